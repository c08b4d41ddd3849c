"""What the blocks of the pages say, from the CSV files."""

from __future__ import annotations

import math
from collections.abc import Callable

from benchmarks.report.tables import Row
from benchmarks.report.words import Files, digits, equal_rows, orders, seconds, short, table, times
from benchmarks.report.work import front

BLOCKS: dict[str, Callable[[Files], str]] = {}


def block(function: Callable[[Files], str]) -> Callable[[Files], str]:
    BLOCKS[function.__name__] = function
    return function


# -- The whole ----------------------------------------------------------------------------------------------------------


@block
def machine(files: Files) -> str:
    """That of the whole report, and those of parts that were measured elsewhere."""
    whole = files.about("equal")[0]
    others = {files.about(name)[0]: name for name in files.names() if files.about(name)[0] != whole}
    return "; ".join([whole, *(f"{name} on {heading}" for heading, name in others.items())])


@block
def duration(files: Files) -> str:
    """When the report was made, and how long it took."""
    day, _, took = files.about("equal")[-1].partition(", ")
    return f"{day} in {float(took.split()[-2]) / 60.0:.0f} minutes" if took.startswith("the whole") else "several days, part by part"


@block
def rebuilt(files: Files) -> str:
    """How far ratios moved against the report before."""
    changes = [(abs(row["change"]), row) for row in files.rows("equal") if row["change"] is not None and row["ratio"] > 1.0]
    if not changes:
        return "There is no report before this one to compare with."
    most, row = max(changes, key=lambda each: each[0])
    middle = sorted(change for change, _ in changes)[len(changes) // 2]
    worst = f"{row['code']}, {row['target'].replace(': ', ', error below ')}"
    return (
        f"Against the report before, the {len(changes)} ratios of times at equal error to that of the fastest code changed by "
        f"{100 * middle:.0f} % in the median and {100 * most:.0f} % at most ({worst})."
    )


# -- The plaque ---------------------------------------------------------------------------------------------------------


@block
def plaque_equal(files: Files) -> str:
    return equal_rows(files, "plaque", "interfacial")


@block
def plaque_drag_equal(files: Files) -> str:
    return equal_rows(files, "plaque", "drag")


FINE_FIPY = {(25, "rtol 1e-03"), (50, "rtol 1e-04"), (100, "rtol 1e-05"), (200, "rtol 1e-06")}
"""FiPy's rows whose tolerance falls with the cells, so that the error in time does, too."""


@block
def plaque_orders(files: Files) -> str:
    lines = []
    for form in ("interfacial", "drag"):
        rows = [row for row in files.rows("plaque") if row["problem"] == form]
        radau = [
            row for row in rows if row["code"].endswith("(default)") and row["setting"] == "rtol 1e-06" and row["size"] not in (45, 50)
        ]
        fipy = [row for row in rows if row["code"] == "FiPy method" and (row["size"], row["setting"]) in FINE_FIPY]
        for code, mine in (("lines, Radau, rtol 1e-6", radau), ("FiPy method, rtol 1e-3 to 1e-6", fipy)):
            sizes = ", ".join(str(row["size"]) for row in sorted(mine, key=lambda row: row["size"]))
            lines.append([form, code, sizes, orders(mine, "error"), orders(mine, "error_L")])
    return table(["form", "code", "cells", "order of n", "order of L"], lines)


@block
def plaque_time(files: Files) -> str:
    rows = files.rows("plaque_time")
    tolerances = sorted({row["rtol"] for row in rows}, reverse=True)
    lines = []
    for form in dict.fromkeys(row["problem"] for row in rows):
        mine = {row["rtol"]: row for row in rows if row["problem"] == form}
        for name in ("n", "L"):
            lines.append([f"{form}, {name}", *(digits(mine[rtol][name], 2) for rtol in tolerances)])
        lines.append([f"{form}, steps", *(str(mine[rtol]["steps"]) for rtol in tolerances)])
    return table(["error in time / rtol", *(short(rtol) for rtol in tolerances)], lines)


@block
def plaque_headline(files: Files) -> str:
    """The reference problem in a sentence."""
    target = "interfacial: 0.0005"
    best = files.equal(target, "lines, Radau")
    others = {row["code"]: row["ratio"] for row in files.rows("equal") if row["target"] == target}
    peers = {code: ratio for code, ratio in others.items() if not code.startswith(("lines", "FiPy method", "IDA on our"))}
    near = min(peers, key=lambda code: peers[code])
    words = f"an error of 5e-4 in n takes {seconds(best['seconds'])}; of codes that do not use this package's equations the nearest "
    words += f"({near}) takes {times(peers[near])} times as long"
    if "plain FiPy script" in others:
        words += f", a plain FiPy script {times(others['plain FiPy script'])} times"
    return f"{words}, and the method `fipy` of this package {times(others['FiPy method'])} times"


# -- The radial tumour --------------------------------------------------------------------------------------------------


@block
def radial_equal(files: Files) -> str:
    """All targets of all problems."""
    problems = ("elastic disk", "elastic sphere", "viscous disk", "viscous sphere")
    return "\n\n".join(f"**{problem.capitalize()}**\n\n{equal_rows(files, 'radial', problem)}" for problem in problems)


@block
def radial_orders(files: Files) -> str:
    lines = []
    for problem in dict.fromkeys(row["problem"] for row in files.rows("radial")):
        mine = [
            row
            for row in files.rows("radial")
            if row["problem"] == problem and row["code"].endswith("(default)") and row["setting"] == "rtol 1e-06"
        ]
        sizes = ", ".join(str(row["size"]) for row in sorted(mine, key=lambda row: row["size"]))
        lines.append([problem, sizes, *(orders(mine, f"error_{name}") for name in ("R", "alpha", "C"))])
    return table(["problem", "cells", "order of R", "of alpha(0)", "of C(0)"], lines)


@block
def radial_time(files: Files) -> str:
    rows = files.rows("radial_time")
    tolerances = sorted({row["rtol"] for row in rows}, reverse=True)
    lines = []
    for problem in dict.fromkeys(row["problem"] for row in rows):
        mine = {row["rtol"]: row for row in rows if row["problem"] == problem}
        lines.append([problem, *(f"{digits(mine[rtol]['mean'], 2)} ({digits(mine[rtol]['worst'], 2)})" for rtol in tolerances)])
    return table(["error in time / rtol: mean (worst cell)", *(short(rtol) for rtol in tolerances)], lines)


@block
def radial_headline(files: Files) -> str:
    coarse, fine = (seconds(files.equal(f"elastic disk: {bound:g}", "lines, Radau")["seconds"]) for bound in (2e-3, 2e-4))
    return f"an error of 2e-3 in R and in the values at the centre takes {coarse}, one of 2e-4 {fine}"


# -- Two dimensions -----------------------------------------------------------------------------------------------------


@block
def plane_table(files: Files) -> str:
    """The radial solver, runs in two dimensions that no other beats at t = 40 or 60, and backward Euler, with the faster linear solver."""
    line, plane = [], []
    for row in files.rows("plane"):
        if row["code"].startswith("radial"):
            line.append(row)
        elif row["code"].endswith(_linear(files)):
            plane.append(row)
    best = [a or b for a, b in zip(front(plane, "error_40"), front(plane, "error_60"), strict=True)]
    lines = []
    for row in [*line, *(row for row, on in zip(plane, best, strict=True) if on or row["code"].startswith("backward Euler"))]:
        each = (" ".join(short(row[f"error_{name}_{at}"]) for name in ("R", "d", "alpha", "C")) for at in (20, 40, 60))
        code = row["code"].removesuffix(f", {_linear(files)}")
        lines.append([code, str(row["size"]), row["setting"], *each, str(row["steps"]), seconds(row["seconds"])])
    return table(["code", "rings (cells)", "setting", "t = 20: R, d, alpha, C", "t = 40", "t = 60", "steps", "time"], lines)


def _linear(files: Files) -> str:
    """The linear solver with which the steps of the paper's program are the fastest."""
    return str(_ours(files)["code"]).rpartition(", ")[2]


@block
def plane_equal(files: Files) -> str:
    return equal_rows(files, "plane", "paper's disk")


@block
def plane_orders(files: Files) -> str:
    """From three runs each, so that nothing else enters: log2 of the ratio of neighbouring differences."""
    rows = {(row["code"], row["size"], row["setting"]): row for row in files.rows("plane")}
    lines = []
    code = next(code for code, _, _ in rows if code.startswith("BDF2, "))
    for what, keys in (
        ("dt = 2, 1, 0.5 on 20 rings", [(20, "dt 2"), (20, "dt 1"), (20, "dt 0.5")]),
        ("dt = 1, 0.5, 0.25 on 20 rings", [(20, "dt 1"), (20, "dt 0.5"), (20, "dt 0.25")]),
        ("20, 40, 80 rings with dt = 0.5", [(20, "dt 0.5"), (40, "dt 0.5"), (80, "dt 0.5")]),
    ):
        three = [rows[code, *key] for key in keys]
        found = []
        for at in (20, 40, 60):
            a, b, c = (row[f"R{at}"] for row in three)
            found.append(f"{math.log2(abs(a - b) / abs(b - c)):.2f}")
        lines.append([what, *found])
    return table(["BDF2, order of R from", "t = 20", "t = 40", "t = 60"], lines)


def _ours(files: Files) -> Row:
    """The program of the paper step by step, with the faster linear solver."""
    return min(files.rows("authors"), key=lambda row: float(row["seconds"]))


def _as_accurate(files: Files) -> Row:
    """The fastest run in two dimensions that is nowhere worse than the program of the paper."""
    theirs = files.paper
    keys = [f"error_{name}_{at}" for at in (20, 40, 60) for name in ("R", "d", "alpha", "C")]
    good = [row for row in files.rows("plane") if "radial" not in row["code"] and all(row[key] <= theirs[key] for key in keys)]
    return min(good, key=lambda row: float(row["seconds"]))


@block
def authors(files: Files) -> str:
    """The program of the paper, the same steps by this package, and the same accuracy."""
    paper, best = files.paper, _as_accurate(files)
    theirs = paper["seconds with OpenBLAS"]

    def line(name: str, row: Row) -> list[str]:
        counts = (str(row[key]) for key in ("steps", "iterations", "tangents"))
        return [name, *counts, seconds(row["seconds"]), times(theirs / row["seconds"])]

    name = "the program of the paper (FEniCS, MUMPS; one core of another machine, extrapolated)"
    lines = [[name, "120", str(paper["Newton iterations"]), "", seconds(theirs), "1"]]
    lines += [line(f"the same steps here, {row['code']} ({row['unknowns']} unknowns)", row) for row in files.rows("authors")]
    lines.append(line(f"as accurate: {best['size']} rings, {best['code']}, {best['setting']}", best))
    return table(["", "steps", "iterations", "tangents", "time", "times faster"], lines)


@block
def authors_errors(files: Files) -> str:
    best = _as_accurate(files)
    lines = []
    for name, row in (("its scheme on its mesh", files.paper), (f"{best['size']} rings, {best['setting']}", best)):
        lines.append([name, *(" ".join(short(row[f"error_{field}_{at}"]) for field in ("R", "d", "alpha", "C")) for at in (20, 40, 60))])
    return table(["", "t = 20: R, d, alpha, C", "t = 40", "t = 60"], lines)


@block
def balance(files: Files) -> str:
    """What backward Euler does on a coarse mesh, beside the program of the paper."""
    code, key = f"backward Euler, {_linear(files)}", (20, "dt 0.5")
    row = next(row for row in files.rows("plane") if row["code"] == code and (row["size"], row["setting"]) == key)
    names = [f"error_{name}_40" for name in ("R", "d", "alpha", "C")]
    own, theirs = (short(max(each[name] for name in names)) for each in (row, files.paper))
    took = seconds(row["seconds"])
    return f"its own formula and step on {row['size']} rings have an error of {own} at t = 40 (its program: {theirs}) in {took}"


@block
def authors_headline(files: Files) -> str:
    same, accuracy = (seconds(row["seconds"]) for row in (_ours(files), _as_accurate(files)))
    there = f"about {digits(files.paper['seconds with OpenBLAS'], 2)} s on another machine (by its time for an iteration)"
    return f"the steps of the paper's program take {same} where it took {there}, and its accuracy {accuracy}"


# -- Size, hard cases, every day ----------------------------------------------------------------------------------------


@block
def size_one(files: Files) -> str:
    """Whole runs in one dimension."""
    lines = []
    for row in files.rows("size"):
        if not row["code"].startswith("two"):
            each = 1e6 * row["seconds"] / row["iterations"] / row["size"]
            lines.append(
                [row["code"], str(row["size"]), seconds(row["seconds"]), str(row["steps"]), str(row["iterations"]), digits(each, 2)]
            )
    return table(["", "cells", "time of a run", "steps", "iterations", "µs an iteration and cell"], lines)


@block
def size_two(files: Files) -> str:
    """Steps in two dimensions."""
    parts = ("tangent", "factorisation", "solve", "setup", "GiB")
    lines = []
    for row in files.rows("size"):
        if row["code"].startswith("two"):
            linear = row["code"].rpartition(", ")[2]
            lines.append([linear, str(row["size"]), seconds(row["seconds"]), *(digits(row[key], 2) for key in parts)])
    return table(["linear solver", "points", "a step", "a tangent, s", "a factorisation, s", "a solve, s", "set-up, s", "GiB"], lines)


@block
def size_exponents(files: Files) -> str:
    """Powers of the size from the second row of each code to its last."""
    lines = []
    for code in dict.fromkeys(row["code"] for row in files.rows("size")):
        mine = sorted((row for row in files.rows("size") if row["code"] == code), key=lambda row: row["size"])
        first, last = mine[1 if len(mine) > 2 else 0], mine[-1]  # the smallest size has costs of its own

        def power(value: Callable[[Row], float], first: Row = first, last: Row = last) -> str:
            return f"{math.log(value(last) / value(first)) / math.log(last['size'] / first['size']):.2f}"

        two = code.startswith("two")
        cost = power(lambda row: row["seconds"]) if two else power(lambda row: row["seconds"] / row["iterations"])
        memory = power(lambda row: row["GiB"]) if two else ""
        lines.append([code, f"{first['size']} to {last['size']}", cost, power(lambda row: row["factorisation"]) if two else "", memory])
    return table(["", "from, to", "time of an iteration (a step)", "of a factorisation", "memory"], lines)


@block
def hard_summary(files: Files) -> str:
    lines = []
    rows = files.rows("hard")
    for model in dict.fromkeys(row["model"] for row in rows):
        mine = [row for row in rows if row["model"] == model]
        longest = max(mine, key=lambda row: float(row["seconds"]))
        ends = [sum(str(row["did"]).startswith(word) for row in mine) for word in ("finished", "refused", "failed")]
        stated = sum(row["as_stated"] == "True" for row in mine)
        errors, defects = ([row[name] for row in mine if row[name] is not None] for name in ("error", "defect"))
        worst = [digits(max(errors), 2) if errors else "", short(max(defects)) if defects else ""]
        time = [seconds(sum(row["seconds"] for row in mine)), f"{longest['case']}, {seconds(longest['seconds'])}"]
        lines.append([model, *map(str, (len(mine), stated, *ends)), *worst, *time])
    headings = ["model", "cases", "as stated", "finished", "refused", "ended in words"]
    bounds = ["largest error in time, of what is allowed", "largest defect of a balance"]
    return table([*headings, *bounds, "all together", "longest"], lines)


@block
def everyday(files: Files) -> str:
    def written(row: Row) -> str:
        return seconds(row["value"]) if row["unit"] == "s" else f"{row['value']:.1f} {row['unit']}"

    return table(["", ""], ([row["what"], written(row)] for row in files.rows("everyday")))


@block
def calls(files: Files) -> str:
    return table(
        ["cells", "rtol", "simulate, 51 stored times", "integrator inside", "over it"],
        (
            [
                str(row["cells"]), short(row["rtol"]), seconds(1e-3 * row["simulate_ms"]), seconds(1e-3 * row["integrator_ms"]),
                f"{100 * (row['simulate_ms'] / row['integrator_ms'] - 1):.0f} %",
            ]
            for row in files.rows("calls")
        ),
    )  # fmt: skip


# -- README and VERIFICATION --------------------------------------------------------------------------------------------


@block
def first_run(files: Files) -> str:
    return f"```\n{files.text('first_run')}\n```"


@block
def first_compare(files: Files) -> str:
    """The head of the comparison, the rows of L and n, and what the two cost."""
    lines = files.text("first_compare").splitlines()
    kept = [line for line in lines if line.startswith(("compared at", "A: ", "B: ", "quantity", "L ", "n "))]
    return "```\n" + "\n".join(kept) + "\n```"


@block
def plaque_cost(files: Files) -> str:
    mine = [row for row in files.rows("size") if row["code"] == "plaque"]
    few, many = mine[0], mine[-1]
    grown, each = files.everyday("growth of memory"), many["bytes_a_cell"] / 1000
    return (
        f"{seconds(few['seconds'])} ({few['size']}) to {seconds(many['seconds'])} ({many['size']} cells); {each:.1f} kB a cell; "
        f"1000 runs grow by {grown:.0f} MB"
    )


@block
def plaque_time_bound(files: Files) -> str:
    return f"{digits(max(row[name] for row in files.rows('plaque_time') for name in ('n', 'L')), 2)} rtol at most"


@block
def radial_time_bound(files: Files) -> str:
    mean, worst = (digits(max(row[name] for row in files.rows("radial_time")), 2) for name in ("mean", "worst"))
    return f"{mean} rtol at most in the mean over the cells, {worst} at a cell that has just lost contact"


@block
def fipy_agreement(files: Files) -> str:
    """The error of the finest FiPy run against the converged solution by lines."""
    rows = [row for row in files.rows("plaque") if row["code"] == "FiPy method" and row["problem"] == "interfacial"]
    row = min(rows, key=lambda row: float(row["error"]))
    return f"{short(row['error'])} in n at {row['size']} cells"
