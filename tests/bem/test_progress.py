"""Progress of the rounds of an active set: patience, damping, and the end by rounding."""

import pytest

from bem.iterate import Violation
from bem.progress import IDLE, PATIENCE, REDUCTION, TIGHTENING, Progress


def violation_of(largest):
    return Violation(penetration=largest, gap=0.0, opening=0.0)


def after_rounds(*largest):
    """Return the progress after rounds that left these violations, at falling energies."""
    progress = Progress(violation_of(1.0))
    for number, value in enumerate(largest):
        progress.note_round(
            violation_of(value), energy=-float(number), exact=False, next_set_taken=True
        )
    return progress


def test_a_smaller_violation_restores_the_patience():
    assert after_rounds(0.5, 0.6, 0.7).patience == PATIENCE - 2
    assert after_rounds(0.5, 0.6, 0.4).patience == PATIENCE


def test_rounds_without_a_smaller_violation_are_damped_and_then_given_up():
    lasting = after_rounds(0.5, *[0.5] * (PATIENCE - 1))
    assert lasting.to_be_damped
    assert lasting.slow
    assert not lasting.impatient
    assert after_rounds(0.5, *[0.5] * PATIENCE).impatient


def test_a_higher_energy_tightens_the_reduction():
    progress = after_rounds(0.5, 0.4)
    assert progress.reduction == REDUCTION
    progress.note_round(violation_of(0.3), energy=1.0, exact=False, next_set_taken=False)
    assert progress.reduction == REDUCTION * TIGHTENING


def test_exact_residuals_that_no_longer_halve_are_stalled():
    progress = after_rounds(0.5)
    for _ in range(IDLE):
        progress.note_renewal(violation_of(0.5))
        assert not progress.stalled
    progress.note_renewal(violation_of(0.3))
    assert progress.stalled
    progress.note_renewal(violation_of(0.1))
    assert not progress.stalled


def test_single_precision_resolves_less_than_the_last_exact_violation():
    progress = after_rounds(0.5)
    assert progress.resolved == pytest.approx(1e-6)
    progress.note_renewal(violation_of(1e-3))
    assert progress.resolved == pytest.approx(1e-9)


def test_bodies_that_begin_to_yield_begin_anew():
    progress = after_rounds(0.5, *[0.6] * PATIENCE)
    progress.note_yielding(violation_of(2.0))
    assert (progress.patience, progress.next_set_taken, progress.largest) == (
        PATIENCE,
        False,
        2.0,
    )
    progress.note_round(violation_of(1.0), energy=1e9, exact=False, next_set_taken=False)
    assert progress.reduction == REDUCTION
