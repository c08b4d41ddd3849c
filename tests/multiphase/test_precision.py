"""Speed against error: what is measured, against what, what is left out, and how it is shown. No test looks at the clock."""

from __future__ import annotations

import csv
import logging
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest

from multiphase.cli import main
from multiphase.errors import ParameterError, SolverError
from multiphase.model import Model, Panel, Quantity
from multiphase.parameters import parameter, validate
from multiphase.precision import Measurement, Order, Study, bench, choices, parse_list, study
from multiphase.precision.accuracy import cell_averages, errors_between, orders_of, pareto
from multiphase.precision.bench import Bench, Cost
from multiphase.result import Result
from multiphase.scene import Scene, TimeTable, load_scene

# -- a model whose runs are made up -----------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True, kw_only=True)
class Nothing:
    table: ClassVar[str] = "parameters"


@dataclass(frozen=True, slots=True, kw_only=True)
class Solver:
    table: ClassVar[str] = "solver"
    method: str = parameter("auto", symbol="-", choices=("auto", "slow", "fast"), doc="the method")
    cells: int = parameter(100, symbol="N", low=4, high=10_000, doc="the number of cells")
    rtol: float = parameter(1e-4, symbol="rtol", low=1e-12, high=0.1, doc="the accuracy")
    dt: float | None = parameter(None, symbol="dt", kind="number", low=0.0, low_open=True, doc="the fixed step")

    def __post_init__(self) -> None:
        validate(self, self.table)


def unused(*_: Any, **__: Any) -> Any:
    raise AssertionError


MODEL = Model(
    name="made-up",
    title="A made-up model",
    parameters=Nothing,
    initial=Nothing,
    geometry=Nothing,
    solver=Solver,
    presets={},
    quantities={"n": Quantity("n", "n", "a fraction"), "L": Quantity("L", "L", "width", kind="scalar")},
    panels=(Panel("profile", ("n",), ""), Panel("scalar", ("L",), ""), Panel("scalar", ("other",), "")),
    film="n",
    scenes="nowhere",
    check=lambda scene: None,
    plan=unused,
    scheme=unused,
    summary=unused,
)


def made_up(**solver: Any) -> Scene:
    parts = {"geometry": Nothing(), "parameters": Nothing(), "initial": Nothing()}
    return Scene(name="made-up", model=MODEL, time=TimeTable.make(2.0), solver=Solver(**solver), **parts)


SIGN = {"fast": 1.0, "slow": -1.0}
SECONDS = {"fast": 1e-3, "slow": 1e-1}


def made_up_result(method: str, cells: int, rtol: float, times: Sequence[float] = (0.0, 0.5, 1.0, 1.5, 2.0)) -> Result:
    """n has the mean 1 + t xi over a cell, and an error of 1/cells^2 + 0.1 rtol upwards (fast) or downwards (slow) after t = 0."""
    t = np.asarray(times)
    xi = (np.arange(cells) + 0.5) / cells
    wrong = SIGN[method] * (cells**-2.0 + 0.1 * rtol)
    width = 1.0 + t
    return Result(
        model="made-up",
        t=t,
        x=xi * width[:, None],
        scalars={"L": width},
        fields={"n": 1.0 + xi * t[:, None] + np.where(t > 0.0, wrong, 0.5)[:, None]},
        stats={"wall_s": SECONDS[method] * (cells / 10) * (1e-3 / rtol) ** 0.5, "steps": 7, "iterations": 21},
    )


class Runs:
    """Stands in for `multiphase.run.run`; `special` may answer first."""

    def __init__(self) -> None:
        self.calls: list[tuple[str, int, float]] = []
        self.scenes: list[Scene] = []
        self.special: Callable[[str, int, float], Result | None] = lambda method, cells, rtol: None

    def __call__(self, scene: Scene, **options: Any) -> Result:
        assert options["threads"] == 1
        assert options["raise_on_failure"] is False
        assert "file" not in options
        key = (scene.solver.method, scene.solver.cells, scene.solver.rtol)
        self.calls.append(key)
        self.scenes.append(scene)
        return self.special(*key) or made_up_result(*key)


