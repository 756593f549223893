"""Tables of a contact law."""

import os

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.interpolate import PchipInterpolator
from strict import json_of

from gen import quantities
from gen.law.curves import Points, monotone, slopes, tabulated
from gen.material import Bodies
from gen.runtime.errors import InputError

STIFFNESS = quantities.STIFFNESS.in_laws
CONDUCTANCE = quantities.CONDUCTANCE.in_laws
QUANTITIES = [
    each.in_laws for each in quantities.ALWAYS_IN_LAWS if each is not quantities.DELTA
]
REST = {"mean_gap_um": 4.0}


def test_a_law_that_is_not_finite_is_refused():
    """Found by the fuzzer, with weights of 1e308 in a surrogate."""
    at = np.array([0.0, 1.0, 2.0])
    values = dict.fromkeys((*QUANTITIES, "delta_um"), at) | {
        "force_uN": np.array([0, 1, np.inf])
    }
    with pytest.raises(
        InputError, match="force_uN of the law has values that are not finite"
    ):
        tabulated("delta_um", at, [Points(values, reasons=("", "", ""))], 0.9, REST)


AT = np.array([0.0, 1.0, 2.0, 3.0])


@pytest.fixture
def stiff():
    """Points of a surface up to full contact, where it is infinitely stiff."""
    values = dict.fromkeys((*QUANTITIES, "delta_um"), AT)
    values[STIFFNESS] = np.array([0.0, 1.0, 4.0, np.inf])
    return Points(values, reasons=("",) * 4)


@pytest.mark.parametrize("surfaces", [1, 2])
def test_full_contact_may_be_infinitely_stiff(stiff, surfaces):
    curves = tabulated("delta_um", AT, [stiff] * surfaces, 0.9, REST)
    assert curves.curves[STIFFNESS].value[-1] == np.inf


def test_an_infinite_stiffness_has_no_slope(stiff):
    curves = tabulated("delta_um", AT, [stiff], 0.9, REST)
    slope = curves.curves[STIFFNESS].slope
    assert np.isnan(slope).tolist() == [False, False, False, True]


def test_the_conductance_is_proportional_to_the_stiffness(stiff):
    curves = tabulated("delta_um", AT, [stiff], 0.9, REST)
    conducting = curves.with_conductance(0.5).curves[CONDUCTANCE]
    np.testing.assert_allclose(conducting.value[:3], [0, 0.5, 2])


def test_a_table_without_stiffness_has_no_conductance():
    points = Points(dict.fromkeys(QUANTITIES, AT), reasons=("",) * 4)
    curves = tabulated("delta_um", AT, [points], 0.9, REST)
    assert STIFFNESS not in curves.curves
    assert curves.with_conductance(0.5) is curves


def test_a_table_ends_below_full_contact(stiff):
    curves = tabulated("delta_um", AT, [stiff], 0.9, REST)
    below = curves.below_full_contact(Bodies(1.0), required=True)
    assert below.curves.at.tolist() == [0.0, 1.0, 2.0]
    assert below.remark.startswith("full contact from 3 um on")


def test_a_table_without_full_contact_stays_as_it_is():
    points = Points(dict.fromkeys(QUANTITIES, AT), reasons=("",) * 4)
    curves = tabulated("delta_um", AT, [points], 0.9, REST)
    below = curves.below_full_contact(Bodies(1.0), required=True)
    assert below.curves is curves
    assert below.remark == ""


def test_points_may_begin_at_rest():
    points = Points({"mean_gap_um": AT, "force_uN": AT}, reasons=("", "", "far", ""))
    begun = points.from_rest(REST)
    assert begun.values["mean_gap_um"].tolist() == [4.0, *AT]
    assert begun.values["force_uN"].tolist() == [0.0, *AT]
    assert begun.reasons == ("", "", "", "far", "")


def test_a_population_counts_surfaces_outside_the_training_and_has_the_first_reason():
    values = dict.fromkeys((*QUANTITIES, "delta_um"), AT)
    inside = Points(values, reasons=("",) * 4)
    outside = Points(values, reasons=("", "", "slope is large; delta is large", ""))
    curves = tabulated("delta_um", AT, [inside, outside, outside], 0.9, REST)
    assert curves.reasons[2] == "2 of 3 surfaces, the first: slope is large"
    np.testing.assert_allclose(curves.outside, [0, 0, 2 / 3, 0])
    assert curves.flagged.tolist() == [False, False, True, False]


def test_slopes_are_those_of_the_cubic_from_first_touch_on():
    at = np.array([1.0, 2.0, 4.0])
    expected = PchipInterpolator([0, 1, 2, 4], [3, 2, 1.5, 1]).derivative()(at)
    np.testing.assert_allclose(slopes(at, np.array([2, 1.5, 1]), 3.0), expected)


def test_values_that_are_not_finite_have_no_slope():
    at = np.array([1.0, 2.0, 4.0])
    assert np.isnan(slopes(at, np.array([np.nan, 1, 2]), 0.0)).tolist() == [
        True,
        False,
        False,
    ]


def test_a_single_point_has_no_slope_but_0():
    assert slopes(np.array([0.0]), np.array([1.0]), 0.0).tolist() == [0.0]


def test_points_outside_the_training_do_not_move_those_inside():
    """A surrogate may predict anything out there, less than at the loads that it knows."""
    rising = np.array([0.0, 1.0, 3.0, 8.0, 2.0, 1.0])
    values = dict.fromkeys(QUANTITIES, rising) | {"mean_gap_um": -rising}
    points = Points(
        values, values, values, ("", "", "", "", "delta is large", "delta is large")
    )
    smooth = monotone(points)
    for name in QUANTITIES:
        np.testing.assert_allclose(
            smooth.points.values[name][:4], values[name][:4], rtol=1e-7
        )
        assert (np.diff(np.abs(smooth.points.values[name])) >= 0).all()
        assert smooth.corrections[name][4] != 0


@given(arrays(np.float64, (3, 12), elements=st.floats(0, 100)), st.integers(0, 2**12 - 1))
@settings(max_examples=60, deadline=None)
def test_laws_are_monotone_whatever_is_predicted(predicted, outside):
    """Values and both ends of the intervals; the values stay between the ends."""
    parts = [dict.fromkeys(QUANTITIES, each) for each in predicted]
    reasons = tuple("far" if outside >> place & 1 else "" for place in range(12))
    smooth = monotone(Points(*parts, reasons)).points
    for name in QUANTITIES:
        sign = -1 if name == "mean_gap_um" else 1
        curves = [part[name] for part in (smooth.low, smooth.values, smooth.high)]
        for curve in curves:
            assert (sign * np.diff(curve) >= -1e-9).all()
        assert (np.diff(curves, axis=0) >= 0).all()


def test_names_of_files_that_are_no_text_have_question_marks(surfaces, run):
    name = os.fsdecode(b"many/s\xff.npy")
    (surfaces / "many/s0.npy").rename(name)
    run(name, "--pressure", "1,10", "--json", "law.json")
    assert "many/s?.npy" in str(json_of("law.json"))
