"""The solver's table of stiff and extreme cases, and proof that its checks can fail."""

import csv
import math
import subprocess
import sys
import warnings
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import bem
from bem import half_space
from bem.influence import KERNELS
from bench import __main__ as command
from bench.page.content import Absent, Table
from bench.stability import report
from bench.stability.contents import FILES, contents
from bench.stability.finding import Finding, Refusal
from bench.stability.sheet import Sheet
from bench.stability.solver import checks, topographies
from bench.stability.solver.case import Case, Result, judge, run, run_case
from bench.stability.solver.checks import Check
from bench.stability.solver.setup import Setup, pressed
from bench.stability.solver.sheet import SHEET
from bench.stability.solver.table import CASES


@pytest.mark.parametrize(
    "case",
    [case for case in CASES if not case.slow],
    ids=lambda case: f"{case.family}: {case.name}",
)
def test_case(case: Case) -> None:
    result = run_case(case)
    wrong = [str(f) for f in (*result.findings, *result.conduct) if not f.passed]
    assert result.passed, "; ".join(wrong)


def test_names_are_unique_and_families_stand_together() -> None:
    names = [(case.family, case.name) for case in CASES]
    families = [family for family, _ in names]
    assert len(set(names)) == len(names)
    assert families == sorted(families, key=families.index)


def test_what_was_promised_is_in_the_table() -> None:
    names = {case.name for case in CASES}
    assert {f"k = {k}" for k in range(1, 12)} <= names
    assert {"E = 1e-12 MPa", "E = 1e+15 MPa", "ν = -0.99", "ν = 0.5"} <= names
    assert {"L = 1e-09 um", "L = 1e+09 um", "H = 0.01", "H = 0.99"} <= names
    for kernel in KERNELS:
        assert {f"Δ = {share:g} Δ*, {kernel}" for share in (0.9, 0.99, 0.999, 2)} <= names


SMALL = pressed(partial(topographies.paper, 33), 12.0)
ASKED = SMALL()
CONTACT = ASKED.solve()


def with_pressure(change: Callable[[np.ndarray], np.ndarray]) -> bem.Contact:
    """The contact with another pressure, and all that it states about it made to fit."""
    pressure = change(CONTACT.pressure.copy())
    share = 100 * float((pressure > 0).mean())
    residual = checks.violation(ASKED, pressure)
    force = float(pressure.sum()) * ASKED.cell[0] * ASKED.cell[1]
    return replace(CONTACT, pressure=pressure, force=force, area_percent=share, residual=residual)


def without(node: str) -> Callable[[np.ndarray], np.ndarray]:
    """Takes the pressure off the node that carries most, or least."""

    def change(pressure: np.ndarray) -> np.ndarray:
        loaded = np.where(pressure > 0, pressure, np.nan)
        where = np.nanargmax(loaded) if node == "most" else np.nanargmin(loaded)
        pressure.flat[where] = 0.0
        return pressure

    return change


def in_tension(pressure: np.ndarray) -> np.ndarray:
    pressure[np.unravel_index(ASKED.surface.argmin(), pressure.shape)] = -1e-9
    return pressure


def on_the_lowest_node(pressure: np.ndarray) -> np.ndarray:
    pressure.flat[ASKED.surface.argmin()] = 1e-3 * pressure.max()
    return pressure


WRONG = {
    "1e-4 too large": lambda pressure: pressure * 1.0001,
    "1e-4 too small": lambda pressure: pressure * 0.9999,
    "turned": lambda pressure: pressure[::-1].copy(),
    "off by one node": lambda pressure: np.roll(pressure, 1, axis=0),
    "without its largest": without("most"),
    "without its smallest": without("least"),
    "on the lowest node": on_the_lowest_node,
    "in tension somewhere": in_tension,
    "nothing": np.zeros_like,
    "not a number": lambda pressure: pressure * np.nan,
    "infinite": lambda pressure: np.where(pressure > 0, np.inf, 0.0),
}


def verdict(check: Check, asked: Setup, contact: bem.Contact) -> bool:
    return all(finding.passed for finding in check(asked, contact))


@pytest.mark.parametrize("wrong", WRONG)
def test_complementarity_fails_for_any_other_pressure(wrong: str) -> None:
    assert verdict(checks.complementarity, ASKED, CONTACT)
    assert not verdict(checks.complementarity, ASKED, with_pressure(WRONG[wrong]))


@pytest.mark.parametrize("wrong", [name for name in WRONG if name != "in tension somewhere"])
def test_dense_solve_tells_another_pressure(wrong: str) -> None:
    check = checks.agrees_with_dense_solve(0.9e-4)
    assert verdict(check, ASKED, CONTACT)
    assert not verdict(check, ASKED, with_pressure(WRONG[wrong]))


