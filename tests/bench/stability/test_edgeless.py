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


def more(contact: bem.Contact) -> bem.Contact:
    return replace(contact, force=1.001 * contact.force)


def stronger(contact: bem.Contact) -> bem.Contact:
    return replace(contact, pressure=1.001 * contact.pressure)


def deeper(contact: bem.Contact) -> bem.Contact:
    return replace(contact, delta=1.001 * contact.delta)


def turned(contact: bem.Contact) -> bem.Contact:
    return replace(contact, pressure=np.ascontiguousarray(contact.pressure[::-1]))


def loose(contact: bem.Contact) -> bem.Contact:
    return replace(contact, residual=contact.residual + 1e-6)


@pytest.mark.parametrize(
    ("draw", "compare", "spoil", "words"),
    [
        (problem, judge, more, "load off"),
        (problem, judge, stronger, "load off"),
        (problem, judge, deeper, "gap"),
        (problem, judge, turned, "pressure off the reference"),
        (problem, judge, loose, "residual off"),
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
