"""The level of the intervals of an answer: the default one, and the levels that are refused."""

from __future__ import annotations

import numpy as np

from gen.runtime.errors import InputError
from learn.surrogate.interval import USUAL_LEVEL, calibrated_by, require_probability
from learn.surrogate.model import Surrogate


def require_level(surrogate: Surrogate, level: float) -> None:
    """Refuse a level of intervals that the calibration of a surrogate does not reach.

    Parameters
    ----------
    surrogate : Surrogate
        The surrogate.
    level : float
        Coverage of the intervals, between 0 and 1.

    Raises
    ------
    InputError
        If the level is not between 0 and 1, or too few surfaces, maps or databases calibrate the
        intervals of a target for it.
    """
    for name, learnt in surrogate.learnt.items():
        calibration = learnt.calibration
        # A quantile is infinite beyond the largest level that its surfaces or maps reach.
        quantiles = [scores.quantile(level) for scores in calibration.scores]
        if np.isfinite(quantiles).all():
            continue
        raise InputError(
            f"--interval {level:g}: intervals of {name} are calibrated by"
            f" {calibrated_by(surrogate.card)}, which reach {calibration.largest_level:g} at"
            " most: give less, or fit to more of them"
        )


def level_of(
    surrogate: Surrogate, requested: float | None, *, mean: bool = False
) -> float:
    """Choose the level of the intervals of an answer, or check the requested one.

    Parameters
    ----------
    surrogate : Surrogate
        The surrogate that answers.
    requested : float or None
        The level that the user names; None for the default.
    mean : bool
        True for intervals of the mean over surfaces. They need no calibration, so that they reach
        any level.

    Returns
    -------
    float
        The requested level. By default it is `USUAL_LEVEL`, or the largest level that the
        calibration reaches if this is smaller.

    Raises
    ------
    InputError
        If the level is not between 0 and 1, or the calibration does not reach it.
    """
    if mean:
        level = USUAL_LEVEL
        if requested is not None:
            level = requested
        require_probability(level)
        return level
    level = min(USUAL_LEVEL, surrogate.largest_level)
    if requested is not None:
        level = requested
    require_level(surrogate, level)
    return level


def level_note(surrogate: Surrogate, level: float, requested: float | None) -> str:
    """Explain why intervals have a lower level than `USUAL_LEVEL` by default.

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
        The explanation; "" if the user named the level, or if it is `USUAL_LEVEL`.
    """
    if requested is not None or level >= USUAL_LEVEL:
        return ""
    return (
        f"intervals of {100 * level:g} %: {calibrated_by(surrogate.card)} calibrate them and reach"
        f" no more; for {100 * USUAL_LEVEL:g} % fit to more of them"
    )
