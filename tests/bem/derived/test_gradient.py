"""Gradients of a contact's answers by its heights, against differences and closed forms."""

import math
from dataclasses import dataclass

import numpy as np
import pytest

import bem

SIDE = 24.0

# Step of the central differences [um], and the solver's tolerance, which keeps their noise small.
STEP = 1e-5
RTOL = 1e-12

# Largest difference between gradient and differences, over the largest derivative [1].
CLOSE = 1e-5


def rough(shape, seed=0):
    """Return a smooth random surface that repeats itself, with an rms height of 1 um."""
    random = np.random.default_rng(seed)
    waves = np.hypot(
        np.fft.fftfreq(shape[0])[:, np.newaxis] * shape[0],
        np.fft.rfftfreq(shape[1]) * shape[1],
    )
    amplitude = np.where(
        (waves >= 2) & (waves < min(shape) / 5), np.maximum(waves, 1) ** -1.8, 0
    )
    phases = np.exp(2j * np.pi * random.random(waves.shape))
    heights = np.fft.irfft2(amplitude * phases, s=shape)
    return heights / heights.std()


@dataclass(frozen=True)
class Case:
    """A kind of contact, and the answer to differentiate."""

    boundary: str
    of: str
    load: str  # "delta" or "pressure"
    hardness: float | None = None
    far_field: str = "rigid"
    pressure: float = 0.02  # mean pressure of the contact [MPa]

    def settings(self):
        """Return the arguments of `bem.solve` but heights, sides and load."""
        return {
            "boundary": self.boundary,
            "hardness": self.hardness,
            "far_field": self.far_field,
            "rtol": RTOL,
        }


CASES = [
    Case(boundary, of, load, hardness)
    for boundary in ("free", "periodic", "mirror")
    for of, load in (
        ("force", "delta"),
        ("delta", "pressure"),
        ("mean_gap", "delta"),
        ("mean_gap", "pressure"),
    )
    for hardness in (None, 0.08)
]
CASES += [
    Case("free", "force", "delta", far_field="compliant"),
    Case("free", "delta", "pressure", far_field="compliant"),
    Case("free", "mean_gap", "delta", far_field="compliant"),
    Case("free", "mean_gap", "pressure", far_field="compliant"),
]


def sides_of(shape):
    """Return sides of a patch with nearly square cells [um]."""
    return SIDE, SIDE * shape[1] / shape[0]


def solved(case, heights, load):
    """Solve the contact of a case at a load, a mapping of one argument."""
    return bem.solve(heights, sides_of(heights.shape), **load, **case.settings())


def load_of(case, heights):
    """Return the load of a case, as a mapping: its pressure, or the Delta of this pressure."""
    if case.load == "pressure":
        return {"pressure": case.pressure}
    return {"delta": solved(case, heights, {"pressure": case.pressure}).delta}


def have_equal_sets(first, second):
    """Tell whether two contacts have the same nodes in contact, and the same yielded nodes."""
    same_contact = np.array_equal(first.pressure > 0, second.pressure > 0)
    return same_contact and np.array_equal(first.yielded, second.yielded)


def worst_difference(case, heights, nodes):
    """Return the largest |difference - derivative| at some nodes, over the largest derivative.

    Nodes at which a step changes the contact set are left out; nan if all of them are.
    """
    load = load_of(case, heights)
    gradient = solved(case, heights, load).gradient(case.of)
    worst = math.nan
    for node in nodes:
        change = np.zeros(heights.shape)
        change.flat[node] = STEP
        above = solved(case, heights + change, load)
        below = solved(case, heights - change, load)
        if not have_equal_sets(above, below):
            continue
        difference = (getattr(above, case.of) - getattr(below, case.of)) / (2 * STEP)
        error = abs(difference - gradient.flat[node]) / np.abs(gradient).max()
        worst = np.fmax(worst, error)
    return worst


