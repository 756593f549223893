"""The 22 statistics against whole numbers, closed forms, scaling laws and the paper's Table 1."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from launch import python

from bench.references import exact
from gen.generation.sample import surface_numbered
from gen.runtime.errors import InputError
from gen.scene import load, preset_names
from gen.schema import TABLE_1
from gen.statistics import NAMES, UNDEFINED, describe, rms_slope, rms_slope_of
from gen.surface import generate

TABLE_1 = {column.name: column.paper_range for column in TABLE_1}
"""Ranges of the paper's database, in the paper's order."""

# Multiples of 1/1024 up to 1024: shifts and differences are exact, so that ties stay ties.
exact_heights = st.integers(-(2**20), 2**20).map(lambda value: value / 1024)
coarse_heights = st.integers(0, 3).map(float)  # many plateaus and equal peaks
spacings = st.sampled_from([0.5, 1.0, 8.0])  # powers of two: ratios are exact


def surfaces(smallest=9, largest=17):
    """Odd, even, square and oblong grids."""
    shapes = st.tuples(st.integers(smallest, largest), st.integers(smallest, largest))
    return shapes.flatmap(
        lambda shape: st.one_of(
            hnp.arrays(np.float64, shape, elements=exact_heights),
            hnp.arrays(np.float64, shape, elements=coarse_heights),
        )
    )


def assert_same(ours, theirs, tolerance=1e-09):
    assert list(ours) == list(theirs)
    assert ours == pytest.approx(theirs, rel=tolerance, abs=tolerance, nan_ok=True)


@settings(max_examples=60, deadline=None)
@given(heights=surfaces(), spacing=st.tuples(spacings, spacings))
def test_agrees_with_whole_numbers_on_any_grid(heights, spacing):
    description = describe(heights, spacing)
    assert_same(description.values, exact.statistics(heights, spacing))
    undefined = any(math.isnan(value) for value in description.values.values())
    assert undefined == bool(description.reason)


@pytest.mark.parametrize(
    ("shape", "spacing"),
    [((9, 9), (0.1, 0.1)), ((17, 9), (0.3, 0.7)), ((17, 9), (0.7, 0.01))],
)
def test_paraboloid_has_one_summit_of_curvature_one_over_radius(shape, spacing):
    radius = 40.0
    x, y = (g * (np.arange(n) - n // 2) for n, g in zip(shape, spacing, strict=True))
    description = describe(-(x[:, None] ** 2 + y**2) / (2 * radius), spacing)
    values, nodes = description.values, shape[0] * shape[1]
    assert values["asperity_density"] == 1 / nodes
    assert values["asperity_mean"] == values["height_max"]
    assert values["asperity_curvature_mean"] == pytest.approx(1 / radius, rel=1e-9)
    assert values["asperity_curvature_rms"] == 0.0
    assert values["peak_density"] == sum(shape) / (2 * nodes)  # one on each profile
    assert values["peak_curvature_mean"] == pytest.approx(1 / radius, rel=1e-9)
    assert math.isnan(values["peak_curvature_skewness"])
    assert description.reason == UNDEFINED


def test_last_bits_do_not_depend_on_the_threads_of_blas():
    """A database is the same for any number of ranks, which share the cores' threads."""
    script = (
        "import numpy as np; from gen.statistics import describe; from gen.surface import generate;"
        "z = generate('diamond-square', 257, 0.65, 12.0, np.random.default_rng(3))\n"
        "print([value.hex() for value in describe(z, 2.0).values.values()])"
    )
    outputs = [
        python("-c", script, OPENBLAS_NUM_THREADS=threads, OMP_NUM_THREADS=threads).stdout
        for threads in ("1", "2", "3")
    ]
    assert outputs[0].count("0x") == len(NAMES)
    assert len(set(outputs)) == 1


def spike(rows, columns, at):
    heights = np.zeros((rows, columns))
    heights[at] = 1.0
    return heights


def test_heights_lost_beside_a_huge_one_are_no_missing_asperities():
    heights = np.random.default_rng(0).normal(size=(9, 9)) - 1e38 * spike(9, 9, (4, 4))
    description = describe(heights, 1.0)
    assert math.isnan(description.values["asperity_skewness"])
    assert (
        description.reason == "most heights are lost in rounding beside one of -1e+38 um"
    )


@pytest.mark.parametrize(
    ("heights", "reason"),
    [
        (np.zeros((5, 5)), "flat surface: no profile peak, no asperity"),
        (np.array([[0.0, 1.0], [2.0, 4.0]]), UNDEFINED),
        (spike(3, 3, (1, 1)), UNDEFINED),
        (np.repeat([[0.0], [1.0], [0.0], [2.0], [0.0]], 4, axis=1), UNDEFINED),
        (spike(5, 8, (2, 2)) + spike(5, 8, (2, 5)), UNDEFINED),
    ],
)
def test_degenerate_surfaces_give_nan_with_a_reason(heights, reason):
    description = describe(heights, 1.0)
    assert description.reason == reason
    assert_same(description.values, exact.statistics(heights, (1.0, 1.0)))
    assert any(math.isnan(value) for value in description.values.values())


