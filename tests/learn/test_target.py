"""The scale on which models see their target."""

import numpy as np
import pytest

from learn import dataset, split
from learn.target import UNSCALED, scaling_of


@pytest.mark.parametrize(("factor", "exponent"), [(1.0, 0), (2.0**-40, -40), (2.0**40, 40)])
def test_targets_of_another_size_are_brought_to_an_areas_by_a_power_of_two(
    database, change, factor, exponent
):
    rows = dataset.read(database, "area")
    change("force", slice(None), rows.target.copy() * factor)
    forces = dataset.read(database, "force")
    scaling = scaling_of(forces, np.arange(forces.size))
    if exponent == 0:
        assert scaling == UNSCALED
        return
    assert scaling.mean == 0
    assert np.log2(scaling.deviation) % 1 == 0
    assert 4 <= np.median(scaling.scaled(forces.target)) < 8
    np.testing.assert_array_equal(scaling.restored(scaling.scaled(forces.target)), forces.target)


def test_targets_without_units_are_standardised_over_the_training_rows(solved):
    rows = dataset.read(solved, "area", features="dimensionless")
    train = split.draw(rows).train
    scaled = scaling_of(rows, train).scaled(rows.target[train])
    assert scaled.mean() == pytest.approx(0, abs=1e-12)
    assert scaled.std() == pytest.approx(1)


def test_roots_of_areas_are_standardised_and_squared_again(solved):
    area = dataset.read(solved, "area", features="dimensionless")
    train = split.draw(area).train
    scaling = scaling_of(area, train, roots=True)
    assert scaling.root
    assert scaling.scaled(area.target[train]).std() == pytest.approx(1)
    np.testing.assert_allclose(scaling.restored(scaling.scaled(area.target)), area.target)
    assert scaling.restored(np.array([-1e3]))[0] == 0.0, "a root below 0 is no area"
    force = dataset.read(solved, "force", features="dimensionless")
    assert not scaling_of(force, train, roots=True).root
