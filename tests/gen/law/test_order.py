"""The request for a law: its loads and its quantities."""

import pytest

from gen.law import Order
from gen.law.order import require_also
from gen.material import Gas
from gen.quantities import CONTINUUM, GAS, JOINT, STIFFNESS
from gen.runtime.errors import InputError


def test_loads_are_ascending_and_each_once():
    loads = Order(inputs=("a",), delta="3,1,2,1", pressure="5:1:2").loads()
    assert {load: values.tolist() for load, values in loads.items()} == {
        "delta": [1.0, 2.0, 3.0],
        "pressure": [1.0, 5.0],
    }


def test_loads_that_are_not_given_are_left_out():
    assert Order(inputs=("a",)).loads() == {}


@pytest.mark.parametrize(
    ("loads", "requested"),
    [
        ({}, ("delta",)),
        ({"delta": "1"}, ("delta",)),
        ({"pressure": "1"}, ("pressure",)),
        ({"delta": "1", "pressure": "1"}, ("delta", "pressure")),
    ],
)
def test_tables_of_the_loads_that_are_given_are_requested(loads, requested):
    assert Order(inputs=("a",), **loads).requested == requested


def test_a_joint_conductance_needs_a_gas_and_conductivities():
    gas = Gas(0.026, 0.4)
    alone = Order(inputs=("a",), gas=gas).quantities
    both = Order(inputs=("a",), gas=gas, conductivities=(1.0, 2.0)).quantities
    assert GAS in alone
    assert JOINT not in alone
    assert {GAS, JOINT, STIFFNESS} <= {*both}
    assert CONTINUUM not in both


def test_further_quantities_are_split_at_commas_and_each_once():
    names = ["perimeter, contact_spots", "perimeter"]
    assert require_also(names) == ("perimeter", "contact_spots")


def test_a_quantity_that_no_law_has_is_refused():
    with pytest.raises(InputError, match="--also 'heights': give one of"):
        require_also(["heights"])
