"""Features of one surface, on any grid."""

import functools

import numpy as np
import pytest
from scipy.special import erf

import bem
from bem.problem import node_spacing
from gen.scene import Scene
from gen.surface import generate
from learn.features import SETS, SurfaceFeatures, chosen
from learn.features.columns import BLOCK_COUNTS, COARSE, HYBRID, LOCAL, SKEWNESS
from learn.features.surface import Blocks, CoarseMaterial


def surface(seed, nodes=33):
    return generate("diamond-square", nodes, 0.7, 12.0, np.random.default_rng(seed))


FEW_NODES = [(33, 33), (20, 20)]
"""Grids whose nodes are the blocks."""

MANY_NODES = [(40, 57), (129, 129), (130, 130), (34, 100)]


@functools.cache
def patch_of(shape):
    """A surface on a grid with cells of 1 um, and its columns at Delta = 3 um by their names."""
    z = np.random.default_rng(0).normal(size=shape).cumsum(axis=0)
    sides = (float(shape[0] - 1), float(shape[1] - 1))
    rough = SurfaceFeatures(z, sides, (1.0, 1.0))
    return rough, dict(zip(HYBRID, rough.hybrid(3.0), strict=True))


@pytest.mark.parametrize("shape", [*FEW_NODES, *MANY_NODES])
def test_any_grid_has_finite_features(shape):
    rough, _ = patch_of(shape)
    deltas = np.array([0.2, 3.0, 30.0])
    found = SETS["hybrid"].of(rough.rows(SETS["hybrid"], deltas))
    assert np.isfinite(found).all()


@pytest.mark.parametrize("shape", [*FEW_NODES, *MANY_NODES])
def test_the_bearing_share_is_that_of_the_nodes_above_a_rigid_plane(shape):
    rough, values = patch_of(shape)
    z = rough.heights
    assert values["bearing_share"] == np.mean(z > z.max() - 3.0)
    assert values["refined_share"] <= values["bearing_share"]


@pytest.mark.parametrize("shape", FEW_NODES)
def test_no_node_is_above_its_own_solution(shape):
    _, values = patch_of(shape)
    assert values["refined_share"] == values["refined_interference/delta"] == 0


@pytest.mark.parametrize("shape", FEW_NODES)
def test_of_few_nodes_the_coarse_solve_is_the_contact(shape):
    rough, values = patch_of(shape)
    solved = bem.solve(rough.heights, rough.sides, 3.0)
    assert values["coarse_area_percent"] == pytest.approx(solved.area_percent, abs=0.5)
    force = solved.force / (rough.length * 3.0)
    assert values["coarse_force/(E*.L.delta)"] == pytest.approx(force, rel=0.02)


@pytest.mark.parametrize("shape", MANY_NODES)
def test_of_many_nodes_some_are_above_the_coarse_displacement(shape):
    _, values = patch_of(shape)
    assert values["refined_share"] > 0


def test_a_delta_that_reaches_no_block_still_has_features():
    z = np.zeros((66, 66))
    z[30, 30] = 10.0
    z += np.random.default_rng(0).uniform(0, 1e-3, z.shape)
    values = SurfaceFeatures(z, (65.0, 65.0), (1.0, 1.0)).hybrid(0.5)
    coarse, local = (
        values[: len(COARSE)],
        dict(zip(LOCAL, values[len(COARSE) :], strict=True)),
    )
    assert coarse == (
        1 / 66**2,
        0.5 / 66**2 / 0.5,
        0.0,
        0.0,
        0.0,
        1 / 66**2,
        0.5 / 66**2 / 0.5,
    )
    assert local["refined_share(+1s)"] == 1 / 66**2
    assert local["local_area(1p)"] == local["coarse_perimeter/L"] == 0.0
    assert local["refined_interference_2/delta"] == pytest.approx(1 / 66)


@pytest.mark.parametrize(
    ("sign", "low", "high"), [(0, -0.1, 0.1), (-1, -np.inf, -1), (1, 1, np.inf)]
)
def test_pits_and_peaks_that_blocks_do_not_resolve_skew_the_heights(sign, low, high):
    peaks = np.zeros((129, 129))
    peaks[5::9, 5::9] = 5.0
    heights = surface(0, nodes=129) + sign * peaks
    rough = SurfaceFeatures(heights, (128.0, 128.0), (1.0, 1.0))
    assert low < rough.hybrid(3.0)[HYBRID.index(SKEWNESS)] < high


