"""Doubts about contact problems: slips of units are told, solids and normalised use are not."""

import numpy as np
import pytest

import bem
from gen.doubts import (
    CHECK_LOAD,
    SLIPS,
    SolvedRows,
    Tally,
    material_doubts,
    modulus_in_words,
    rows_doubts,
)
from gen.material import Bodies, LayeredBody
from gen.scene.tables import Contact

PLAUSIBLE = [
    (210e3, 2000.0),
    (70e3, 300.0),
    (3e3, 250.0),
    (1e6, 1e5),
    (12e3, 9.0),
    (1.0, 0.01),
]
"""Young's modulus and hardness of steel, aluminium, PMMA, diamond, indium; of normalised use."""


@pytest.mark.parametrize(("young", "hardness"), PLAUSIBLE)
def test_solids_are_not_doubted(young, hardness):
    assert not material_doubts(Bodies.of([young], [], None, hardness))
    assert not material_doubts(Bodies.of([young], [], None, None))


@pytest.mark.parametrize(("young", "hardness"), PLAUSIBLE)
def test_slips_of_the_units_of_solids_are_doubted(young, hardness):
    for factors in ((1e-3, 1), (1e6, 1), (1, 1e-3), (1, 1e6)):
        slipped = young * factors[0], hardness * factors[1]
        doubts = material_doubts(Bodies.of([slipped[0]], [], None, slipped[1]))
        ratio = slipped[1] / slipped[0]
        if 1e-4 <= ratio <= 0.2:  # soft or hard enough to pass for another solid
            assert not doubts
            continue
        (line,) = doubts
        assert line.startswith(
            f"hardness over E* is {ratio:.3g}, solids have 0.0001 to 0.2: "
        )
        assert any(
            slip in line for slip in SLIPS.values()
        )  # a ratio may have come of several


def test_the_hardness_of_the_base_of_a_soft_layer_is_doubted():
    layered = LayeredBody.of(bem.Layered(2.0, 3e3, 0.4, bem.HalfSpace(210e3, 0.3)))
    soft = Bodies(e_star=3571.0, has_modulus=True, layered=layered)
    (line,) = material_doubts(soft._replace(hardness=2000.0))
    assert "is the hardness that of the base and not of the layer?" in line
    (line,) = material_doubts(soft._replace(hardness=2e6))
    assert "base" not in line
    assert not material_doubts(soft._replace(hardness=150.0))


@pytest.mark.parametrize(
    "sound",
    [
        {},
        {"hardness_ratio": 0.3},
        {"modulus": 210e3, "hardness_ratio": 0.3},
        {"hardness": (0.001, 0.1)},
        {"modulus": 210e3, "hardness": 2000.0},
    ],
)
def test_scenes_are_not_doubted_by_their_hardness_over_the_modulus(sound):
    assert not Contact(**sound).doubts


@pytest.mark.parametrize(
    ("slipped", "question"),
    [
        ({"modulus": 210.0, "hardness": (1000.0, 2000.0)}, "is the modulus in GPa?"),
        ({"modulus": 210e9}, "is the modulus in Pa?"),
        ({"hardness": 2000.0}, "is the modulus left out?"),
    ],
)
def test_scenes_are_doubted_by_the_hardness_in_megapascals(slipped, question):
    (line,) = Contact(**slipped).doubts
    assert question in line


NODES = 100


def solved(contact_nodes, *, pressure=0.001, slope=0.2):
    """Rows with these numbers of nodes in contact at Delta = 1, 2, ... um on heights of 10 um."""
    rows = len(contact_nodes)
    return SolvedRows(
        delta=np.arange(1.0, rows + 1.0),
        span=np.full(rows, 10.0),
        slope=np.broadcast_to(slope, rows),
        contact_nodes=np.array(contact_nodes),
        pressure=np.full(rows, pressure),
    )


def doubts(rows, load="delta", bodies=None):
    return rows_doubts(Tally.of(rows, NODES), bodies or Bodies(1.0), load, 5.0)


def test_what_holds_for_half_of_the_rows_is_no_doubt():
    assert doubts(solved([1, 1, 30, 40])) == []
    assert doubts(solved([30, 40, NODES, NODES])) == []
    assert doubts(solved([30, 40], slope=[0.9, 1.1])) == []


def test_what_holds_for_more_than_half_of_the_rows_is_a_doubt():
    (line,) = doubts(solved([1, 0, 30]))
    assert line.startswith("up to Delta = 2 um one node touches at most in 2 of 3 rows")
    (line,) = doubts(solved([40, NODES, NODES]))
    assert line.startswith("from Delta = 2 um on every node touches in 2 of 3 rows")
    (line,) = doubts(solved([30, 40, 50], slope=[1.1, np.nan, 3.0]))
    assert line.startswith("rms slope 3 between nodes 5 um apart, above 1 in 2 of 3 rows")


DEFAULT = "E* is 1 MPa, the default without a modulus (modulus in [contact])"
IN_UNITS = pytest.mark.parametrize("load", ["pressure", "force"])


@IN_UNITS
def test_a_pressure_above_the_default_modulus_is_told(load):
    assert doubts(solved([30], pressure=0.9), load) == []
    assert doubts(solved([30], pressure=2.0), load) == [
        f"the largest nominal pressure is 2 MPa: {DEFAULT}"
    ]


@IN_UNITS
def test_full_contact_with_the_default_modulus_asks_for_a_modulus(load):
    (line,) = doubts(solved([NODES], pressure=2.0), load)
    assert line.endswith(DEFAULT)


@IN_UNITS
def test_full_contact_with_a_modulus_asks_for_the_load(load):
    bodies = Bodies(2.3e5, has_modulus=True)
    (line,) = doubts(solved([NODES], pressure=20.0), load, bodies)
    assert line.endswith(f"E* is 230000 MPa; {CHECK_LOAD}")


@pytest.mark.parametrize("load", ["delta", "delta/height_rms", "pressure/(E* slope_rms)"])
def test_a_load_that_does_not_scale_with_the_modulus_is_no_doubt_about_it(load):
    assert doubts(solved([30], pressure=2.0), load) == []


def test_one_slip_has_one_line():
    """Steep surfaces hardly touch under a load that is usual elsewhere: that is no second slip."""
    assert len(doubts(solved([1, 1], slope=440.0))) == 1
    steep, default = doubts(solved([1, 1], slope=440.0, pressure=50.0), "pressure")
    assert steep.startswith("rms slope 440 ")
    assert default.startswith(
        "the largest nominal pressure is 50 MPa: E* is 1 MPa, the default"
    )


def test_tallies_of_parts_add_up_to_that_of_all_rows():
    nodes, slopes = [1, 100, 50, 0, 100, 100], np.array([0.1, np.nan, 2.0, 3.0, 0.5, 0.2])
    whole = solved(nodes, slope=slopes)
    total = Tally()
    for places in (slice(0, 0), slice(0, 2), slice(2, 6)):
        part = SolvedRows(
            **{name: values[places] for name, values in vars(whole).items()}
        )
        total += Tally.of(part, NODES)
    assert total == Tally.of(whole, NODES)
    assert (total.rows, total.full, total.single, total.steep) == (6, 3, 2, 2)


def test_a_modulus_that_is_known_is_no_default():
    assert modulus_in_words(Bodies(1.0)).endswith(
        "without a modulus (--young or --e-star)"
    )
    for bodies in (Bodies(1.0, has_modulus=True), Bodies(2.0)):
        assert modulus_in_words(bodies) == f"E* is {bodies.e_star:g} MPa"
