"""Arguments that a contact problem accepts or refuses."""

import itertools
import math
from typing import Any

import numpy as np
import pandas as pd
import pytest

import bem
from bem.problem import BOUNDARIES, node_spacing
from gen.surface import generate

NAN, INF = math.nan, math.inf


SQUARE = np.zeros((4, 4))

BAD_HEIGHTS = [
    (np.array([[0.0, NAN], [INF, -INF]]), ["3 values", "not finite"]),
    (SQUARE + 1j, ["complex128", "real numbers"]),
    (3.0, ["()", "(nx, ny)"]),
    ("surface.npy", ["<U11", "real numbers"]),
    ([np.ma.masked_equal(row, 0.0) for row in np.eye(3)], ["masked", "fill or crop"]),
    ([[1.0, 2.0], [3.0]], ["unequal length"]),
]


BAD_ARGUMENTS: list[tuple[dict[str, Any], list[str]]] = [
    ({"side": 0}, ["side = 0", "above 0 um"]),
    (
        {"side": 1000.0, "heights": np.zeros((65, 129))},
        [
            "65 x 129 nodes",
            "(1000, 2000) for square cells",
            "(1000, 1000) for a square patch",
        ],
    ),
    ({"side": (1.0, 2.0, 3.0)}, ["side = (1.0, 2.0, 3.0)", "one length or two"]),
    ({"spacing": -0.5}, ["spacing = -0.5", "above 0 um"]),
    ({"heights": SQUARE[:1]}, ["1 x 4", "give the spacing"]),
    ({"delta": [1.0]}, ["delta = [1.0]", "finite"]),
    ({"delta": 10**400}, ["delta = 1000", "finite"]),
    ({"delta": 10**5000}, ["delta = a whole number of thousands of digits", "finite"]),
    ({"delta": "1.0"}, ["delta = '1.0'", "finite"]),
    ({"delta": np.complex128(1.0)}, ["delta = ", "finite"]),
    ({"near": 1j * SQUARE}, ["near are of type complex128", "real numbers"]),
    ({"delta": 1e-320}, ["double precision"]),
    ({"delta": None}, ["no load given", "delta [um]", "force [uN]", "pressure [MPa]"]),
    ({"force": 1.0}, ["delta and force given", "give one of"]),
    ({"delta": None, "force": -1.0}, ["force = -1.0", "at least 0 uN"]),
    ({"modulus": 1e308, "spacing": 1e-6}, ["pressure scale", "double precision"]),
    ({"poisson": np.nextafter(0.5, 1)}, ["0.5", "above -1 and at most 0.5"]),
    ({"hardness": 0}, ["hardness = 0", "above 0 MPa"]),
    ({"rtol": 1}, ["rtol = 1", "between 1e-15 and 1"]),
    ({"kernel": np.array(["uniform-pressure"])}, ["kernel", "must be one of"]),
    (
        {"kernel": "concentrated-force", "side": (1.0, 2.0)},
        ["square cells", "uniform-pressure"],
    ),
    ({"far_field": "soft"}, ["far_field = 'soft'", "rigid, compliant"]),
    (
        {"kernel": "concentrated-force", "boundary": "mirror"},
        ["is not solved with boundary"],
    ),
    (
        {"boundary": "round"},
        ["boundary = 'round'", "must be one of free, periodic, mirror"],
    ),
    ({"boundary": "mirror", "far_field": "compliant"}, ["use far_field = 'rigid'"]),
    ({"max_iterations": 0}, ["max_iterations = 0", "at least 1"]),
]


@pytest.mark.parametrize(
    ("arguments", "parts"),
    [*[({"heights": bad}, parts) for bad, parts in BAD_HEIGHTS], *BAD_ARGUMENTS],
)
def test_input_is_refused_in_one_line(arguments, parts):
    usable = {"heights": SQUARE, "side": 1.0, "delta": 1.0}
    with pytest.raises(
        ValueError, match=r"\A.*\Z"
    ) as refused:  # . is never the end of a line
        bem.solve(**usable | arguments)
    for part in parts:
        assert part in str(refused.value)


ROUGH = generate("diamond-square", 65, 0.65, 12.5, np.random.default_rng(4))


@pytest.mark.parametrize(
    "near", [np.zeros((3, 3)), np.full((65, 65), np.nan), np.full((65, 65), -1.0)]
)
def test_a_start_that_is_no_pressure_is_refused(near):
    with pytest.raises(ValueError, match=r"finite pressures of shape \(65, 65\)"):
        bem.solve(ROUGH, 1000.0, 15.0, near=near)


INTEGERS = np.random.default_rng(2).integers(0, 50, (20, 31))


@pytest.mark.parametrize(
    "given",
    [
        INTEGERS.astype(np.uint8),
        INTEGERS.astype(">f8"),
        np.asfortranarray(INTEGERS, dtype=float),
        INTEGERS[::-1, ::-1].copy()[::-1, ::-1],
        pd.DataFrame(INTEGERS),
    ],
    ids=lambda given: str(getattr(given, "dtype", type(given).__name__)),
)
def test_any_array_of_real_numbers_will_do(given):
    expected = bem.solve(INTEGERS.astype(float), (1.0, 1.0), 5.0)
    np.testing.assert_array_equal(
        bem.solve(given, (1.0, 1.0), 5.0).pressure, expected.pressure
    )