@pytest.fixture
def runs(monkeypatch: pytest.MonkeyPatch) -> Runs:
    made = Runs()
    monkeypatch.setattr(bench, "run", made)
    return made


SMALL: dict[str, Any] = {"cells": (10, 20), "rtols": (1e-3, 1e-4), "repeats": 3}


def row_of(found: Study, method: str, cells: int, rtol: float) -> Measurement:
    return next(row for row in found.measurements if (row.method, row.cells, row.rtol) == (method, cells, rtol))


# -- averages and errors ----------------------------------------------------------------------------------------------


def test_fine_cells_are_averaged() -> None:
    values = np.arange(12.0).reshape(2, 6)
    assert cell_averages(values, 3).tolist() == [[0.5, 2.5, 4.5], [6.5, 8.5, 10.5]]
    assert cell_averages(values, 6).tolist() == values.tolist()


def test_cells_that_overlap_are_averaged_by_their_share() -> None:
    # Three cells onto two: each takes one cell and half of the middle one. Two onto three: the middle takes half of each.
    assert np.allclose(cell_averages(np.array([1.0, 2.0, 6.0]), 2), [(1.0 + 0.5 * 2.0) / 1.5, (0.5 * 2.0 + 6.0) / 1.5], rtol=1e-15)
    assert np.allclose(cell_averages(np.array([1.0, 5.0]), 3), [1.0, 3.0, 5.0], rtol=1e-15)


@pytest.mark.parametrize(("fine", "coarse"), [(7, 3), (100, 64), (1001, 10), (9, 20)])
def test_averaging_keeps_the_total(fine: int, coarse: int) -> None:
    values = np.random.default_rng(1).random((4, fine))
    # sums of at most 1001 numbers below 1, rounded to 1e-16 each
    assert np.allclose(cell_averages(values, coarse).mean(axis=1), values.mean(axis=1), rtol=1e-13)


def test_the_error_is_relative_in_the_mean_over_cells_at_the_worst_time() -> None:
    a, b = made_up_result("fast", 10, 1e-3), made_up_result("fast", 40, 1e-3)
    a.fields["n"][3] += 0.5
    a.fields["n"][4, 2] += 1.0
    a.scalars["k"], b.scalars["k"] = np.array([0.0, 1.25, 2.0, 3.0, -4.0]), np.array([0.0, 1.0, 2.0, 3.0, -4.0])
    found = errors_between(a, b, ("n", "k"))
    largest = float(np.max(np.abs(b["n"])))
    assert found["n"] == pytest.approx((0.5 + 10**-2.0 - 40**-2.0) / largest, rel=1e-12)
    assert found["k"] == 0.25 / 4.0


def test_the_initial_state_is_no_error() -> None:
    a, b = made_up_result("fast", 10, 1e-3), made_up_result("fast", 10, 1e-3)
    a.fields["n"][0] = 0.0
    assert errors_between(a, b, ("n",))["n"] == 0.0


def test_cells_that_divide_the_body_in_another_way_are_refused() -> None:
    a, b = made_up_result("fast", 10, 1e-3), made_up_result("fast", 10, 1e-3)
    a.x[:, 3] += 0.01 * a.width()  # a tenth of a cell, as an error may be
    errors_between(a, b, ("n",))
    a.x[:, 3] += 0.03 * a.width()
    with pytest.raises(ParameterError, match="n: the cells of these runs divide the body in different ways"):
        errors_between(a, b, ("n",))
    with pytest.raises(ParameterError, match="one-dimensional body"):
        errors_between(replace(b, x=None), b, ("n",))


def test_cells_may_be_equal_at_rest_or_in_area() -> None:
    """The same shares of a body, wherever they lie now: what counts is the share."""
    a, b = made_up_result("fast", 10, 1e-3), made_up_result("fast", 20, 1e-3)
    before = errors_between(a, b, ("n",))["n"]
    for result in (a, b):
        share, width = (np.arange(result.x.shape[1]) + 0.5) / result.x.shape[1], result.width()
        result.x[:] = (share**0.7)[None, :] * width[:, None]
    assert errors_between(a, b, ("n",))["n"] == pytest.approx(before, rel=1e-12)


# -- Pareto front and orders ------------------------------------------------------------------------------------------


