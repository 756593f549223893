"""Cases about the generators: Hurst exponents, amplitudes, numbers of nodes, nestedness."""

import math
from collections.abc import Iterator
from functools import partial
from typing import Any

import numpy as np

from bench.references.half_space import Field
from bench.stability.case import EXACT_FACTORS, FACTORS, Answer, Case, Finding, Refusal
from bench.stability.surfaces import exact
from gen.runtime.errors import InputError
from gen.surface import GENERATORS, generate

NODES = 17  # nodes a side of the surfaces that are computed again in fractions
ROUNDING = 1e-14  # what the roundings of a few levels may add up to, over the range of heights

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

# From nothing to all that numbers hold [um].
AMPLITUDES = {"0": 0.0} | FACTORS | {"1e-300": 1e-300, "1e300": 1e300}


def cases() -> Iterator[Case]:
    """Family after family, each with both generators."""
    for generator in GENERATORS:
        for name, hurst in HURSTS.items():
            asked = f"{NODES} x {NODES}, σ0 = 12 um, beside the same in fractions"
            examine = partial(_as_in_fractions, generator, hurst, 12.0)
            yield Case("generator: Hurst exponent", f"H = {name}, {generator}", asked, examine)
    for generator in GENERATORS:
        yield from _amplitudes(generator)
    for generator in GENERATORS:
        for k in range(1, 12):
            nodes = 2**k + 1
            asked = f"{nodes} x {nodes}, H = 0.65, σ0 = 12 um, beside k = {max(k - 1, 1)}"
            examine = partial(_nested, generator, nodes)
            yield Case("generator: levels", f"k = {k}, {generator}", asked, examine)
    yield from _refused()


def _surface(generator: str, nodes: int, hurst: float, sigma0: float) -> Field:
    return generate(generator, nodes, hurst, sigma0, np.random.default_rng(SEED))


def _answer(heights: Field, *findings: Finding) -> Answer:
    largest = float(heights.max()) or 1.0
    rms = float((heights / largest).std()) * largest  # without the overflow of squares
    return Answer(f"range {np.ptp(heights):.4g} um, rms {rms:.4g} um", findings)


def _as_in_fractions(generator: str, hurst: float, sigma0: float) -> Answer:
    heights = _surface(generator, NODES, hurst, sigma0)
    expected = exact.surface(generator, NODES, hurst, sigma0, np.random.default_rng(SEED))
    error = abs(exact.fractions(heights) - expected).max() / (expected.max() or 1)
    return _answer(heights, Finding("off fractions [range]", float(error), ROUNDING))


def _amplitudes(generator: str) -> Iterator[Case]:
    case = partial(Case, "generator: amplitude")
    for name, sigma0 in AMPLITUDES.items():
        asked = "129 x 129, H = 0.65" + ", beside σ0 = 1 um" * bool(sigma0)
        allowed = 0.0 if name in {"0", *EXACT_FACTORS} else ROUNDING
        title = f"σ0 = {name}{' um' * bool(sigma0)}, {generator}"
        yield case(title, asked, partial(_scaled, generator, sigma0, allowed))
    for name in ("1e-12", "1e12"):
        title, asked = f"σ0 = {name} um in fractions, {generator}", f"{NODES} x {NODES}, H = 0.65"
        yield case(title, asked, partial(_as_in_fractions, generator, 0.65, AMPLITUDES[name]))


def _scaled(generator: str, sigma0: float, allowed: float) -> Answer:
    """Heights are proportional to sigma0."""
    unit, heights = (_surface(generator, 129, 0.65, each) for each in (1.0, sigma0))
    error = float(np.abs(heights / (sigma0 or 1.0) - unit * bool(sigma0)).max() / unit.max())
    return _answer(heights, Finding("off proportion [range]", error, allowed))


def _nested(generator: str, nodes: int) -> Answer:
    """The same seed gives the same coarse nodes, the same bits, and the lowest node is 0."""
    heights, again = (_surface(generator, nodes, 0.65, 12.0) for _ in range(2))
    coarse = _surface(generator, max((nodes + 1) // 2, 3), 0.65, 12.0)
    step = (nodes - 1) // (len(coarse) - 1)
    shared = heights[::step, ::step]
    off = np.abs((shared - shared[0, 0]) - (coarse - coarse[0, 0])).max() / np.ptp(heights)
    unlike = int(np.count_nonzero(heights != again)) + abs(heights.shape[0] - nodes)
    return _answer(
        heights,
        Finding("coarse nodes off [range]", float(off), ROUNDING),
        Finding("nodes unlike a second time", unlike, 0),
        Finding("lowest height", abs(float(heights.min())), 0),
    )


def _refused() -> Iterator[Case]:
    usual: dict[str, Any] = {"generator": "midpoint", "nodes": 9, "hurst": 0.65, "sigma0": 12.0}
    refusals: dict[tuple[str, str], tuple[object, ...]] = {
        ("hurst", "from 0 to 1"): (-5e-324, math.nextafter(1.0, 2.0), math.nan),
        ("sigma0", "0 um or more"): (-1e-12, math.nan, math.inf),
        ("sigma0", "give less"): (1.7e308,),
        ("nodes", "2^k + 1"): (128, 2, 0, -3),
        ("generator", "diamond-square, midpoint"): ("fourier",),
    }
    for words, values in refusals.items():
        for value in values:
            call = partial(generate, **{**usual, words[0]: value}, random=np.random.default_rng(0))
            name, refusal = f"{words[0]} {value}", Refusal(InputError, words)
            yield Case("generator: refused", name, "", call, refusal)
