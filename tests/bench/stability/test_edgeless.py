"""Proof that the checks of contacts without edges can fail."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

import bem
from bench.stability.edgeless import (
    Judge,
    cases,
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


def test_the_table_asks_for_every_problem_once() -> None:
    for family, count in (("dense references", 1000), ("mirror images", 200)):
        blocks = [case.examine.args[0] for case in cases() if case.family == family]  # type: ignore[attr-defined]
        assert [number for block in blocks for number in block] == list(range(count))


def test_problems_are_of_every_kind() -> None:
    drawn = [problem(seed) for seed in range(60)]
    kinds = {(each.boundary, each.hardness is None, bool(each.force)) for each in drawn}
    assert len(kinds) == 8
    assert any(each.pressure for each in drawn)
    assert any(not each.pressure and not each.force for each in drawn)
    assert any(len(set(each.cell)) == 2 for each in drawn)


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
