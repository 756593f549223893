"""Elastic contact of a patch without edges under a load, and what an interrupted one leaves."""

import sys
from contextlib import suppress
from types import FrameType
from typing import Any

import numpy as np
import pytest

import bem
from bem.spacing import Boundary
from bem.spectrum import spectral_filter
from bem.whole_patch import WholePatch, cut_to_load

EDGELESS: list[Boundary] = ["periodic", "mirror"]
SHAPES = [(1, 9), (8, 1), (12, 16), (9, 13)]


def rough(shape: tuple[int, int]) -> np.ndarray:
    """Return heights less the highest, without a scale of their own."""
    heights = np.random.default_rng(shape).standard_normal(shape)
    return np.asarray(heights - heights.max())


def smooth(shape: tuple[int, int]) -> np.ndarray:
    """Return heights less the highest, smooth over some cells, with a rms slope of one."""
    waves = np.fft.rfft2(rough(shape))
    orders = np.hypot.outer(np.fft.fftfreq(shape[0]), np.fft.rfftfreq(shape[1]))
    heights = np.fft.irfft2(waves * (orders < 0.25) / (0.05 + orders) ** 2, s=shape)
    slopes = [np.diff(heights, axis=axis) for axis in (0, 1)]
    heights /= np.sqrt(sum((slope**2).mean() for slope in slopes))
    return np.asarray(heights - heights.max())


@pytest.mark.parametrize("boundary", EDGELESS)
@pytest.mark.parametrize("shape", SHAPES)
def test_full_contact_is_known_without_a_solve(shape: tuple[int, int], boundary: Boundary) -> None:
    below = rough(shape)
    load = 10.0 * below.size
    patch = WholePatch(below, boundary, 1.0, load)
    pressed = patch.closed(patch.full_contact())
    assert pressed.pressure.min() > 0
    assert pressed.pressure.sum() == pytest.approx(load, rel=1e-14)
    assert pressed.shift == -below.mean()
    assert not pressed.residual.any()
    displacement = spectral_filter(shape, boundary)(pressed.pressure)
    np.testing.assert_allclose(displacement, below + pressed.shift, atol=1e-12)
    np.testing.assert_array_equal(patch.displacement, below + pressed.shift)


@pytest.mark.parametrize("load", [1e-30, 1e-3, 1.0, 50.0, 1e5])
def test_a_cut_pressure_carries_the_load_and_keeps_the_order(load: float) -> None:
    pressure = np.random.default_rng(2).standard_normal((7, 9))
    cut = cut_to_load(pressure, load)
    assert cut.sum() == pytest.approx(load, rel=1e-13)
    assert cut.min() >= 0
    pressed = cut > 0
    constants = pressure[pressed] - cut[pressed]
    np.testing.assert_allclose(constants, constants[0], atol=1e-12 * max(load, 1))
    assert pressure[~pressed].max(initial=-np.inf) <= constants[0] + 1e-12


@pytest.mark.parametrize("boundary", EDGELESS)
@pytest.mark.parametrize("load", [1e-9, 1e-3, 0.01, 0.04])
@pytest.mark.parametrize("shape", [(48, 64), (41, 70)])
def test_light_contacts_start_nearer_on_the_peaks_than_from_full_contact(
    shape: tuple[int, int], load: float, boundary: Boundary
) -> None:
    below = smooth(shape)
    patch = WholePatch(below, boundary, 1.0, load * below.size)
    pressed = patch.start_on_peaks(8 * load)
    assert pressed.pressure.min() >= 0
    assert pressed.pressure.sum() == pytest.approx(patch.load, rel=1e-12)
    fresh = patch.press(pressed.pressure, pressed.effort)
    assert pressed.shift == pytest.approx(fresh.shift, rel=1e-5)
    np.testing.assert_allclose(pressed.residual, fresh.residual, atol=1e-5 * np.ptp(below))
    other = patch.start(patch.full_contact())
    assert pressed.violation() / pressed.shift < 0.8 * other.violation() / other.shift


@pytest.mark.parametrize("boundary", EDGELESS)
def test_a_plateau_shares_a_light_load(boundary: Boundary) -> None:
    below = np.full((12, 16), -1.0)
    below[3:7, 5:9] = 0
    pressed = WholePatch(below, boundary, 1.0, 0.01).start_on_peaks(0.05)
    np.testing.assert_allclose(pressed.pressure, (below == 0) * 0.01 / 16, rtol=1e-12)


@pytest.mark.parametrize("most", [1, 2, 3, 5])
@pytest.mark.parametrize("boundary", EDGELESS)
@pytest.mark.parametrize("load", [{"pressure": 0.6}, {"delta": 2.0}])
def test_iterations_are_bounded_and_what_is_left_is_said(
    load: dict[str, float], boundary: Boundary, most: int
) -> None:
    heights = rough((64, 60))
    settings: dict[str, Any] = {"spacing": 1.0, "boundary": boundary, "rtol": 1e-12}
    with pytest.raises(bem.NotConverged) as caught:
        bem.solve(heights, 1.0, **load, **settings, max_iterations=most)
    contact = caught.value.contact
    assert contact.iterations <= most
    violation = np.where(contact.pressure > 0, np.abs(contact.gap), -contact.gap).max()
    assert contact.residual == pytest.approx(violation / contact.delta, rel=1e-3)


class Interruption:
    """Raises KeyboardInterrupt at one of the lines of `bem`, as Ctrl-C may.

    It spares `bem.sections`, whose counts all later tests in the process rely on.
    """

    def __init__(self, last: int) -> None:
        self.lines, self._last = 0, last

    def __call__(self, frame: FrameType, event: str, _: Any) -> "Interruption | None":
        module = frame.f_globals.get("__name__", "")
        if not module.startswith("bem.") or module == "bem.sections":
            return None
        if event == "line":
            self.lines += 1
            if self.lines == self._last:
                raise KeyboardInterrupt
        return self

    def during(self, solve: Any) -> Any:
        before = sys.gettrace()
        sys.settrace(self)
        try:
            return solve()
        finally:
            sys.settrace(before)


@pytest.mark.parametrize("boundary", EDGELESS)
@pytest.mark.parametrize("hardness", [None, 0.5])
def test_an_interrupted_solve_spoils_no_later_one(
    boundary: Boundary, hardness: float | None
) -> None:
    heights = rough((13, 18))

    def solve() -> np.ndarray:
        contact = bem.solve(
            heights, 1.0, spacing=1.0, pressure=0.05, boundary=boundary, hardness=hardness
        )
        return contact.pressure

    expected = solve()
    whole = Interruption(last=-1)
    whole.during(solve)
    for last in np.random.default_rng(4).integers(1, whole.lines, 40):
        with suppress(KeyboardInterrupt):  # tables that are kept by now take fewer lines
            Interruption(int(last)).during(solve)
        np.testing.assert_array_equal(solve(), expected)
