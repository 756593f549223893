"""The curve from normal scores to the heights of maps, and how it changes an autocovariance.

A map's curve passes through mean heights at a few normal scores. A curve through all heights would
add noise to the short waves of surfaces.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from gen.arrays import Heights, Values
from gen.population import FURTHEST_SCORE, tabulated_curve

# number of normal scores at which the curve of heights is known, without its two ends
KNOTS = 17
LARGEST_KNOT = 2.8  # largest of these scores
# Each height of the curve between its ends is the mean of this share of all nodes.
SHARE_OF_A_KNOT = 1 / 200
# Largest share of the furthest score at which there is a knot between the ends.
SHARE_OF_FURTHEST = 0.9

DEGREES = 64  # number of Hermite polynomials of the curve of heights
INTEGRATED = 4001  # number of normal scores by which their integrals are computed


@dataclass(frozen=True, eq=False)
class HeightCurve:
    """The rising curve from normal scores to heights over the rms height of their map."""

    scores: Values  # rising normal scores, shape (knots,) [1]
    heights: Values  # heights at these scores, rising, shape (knots,) [1]

    @classmethod
    def of(cls, textures: Sequence[Heights]) -> HeightCurve:
        """Return the mean of the curves of several textures.

        It ends at the furthest score that all textures have.

        Parameters
        ----------
        textures : sequence of ndarray, shape (nx, ny)
            Heights about their mean, over the rms heights of their maps [1].

        Returns
        -------
        HeightCurve
            The mean curve.
        """
        curves = [_curve_of_texture(texture) for texture in textures]
        furthest = float(min(curve.scores[-1] for curve in curves))
        scores = np.concatenate(([-furthest], _knots(furthest), [furthest]))
        heights = np.mean(
            [np.interp(scores, curve.scores, curve.heights) for curve in curves], axis=0
        )
        return cls(scores=scores, heights=np.maximum.accumulate(heights))

    def __call__(self, scores: Values) -> Values:
        """Return the heights at normal scores [1]."""
        places, heights = tabulated_curve(tuple(self.scores), tuple(self.heights))
        return np.interp(scores, places, heights)

    @cached_property
    def hermite_powers(self) -> Values:
        """Powers of the curve's normalised Hermite polynomials, shape (`DEGREES` + 1,) [1].

        The autocovariance of the heights is a sum over degrees k: the power of degree k times the
        k-th power of the autocorrelation of the Gaussian field. The last power is the sum of the
        powers of all higher degrees.
        """
        scores = np.linspace(-FURTHEST_SCORE, FURTHEST_SCORE, INTEGRATED)
        weights = np.exp(-(scores**2) / 2)
        weights /= weights.sum()
        heights = self(scores)
        heights -= weights @ heights
        previous = np.zeros_like(scores)
        polynomial = np.ones_like(scores)
        powers = []
        for degree in range(DEGREES):
            powers.append(float(weights @ (heights * polynomial)) ** 2)
            # recurrence of Hermite polynomials with unit variance
            unscaled = scores * polynomial - math.sqrt(degree) * previous
            previous = polynomial
            polynomial = unscaled / math.sqrt(degree + 1)
        higher = float(weights @ heights**2) - sum(powers)
        return np.array([*powers, max(0.0, higher)])

    @property
    def variance(self) -> float:
        """Variance of the heights at normally distributed scores [1]."""
        return float(self.hermite_powers.sum())


def _knots(furthest: float) -> Values:
    """Return the scores between the ends of a curve that reaches to the score `furthest`."""
    largest = min(LARGEST_KNOT, SHARE_OF_FURTHEST * furthest)
    return np.linspace(-largest, largest, KNOTS)


def _curve_of_texture(texture: Heights) -> HeightCurve:
    """Return the curve of one texture; its ends are the lowest and the highest node."""
    from scipy.special import ndtri

    ordered = np.sort(texture, axis=None)
    scores = ndtri((np.arange(ordered.size) + 0.5) / ordered.size)
    knots = _knots(float(scores[-1]))
    half = int(SHARE_OF_A_KNOT * ordered.size / 2)
    centres = np.searchsorted(scores, knots)
    means = [
        ordered[max(0, centre - half) : centre + half + 1].mean() for centre in centres
    ]
    heights = np.concatenate(([ordered[0]], means, [ordered[-1]]))
    return HeightCurve(
        scores=np.concatenate(([scores[0]], knots, [scores[-1]])),
        heights=np.maximum.accumulate(heights),
    )
