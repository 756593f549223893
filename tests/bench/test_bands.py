"""Further surfaces inside the bands of laws: how many, of which populations."""

import numpy as np
import pytest

from bench import bands
from gen.runtime.errors import InputError


@pytest.mark.long
def test_further_surfaces_lie_inside_the_bands_of_laws_of_all_populations():
    """And far fewer between the quantiles of five surfaces."""
    rows = bands.bands(nodes=17, pool=150, draws=100)
    assert {row["surfaces"] for row in rows} == {5, 10, 20, 50}
    assert len({row["population"] for row in rows}) == 3
    assert [row for row in rows if row["verdict"] != "passed"] == []
    assert max(row["by_quantiles_percent"] for row in rows if row["surfaces"] == 5) < 70


def test_shares_of_a_pool_whose_values_are_known():
    """Normal logarithms, of which bands of any number hold what they say."""
    values = np.random.default_rng(0).lognormal(size=(300, 2))
    pool = bands.Pool("known", {"closure": values, "mean gap": np.ones((300, 2))})
    for number in (5, 50):
        closure, gap = bands.judged(pool, number, draws=60)
        assert closure["inside_percent"] == pytest.approx(90, abs=3)
        assert (
            closure["least_percent"]
            <= closure["inside_percent"]
            <= closure["most_percent"]
        )
        assert gap["inside_percent"] == 100
        assert gap["verdict"] == "failed"


def test_a_pool_has_twice_the_surfaces_of_the_largest_law():
    with pytest.raises(InputError, match="--pool 99: give 100 or more"):
        bands.bands(nodes=17, pool=99, draws=1)
