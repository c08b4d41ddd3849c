"""Bodies from segmented images: where the contour lies, to a fraction of a pixel, and what is refused."""

from __future__ import annotations

import importlib.util
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from multiphase.errors import ParameterError
from multiphase.scene import parse_scene
from tumour.fem.bodies import body_of
from tumour.geometry import TumourGeometry
from tumour.meshes import images, outlines_of_image
from tumour.meshes.images import trace
from tumour.meshes.polygons import signed_area

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"

pytestmark = pytest.mark.skipif(importlib.util.find_spec("skimage") is None, reason="scikit-image is not installed")


def pixels(size: int = 120) -> tuple[np.ndarray, np.ndarray]:
    """x and y of the centres of the pixels of a square image."""
    x, y = np.meshgrid(np.arange(size) + 0.5 - size / 2, size / 2 - np.arange(size) - 0.5)
    return x, y


def disk(radius: float, x: float = 0.0, y: float = 0.0, size: int = 120) -> np.ndarray:
    columns, rows = pixels(size)
    return np.hypot(columns - x, rows - y) < radius


def saved(folder: Path, mask: np.ndarray, name: str = "mask.npy") -> Path:
    np.save(folder / name, mask)
    return folder / name


def radius_of(loop: np.ndarray) -> float:
    return float(np.sqrt(abs(signed_area(loop)) / np.pi))


# where the contour lies

PLACES = [(0.0, 0.0), (0.5, 0.5), (0.3, 0.1), (0.21, -0.37)]


@pytest.mark.parametrize(("x", "y"), PLACES)
@pytest.mark.parametrize("smoothing", [0.0, 1.0])
def test_a_disk_of_40_pixels_to_below_a_tenth_of_one(tmp_path: Path, smoothing: float, x: float, y: float) -> None:
    """Found: the radius by the area to 0.07 pixels, 0.06 of which are the mask's own; each point to half a pixel, as the steps are."""
    mask = disk(40.0, x, y)
    (loop,) = outlines_of_image(saved(tmp_path, mask), 0.1, smoothing)
    assert radius_of(loop) == pytest.approx(4.0, abs=0.007)
    apart = np.hypot(*(loop - (0.1 * x, 0.1 * y)).T)
    assert apart.mean() == pytest.approx(4.0, abs=0.006)
    assert np.abs(apart - 4.0).max() < 0.051
    # the area of the pixels, less an eighth for each of the four corners by which more point outwards than inwards, and less pi sigma^2;
    # found with smoothing: 0.14 pixels more than that, as linear interpolation between rounded values is another thing
    assert 100.0 * signed_area(loop) == pytest.approx(mask.sum() - 0.5 - np.pi * smoothing**2, abs=1e-9 + 0.2 * smoothing)


@pytest.mark.parametrize("smoothing", [1.0, 2.0, 4.0])
def test_smoothing_moves_a_curved_contour_inwards(tmp_path: Path, smoothing: float) -> None:
    """By sigma^2/(2 R): the area shrinks by pi sigma^2, whatever the shape, and grows by as much for a hole."""
    for mask, bodies in ((disk(40.0), 1), (disk(50.0) & ~disk(30.0), 0)):
        file = saved(tmp_path, mask)
        plain, smooth = (sum(map(signed_area, outlines_of_image(file, 1.0, sigma))) for sigma in (0.0, smoothing))
        assert smooth - plain == pytest.approx(-np.pi * smoothing**2 * bodies, abs=0.03 * np.pi * smoothing**2 + 0.1)
    (loop,) = outlines_of_image(saved(tmp_path, disk(40.0)), 1.0, smoothing)
    (rough,) = outlines_of_image(saved(tmp_path, disk(40.0)), 1.0, 0.0)
    assert radius_of(rough) - radius_of(loop) == pytest.approx(smoothing**2 / 80.0, rel=0.05)


