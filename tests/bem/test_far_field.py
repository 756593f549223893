"""The compliant far field: MIRCO's published results, the exact limit of its loop, and Delta*."""

from functools import partial
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import bem
from bem.bodies import HALF_SPACE, KERNELS, REDUCED
from bem.far_field import critical_delta, flat_punch
from bench.references import dense
from bench.references.surfaces import surface

pytestmark = pytest.mark.usefixtures("both_ways")

SIDE = 1000.0  # um
MODULUS = 1 / (2 * (1 - 0.3**2))  # two bodies with E = 1 and nu = 0.3 [MPa]

MIRCO = Path(__file__).parents[3] / "shared" / "mirco"
RESULTS = [
    # file, Delta [um], mean pressure [MPa], share of the area, shape factor
    ("sup2.dat", 15.0, 0.006069099831252897, 0.16, 0.8055133886663758),
    ("sup5.dat", 10.0, 0.0008690895874828513, 0.008264462809917357, 0.8517330207256517),
]


def topography(name):
    path = MIRCO / name
    if not path.is_file():
        pytest.skip(f"MIRCO's regression input {path} is not on this machine")
    lines = path.read_text(encoding="ascii").splitlines()
    return np.array(
        [[float(field) for field in line.strip(" ;").split(";")] for line in lines]
    )


def rigid(heights, delta, kernel="concentrated-force", **far):
    spacing = SIDE / len(heights)
    how = {"spacing": spacing, "modulus": MODULUS, "kernel": kernel, "rtol": 1e-12}
    return bem.solve(heights, SIDE, delta, **how, **far)


compliant = partial(rigid, far_field="compliant")


def shape_factor(nodes, kernel):
    """MIRCO's alpha = L E* Delta / F of the flat punch, with its spacing L / n."""
    return float(nodes / flat_punch((nodes, nodes), REDUCED[kernel]).sum())


def mircos_loop(heights, delta, tolerance, kernel="concentrated-force"):
    """Add F / K of the last solution to Delta until the force changes by less than tolerance."""
    stiffness = SIDE * MODULUS / shape_factor(len(heights), kernel)
    force = 0.0
    while True:
        contact = rigid(heights, delta + force / stiffness, kernel)
        if abs(contact.force - force) < tolerance * contact.force:
            return contact
        force = contact.force


@pytest.mark.parametrize(("name", "delta", "mean_pressure", "area", "factor"), RESULTS)
def test_mircos_own_results(name, delta, mean_pressure, area, factor):
    """They come from a loop that stopped at a change of 1 %."""
    heights = topography(name)
    assert shape_factor(len(heights), "concentrated-force") == pytest.approx(
        factor, rel=1e-12
    )
    contact = mircos_loop(heights, delta, tolerance=0.01)
    assert contact.force / SIDE**2 == pytest.approx(mean_pressure, rel=1e-8)
    assert contact.area_percent / 100 == pytest.approx(area, rel=1e-8)


@pytest.mark.parametrize("kernel", KERNELS)
@pytest.mark.parametrize(("name", "delta"), [(row[0], row[1]) for row in RESULTS])
def test_compliant_solves_the_limit_of_mircos_loop(name, delta, kernel):
    heights = topography(name)
    limit, contact = (
        mircos_loop(heights, delta, 1e-13, kernel),
        compliant(heights, delta, kernel),
    )
    stiffness = SIDE * MODULUS / shape_factor(len(heights), kernel)
    assert contact.force == pytest.approx(limit.force, rel=1e-10)
    assert contact.approach == pytest.approx(delta + contact.force / stiffness, rel=1e-12)
    np.testing.assert_array_equal(contact.pressure > 0, limit.pressure > 0)


@pytest.mark.parametrize("kernel", KERNELS)
@pytest.mark.parametrize("excess", [1.0, 1 + 1e-12, 1.5, 1e6])
def test_no_equilibrium_from_the_critical_delta_on(excess, kernel):
    heights = 10 * surface("random walk", (17, 17), 2)
    critical = critical_delta(heights, REDUCED[kernel])
    with pytest.raises(bem.NoSolution) as refused:
        compliant(heights, excess * critical, kernel)
    assert refused.value.critical_delta == critical
    assert refused.value.delta == excess * critical
    assert f"Delta* = {critical:.10g} um" in str(refused.value)
    assert len(str(refused.value).splitlines()) == 1


@pytest.mark.parametrize("kernel", KERNELS)
def test_a_flat_surface_has_no_equilibrium_on_a_compliant_far_field(kernel):
    with pytest.raises(bem.NoSolution, match="Delta"):
        compliant(np.zeros((9, 9)), 1e-9, kernel)


@pytest.mark.parametrize("kernel", KERNELS)
def test_the_last_node_comes_to_touch_at_the_critical_delta(kernel):
    """With all nodes in contact, nothing resists the displacement of the far field."""
    heights = 10 * surface("random walk", (17, 17), 3)
    critical = critical_delta(heights, REDUCED[kernel])
    contacts = [
        compliant(heights, (1 - short) * critical, kernel) for short in (0.1, 1e-3, 1e-6)
    ]
    nodes = [contact.contact_nodes for contact in contacts]
    assert nodes == sorted(nodes)
    assert nodes[-1] == heights.size - 1


@pytest.mark.parametrize("aspect", [1.0, 2.0, 1 / 7.3])
@pytest.mark.parametrize("shape", [(1, 1), (1, 12), (7, 20), (16, 16)])
def test_flat_punch_is_the_dense_solution(shape, aspect):
    nodes = shape[0] * shape[1]
    matrix = dense.influence_matrix(shape, "uniform-pressure", aspect).reshape(
        nodes, nodes
    )
    expected = np.linalg.solve(matrix, np.ones(nodes)).reshape(shape)
    np.testing.assert_allclose(
        flat_punch(shape, HALF_SPACE, aspect), expected, rtol=1e-11
    )


@settings(max_examples=60)
@given(
    seed=st.integers(0, 2**32 - 1),
    shape=st.tuples(st.integers(2, 21), st.integers(2, 21)),
    kernel=st.sampled_from(KERNELS),
    kind=st.sampled_from(["white noise", "random walk"]),
    share=st.floats(0.01, 0.999),
)
def test_any_equilibrium_is_that_of_its_own_approach(seed, shape, kernel, kind, share):
    """The dense reference has the same force and nodes at Delta + F / K on a rigid far field."""
    heights = 10 * surface(kind, shape, seed)
    delta = share * critical_delta(heights, REDUCED[kernel])
    contact = bem.solve(
        heights, 1.0, delta, spacing=1.0, kernel=kernel, far_field="compliant", rtol=1e-11
    )
    softening = 1 / flat_punch(shape, REDUCED[kernel]).sum()
    assert contact.approach == pytest.approx(delta + softening * contact.force, rel=1e-12)
    pressure, gap = dense.press(heights, contact.approach, kernel)
    decided = (pressure > 1e-8) | (gap > 1e-8)
    np.testing.assert_array_equal(
        (contact.pressure > 0)[decided], (pressure > 1e-8)[decided]
    )
    assert contact.force == pytest.approx(pressure.sum() * contact.approach, rel=1e-8)
