"""Judgements of statistics that do not rely on `gen.statistics`."""

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from bench.references.half_space import Field
from bench.stability.case import Answer, Finding
from bench.stability.surfaces import exact
from gen.statistics import NAMES, Description, describe

Spacing = tuple[float, float]

G = 7.8125  # spacing of the paper's nodes [um]
EXACT = 1e-12  # what a few hundred roundings may add up to, relative to each statistic

LENGTHS = {name for name in NAMES if name.split("_")[-1] in {"mean", "rms", "max"}}
CURVATURES = {name for name in LENGTHS if "curvature" in name}
SHAPES = {name for name in NAMES if "kurtosis" in name or "skewness" in name}


def described(heights: ArrayLike, spacing: Spacing = (G, G), allowed: float = EXACT) -> Answer:
    """Describe a surface of any type, and compare with whole numbers.

    `allowed` is a relative error, and absolute for skewness and kurtosis below 1.
    """
    given = np.asanyarray(heights)
    expected = exact.statistics(np.array(given, dtype=np.float64), spacing)
    return _compared(describe(given, spacing), expected, "off exact", allowed)


def _compared(found: Description, expected: dict[str, float], what: str, allowed: float) -> Answer:
    """Find the largest error of all statistics, and those that are defined in one of both only."""
    values = found.values
    errors = [_error(name, values[name], expected[name], expected) for name in NAMES]
    worst = int(np.argmax(errors))
    unlike = [name for name in NAMES if math.isnan(values[name]) != math.isnan(expected[name])]
    error = Finding(f"{what}: {NAMES[worst]}", errors[worst], allowed)
    undefined = Finding(", ".join(["defined unlike", *unlike]), len(unlike), 0)
    return Answer(in_words(found), [error, undefined])


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


def says(heights: ArrayLike, *words: str) -> Answer:
    """Describe a surface that does not define everything, for a reason with these words."""
    found = describe(np.asanyarray(heights), (G, G))
    missing = [word for word in words if word not in found.reason]
    said = Finding(", ".join(["words missing in the reason", *missing]), len(missing), 0)
    defined = not any(map(math.isnan, found.values.values()))
    return Answer(in_words(found), [said, Finding("undefined without a reason", int(defined), 0)])


def unchanged(
    heights: Field,
    *,
    change: Callable[[Field], ArrayLike],
    allowed: float = 0.0,
    length: float = 1.0,
    spacings: tuple[Spacing, Spacing] = ((G, G), (G, G)),
    swapped: bool = False,
) -> Answer:
    """Describe a surface and its image by `change`, whose statistics follow from its own.

    The image's heights are `length` times those of the surface [1], spacings are those of both
    [um], and with `swapped` the axes change places; `allowed` is relative, 0 is to the last bit.
    """
    expected = dict(describe(heights, spacings[0]).values)
    per_length = length * (spacings[0][0] / spacings[1][int(swapped)]) ** 2
    for name in LENGTHS:
        expected[name] *= per_length if name in CURVATURES else length
    if swapped:
        x, y = expected["bandwidth_x"], expected["bandwidth_y"]
        expected |= {"bandwidth_x": y, "bandwidth_y": x}
    image = describe(np.asanyarray(change(heights)), spacings[1])
    return _compared(image, expected, "off the other's", allowed)


def in_words(found: Description) -> str:
    """The result, in a line."""
    values = found.values
    said = f"rms {values['height_rms']:.4g} um, mean {values['height_mean']:.4g} um"
    if not math.isnan(values["asperity_density"]):
        said += f", {values['asperity_density']:.3g} asperities a node"
    undefined = sum(map(math.isnan, values.values()))
    return f"{said}; {undefined} undefined ({found.reason})" if undefined else said
