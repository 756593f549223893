"""Proof that the checks of contacts can fail."""

import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pytest

import bem
from bem.operators import patch
from bench.stability import checks
from bench.stability import setup as topographies
from bench.stability.case import Case, Refusal, run_case
from bench.stability.checks import Check, judge, solve
from bench.stability.setup import Setup

SMALL = partial(topographies.paper, 33)
DELTA = 12.0
ASKED = Setup(SMALL(), DELTA)
CONTACT = ASKED.solve()


def with_pressure(change: Callable[[np.ndarray], np.ndarray]) -> bem.Contact:
    """The contact with another pressure, and all that it states about it made to fit."""
    pressure = change(CONTACT.pressure.copy())
    share = 100 * float((pressure > 0).mean())
    residual = checks.violation(ASKED, pressure)
    force = float(pressure.sum()) * ASKED.cell[0] * ASKED.cell[1]
    return replace(CONTACT, pressure=pressure, force=force, area_percent=share, residual=residual)


def without_smallest(pressure: np.ndarray) -> np.ndarray:
    pressure.flat[np.nanargmin(np.where(pressure > 0, pressure, np.nan))] = 0.0
    return pressure


def in_tension(pressure: np.ndarray) -> np.ndarray:
    pressure[np.unravel_index(ASKED.surface.argmin(), pressure.shape)] = -1e-9
    return pressure


def on_the_lowest_node(pressure: np.ndarray) -> np.ndarray:
    pressure.flat[ASKED.surface.argmin()] = 1e-3 * pressure.max()
    return pressure


WRONG = {
    "1e-4 too large": lambda pressure: pressure * 1.0001,
    "off by one node": lambda pressure: np.roll(pressure, 1, axis=0),
    "without its smallest": without_smallest,
    "on the lowest node": on_the_lowest_node,
    "in tension somewhere": in_tension,
    "not a number": lambda pressure: pressure * np.nan,
}


def verdict(check: Check, asked: Setup, contact: bem.Contact) -> bool:
    return all(finding.passed for finding in check(asked, contact))


@pytest.mark.parametrize("wrong", WRONG)
def test_complementarity_fails_for_any_other_pressure(wrong: str) -> None:
    assert verdict(checks.complementarity, ASKED, CONTACT)
    assert not verdict(checks.complementarity, ASKED, with_pressure(WRONG[wrong]))


@pytest.mark.parametrize("wrong", [name for name in WRONG if name != "in tension somewhere"])
def test_dense_solve_tells_another_pressure(wrong: str) -> None:
    check = partial(checks.agrees_with_dense_solve, allowed=0.9e-4)
    assert verdict(check, ASKED, CONTACT)
    assert not verdict(check, ASKED, with_pressure(WRONG[wrong]))


@pytest.mark.parametrize(
    "other",
    [
        {"kernel": "concentrated-force"},
        {"far_field": "compliant"},
        {"poisson": 0.02},
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
        {"force": CONTACT.force * (1 + 1e-9)},
        {"force": math.inf},
        {"area_percent": CONTACT.area_percent + 1e-6},
    ],
    ids=str,
)
def test_numbers_that_the_pressure_does_not_bear_out_fail(stated: dict[str, float]) -> None:
    assert not failed(ASKED, CONTACT)
    assert set(failed(ASKED, replace(CONTACT, **stated))) & {
        "residual off",
        "force off its pressure",
        "area off its nodes",
    }


def failed(asked: Setup, contact: bem.Contact, reason: str = "") -> list[str]:
    """Names of the findings that an answer fails by."""
    answer = judge(asked, contact, reason=reason)
    return [finding.what for finding in answer.findings if not finding.passed]


def test_an_unconverged_answer_that_claims_to_be_converged_fails(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(patch, "FEW_FREE", ((0.0, 1.0),))  # else two iterations may be enough
    with pytest.raises(bem.NotConverged) as stopped:
        replace(ASKED, max_iterations=2).solve()
    unfinished = stopped.value.contact
    assert failed(ASKED, unfinished) == ["gap"]
    assert failed(ASKED, replace(unfinished, residual=1e-7)) == ["gap", "residual off"]


class Failing(Setup):
    """A problem that no solver is asked about: its heights are the error that is raised."""

    def solve(self) -> bem.Contact:
        raise self.heights  # type: ignore[misc]

    def describe(self) -> str:
        return "an error"


def failing(error: Exception, refusal: Refusal | None = None) -> Case:
    return Case("test", "test", "", lambda: solve(Failing(error)), refusal)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("error", "refused"),
    [
        (ValueError("side = 0: must be above 0 um"), True),
        (ValueError("side = 0: must be above\n0 um"), False),
        (TypeError("side = 0: must be above 0 um"), False),
    ],
    ids=repr,
)
def test_refusals_are_of_the_right_kind_and_say_what_is_allowed(
    error: Exception, refused: bool
) -> None:
    refusal = Refusal(ValueError, ("side = 0", "above 0 um"))
    assert run_case(failing(error, refusal)).passed is refused


def test_many_iterations_need_a_reason() -> None:
    slow = replace(CONTACT, iterations=200)
    assert failed(ASKED, slow) == ["times ordinary"]
    assert not failed(ASKED, slow, "stiff")
    assert judge(ASKED, slow, reason="stiff").numbers["reason"] == "stiff"
    assert judge(ASKED, CONTACT, reason="stiff").numbers["reason"] == ""
    endless = replace(CONTACT, iterations=ASKED.max_iterations + 1)
    assert failed(ASKED, endless, "stiff") == ["iterations"]
