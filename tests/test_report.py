"""The report of speed against accuracy: its pages say what its files say, and its parts measure what they claim."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pytest

from benchmarks.plaque_reference import solve
from benchmarks.report import pages, pictures, plane, plaque, radial, work
from benchmarks.report.__main__ import RESULTS, ROOT
from benchmarks.report.blocks import BLOCKS
from benchmarks.report.ratios import equal
from benchmarks.report.tables import read, write
from benchmarks.report.words import Files, digits, seconds, short, times
from plaque1d.lines_scheme import RadauLines
from tumour.schemes import ElasticRadau


def test_pages_say_what_the_files_say() -> None:
    """Numbers in README, VERIFICATION and docs come from benchmarks/results: `python -m benchmarks.report --pages` writes them."""
    assert pages.stale(ROOT, RESULTS) == []


def test_a_page_changed_by_hand_is_found(tmp_path: Path) -> None:
    page = tmp_path / "README.md"
    page.write_text("It runs on <!-- report: machine -->a fast one<!-- /report -->.", encoding="utf-8")
    text, changed = pages.filled(page.read_text(encoding="utf-8"), Files(RESULTS))
    assert changed == ["machine"]
    assert text == f"It runs on <!-- report: machine -->{read(RESULTS / 'equal.csv')[0][0]}<!-- /report -->."
    assert pages.filled(text, Files(RESULTS)) == (text, [])


def test_every_block_is_used() -> None:
    names = {name for page in pages.pages(ROOT) for _, name, _, _ in pages.MARK.findall(page.read_text(encoding="utf-8"))}
    assert names == set(BLOCKS)


def test_numbers_are_written_plainly() -> None:
    assert [digits(value) for value in (0.0123456, 1.0, 99.96, 12345.0)] == ["0.0123", "1.00", "100", "12300"]
    assert [seconds(value) for value in (0.00159, 0.0995, 31.62)] == ["1.59 ms", "0.0995 s", "31.6 s"]
    assert [short(value) for value in (4.44e-4, 1e-5, 0.5)] == ["4.4e-4", "1e-5", "5e-1"]
    assert [times(value) for value in (1.0, 9.96, 2183.3)] == ["1.0", "10", "2200"]


def test_files_are_read_as_they_were_written(tmp_path: Path) -> None:
    rows = [{"code": "a, b", "error": 0.1 + 0.2, "steps": 3, "change": None}, {"code": "c", "error": math.nan, "more": 1e-300}]
    write(tmp_path / "x.csv", ["made by hand", "today"], rows)
    about, found = read(tmp_path / "x.csv")
    assert about == ["made by hand", "today"]
    assert found[0] == {"code": "a, b", "error": 0.1 + 0.2, "steps": 3, "change": None, "more": None}
    assert math.isnan(found[1]["error"])
    assert found[1]["more"] == 1e-300


def row(code: str, seconds: float, error: float, setting: str = "rtol 1e-03") -> dict[str, Any]:
    return {"problem": "interfacial", "code": code, "size": 50, "setting": setting, "seconds": seconds, "error": error}


def test_equal_error_takes_the_fastest_setting_that_is_accurate_enough() -> None:
    """Not by luck: where a finer run of the code misses the error, none that is coarser counts."""
    settings = (("rtol 1e-01", 0.5, 4e-4), ("rtol 1e-02", 1.0, 6e-4), ("rtol 1e-03", 2.0, 5e-4), ("rtol 1e-04", 3.0, 1e-4))
    rows = [row("a", seconds, error, setting) for setting, seconds, error in settings]
    rows += [row("b", 8.0, 1e-5, "260 steps"), row("b", 4.0, 2e-4, "130 steps"), row("c", 0.1, 1e-2, "dt 0.5"), row("d", 5.0, 3e-4, "dt 1")]
    before = [{"target": "interfacial: 0.0005", "code": "b", "size": 50, "setting": "130 steps", "ratio": 2.5}]
    before += [{"target": "interfacial: 0.0005", "code": "d", "size": 50, "setting": "dt 0.1", "ratio": 9.0}]  # another setting
    found = [each for each in equal({"plaque": rows}, before) if each["target"] == "interfacial: 0.0005"]
    expected = [("a", "rtol 1e-03", 1.0), ("b", "130 steps", 2.0), ("d", "dt 1", 2.5)]
    assert [(each["code"], each["setting"], each["ratio"]) for each in found] == expected
    assert found[0]["change"] is found[2]["change"] is None
    assert found[1]["change"] == pytest.approx(-0.2)
    assert equal({"plaque": rows}, found, "ratio_before")[1]["change"] == pytest.approx(-0.2)  # a part measured again
    assert work.front(rows) == [True, False, False, True, True, False, True, False]
    assert [work.fineness(text) for text in ("rtol 1e-03", "dt 0.5", "260 steps")] == [-1e-3, -0.5, 260.0]


def test_the_observed_order_is_the_one_of_the_errors() -> None:
    assert work.order([8.0, 2.0, 0.5 / 4.0], [10, 20, 40]) == pytest.approx([2.0, 4.0])


def test_a_run_is_repeated_as_often_as_it_is_short() -> None:
    for length, count in ((0.05, 9), (0.5, 5), (5.0, 3), (50.0, 1)):
        calls = iter([("first", length), *(("later", length * k) for k in range(2, 20))])
        answer, middle, runs = work.repeated(lambda calls=calls: next(calls))
        assert (answer, runs) == ("first", count)
        assert middle == pytest.approx(length * (count + 1) / 2)  # the median of 1, 2, ... count lengths


def test_the_plaques_errors_fall_with_the_square_of_the_cells(monkeypatch: pytest.MonkeyPatch) -> None:
    """And `plaque.csv` has what the page shows of it. Against 400 cells, whose own error is a 64th of that of 50."""
    monkeypatch.setattr("benchmarks.plaque_reference.FINE", 400)
    monkeypatch.setattr(plaque, "time_errors", list)
    settings = [(25, 1e-6), (50, 1e-6)]
    monkeypatch.setattr(plaque, "codes", lambda: iter([("interfacial", "lines", plaque.own(RadauLines, "interfacial"), settings, None)]))
    from benchmarks import plaque_reference

    plaque_reference.reference.cache_clear()
    try:
        rows = plaque.measure()["plaque"]
    finally:
        plaque_reference.reference.cache_clear()
    assert [each["size"] for each in rows] == [25, 50]
    assert all(each["seconds"] > 0.0 and each["steps"] > 10 for each in rows)
    assert work.order([each["error"] for each in rows], [25, 50])[0] == pytest.approx(2.0, abs=0.2)  # 1.95 observed
    assert rows[1]["error"] == pytest.approx(3.6e-4, rel=0.05)  # of the converged answer, docs/speed-and-accuracy.md


def test_the_radial_errors_are_those_of_the_papers_disk(monkeypatch: pytest.MonkeyPatch) -> None:
    """R(60) = 5.0635312, alpha(0) = 0.6751270, C(0) = 0.1820739, converged; one row on 50 cells."""
    exact = [5.0635312, 0.6751270, 0.1820739]
    monkeypatch.setattr(radial, "reference", lambda kind, shape: exact)
    monkeypatch.setattr(radial, "problems", lambda: iter([("elastic disk", "disk", [(radial.DEFAULT, ElasticRadau, [(50, 1e-4)], False)])]))
    monkeypatch.setattr(radial, "time_errors", list)
    (found,) = radial.measure()["radial"]
    assert found["setting"] == "rtol 1e-04"
    assert found["error"] == max(found[f"error_{name}"] for name in ("R", "alpha", "C"))
    assert 5e-4 < found["error"] < 2e-3  # of second order from 3.2e-4 on 100 cells


def test_errors_in_two_dimensions_are_those_against_the_radial_solution(monkeypatch: pytest.MonkeyPatch) -> None:
    """To t = 2 here. Radii differ between meshes by errors of order two, from which differences of three are free of those of the steps."""
    from tumour import simulate

    monkeypatch.setattr(plane, "TIMES", (0.5, 1.0, 2.0))
    exact = plane.profiles(simulate(plane.PAPER, t_end=2.0, geometry="quarter_disk", cells=200, rtol=1e-6, save_at=plane.TIMES))
    monkeypatch.setattr(plane, "reference", lambda: exact)
    options: Any = {"parameters": plane.PAPER}
    line = plane.measured("radial", 50, "rtol 1e-06", geometry="quarter_disk", cells=50, rtol=1e-6, **options).row()
    assert line["error_2"] < 1e-3
    found = [
        plane.measured("BDF2", rings, "dt 0.05", geometry=plane.QUARTER, cells=rings, time_scheme="bdf2", dt=0.05, **options).row()
        for rings in (6, 12, 24)
    ]
    a, b, c = (each["R60"] for each in found)  # the third of the times
    assert math.log2((a - b) / (b - c)) == pytest.approx(2.0, abs=0.1)  # 1.98 observed
    for each in found:
        assert each["error_2"] == max(each[f"error_{name}_2"] for name in plane.NAMES)
        assert each["error_R_2"] == pytest.approx(abs(each["R60"] / exact[2.0][0] - 1.0), rel=1e-12)
    assert found[0]["error_d_2"] == pytest.approx(6.4e-4, rel=0.05)  # of its length, of six rings, against 400 radial cells


def test_the_pictures_are_drawn_from_the_files(tmp_path: Path) -> None:
    """Every point of the files is in them."""
    for name in ("plaque", "radial", "plane"):
        rows = read(RESULTS / f"{name}.csv")[1]
        figure = getattr(pictures, name)(rows)
        drawn = {(float(x), float(y)) for axes in figure.axes for line in axes.get_lines() for x, y in zip(*line.get_data(), strict=True)}
        for axes, (problem, key) in zip(figure.axes, PANELS[name], strict=True):
            assert axes.get_xlabel().endswith("[s]")
            wanted = {(each["seconds"], each[key]) for each in rows if problem in (None, each["problem"])}
            assert wanted <= drawn
    pictures.write(RESULTS, tmp_path / "figures")
    assert {path.name for path in (tmp_path / "figures").iterdir()} == {"plaque.png", "radial.png", "plane.png", "size.png"}


PANELS: dict[str, list[tuple[str | None, str]]] = {
    "plaque": [("interfacial", "error"), ("drag", "error")],
    "radial": [("elastic disk", "error"), ("viscous disk", "error"), ("viscous sphere", "error")],
    "plane": [(None, "error_40"), (None, "error_60")],
}


def test_the_reference_problem_is_that_of_the_peers() -> None:
    """The files in benchmarks/peers repeat its parameters: one of them, and this package, give the same n to the error of 50 cells."""
    from benchmarks.peers import scipy_bdf

    theirs = scipy_bdf.solve(50, 1e-6)
    scheme, state, _ = solve(50, 1e-6)
    from benchmarks.plaque_reference import fraction, width

    assert float(abs(theirs["n"] - fraction(scheme, state)).mean()) < 1e-4  # both discretise alike but for the wall: 3.6e-4 is the error
    assert theirs["L"] == pytest.approx(width(scheme, state), rel=1e-4)
