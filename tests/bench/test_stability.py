"""Stiff and extreme cases: every quick one passes, and checks can fail."""

import csv
import math
from contextlib import redirect_stdout
from dataclasses import replace
from functools import partial
from io import StringIO

import numpy as np
import pytest

from bench import commands as command
from bench.stability import case as tables
from bench.stability import checks, models, random_contacts, surfaces
from bench.stability import setup as topographies
from bench.stability.case import (
    TABLES,
    Answer,
    Case,
    Finding,
    Refusal,
    cases_of,
    run_case,
)
from bench.stability.checks import contact_case, has_force, judge
from bench.stability.models import fitted, ordinary, solves_its_equations
from bench.stability.random_contacts import examine
from bench.stability.setup import Setup
from gen import statistics
from gen.runtime.errors import InputError
from gen.statistics import NAMES

LARGE = {"k = 9", "k = 10", "k = 11"}
SOME = {"Decision Tree", "SVM Regressor", "Kernel Ridge", "GP Regressor"}


def is_fast(table, case):
    """Whether a case takes seconds at most; tests/bem has some of the random contacts."""
    if table == "models":
        return case.name in SOME or case.family == "models: few rows"
    return not (
        case.slow
        or table in {"hardness", "edgeless"}
        or (table == "surfaces" and {case.name, case.name.partition(",")[0]} & LARGE)
    )


FAST = [case for table in TABLES for case in cases_of(table) if is_fast(table, case)]


@pytest.mark.long
@pytest.mark.parametrize("case", FAST, ids=lambda case: f"{case.family}: {case.name}")
def test_case(case):
    result = run_case(case)
    assert result.passed, result.failed


def refuse():
    raise InputError("too much: give less")


def refuse_in_two_lines():
    raise InputError("too much:\ngive less")


TOO_MUCH = Refusal(InputError, ("give less",))


@pytest.mark.parametrize(
    ("examine", "refusal", "passed"),
    [
        pytest.param(refuse, TOO_MUCH, True, id="as it has to be"),
        pytest.param(refuse_in_two_lines, TOO_MUCH, False, id="in two lines"),
        pytest.param(dict, TOO_MUCH, False, id="no error"),
        pytest.param(refuse, Refusal(ValueError, ()), False, id="another error"),
    ],
)
def test_input_has_to_be_refused_by_its_error_in_a_line(examine, refusal, passed):
    assert run_case(Case("test", "test", "", examine, refusal)).passed is passed


def test_a_warning_fails():
    def warn():
        np.float64(1.0) / np.float64(0.0)
        return Answer("", [Finding("nothing", 0, 0)])

    result = run_case(Case("test", "test", "", warn))
    assert not result.passed
    assert "warning divide by zero" in result.worst.name


def test_an_error_fails():
    broken = run_case(Case("test", "test", "", lambda: 1 / 0))
    assert broken.out == "division by zero"
    assert not broken.passed


def test_an_answer_without_findings_fails():
    assert not Answer("").passed


SMALL = partial(topographies.paper, 33)
SOUND = contact_case("one", "sound", SMALL, 12.0)
REFUSED = contact_case(
    "two", "refused", np.zeros(3), refusal=Refusal(ValueError, ("(3,)",))
)
WRONG_FORCE = (partial(has_force, "nothing", 0.0, 0.0),)
BROKEN = contact_case("two", "broken", SMALL, 12.0, checks=WRONG_FORCE)
SLOW = replace(SOUND, family="two", name="slow", slow=True)


def run_solver_table(cases, *options):
    """Exit code and output of the report on the solver with other cases."""
    output = StringIO()
    with pytest.MonkeyPatch.context() as patch, redirect_stdout(output):
        patch.setattr(tables, "cases_of", lambda _name: cases)
        code = command.main(["stability", "--of", "solver", *options])
    return code, output.getvalue()


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """Exit code, output and rows of a short run over three cases, one of which is slow."""
    folder = tmp_path_factory.mktemp("stability") / "new"
    code, output = run_solver_table([SOUND, REFUSED, SLOW], "-o", str(folder))
    with (folder / "stability.csv").open(encoding="utf-8", newline="") as file:
        return code, output, list(csv.DictReader(file))


def test_a_run_whose_cases_pass_succeeds_and_counts_them(written):
    code, output, _ = written
    assert code == 0
    assert "2 cases, 0 failed" in output


def test_a_short_run_leaves_out_slow_cases(written):
    _, _, rows = written
    assert [row["case"] for row in rows] == ["sound", "refused"]
    assert {row["verdict"] for row in rows} == {"passed"}


def test_a_row_holds_the_numbers_of_the_contact(written):
    _, _, (sound, _) = written
    assert float(sound["force_uN"]) == pytest.approx(CONTACT.force, rel=1e-6)
    assert int(sound["ordinary_iterations"]) > 0


def test_a_row_of_refused_input_holds_the_message_and_no_numbers(written):
    _, _, (_, refused) = written
    assert "heights have shape (3,)" in refused["message"]
    assert refused["force_uN"] == refused["iterations"] == ""


def test_a_full_run_has_slow_cases_too():
    code, output = run_solver_table([SOUND, REFUSED, SLOW], "--full")
    assert code == 0
    assert "3 cases, 0 failed" in output


def test_a_run_with_a_failed_case_fails_and_names_it():
    code, output = run_solver_table([SOUND, BROKEN])
    assert code == 1
    assert "2 cases, 1 failed" in output
    assert "two, broken: force off nothing" in output


PROBLEM = Setup(SMALL(), 12.0)
CONTACT = PROBLEM.solve()


