"""Numbers as users type them, and moduli of one elastic body and of two."""

import numpy as np
import pytest

import bem
from bem.bodies import Pair
from bem.checks import LARGEST as LARGEST_COMPUTED
from gen.maps.answers import require_conductivities
from gen.material import (
    LARGEST,
    MOST_VALUES,
    Bodies,
    ElasticBody,
    Gas,
    Layer,
    combined_modulus,
    loads_from,
)
from gen.runtime.errors import InputError

HUGE = "9" * 5000


def test_values_are_those_of_linspace():
    assert loads_from("delta", "5", "advice") == [5.0]
    assert loads_from("delta", "1,2:3:5,-7", "advice") == [
        1.0,
        *np.linspace(2, 3, 5),
        -7.0,
    ]
    decades = loads_from("delta", "0.1:100:4:log", "advice")
    assert (decades[0], *decades[1:3], decades[3]) == (
        0.1,
        *map(pytest.approx, (1, 10)),
        100,
    )
    assert loads_from("delta", "8:2:3:log,1", "advice") == pytest.approx([8, 4, 2, 1])


@pytest.mark.parametrize(
    "text",
    [
        "",
        "1:2",
        "1:2:1",
        "1:inf:3",
        "1,",
        ":" * 3000,
        "1:2:1_0",
        "1:2:٣",
        "0:1:3:log",
        "1:log",
        f"1:2:{HUGE}",
    ],
)
def test_what_is_no_value_is_refused(text):
    with pytest.raises(InputError, match=r"^--delta .*: advice$"):
        loads_from("delta", text, "advice")


@pytest.mark.parametrize(
    "text", ["1:2:2000000000", f"1:2:{MOST_VALUES},1:2:3", "1," * MOST_VALUES + "1"]
)
def test_more_values_than_any_use_are_refused_before_they_take_memory(text):
    with pytest.raises(InputError, match="give 100,000 values at most"):
        loads_from("delta", text, "advice")


def test_numbers_that_users_give_end_where_computed_ones_do():
    assert LARGEST == LARGEST_COMPUTED
    for refused in (
        lambda: loads_from("pressure", "1e39"),
        lambda: loads_from("force", "1,-1e200", "give a number"),
        lambda: require_conductivities([1e308]),
        lambda: Bodies.of([1e39], None, None, None),
    ):
        with pytest.raises(InputError, match=r"1e\+38"):
            refused()


def test_moduli_of_one_elastic_body_and_of_two_combine():
    assert combined_modulus([210e3], [0.3]) == pytest.approx(210e3 / 0.91)
    both = 1 / (0.91 / 210e3 + 0.75 / 3e3)
    assert combined_modulus([210e3, 3e3], [0.3, 0.5]) == pytest.approx(both)
    assert combined_modulus([2.0, 2.0], []) == 1


def test_e_star_stands_for_moduli():
    assert combined_modulus([], [], 7.0) == 7


def test_without_numbers_there_is_no_modulus():
    assert combined_modulus([], []) is None


def test_a_gas_between_parallel_plates_conducts_by_their_distance_and_its_jump():
    gas = Gas(0.026, 0.37)
    assert gas.conductance(np.full((4, 4), 2.0)) == 0.026 / (2.0 + 0.37)


def test_a_gas_conducts_nothing_where_bodies_touch():
    gas = Gas(0.026, 0.37)
    assert gas.conductance(np.array([[0.0, 2.0]])) == 0.026 / (2.0 + 0.37) / 2


@pytest.mark.parametrize(
    ("text", "message"),
    [("0,1", "give numbers"), ("-1", "give numbers"), ("nan", "give numbers")],
)
def test_displacements_are_above_0(text, message):
    with pytest.raises(InputError, match=message):
        loads_from("delta", text)


def test_pressures_may_be_0_but_not_all_of_them():
    assert loads_from("pressure", "0,1") == [0.0, 1.0]
    with pytest.raises(InputError, match="not all 0"):
        loads_from("pressure", "0,0")


@pytest.mark.parametrize(
    ("young", "poisson", "e_star", "message"),
    [
        ([1.0, 2.0], [0.3], None, "--young was given 2 times, --poisson 1 times"),
        ([0.0], [], None, "--young 0"),
        ([1.0], [0.6], None, "--poisson 0.6"),
        ([1.0], [], 2.0, "--e-star stands in place"),
        ([], [], -2.0, "--e-star -2"),
    ],
)
def test_moduli_that_no_material_has_are_refused(young, poisson, e_star, message):
    with pytest.raises(InputError, match=message):
        combined_modulus(young, poisson, e_star)


