"""Arguments that a contact problem accepts or refuses."""

import math
from typing import Any

import numpy as np
import pandas as pd
import pytest

import bem
from gen.surface import generate

NAN, INF = math.nan, math.inf


def test_one_side_of_one_cell_needs_its_spacing() -> None:
    contact = bem.solve([[0.0, 1.0, 0.5]], 1.0, 0.2, spacing=(2.0, 4.0))
    assert contact.problem.spacing == (2.0, 4.0)
    assert contact.contact_nodes == 1


@pytest.mark.parametrize("side", [(3.0, 6.0), [3.0, 6.0], np.array([3.0, 6.0])])
def test_pairs_of_sides(side: Any) -> None:
    assert bem.solve(np.zeros((4, 7)), side, 1.0).problem.spacing == (1.0, 1.0)


SQUARE = np.zeros((4, 4))


HOLES = np.array([[0.0, NAN], [INF, -INF]])


BAD_HEIGHTS = [
    (HOLES, ["3 values", "not finite"]),
    (np.full((2, 2), NAN), ["4 values", "not finite"]),
    (SQUARE + 1j, ["complex128", "real numbers"]),
    (np.empty((0, 4)), ["(0, 4)", "(nx, ny)"]),
    (np.zeros(4), ["(4,)", "(nx, ny)"]),
    (np.zeros((2, 2, 2)), ["(2, 2, 2)", "(nx, ny)"]),
    (3.0, ["()", "(nx, ny)"]),
    ("surface.npy", ["<U11", "real numbers"]),
    ([["a", "b"], ["c", "d"]], ["<U1", "real numbers"]),
    (None, ["object", "real numbers"]),
    (SQUARE.astype(object), ["object", "real numbers"]),
    (SQUARE > 0, ["bool", "real numbers"]),
    ([np.ma.masked_equal(row, 0.0) for row in np.eye(3)], ["masked", "fill or crop"]),
    (
        pd.DataFrame({0: [1.0, None], 1: [2.0, 3.0]}, dtype="Float64"),
        ["1 values", "not finite"],
    ),
    (pd.DataFrame({0: ["1", "2"], 1: ["3", "4"]}), ["real numbers"]),
    (SQUARE.astype("datetime64[s]"), ["datetime64[s]", "real numbers"]),
]


BAD_ARGUMENTS: list[tuple[dict[str, Any], list[str]]] = [
    ({"side": 0}, ["side = 0", "above 0 um"]),
    ({"side": -1.5}, ["side = -1.5", "above 0 um"]),
    ({"side": NAN}, ["side = nan", "above 0 um"]),
    ({"side": INF}, ["side = inf", "above 0 um"]),
    (
        {"side": 1000.0, "heights": np.zeros((65, 129))},
        ["65 x 129 nodes", "(1000, 2000) for square cells", "(1000, 1000) for a square patch"],
    ),
    ({"side": None}, ["side = None", "above 0 um"]),
    ({"side": "long"}, ["side = 'long'", "above 0 um"]),
    ({"side": (1.0, 2.0, 3.0)}, ["side = (1.0, 2.0, 3.0)", "one length or two"]),
    ({"side": (1.0,)}, ["side = (1.0,)", "one length or two"]),
    ({"side": (1.0, 0.0)}, ["side = 0.0", "above 0 um"]),
    ({"spacing": 0}, ["spacing = 0", "above 0 um"]),
    ({"spacing": -0.5}, ["spacing = -0.5", "above 0 um"]),
    ({"spacing": (1.0, 2.0, 3.0)}, ["spacing = (1.0, 2.0, 3.0)", "one length or two"]),
    ({"heights": SQUARE[:1]}, ["1 x 4", "give the spacing"]),
    ({"heights": SQUARE[:, :1]}, ["4 x 1", "give the spacing"]),
    ({"delta": NAN}, ["delta = nan", "finite"]),
    ({"delta": INF}, ["delta = inf", "finite"]),
    ({"delta": -INF}, ["delta = -inf", "finite"]),
    ({"delta": None}, ["no load given", "delta [um]", "force [uN]", "pressure [MPa]"]),
    ({"force": 1.0}, ["delta and force given", "give one of"]),
    ({"delta": None, "force": -1.0}, ["force = -1.0", "at least 0 uN"]),
    ({"delta": None, "force": "much"}, ["force = 'much'", "at least 0 uN"]),
    ({"delta": None, "pressure": np.nan}, ["pressure = nan", "at least 0 MPa"]),
    ({"modulus": 1e308, "spacing": 1e-6}, ["pressure scale", "double precision"]),
    ({"delta": 1e-320}, ["double precision"]),
    ({"delta": [1.0]}, ["delta = [1.0]", "finite"]),
    ({"delta": 1 + 1j}, ["delta = (1+1j)", "finite"]),
    ({"modulus": 0}, ["modulus = 0", "above 0 MPa"]),
    ({"modulus": -1}, ["modulus = -1", "above 0 MPa"]),
    ({"modulus": INF}, ["modulus = inf", "above 0 MPa"]),
    ({"modulus": NAN}, ["modulus = nan", "above 0 MPa"]),
    ({"poisson": 0.6}, ["poisson = 0.6", "above -1 and at most 0.5"]),
    ({"poisson": np.nextafter(0.5, 1)}, ["0.5", "above -1 and at most 0.5"]),
    ({"poisson": -1}, ["poisson = -1", "above -1 and at most 0.5"]),
    ({"poisson": NAN}, ["poisson = nan", "above -1 and at most 0.5"]),
    ({"rtol": 0}, ["rtol = 0", "between 1e-15 and 1"]),
    ({"rtol": -1e-6}, ["rtol = -1e-06", "between 1e-15 and 1"]),
    ({"rtol": 1}, ["rtol = 1", "between 1e-15 and 1"]),
    ({"rtol": NAN}, ["rtol = nan", "between 1e-15 and 1"]),
    ({"kernel": "gaussian"}, ["kernel = 'gaussian'", "uniform-pressure, concentrated-force"]),
    ({"kernel": None}, ["kernel = None", "uniform-pressure, concentrated-force"]),
    ({"far_field": "soft"}, ["far_field = 'soft'", "rigid, compliant"]),
    ({"max_iterations": 0}, ["max_iterations = 0", "at least 1"]),
    ({"max_iterations": -5}, ["max_iterations = -5", "at least 1"]),
    ({"max_iterations": 1.5}, ["max_iterations = 1.5", "at least 1"]),
    ({"max_iterations": True}, ["max_iterations = True", "at least 1"]),
    ({"rtol": 1e-300}, ["rtol = 1e-300", "between 1e-15 and 1"]),
    ({"delta": True}, ["delta = True", "finite"]),
    ({"delta": 10**400}, ["delta = 1000", "finite"]),
    ({"side": -5.0, "spacing": 1.0}, ["side = -5.0", "above 0"]),
    ({"kernel": np.array(["uniform-pressure"])}, ["kernel", "must be one of"]),
    ({"heights": [[1.0, 2.0], [3.0]]}, ["unequal length"]),
    ({"heights": np.ma.masked_equal(np.eye(3), 1)}, ["masked"]),
    (
        {"kernel": "concentrated-force", "side": (1.0, 2.0)},
        ["concentrated-force", "square cells", "uniform-pressure"],
    ),
    (
        {"kernel": "concentrated-force", "heights": np.zeros((4, 5)), "side": (1.0, 1.0)},
        ["concentrated-force", "square cells", "uniform-pressure"],
    ),
]


