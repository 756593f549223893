"""Made maps of known kinds: whether a spectrum and heights can describe them."""

import numpy as np
import pytest

from gen.draft.judge import judge_surfaces
from gen.material import Bodies
from gen.population import generate_like
from gen.spectral import SelfAffineSpectrum
from tests.gen.draft.test_populations import fitted_to, made

NODES = 192
NUMBER = 10  # of maps of each kind
YIELDING = Bodies(231e3, hardness=2000.0)
ELASTIC = Bodies(231e3)

FINE = SelfAffineSpectrum(0.8, 24.0, 4.0)
LAY = SelfAffineSpectrum(0.8, 32.0, 10.0, stretch=0.25)
WAVINESS = SelfAffineSpectrum(0.8, 32.0, 20.0)
ROUGHNESS = SelfAffineSpectrum(0.8, 6.0, 4.0)
VALLEYS = SelfAffineSpectrum(0.8, 32.0, 8.0)


def gaussian(seed):
    return 0.3 * made(FINE, seed, NODES)


def lognormal(seed):
    return 0.3 * np.exp(0.5 * made(FINE, seed, NODES))


def plateau_honed(seed):
    """The lower one of two processes: a fine plateau above deep valleys."""
    return np.minimum(
        0.1 * made(FINE, seed, NODES), 0.5 + 0.6 * made(VALLEYS, 100 + seed, NODES)
    )


def directional(seed):
    """Waves are four times as long along y."""
    return 0.3 * made(LAY, seed, NODES)


def two_scales(seed):
    return 0.3 * made(WAVINESS, seed, NODES) + 0.03 * made(ROUGHNESS, 100 + seed, NODES)


@pytest.mark.long
@pytest.mark.parametrize("bodies", [ELASTIC, YIELDING], ids=["elastic", "yielding"])
@pytest.mark.parametrize(
    "kind", [gaussian, lognormal, plateau_honed, directional, two_scales]
)
def test_surfaces_are_of_the_kind_of_their_map(kind, bodies):
    verdicts = []
    for seed in range(NUMBER):
        heights = kind(seed)
        heights -= heights.mean()
        fitted = fitted_to(heights)

        def make(shape, random, population=fitted):
            return generate_like(population, shape, (NODES, NODES), random)

        judgement = judge_surfaces(heights, (1.0, 1.0), make, bodies, NODES // 2)
        verdicts.append(judgement.verdict)
    assert verdicts.count("of its kind") >= NUMBER - 1, verdicts
    assert "not of its kind" not in verdicts
