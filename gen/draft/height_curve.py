"""The curve from normal scores to the heights of maps, and how it changes an autocovariance.

There are two estimates of the curve, which agree on large maps of a translation field:

- The curve by quantiles passes through mean heights at a few normal scores. A curve through all
  heights would add noise to the short waves of surfaces. A map has few long waves, so that chance
  bends this curve. If it is steeper at the top because a map has a high hill by chance, all
  summits of surfaces become steeper.
- The curve by slopes gives surfaces the map's rms slope at each height. The Gaussian field u of a
  translation field g(u) has the same rms slope at all heights. The rms slope at a height is
  therefore proportional to dg/du, and u follows by integration over the heights. A map has many
  short waves, whose slopes are hardly changed by chance. But if steep places of a map have another
  reason than their height, this curve misses the quantiles.
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

CLASSES = 41  # number of classes of heights whose rms slopes give a curve
BEARING_SHARES = (0.01, 0.05)  # shares of all nodes that bear a contact that has yielded
# Largest relative difference of the heights that bear it. On made maps of translation fields of 192
# x 192 nodes, curves by slopes and by quantiles differ by up to 0.1.
LARGEST_DIFFERENCE = 0.15
FEWEST_OF_A_CLASS = 30  # number of nodes in the lowest and in the highest class

DEGREES = 64  # number of Hermite polynomials of the curve of heights
INTEGRATION_SCORES = 4001  # number of normal scores by which their integrals are computed


@dataclass(frozen=True, eq=False)
class HeightCurve:
    """The rising curve from normal scores to heights over the rms height of their map."""

    scores: Values  # rising normal scores, shape (knots,) [1]
    heights: Values  # heights at these scores, rising, shape (knots,) [1]

    @classmethod
    def by_quantiles(cls, textures: Sequence[Heights]) -> HeightCurve:
        """Return the mean of the curves of several textures by quantiles.

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

    def has_bearing_heights_of(self, other: HeightCurve) -> bool:
        """Tell whether two curves agree at the heights that bear bodies that yield.

        Where all of a contact has yielded, the highest nodes bear it, up to a share of all nodes.
        The mean gap is then the height of this quantile.

        Parameters
        ----------
        other : HeightCurve
            The other curve.

        Returns
        -------
        bool
            True if the heights above which the shares `BEARING_SHARES` of all nodes lie differ by
            at most `LARGEST_DIFFERENCE`.
        """
        from scipy.special import ndtri

        scores = -ndtri(np.array(BEARING_SHARES))
        heights = other(scores)
        return bool((abs(self(scores) - heights) <= LARGEST_DIFFERENCE * heights).all())

    @cached_property
    def hermite_powers(self) -> Values:
        """Powers of the curve's normalised Hermite polynomials, shape (`DEGREES` + 1,) [1].

        The autocovariance of the heights is a sum over degrees k: the power of degree k times the
        k-th power of the autocorrelation of the Gaussian field. The last power is the sum of the
        powers of all higher degrees.
        """
        scores = np.linspace(-FURTHEST_SCORE, FURTHEST_SCORE, INTEGRATION_SCORES)
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

    @classmethod
    def by_slopes(
        cls, textures: Sequence[Heights], spacing: tuple[float, float]
    ) -> HeightCurve | None:
        """Return the mean of the curves of several textures that follow from their slopes.

        Parameters
        ----------
        textures : sequence of ndarray, shape (nx, ny)
            Heights about their mean, over the rms heights of their maps [1].
        spacing : tuple of float
            Distance of the nodes along x and y [um].

        Returns
        -------
        HeightCurve or None
            The mean curve, at the scores of the curve by quantiles. None if a texture is flat at
            some height.
        """
        scores = cls.by_quantiles(textures).scores
        curves = [_heights_by_slopes(texture, spacing, scores) for texture in textures]
        known_curves = [curve for curve in curves if curve is not None]
        if len(known_curves) < len(curves):
            return None
        heights = np.mean(known_curves, axis=0)
        return cls(scores=scores, heights=np.maximum.accumulate(heights))


def _knots(furthest: float) -> Values:
    """Return the scores between the ends of a curve that reaches to the score `furthest`."""
    largest = min(LARGEST_KNOT, SHARE_OF_FURTHEST * furthest)
    return np.linspace(-largest, largest, KNOTS)


def _curve_of_texture(texture: Heights) -> HeightCurve:
    """Return the curve of a texture by quantiles; its ends are the lowest and highest node."""
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


def _heights_by_slopes(
    texture: Heights, spacing: tuple[float, float], scores: Values
) -> Values | None:
    """Return the heights of one texture at normal scores that follow from its slopes [1].

    The heights are divided into classes. Each class has its rms slope, which is that of the curve
    times that of the field. None if a class is flat.
    """
    from scipy.special import ndtr, ndtri

    ordered = np.sort(texture, axis=None)
    largest = -ndtri(FEWEST_OF_A_CLASS / ordered.size)
    shares = ndtr(np.linspace(-largest, largest, CLASSES - 1))
    limits = ordered[np.round(shares * ordered.size).astype(np.int64)]
    slopes = np.sqrt(_mean_square_slopes(texture, spacing, limits))
    if not slopes.min() > 0:
        return None
    # Heights at the ends of the classes, and the field there, up to a factor and a constant.
    heights = np.concatenate((ordered[:1], limits, ordered[-1:]))
    field = np.concatenate(([0.0], np.cumsum(np.diff(heights) / slopes)))
    field_of_nodes = np.interp(ordered, heights, field)
    deviation = float(field_of_nodes.std())
    field = (field - field_of_nodes.mean()) / deviation
    inside = np.interp(scores, field, heights)
    # Beyond the ends the curve is straight.
    below = np.minimum(scores - field[0], 0.0) * deviation * slopes[0]
    above = np.maximum(scores - field[-1], 0.0) * deviation * slopes[-1]
    return np.asarray(inside + below + above)


def _mean_square_slopes(
    heights: Heights, spacing: tuple[float, float], limits: Values
) -> Values:
    """Return the mean square slope of each class of heights.

    `heights` are in any unit, and the result in its square over that of `spacing`. `limits` are the
    rising heights between the classes. A slope is that between two neighbours; its height is their
    mean, because in a Gaussian field the difference of two nodes does not depend on their mean.
    """
    sums = np.zeros(limits.size + 1)
    counts = np.zeros(limits.size + 1)
    for axis, step in enumerate(spacing):
        along = np.moveaxis(heights, axis, 0)
        squared_slopes = (np.diff(along, axis=0) / step) ** 2
        means = (along[1:] + along[:-1]) / 2
        classes = np.searchsorted(limits, means.ravel())
        sums += np.bincount(classes, squared_slopes.ravel(), sums.size)
        counts += np.bincount(classes, minlength=sums.size)
    return np.asarray(sums / np.maximum(counts, 1.0))
