"""Proof that the checks of contacts without edges can fail."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

import bem
from bench.stability.edgeless import (
    Judge,
    examine,
    judge,
    judge_images,
    judge_shift,
    mirrored_problem,
    periodic_problem,
    problem,
)
from bench.stability.setup import Setup

SEED = 16


def turned(contact: bem.Contact) -> bem.Contact:
    return replace(contact, pressure=np.ascontiguousarray(contact.pressure[::-1]))


@pytest.mark.parametrize(
    ("draw", "compare", "spoil", "words"),
    [
        (problem, judge, lambda c: replace(c, force=1.001 * c.force), "load off"),
        (problem, judge, lambda c: replace(c, delta=1.001 * c.delta), "gap"),
        (problem, judge, turned, "pressure off the reference"),
        (mirrored_problem, judge_images, turned, "pressure off"),
        (periodic_problem, judge_shift, turned, "pressure off"),
    ],
)
def test_wrong_answers_are_told(
    draw: Callable[[int], Setup],
    compare: Judge,
    spoil: Callable[[bem.Contact], bem.Contact],
    words: str,
) -> None:
    seeds = range(SEED, SEED + 1)
    assert examine(seeds, draw, compare).passed

    def spoilt(asked: Setup, contact: bem.Contact):
        return compare(asked, spoil(contact))

    assert words in examine(seeds, draw, spoilt).failed
