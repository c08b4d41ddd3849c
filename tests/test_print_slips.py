"""What each slip of the print changes: the table of VERIFICATION.md is the benchmark's, and the benchmark is still about this source."""

from __future__ import annotations

from pathlib import Path

import pytest

from benchmarks import print_slips as slips

ROOT = Path(slips.__file__).resolve().parent.parent


def test_the_section_of_verification_is_the_stored_table():
    text = (ROOT / "VERIFICATION.md").read_text(encoding="utf-8")
    section = text.split("## The paper's slips, and what each changes\n")[1].split("\n## ")[0]
    lines = [line for line in section.splitlines() if line.startswith("| ") and not line.startswith(("| where", "| ---"))]
    assert lines == slips.summary(slips.stored())


def test_the_stored_table_has_every_slip_of_the_docs():
    found = dict.fromkeys((row["model"], row["where"], row["printed"], row["solved"]) for row in slips.stored())
    assert list(found) == [(model, *row) for model, row, _ in slips.slips()]


def test_every_quantity_that_is_measured_is_stored():
    for (model, row, slip), lines in zip(slips.slips(), slips.summary(slips.stored()), strict=True):
        stored = [entry for entry in slips.stored() if (entry["model"], entry["where"], entry["printed"]) == (model, *row[:2])]
        assert sum(bool(entry["quantity"]) for entry in stored) == sum(len(pair.quantities) for pair in slip.pairs)
        assert slip.remark in lines


def test_every_text_that_is_replaced_still_stands_in_its_file_once():
    texts = [(file, old) for edits in slips.EDITS.values() for file, old, _ in edits]
    assert [(file, old) for file, old in texts if (ROOT / file).read_text(encoding="utf-8").count(old) != 1] == []


def test_every_edit_is_used_and_made_in_a_copy(tmp_path):
    used = {form.edits for *_, slip in slips.slips() for pair in slip.pairs for form in (pair.solved, pair.printed)} - {""}
    assert used == set(slips.EDITS)
    slips.edited_tree(tmp_path, "lambda without alpha")  # the second text must still stand there once after the first
    edited = (tmp_path / slips.LAWS).read_text(encoding="utf-8")
    assert "own, other = 2.0 * mu * alpha + lam, lam" in edited
    assert edited != (ROOT / slips.LAWS).read_text(encoding="utf-8")


def test_a_text_that_no_longer_stands_there_stops_the_benchmark(tmp_path, monkeypatch):
    monkeypatch.setitem(slips.EDITS, "gone", ((slips.LAWS, "not there", ""),))
    with pytest.raises(SystemExit, match=r"tumour/equations\.py: 'not there' stands there 0 times"):
        slips.edited_tree(tmp_path, "gone")


def test_the_mobility_again():
    # 200 cells and a tenfold tolerance against the table's 400: 2e-4
    stored = next(row for row in slips.stored() if row["where"] == "(2.16), (2.17), (2.22c)" and row["quantity"] == "R(60)")
    for value, settings in ((stored["solved_value"], {}), (stored["printed_value"], {"parameters": {"mobility": "printed"}})):
        found = slips.run_disk("disk", settings, cells=200, rtol=1e-4)["R(60)"]
        assert found == pytest.approx(float(value), rel=1e-3)


def test_numbers_in_words():
    assert slips.change_of("R(60)", 4.0, 5.0) == "+25 %"
    assert slips.change_of("R(60)", 4.0, 3.9) == "−2.5 %"
    assert slips.change_of("L(40)", 5.0, 100.0) == "× 20"
    assert slips.change_of("L(40)", 1.0, -1.25) == "the other sign"
    assert slips.change_of("n(0)", 0.5, 0.25) == "−0.25"
    assert slips.change_of("n(0)", 0.5, 0.50001) == "the same"
