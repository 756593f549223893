"""Quantiles of every distribution: against scipy's, their limits, and pure in each number."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import TypeAdapter, ValidationError
from scipy import stats

from gen.distribution import AnyNumber, limits, quantiles
from gen.generation.plan import parameters
from gen.scene import Scene, load, preset_names

READ = TypeAdapter(AnyNumber).validate_python
EVEN = (np.arange(200_000) + 0.5) / 200_000
LARGEST = math.nextafter(1.0, 0.0)


def truncated(mean, deviation, low, high):
    ends = (low - mean) / deviation, (high - mean) / deviation
    return stats.truncnorm(*ends, loc=mean, scale=deviation)


DISTRIBUTIONS = {
    "uniform": ([2.0, 5.0], stats.uniform(2.0, 3.0)),
    "log-uniform": ({"log_uniform": [1e-3, 1e2]}, stats.loguniform(1e-3, 1e2)),
    "normal": ({"normal": [1.0, 2.0]}, truncated(1.0, 2.0, -5.0, 7.0)),
    "one-sided": (
        {"normal": [1.0, 2.0], "range": [0.0, 3.5]},
        truncated(1.0, 2.0, 0.0, 3.5),
    ),
    "upper-tail": (
        {"normal": [0.0, 1.0], "range": [4.0, 5.0]},
        truncated(0, 1, 4.0, 5.0),
    ),
    "lower-tail": (
        {"normal": [0.0, 1.0], "range": [-5.5, -5.0]},
        truncated(0, 1, -5.5, -5.0),
    ),
    "narrow": ({"normal": [500.0, 1e-3]}, truncated(500.0, 1e-3, 499.997, 500.003)),
}


@pytest.mark.parametrize("name", DISTRIBUTIONS)
def test_quantiles_are_those_of_the_distribution(name):
    """The largest distance to scipy's CDF (as Kolmogorov and Smirnov have it) is below 2e-5."""
    given_as, reference = DISTRIBUTIONS[name]
    values = quantiles(READ(given_as), EVEN)
    assert np.abs(reference.cdf(values) - EVEN).max() < 2e-5
    assert (np.diff(values) >= 0).all()


finite = st.floats(allow_nan=False, allow_infinity=False)
positive = st.floats(5e-324, 1.7e308)
pairs = st.tuples(finite, finite).map(sorted)
any_distribution = st.one_of(
    finite,
    pairs,
    st.tuples(positive, positive).map(lambda pair: {"log_uniform": sorted(pair)}),
    st.tuples(st.floats(-1e6, 1e6), st.floats(1e-3, 1e6)).map(
        lambda pair: {"normal": list(pair)}
    ),
    st.tuples(
        st.floats(-1e3, 1e3), st.floats(1e-3, 1e3), st.floats(-5, 5), st.floats(0.01, 4)
    ).map(
        lambda n: {
            "normal": [n[0], n[1]],
            "range": [n[0] + n[1] * n[2], n[0] + n[1] * (n[2] + n[3])],
        }
    ),
    st.lists(finite, min_size=1, max_size=6).map(lambda numbers: {"choice": numbers}),
)


@given(any_distribution, st.lists(st.floats(0, LARGEST), min_size=1, max_size=20))
@settings(max_examples=150, deadline=None)
def test_values_are_within_their_limits_and_each_depends_on_its_number_alone(
    given_as, numbers
):
    try:
        distribution = READ(given_as)
    except ValidationError as error:
        assert "too wide" in str(error)  # noqa: PT017
        return
    uniform = np.array([0.0, *numbers, LARGEST])
    values = quantiles(distribution, uniform)
    low, high = limits(distribution)
    assert np.isfinite(values).all()
    assert ((low <= values) & (values <= high)).all()
    alone = [quantiles(distribution, uniform[i : i + 1])[0] for i in range(uniform.size)]
    assert values.tobytes() == np.array(alone).tobytes()
    if not (isinstance(given_as, dict) and "choice" in given_as):
        order = np.argsort(uniform, kind="stable")
        assert (np.diff(values[order]) >= 0).all()


DRAWN = """samples = 10
samples_per_surface = {m}
[surface]
generator = "python"
function = "any:thing"
[surface.parameters]
a = {{ normal = [0.5, 0.1] }}
b = {{ log_uniform = [1.0, 9.0] }}
c = [0, 1]
d = {{ choice = [1, 2, 3] }}
e = 5
hurst = 0.5
[load]
quantity = "pressure"
pieces = [{{ share = 0.25, range = {{ log_uniform = [1, 10] }} }},
    {{ share = 0.75, range = {{ normal = [5, 1] }} }}]
[contact]
hardness = {{ choice = [100, 200] }}
"""


def test_parameters_are_independent_and_an_added_one_shifts_no_other():
    scene = Scene.parse(DRAWN.format(m=1), "test")
    plan = parameters(scene, 0, 20_000)
    numbers = np.array(
        [plan.drawn["a"], np.log(plan.drawn["b"]), plan.drawn["c"], plan.load]
    )
    correlations = np.corrcoef(numbers) - np.eye(4)
    assert np.abs(correlations).max() < 0.03
    fewer = Scene.parse(DRAWN.format(m=1).replace("c = [0, 1]\n", ""), "test")
    for name, values in parameters(fewer, 0, 100).drawn.items():
        assert values.tobytes() == plan.drawn[name][:100].tobytes()


FINGERPRINTS = {
    "broad-fine": "0fc3bdf15c6c035c",
    "broad-midpoint": "3f959dc39144b421",
    "broad-rmd": "4a79dff8f32f57a9",
    "broad-spectral": "de26a4ad26399baf",
    "broad-spectral-yielding": "e2d0929b2346c0fd",
    "broad-yielding": "15f909aa8da367f8",
    "extreme": "e86de22cd8c90a48",
    "fine": "7d884a9d8a3d2f88",
    "paper": "5ac8e0d743b06f1d",
    "paper-mirco": "e74adbf40f6d676d",
    "paper-nearest": "7e313bd512e217df",
    "paper-yielding": "55125ba1b43db99e",
    "quick": "5ac8e0d743b06f1d",
}


def test_shipped_scenes_keep_their_fingerprints():
    """Another fingerprint here means that no database made so far can be continued."""
    assert {
        name: load(name).fingerprint()[:16] for name in preset_names()
    } == FINGERPRINTS