def test_the_front_is_what_nothing_beats() -> None:
    assert pareto([1, 2, 3, 4], [4, 2, 3, 1]) == [True, True, False, True]
    assert pareto([1, 1, 2], [1, 2, 1]) == [True, False, False]  # as fast, or as accurate, and worse in the other
    assert pareto([1, 1], [2, 2]) == [True, True]  # equals do not beat each other
    assert pareto([math.nan, 1.0], [0.0, 1.0]) == [False, True]
    assert pareto([1.0, 2.0], [math.nan, math.inf]) == [False, False]


def test_errors_below_the_floor_are_equal() -> None:
    assert pareto([1, 2, 3], [0.5, 0.02, 0.01]) == [True, True, True]
    assert pareto([1, 2, 3], [0.5, 0.02, 0.01], floor=0.1) == [True, True, False]


def measured(
    error: Callable[[int, float], float], cells: Sequence[int] = (25, 50, 100), rtols: Sequence[float] = (1e-3, 1e-4, 1e-5)
) -> list[Measurement]:
    return [Measurement(method="a", cells=c, rtol=r, status="completed", seconds=1.0, error=error(c, r)) for c in cells for r in rtols]


def values_of(orders: Sequence[Order], kind: str) -> list[float | None]:
    return [None if order.value is None else round(order.value, 6) for order in orders if order.kind == kind]


def test_orders_in_space() -> None:
    found = orders_of(measured(lambda cells, rtol: 3.0 * cells**-2.0 + rtol * (rtol > 1e-5)))
    assert values_of(found, "cells") == [2.0, 2.0]
    assert [(order.fixed, order.coarse, order.fine) for order in found if order.kind == "cells"] == [(1e-5, 25, 50), (1e-5, 50, 100)]


def test_orders_in_the_tolerance_where_the_steps_make_the_error() -> None:
    found = orders_of(measured(lambda cells, rtol: rtol**0.7))
    assert values_of(found, "rtol") == [0.7, 0.7]
    assert {order.fixed for order in found if order.kind == "rtol"} == {100}


def test_no_order_in_the_tolerance_where_the_cells_make_the_error() -> None:
    # at 1e-4 the steps make nearly all of the error of 100 cells (1e-4 against 1e-6), at 1e-5 about a hundredth
    assert values_of(orders_of(measured(lambda cells, rtol: 1e-2 * cells**-2.0 + rtol)), "rtol")[0] is not None
    assert values_of(orders_of(measured(lambda cells, rtol: cells**-1.0 + rtol)), "rtol") == [None, None]
    assert values_of(orders_of(measured(lambda cells, rtol: cells**-2.0 + 1e-3 * rtol)), "rtol") == [None, None]
    assert values_of(orders_of(measured(lambda cells, rtol: rtol, cells=(100,))), "rtol") == [None, None]  # nothing to tell by


def test_no_orders_below_the_floor() -> None:
    found = orders_of(measured(lambda cells, rtol: 3.0 * cells**-2.0), floor=3.0 * 60**-2.0)
    assert values_of(found, "cells") == [2.0, None]


def test_orders_of_what_was_run() -> None:
    rows = [row for row in measured(lambda cells, rtol: cells**-2.0) if row.cells == 25 or row.rtol == 1e-3]
    assert {order.fixed for order in orders_of(rows) if order.kind == "cells"} == {1e-3}
    assert {order.fixed for order in orders_of(rows) if order.kind == "rtol"} == {25}


# -- what is run ------------------------------------------------------------------------------------------------------


