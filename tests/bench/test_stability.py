"""Stiff and extreme cases: every quick one passes, and checks can fail."""

import csv
import math
from dataclasses import replace
from functools import partial

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


def test_what_was_to_be_refused_fails_without_an_error():
    refusal = Refusal(InputError, ("give less",))

    def refuse():
        raise InputError("too much: give less")

    def in_two_lines():
        raise InputError("too much:\ngive less")

    assert run_case(Case("test", "test", "", refuse, refusal)).passed
    assert not run_case(Case("test", "test", "", in_two_lines, refusal)).passed
    assert not run_case(Case("test", "test", "", dict, refusal)).passed
    assert not run_case(Case("test", "test", "", refuse, Refusal(ValueError, ()))).passed


def test_warnings_and_errors_fail():
    def warn():
        np.float64(1.0) / np.float64(0.0)
        return Answer("", [Finding("nothing", 0, 0)])

    result = run_case(Case("test", "test", "", warn))
    assert not result.passed
    assert "warning divide by zero" in result.worst.name
    broken = run_case(Case("test", "test", "", lambda: 1 / 0))
    assert broken.out == "division by zero"
    assert not broken.passed
    assert not Answer("").passed


SMALL = partial(topographies.paper, 33)
SOUND = contact_case("one", "sound", SMALL, 12.0)
REFUSED = contact_case(
    "two", "refused", np.zeros(3), refusal=Refusal(ValueError, ("(3,)",))
)
WRONG_FORCE = (partial(has_force, "nothing", 0.0, 0.0),)
BROKEN = contact_case("two", "broken", SMALL, 12.0, checks=WRONG_FORCE)
SLOW = replace(SOUND, family="two", name="slow", slow=True)


def test_command_writes_the_table_and_fails_with_a_case(tmp_path, monkeypatch, capsys):
    cases = [SOUND, REFUSED, SLOW]
    monkeypatch.setattr(tables, "cases_of", lambda _name: cases)
    solver = ["stability", "--of", "solver"]
    assert command.main([*solver, "-o", str(tmp_path / "new")]) == 0
    assert "2 cases, 0 failed" in capsys.readouterr().out
    with (tmp_path / "new" / "stability.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["case"] for row in rows] == ["sound", "refused"]
    assert {row["verdict"] for row in rows} == {"passed"}
    force = Setup(SMALL(), 12.0).solve().force
    assert float(rows[0]["force_uN"]) == pytest.approx(force, rel=1e-6)
    assert int(rows[0]["ordinary_iterations"]) > 0
    assert "heights have shape (3,)" in rows[1]["message"]
    assert rows[1]["force_uN"] == rows[1]["iterations"] == ""
    assert command.main([*solver, "--full"]) == 0
    assert "3 cases, 0 failed" in capsys.readouterr().out
    cases.append(BROKEN)
    assert command.main([*solver, "-o", str(tmp_path)]) == 1
    printed = capsys.readouterr().out
    assert "3 cases, 1 failed" in printed
    assert "two, broken: force off nothing" in printed


ASKED = Setup(SMALL(), 12.0)
CONTACT = ASKED.solve()


def with_pressure(change):
    """The contact with another pressure, and all that it states about it made to fit."""
    pressure = change(CONTACT.pressure.copy())
    share = 100 * float((pressure > 0).mean())
    residual = checks.violation(ASKED, pressure)
    force = float(pressure.sum()) * ASKED.cell[0] * ASKED.cell[1]
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


def verdict(check, asked, contact):
    return all(finding.passed for finding in check(asked, contact))


@pytest.mark.parametrize("wrong", WRONG)
def test_another_pressure_is_told(wrong):
    spoilt = with_pressure(WRONG[wrong])
    assert verdict(checks.complementarity, ASKED, CONTACT)
    assert not verdict(checks.complementarity, ASKED, spoilt)
    other = replace(ASKED, far_field="compliant").solve()
    assert not verdict(checks.complementarity, ASKED, other)


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
    assert not failed(ASKED, CONTACT)
    assert told in failed(ASKED, replace(CONTACT, **stated))


def test_many_iterations_fail_unless_a_case_takes_them():
    slow = replace(CONTACT, iterations=200)
    assert failed(ASKED, slow) == ["times ordinary"]
    assert not failed(ASKED, slow, largest_ratio=math.inf)
    endless = replace(CONTACT, iterations=ASKED.max_iterations + 1)
    assert failed(ASKED, endless, largest_ratio=math.inf) == ["iterations"]


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


def test_wrong_coefficients_an_unflagged_row_and_silent_nonsense_fail():
    ridge = fitted("kernel-ridge", "tuned", ordinary())
    assert all(finding.passed for finding in models.flagged(ridge))
    low, high = ridge.surrogate.low - np.inf, ridge.surrogate.high + np.inf
    near = replace(ridge.surrogate.distance, limit=np.inf)
    wide = replace(ridge.surrogate, low=low, high=high, distance=near)
    assert not all(each.passed for each in models.flagged(replace(ridge, surrogate=wide)))
    assert all(finding.passed for finding in solves_its_equations(ridge))
    ridge.estimator.dual_coef_ = ridge.estimator.dual_coef_ * (1 + 1e-6)
    assert not all(finding.passed for finding in solves_its_equations(ridge))
    tree = fitted("decision-tree", "default", ordinary())
    other = replace(tree, train=replace(tree.train, target=tree.train.target[::-1]))
    assert [f.name for f in models.sound(other) if not f.passed] == [
        "worse than a constant, unsaid"
    ]
