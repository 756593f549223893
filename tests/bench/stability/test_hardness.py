"""Proof that the checks of contacts that yield can fail."""

from collections.abc import Callable
from dataclasses import replace

import pytest

import bem
from bench.stability.hardness import beside_least_squares
from bench.stability.setup import Setup

SEED = 11


def nothing(contact: bem.Contact) -> bem.Contact:
    raise ZeroDivisionError


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (lambda c: replace(c, force=1.001 * c.force), "force off least squares"),
        (lambda c: replace(c, pressure=0.999 * c.pressure), "nodes off least squares"),
        (lambda c: replace(c, residual=c.residual + 1e-6), "residual off"),
        (nothing, "ZeroDivisionError at seed 11"),
    ],
)
def test_wrong_answers_are_told(
    monkeypatch: pytest.MonkeyPatch, spoil: Callable[[bem.Contact], bem.Contact], words: str
) -> None:
    seeds = range(SEED, SEED + 1)
    assert beside_least_squares(seeds).passed
    solve = Setup.solve
    monkeypatch.setattr(Setup, "solve", lambda asked: spoil(solve(asked)))
    assert words in beside_least_squares(seeds).failed
