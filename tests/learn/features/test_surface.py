"""Features of one surface, on any grid."""

import numpy as np
import pytest
from scipy.special import erf

import bem
from bem.problem import node_spacing
from gen.scene import Scene
from gen.surface import generate
from learn.features import SETS, SurfaceFeatures, chosen
from learn.features.columns import BLOCK_COUNTS, COARSE, HYBRID, LOCAL, SKEWNESS
from learn.features.surface import Blocks


def surface(seed, nodes=33):
    return generate("diamond-square", nodes, 0.7, 12.0, np.random.default_rng(seed))


@pytest.mark.parametrize(
    "shape", [(33, 33), (20, 20), (40, 57), (129, 129), (130, 130), (34, 100)]
)
def test_any_grid_has_features_and_few_nodes_are_their_own_blocks(shape):
    z = np.random.default_rng(0).normal(size=shape).cumsum(axis=0)
    sides = (float(shape[0] - 1), float(shape[1] - 1))
    rough = SurfaceFeatures(z, sides, (1.0, 1.0))
    deltas = np.array([0.2, 3.0, 30.0])
    found = SETS["hybrid"].of(rough.rows(SETS["hybrid"], deltas))
    assert np.isfinite(found).all()
    values = dict(zip(HYBRID, rough.hybrid(3.0), strict=True))
    assert values["bearing_share"] == np.mean(z > z.max() - 3.0)
    assert values["refined_share"] <= values["bearing_share"]
    if (
        max(shape) <= 33
    ):  # nothing stands above its own solution, whatever that leaves there
        assert values["refined_share"] == values["refined_interference/delta"] == 0
        solved = bem.solve(z, sides, 3.0)
        assert values["coarse_area_percent"] == pytest.approx(
            solved.area_percent, abs=0.5
        )
        force = solved.force / (rough.length * 3.0)
        assert values["coarse_force/(E*.L.delta)"] == pytest.approx(force, rel=0.02)
    else:
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


def test_pits_that_blocks_do_not_resolve_skew_what_they_leave():
    rough, pits = surface(0, nodes=129), np.zeros((129, 129))
    pits[5::9, 5::9] = 5.0
    each = (
        SurfaceFeatures(rough + sign * pits, (128.0, 128.0), (1.0, 1.0))
        for sign in (0, -1, 1)
    )
    flat, deep, high = (one.hybrid(3.0)[HYBRID.index(SKEWNESS)] for one in each)
    assert abs(flat) < 0.1
    assert deep < -1
    assert high > 1
    tiny = SurfaceFeatures(surface(0) + 1e9, (128.0, 128.0), (4.0, 4.0))
    assert tiny.hybrid(3.0)[HYBRID.index(SKEWNESS)] == 0.0


@pytest.mark.parametrize("boundary", ["periodic", "mirror"])
@pytest.mark.parametrize("shape", [(32, 32), (20, 27), (64, 64), (70, 100)])
def test_patches_without_edges_have_features_up_to_full_contact(shape, boundary):
    """Blocks of unequal sizes are in full contact before the surface is: they are held below."""
    z = np.random.default_rng(0).normal(size=shape).cumsum(axis=0)
    sides = float(shape[0]), float(shape[1])
    rough = SurfaceFeatures(z, sides, (1.0, 1.0), boundary=boundary)
    full = float(z.max() - z.mean())
    for share in (0.05, 0.5, 0.98, 0.9999):
        values = dict(zip(HYBRID, rough.hybrid(share * full), strict=True))
        assert np.isfinite(list(values.values())).all()
        assert values["coarse_displacement/delta"] == 0.0
        assert rough.means(share * full) == (0.0, 0.0)
        if max(shape) <= 32 and share < 0.98:
            solved = bem.solve(z, rough.sides, share * full, boundary=boundary)
            assert values["coarse_area_percent"] == pytest.approx(
                solved.area_percent, abs=0.5
            )
    assert values["coarse_area_percent"] > 80
    assert rough.means(0.9 * full, 0.05)[1] > 0


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
    a, b = (s.hybrid(10.0, hardness_ratio, blocks) for s in (rough, turned))
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
