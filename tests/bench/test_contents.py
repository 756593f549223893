"""What the page shows: tables of few digits, and lines at its top that are computed from them."""

import lzma
from pathlib import Path

import pytest
from page_parts import written

from bench.answers import FIRST, FREE, FURTHER, lines
from bench.contents import Table, tabulated
from bench.record import Inputs
from bench.report import PARTS
from gen.quantities import IN_LAWS, typographic
from gen.runtime.errors import InputError


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("", ""),
        ("infinity", "infinity"),
        ("inf", "∞"),
        ("15878", "15,878"),
        ("0.30000000000000004", "0.3"),
        ("1.23456e-12", "1.235e-12"),
        ("some words", "some words"),
    ],
)
def test_numbers_are_short(text, expected, tmp_path):
    data = written("data.csv", [["value", "other"], [text, 1]], tmp_path)
    assert tabulated(Table(data, "")).rows[0][0].text == expected


def test_large_forces_are_shown_in_newtons(tmp_path):
    rows: list[list[object]] = [
        ["force_uN", "hardness_MPa"],
        [5.0784e7, 2000],
        ["", "inf"],
    ]
    table = tabulated(Table(written("data.csv", rows, tmp_path), ""))
    assert [title.text for title in table.titles] == ["force [N]", "hardness [MPa]"]
    assert [[cell.text for cell in row] for row in table.rows] == [
        ["50.78", "2000"],
        ["", "∞"],
    ]


def test_columns_of_quantities_are_shown_with_their_units(tmp_path):
    units = {
        name: typographic(quantity.law_unit)
        for name, quantity in IN_LAWS.items()
        if quantity.law_unit not in {"1", "%"}
    }
    (tmp_path / "a.csv").write_text(",".join(units) + "\n" + ",".join("1" * len(units)))
    titles = tabulated(Table(tmp_path / "a.csv", "")).titles
    for title, unit in zip(titles, units.values(), strict=True):
        assert title.text.endswith(f" [{unit}]")


def test_tables_without_a_column_are_refused(tmp_path):
    data = written("data.csv", [["value"], [1]], tmp_path)
    with pytest.raises(InputError, match="has no column nothing"):
        tabulated(Table(data, "", columns=("nothing",)))
    with pytest.raises(InputError, match="cannot be read as a table"):
        tabulated(Table(tmp_path / "none.csv", ""))


def test_a_compressed_table_is_read_as_the_table(tmp_path):
    data = written("data.csv", [["value", "note"], [1.5, "a"]], tmp_path)
    plain = tabulated(Table(data, ""))
    (tmp_path / "data.csv.xz").write_bytes(lzma.compress(data.read_bytes()))
    data.unlink()
    assert tabulated(Table(data, "")) == plain
    (tmp_path / "data.csv.xz").write_bytes(b"no xz")
    with pytest.raises(InputError, match=r"data.csv.xz cannot be read"):
        tabulated(Table(data, ""))


RESULTS = Path(__file__).resolve().parents[2] / "bench" / "results"


def test_all_questions_are_answered_by_what_is_published():
    inputs = Inputs(RESULTS, None, None, full=True)
    questions = (*FIRST, *FURTHER)
    answers = lines(PARTS, inputs, questions)
    assert [line.question for line in answers] == [
        question.text for question in questions
    ]
    assert all(line.answer.endswith(".") and len(line.answer) < 280 for line in answers)
    assert all(line.command.startswith("asperity bench ") for line in answers[:6])


def test_what_is_not_there_is_not_listed(tmp_path):
    (tmp_path / "grow").mkdir()
    (tmp_path / "grow" / "grow.csv").write_text(
        "asked,seed\n3,1\n"
    )  # lacks what is asked
    assert lines(PARTS, Inputs(tmp_path, None, None, full=False), FURTHER) == []


def test_the_fastest_other_solver_is_chosen_case_by_case():
    times = {("1", "bem"): 1, ("1", "A"): 5, ("1", "B"): 9, ("2", "A"): 8, ("2", "B"): 7}
    times |= {
        ("2", "paper's NNLS"): 2,
        ("2", "C"): "",
    }  # another algorithm, one that failed
    rows = [
        {
            "nodes": "9",
            "hurst": "1",
            "delta_um": delta,
            "solver": solver,
            "times_ours": str(each),
        }
        for (delta, solver), each in times.items()
    ]
    assert "takes 5 to 7 times" in FREE(rows)