@pytest.mark.parametrize(
    ("arguments", "parts"),
    [*[({"heights": bad}, parts) for bad, parts in BAD_HEIGHTS], *BAD_ARGUMENTS],
)
def test_input_is_refused_in_one_line(arguments: dict[str, Any], parts: list[str]) -> None:
    usable = {"heights": SQUARE, "side": 1.0, "delta": 1.0}
    with pytest.raises(ValueError, match=r"\A.*\Z") as refused:  # . is never the end of a line
        bem.solve(**usable | arguments)
    for part in parts:
        assert part in str(refused.value)


ROUGH = generate("diamond-square", 65, 0.65, 12.5, np.random.default_rng(4))


@pytest.mark.parametrize(
    "near", [np.zeros((3, 3)), np.full((65, 65), np.nan), np.full((65, 65), -1.0)]
)
def test_a_start_that_is_no_pressure_is_refused(near: np.ndarray) -> None:
    with pytest.raises(ValueError, match=r"finite pressures of shape \(65, 65\)"):
        bem.solve(ROUGH, 1000.0, 15.0, near=near)


INTEGERS = np.random.default_rng(2).integers(0, 50, (20, 31))


@pytest.mark.parametrize(
    "given",
    [
        INTEGERS,
        INTEGERS.astype(np.uint8),
        INTEGERS.astype(np.float16),
        INTEGERS.astype(np.float32),
        INTEGERS.astype(np.longdouble),
        INTEGERS.astype(">f8"),
        np.asfortranarray(INTEGERS, dtype=float),
        np.repeat(INTEGERS, 2, axis=1)[:, ::2],
        INTEGERS[::-1, ::-1].copy()[::-1, ::-1],
        np.broadcast_to(INTEGERS, INTEGERS.shape),
        INTEGERS.tolist(),
        pd.DataFrame(INTEGERS),
        pd.DataFrame(INTEGERS).astype("Float64"),
        pd.DataFrame(INTEGERS).astype("Int64"),
    ],
    ids=lambda given: str(getattr(given, "dtype", type(given).__name__)),
)
def test_any_array_of_real_numbers_will_do(
    given: np.ndarray | list[list[int]] | pd.DataFrame,
) -> None:
    expected = bem.solve(INTEGERS.astype(float), (1.0, 1.0), 5.0)
    np.testing.assert_array_equal(bem.solve(given, (1.0, 1.0), 5.0).pressure, expected.pressure)


def test_surfaces_are_neither_changed_nor_kept() -> None:
    heights = ROUGH.copy()
    heights.setflags(write=False)
    bem.solve(heights, 1000.0, 15.0)
    np.testing.assert_array_equal(heights, ROUGH)
    heights = ROUGH.copy()
    contact = bem.solve(heights, 1000.0, 15.0)
    heights[:] = 0
    np.testing.assert_array_equal(contact.problem.heights, ROUGH)
