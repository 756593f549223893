"""The numbers of a `Contact`, recomputed from its pressure with SciPy alone.

Influence coefficients by numerical integration, displacements by direct convolution, the far
field's stiffness from a flat punch on the full matrix, contact and perimeter by image operations.
"""

import math
from functools import cache

import numpy as np
import pytest
from hypothesis import given, reject, settings
from hypothesis import strategies as st
from scipy import linalg, ndimage, signal
from scipy.integrate import quad

import bem
from bem.influence import Kernel
from bem.problem import FarField
from bench.references.surfaces import SURFACES, surface

pytestmark = pytest.mark.usefixtures("both_ways")

KERNELS: list[Kernel] = ["uniform-pressure", "concentrated-force"]
FAR_FIELDS: list[FarField] = ["rigid", "compliant"]
ASPECTS = [1.0, 2.0, 0.3]


@cache
def coefficient(i: int, j: int, kernel: Kernel, aspect: float) -> float:
    """Displacement at (i, aspect j) of unit pressure on a cell of sides 1 and aspect at 0.

    1 / (pi r) integrated over the cell, along its first side in closed form (Love 1929); or the
    point force asin(a / r) / (pi a) of MIRCO, a = 1/2, and 1 / (pi a) on the loaded cell.
    """
    if kernel == "concentrated-force":
        return math.asin(0.5 / math.hypot(i, j)) / (math.pi / 2) if i or j else 2 / math.pi

    def strip(y: float) -> float:
        return math.asinh((i + 0.5) / abs(y)) - math.asinh((i - 0.5) / abs(y))

    half = aspect / 2
    if j:
        total = quad(strip, aspect * j - half, aspect * j + half, epsabs=0, epsrel=1e-12)[0]
    else:  # both halves of the cell, up to where the integrand may be singular
        total = 2 * quad(strip, 0, half, epsabs=0, epsrel=1e-12)[0]
    return total / math.pi


def table(shape: tuple[int, int], kernel: Kernel, aspect: float) -> np.ndarray:
    """(2 nx - 1, 2 ny - 1) coefficients of all offsets on a grid, none in the middle."""
    quarter = np.array(
        [[coefficient(i, j, kernel, aspect) for j in range(shape[1])] for i in range(shape[0])]
    )
    offsets = [np.abs(np.arange(1 - nodes, nodes)) for nodes in shape]
    return quarter[np.ix_(*offsets)]


@cache
def stiffness(shape: tuple[int, int], kernel: Kernel, aspect: float) -> float:
    """Force that moves the whole patch by a unit [second side of a cell x E*]."""
    coefficients = table(shape, kernel, aspect)
    x, y = (index.ravel() for index in np.indices(shape))
    rows, columns = x[:, None] - x + shape[0] - 1, y[:, None] - y + shape[1] - 1
    punch = linalg.solve(coefficients[rows, columns], np.ones(x.size), assume_a="pos")
    return float(punch.sum())


def displacement(contact: bem.Contact) -> np.ndarray:
    """Recompute the (nx, ny) field [um]."""
    problem = contact.problem
    coefficients = table(contact.pressure.shape, problem.kernel, problem.aspect)
    reduced = signal.convolve(coefficients, contact.pressure, mode="valid", method="direct")
    return reduced * problem.spacing[0] / problem.modulus


def gap(contact: bem.Contact) -> np.ndarray:
    """Recompute the (nx, ny) field [um]."""
    heights = contact.problem.heights
    return displacement(contact) - (heights - heights.max() + approach(contact))


def approach(contact: bem.Contact) -> float:
    """Delta, plus F / K on a compliant far field [um]."""
    problem = contact.problem
    if problem.far_field == "rigid":
        return problem.delta
    unit = stiffness(contact.pressure.shape, problem.kernel, problem.aspect)
    cell = problem.spacing[0] * problem.spacing[1]
    return problem.delta + contact.pressure.sum() * cell / (
        unit * problem.modulus * problem.spacing[1]
    )


def perimeter(contact: bem.Contact) -> float:
    """Edges between touching and open cells, by differences that vanish at the border [um]."""
    touching = (contact.pressure > 0).astype(int)
    edges = [
        np.abs(ndimage.correlate1d(touching, [-1, 1], axis=axis, mode="nearest")).sum()
        for axis in (0, 1)
    ]
    return float(edges[0] * contact.problem.spacing[1] + edges[1] * contact.problem.spacing[0])