@settings(max_examples=200, deadline=None)
@given(
    heights=hnp.arrays(
        np.float64,
        st.tuples(st.integers(2, 6), st.integers(2, 6)),
        elements=st.floats(-1e300, 1e300)
        | st.floats(-1.0, 1.0)
        | st.sampled_from([0.0, 1.0]),
    )
)
def test_any_finite_surface_has_statistics_or_a_reason(heights):
    """No warning either: pytest turns them into errors."""
    description = describe(heights, 1.0)
    values = description.values.values()
    assert not any(math.isinf(value) for value in values)
    assert any(math.isnan(value) for value in values) == bool(description.reason)


@pytest.mark.parametrize(
    "heights", [np.zeros((1, 9)), np.diag([0.0, np.nan]), np.diag([-1.7e308, 1.7e308])]
)
def test_heights_that_have_no_statistics_are_refused(heights):
    with pytest.raises(InputError, match=r"^heights .*: give .*"):
        describe(heights, 1.0)


@pytest.mark.parametrize("spacing", [0.0, (1.0, 0.0), (1.0, 1.0, 1.0)])
def test_spacings_that_are_none_are_refused(spacing):
    message = r"^spacing .*: give one or a pair, from 1e-15 to"
    with pytest.raises(InputError, match=message):
        describe(np.eye(4), spacing)


@pytest.fixture(scope="module")
def database():
    """Statistics of 2,000 surfaces drawn as the paper's: k = 7, L = 1000, H from 0.5 to 0.8."""
    random = np.random.default_rng(7)
    rows = []
    for _ in range(2000):
        hurst, sigma0 = random.uniform(0.5, 0.8), random.uniform(10.0, 15.0)
        heights = generate("diamond-square", 129, hurst, sigma0, random)
        rows.append(list(describe(heights, 1000 / 128).values.values()))
    return dict(zip(NAMES, np.array(rows).T, strict=True))


@pytest.mark.parametrize(
    "name", [name for name in NAMES if not name.startswith("bandwidth")]
)
def test_ranges_are_those_of_table_1(database, name):
    """The central 98 % lie in the paper's range, to its printed digits, and span most of it.

    The upper ends of fourth moments, and of the skewness of curvature, are set by single surfaces
    among the paper's 15,878.
    """
    values, (low, high) = database[name], TABLE_1[name]
    width = high - low
    inner_low, inner_high = np.percentile(values, [1, 99])
    assert low - 0.02 * width <= inner_low < inner_high <= high + 0.02 * width
    assert values.min() <= low + 0.25 * width
    part = 0.3 if "kurtosis" in name or "curvature_skewness" in name else 0.7
    assert min(values.max(), high) - max(values.min(), low) >= part * width


@pytest.mark.few(4)
@pytest.mark.parametrize("name", preset_names())
def test_slopes_of_the_shipped_scenes_are_known_from_their_statistics(name):
    scene = load(name)
    for number in range(5):
        heights = surface_numbered(scene, number)
        statistics = describe(heights, scene.grid.spacing).values
        values = {key: np.array([value]) for key, value in statistics.items()}
        (estimate,) = rms_slope_of(values, scene.grid.spacing)
        assert estimate == pytest.approx(rms_slope(heights, scene.grid.spacing), rel=0.08)


def estimated_slope(heights):
    """The slope of a surface that is known from its statistics alone."""
    statistics = describe(heights, 2.0).values
    values = {key: np.array([value]) for key, value in statistics.items()}
    (estimate,) = rms_slope_of(values, (2.0, 2.0))
    return estimate


@pytest.mark.parametrize("spacing", [1e-200, 1e200])
def test_slopes_beyond_the_largest_numbers_raise_no_error(spacing):
    statistics = describe(np.random.default_rng(0).normal(size=(9, 9)), 1.0).values
    values = {key: np.array([value]) for key, value in statistics.items()}
    assert rms_slope_of(values, (spacing, spacing)).shape == (1,)


def test_the_slope_of_a_sine_wave_is_known_exactly():
    x = np.arange(240)[:, None] * np.ones(240)
    waves = np.sin(2 * np.pi * x / 12 + 0.1) + np.sin(2 * np.pi * x.T / 12 + 0.1)
    expected = rms_slope(waves, (2.0, 2.0))
    assert estimated_slope(waves) == pytest.approx(expected, rel=0.01)


def test_the_slope_of_a_flat_surface_is_not_known():
    assert math.isnan(estimated_slope(np.zeros((240, 240))))
