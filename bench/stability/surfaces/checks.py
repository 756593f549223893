"""Judgements of statistics that do not rely on `gen.statistics`."""

import math
from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bench.stability.case import Answer, Finding
from bench.stability.surfaces import exact
from gen.statistics import NAMES, Description, describe

Spacing = tuple[float, float]
Field = NDArray[np.float64]

G = 7.8125
"""Spacing of the paper's nodes [um]."""

EXACT = 1e-12
"""What a few hundred roundings may add up to, relative to each statistic."""

LENGTHS = {name for name in NAMES if name.split("_")[-1] in {"mean", "rms", "max"}}
CURVATURES = {name for name in LENGTHS if "curvature" in name}
SHAPES = {name for name in NAMES if "kurtosis" in name or "skewness" in name}


def described(heights: ArrayLike, spacing: Spacing = (G, G), allowed: float = EXACT) -> Answer:
    """Describe a surface and compare with whole numbers.

    Parameters
    ----------
    heights : as they are handed over, of whatever type
    spacing : along x and y [um]
    allowed : relative error; absolute for skewness and kurtosis below 1
    """
    given = np.asanyarray(heights)
    found = describe(given, spacing)
    expected = exact.statistics(np.array(given, dtype=np.float64), spacing)
    return Answer(in_words(found), [*differences(found.values, expected, "off exact", allowed)])


def differences(
    found: dict[str, float], expected: dict[str, float], what: str, allowed: float
) -> Iterator[Finding]:
    """The largest error of all statistics, and how many are defined in one of both only."""
    errors = [_error(name, found[name], expected[name], expected) for name in NAMES]
    worst = int(np.argmax(errors))
    yield Finding(f"{what}: {NAMES[worst]}", errors[worst], allowed)
    unlike = [name for name in NAMES if math.isnan(found[name]) != math.isnan(expected[name])]
    yield Finding(", ".join(["defined unlike", *unlike]), len(unlike), 0)


def _error(name: str, value: float, expected: float, beside: dict[str, float]) -> float:
    """Relative, over 1 or the largest of its kind where the expected value is smaller."""
    if value == expected or math.isnan(value) or math.isnan(expected):
        return 0.0
    if name in SHAPES:
        return abs(value - expected) / max(1.0, abs(expected))
    if expected:
        return abs(value / expected - 1)
    kind = CURVATURES if name in CURVATURES else LENGTHS - CURVATURES
    largest = max((abs(beside[each]) for each in kind if beside[each] == beside[each]), default=0.0)
    return abs(value) / largest if largest else math.inf


def says(heights: ArrayLike, *words: str, spacing: Spacing = (G, G)) -> Answer:
    """Describe a surface that does not define everything; nothing may be undefined silently.

    Parameters
    ----------
    heights : see `described`
    words : of the reason that is given
    spacing : along x and y [um]
    """
    found = describe(np.asanyarray(heights), spacing)
    missing = [word for word in words if word not in found.reason]
    undefined = sum(map(math.isnan, found.values.values()))
    return Answer(
        in_words(found),
        [
            Finding(", ".join(["words missing in the reason", *missing]), len(missing), 0),
            Finding("undefined without a reason", int(not undefined), 0),
        ],
    )


def unchanged(
    heights: Field,
    *,
    change: Callable[[Field], ArrayLike],
    allowed: float = 0.0,
    length: float = 1.0,
    spacings: tuple[Spacing, Spacing] = ((G, G), (G, G)),
    swapped: bool = False,
) -> Answer:
    """Describe a surface and its image, whose statistics follow from its own.

    Parameters
    ----------
    heights : the surface [um]
    change : makes the image
    allowed : relative error; 0 is to the last bit
    length : of heights of the image over those of the surface
    spacings : of the surface and of the image [um]
    swapped : whether the axes change places
    """
    before = describe(heights, spacings[0]).values
    after = describe(np.asanyarray(change(heights)), spacings[1])
    per_length = length * (spacings[0][0] / spacings[1][int(swapped)]) ** 2
    expected = {
        name: value * (per_length if name in CURVATURES else length if name in LENGTHS else 1.0)
        for name, value in before.items()
    }
    if swapped:
        x, y = expected["bandwidth_x"], expected["bandwidth_y"]
        expected |= {"bandwidth_x": y, "bandwidth_y": x}
    found = differences(after.values, expected, "off the other's", allowed)
    return Answer(in_words(after), [*found])


def in_words(found: Description) -> str:
    """What came out, in a line."""
    values = found.values
    said = f"rms {values['height_rms']:.4g} um, mean {values['height_mean']:.4g} um"
    if not math.isnan(values["asperity_density"]):
        said += f", {values['asperity_density']:.3g} asperities a node"
    undefined = sum(map(math.isnan, values.values()))
    return f"{said}; {undefined} undefined ({found.reason})" if undefined else said