def test_the_middle_of_the_image_is_the_origin_and_y_points_up(tmp_path: Path) -> None:
    mask = np.zeros((30, 50))
    mask[4:10, 30:44] = 1  # rows from the top
    (loop,) = outlines_of_image(saved(tmp_path, mask), 0.5, 0.0)
    np.testing.assert_allclose(loop.min(axis=0), [(30 - 25) * 0.5, (15 - 10) * 0.5], rtol=1e-12)
    np.testing.assert_allclose(loop.max(axis=0), [(44 - 25) * 0.5, (15 - 4) * 0.5], rtol=1e-12)
    assert signed_area(loop) == pytest.approx(0.25 * (6 * 14 - 0.5))


def test_holes_and_specks(tmp_path: Path) -> None:
    mask = disk(40.0) & ~disk(6.0, -20.0) & ~disk(10.0, 15.0, 5.0)
    clean = outlines_of_image(saved(tmp_path, mask), 1.0)
    assert [np.sign(signed_area(loop)) for loop in clean] == [1.0, -1.0, -1.0]
    assert [radius_of(loop) for loop in clean] == pytest.approx([40.0, 10.0, 6.0], abs=0.15)
    np.testing.assert_allclose((clean[1].min(axis=0) + clean[1].max(axis=0)) / 2.0, (15.0, 5.0), atol=0.1)
    mask[3, 4:6] = mask[118, 0] = True  # two specks, one at the border, and one dark one, across a corner
    mask[80, 60] = mask[81, 61] = False
    traced = trace(saved(tmp_path, mask), 1.0)
    for loop, other in zip(traced.loops, clean, strict=True):
        assert np.array_equal(loop, other)
    assert traced.origin == (
        f"from mask.npy: 120 x 120 pixels of 1, smoothed by 1 pixel, area {sum(map(signed_area, clean)):.4g} (mask {mask.sum() - 1:.4g}), "
        "2 holes; 3 specks left out"
    )
    with pytest.raises(ParameterError, match=r"^geometry\.file: mask\.npy shows 2 separate bodies, with 99\.9 %, 0\.0435 % of the area"):
        trace(saved(tmp_path, mask), 1.0, smallest=3e-4)


def test_bodies_hang_together_by_sides_and_gaps_by_corners(tmp_path: Path) -> None:
    mask = np.zeros((60, 60), dtype=bool)
    mask[10:30, 10:30] = mask[30:50, 30:50] = True
    with pytest.raises(ParameterError, match=r"shows 2 separate bodies, with 50 %, 50 % of the area"):
        trace(saved(tmp_path, mask), 1.0)
    mask[10:50, 10:50] = True
    mask[20:30, 20:30] = False
    assert len(outlines_of_image(saved(tmp_path, mask), 1.0, 0.0)) == 2
    mask[np.arange(10, 20), np.arange(10, 20)] = False  # a way out across corners
    assert len(outlines_of_image(saved(tmp_path, mask), 1.0, 0.0)) == 1


def test_specks_that_smoothing_makes(tmp_path: Path) -> None:
    """A grain on a short thread comes off, and a pit behind a short channel closes: both are left out where they are small."""
    grain = changed(changed(disk(38.0), 60, slice(98, 101), True), slice(59, 62), slice(101, 103), True)
    pit = changed(changed(disk(40.0), 60, slice(97, 101), False), slice(59, 62), slice(95, 97), False)
    for mask, plain in ((grain, disk(38.0)), (pit, disk(40.0))):
        traced = trace(saved(tmp_path, mask), 1.0, smallest=5e-3)
        assert len(traced.loops) == 1
        assert traced.origin.endswith("; 1 speck left out")
        (loop,) = outlines_of_image(saved(tmp_path, plain), 1.0)
        assert signed_area(traced.loops[0]) == pytest.approx(signed_area(loop), abs=6.0)
        with pytest.raises(ParameterError, match=r"would part the body .* in two near|would close"):
            trace(saved(tmp_path, mask), 1.0, smallest=1e-4)


def test_what_is_around_is_no_speck(tmp_path: Path) -> None:
    (loop,) = outlines_of_image(saved(tmp_path, disk(55.0)), 1.0, smallest=0.9)
    assert radius_of(loop) == pytest.approx(55.0, abs=0.1)


