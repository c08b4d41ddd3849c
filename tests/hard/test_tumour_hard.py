"""Every hard case of the tumour does what `tumour_cases.py` states; `benchmarks/hard.py` prints the same as a table."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import tumour_cases as hard
from judging import judge, number

from multiphase.run import run

BY_NAME = {(case.kind, case.name): case for case in hard.CASES}
ELASTIC = BY_NAME[hard.ELASTIC, "soft, sphere, radau"]
VISCOUS = BY_NAME[hard.VISCOUS, "kappa 1e4, disk, radau"]
PLANE = BY_NAME[hard.PLANE, "no contact stress, quarter disk"]


@pytest.mark.parametrize("case", hard.CASES, ids=lambda case: f"{case.kind}: {case.name}")
def test_hard_case(case: hard.Case) -> None:
    assert judge(case).wrong == []


def test_every_case_has_a_name_of_its_own_and_radial_ones_run_in_all_shapes_and_with_both_schemes() -> None:
    assert len(BY_NAME) == len(hard.CASES)
    found: dict[tuple[str, str], set[tuple[str, str]]] = {}
    for case in hard.CASES:
        if case.must == "finishes" and case.kind != hard.PLANE:
            found.setdefault((case.kind, case.title), set()).add((case.shape, case.scheme))
    whole = {(shape, scheme) for shape in hard.SHAPES for scheme in hard.SCHEMES}
    assert {title for (_, title), of in found.items() if of != whole} == {"no ceiling"}  # the sphere's has none


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"must": "fails"}, "it finished"),
        ({"must": "refuses"}, "it finished"),
        ({"parameters": {"lambda_alpha": -1.0}}, "refused: parameters.lambda_alpha"),
        ({"parameters": {"p_out": 2.0, "kappa": 0.0}}, "it failed: no equilibrium"),
        ({"parameters": {"p_out": 1.0}}, "it failed: no step from t"),
        ({"parameters": {"p_out": 1.0}, "must": "fails", "words": ("no such words",)}, 'does not say "no such words"'),
        ({"parameters": {"p_out": 1.0}, "must": "fails", "until": 0.1}, "beyond 0.1"),
        ({"parameters": {"p_out": 1.0}, "must": "fails", "reached": 1.0}, "only t = "),
        ({"parameters": {"alpha_min": 0.5}}, "it warns: alpha_min"),
        ({"solver": {"cells": 100, "max_steps": 400}, "most": 10}, "more than 10 together"),
        ({"accuracy": 1e-9}, "error in time"),
        ({"warns": ("no such words",)}, "no warning says"),
        ({"limits": (hard.RESTS,)}, "R returns to 1"),
        ({"limits": (hard.DIES,)}, "2 % of the cells"),
        ({"limits": (hard.NECROTIC,)}, "a twentieth is necrotic"),
        ({"limits": (hard.FULL_OXYGEN,)}, "C strays"),
        ({"limits": (hard.INCOMPRESSIBLE,)}, "alpha Sigma"),
        ({"limits": (hard.COMES_TO_REST,)}, "comes to rest"),
        ({"limits": (hard.slower("slower", lambda_alpha=10.0),)}, "not so: slower"),
        ({"limits": (hard.as_changed("as kappa = 2", 1e-4, kappa=2.0),)}, "as kappa = 2"),
        ({"limits": (hard.as_changed("cannot be", 1e-4, p_out=2.0, kappa=0.0, lambda_alpha=0.0),)}, "a run to compare with failed"),
        ({"limits": (number("R", "radius", 1.0, 0.1),)}, "not 1 to"),
    ],
    ids=lambda value: value if isinstance(value, str) else ", ".join(value),
)
def test_the_judge_notices(changes: dict[str, Any], words: str) -> None:
    outcome = judge(replace(ELASTIC, **changes))
    assert any(words in line for line in outcome.wrong)


@pytest.mark.parametrize(
    ("case", "name", "change", "words"),
    [
        (ELASTIC, "alpha", -1.0, "alpha from"),
        (VISCOUS, "alpha", 0.3, "alpha from"),
        (ELASTIC, "J", -5.0, "J falls"),
        (ELASTIC, "C", -1.0, "C falls"),
        (ELASTIC, "C_min", -0.5, "C falls"),
        (PLANE, "C", -1.0, "C falls"),
        (VISCOUS, "C", 0.01, "C rises"),
        (ELASTIC, "defect_cells", 2e-11, "a defect"),
        (PLANE, "defect_volume", 2e-5, "a defect"),
        (ELASTIC, "cell_mass", 1e-9, "the sum of cells"),
        (VISCOUS, "cell_mass", 1e-9, "the sum of cells"),
        (ELASTIC, "radius", 1e-9, "the sum of size"),
        (ELASTIC, "J", 1e-9, "the sum of volume"),
        (VISCOUS, "p", np.nan, "p is not finite"),
    ],
    ids=lambda value: value.kind if isinstance(value, hard.Case) else str(value),
)
def test_the_judge_notices_in_a_result(case: hard.Case, name: str, change: float, words: str) -> None:
    """One quantity tampered with."""
    scene = case.load()
    result = run(scene)
    assert case.wrong_rows(result, scene) == []
    result[name][...] += change
    assert any(words in line for line in case.wrong_rows(result, scene))


def test_the_judge_notices_a_body_that_shrinks_or_loses_its_shape() -> None:
    scene = VISCOUS.load()
    result = run(scene)
    result["radius"][5] = result["radius"][4] - 1e-2
    assert "R rises" in hard.GROWS.check(result, scene)
    scene = PLANE.load()
    result = run(scene)
    assert hard.ROUND.check(result, scene) == hard.STAYS.check(result, scene) == ""
    result["asymmetry"][...] += 0.1
    result["radius"][-1] += 0.1
    assert "stays round" in hard.ROUND.check(result, scene)
    assert "R stays" in hard.STAYS.check(result, scene)
