"""Features of one surface, on any grid."""

import numpy as np
import pytest

import bem
from gen.runtime.errors import InputError
from gen.surface import generate
from learn.features import SETS, SurfaceFeatures
from learn.features.sets import HYBRID


def surface(seed, nodes=33):
    return generate("diamond-square", nodes, 0.7, 12.0, np.random.default_rng(seed))


@pytest.mark.parametrize("shape", [(33, 33), (20, 20), (40, 57), (129, 129), (130, 130), (34, 100)])
def test_any_grid_has_features_and_few_nodes_are_their_own_blocks(shape):
    z = np.random.default_rng(0).normal(size=shape).cumsum(axis=0)
    sides = (float(shape[0] - 1), float(shape[1] - 1))
    rough = SurfaceFeatures(z, sides)
    deltas = np.array([0.2, 3.0, 30.0])
    found = rough.features(SETS["hybrid"], deltas)
    assert np.isfinite(found).all()
    values = dict(zip(HYBRID, rough.hybrid(3.0), strict=True))
    assert values["bearing_share"] == np.mean(z > z.max() - 3.0)
    assert values["refined_share"] <= values["bearing_share"]
    if max(shape) <= 33:  # nothing stands above its own solution, whatever that leaves there
        assert values["refined_share"] == values["refined_interference/delta"] == 0
        solved = bem.solve(z, sides, 3.0)
        assert values["coarse_area_percent"] == pytest.approx(solved.area_percent, abs=0.5)
        assert values["coarse_force/(E*.L.delta)"] == pytest.approx(
            solved.force / (rough.length * 3.0), rel=0.02
        )
    else:
        assert values["refined_share"] > 0


def test_a_delta_that_reaches_no_block_still_has_features():
    z = np.zeros((66, 66))
    z[30, 30] = 10.0
    z += np.random.default_rng(0).uniform(0, 1e-3, z.shape)
    values = SurfaceFeatures(z, (65.0, 65.0)).hybrid(0.5)
    assert values == (1 / 66**2, 0.5 / 66**2 / 0.5, 0.0, 0.0, 0.0, 1 / 66**2, 0.5 / 66**2 / 0.5)


def test_the_mean_displacement_follows_from_the_force():
    z = surface(7, 129)
    for delta in (5.0, 15.0, 40.0):
        solved = bem.solve(z, 1000.0, delta)
        compliance, yielded = SurfaceFeatures(z, (1000.0, 1000.0)).coarse_means(delta)
        assert yielded == 0.0
        predicted = compliance * solved.force / 1000.0
        assert predicted == pytest.approx(float(solved.displacement.mean()), rel=0.03)


@pytest.mark.parametrize("delta", [0.0, -1.0, np.nan, np.inf])
def test_a_delta_that_no_contact_has_is_refused(delta):
    with pytest.raises(InputError, match="above 0"):
        SurfaceFeatures(surface(0), (1.0, 1.0)).features(SETS["paper"], np.array([delta]))


def test_a_flat_surface_is_refused_with_its_reason():
    with pytest.raises(InputError, match="flat surface"):
        SurfaceFeatures(np.ones((9, 9)), (1.0, 1.0)).features(SETS["paper"], np.array([1.0]))


@pytest.mark.parametrize("boundary", ["periodic", "mirror"])
@pytest.mark.parametrize("shape", [(32, 32), (20, 27), (64, 64), (70, 100)])
def test_patches_without_edges_have_features_up_to_full_contact(shape, boundary):
    """Blocks of unequal sizes are in full contact before the surface is: they are held below."""
    z = np.random.default_rng(0).normal(size=shape).cumsum(axis=0)
    rough = SurfaceFeatures(z, (float(shape[0]), float(shape[1])), boundary=boundary)
    assert rough.steps == (1.0, 1.0)
    full = float(z.max() - z.mean())
    for share in (0.05, 0.5, 0.98, 0.9999):
        values = dict(zip(HYBRID, rough.hybrid(share * full), strict=True))
        assert np.isfinite(list(values.values())).all()
        assert values["coarse_displacement/delta"] == 0.0
        assert rough.coarse_means(share * full) == (0.0, 0.0)
        if max(shape) <= 32 and share < 0.98:
            solved = bem.solve(z, rough.sides, share * full, boundary=boundary)
            assert values["coarse_area_percent"] == pytest.approx(solved.area_percent, abs=0.5)
    assert values["coarse_area_percent"] > 80
    assert rough.coarse_means(0.9 * full, 0.05)[1] > 0
