"""Contacts with few gaps: the sparse solve on neighbours, and the contact that it leads to."""

import numpy as np
import pytest
from scipy import sparse
from scipy.optimize import nnls

import bem
from bem.few_gaps import open_few
from bem.nearly_full import RADIUS, complementary, neighbour_matrix, press_nearly_full, widened
from bem.spacing import Boundary
from bem.spectrum import inverse_filter
from bem.under_load import OnFields, press_under_load
from bem.whole_patch import WholePatch

EDGELESS: list[Boundary] = ["periodic", "mirror"]


def hilly(shape: tuple[int, int]) -> np.ndarray:
    """Return waves with a few cells a wave, less the highest of their heights."""
    random = np.random.default_rng(shape)
    rows, columns = np.ogrid[: shape[0], : shape[1]]
    heights = np.zeros(shape)
    for along, across in random.integers(1, 7, (8, 2)):
        phases = random.uniform(0, 2 * np.pi, 2)
        wave = np.cos(2 * np.pi * along * (rows + 0.5) / shape[0] + phases[0])
        heights += wave * np.cos(2 * np.pi * across * (columns + 0.5) / shape[1] + phases[1])
    return np.asarray(heights - heights.max())


def nearly_full(shape: tuple[int, int], boundary: Boundary, share: float) -> WholePatch:
    """Return a patch under a load that leaves tension on a share of the nodes at full contact."""
    below = hilly(shape)
    waves = inverse_filter(shape, boundary)(below)
    return WholePatch(below, boundary, 1.0, -float(np.quantile(waves, share)) * below.size)


@pytest.mark.parametrize("boundary", EDGELESS)
@pytest.mark.parametrize("aspect", [1.0, 0.4])
def test_the_matrix_of_neighbours_has_the_pressures_by_displacements_nearby(
    boundary: Boundary, aspect: float
) -> None:
    """Borders included; coefficients are those of a larger patch, and differ by a percent."""
    shape = 20, 26
    units = np.eye(shape[0] * shape[1]).reshape(-1, *shape)
    inverse = inverse_filter(shape, boundary, aspect)
    whole = np.array([inverse(unit).reshape(-1) for unit in units])
    nodes = np.flatnonzero(np.random.default_rng(5).random(len(units)) < 0.5)
    near = neighbour_matrix(shape, boundary, aspect, nodes).toarray()
    np.testing.assert_allclose(near, near.T, atol=1e-6)
    rows, columns = np.abs(np.subtract.outer(np.divmod(nodes, 26), np.divmod(nodes, 26)))[
        [0, 1], :, [0, 1]
    ]
    close = np.hypot(rows, columns) <= RADIUS / 2
    expected = whole[np.ix_(nodes, nodes)]
    np.testing.assert_allclose(near[close], expected[close], atol=0.015 * expected.max())


@pytest.mark.parametrize("boundary", EDGELESS)
@pytest.mark.parametrize("rings", [1, 2])
def test_rings_go_on_past_the_borders_of_a_periodic_patch_only(
    boundary: Boundary, rings: int
) -> None:
    marked = np.zeros((9, 12), dtype=bool)
    marked[0, 11] = True
    rows, columns = np.ogrid[:9, :12]
    away = 12 if boundary == "periodic" else 24
    across = np.minimum(np.abs(columns - 11), away - np.abs(columns - 11))
    along = np.minimum(rows, 9 - rows) if boundary == "periodic" else rows
    expected = np.maximum(along, across) <= rings
    np.testing.assert_array_equal(widened(marked, boundary, rings), expected)


def test_the_active_set_finds_the_complementary_solution() -> None:
    random = np.random.default_rng(3)
    square = random.standard_normal((40, 40))
    matrix = np.eye(40) + 0.1 * (square + square.T) / np.sqrt(40)
    sides = random.standard_normal(40)
    factor = np.linalg.cholesky(matrix)
    expected, _ = nnls(factor.T, np.linalg.solve(factor, sides))
    found = complementary(
        sparse.csr_array(matrix.astype(np.float32)),
        sides.astype(np.float32),
        np.zeros(40, np.float32),
        1e-6,
    )
    np.testing.assert_allclose(found, expected, atol=1e-5)


@pytest.mark.parametrize("few", [0, 400])
@pytest.mark.parametrize("boundary", EDGELESS)
@pytest.mark.parametrize("share", [0.003, 0.019])
@pytest.mark.parametrize("shape", [(48, 60), (31, 75)])
def test_gaps_and_contact_are_those_of_iterations_on_the_contact(
    shape: tuple[int, int],
    share: float,
    boundary: Boundary,
    few: int,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Both by sparse algebra on neighbours and by dense algebra on the open nodes."""
    monkeypatch.setattr("bem.few_gaps.FEW_OPEN", few)
    patch = nearly_full(shape, boundary, share)
    full = patch.full_contact()
    found = press_nearly_full(patch, full, 1e-6)
    assert found is not None
    assert found.pressure.sum() == pytest.approx(patch.load, rel=1e-14)
    iterated = patch.start(full)
    assert press_under_load(OnFields(patch, iterated), rtol=1e-10, least=1.0, max_iterations=1000)
    assert found.shift == pytest.approx(iterated.shift, rel=1e-6)
    np.testing.assert_array_equal(found.pressure > 0, iterated.pressure > 0)
    largest = iterated.pressure.max()
    np.testing.assert_allclose(found.pressure, iterated.pressure, atol=1e-5 * largest)
    np.testing.assert_allclose(found.residual, iterated.residual, atol=1e-5 * found.shift)


@pytest.mark.parametrize("boundary", EDGELESS)
def test_open_nodes_take_dense_algebra_while_they_are_few(
    boundary: Boundary, monkeypatch: pytest.MonkeyPatch
) -> None:
    patch = nearly_full((48, 60), boundary, 0.01)
    full = patch.full_contact().astype(np.float32)
    opened = open_few(patch, full, 1e-6)
    assert opened is not None
    under_tension = np.flatnonzero(full < 0)
    assert set(under_tension) < set(opened.nodes)
    pressure = full + opened.change
    assert np.abs(pressure.flat[opened.nodes]).max() <= 1e-6
    assert pressure.min() >= -1e-6
    assert opened.transforms <= 4
    for few in (len(under_tension) - 1, len(opened.nodes) - 1):  # at the first set, and at the last
        monkeypatch.setattr("bem.few_gaps.FEW_OPEN", few)
        assert open_few(patch, full, 1e-6) is None


def test_many_gaps_are_left_to_others() -> None:
    patch = nearly_full((40, 40), "periodic", 0.04)
    assert press_nearly_full(patch, patch.full_contact(), 1e-6) is None


@pytest.mark.parametrize("boundary", EDGELESS)
def test_a_solve_at_a_tight_tolerance_goes_on_from_there(boundary: Boundary) -> None:
    patch = nearly_full((48, 60), boundary, 0.01)
    pressure = patch.load / patch.below.size
    contact = bem.solve(
        patch.below, 1.0, spacing=1.0, pressure=pressure, boundary=boundary, rtol=1e-12
    )
    gap = contact.displacement - (patch.below + contact.delta)
    assert np.abs(gap[contact.pressure > 0]).max() <= 1e-12 * contact.delta
    assert gap.min() >= -1e-12 * contact.delta
    assert 97 < contact.area_percent < 100
