"""Transforms by FFTW and the memory that they work on; no other module imports pyfftw.

Every plan is made with FFTW_ESTIMATE, because FFTW_MEASURE chooses by timing, so that two processes
could differ in the last bits of a result.
"""

import math
from typing import Any, Protocol, cast

import pyfftw

from bem.arrays import Real

# Memory of one of FFTW's plans, estimated because FFTW does not tell.
PLAN_BYTES = 5 * 2**10


class Plan(Protocol):
    """A planned transform of many vectors, which may be applied to other arrays of that layout."""

    def execute(self) -> None:
        """Transform the source that was given last into the target."""

    def update_arrays(self, source: Any, target: Any) -> None:
        """Take another source and target of the same shape, strides and alignment."""


def plan(source: Any, target: Any, axis: int, *, backward: bool = False) -> Plan:
    """Plan a transform along one axis; a backward one may destroy its input."""
    direction = "FFTW_BACKWARD" if backward else "FFTW_FORWARD"
    flags = ("FFTW_ESTIMATE", "FFTW_DESTROY_INPUT") if backward else ("FFTW_ESTIMATE",)
    return cast("Plan", pyfftw.FFTW(source, target, axes=(axis,), direction=direction, flags=flags))


def aligned(shape: tuple[int, ...], dtype: Any) -> Real:
    """Return zeros at an address that FFTW's vector instructions can load from."""
    zeros: Real = pyfftw.zeros_aligned(shape, dtype)
    return zeros


def shared_buffer(owner: Any, name: str, shape: tuple[int, ...], dtype: Any) -> Any:
    """Return a buffer in the flat memory that an object keeps under a name, made if it has none."""
    room = vars(owner).get(name)
    if room is None:
        room = aligned((math.prod(shape),), dtype)
        setattr(owner, name, room)
    return room.view(dtype)[: math.prod(shape)].reshape(shape)
