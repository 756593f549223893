"""Cases about the generators: Hurst exponents, amplitudes, numbers of nodes, nestedness."""

import math
from collections.abc import Iterator
from fractions import Fraction
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bench.stability.case import Answer, Case, Finding, Refusal
from bench.stability.surfaces import exact
from gen.runtime.errors import InputError
from gen.surface import GENERATORS, generate

Field = NDArray[np.float64]

NODES = 17
"""Nodes a side of the surfaces that are computed again in fractions."""

ROUNDING = 1e-14
"""What the roundings of a few levels may add up to, over the range of heights."""

SEED = 3

HURSTS = {
    "0": 0.0,
    "5e-324": 5e-324,
    "1e-16": 1e-16,
    "1e-3": 1e-3,
    "0.65": 0.65,
    "1 - 1e-3": 0.999,
    "1 less one ulp": math.nextafter(1.0, 0.0),
    "1": 1.0,
}
"""As near to 0 and 1 as numbers go."""


def cases() -> Iterator[Case]:
    """Family after family, each with both generators."""
    for generator in GENERATORS:
        yield from _hursts(generator)
    for generator in GENERATORS:
        yield from _amplitudes(generator)
    for generator in GENERATORS:
        yield from _levels(generator)
    yield from _refused()


def _surface(generator: str, nodes: int, hurst: float, sigma0: float, seed: int = SEED) -> Field:
    return generate(generator, nodes, hurst, sigma0, np.random.default_rng(seed))


def _hursts(generator: str) -> Iterator[Case]:
    for name, hurst in HURSTS.items():
        yield Case(
            "generator: Hurst exponent",
            f"H = {name}, {generator}",
            f"{NODES} x {NODES}, σ0 = 12 um, beside the same in fractions",
            partial(_as_in_fractions, generator, hurst, 12.0),
        )


def _as_in_fractions(generator: str, hurst: float, sigma0: float) -> Answer:
    heights = _surface(generator, NODES, hurst, sigma0)
    expected = exact.surface(generator, NODES, hurst, sigma0, np.random.default_rng(SEED))
    highest = max(max(row) for row in expected)
    errors = [
        abs(Fraction(height) - fraction)
        for row, fractions in zip(heights.tolist(), expected, strict=True)
        for height, fraction in zip(row, fractions, strict=True)
    ]
    error = float(max(errors) / highest) if highest else float(max(errors))
    return Answer(_in_words(heights), [Finding("off fractions [range]", error, ROUNDING)])


def _amplitudes(generator: str) -> Iterator[Case]:
    family, asked = "generator: amplitude", "129 x 129, H = 0.65"
    nothing = partial(_scaled, generator, 0.0, 0.0)
    yield Case(family, f"σ0 = 0, {generator}", asked, nothing)
    for name, sigma0, allowed in (
        ("2^-40", 2.0**-40, 0.0),
        ("2^40", 2.0**40, 0.0),
        ("1e-12", 1e-12, ROUNDING),
        ("1e12", 1e12, ROUNDING),
        ("1e-300", 1e-300, ROUNDING),
        ("1e300", 1e300, ROUNDING),
    ):
        examine = partial(_scaled, generator, sigma0, allowed)
        yield Case(family, f"σ0 = {name} um, {generator}", f"{asked}, beside σ0 = 1 um", examine)
    for name, sigma0 in (("1e-12", 1e-12), ("1e12", 1e12)):
        yield Case(
            family,
            f"σ0 = {name} um in fractions, {generator}",
            f"{NODES} x {NODES}, H = 0.65",
            partial(_as_in_fractions, generator, 0.65, sigma0),
        )


def _scaled(generator: str, sigma0: float, allowed: float) -> Answer:
    """Heights are proportional to sigma0."""
    unit, heights = (_surface(generator, 129, 0.65, each) for each in (1.0, sigma0))
    error = float(np.abs(heights / (sigma0 or 1.0) - unit * bool(sigma0)).max() / unit.max())
    return Answer(_in_words(heights), [Finding("off proportion [range]", error, allowed)])


def _levels(generator: str) -> Iterator[Case]:
    for k in range(1, 12):
        nodes = 2**k + 1
        yield Case(
            "generator: levels",
            f"k = {k}, {generator}",
            f"{nodes} x {nodes}, H = 0.65, σ0 = 12 um, beside k = {max(k - 1, 1)}",
            partial(_nested, generator, nodes),
        )


def _nested(generator: str, nodes: int) -> Answer:
    """The same seed gives the same coarse nodes, the same bits, and the lowest node is 0."""
    heights, again = (_surface(generator, nodes, 0.65, 12.0) for _ in range(2))
    coarse = _surface(generator, max((nodes + 1) // 2, 3), 0.65, 12.0)
    shared = heights[:: (nodes - 1) // (len(coarse) - 1), :: (nodes - 1) // (len(coarse) - 1)]
    off = np.abs((shared - shared[0, 0]) - (coarse - coarse[0, 0])).max() / np.ptp(heights)
    unlike = int(np.count_nonzero(heights != again)) + abs(heights.shape[0] - nodes)
    return Answer(
        _in_words(heights),
        [
            Finding("coarse nodes off [range]", float(off), ROUNDING),
            Finding("nodes unlike a second time", unlike, 0),
            Finding("lowest height", abs(float(heights.min())), 0),
        ],
    )


def _refused() -> Iterator[Case]:
    above = math.nextafter(1.0, 2.0)
    usual: dict[str, Any] = {"generator": "midpoint", "nodes": 9, "hurst": 0.65, "sigma0": 12.0}
    for name, value, words in (
        ("hurst", -5e-324, "from 0 to 1"),
        ("hurst", above, "from 0 to 1"),
        ("hurst", math.nan, "from 0 to 1"),
        ("sigma0", -1e-12, "0 um or more"),
        ("sigma0", math.nan, "0 um or more"),
        ("sigma0", math.inf, "0 um or more"),
        ("sigma0", 1.7e308, "give less"),
        ("nodes", 128, "2^k + 1"),
        ("nodes", 2, "2^k + 1"),
        ("nodes", 0, "2^k + 1"),
        ("nodes", -3, "2^k + 1"),
        ("generator", "fourier", "diamond-square, midpoint"),
    ):
        call = partial(generate, **{**usual, name: value}, random=np.random.default_rng(SEED))
        refusal = Refusal(InputError, (name, words))
        yield Case("generator: refused", f"{name} {value}", "", call, refusal)


def _in_words(heights: Field) -> str:
    """What came out, in a line."""
    return f"range {np.ptp(heights):.4g} um, rms {_rms(heights):.4g} um"


def _rms(heights: Field) -> float:
    """Without the overflow of squares [um]."""
    largest = float(heights.max()) or 1.0
    return float((heights / largest).std()) * largest
