"""The pictures of the report: error against time, and cost against size."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from benchmarks.report.tables import Row, read
from benchmarks.report.work import front
from multiphase.plotting.files import write_picture
from multiphase.plotting.style import STYLE

COLOURS = (
    "#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#000000", "#999999", "#8c510a", "#5e3c99", "#66a61e", "#a50026",
)  # fmt: skip
MARKERS = "os^Dv<>PX*hd"


def write(results: Path, folder: Path) -> None:
    """plaque.png, radial.png, plane.png and size.png."""
    folder.mkdir(exist_ok=True)
    with matplotlib.rc_context(STYLE):
        for name, draw in (("plaque", plaque), ("radial", radial), ("plane", plane), ("size", size)):
            if (results / f"{name}.csv").exists():
                picture = draw(read(results / f"{name}.csv")[1])
                if name == "plane":
                    paper(picture, {row["what"]: row["value"] for row in read(results / "paper.csv")[1]})
                FigureCanvasAgg(picture)
                write_picture(picture, folder / f"{name}.png")


def _work(axes: Axes, rows: Sequence[Row], codes: Sequence[str], key: str = "error") -> None:
    """Error against seconds: the rows of each code in its colour, points of one setting joined, the Pareto front beneath."""
    axes.set_xscale("log")
    axes.set_yscale("log")
    best = sorted((row for row, on in zip(rows, front(rows, key), strict=True) if on), key=lambda row: row["seconds"])
    axes.step([row["seconds"] for row in best], [row[key] for row in best], where="post", color="0.85", linewidth=6, zorder=1)
    for code in dict.fromkeys(row["code"] for row in rows):
        k = codes.index(code) % len(COLOURS)
        mine = [row for row in rows if row["code"] == code]
        for setting in dict.fromkeys(row["setting"] for row in mine):
            line = sorted((row for row in mine if row["setting"] == setting), key=lambda row: row["size"])
            axes.plot([row["seconds"] for row in line], [row[key] for row in line], color=COLOURS[k], linewidth=0.6, alpha=0.6, zorder=2)
        axes.plot(
            [row["seconds"] for row in mine], [row[key] for row in mine], linestyle="", marker=MARKERS[k], markersize=4, color=COLOURS[k],
            label=code, zorder=3,
        )  # fmt: skip
    axes.grid(which="major", color="0.92", linewidth=0.6)
    axes.set_axisbelow(True)
    axes.set_xlabel("wall time of one run [s]")


def _panels(count: int, height: float = 4.6) -> tuple[Figure, Any]:
    picture = Figure(figsize=(3.6 * count + 0.6, height), layout="constrained")
    return picture, np.atleast_1d(picture.subplots(1, count))


def _legend(picture: Figure, panels: Iterable[Axes], columns: int) -> None:
    handles = {label: handle for axes in panels for handle, label in zip(*axes.get_legend_handles_labels(), strict=True)}
    picture.legend(handles.values(), handles.keys(), loc="outside lower center", ncols=columns, frameon=False)


def _codes(rows: Sequence[Row]) -> list[str]:
    return list(dict.fromkeys(row["code"] for row in rows))


def plaque(rows: list[Row]) -> Figure:
    picture, panels = _panels(2, 5.0)
    for axes, form in zip(panels, ("interfacial", "drag"), strict=True):
        _work(axes, [row for row in rows if row["problem"] == form], _codes(rows))
        axes.set_title(f"{form} form")
    panels[0].set_ylabel("error of $n$ at the end (mean over the cells)")
    _legend(picture, panels, 4)
    picture.suptitle("The plaque's reference problem: error against time")
    return picture


def radial(rows: list[Row]) -> Figure:
    shown = ("elastic disk", "viscous disk", "viscous sphere")
    picture, panels = _panels(len(shown))
    for axes, problem in zip(panels, shown, strict=True):
        _work(axes, [row for row in rows if row["problem"] == problem], _codes(rows))
        axes.set_title(problem)
    panels[0].set_ylabel(r"error at $t = 60$: the largest of $R$, $\alpha(0)$, $C(0)$, relative")
    _legend(picture, panels, 4)
    picture.suptitle("The radial tumour: error against time")
    return picture


def plane(rows: list[Row]) -> Figure:
    picture, panels = _panels(2, 5.0)
    for axes, at in zip(panels, (40, 60), strict=True):
        _work(axes, rows, _codes(rows), f"error_{at}")
        axes.set_title(f"$t = {at}$")
    panels[0].set_ylabel(r"largest error of $R$, $d$, $\alpha$, $C$ (maximum norm, relative)")
    _legend(picture, panels, 3)
    picture.suptitle("The paper's disk to $t = 60$, in two dimensions and radial: error against time")
    return picture


def paper(picture: Figure, facts: dict[str, float]) -> None:
    """The program of the paper, beside the runs in two dimensions."""
    for axes, at in zip(picture.axes, (40, 60), strict=True):
        error = max(facts[f"error_{name}_{at}"] for name in ("R", "d", "alpha", "C"))
        axes.plot([facts["seconds with OpenBLAS"]], [error], linestyle="", marker="*", markersize=11, color="#a50026")
        axes.annotate(
            "the paper's program\n(elsewhere)", (facts["seconds with OpenBLAS"], error), xytext=(-8, 8), textcoords="offset points",
            ha="right", fontsize=7.5,
        )  # fmt: skip


def size(rows: list[Row]) -> Figure:
    picture, panels = _panels(3)
    for k, code in enumerate(_codes(rows)):
        mine = [row for row in rows if row["code"] == code]
        line: dict[str, Any] = {"marker": MARKERS[k], "markersize": 4, "color": COLOURS[k], "label": code}
        two = code.startswith("two dimensions")
        panels[1 if two else 0].plot([row["size"] for row in mine], [row["seconds"] for row in mine], **line)
        if two:
            panels[2].plot([row["size"] for row in mine], [row["GiB"] for row in mine], **line)
    for axes, across, up in zip(
        panels, ("cells", "points of the mesh", "points of the mesh"), ("a run, rtol = 1e-4 [s]", "a step [s]", "memory [GiB]"), strict=True
    ):
        axes.set_xscale("log")
        axes.set_yscale("log")
        axes.set_xlabel(across)
        axes.set_ylabel(up)
        axes.grid(which="major", color="0.92", linewidth=0.6)
    _legend(picture, panels, 5)
    picture.suptitle("Cost against size")
    return picture