# what an image may be; more of it in tests/multiphase/test_pictures.py


def test_the_same_mask_in_many_forms(tmp_path: Path) -> None:
    mask = disk(30.0, 3.0, 2.0, 90) & ~disk(9.0, 3.0, 2.0, 90)
    wanted = outlines_of_image(saved(tmp_path, mask), 0.1)
    grey = 255 * mask.astype(np.uint8)
    colour = np.stack((grey, grey, np.where(mask, 0, 200).astype(np.uint8)), axis=-1)  # means 170 and 67
    forms = {"grey.png": grey, "ones.png": mask.astype(np.uint8), "colour.png": colour, "deep.tiff": grey.astype(np.uint16) * 257}
    for name, values in forms.items():
        Image.fromarray(values).save(tmp_path / name)
    np.save(tmp_path / "float.npy", mask * 0.9)
    for name in (*forms, "float.npy"):
        for loop, other in zip(outlines_of_image(tmp_path / name, 0.1), wanted, strict=True):
            assert np.array_equal(loop, other), name


def test_threshold(tmp_path: Path) -> None:
    x, y = pixels()
    file = saved(tmp_path, np.clip(1.0 - np.hypot(x, y) / 50.0, 0.0, 1.0))
    for threshold in (0.3, 0.5, 0.8):
        (loop,) = outlines_of_image(file, 1.0, threshold=threshold)
        assert radius_of(loop) == pytest.approx(50.0 * (1.0 - threshold), abs=0.15)
    for threshold in (0.0, 1.0, -2.0, np.nan):
        with pytest.raises(ParameterError, match=r"^geometry\.threshold: .* must be greater than 0 and below 1\.$"):
            outlines_of_image(file, 1.0, threshold=threshold)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"pixel": 0.0}, "pixel: 0 must be a finite number greater than 0"), ({"smoothing": -1.0}, "smoothing: -1 is not allowed"),
        ({"smoothing": np.nan}, "smoothing: nan is not allowed"), ({"smallest": 1.0}, "smallest: 1 is not allowed"),
    ],
)  # fmt: skip
def test_values_that_are_refused(tmp_path: Path, values: dict[str, float], message: str) -> None:
    with pytest.raises(ParameterError, match=rf"^geometry\.{message}"):
        outlines_of_image(saved(tmp_path, disk(20.0)), **{"pixel": 1.0, **values})


# what is refused


def one_wide() -> np.ndarray:
    """Two disks, with a bridge of a pixel between them."""
    mask = disk(20.0, -25.0) | disk(20.0, 25.0)
    mask[60, 40:80] = True
    return mask


def changed(mask: np.ndarray, rows: int | slice, columns: int | slice, value: bool) -> np.ndarray:
    mask = mask.copy()
    mask[rows, columns] = value
    return mask


TOUCHES = "the body touches the upper side of mask.npy; add an empty margin of a pixel to take the cut for its surface"


