"""Random loads: some of the 5,000 that bench asks for, and what its table says of wrong answers."""

from collections.abc import Callable
from dataclasses import replace

import pytest

import bem
from bench.stability.loads import examine
from bench.stability.setup import Setup

MANY = 40


@pytest.mark.parametrize("rtol", [1e-2, 2e-7, 1e-10, 1e-13])
def test_random_loads_have_an_answer(rtol: float) -> None:
    answer = examine(rtol, range(MANY))
    assert answer.passed, answer.failed
    assert answer.out.startswith(f"{MANY} solves, ")


def shifted(contact: bem.Contact) -> bem.Contact:
    return replace(contact, residual=contact.residual + 1e-6)


def stretched(contact: bem.Contact) -> bem.Contact:
    return replace(contact, force=1.001 * contact.force)


def nothing(contact: bem.Contact) -> bem.Contact:
    raise ZeroDivisionError


def given_up(contact: bem.Contact) -> bem.Contact:
    raise bem.NotConverged(contact)


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (shifted, "residual off"),
        (stretched, "force off"),
        (nothing, "ZeroDivisionError at seed 0"),
        (given_up, "messages that are not true"),
    ],
)
def test_wrong_answers_are_told(
    monkeypatch: pytest.MonkeyPatch, spoil: Callable[[bem.Contact], bem.Contact], words: str
) -> None:
    solve = Setup.solve
    monkeypatch.setattr(Setup, "solve", lambda asked: spoil(solve(asked)))
    assert words in examine(1e-9, range(1)).failed
