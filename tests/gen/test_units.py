"""Numbers for people have no exponents where a larger unit avoids them."""

import math

import pytest

from gen.maps.answers import Answer
from gen.units import LARGER_UNITS, Unit, readable_unit, time_with_unit, with_unit


@pytest.mark.parametrize("unit", LARGER_UNITS)
def test_a_larger_unit_is_chosen_where_a_number_would_have_an_exponent(unit):
    assert readable_unit(unit, 9_999.0, 4) == Unit(unit, 1.0)
    assert readable_unit(unit, -10_000.0, 4) == LARGER_UNITS[unit]


@pytest.mark.parametrize("number", [math.nan, math.inf, -math.inf])
def test_what_is_no_finite_number_keeps_its_unit(number):
    assert readable_unit("uN", number, 4).name == "uN"


def test_other_units_stay():
    assert readable_unit("um", 1e9, 4) == Unit("um", 1.0)


def test_numbers_are_written_with_their_units():
    assert with_unit(5.0784e7, "uN") == "50.78 N"
    assert with_unit(50.0, "uN") == "50 uN"
    assert with_unit(2.308e5, "MPa") == "230.8 GPa"


def test_an_answer_keeps_its_remark_in_another_unit():
    stiffness = Answer(
        "stiffness_N_per_m", 8.0e7, "stiffness", "N/m, of unloading", error=2e6
    )
    larger = stiffness.in_unit(LARGER_UNITS["N/m"])
    assert larger == Answer(
        "stiffness_N_per_um", 80.0, "stiffness", "N/um, of unloading", 2.0
    )
    assert stiffness.in_unit(Unit("N/m", 1.0)) is stiffness


@pytest.mark.parametrize(
    ("seconds", "text"),
    [
        (0.0, "0 ms"),
        (0.023544, "23.5 ms"),
        (0.99996, "1 s"),
        (6.02601, "6.03 s"),
        (1234.5, "1230 s"),
        (math.inf, "inf s"),
    ],
)
def test_measured_times_have_three_digits(seconds, text):
    assert time_with_unit(seconds) == text