def test_choices() -> None:
    scene = made_up()
    assert choices(scene).methods == ("slow", "fast")
    assert choices(scene).cells == (25, 50, 100, 200)
    assert choices(scene).rtols == (1e-3, 1e-4, 1e-5)
    some = choices(scene, methods=["fast", "fast"], cells=[20, 10, 20], rtols=[1e-4, 1e-2])
    assert (some.methods, some.cells, some.rtols) == (("fast",), (10, 20), (1e-2, 1e-4))


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"methods": ["fats"]}, 'methods: .* no method "fats"; did you mean "fast"\\? It has slow, fast'),
        ({"methods": ["auto"]}, 'no method "auto"'),
        ({"methods": []}, "nothing to run"),
        ({"cells": [10, 3]}, "cells: 3 is not allowed; the number of cells must be a whole number from 4"),
        ({"cells": [10.5]}, "cells: 10.5 is not allowed"),
        ({"rtols": [0.5]}, "rtols: 0.5 is not allowed; the accuracy must be"),
        ({"rtols": [math.nan]}, "rtols: nan is not allowed"),
        ({"repeats": 0}, "repeats: 0"),
        ({"budget": 0.0}, "budget: 0 s"),
        ({"cells": [10], "reference": (19, 1e-9)}, "reference: 19 cells .* take at least 20"),
        ({"rtols": [1e-3], "reference": (10_000, 1e-3)}, "an rtol below 0.001"),
    ],
)
def test_what_cannot_be_run_is_refused_before_any_work(runs: Runs, given: dict[str, Any], said: str) -> None:
    with pytest.raises(ParameterError, match=said):
        study(made_up(), **given)
    assert runs.calls == []


def test_a_list_on_the_command_line() -> None:
    assert parse_list("25, 50", "--cells", int) == [25, 50]
    assert parse_list("1e-3", "--rtols", float) == [1e-3]
    with pytest.raises(ParameterError, match='--cells: "2x" is not a whole number; the form is --cells 25,50,100'):
        parse_list("10,2x", "--cells", int)
    with pytest.raises(ParameterError, match='--methods: "" is not a name'):
        parse_list("a,,b", "--methods")


def test_every_combination_is_run_with_few_stored_times(runs: Runs) -> None:
    lines: list[str] = []
    found = study(made_up(), **SMALL, progress=lines.append)
    wanted = [(method, cells, rtol) for method in ("slow", "fast") for cells in (10, 20) for rtol in (1e-3, 1e-4)]
    assert [(row.method, row.cells, row.rtol) for row in found.measurements] == wanted
    # one warm-up of each method, three runs of each combination, and two references
    assert len(runs.calls) == 2 + 3 * 8 + 2
    assert runs.calls[:2] == [("slow", 10, 1e-3), ("fast", 10, 1e-3)]
    assert all(row.runs == 3 and (row.steps, row.iterations) == (7, 21) for row in found.measurements)
    assert {scene.time.save_at for scene in runs.scenes} == {(0.0, 0.5, 1.0, 1.5, 2.0)}
    assert {scene.output.fields for scene in runs.scenes} == {("n",)}
    assert lines[0] == "slow: warm-up"
    assert "fast: 20 cells, rtol = 0.0001" in lines


def test_the_warm_up_does_not_count(runs: Runs) -> None:
    def special(method: str, cells: int, rtol: float) -> Result | None:
        result = made_up_result(method, cells, rtol)
        if len(runs.calls) <= 2:
            result.stats["wall_s"] = 1e6
        return result

    runs.special = special
    found = study(made_up(), **SMALL)
    assert row_of(found, "fast", 10, 1e-3).seconds == SECONDS["fast"]
    assert all(row.status == "completed" for row in found.measurements)


def test_the_time_is_the_median(runs: Runs) -> None:
    def special(method: str, cells: int, rtol: float) -> Result | None:
        result = made_up_result(method, cells, rtol)
        result.stats["wall_s"] = [0.1, 0.1, 0.9, 0.2, 0.1, 0.1][len(runs.calls) - 1]
        return result

    runs.special = special
    found = study(made_up(), methods=["fast"], cells=[10], rtols=[1e-3], repeats=3)
    assert found.measurements[0].seconds == 0.2


def test_errors_are_measured_against_the_other_method(runs: Runs) -> None:
    found = study(made_up(), **SMALL)
    assert found.reference is not None
    assert found.second is not None
    assert (found.reference.method, found.reference.cells, found.reference.rtol) == ("fast", 80, pytest.approx(1e-6))
    assert found.second.method == "slow"
    largest = 3.0  # 1 + t xi at the end, but for what is checked to 2 % here
    difference = 2 * (80**-2.0 + 1e-7) / largest
    assert found.difference == pytest.approx(difference, rel=0.02)
    row = row_of(found, "fast", 10, 1e-3)
    assert row.against == "slow"
    assert row.error == pytest.approx((10**-2.0 + 1e-4 + 80**-2.0) / largest, rel=0.02)
    assert row_of(found, "slow", 20, 1e-4).against == "fast"
    assert set(row.errors) == {"n", "L"}
    assert row.errors["L"] == 0.0