@pytest.mark.parametrize(
    ("mask", "smoothing", "message"),
    [
        (disk(0.0), 1.0, r"no pixel of mask\.npy is brighter than 0\.5, and the brightest has 0 of white"),
        (disk(40.0).astype(np.uint8) * 4, 1.0, r"no pixel of mask\.npy is brighter than 0\.5, and the brightest has 0\.0157 of white"),
        (disk(40.0, 0.0, 25.0), 1.0, TOUCHES),
        (disk(70.0), 1.0, r"the body touches the upper, lower, left and right sides of mask\.npy; .*, or invert the image"),
        (~disk(40.0), 1.0, r"the body touches the upper, lower, left and right sides of mask\.npy; .*, or invert the image"),
        (disk(20.0, -25.0) | disk(15.0, 25.0), 1.0, r"mask\.npy shows 2 separate bodies, with 63\.8 %, 36\.2 % of the area; leave"),
        (one_wide(), 1.0, r"smoothing by 1 pixel would part the body .* near \(-?\d\.5, -0\.5\) \(row 61, column \d+\), .* 2 pixels wide"),
        (changed(disk(40.0), 60, slice(90, 117), True), 1.0, r"the part of .* near \(56\.5, -0\.5\) .* too narrow .* would vanish; make"),
        (changed(disk(40.0), 60, slice(60, 120), False), 1.0, r"the gap of .* near \(0\.5, -0\.5\) .* too narrow .* would close; make"),
        (changed(disk(40.0), 60, slice(40, 80), False), 1.0, r"the hole of .* at \(-19\.5, -0\.5\) .* too narrow .* would vanish; fill it"),
        (changed(disk(40.0) & ~disk(10.0, 25.0), 60, slice(90, 120), False), 1.0, r"the gap of .* near \(3\d\.5, -0\.5\) .* would close"),
        (changed(disk(40.0), slice(50, 70), [*range(84, 88), *range(89, 93)], False), 1.0, r"the wall of .* near \(28\.5, .* too thin for"),
        (changed(disk(0.0), 60, slice(40, 80), True), 1.0, r"the body of mask\.npy is too narrow for smoothing by 1 pixel and"),
    ],
    ids=[
        "empty", "labels", "upper side", "full", "dark", "two bodies", "bridge", "whisker", "notch", "slit", "keyhole", "wall", "line",
    ],
)  # fmt: skip
def test_masks_that_are_refused(tmp_path: Path, mask: np.ndarray, smoothing: float, message: str) -> None:
    with pytest.raises(ParameterError, match=rf"^geometry\.file: {message}") as refusal:
        outlines_of_image(saved(tmp_path, mask), 1.0, smoothing, smallest=5e-4)
    assert len(re.findall(r"\.(?: |$)", str(refusal.value))) == 1


def test_narrow_parts_without_smoothing_are_the_size_s_affair(tmp_path: Path) -> None:
    """A bridge of a pixel stays, and the triangles do not fit in; two disks with a bridge of ten are filled."""
    file = saved(tmp_path, one_wide())
    with pytest.raises(ParameterError, match=r"^solver\.cells: with 6 cells .* is too large near \(-?\d\.\d+, -\d\.?\d*\): .* More cells"):
        body_of(TumourGeometry(kind="outline", file=str(file), pixel=1.0, smoothing=0.0), 6)
    file = saved(tmp_path, changed(one_wide(), slice(54, 66), slice(40, 80), True), "wide.npy")
    body = body_of(TumourGeometry(kind="outline", file=str(file), pixel=1.0), 6)
    assert body.quality.least_angle >= 20.0
    assert body.quality.pinned == 0


def test_files_that_cannot_be_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "text.png").write_text("no picture")
    saved(tmp_path, np.full((4, 4), 1000.0))
    for name, message in (
        ("none.png", r"there is no file '.*none\.png'"), ("text.png", "'.*' cannot be read as an image"),
        ("mask.npy", r"mask\.npy has values of the type float64 from 1000 to 1000, so that white is not known"),
    ):  # fmt: skip
        with pytest.raises(ParameterError, match=rf"^geometry\.file: {message}"):
            outlines_of_image(tmp_path / name, 1.0)
    monkeypatch.setattr(images, "MOST_PIXELS", 899)
    with pytest.raises(ParameterError, match=r"^geometry\.file: mask\.npy has 30 rows of 30 pixels, and at most 899 are read"):
        outlines_of_image(saved(tmp_path, disk(10.0, size=30)), 1.0)


def test_without_scikit_image_it_says_what_to_install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("skimage", "skimage.measure"):
        monkeypatch.setitem(sys.modules, name, None)
    with pytest.raises(ParameterError, match=r'^geometry\.file: .*pip install "multiphase-tissue\[image\]"$'):
        outlines_of_image(saved(tmp_path, disk(30.0)), 1.0)


def test_neither_scikit_image_nor_pillow_is_imported_early() -> None:
    code = "import sys, tumour.meshes; sys.exit('skimage' in sys.modules or 'PIL' in sys.modules and 2)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


# scenes and bodies


