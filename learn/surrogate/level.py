"""Which level the intervals of an answer get."""

from __future__ import annotations

import numpy as np

from gen.runtime.errors import InputError
from learn.surrogate.interval import USUAL_LEVEL, calibrated_by, require_probability
from learn.surrogate.model import Surrogate


def require_level(surrogate: Surrogate, level: float) -> None:
    """Refuse a level of intervals that too few surfaces or maps calibrate.

    Parameters
    ----------
    surrogate : Surrogate
        The surrogate.
    level : float
        Coverage of the intervals.

    Raises
    ------
    InputError
        If the level is not between 0 and 1, or the intervals of a target do not reach it.
    """
    for name, learnt in surrogate.learnt.items():
        calibration = learnt.calibration
        if all(np.isfinite(scores.quantile(level)) for scores in calibration.scores):
            continue
        raise InputError(
            f"--interval {level:g}: intervals of {name} are calibrated by"
            f" {calibrated_by(surrogate.card)}, which reach {calibration.largest_level:g} at"
            " most: give less, or fit to more of them"
        )


def level_of(
    surrogate: Surrogate, requested: float | None, *, mean: bool = False
) -> float:
    """Return the level of the intervals of an answer.

    Parameters
    ----------
    surrogate : Surrogate
        The surrogate that answers.
    requested : float or None
        The level that the user names. None stands for `USUAL_LEVEL`, or for the largest level that
        holds if it is smaller.
    mean : bool
        True for intervals of the mean over surfaces, which no rows calibrate: any level holds.

    Returns
    -------
    float
        A level that holds, between 0 and 1.

    Raises
    ------
    InputError
        If the level is not between 0 and 1, or too few surfaces or maps calibrate it.
    """
    level = requested
    if level is None:
        level = USUAL_LEVEL if mean else min(USUAL_LEVEL, surrogate.largest_level)
    if mean:
        require_probability(level)
    else:
        require_level(surrogate, level)
    return level


def level_note(surrogate: Surrogate, level: float, requested: float | None) -> str:
    """Explain a level of intervals that is below the usual one though the user named none.

    Parameters
    ----------
    surrogate : Surrogate
        The surrogate that answers.
    level : float
        The level of its intervals, from `level_of`.
    requested : float or None
        The level that the user names; None if the user names none.

    Returns
    -------
    str
        The explanation; "" if there is nothing to explain.
    """
    if requested is not None or level >= USUAL_LEVEL:
        return ""
    return (
        f"intervals of {100 * level:g} %: {calibrated_by(surrogate.card)} calibrate them and reach"
        f" no more; for {100 * USUAL_LEVEL:g} % fit to more of them"
    )