def test_a_row_near_the_difference_is_measured_against_the_main_reference(runs: Runs) -> None:
    runs.special = lambda method, cells, rtol: made_up_result("slow", 4, 0.1) if (method, cells) == ("slow", 80) else None
    found = study(made_up(), **SMALL)
    # the second reference is off by 0.07 / 3, far more than a fifth of any error of the other method
    assert row_of(found, "fast", 10, 1e-3).against == "fast"
    assert row_of(found, "slow", 10, 1e-3).against == "fast"


def test_a_reference_can_be_given(runs: Runs) -> None:
    found = study(made_up(), **SMALL, reference=(120, 1e-8), budget=1e5)
    assert found.reference is not None
    assert (found.reference.cells, found.reference.rtol) == (120, 1e-8)
    assert runs.calls[-2:] == [("fast", 120, 1e-8), ("slow", 120, 1e-8)]


def test_a_reference_stays_within_what_the_solver_allows(runs: Runs) -> None:
    found = study(made_up(), methods=["fast"], cells=[6000], rtols=[5e-12], repeats=1)
    assert found.reference is not None
    assert (found.reference.cells, found.reference.rtol) == (10_000, 1e-12)


def test_one_method_is_measured_against_itself_and_says_so(runs: Runs) -> None:
    found = study(made_up(), methods=["fast"], **SMALL)
    assert found.second is None
    assert found.difference is None
    assert {row.against for row in found.measurements} == {"fast"}
    assert "its own error is not seen" in " ".join(found.table().split())


def test_a_fixed_step_is_set_aside(runs: Runs) -> None:
    found = study(made_up(dt=0.01), **SMALL)
    assert {scene.solver.dt for scene in runs.scenes} == {None}
    assert "dt = 0.01, is set aside" in found.table()
    assert "set aside" not in study(made_up(), **SMALL).table()


# -- what cannot be run -----------------------------------------------------------------------------------------------


def test_a_refusal_and_a_failure_are_rows(runs: Runs) -> None:
    def special(method: str, cells: int, rtol: float) -> Result | None:
        match method, cells, rtol:
            case "slow", 10, _:
                raise ParameterError("solver.cells", "too few for this method.")
            case "slow", 20, 1e-3:
                raise SolverError("the initial state cannot be evaluated")
            case "fast", 10, 1e-4:
                return replace(made_up_result(method, cells, rtol), status="failed", message="the step became too small")
        return None

    runs.special = special
    found = study(made_up(), **SMALL)
    statuses = [row.status for row in found.measurements]
    assert statuses == ["refused", "refused", "failed", "completed", "completed", "failed", "completed", "completed"]
    assert "solver.cells: too few for this method." in row_of(found, "slow", 10, 1e-3).message
    assert math.isnan(row_of(found, "slow", 10, 1e-3).error)
    for said in ("refused: solver.cells: too few", "failed: the step became too small", "failed: the initial state"):
        assert said in found.table()
    assert not any(row.pareto for row in found.measurements if row.status != "completed")


def test_a_reference_that_fails_gives_way_to_the_next(runs: Runs) -> None:
    def special(method: str, cells: int, rtol: float) -> Result | None:
        if method == "fast" and cells == 80:
            raise SolverError("no convergence")
        return None

    runs.special = special
    found = study(made_up(), **SMALL)
    assert found.reference is not None
    assert (found.reference.method, found.reference.cells) == ("fast", 40)
    assert "no reference fast, 80 cells" in found.table()


def test_without_a_run_there_is_no_reference_and_no_crash(runs: Runs, tmp_path: Path) -> None:
    def special(method: str, cells: int, rtol: float) -> Result | None:
        raise ParameterError("solver", "never.")

    runs.special = special
    found = study(made_up(), **SMALL)
    assert found.reference is None
    assert "there are no errors" in found.table()
    assert found.figure() is not None
    assert len(list(csv.reader(line for line in written(found, tmp_path) if not line.startswith("#")))) == 9


