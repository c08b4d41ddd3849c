"""Every hard case of the plaque does what `cases.py` states; `benchmarks/hard.py` prints the same as a table."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cases as hard
import numpy as np
import pytest
from judging import judge

from multiphase.run import run
from multiphase.scene import load_scene

HERE = Path(__file__).resolve().parent


@pytest.mark.parametrize("case", hard.CASES, ids=lambda case: case.name)
def test_hard_case(case):
    outcome = judge(case)
    assert outcome.wrong == []
    assert sum(outcome.cost) <= 5000


def test_every_scene_is_a_case_and_says_what_is_hard():
    files = {path.stem for path in HERE.glob("*.toml")}
    assert files == {case.scene for case in hard.CASES if not case.scene.startswith("plaque-")}
    assert len({case.name for case in hard.CASES}) == len(hard.CASES)
    assert all(load_scene(path).title for path in HERE.glob("*.toml") if path.stem not in ("drag-inviscid-refused", "l-0-k-0.5"))


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"must": "fails"}, "it finished"),
        ({"must": "refuses"}, "it finished"),
        ({"most": 10}, "more than 10 together"),
        ({"accuracy": 1e-9}, "error in time"),
        ({"warns": ("no such words",)}, "no warning says"),
        ({"limits": (hard.near("as without reactions", "no-reactions", 1e-3),)}, "as without reactions"),
        ({"limits": (hard.number("L", "L", 1.0, 0.1),)}, "not 1 to"),
        ({"limits": (hard.throughout("L stays", "L", None, 0.1),)}, "L strays"),
        ({"limits": (hard.deep_fraction(0.05),)}, "n deep inside"),
    ],
)
def test_the_judge_notices(changes, words):
    outcome = judge(replace(hard.CASES[0], **changes))
    assert any(words in line for line in outcome.wrong)


@pytest.mark.parametrize(
    ("name", "change", "words"),
    [
        ("n", -1e-9, "n from"),
        ("n", 1.0, "n from"),
        ("l", -2.0, "l falls"),
        ("L", np.linspace(0.0, -2.0, 51), "L falls"),
        ("defect_n", 2e-11, "a defect"),
        ("n_total", np.linspace(0.0, 1e-8, 51), "the identity"),
        ("p_n", np.nan, "p_n is not finite"),
    ],
)
def test_the_judge_notices_in_a_result(name, change, words):
    """The reference problem, with one quantity tampered with."""
    case = hard.Case("n-0")
    scene = case.load()
    result = run(scene)
    assert case.wrong_rows(result, scene) == []
    result[name][...] += change
    assert any(words in line for line in case.wrong_rows(result, scene))