def chosen_nodes(heights, random, count):
    """Return the highest node, some of the upper tenth and some of all nodes, as flat indices."""
    order = np.argsort(heights, axis=None)
    upper = random.choice(order[-heights.size // 10 :], count, replace=False)
    return [int(order[-1]), *upper, *random.integers(heights.size, size=count)]


@pytest.mark.few(10)
@pytest.mark.parametrize("case", CASES)
def test_gradients_are_central_differences(case):
    heights = rough((20, 23), seed=3)
    nodes = chosen_nodes(heights, np.random.default_rng(4), 2)
    assert worst_difference(case, heights, nodes) < CLOSE


@pytest.mark.long
@pytest.mark.parametrize("case", CASES)
def test_gradients_are_central_differences_on_many_surfaces(case):
    """Eight surfaces for each of 28 cases: 224 problems from light to heavy contact."""
    random = np.random.default_rng(5)
    worst = []
    for seed in range(8):
        shape = (random.integers(16, 33), random.integers(16, 33))
        pressure = 10 ** random.uniform(-2.5, -1.2)
        heights = rough(shape, seed)
        nodes = chosen_nodes(heights, random, 2)
        loaded = Case(**{**vars(case), "pressure": pressure})
        worst.append(worst_difference(loaded, heights, nodes))
    assert np.nanmax(worst) < CLOSE


@pytest.mark.parametrize("of", ["force", "delta", "mean_gap"])
@pytest.mark.parametrize("base", ["rigid", bem.HalfSpace(1.0, 0.3)], ids=str)
def test_gradients_on_a_layer_are_central_differences(of, base):
    heights = rough((20, 20), seed=3)
    body = bem.Layered(thickness=3.0, modulus=0.3, poisson=0.3, base=base)
    settings = {"body": body, "boundary": "periodic", "rtol": RTOL}
    light = bem.solve(heights, SIDE, pressure=0.005, **settings)
    load = {"pressure": 0.005} if of == "delta" else {"delta": light.delta}
    gradient = bem.solve(heights, SIDE, **load, **settings).gradient(of)
    for node in chosen_nodes(heights, np.random.default_rng(1), 1):
        change = np.zeros(heights.shape)
        change.flat[node] = STEP
        above = bem.solve(heights + change, SIDE, **load, **settings)
        below = bem.solve(heights - change, SIDE, **load, **settings)
        difference = (getattr(above, of) - getattr(below, of)) / (2 * STEP)
        largest = np.abs(gradient).max()
        assert abs(difference - gradient.flat[node]) < CLOSE * largest


@pytest.mark.parametrize("boundary", ["free", "periodic", "mirror"])
@pytest.mark.parametrize("of", ["force", "delta", "mean_gap"])
def test_a_common_rise_of_all_heights_changes_nothing(boundary, of):
    heights = rough((24, 24))
    contact = bem.solve(heights, SIDE, 0.9, boundary=boundary)
    gradient = contact.gradient(of)
    assert abs(gradient.sum()) < 1e-6 * np.abs(gradient).max()


def test_force_of_full_contact_moves_delta_with_the_mean_height():
    heights = rough((16, 16))
    contact = bem.solve(heights, SIDE, pressure=20.0, boundary="periodic")
    assert contact.area_percent == 100
    expected = np.full(heights.shape, -1 / heights.size)
    expected.flat[heights.argmax()] += 1
    np.testing.assert_allclose(contact.gradient("delta"), expected, atol=1e-12)
    np.testing.assert_allclose(contact.gradient("mean_gap"), 0, atol=1e-12)


def test_bodies_apart_have_no_force_to_change():
    heights = rough((16, 16))
    contact = bem.solve(heights, SIDE, -0.1)
    assert not contact.gradient("force").any()
    gap = contact.gradient("mean_gap")
    expected = np.full(heights.shape, -1 / heights.size)
    expected.flat[heights.argmax()] += 1
    np.testing.assert_allclose(gap, expected, atol=1e-15)


@pytest.mark.parametrize("case", [case for case in CASES if case.of == "mean_gap"])
def test_slope_of_the_mean_gap_is_a_difference(case):
    heights = rough((20, 23), seed=3)
    load = load_of(case, heights)
    (name,) = load
    above = solved(case, heights, {name: load[name] * (1 + 1e-7)})
    below = solved(case, heights, {name: load[name] * (1 - 1e-7)})
    assert have_equal_sets(above, below)
    difference = (above.mean_gap - below.mean_gap) / (above.delta - below.delta)
    slope = solved(case, heights, load).mean_gap_slope
    assert difference == pytest.approx(slope, rel=1e-4)


@pytest.mark.parametrize(
    ("of", "message"),
    [
        ("area_percent", "a count of nodes changes in steps"),
        ("continuum_area_percent", "changes in steps"),
        ("stiffness", "allowed: force, delta, mean_gap"),
    ],
)
def test_answers_without_a_gradient_are_refused(of, message):
    contact = bem.solve(rough((16, 16)), SIDE, 0.5)
    with pytest.raises(ValueError, match=message):
        contact.gradient(of)


def test_two_highest_nodes_are_refused_where_delta_counts():
    heights = rough((16, 16))
    heights.flat[np.argsort(heights, axis=None)[-2]] = heights.max()
    contact = bem.solve(heights, SIDE, pressure=0.02)
    for of in ("force", "delta"):
        with pytest.raises(ValueError, match="2 nodes are the highest"):
            contact.gradient(of)
    assert np.isfinite(contact.gradient("mean_gap")).all()


def test_delta_has_no_gradient_where_all_contact_has_yielded():
    heights = rough((16, 16))
    contact = bem.solve(heights, SIDE, 0.5, hardness=1e-6)
    assert contact.yielded_percent == contact.area_percent
    assert not contact.gradient("force").any()
    with pytest.raises(ValueError, match="no node is in contact and below the hardness"):
        contact.gradient("delta")


def test_a_contact_on_a_coarser_grid_is_refused():
    x = np.arange(96) / 96
    heights = np.cos(2 * np.pi * x)[:, np.newaxis] + np.cos(2 * np.pi * x + 1)
    contact = bem.solve_within(heights, SIDE, 0.05, pressure=0.02, boundary="periodic")
    assert contact.problem.datum is not None
    with pytest.raises(ValueError, match="were made from another grid"):
        contact.gradient("delta")
