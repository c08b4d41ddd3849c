"""The examples run, small, and say what they should."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import numpy as np
import pytest

EXAMPLES = Path(__file__).resolve().parent.parent / "examples"


def _load(name):
    spec = importlib.util.spec_from_file_location(name, EXAMPLES / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(autouse=True)
def _in_a_folder_of_its_own(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def test_every_example_is_short_and_tested():
    found = {path.stem: len(path.read_text(encoding="utf-8").splitlines()) for path in EXAMPLES.glob("*.py")}
    assert set(found) == {
        "first_plaque", "drag_or_interfacial", "hdl_removes_modldl", "mouse_and_human", "stability_of_the_plaque", "plaque_in_a_vessel",
        "first_tumour", "tumour_switches", "quarter_disk_2d", "glioma", "anisotropic_tumour", "tumour_from_image", "draw_tumour_mask",
        "stability_of_the_disk",
    }  # fmt: skip
    assert max(found["first_plaque"], found["first_tumour"]) <= 30
    assert max(found["quarter_disk_2d"], found["glioma"] - 20) <= 40
    assert max(found["anisotropic_tumour"], found["tumour_from_image"]) <= 60
    assert max(found.values()) <= 120


def test_first_plaque(capsys):
    # 40 cells at t = 4 against 1.4967 of 800 cells: the mesh error there is below 0.01
    assert _load("first_plaque").main(cells=40, t_end=4.0) == pytest.approx(1.4967, abs=0.01)
    assert "necrotic" in capsys.readouterr().out
    assert Path("first_plaque.png").stat().st_size > 10_000


def test_drag_or_interfacial():
    results = _load("drag_or_interfacial").main(cells=16, t_end=2.0)
    widths = {name: result["L"][-1] for name, result in results.items()}
    # more pressure at the outer wall spreads the necrotic phase, leaves more macrophages inside and more growth
    assert widths["drag, p_out = 2A"] > widths["drag, p_out = A"] > widths["interfacial"] > 1.2
    assert Path("drag_or_interfacial.png").exists()


def test_hdl_slows_growth():
    plain, treated = _load("hdl_removes_modldl").main(cells=8, t_end=0.3)
    growth = [result["L"][-1] - 1.0 for result in (plain, treated)]
    assert 0.0 < growth[1] < 0.97 * growth[0]
    assert np.all(treated["hdl"][-1] > 0.0)
    assert np.abs(treated["defect_l"]).max() < 1e-11  # the balance counts what HDL takes
    assert Path("hdl_removes_modldl.png").exists()


def test_mouse_and_human_grow_at_the_rates_they_were_chosen_for():
    results = _load("mouse_and_human").main(cells=16, fraction=0.2)
    mouse, human = results["mouse"], results["human"]
    assert mouse.unit("L_rate") == "µm/week"
    assert human.unit("L_rate") == "µm/year"
    # within a factor 2 of 6 µm a week (assumed for mice on an atherogenic diet) and 11.8 µm a year (measured, carotid intima-media, MESA)
    assert 3.0 < mouse["L_rate"][-1] < 12.0
    assert 6.0 < human["L_rate"][-1] < 24.0


def test_stability_of_the_plaque(capsys):
    modes = _load("stability_of_the_plaque").main()
    sigma = 0.1 / 1.02
    shortest, finite = modes["drag"], modes["drag, viscosity x 100"]
    assert shortest.wavelength == 0.0
    assert shortest.rate == pytest.approx(0.4 * sigma / 0.01 - 0.02, rel=1e-12)  # ((1 - 2n) Sigma - p_out) / nu - k_m l
    assert finite.wavelength == pytest.approx(2.5875, abs=1e-3)  # by brute force, tests/plaque1d/test_stability.py
    assert finite.rate > 0.4 * sigma / 1.0 - 0.02
    assert not modes["drag, p_out = A"].grows
    assert not modes["interfacial"].grows
    said = capsys.readouterr().out
    assert "most dangerous wavelength 2.587," in said
    assert f"{0.4 * sigma:.4g}" in said
    assert Path("stability_of_the_plaque.png").stat().st_size > 10_000


def test_plaque_in_a_vessel(capsys):
    results = _load("plaque_in_a_vessel").main(cells=40, t_end=4.0)
    said = capsys.readouterr().out
    assert results[None]["L"][-1] == pytest.approx(1.4967, abs=0.01)  # as in test_first_plaque
    widths = {radius: float(result["L"][-1]) for radius, result in results.items()}
    assert widths[None] > widths[20.0] > widths[5.0] > widths[1.0] > 1.1
    # W = L (R + L/2), so W' = R Psi_m l(R) gives L' = Psi_m l(R) R / (R + L): half of the slab's for R = L = 1, were l(R) the same
    assert 0.4 < (widths[1.0] - 1.0) / (widths[None] - 1.0) < 0.6
    for radius in (20.0, 5.0, 1.0):
        # cells of equal area: their mean is the mean over the wall
        assert f"lumen {radius:4g}, outer wall {radius + widths[radius]:6.3f}  L = {widths[radius]:.3f}, " in said
        assert f"L = {widths[radius]:.3f}, {results[radius]['n'][-1].mean():.1%} necrotic" in said
    assert Path("plaque_in_a_vessel.png").stat().st_size > 10_000


def test_first_tumour(capsys):
    # 40 cells at t = 20 against 2.16999 of 200 cells, whose own error is below 1e-4: the mesh error falls as 1/cells^2
    assert _load("first_tumour").main(cells=40, t_end=20.0) == pytest.approx(2.1700, abs=2e-3)
    assert "necrotic core" in capsys.readouterr().out
    assert Path("first_tumour.png").stat().st_size > 10_000


def test_tumour_switches(capsys):
    rows = {(row.case.group, row.case.name): row for row in _load("tumour_switches").main(cells=50, t_end=60.0)}
    said = capsys.readouterr().out
    base = rows["base", "the paper's disk"]
    assert base.radius == pytest.approx(5.0633, abs=5e-3)
    change = {key: row.radius - base.radius for key, row in rows.items()}
    assert change["mobility", "darcy, (1 - alpha)/(kappa alpha)"] < -0.2  # fluid flows less easily
    assert change["lambda_alpha", "1"] < change["lambda_alpha", "0.3"] < -1.0  # cells resist to being swollen
    assert change["geometry", "slab"] < 0.0 < change["geometry", "sphere"]
    assert change["rheology", "viscous"] > 1.0  # which forgets its shape at rest
    # backward Euler errs to one side by its first order, 0.0229 here; as printed it makes or loses cells beside that
    euler, printed = rows["time step", "backward Euler, 0.5"], rows["time step", "the same, alpha as printed"]
    assert euler.radius - base.radius == pytest.approx(0.028, abs=1e-3)
    assert euler.defect < 1e-11 < 1e-4 < printed.defect
    assert f"cells off by {printed.defect:.1e}" in said
    assert len(Path("tumour_switches.csv").read_text(encoding="utf-8").splitlines()) == len(rows) + 1


def test_quarter_disk_2d(capsys):
    plane, radial = _load("quarter_disk_2d").main(cells=8, t_end=20.0)
    assert radial == pytest.approx(2.2201, abs=1e-4)
    assert plane == pytest.approx(radial, rel=1e-3)  # 4e-4: half of it of 8 rings, half of rtol
    said = capsys.readouterr().out
    assert f"  20 {plane:14.4f} {radial:8.4f} " in said
    assert "128 triangles" in said
    assert Path("quarter_disk_2d.png").stat().st_size > 10_000


def test_glioma(capsys):
    results = _load("glioma").main(cells=4)
    soft, stiff = results[0.0], results[1.0]
    assert (soft.status, stiff.status) == ("failed", "completed")
    assert 40.0 < soft.t[-1] < 80.0  # as in tests/tumour/fem/test_glioma.py
    said = capsys.readouterr().out
    assert "lambda_alpha = 0: failed, " in said
    assert "has lost its stability" in said
    assert f"{len(soft.t)} rows are stored, to t = {soft.t[-1]:g}" in said
    assert "lambda_alpha = 1: completed, " in said
    assert stiff.t[-1] == 100.0
    assert stiff["area"][-1] == pytest.approx(8.624, rel=5e-3)  # of 20 triangles to the radius
    assert said.count("times the median") == 2
    for result in (soft, stiff):
        stress = result["stress_magnitude"][-1]
        assert stress.max() > 4.0 * np.median(stress)
    assert Path("glioma.png").stat().st_size > 10_000


def test_anisotropic_tumour(capsys):
    example = _load("anisotropic_tumour")
    results = example.main(cells=8)
    plain, one_way, around = results.values()
    said = capsys.readouterr().out
    # 1.4731 of 20 and 1.4732 of 40 triangles to the radius
    assert example.elongation(one_way)[-1] == pytest.approx(1.473, abs=2e-3)
    assert "1.473 times as long as wide" in said
    # round to what six sectors of 8 triangles do to a circle of fibres
    assert np.abs(example.elongation(plain) - 1.0).max() < 1e-4
    assert np.abs(example.elongation(around) - 1.0).max() < 1e-3
    assert one_way["area"][-1] > 1.02 * plain["area"][-1]
    # the slope between t = 0.4 and 1.2, where growth is small: what theory leaves out is half of e^2, e up to 0.1, of it
    early = (one_way.t > 0.4) & (one_way.t < 1.2)
    slope = np.polyfit(one_way.t[early], example.elongation(one_way)[early], 1)[0]
    theory = np.diff(example.small_growth(np.array([0.0, 1.0])))[0]
    assert slope == pytest.approx(theory, rel=0.07)
    assert Path("anisotropic_tumour.png").stat().st_size > 10_000


def test_tumour_from_image(capsys):
    results = _load("tumour_from_image").main(cells=6)
    free, bed = results["free"], results["against a bed"]
    areas = [result["area"][-1] for result in (free, bed)]
    # of 10 triangles to the radius: 8.666 and 8.479
    assert areas == pytest.approx([8.67, 8.48], rel=5e-3)
    right = free.mesh.points[:, 0] > 0.9
    moved = [result["displacement"][-1][right, 0].mean() for result in (free, bed)]
    assert moved[1] < 0.5 * moved[0]  # the springs hold the right side
    said = capsys.readouterr().out
    assert f"against a bed: {bed.size()}, area {bed['area'][0]:.3f} -> {bed['area'][-1]:.3f}" in said
    for name in ("tumour_from_image", "tumour_against_a_bed"):
        assert Path(f"{name}.png").stat().st_size > 10_000


def test_stability_of_the_disk(capsys):
    critical = _load("stability_of_the_disk").main(cells=50, dt=0.4, lambdas=(0.0, 0.05, 0.3))
    # 50 cells leave 0.3 of t, more for narrow modes: tests/tumour/test_disk_stability_runs.py has finer ones
    assert critical[0.0].first[0] == pytest.approx(63.6, abs=0.4)
    assert critical[0.05].first == (pytest.approx(73.7, abs=0.4), 4)
    said = capsys.readouterr().out
    gain = float(said.split("-fold as cos(5 theta)")[0].split()[-1])
    assert gain == pytest.approx(10.6, rel=0.1)
    assert "lambda_alpha = 0.05: unstable from t = 73." in said
    assert "lambda_alpha =  0.3: stable to t = 100" in said
    assert Path("stability_of_the_disk.png").stat().st_size > 10_000


def test_the_scene_of_docs_tissue(tmp_path):
    """As it stands there, beside the images of the examples, coarser and shorter."""
    import shutil

    from multiphase.run import run
    from multiphase.scene import load_scene

    text = (EXAMPLES.parent / "docs" / "tissue.md").read_text(encoding="utf-8")
    (tmp_path / "real.toml").write_text(text.split("```toml\n")[1].split("```")[0], encoding="utf-8")
    for name in ("tumour_mask", "tumour_permeability"):
        shutil.copy(EXAMPLES / f"{name}.png", tmp_path)
    result = run(load_scene(tmp_path / "real.toml", ["solver.cells=6", "time.end=1.0"]))
    assert result.status == "completed"
    assert 1.0 < result["area"][-1] / result["area"][0] < 1.2  # held by a clamp and a bed; a free body grows by 22 % in this time
    assert np.abs(result["defect_volume"]).max() < 1e-5
