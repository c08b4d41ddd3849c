"""Brightness of the pixels of image files: kinds of files and of pixels, and what is refused."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from multiphase.errors import ParameterError
from multiphase.pictures import brightness

EIGHT = np.array([[0, 255, 51], [102, 153, 204]], dtype=np.uint8)
SHOWN = np.array([[0.0, 1.0, 0.2], [0.4, 0.6, 0.8]])
"""Shares of white of the pixels above."""

SINGLE = 2.0**-24
"""Largest rounding of a number from 0 to 1 in single precision."""


def read(file: Path, most: int = 100) -> np.ndarray:
    return brightness(file, "some.path", most=most)


def saved(folder: Path, name: str, pixels: np.ndarray, mode: str | None = None) -> Path:
    """The file of some pixels, an array or a picture by its name."""
    if name.endswith(".npy"):
        np.save(folder / name, pixels)
    else:
        image = Image.fromarray(pixels)
        (image if mode is None else image.convert(mode)).save(folder / name)
    return folder / name


def refusal(file: Path, most: int = 100) -> str:
    """The one sentence with which a file is refused, without its path."""
    with pytest.raises(ParameterError) as caught:
        read(file, most)
    message = str(caught.value).removeprefix("some.path: ")
    assert caught.value.path == "some.path"
    assert file.name in message
    assert len(re.findall(r"\.(?: |$)", message)) == 1
    return message


# what is read


@pytest.mark.parametrize("name", ["a.png", "a.tif", "a.bmp", "a.npy", "A.NPY.png"])
def test_8_bits(tmp_path: Path, name: str) -> None:
    assert np.array_equal(read(saved(tmp_path, name, EIGHT)), SHOWN)


@pytest.mark.parametrize(
    ("name", "order"), [("a.png", "<u2"), ("a.tif", "<u2"), ("a.tif", ">u2"), ("a.pgm", "<u2"), ("a.npy", "<u2"), ("a.npy", ">u2")]
)
def test_16_bits(tmp_path: Path, name: str, order: str) -> None:
    assert np.array_equal(read(saved(tmp_path, name, (EIGHT.astype(np.uint16) * 257).astype(order))), SHOWN)


@pytest.mark.parametrize("name", ["a.tif", "a.npy"])
def test_numbers_with_a_point(tmp_path: Path, name: str) -> None:
    np.testing.assert_allclose(read(saved(tmp_path, name, SHOWN.astype(np.float32))), SHOWN, rtol=0, atol=SINGLE)


def test_masks_of_0_and_1(tmp_path: Path) -> None:
    mask = np.array([[0, 1], [1, 0]], dtype=np.uint8)
    for name in ("a.png", "a.npy"):
        for values in (mask, mask.astype(bool), 0 * mask):
            assert np.array_equal(read(saved(tmp_path, name, values)), values)
    for values in (mask.astype(np.int64), mask.astype(np.int8), mask.astype(np.float16)):
        assert np.array_equal(read(saved(tmp_path, "a.npy", values)), mask)
    assert np.array_equal(read(saved(tmp_path, "a.tif", mask.astype(np.int32))), mask)


@pytest.mark.parametrize("ending", ["png", "npy"])
def test_colours_count_by_their_mean_without_alpha(tmp_path: Path, ending: str) -> None:
    alpha = EIGHT[::-1, :, None]
    colour = np.stack([EIGHT, 0 * EIGHT, EIGHT], axis=-1)
    shown = np.array([[0, 510, 102], [204, 306, 408]]) / 3 / 255
    assert np.array_equal(read(saved(tmp_path, f"rgb.{ending}", colour)), shown)
    assert np.array_equal(read(saved(tmp_path, f"rgba.{ending}", np.concatenate([colour, alpha], axis=-1))), shown)
    assert np.array_equal(read(saved(tmp_path, f"la.{ending}", np.concatenate([EIGHT[..., None], alpha], axis=-1))), SHOWN)


def test_one_channel(tmp_path: Path) -> None:
    assert np.array_equal(read(saved(tmp_path, "a.npy", EIGHT[..., None])), SHOWN)


def test_palettes_hold_numbers_of_colours(tmp_path: Path) -> None:
    indexed = Image.fromarray(np.array([[2, 0, 1]], dtype=np.uint8))
    indexed.putpalette([255, 255, 255, 51, 51, 51, 0, 0, 0])
    indexed.save(tmp_path / "a.png")
    indexed.save(tmp_path / "a.gif")
    indexed.save(tmp_path / "alpha.png", transparency=b"\x00\x80\xff")  # alpha of each colour; Pillow warns where it is dropped
    for name in ("a.png", "a.gif", "alpha.png"):
        assert np.array_equal(read(tmp_path / name), SHOWN[:1]), name


def test_other_colours_are_turned_into_red_green_and_blue(tmp_path: Path) -> None:
    file = saved(tmp_path, "a.tif", np.stack([EIGHT] * 3, axis=-1), "CMYK")
    assert np.array_equal(read(file), SHOWN)


def test_as_the_camera_was_held(tmp_path: Path) -> None:
    exif = Image.Exif()
    exif[0x0112] = 6  # to be turned by a quarter, clockwise
    for name, pixels in (("8.png", EIGHT), ("16.png", EIGHT.astype(np.uint16) * 257)):
        Image.fromarray(pixels).save(tmp_path / name, exif=exif)
        assert np.array_equal(read(tmp_path / name), np.rot90(SHOWN, -1)), name


def test_an_array_is_a_copy_of_its_file(tmp_path: Path) -> None:
    values = read(saved(tmp_path, "a.npy", SHOWN))
    with (tmp_path / "a.npy").open("r+b") as file:
        file.seek(-SHOWN.nbytes, 2)
        file.write(bytes(SHOWN.nbytes))
    assert np.array_equal(values, SHOWN)
    assert not np.array_equal(read(tmp_path / "a.npy"), SHOWN)
    values[0, 0] = 0.5


# what is refused


@pytest.mark.parametrize("name", ["a.png", "a.npy"])
def test_the_most_pixels(tmp_path: Path, name: str) -> None:
    file = saved(tmp_path, name, EIGHT)
    assert read(file, most=6).shape == (2, 3)
    assert refusal(file, most=5) == (
        f"{name} has 2 rows of 3 pixels, and at most 5 are read; scale it down, and take pixels larger by as much."
    )


def test_the_size_is_known_before_the_pixels_are_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = saved(tmp_path, "whole.png", np.zeros((64, 64), dtype=np.uint8)).read_bytes()
    (tmp_path / "cut.png").write_bytes(whole[:50])
    assert "64 rows of 64 pixels" in refusal(tmp_path / "cut.png", most=4095)
    assert "cannot be read" in refusal(tmp_path / "cut.png", most=4096)
    header = {"descr": "|u1", "fortran_order": False, "shape": (2**20, 2**20)}
    with (tmp_path / "sparse.npy").open("wb") as file:
        np.lib.format.write_array_header_1_0(file, header)
        file.truncate(2**40 + 1000)  # no space is taken: nothing is written
    assert "1048576 rows of 1048576 pixels" in refusal(tmp_path / "sparse.npy")
    monkeypatch.setattr(Image, "MAX_IMAGE_PIXELS", 100)
    assert "more pixels than Pillow opens, and at most 10 are read" in refusal(tmp_path / "whole.png", most=10)


def test_a_large_picture_that_is_allowed_is_read_without_a_warning(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Image, "MAX_IMAGE_PIXELS", 5)  # Pillow warns of more, and refuses twice as many
    assert np.array_equal(read(saved(tmp_path, "a.png", EIGHT)), SHOWN)


@pytest.mark.parametrize(
    ("values", "words"),
    [
        (EIGHT.astype(np.int64), "has values of the type int64 from 0 to 255, so that white is not known"),
        (EIGHT.astype(np.uint32), "has values of the type uint32 from 0 to 255, so that white is not known"),
        (EIGHT / 100, "from 0 to 2.55, so that white is not known"),
        (-SHOWN, "from -1 to -0, so that white is not known"),
        (np.full((2, 2), -1), "from -1 to -1, so that white is not known"),
        (np.array([[0.0, np.nan]]), "from nan to nan, so that white is not known"),
        (EIGHT * 1j, "is an array of shape (2, 3) and type complex128"),
        (np.full((4, 4), "a"), "is an array of shape (4, 4) and type <U1"),
        (EIGHT.ravel(), "is an array of shape (6,) and type uint8"),
        (np.array(1.0), "is an array of shape () and type float64"),
        (np.zeros((2, 2, 5)), "is an array of shape (2, 2, 5)"),
        (np.zeros((2, 2, 0)), "is an array of shape (2, 2, 0)"),
        (np.zeros((2, 2, 1, 1)), "is an array of shape (2, 2, 1, 1)"),
        (EIGHT[:0], "has no pixels"),
        (EIGHT[:, :0], "has no pixels"),
        (np.array([[None, 1]], dtype=object), "cannot be read as an image"),
    ],
)
def test_arrays_that_are_refused(tmp_path: Path, values: np.ndarray, words: str) -> None:
    assert words in refusal(saved(tmp_path, "a.npy", values))


def test_32_bits_in_a_picture_have_no_known_white(tmp_path: Path) -> None:
    assert "int32 from 0 to 255, so that white is not known" in refusal(saved(tmp_path, "a.tif", EIGHT.astype(np.int32)))


def test_several_pictures_in_a_file(tmp_path: Path) -> None:
    frames = [Image.fromarray(EIGHT), Image.fromarray(EIGHT[::-1].copy())]
    for name in ("a.tif", "a.gif"):
        frames[0].save(tmp_path / name, save_all=True, append_images=frames[1:])
        assert "holds 2 pictures, and must have one" in refusal(tmp_path / name)


def test_files_that_cannot_be_read(tmp_path: Path) -> None:
    whole = saved(tmp_path, "whole.png", np.zeros((64, 64), dtype=np.uint8)).read_bytes()
    array = saved(tmp_path, "whole.npy", EIGHT).read_bytes()
    np.savez(tmp_path / "several.npz", a=EIGHT, b=EIGHT)
    (tmp_path / "several.npz").rename(tmp_path / "several.npy")
    for name, content in (
        ("text.png", b"no image"), ("text.npy", b"no array"), ("empty.png", b""), ("empty.npy", b""), ("cut.png", whole[:50]),
        ("cut.npy", array[:-1]), ("head.npy", array[:40]), ("brace.npy", array.replace(b"}", b" ")),
    ):  # fmt: skip
        (tmp_path / name).write_bytes(content)
    for name in ("text.png", "text.npy", "empty.png", "empty.npy", "cut.png", "cut.npy", "head.npy", "brace.npy", "several.npy"):
        assert "cannot be read as an image: it is of no known kind, or damaged; give" in refusal(tmp_path / name, most=4096), name
    for name in ("none.png", "none.npy"):
        assert f"there is no file '{tmp_path / name}'; a relative name is looked for" in refusal(tmp_path / name)
    assert "cannot be read as an image: Is a directory; give" in refusal(tmp_path)