def residual(contact: bem.Contact) -> float:
    """Largest |gap| in contact or penetration outside, over Delta."""
    distance = gap(contact)
    wrong = np.where(contact.pressure > 0, np.abs(distance), -distance)
    return float(max(wrong.max(), 0.0)) / contact.problem.delta


@st.composite
def contacts(draw: st.DrawFn) -> bem.Contact:
    """Draw a contact of any surface, grid, material and tolerance."""
    shape = draw(st.tuples(st.integers(1, 17), st.integers(1, 17)))
    kind = draw(st.sampled_from(list(SURFACES)))
    heights = draw(st.floats(0.1, 100)) * surface(kind, shape, draw(st.integers(0, 2**32 - 1)))
    kernel = draw(st.sampled_from(KERNELS))
    aspect = draw(st.sampled_from(ASPECTS)) if kernel == "uniform-pressure" else 1.0
    spacing = draw(st.sampled_from([0.01, 1.0, 7.8]))
    depth = draw(st.floats(0.001, 3))
    far_field = draw(st.sampled_from(FAR_FIELDS))
    try:
        return bem.solve(
            heights,
            1.0,
            depth * (np.ptp(heights) or 1.0),
            spacing=(spacing, spacing * aspect),
            modulus=draw(st.sampled_from([1.0, 3.0, 2.1e5])),
            poisson=draw(st.sampled_from([0.0, 0.3, 0.5])),
            kernel=kernel,
            far_field=far_field,
            rtol=draw(st.sampled_from([1e-3, 1e-6, 1e-11])),
        )
    except bem.NoSolution:  # too deep for a compliant far field
        reject()


@settings(max_examples=120)
@given(contacts())
def test_numbers_and_fields_are_those_of_the_pressure(contact):
    rounding = {"rel": 0, "abs": 1e-12 * contact.approach}
    assert contact.approach == pytest.approx(approach(contact), rel=1e-11)
    assert contact.displacement == pytest.approx(displacement(contact), **rounding)
    assert contact.gap == pytest.approx(gap(contact), **rounding)
    assert contact.mean_gap == pytest.approx(gap(contact).mean(), **rounding)
    accepted = 1e-12 * contact.approach / contact.problem.delta
    assert contact.residual == pytest.approx(residual(contact), rel=0, abs=accepted)
    assert residual(contact) <= contact.problem.rtol + accepted
    cell = contact.problem.spacing[0] * contact.problem.spacing[1]
    touching = contact.pressure > 0
    assert contact.force == pytest.approx(math.fsum(contact.pressure.flat) * cell, rel=1e-13)
    assert contact.largest_pressure == ndimage.maximum(contact.pressure)
    assert contact.contact_nodes == ndimage.sum_labels(touching)
    assert contact.area_percent == pytest.approx(100 * ndimage.mean(touching), rel=1e-14)
    assert contact.perimeter == pytest.approx(perimeter(contact), rel=1e-13)


@pytest.mark.usefixtures("iterations_alone")
@pytest.mark.parametrize("far_field", FAR_FIELDS)
@pytest.mark.parametrize("kernel", KERNELS)
def test_numbers_of_a_solve_that_was_stopped(kernel, far_field):
    """They belong to the pressure that was reached, not to the solution."""
    heights = surface("self-affine", (17, 16), seed=3)
    with pytest.raises(bem.NotConverged) as stopped:
        bem.solve(
            heights, 1.0, 0.4, spacing=0.5, kernel=kernel, far_field=far_field, max_iterations=2
        )
    contact = stopped.value.contact
    assert contact.residual > contact.problem.rtol
    assert contact.residual == pytest.approx(residual(contact), rel=1e-10)
    assert contact.approach == pytest.approx(approach(contact), rel=1e-12)
    assert contact.gap == pytest.approx(gap(contact), rel=0, abs=1e-12)
    assert contact.force == pytest.approx(
        contact.pressure.sum() * contact.problem.spacing[0] * contact.problem.spacing[1], rel=1e-13
    )
