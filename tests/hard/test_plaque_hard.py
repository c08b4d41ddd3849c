"""Every hard case does what `cases.py` states; `benchmarks/plaque_hard.py` prints the same as a table."""

from __future__ import annotations

import importlib.util
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

HERE = Path(__file__).resolve().parent


def _load():
    spec = importlib.util.spec_from_file_location("hard_cases", HERE / "cases.py")
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


hard = _load()


@pytest.mark.parametrize("case", hard.CASES, ids=lambda case: case.name)
def test_hard_case(case):
    outcome = hard.judge(case)
    assert outcome.wrong == []
    assert sum(outcome.cost) <= 5000


def test_every_scene_is_a_case_and_says_what_is_hard():
    files = {path.stem for path in HERE.glob("*.toml")}
    assert files == {case.scene for case in hard.CASES if not case.scene.startswith("plaque-")}
    assert len({case.name for case in hard.CASES}) == len(hard.CASES)
    assert all(hard.load_scene(path).title for path in HERE.glob("*.toml") if path.stem not in ("drag-inviscid-refused", "l-0-k-0.5"))


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
    outcome = hard.judge(replace(hard.CASES[0], **changes))
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
    scene = hard.load_scene(HERE / "n-0.toml")
    result = hard.run(scene)
    assert hard._wrong_rows(result, scene) == []
    result[name][...] += change
    assert any(words in line for line in hard._wrong_rows(result, scene))
