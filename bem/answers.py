"""The answers of a contact that can be asked for with an error."""

from __future__ import annotations  # short signatures in help()

from collections.abc import Callable
from dataclasses import dataclass

from bem.contact import Contact
from bem.derived.grid_error import GridError


@dataclass(frozen=True)
class Answer:
    """An answer of a contact that can be asked for with an error.

    Attributes
    ----------
    value : callable
        Function that returns the answer of a contact.
    bar : callable
        Function that returns the half-width of its 90 % bar, in the same unit.
    by_violation : float
        Relative error that the solver leaves, at 95 %, over the largest violation of the conditions
        of contact in units of Delta [1].
    gap_power : float
        Power of Delta over the mean gap with which this error grows [1]. A violation is a length:
        it is a larger part of a small gap, and changes small open areas by more.
    """

    value: Callable[[Contact], float]
    bar: Callable[[GridError], float]
    by_violation: float
    gap_power: float


# The factors of violations are 95 % quantiles on 680 contacts of seventeen kinds of surface. Each
# was solved for errors of 3, 1 and 0.3 % and with a tolerance of 1e-11 on the same grid.
# `asperity bench accuracy` counts the errors that hold on other surfaces.
ANSWERS = {
    "area": Answer(
        lambda contact: contact.continuum_area_percent,
        lambda error: error.area_percent,
        by_violation=2.0,
        gap_power=0.0,
    ),
    "mean_gap": Answer(
        lambda contact: contact.mean_gap,
        lambda error: error.mean_gap,
        by_violation=0.17,
        gap_power=1.0,
    ),
    "stiffness": Answer(
        lambda contact: contact.stiffness,
        lambda error: error.stiffness,
        by_violation=3.0,
        gap_power=0.5,
    ),
    "delta": Answer(
        lambda contact: contact.delta,
        lambda error: error.delta,
        by_violation=0.2,
        gap_power=0.0,
    ),
    "force": Answer(
        lambda contact: contact.force,
        lambda error: error.force,
        by_violation=0.8,
        gap_power=0.5,
    ),
}
"""Answers that can be asked for, by their names."""
