"""The table of mutations fits the sources, and nothing that is compiled outlives a change of what it is made of."""

from __future__ import annotations

import dis
import importlib
from pathlib import Path
from types import FunctionType, ModuleType
from typing import Any

import pytest

from multiphase import compiled
from multiphase.lines import Kernel
from plaque1d.lines_scheme import LDL
from plaque1d.semidiscrete import KERNEL as PLAQUE
from tumour.fem.kernel import KERNEL as MINI
from tumour.schemes import ELASTIC, VISCOUS

ROOT = Path(__file__).resolve().parent.parent


@pytest.fixture
def mutations(monkeypatch: pytest.MonkeyPatch) -> Any:
    monkeypatch.syspath_prepend(ROOT)
    return importlib.import_module("benchmarks.mutations")


def test_each_term_stands_where_it_should(mutations: Any) -> None:
    assert mutations.check() == []


def test_mutations_differ_and_are_python(mutations: Any) -> None:
    texts = set()
    for mutation in mutations.MUTATIONS:
        source = (ROOT / mutation.file).read_text(encoding="utf-8")
        text = mutation.of(source)
        compile(text, mutation.file, "exec")
        texts |= {source, text}
    files = {mutation.file for mutation in mutations.MUTATIONS}
    assert len(texts) == len(mutations.MUTATIONS) + len(files)
    assert len({mutation.row for mutation in mutations.MUTATIONS}) == len(mutations.MUTATIONS)


def test_their_tests_are_there(mutations: Any) -> None:
    files = {name for _, *groups in mutations.GROUPS for group in groups for name in group if name.endswith(".py")}
    assert [name for name in sorted(files) if not (ROOT / name).exists()] == []


def test_a_text_that_is_gone_or_stands_twice_is_told(mutations: Any) -> None:
    one = mutations.M("a", "b", "c.py", "x + y", "x - y")
    assert one.of("z = x + y") == "z = x - y"
    assert one._replace(times=2).of("x + y, x + y") == "x - y, x - y"
    for text, count in (("z = x * y", 0), ("x + y, x + y", 2)):
        with pytest.raises(LookupError, match=rf"a, b: 'x \+ y' stands {count} times in c.py, not 1"):
            one.of(text)


def add_called(function: Any, found: set[FunctionType]) -> None:
    """Add a function, plain or compiled, and all that it calls by name."""
    plain = getattr(function, "py_func", function)
    if not isinstance(plain, FunctionType) or plain in found:
        return
    found.add(plain)
    last: Any = None
    for step in dis.get_instructions(plain):
        if step.opname == "LOAD_GLOBAL":
            last = plain.__globals__.get(step.argval)
        elif step.opname in ("LOAD_ATTR", "LOAD_METHOD") and isinstance(last, ModuleType):
            last = getattr(last, step.argval, None)
        else:
            last = None
        add_called(last, found)


@pytest.mark.parametrize("kernel", [PLAQUE, LDL, ELASTIC, VISCOUS, MINI], ids=["plaque", "modLDL", "elastic", "viscous", "2D"])
def test_compiled_code_is_kept_under_all_that_it_is_made_of(kernel: Kernel, monkeypatch: pytest.MonkeyPatch) -> None:
    """Numba does not see that a function which a compiled one calls has changed in another file; the fingerprint must."""
    files: set[Path] = set()

    def keep(*names: str) -> str:
        files.update(Path(name) for name in names)
        return ""

    monkeypatch.setattr(compiled, "fingerprint", keep)
    Kernel.mark.func(kernel)
    called: set[FunctionType] = set()
    for module in kernel._modules:
        for function in vars(module).values():
            if hasattr(function, "py_func") and function.__module__ == module.__name__:
                add_called(function, called)
    for function in kernel._named.values():
        add_called(function, called)
    packages = {ROOT / name for name in ("multiphase", "plaque1d", "tumour")}  # ROOT may hold an environment as well
    own = {path for function in called if packages & set((path := Path(function.__code__.co_filename)).parents)}
    assert len(called) > 5
    assert own - files == set()
