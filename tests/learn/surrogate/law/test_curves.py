"""Tables of a contact law."""

import numpy as np
import pytest

from gen.runtime.errors import InputError
from learn.surrogate.law.curves import QUANTITIES, monotone, tabulated
from learn.surrogate.law.points import Points


def test_a_law_that_is_not_finite_is_refused():
    """Found by the fuzzer, with weights of 1e308 in a surrogate."""
    at = np.array([0.0, 1.0, 2.0])
    values = dict.fromkeys((*QUANTITIES, "delta_um"), at) | {"force_uN": np.array([0, 1, np.inf])}
    with pytest.raises(InputError, match="force_uN of the law has values that are not finite"):
        tabulated("delta_um", at, [Points(values, reasons=("", "", ""))], 0.9)


def test_points_outside_the_training_do_not_move_those_inside():
    """A surrogate may predict anything out there, less than at the loads that it knows."""
    rising = np.array([0.0, 1.0, 3.0, 8.0, 2.0, 1.0])
    values = dict.fromkeys(QUANTITIES, rising) | {"mean_gap_um": -rising}
    points = Points(values, values, values, ("", "", "", "", "delta is large", "delta is large"))
    smooth, correction = monotone(points)
    for name in QUANTITIES:
        np.testing.assert_allclose(smooth.values[name][:4], values[name][:4], rtol=1e-7)
        assert (np.diff(np.abs(smooth.values[name])) >= 0).all()
        assert correction.values[name][4] != 0