def test_a_body_from_the_shipped_mask() -> None:
    geometry = TumourGeometry(kind="outline", file=str(EXAMPLES / "tumour_mask.png"), pixel=0.02)
    assert (geometry.smoothing, geometry.threshold, geometry.smallest) == (1.0, 0.5, 1e-3)
    body = body_of(geometry, 8)
    assert list(body.sides) == ["surface", "outer", "hole 1"]
    assert body.quality.least_angle >= 20.0
    assert body.quality.pinned == 0
    assert not body.is_round
    mask = np.asarray(Image.open(EXAMPLES / "tumour_mask.png")) > 127
    assert body.area == pytest.approx(mask.sum() * 0.02**2, rel=5e-3)
    assert body.origin == "from tumour_mask.png: 160 x 128 pixels of 0.02, smoothed by 1 pixel, area 2.592 (mask 2.592), 1 hole"
    assert body_of(TumourGeometry(kind="glioma"), 6).origin == ""


def test_the_examples_images_are_drawn_by_their_script(tmp_path: Path) -> None:
    spec = importlib.util.spec_from_file_location("draw_tumour_mask", EXAMPLES / "draw_tumour_mask.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    module.main(tmp_path)
    for name in ("tumour_mask.png", "tumour_permeability.png"):
        drawn, stored = (np.asarray(Image.open(folder / name)).astype(int) for folder in (tmp_path, EXAMPLES))
        assert np.abs(drawn - stored).max() <= (0 if "mask" in name else 1)  # a grey value on the edge of two may be rounded either way
        assert drawn.shape == (128, 160)


def test_a_changed_image_is_read_anew(tmp_path: Path) -> None:
    areas = []
    for radius in (20.0, 30.0):
        file = saved(tmp_path, disk(radius))
        areas.append(body_of(TumourGeometry(kind="outline", file=str(file), pixel=0.1), 4).area)
    assert areas[1] / areas[0] == pytest.approx(2.25, rel=0.02)


def test_a_scene_with_an_image_goes_round() -> None:
    text = f'[scene]\nmodel = "tumour"\n[geometry]\nkind = "outline"\nfile = "{EXAMPLES.as_posix()}/tumour_mask.png"\npixel = 0.02\n'
    scene = parse_scene(text + "smallest = 0.01\n[time]\nend = 1.0\n", name="mine")
    table = scene.to_table()["geometry"]
    assert (table["pixel"], table["smoothing"], table["threshold"], table["smallest"]) == (0.02, 1.0, 0.5, 0.01)
    assert parse_scene(scene.to_toml(), name="again").geometry == scene.geometry


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"kind": "outline", "file": "a.png"}, r"pixel: is missing: give the side of a pixel"),
        ({"kind": "outline", "file": "a.csv", "pixel": 0.1}, r'pixel: has no meaning for kind = "outline" from a \.csv file'),
        (
            {"kind": "outline", "points": [(0, 0), (1, 0), (0, 1)], "smoothing": 0.1},
            r'smoothing: has no meaning for kind = "outline": only',
        ),
        ({"kind": "disk", "threshold": 0.4}, r'threshold: has no meaning for kind = "disk": only an outline from an image'),
        ({"kind": "mesh", "file": "a.msh", "smallest": 0.4}, r'smallest: has no meaning for kind = "mesh"'),
        ({"kind": "outline", "file": "a.png", "pixel": 0.0}, r"pixel: 0 is not allowed"),
        (
            {"kind": "outline", "file": "a.TIF", "pixel": 1.0, "threshold": 1.0},
            r"threshold: 1 is not allowed; .* greater than 0 and below 1",
        ),
        ({"kind": "outline", "file": "a.npy", "pixel": 1.0, "smoothing": -1.0}, r"smoothing: -1 is not allowed"),
        ({"kind": "outline", "file": "a.png", "pixel": 1.0, "smallest": 1.0}, r"smallest: 1 is not allowed"),
        ({"kind": "outline", "file": "a.png", "points": [(0, 0)], "pixel": 1.0}, r"points: the outline is read from a file"),
    ],
)
def test_what_goes_with_an_image_alone(values, message: str) -> None:
    with pytest.raises(ParameterError, match=rf"^geometry\.{message}"):
        TumourGeometry(**values)