def test_a_slow_method_is_repeated_once_and_dropped_where_it_would_exceed_the_budget(runs: Runs) -> None:
    def special(method: str, cells: int, rtol: float) -> Result | None:
        result = made_up_result(method, cells, rtol)
        if method == "slow":
            result.stats["wall_s"] = 0.3 * cells
        return result

    runs.special = special
    # slow: 3 s with 10 cells, 6 s with 20, 12 s with 40; of 50 s half is for the rows
    found = study(made_up(), cells=(10, 20, 40), rtols=(1e-3,), repeats=5, budget=50.0)
    assert row_of(found, "slow", 10, 1e-3).runs == 2
    assert row_of(found, "slow", 20, 1e-3).runs == 2
    assert "slow: 2 of 5 runs" in found.table()
    dropped = row_of(found, "slow", 40, 1e-3)
    assert dropped.status == "not run"
    assert "would take about 1" in dropped.message
    assert f"not run: {dropped.message}" in found.table()
    assert ("slow", 40, 1e-3) not in runs.calls
    assert all(row.status == "completed" and row.runs == 5 for row in found.measurements if row.method == "fast")
    assert found.second is None
    assert "no reference of slow" in found.table()


def test_repeats_end_with_the_budget(runs: Runs) -> None:
    def special(method: str, cells: int, rtol: float) -> Result | None:
        result = made_up_result(method, cells, rtol)
        result.stats["wall_s"] = 1.0
        return result

    runs.special = special
    # 2.5 s are for the rows, and each run takes 1 s
    found = study(made_up(), methods=["fast"], cells=[10], rtols=[1e-3], repeats=5, budget=5.0)
    assert found.measurements[0].runs == 2


def test_a_model_with_another_mesh_is_refused_after_the_warm_up(runs: Runs) -> None:
    def special(method: str, cells: int, rtol: float) -> Result | None:
        result = made_up_result(method, cells, rtol)
        return replace(result, x=None)

    runs.special = special
    with pytest.raises(ParameterError, match="cells of a one-dimensional body"):
        study(made_up(), **SMALL)
    assert len(runs.calls) == 1


def test_a_run_that_was_stopped_warns_of_the_heavier_ones(runs: Runs) -> None:
    def special(method: str, cells: int, rtol: float) -> Result | None:
        result = made_up_result(method, cells, rtol)
        if cells == 20:
            result.stats["wall_s"] = 25.0
            return replace(result, status="stopped")
        return result

    runs.special = special
    # 30 s are for the rows: 20 cells take 25 s of them, so that 40 cells cannot fit in the rest
    found = study(made_up(), methods=["fast"], cells=(10, 20, 40), rtols=(1e-3,), repeats=1, budget=60.0)
    assert [row.status for row in found.measurements] == ["completed", "stopped", "not run"]
    assert "stopped: after 25 s" in found.table()


def test_a_main_reference_beyond_the_budget_is_run_all_the_same(runs: Runs) -> None:
    found = study(made_up(), methods=["slow"], cells=[100], rtols=[1e-3], repeats=1, budget=3.0)
    assert found.reference is not None
    assert (found.reference.cells, found.reference.rtol) == (200, pytest.approx(1e-4))  # the cheapest of the ladder
    assert "the reference needed more than the budget" in found.table()


def test_a_method_that_does_not_get_through_its_first_run_is_left_out(runs: Runs) -> None:
    def special(method: str, cells: int, rtol: float) -> Result | None:
        return replace(made_up_result(method, cells, rtol), status="stopped") if method == "slow" else None

    runs.special = special
    found = study(made_up(), **SMALL)
    assert runs.calls.count(("slow", 10, 1e-3)) == 1
    assert {row.status for row in found.measurements if row.method == "slow"} == {"not run"}
    assert "slow: the first run had not ended after 30 s" in found.table()


