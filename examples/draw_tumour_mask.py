"""Draws tumour_mask.png, a body with five lobes and a hole, and tumour_permeability.png, a dark band across the same frame."""

from pathlib import Path

import numpy as np
from PIL import Image


def main(folder: Path = Path(__file__).parent) -> None:
    column, row = np.meshgrid(np.arange(160) - 79.5, 63.5 - np.arange(128))
    r, theta = np.hypot(column, row), np.arctan2(row, column)
    lobes = 46.0 * (1.0 + 0.12 * np.cos(2.0 * theta - 0.4) + 0.10 * np.cos(3.0 * theta - 2.0) + 0.08 * np.cos(5.0 * theta - 1.0))
    body = (r < lobes) & (np.hypot((column - 14.0) / 11.0, (row + 8.0) / 8.0) > 1.0)
    Image.fromarray(255 * body.astype(np.uint8)).save(folder / "tumour_mask.png")
    across = (0.5 * column + row - 22.0) / 12.0
    Image.fromarray(np.rint(255.0 * (1.0 - 0.9 * np.exp(-(across**2)))).astype(np.uint8)).save(folder / "tumour_permeability.png")


if __name__ == "__main__":
    main()