@pytest.mark.parametrize(
    "other",
    [
        {"kernel": "concentrated-force"},
        {"far_field": "compliant"},
        {"modulus": 1.0001},
        {"poisson": 0.02},
        {"side": 999.9},
        {"delta": 12.001},
        {"heights": ASKED.surface.T},
    ],
    ids=str,
)
def test_the_answer_to_another_question_fails(other: dict[str, Any]) -> None:
    answer = replace(ASKED, **other).solve()
    assert not verdict(checks.complementarity, ASKED, answer)


@pytest.mark.parametrize(
    "stated",
    [
        {"residual": CONTACT.residual + 1e-8},
        {"residual": math.nan},
        {"force": CONTACT.force * (1 + 1e-9)},
        {"force": math.inf},
        {"area_percent": CONTACT.area_percent + 1e-6},
    ],
    ids=str,
)
def test_numbers_that_the_pressure_does_not_bear_out_fail(stated: dict[str, float]) -> None:
    case = Case("test", "test", SMALL)
    assert judge(case, ASKED, CONTACT).passed
    result = judge(case, ASKED, replace(CONTACT, **stated))
    assert all(finding.passed for finding in result.findings)
    assert not result.passed


def test_an_unconverged_answer_that_claims_to_be_converged_fails(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(half_space, "FEW_PER_ROOT", 0.0)  # else two iterations may be enough
    with pytest.raises(bem.NotConverged) as stopped:
        replace(ASKED, max_iterations=2).solve()
    unfinished = stopped.value.contact
    case = Case("test", "test", SMALL)
    assert not judge(case, ASKED, unfinished).passed
    liar = judge(case, ASKED, replace(unfinished, residual=1e-7))
    assert [f.what for f in liar.findings if not f.passed] == ["gap"]
    assert [f.what for f in liar.conduct if not f.passed] == ["residual off"]


def test_similarity_fails_for_another_force_or_another_node() -> None:
    setup = pressed(topographies.paper, modulus=3.0)()
    contact = setup.solve()
    assert verdict(checks.scales(3.0), setup, contact)
    assert not verdict(checks.scales(3.0 + 4e-15), setup, contact)
    moved = replace(contact, pressure=np.roll(contact.pressure, 1, axis=1))
    assert not verdict(checks.scales(3.0), setup, moved)


def test_closed_forms_fail_for_another_force() -> None:
    check = checks.has_force("a body", CONTACT.force, 1e-3)
    assert verdict(check, ASKED, CONTACT)
    assert not verdict(check, ASKED, replace(CONTACT, force=1.002 * CONTACT.force))
    assert not verdict(check, ASKED, replace(CONTACT, force=math.nan))


def test_equality_is_to_the_last_bit() -> None:
    check = checks.equals("a copy", np.array)
    assert verdict(check, ASKED, CONTACT)
    pressure = CONTACT.pressure.copy()
    pressure.flat[pressure.argmax()] = np.nextafter(pressure.max(), 0)
    assert not verdict(check, ASKED, replace(CONTACT, pressure=pressure))


def test_symmetry_fails_for_a_pressure_without_it() -> None:
    assert not verdict(checks.is_symmetric(), ASKED, CONTACT)
    assert verdict(checks.turns_with_surface(), ASKED, CONTACT)
    turned = replace(CONTACT, pressure=CONTACT.pressure[::-1])
    assert not verdict(checks.turns_with_surface(), ASKED, turned)


def fails_with(error: Exception) -> Setup:
    class Failing(Setup):
        def solve(self) -> bem.Contact:
            raise error

    return Failing(np.zeros((3, 3)))


@pytest.mark.parametrize(
    ("error", "refused"),
    [
        (ValueError("side = 0: must be above 0 um"), True),
        (ValueError("side = 0: must be above\n0 um"), False),
        (ValueError("side = 0: no"), False),
        (ValueError(""), False),
        (TypeError("side = 0: must be above 0 um"), False),
        (bem.NoSolution(1.0, 0.5), False),
    ],
    ids=repr,
)
def test_refusals_are_of_the_right_kind_and_say_what_is_allowed(
    error: Exception, refused: bool
) -> None:
    refusal = Refusal(ValueError, ("side = 0", "above 0 um"))
    case = Case("test", "test", partial(fails_with, error), refusal=refusal)
    assert run_case(case).passed is refused


def test_an_answer_where_a_refusal_is_due_fails() -> None:
    assert not run_case(Case("test", "test", SMALL, refusal=Refusal(ValueError, ()))).passed


def test_an_error_where_an_answer_is_due_is_a_failure_of_its_case_alone() -> None:
    broken = Case("test", "broken", partial(fails_with, ZeroDivisionError("by zero")))
    results = run([broken, Case("test", "sound", SMALL)])
    assert [result.passed for result in results] == [False, True]
    assert results[0].message == "by zero"


def test_warnings_fail() -> None:
    class Talkative(Setup):
        def solve(self) -> bem.Contact:
            warnings.warn("beware", RuntimeWarning, stacklevel=1)
            return super().solve()

    result = run_case(Case("test", "test", lambda: Talkative(ASKED.heights)))
    assert [f.what for f in result.conduct if not f.passed] == ["warnings beware"]


def test_many_iterations_need_a_reason() -> None:
    case = Case("test", "test", SMALL)
    slow = replace(CONTACT, iterations=200)
    assert not judge(case, ASKED, slow).passed
    explained = judge(replace(case, reason="stiff"), ASKED, slow)
    assert explained.passed
    assert explained.reason == "stiff"
    assert judge(replace(case, reason="stiff"), ASKED, CONTACT).reason == ""
    endless = replace(CONTACT, iterations=ASKED.max_iterations + 1)
    assert not judge(replace(case, reason="stiff"), ASKED, endless).passed


def test_nothing_proved_is_not_passed() -> None:
    assert not Result(Case("test", "test", SMALL), "", "").passed
    assert not Finding("error", math.nan, 1.0).passed


TWO = (
    Case("one", "sound", SMALL),
    Case("two", "refused", partial(Setup, np.zeros(3)), refusal=Refusal(ValueError, ("(3,)",))),
)
BROKEN = Case("two", "broken", SMALL, (checks.has_force("nothing", 0.0, 0.0),))
SLOW = Case("two", "slow", SMALL, slow=True)


@pytest.fixture
def holding(monkeypatch: pytest.MonkeyPatch) -> Callable[..., None]:
    """Puts other cases into the solver's table."""

    def put(*cases: Case) -> None:
        table = replace(SHEET, cases=cases)
        monkeypatch.setattr(report, "sheet", lambda _name: table)

    return put


SOLVER = ["stability", "--of", "solver"]


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
    assert float(rows[0]["force_uN"]) == CONTACT.force
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
    assert "3 cases, 1 failed: broken" in printed
    assert "FAILED" in printed
    assert ",failed," in (tmp_path / "stability.csv").read_text(encoding="utf-8")


def test_all_tables_are_run_unless_some_are_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def named(name: str) -> Sheet:
        return replace(SHEET, cases=TWO, file=FILES[name], title=name)

    monkeypatch.setattr(report, "sheet", named)
    assert command.main(["stability", "--of", "models", "-o", str(tmp_path)]) == 0
    assert [path.name for path in tmp_path.iterdir()] == ["models.csv"]
    shown = contents(tmp_path)
    assert [type(each) for each in shown] == [Absent, Absent, Absent, Table]
    assert command.main(["stability", "-o", str(tmp_path)]) == 0
    assert {path.name for path in tmp_path.iterdir()} == set(FILES.values())
    capsys.readouterr()
    assert command.main(["stability", "--of", "rivers"]) == 2
    assert "solver, loads, surfaces, models" in capsys.readouterr().err


def test_the_page_names_columns_that_are_there() -> None:
    for name, shown in zip(FILES, contents_of_all(), strict=True):
        header = report.sheet(name).header
        assert set(shown.columns) | {shown.verdict} <= set(header)


def contents_of_all() -> list[Any]:
    import tempfile

    with tempfile.TemporaryDirectory() as folder:
        for file in FILES.values():
            (Path(folder) / file).touch()
        return contents(Path(folder))


def test_failures_are_red_on_a_terminal(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("FORCE_COLOR", "1")
    SHEET.show(run([TWO[0], BROKEN]))
    lines = capsys.readouterr().out.splitlines()
    sound, broken, *_ = (line for line in lines if "sound" in line or "broken" in line)
    assert "\x1b[31m" in broken
    assert "\x1b[31m" not in sound


def test_folders_are_refused_before_anything_is_solved(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(report, "sheet", lambda _name: pytest.fail("ran"))
    (tmp_path / "taken").touch()
    assert command.main(["stability", "-o", str(tmp_path / "taken")]) == 2
    assert len(capsys.readouterr().err.splitlines()) == 1


def test_help_imports_no_numerics(tmp_path: Path) -> None:
    code = "import sys; from bench.__main__ import main; assert main(['stability', '--help']) == 0;"
    code += "assert not {'numpy', 'scipy', 'pyfftw', 'h5py', 'matplotlib'} & sys.modules.keys()"
    command_line = [sys.executable, "-c", code]
    done = subprocess.run(command_line, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