def test_the_cost_of_a_heavier_run_is_foreseen() -> None:
    cost = Cost()
    assert cost.predict(100, 1e-4) == 0.0
    cost.add(10, 1e-3, 2.0)
    assert cost.predict(10, 1e-3) == pytest.approx(2.0)
    assert cost.predict(100, 1e-3) == pytest.approx(20.0)  # the usual power, 1, for want of better
    assert cost.predict(10, 1e-5) == pytest.approx(20.0)  # the usual power, 1/2
    for cells in (20, 40, 80, 160):
        cost.add(cells, 1e-3, 2.0 * (cells / 10) ** 2)
    assert cost.predict(320, 1e-3) == pytest.approx(2.0 * 32**2, rel=0.1)  # measured: the power 2
    cost.add(10, 1e-4, 2.1)
    assert cost.predict(10, 1e-6) >= 2.1 * 10.0  # not by the measured power, about 0, two decades further


def test_a_scene_warns_once(runs: Runs, caplog: pytest.LogCaptureFixture) -> None:
    log = logging.getLogger("multiphase")

    def special(method: str, cells: int, rtol: float) -> Result | None:
        log.warning("something about the scene")
        return None

    runs.special = special
    before = list(log.filters)
    with caplog.at_level(logging.WARNING, "multiphase"):
        study(made_up(), **SMALL)
    assert [record.getMessage() for record in caplog.records] == ["something about the scene"]
    assert log.filters == before


# -- what is shown ----------------------------------------------------------------------------------------------------


def written(found: Study, folder: Path) -> list[str]:
    found.to_csv(folder / "rows.csv")
    return (folder / "rows.csv").read_text(encoding="utf-8").splitlines()


def test_the_table_is_aligned_and_complete(runs: Runs) -> None:
    found = study(made_up(), **SMALL)
    lines = found.table().splitlines()
    head = next(i for i, line in enumerate(lines) if line.split()[:2] == ["method", "cells"])
    rows = lines[head + 1 : head + 9]
    end = lines[head].index("rtol") + len("rtol")
    assert [line[:end].split()[-1] for line in rows] == ["0.001", "0.0001"] * 4
    assert [line.startswith("*") for line in rows] == [row.pareto for row in found.measurements]
    assert any(row.pareto for row in found.measurements)
    text = " ".join(found.table().split())
    assert "references: fast, 80 cells" in text
    assert f"differ by {found.difference:.2g} in n" in text
    assert "fast, observed order in the cells, at rtol = 0.0001:" in text
    assert "machine: " in text
    assert "numpy " + np.__version__ in text
    assert "1 thread" in text


def test_the_csv_holds_the_numbers_in_full(runs: Runs, tmp_path: Path) -> None:
    found = study(made_up(), **SMALL)
    lines = written(found, tmp_path)
    assert any(line.startswith("# machine: ") for line in lines)
    rows = list(csv.DictReader(line for line in lines if not line.startswith("#")))
    assert len(rows) == 8
    for row, measurement in zip(rows, found.measurements, strict=True):
        assert (row["method"], int(row["cells"]), float(row["rtol"])) == (measurement.method, measurement.cells, measurement.rtol)
        assert (float(row["seconds"]), float(row["error_n"])) == (measurement.seconds, measurement.error)
        assert bool(int(row["pareto"])) == measurement.pareto
        assert row["against"] == measurement.against


def test_the_picture_shows_error_against_time(runs: Runs) -> None:
    found = study(made_up(), **SMALL)
    axes = found.figure().axes[0]
    assert (axes.get_xscale(), axes.get_yscale()) == ("log", "log")
    assert axes.get_xlabel() == "wall time of one run [s]"
    assert "error of $n$, relative" in axes.get_ylabel()
    lines = {line.get_label(): line for line in axes.get_lines()}
    row = [row_of(found, "fast", cells, 1e-4) for cells in (10, 20)]
    assert lines["fast, rtol = 0.0001"].get_xydata().tolist() == [[entry.seconds, entry.error] for entry in row]
    front = sorted((entry.seconds, entry.error) for entry in found.measurements if entry.pareto)
    assert lines["front"].get_drawstyle() == "steps-post"  # what the front reaches at a time, it keeps
    assert [tuple(point) for point in lines["front"].get_xydata().tolist()] == front
    legend = [text.get_text() for text in found.figure().subfigs[0].legends[0].get_texts()]
    assert legend == ["slow", "fast", "rtol = 0.001", "rtol = 0.0001", "Pareto front", "difference of the references"]


