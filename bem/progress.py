"""The progress of an active set's rounds: violations seen, patience, and the end by rounding.

Rounds are described in `bem.active_set`. They normally leave smaller and smaller violations. Where
they do not, they are damped, then interrupted by safe steps, and ended where only rounding is left.

Constants say how far they move the counts of the ledger, see `bem.active_set`.
"""

import math
from dataclasses import dataclass, field

from bem.iterate import Violation

# Factor by which conjugate gradients reduce the residual before the sets are checked [1]. With
# factors from 0.3 to 0.55, solves of the paper's distribution take nearly equal numbers of
# convolutions (`pytest bench -k solve_paper`). Solves take up to 30 % more iterations if it is
# halved, and up to 7 % fewer if it is doubled
# (`python -m tests.ledger --halved bem.progress.REDUCTION`).
REDUCTION = 0.4

# Factor on the reduction whenever a round has raised the energy [1]: its conjugate gradients ended
# too early. This number matters in rare cases.
TIGHTENING = 0.5

# Least violation, over the last exact one, for which a residual that was updated in single
# precision is trusted [1]: single precision carries about seven digits. This number matters little.
ROUNDING = 1e-6

# Number of exact residuals in a row, none below half of the smallest one before it, after which
# only rounding is left. This number matters in rare cases.
IDLE = 5

# Number of rounds without a smaller violation after which the energy damps further rounds. This
# number matters in rare cases.
DAMPED = 3

# Number of rounds without a smaller violation after which projected gradients or splitting take
# over. This number matters in rare cases.
PATIENCE = 12

# Number of rounds after which projected gradients or splitting take over, whatever the violations
# are. This number matters in rare cases.
ROUNDS = 40


@dataclass(eq=False)
class Progress:
    """State of the rounds so far: the last violation, and for how long none has become smaller.

    Attributes
    ----------
    violation : Violation
        Departures from equilibrium after the last round [unit of displacement].
    renewed : float
        Largest violation of the last exact residual; 1 before the first one
        [unit of displacement].
    energy : float
        Energy after the last round, inf before the first one [reduced].
    reduction : float
        Factor by which conjugate gradients reduce the residual before the sets are checked [1].
    next_set_taken : bool
        Whether the last round has already made the next round's set the patch's contact set.
    smallest : float
        Smallest value of `largest` after rounds since the patience was last restored; inf if there
        was none [unit of displacement].
    patience : int
        Number of rounds without a smaller violation that are still allowed.
    smallest_renewed : float
        Smallest value of `largest` of all exact residuals between rounds; inf before the first one
        [unit of displacement].
    idle : int
        Number of exact residuals in a row, none below half of the smallest one before it.
    rounds : int
        Number of rounds so far, plus exact residuals computed between them. `ActiveSet.run` counts
        them.
    """

    violation: Violation
    renewed: float = 1.0
    energy: float = math.inf
    reduction: float = field(default_factory=lambda: REDUCTION)
    next_set_taken: bool = False
    smallest: float = math.inf
    patience: int = field(default_factory=lambda: PATIENCE)
    smallest_renewed: float = math.inf
    idle: int = 0
    rounds: int = 0

    @property
    def largest(self) -> float:
        """Largest departure of `violation` [unit of displacement]."""
        return self.violation.largest

    @property
    def resolved(self) -> float:
        """Least violation that single precision resolves [unit of displacement]."""
        return ROUNDING * self.renewed

    @property
    def impatient(self) -> bool:
        """Whether projected gradients or splitting have to come before the next round."""
        return self.patience <= 0 or self.rounds % ROUNDS == ROUNDS - 1

    @property
    def slow(self) -> bool:
        """Whether half of the patience is used up, so that yielded nodes are freed more slowly."""
        return self.patience <= PATIENCE // 2

    @property
    def to_be_damped(self) -> bool:
        """Whether the energy has to damp the next round."""
        return self.patience <= PATIENCE - DAMPED

    @property
    def stalled(self) -> bool:
        """Whether the last `IDLE` exact residuals did not fall, so that only rounding is left."""
        return self.idle >= IDLE

    def restore_patience(self) -> None:
        """Begin to count rounds without a smaller violation anew."""
        self.smallest = math.inf
        self.patience = PATIENCE

    def note_round(
        self, violation: Violation, *, energy: float, exact: bool, next_set_taken: bool
    ) -> None:
        """Take in the results of a round, and update the patience.

        If the energy has risen, the reduction is tightened.

        Parameters
        ----------
        violation : Violation
            Departures from equilibrium after the round [unit of displacement].
        energy : float
            Energy after the round [reduced].
        exact : bool
            Whether the round ended with an exact residual.
        next_set_taken : bool
            Whether the round has already made the next round's set the patch's contact set.
        """
        if energy > self.energy:
            self.reduction *= TIGHTENING
        self.energy = energy
        self.violation = violation
        self.next_set_taken = next_set_taken
        largest = self.largest
        if exact:
            self.renewed = largest
        if largest < self.smallest:
            self.patience = PATIENCE
        else:
            self.patience -= 1
        self.smallest = min(self.smallest, largest)

    def note_renewal(self, violation: Violation) -> None:
        """Take in the violation of an exact residual between rounds, and restore the patience.

        `idle` counts it if it is not below half of the smallest one before.

        Parameters
        ----------
        violation : Violation
            Departures from equilibrium by the exact residual [unit of displacement].
        """
        self.violation = violation
        self.renewed = self.largest
        if self.renewed < self.smallest_renewed / 2:
            self.idle = 0
        else:
            self.idle += 1
        self.smallest_renewed = min(self.smallest_renewed, self.renewed)
        self.restore_patience()

    def note_yielding(self, violation: Violation) -> None:
        """Begin anew with bodies that yield.

        `reduction`, `smallest_renewed`, `idle` and `rounds` keep their values.

        Parameters
        ----------
        violation : Violation
            Departures from equilibrium of the pressure cut off at the hardness
            [unit of displacement].
        """
        self.violation = violation
        self.renewed = 1.0
        self.energy = math.inf
        self.next_set_taken = False
        self.restore_patience()
