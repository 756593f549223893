"""The pruned convolution and its circulant inverse against the matrices that they stand for."""

import gc
import threading
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from bem import convolution
from bem.convolution import displacement_filter, fast_period
from bem.influence import Kernel, influence_coefficients
from bench.references import dense

KERNELS: list[Kernel] = ["uniform-pressure", "concentrated-force"]
SHAPES = [(1, 1), (1, 2), (2, 1), (1, 17), (23, 1), (2, 3), (8, 8), (9, 9), (16, 33), (37, 10)]


def random_field(shape: tuple[int, int]) -> np.ndarray:
    return np.random.default_rng(shape).standard_normal(shape)


def relative_error(computed: np.ndarray, expected: np.ndarray) -> float:
    return float(np.abs(computed - expected).max() / np.abs(expected).max())


@pytest.mark.parametrize("kernel", KERNELS)
@pytest.mark.parametrize("shape", [*SHAPES, (65, 65), (128, 65)])
def test_displacement_is_the_dense_product(shape: tuple[int, int], kernel: Kernel) -> None:
    pressure = random_field(shape)
    expected = dense.displace(pressure, kernel)
    assert relative_error(displacement_filter(shape, kernel)(pressure), expected) < 1e-12
    single = displacement_filter(shape, kernel, dtype="float32")(pressure)
    assert single.dtype == np.float32
    assert relative_error(single, expected) < 1e-6


@pytest.mark.parametrize("aspect", [2.0, 0.5, 7.3, 1 / 64])
@pytest.mark.parametrize("shape", [(1, 17), (16, 33), (65, 20)])
def test_displacement_on_oblong_cells(shape: tuple[int, int], aspect: float) -> None:
    pressure = random_field(shape)
    expected = dense.displace(pressure, "uniform-pressure", aspect)
    displacement = displacement_filter(shape, "uniform-pressure", aspect)(pressure)
    assert relative_error(displacement, expected) < 1e-12


@pytest.mark.parametrize("kernel", KERNELS)
def test_unit_pressures_give_back_the_coefficients(kernel: Kernel) -> None:
    """A load in a corner sees every offset once, and nothing comes round from the other side."""
    pressure = np.zeros((20, 33))
    pressure[0, -1] = 1
    displacement = displacement_filter(pressure.shape, kernel)(pressure)
    np.testing.assert_allclose(
        displacement[:, ::-1], influence_coefficients(pressure.shape, kernel), rtol=1e-12
    )


@pytest.mark.parametrize("k", [1, 4, 7, 10])
def test_grids_of_a_power_of_two_and_one_have_that_period(k: int) -> None:
    assert fast_period(2**k + 1) == 2 ** (k + 1)


def test_periods_are_even_and_hold_every_offset() -> None:
    for nodes in range(1, 600):
        period = fast_period(nodes)
        assert period % 2 == 0
        assert period >= max(2 * nodes - 2, 2)


def test_a_kept_filter_forgets_its_last_field() -> None:
    operator = displacement_filter((9, 12), "uniform-pressure")
    assert displacement_filter((9, 12), "uniform-pressure") is operator
    field = random_field((9, 12))
    first = operator(field)
    operator(1e6 * np.ones((9, 12)))
    np.testing.assert_array_equal(operator(field), first)


@pytest.mark.parametrize("dtype", ["float64", "float32"])
@pytest.mark.parametrize("shape", [(64, 40), (100, 30), (129, 64), (40, 90)])
def test_columns_in_stripes_give_the_same_displacement(
    monkeypatch: pytest.MonkeyPatch, shape: tuple[int, int], dtype: str
) -> None:
    """Whole stripes of rows, a narrower last one, and fewer rows than a stripe has."""
    kernel: Kernel = "uniform-pressure"
    field = random_field(shape).astype(dtype)
    expected = convolution._make_displacement_filter(shape, kernel, 1.0, dtype)(field)
    monkeypatch.setattr(convolution, "SHARED_ENTRIES", 1)
    double = convolution._make_displacement_filter(shape, kernel, 1.0, "float64")
    packed = double if dtype == "float64" else double.in_single_precision()
    assert packed._packed
    for _ in range(2):  # what the first leaves behind is not in the second
        accepted = {"float64": 1e-14, "float32": 1e-6}[dtype] * np.abs(expected).max()
        np.testing.assert_allclose(packed(field), expected, rtol=0, atol=accepted)


def test_kept_filters_count_all_that_they_hold() -> None:
    """Whatever is reachable from one, its buffers and views of them included."""
    for nodes in (9, 33, 129):
        with ThreadPoolExecutor(1) as fresh:  # other threads keep filters of earlier tests
            kept = fresh.submit(displacement_filter, (nodes, nodes), "uniform-pressure").result()
        bases: dict[int, np.ndarray] = {}
        reachable: list[object] = list(vars(kept).values())
        while reachable:
            item = reachable.pop()
            if isinstance(item, list | tuple):
                reachable += item
            elif isinstance(item, np.ndarray):
                base = item
                while isinstance(base.base, np.ndarray):
                    base = base.base
                bases[id(base)] = base
        held = sum(base.nbytes for base in bases.values())
        assert held <= kept.bytes <= held + 60 * 1024


def test_what_filters_occupy_is_bounded_for_all_threads_together(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(convolution, "KEPT_BYTES", 3 * 2**20)
    ready, done = threading.Barrier(4), threading.Event()
    earlier = set(convolution._Filters._threads)  # this thread keeps filters of earlier tests

    def occupied_here() -> int:
        return sum(kept.bytes for kept in convolution._Filters._threads if kept not in earlier)

    def solve() -> None:
        for nodes in range(20, 60):
            displacement_filter((nodes, nodes), "uniform-pressure")
        ready.wait(30)
        done.wait(30)

    threads = [threading.Thread(target=solve) for _ in range(3)]
    for thread in threads:
        thread.start()
    ready.wait(30)
    occupied = occupied_here()
    done.set()
    for thread in threads:
        thread.join()
    fewest = 3 * convolution.FEWEST_KEPT * displacement_filter((61, 61), "uniform-pressure").bytes
    assert 0 < occupied <= 3 * 2**20 + fewest
    del threads, thread
    gc.collect()
    assert occupied_here() == 0


def test_threads_have_filters_of_their_own() -> None:
    others = []
    work = threading.Thread(
        target=lambda: others.append(displacement_filter((9, 9), "uniform-pressure"))
    )
    work.start()
    work.join()
    assert others[0] is not displacement_filter((9, 9), "uniform-pressure")