LAYER = Layer(thickness=5.0, material=ElasticBody(2.4, 0.45), on_rigid=False)


def test_e_star_of_a_layer_is_that_of_its_own_material():
    """With a second elastic body it is that of layer and body together."""
    bodies = Bodies.with_layer(LAYER, [2e5], [0.3], None, None)
    assert bodies.e_star == pytest.approx(2.4 / (1 - 0.45**2))
    both = Bodies.with_layer(LAYER, [2e5, 10.0], [0.3, 0.5], None, None)
    assert both.e_star == pytest.approx(1 / (1 / bodies.e_star + (1 - 0.5**2) / 10))
    assert both.text == f"E* = {both.e_star:.6g} MPa, layer of {both.layered.text}"


def test_a_layer_is_named_with_what_lies_below_and_above_it():
    both = Bodies.with_layer(LAYER, [2e5, 10.0], [0.3, 0.5], None, None)
    layer = "5 um of 2.4 MPa (Poisson's ratio 0.45)"
    below = "200000 MPa (Poisson's ratio 0.3)"
    other = "10 MPa (Poisson's ratio 0.5)"
    assert both.layered.text == f"{layer} on {below}, against {other}"
    rigid = Bodies.with_layer(LAYER._replace(on_rigid=True), None, None, None, None)
    assert rigid.layered.text == f"{layer} on a rigid base"


def test_a_uniform_pressure_compresses_a_layer_alike_on_any_base():
    """Under uniaxial strain: h (1 + nu) (1 - 2 nu) / ((1 - nu) E)."""
    elastic = Bodies.with_layer(LAYER, [2e5, 10.0], [0.3, 0.5], None, None).layered
    rigid = elastic._replace(base=None, other=None)
    expected = 5.0 * 1.45 * 0.1 / (0.55 * 2.4)
    assert elastic.layer_compliance == pytest.approx(expected, rel=1e-12)
    assert rigid.layer_compliance == elastic.layer_compliance


def test_a_layer_becomes_the_body_that_the_solver_takes():
    layered = Bodies.with_layer(LAYER, [2e5, 10.0], [0.3, 0.5], None, None).layered
    on_steel = bem.Layered(5.0, 2.4, 0.45, bem.HalfSpace(2e5, 0.3))
    assert layered.body == Pair(on_steel, bem.HalfSpace(10.0, 0.5))
    rigid = Bodies.with_layer(LAYER._replace(on_rigid=True), None, None, None, None)
    assert rigid.layered.body == bem.Layered(5.0, 2.4, 0.45, "rigid")


@pytest.mark.parametrize(
    ("layer", "material", "message"),
    [
        (
            (5.0, None, None, "elastic"),
            (),
            "--layer-thickness: a layer needs --layer-young",
        ),
        ((None, 5.0, None, "elastic"), (), "--layer-young: a layer needs --layer-thick"),
        ((None, None, None, "rigid"), (), "--layer-base rigid: a layer needs"),
        ((-1.0, 1.0, None, "elastic"), (), "the thickness must be between"),
        ((1.0, 0.0, None, "elastic"), (), "the modulus must be between"),
        ((1.0, 1.0, 0.6, "elastic"), (), "--layer-poisson 0.6: must be above -1"),
        (
            (1.0, 1.0, 0.3, "elastic"),
            (None, None, None, None),
            "give --young of the body",
        ),
        ((1.0, 1.0, 0.3, "elastic"), (None, None, 3.0, None), "--e-star does not tell"),
        ((1.0, 1.0, 0.3, "rigid"), ([3.0], None, None, None), "leave out --young and"),
        (
            (1.0, 1.0, 0.3, "elastic"),
            ([3.0], [0.7], None, None),
            "--poisson 0.7: must be",
        ),
    ],
)
def test_layers_that_are_refused(layer, material, message):
    with pytest.raises(InputError, match=message):
        Bodies.with_layer(Layer.of(*layer), *material)


def test_without_its_options_there_is_no_layer():
    assert Layer.of(None, None, None, "elastic") is None