def with_pressure(change):
    """The contact with another pressure, and all that it states about it made to fit."""
    pressure = change(CONTACT.pressure.copy())
    share = 100 * float((pressure > 0).mean())
    residual = checks.violation(PROBLEM, pressure)
    force = float(pressure.sum()) * PROBLEM.cell[0] * PROBLEM.cell[1]
    return replace(
        CONTACT, pressure=pressure, force=force, area_percent=share, residual=residual
    )


def without_smallest(pressure):
    pressure.flat[np.nanargmin(np.where(pressure > 0, pressure, np.nan))] = 0.0
    return pressure


WRONG = {
    "1e-4 too large": lambda pressure: pressure * 1.0001,
    "off by one node": lambda pressure: np.roll(pressure, 1, axis=0),
    "without its smallest": without_smallest,
    "not a number": lambda pressure: pressure * np.nan,
}


def passes(findings):
    return all(finding.passed for finding in findings)


@pytest.mark.parametrize("wrong", WRONG)
def test_another_pressure_is_told(wrong):
    spoilt = with_pressure(WRONG[wrong])
    assert passes(checks.complementarity(PROBLEM, CONTACT))
    assert not passes(checks.complementarity(PROBLEM, spoilt))
    other = replace(PROBLEM, far_field="compliant").solve()
    assert not passes(checks.complementarity(PROBLEM, other))


def failed(asked, contact, **more):
    """Names of the findings that an answer fails by."""
    return [
        finding.name
        for finding in judge(asked, contact, **more).findings
        if not finding.passed
    ]


@pytest.mark.parametrize(
    ("stated", "told"),
    [
        ({"residual": CONTACT.residual + 1e-8}, "residual off"),
        ({"force": CONTACT.force * (1 + 1e-9)}, "force off its pressure"),
        ({"area_percent": CONTACT.area_percent + 1e-6}, "area off its nodes"),
    ],
)
def test_numbers_that_the_pressure_does_not_bear_out_fail(stated, told):
    assert not failed(PROBLEM, CONTACT)
    assert told in failed(PROBLEM, replace(CONTACT, **stated))


def test_many_iterations_fail_unless_a_case_takes_them():
    slow = replace(CONTACT, iterations=200)
    assert failed(PROBLEM, slow) == ["times ordinary"]
    assert not failed(PROBLEM, slow, largest_ratio=math.inf)
    endless = replace(CONTACT, iterations=PROBLEM.max_iterations + 1)
    assert failed(PROBLEM, endless, largest_ratio=math.inf) == ["iterations"]


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (lambda c: replace(c, force=1.001 * c.force), "force off least squares"),
        (lambda c: replace(c, pressure=0.999 * c.pressure), "nodes off least squares"),
    ],
)
def test_wrong_contacts_that_yield_are_told(monkeypatch, spoil, words):
    case = (
        range(11, 12),
        random_contacts.yielding_problem,
        random_contacts.judge_both_ways,
    )
    assert examine(*case).passed
    solve = Setup.solve
    monkeypatch.setattr(Setup, "solve", lambda asked: spoil(solve(asked)))
    assert words in examine(*case).failed


def turned(contact):
    return replace(contact, pressure=np.ascontiguousarray(contact.pressure[::-1]))


EDGELESS = random_contacts.edgeless_problem, random_contacts.judge_edgeless
PERIODIC = random_contacts.periodic_problem, random_contacts.judge_shift


@pytest.mark.parametrize(
    ("case", "spoil", "words"),
    [
        (EDGELESS, lambda c: replace(c, delta=1.001 * c.delta), "gap"),
        (EDGELESS, turned, "pressure off the reference"),
        (PERIODIC, turned, "pressure off"),
    ],
)
def test_wrong_contacts_without_edges_are_told(case, spoil, words):
    seeds, (draw, compare) = range(16, 17), case
    assert examine(seeds, draw, compare).passed

    def spoilt(asked, contact):
        return compare(asked, spoil(contact))

    assert words in examine(seeds, draw, spoilt).failed


@pytest.mark.parametrize("name", NAMES[::8])
def test_a_statistic_that_is_wrong_fails(name, monkeypatch):
    rough = surfaces.rough(17)
    found = statistics.describe(rough, 2.0)
    assert surfaces.described(rough, (2.0, 2.0)).passed
    value = found.values[name]
    for wrong in (value + 1e-10 * max(1.0, abs(value)), math.nan):
        other = replace(found, values=found.values | {name: wrong})
        monkeypatch.setattr(surfaces, "describe", lambda *_, other=other: other)
        assert not surfaces.described(rough, (2.0, 2.0)).passed


@pytest.fixture(scope="module")
def ridge():
    """Our kernel ridge regression, fitted to ordinary rows."""
    return fitted("kernel-ridge", "tuned", ordinary())


def test_rows_far_outside_that_are_not_flagged_fail(ridge):
    assert passes(models.flagged(ridge))
    low = ridge.surrogate.low - np.inf
    high = ridge.surrogate.high + np.inf
    near = replace(ridge.surrogate.distance, limit=np.inf)
    wide = replace(ridge.surrogate, low=low, high=high, distance=near)
    assert not passes(models.flagged(replace(ridge, surrogate=wide)))


def test_coefficients_that_do_not_solve_the_equations_fail(ridge, monkeypatch):
    assert passes(solves_its_equations(ridge))
    wrong = ridge.estimator.dual_coef_ * (1 + 1e-6)
    monkeypatch.setattr(ridge.estimator, "dual_coef_", wrong)
    assert not passes(solves_its_equations(ridge))


def test_a_fit_worse_than_a_constant_without_a_warning_fails():
    tree = fitted("decision-tree", "default", ordinary())
    other = replace(tree, train=replace(tree.train, target=tree.train.target[::-1]))
    assert [f.name for f in models.sound(other) if not f.passed] == [
        "worse than a constant, unsaid"
    ]
