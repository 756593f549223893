"""When a solution counts as one, and the loosest tolerance that gives it."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from bem.convolution import displacement_filter
from bench.solvers.case import Case, Exact, Field
from bench.solvers.solver import Control

# The force at the displacement given, or the displacement of the far field at the force given [1].
LOAD_ERROR = 1e-6
# Nodes in contact in one solution only, of those in contact [1]; one is always allowed.
MISPLACED_SHARE = 5e-4


@dataclass(frozen=True)
class Errors:
    """How far a pressure is from the reference."""

    load_error: float  # of the force, or of the displacement where the force is given, relative
    misplaced_nodes: int  # in contact, or yielded, in it or in the reference, not in both
    pressure_error: float  # the largest, over the largest pressure

    def good_enough(self, contact_nodes: int) -> bool:
        """Say whether a solution of a contact of this many nodes may have these errors."""
        allowed = max(1.0, MISPLACED_SHARE * contact_nodes)
        return self.load_error <= LOAD_ERROR and self.misplaced_nodes <= allowed


def find_errors(pressure: Field, control: Control, case: Case, exact: Exact) -> Errors:
    """Measure the errors of an (n, n) pressure [MPa] that was found under a given load.

    A given force is met by construction, so that its displacement counts, which is computed here
    and not by the peer.
    """
    if control == "force":
        moved = displacement_filter(pressure.shape, case.kernel)(pressure) * case.spacing
        approach = moved - (case.heights - case.heights.max())
        load_error = (pressure * approach).sum() / pressure.sum() / case.delta - 1
    else:
        load_error = pressure.sum() * case.spacing**2 / exact.force - 1
    touching = (pressure > 0) != (exact.pressure > 0)
    yielded = case.yielded(pressure) != case.yielded(exact.pressure)
    return Errors(
        load_error=abs(float(load_error)),
        misplaced_nodes=int(np.count_nonzero(touching) + np.count_nonzero(yielded)),
        pressure_error=float(np.abs(pressure - exact.pressure).max() / exact.pressure.max()),
    )


def loosest(
    good_enough: Callable[[float], bool], ladder: Sequence[float], guess: float
) -> float | None:
    """Find the loosest tolerance of a falling ladder that is good enough, or None if none is.

    Begin at the nearest tolerance that is not looser than the guess. Go looser from one that is
    good enough, as far as that holds; go tighter from one that is not.
    """
    rung = next((r for r, tolerance in enumerate(ladder) if tolerance <= guess), len(ladder) - 1)
    if good_enough(ladder[rung]):
        while rung > 0 and good_enough(ladder[rung - 1]):
            rung -= 1
        return ladder[rung]
    return next((tolerance for tolerance in ladder[rung + 1 :] if good_enough(tolerance)), None)