def test_saving_replaces_its_own_files_only(runs: Runs, tmp_path: Path) -> None:
    folder = tmp_path / "out"
    found = study(made_up(), **SMALL)
    first = found.save(folder)
    assert [path.name for path in first] == ["precision.txt", "precision.csv", "precision.png"]
    (folder / "mine.txt").write_text("keep", encoding="utf-8")
    (folder / "precision.txt").write_text("old", encoding="utf-8")
    found.save(folder)
    assert (folder / "precision.txt").read_text(encoding="utf-8") == found.table()
    assert (folder / "precision.png").read_bytes().startswith(b"\x89PNG")
    assert sorted(path.name for path in folder.iterdir()) == ["mine.txt", "precision.csv", "precision.png", "precision.txt"]


# -- the plaque, and the command --------------------------------------------------------------------------------------

PLAQUE = ["--set", "time.end=0.05", "--cells", "8,16", "--rtols", "1e-2", "--repeats", "1"]


@pytest.fixture(autouse=True)
def _clean(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """An empty working folder, and the log as it was."""
    monkeypatch.chdir(tmp_path)
    log = logging.getLogger("multiphase")
    handlers, level = log.handlers, log.level
    yield
    log.handlers = handlers
    log.setLevel(level)


def test_the_command_measures_the_plaque(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["precision", "plaque", *PLAQUE, "--methods", "fipy"]) == 0
    out, err = capsys.readouterr()
    folder = Path("plaque-precision")
    assert (folder / "precision.txt").read_text(encoding="utf-8") in out
    assert out.splitlines()[-3:] == [f"{folder / name} written" for name in ("precision.txt", "precision.csv", "precision.png")]
    assert err.splitlines()[0] == "fipy: warm-up"
    lines = (folder / "precision.csv").read_text(encoding="utf-8").splitlines()
    rows = list(csv.DictReader(line for line in lines if not line.startswith("#")))
    assert [(row["method"], row["cells"], row["status"]) for row in rows] == [("fipy", "8", "completed"), ("fipy", "16", "completed")]
    # the steps make a part of these errors, so no order is asked of them
    assert 0.0 < float(rows[1]["error_n"]) < float(rows[0]["error_n"]) < 0.05
    assert float(rows[0]["error_L"]) < 0.05


def test_a_run_beyond_its_limit_is_stopped() -> None:
    scene = load_scene("plaque", ["time.end=0.05"])
    runner = Bench(scene, 1.0, lambda line: None)
    assert runner.attempt("fipy", 8, 1e-2, limit=-1.0).status == "stopped"
    assert runner.attempt("fipy", 8, 1e-2, limit=1e6).status == "completed"


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--cells", "8,1"], "cells: 1 is not allowed"),
        (["--cells", "8;16"], '--cells: "8;16" is not a whole number'),
        (["--rtols", "1e-3,x"], '--rtols: "x" is not a number'),
        (["--methods", "fipi"], 'did you mean "fipy"?'),
        (["--budget", "0"], "budget: 0 s is not allowed"),
        (["-o", "missing/folder"], "its folder does not exist"),
        (["-o", ""], "-o: the name of the folder is empty"),
    ],
)
def test_the_command_refuses_in_one_paragraph(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, arguments: list[str], said: str
) -> None:
    monkeypatch.setattr(bench, "run", unused)
    assert main(["precision", "plaque", *arguments]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith("multiphase: ")
    assert err.count("\n") == 1
    assert said in err
    assert list(Path().iterdir()) == []


def test_the_command_refuses_a_file_in_the_place_of_its_folder(capsys: pytest.CaptureFixture[str]) -> None:
    Path("taken").touch()
    assert main(["precision", "plaque", "-o", "taken"]) == 2
    assert "taken is a file" in capsys.readouterr().err
    (Path("folder") / "precision.csv").mkdir(parents=True)
    assert main(["precision", "plaque", "-o", "folder"]) == 2
    assert "it is a folder" in capsys.readouterr().err


def test_the_command_fails_where_nothing_could_be_run(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(scene: Scene, **_: Any) -> Result:
        raise ParameterError("solver", "never.")

    monkeypatch.setattr(bench, "run", refuse)
    assert main(["precision", "plaque", *PLAQUE]) == 3
    assert "refused: solver: never." in capsys.readouterr().out