def test_rounding_of_heights_has_no_skewness():
    tiny = SurfaceFeatures(surface(0) + 1e9, (128.0, 128.0), (4.0, 4.0))
    assert tiny.hybrid(3.0)[HYBRID.index(SKEWNESS)] == 0.0


WITHOUT_EDGES = pytest.mark.parametrize("boundary", ["periodic", "mirror"])


def patch_without_edges(shape, boundary):
    """A surface on a grid with cells of 1 um, and the Delta of its full contact."""
    z = np.random.default_rng(0).normal(size=shape).cumsum(axis=0)
    sides = float(shape[0]), float(shape[1])
    rough = SurfaceFeatures(z, sides, (1.0, 1.0), boundary=boundary)
    return rough, float(z.max() - z.mean())


@WITHOUT_EDGES
@pytest.mark.parametrize("shape", [(32, 32), (20, 27), (64, 64), (70, 100)])
def test_patches_without_edges_have_features_up_to_full_contact(shape, boundary):
    """Blocks of unequal sizes are in full contact before the surface is: they are held below."""
    rough, full = patch_without_edges(shape, boundary)
    for share in (0.05, 0.5, 0.98, 0.9999):
        values = dict(zip(HYBRID, rough.hybrid(share * full), strict=True))
        assert np.isfinite(list(values.values())).all()
        assert values["coarse_displacement/delta"] == 0.0
    assert values["coarse_area_percent"] > 80


@WITHOUT_EDGES
@pytest.mark.parametrize("shape", [(32, 32), (20, 27)])
@pytest.mark.parametrize("share", [0.05, 0.5])
def test_of_few_nodes_without_edges_the_coarse_area_is_that_of_the_contact(
    shape, boundary, share
):
    rough, full = patch_without_edges(shape, boundary)
    area = rough.hybrid(share * full)[HYBRID.index("coarse_area_percent")]
    solved = bem.solve(rough.heights, rough.sides, share * full, boundary=boundary)
    assert area == pytest.approx(solved.area_percent, abs=0.5)


@WITHOUT_EDGES
def test_bodies_without_edges_have_means_only_if_they_yield(boundary):
    rough, full = patch_without_edges((64, 64), boundary)
    assert rough.means(0.9 * full) == (0.0, 0.0)
    assert rough.means(0.9 * full, 0.05).yielded_depth > 0


@pytest.mark.parametrize("boundary", ["free", "periodic", "mirror"])
@pytest.mark.parametrize("blocks", BLOCK_COUNTS)
@pytest.mark.parametrize("hardness_ratio", [None, 0.01])
def test_what_surrogates_see_is_finite_on_any_patch(boundary, blocks, hardness_ratio):
    """Oblong patches and cells, fewer nodes than blocks along one axis, bodies that yield."""
    z = np.random.default_rng(3).normal(size=(40, 150)).cumsum(axis=1)
    text = f"[contact]\nhardness_ratio = {hardness_ratio}" if hardness_ratio else ""
    scene = Scene.parse(f"samples = 8\n{text}", "test")
    wanted = chosen("hybrid", [scene], roots=True, blocks=blocks)
    steps = node_spacing(40, 50.0, boundary), node_spacing(150, 130.0, boundary)
    rough = SurfaceFeatures(z, (50.0, 130.0), steps, boundary=boundary)
    found = wanted.of(rough.rows(wanted, np.array([1e-3, 2.0, 10.0]), hardness_ratio))
    assert found.shape == (3, len(wanted.columns))
    assert np.isfinite(found).all()
    turned = SurfaceFeatures(z.T.copy(), (130.0, 50.0), steps[::-1], boundary=boundary)
    a, b = (
        s.hybrid(10.0, CoarseMaterial(hardness_ratio), blocks) for s in (rough, turned)
    )
    np.testing.assert_allclose(a, b, rtol=1e-6)


def test_the_area_inside_the_blocks_is_perssons():
    z = np.random.default_rng(1).normal(size=(40, 30))
    blocks = Blocks(z, (1.0, 1.0), 10)
    pressure = np.zeros((10, 10))
    pressure[3, 5], pressure[8, 8] = 0.2, 1.5
    for factor in (0.5, 1.0, 2.0):
        shares = erf(np.sqrt(2) * factor * pressure / blocks.slopes)
        assert blocks.local_area(pressure, factor) == pytest.approx(shares.mean())
    assert blocks.local_area(1e6 * np.ones((10, 10)), 1.0) == pytest.approx(1.0)
    assert blocks.local_area(np.zeros((10, 10)), 1.0) == 0.0
