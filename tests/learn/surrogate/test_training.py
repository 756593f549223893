"""Flags of surfaces of a population, by a training on surfaces of this population."""

from dataclasses import replace

import numpy as np
import pytest

from gen.population import generate_like
from gen.statistics import describe
from learn.features.columns import STATISTICS
from learn.features.rows import Rows
from learn.features.sets import SETS
from learn.surrogate.interval import rows_measured_by_surfaces
from learn.surrogate.training import Training
from tests.like_maps import population

NODES = 32
FEATURES = replace(
    SETS["dimensionless"],
    columns=tuple(
        column for column in SETS["dimensionless"].columns if column != "delta/h"
    ),
)
"""The features without units of a surface, but for its load."""

RAREST = 0.1
"""Largest share of the surfaces of the population that may be flagged."""


def rows_of(of_kind, number, seed):
    """Rows of surfaces of a population."""
    shape = (NODES, NODES)
    surfaces = [
        generate_like(of_kind, shape, (64, 64), np.random.default_rng([seed, number]))
        for number in range(number)
    ]
    descriptions = [describe(surface, of_kind.spacing).values for surface in surfaces]
    statistics = np.array(
        [[description[name] for name in STATISTICS] for description in descriptions]
    )
    return Rows(statistics=statistics, delta=np.ones(number), length=float(NODES))


@pytest.fixture(scope="module")
def training():
    """The training of a surrogate on 400 surfaces of a population."""
    inputs = FEATURES.of(rows_of(population(), 400, seed=0))
    distance = rows_measured_by_surfaces(
        inputs, np.zeros(400, dtype=np.int64), np.arange(400) % 5
    ).training
    return Training(
        card={"nodes": [NODES, NODES], "side": [1.0, 1.0]},
        features=FEATURES,
        low=inputs.min(axis=0),
        high=inputs.max(axis=0),
        distance=distance,
        modulus=1.0,
        boundary="free",
    )


def share_flagged(training, of_kind, seed):
    rows = rows_of(of_kind, 100, seed)
    reasons = training.reasons(rows, FEATURES.of(rows))
    return np.mean([bool(reason) for reason in reasons])


@pytest.mark.parametrize(
    "seed",
    [1, pytest.param(2, marks=pytest.mark.long), pytest.param(3, marks=pytest.mark.long)],
)
def test_surfaces_of_the_population_are_rarely_flagged(training, seed):
    assert share_flagged(training, population(), seed) <= RAREST


@pytest.mark.parametrize(
    "far",
    [
        population(lambda scores: np.exp(0.8 * scores)),
        population(wide=3.0),
        population(spacing=(2.0, 2.0)),
    ],
    ids=["lognormal", "directional", "of shorter waves"],
)
def test_surfaces_of_another_population_are_always_flagged(training, far):
    assert share_flagged(training, far, seed=4) == 1.0