def everything(contact):
    """All that a contact tells, the properties that are computed when they are read included."""
    names = [
        name for name in dir(contact) if not name.startswith("_") and name != "problem"
    ]
    values = [getattr(contact, name) for name in names]
    told = [value for value in values if isinstance(value, np.ndarray | float | int)]
    told += [contact.problem.heights, contact.spots.labels, contact.punch.pressure]
    return [np.asarray(value).tobytes() for value in told]


SETTINGS: list[dict[str, Any]] = [
    {},
    {"hardness": 0.02},
    {"boundary": "mirror"},
    {"boundary": "periodic", "hardness": 0.02},
]


@pytest.mark.parametrize("settings", SETTINGS)
@pytest.mark.parametrize("name", ["delta", "pressure"])
def test_a_caller_may_fill_its_arrays_anew(name, settings):
    """Every array argument is refilled after the call and before anything of the result is read."""
    loads = np.array([0.005, 0.008, 0.011]) * (1000.0 if name == "delta" else 1.0)
    near = bem.solve(ROUGH, 1000.0, **{name: loads[0]}, **settings).pressure
    arrays = [ROUGH.copy(), np.array([1000.0, 1000.0]), loads.copy(), near.copy()]
    heights, side, given, start = arrays
    alone = bem.solve(
        heights, side, **{"delta": None, name: given[0]}, near=start, **settings
    )
    rungs = bem.ladder(heights, side, **{f"{name}s": given}, **settings)
    for array in arrays:
        array.fill(7.0)
    contacts = [alone, *rungs]
    same = [
        bem.solve(
            ROUGH, 1000.0, **{"delta": None, name: loads[0]}, near=near, **settings
        ),
        *bem.ladder(ROUGH, 1000.0, **{f"{name}s": loads}, **settings),
    ]
    assert [everything(contact) for contact in contacts] == [
        everything(other) for other in same
    ]


def test_masked_arrays_are_refused():
    masked = np.ma.masked_less(np.array([5.0, 8.0, 11.0]), 6.0)
    with pytest.raises(ValueError, match="deltas are masked in places"):
        bem.ladder(ROUGH, 1000.0, masked)
    with pytest.raises(ValueError, match="heights are masked in places"):
        bem.ladder(np.ma.masked_less(ROUGH, 10.0), 1000.0, [5.0])
    with pytest.raises(ValueError, match="near are masked in places"):
        bem.solve(ROUGH, 1000.0, 5.0, near=np.ma.masked_equal(np.ones((65, 65)), 1.0))
    with pytest.raises(ValueError, match="side are masked in places"):
        bem.solve(ROUGH, np.ma.masked_less(np.array([1e3, 2e3]), 1e3 + 1), 5.0)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("load", ["force", "pressure"])
def test_loads_end_where_single_precision_does(load):
    """Every load is solved, not converged or refused, without a warning of NumPy."""
    heights, outcomes = np.random.default_rng(0).normal(size=(33, 33)), set()
    for exponent in (1, 20, 30, 34, 36, 38, 40, 59, 200, 300):
        try:
            bem.solve(heights, 1000.0, **{"delta": None, load: 10.0**exponent})
        except (bem.OutOfRange, bem.NotConverged) as error:
            outcomes.add(type(error))
    assert outcomes == {bem.OutOfRange, bem.NotConverged}


EXPONENTS = [
    *itertools.product(BOUNDARIES, (-300, 0, 300), (-300, 0, 300), (-100, 0, 100), (1, 4))
]


@pytest.mark.parametrize("load", ["delta", "force"])
@pytest.mark.filterwarnings("error")
def test_results_are_finite_or_the_input_is_out_of_range(load):
    """Near the ends of double precision nothing overflows on the way or in what is derived."""
    heights, solved = np.random.default_rng(0).normal(size=(20, 20)), 0
    for boundary, height, modulus, spacing, share in EXPONENTS:
        unit = height if load == "delta" else modulus + height + spacing
        if not abs(unit) < 305:
            continue
        cell = {"boundary": boundary, "modulus": 10.0**modulus, "spacing": 10.0**spacing}
        try:
            contact = bem.solve(
                heights * 10.0**height,
                1,
                **{"delta": None, load: 0.1 * share * 10.0**unit},
                **cell,
            )
        except (bem.OutOfRange, bem.NoSolution):
            continue
        solved += 1
        told = (
            contact.force,
            contact.mean_gap,
            contact.largest_pressure,
            contact.stiffness,
        )
        assert np.isfinite(told).all()
        assert np.isfinite([contact.yielded_depth, contact.flattened, contact.gap]).all()
    assert solved > 20

    many = 1e303 * np.random.default_rng(0).uniform(0, 1, (300, 300))
    with pytest.raises(bem.OutOfRange, match="height range times nodes"):
        bem.solve(many, 1e300, 1e302, boundary="mirror", spacing=1.0)


@pytest.mark.parametrize(
    ("nodes", "boundary", "spacing"),
    [(5, "free", 2.0), (4, "periodic", 2.0), (4, "mirror", 2.0), (1, "mirror", 8.0)],
)
def test_outer_nodes_lie_on_the_border_or_half_a_cell_inside(nodes, boundary, spacing):
    assert node_spacing(nodes, 8.0, boundary) == spacing
