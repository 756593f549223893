"""Cases and their verdicts, and the tables: every quick case passes, and the command shows it."""

import csv
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from bench import __main__ as command
from bench.stability import case as tables
from bench.stability import setup as topographies
from bench.stability.case import TABLES, Answer, Case, Finding, Refusal, cases_of, run_case
from bench.stability.checks import contact_case, has_force
from bench.stability.setup import Setup
from gen.runtime.errors import InputError


def test_what_was_to_be_refused_fails_without_an_error() -> None:
    refusal = Refusal(InputError, ("give less",))

    def refuse() -> None:
        raise InputError("too much: give less")

    assert run_case(Case("test", "test", "", refuse, refusal)).passed
    assert not run_case(Case("test", "test", "", dict, refusal)).passed
    assert not run_case(Case("test", "test", "", refuse, Refusal(ValueError, ()))).passed


def test_warnings_and_errors_fail() -> None:
    def warn() -> Answer:
        np.float64(1.0) / np.float64(0.0)
        return Answer("", [Finding("nothing", 0, 0)])

    result = run_case(Case("test", "test", "", warn))
    assert not result.passed
    assert "warning divide by zero" in result.worst.what
    broken = run_case(Case("test", "test", "", lambda: 1 / 0))
    assert broken.out == "division by zero"
    assert not broken.passed
    assert not Answer("").passed


def test_a_missing_extra_ends_the_table_and_is_no_failed_case():
    def learn() -> Answer:
        raise ModuleNotFoundError("No module named 'mapie'", name="mapie")

    with pytest.raises(ModuleNotFoundError, match="mapie"):
        run_case(Case("test", "test", "", learn))


LARGE = {"k = 9", "k = 10", "k = 11"}
MODELS = {"Decision Tree", "SVM Regressor", "Kernel Ridge", "GP Regressor"}


def is_fast(table: str, case: Case) -> bool:
    """Whether a case takes seconds at most; the tests of random contacts draw some of them."""
    if table == "models" and case.family.startswith("models: "):
        return case.name in MODELS or case.family == "models: few rows"
    return not (
        case.slow
        or table in {"hardness", "edgeless"}
        or (table == "surfaces" and {case.name, case.name.partition(",")[0]} & LARGE)
    )


FAST = [case for table in TABLES for case in cases_of(table) if is_fast(table, case)]


@pytest.mark.long
@pytest.mark.parametrize("case", FAST, ids=lambda case: f"{case.family}: {case.name}")
def test_case(case: Case) -> None:
    result = run_case(case)
    assert result.passed, result.failed


@pytest.mark.parametrize("table", TABLES)
def test_names_are_unique_and_families_stand_together(table: str) -> None:
    names = [(case.family, case.name) for case in cases_of(table)]
    families = [family for family, _ in names]
    assert len(set(names)) == len(names)
    assert families == sorted(families, key=families.index)


SMALL = partial(topographies.paper, 33)
SOUND = contact_case("one", "sound", SMALL, 12.0)
TWO = (
    SOUND,
    contact_case("two", "refused", np.zeros(3), refusal=Refusal(ValueError, ("(3,)",))),
)
BROKEN = contact_case(
    "two", "broken", SMALL, 12.0, checks=(partial(has_force, "nothing", 0.0, 0.0),)
)
SLOW = replace(SOUND, family="two", name="slow", slow=True)


@pytest.fixture
def holding(monkeypatch: pytest.MonkeyPatch) -> Callable[..., None]:
    """Puts other cases into all tables."""

    def put(*cases: Case) -> None:
        monkeypatch.setattr(tables, "cases_of", lambda _name: cases)

    return put


SOLVER: Sequence[str] = ["stability", "--of", "solver"]


def test_command_prints_and_writes_the_table(
    tmp_path: Path, holding: Callable[..., None], capsys: pytest.CaptureFixture[str]
) -> None:
    holding(*TWO, SLOW)
    assert command.main([*SOLVER, "-o", str(tmp_path / "new")]) == 0
    printed = capsys.readouterr().out
    assert "2 cases, 0 failed" in printed
    assert "heights have shape (3,)" in printed
    with (tmp_path / "new" / "stability.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["case"] for row in rows] == ["sound", "refused"]
    assert {row["verdict"] for row in rows} == {"passed"}
    assert float(rows[0]["force_uN"]) == Setup(SMALL(), 12.0).solve().force
    assert int(rows[0]["ordinary_iterations"]) > 0
    assert rows[1]["force_uN"] == rows[1]["iterations"] == ""
    assert command.main([*SOLVER, "--full"]) == 0
    assert "3 cases, 0 failed" in capsys.readouterr().out


def test_command_fails_with_a_case(
    tmp_path: Path, holding: Callable[..., None], capsys: pytest.CaptureFixture[str]
) -> None:
    holding(*TWO, BROKEN)
    assert command.main([*SOLVER, "-o", str(tmp_path)]) == 1
    printed = capsys.readouterr().out
    assert "3 cases, 1 failed" in printed
    assert "two, broken: force off nothing" in printed
    assert ",failed," in (tmp_path / "stability.csv").read_text(encoding="utf-8")
