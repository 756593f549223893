"""The data that all fits of a job share: sent to every process once, not with each task."""

from dataclasses import dataclass

from gen.runtime import farm
from learn.arrays import Folds, Values
from learn.target import UNSCALED, Scaling


@dataclass(frozen=True, eq=False)
class Training:
    """What all fits of a search share.

    Attributes
    ----------
    inputs : (n, d) of the training rows
    target : (n,) over `scaling`, as the models are trained on it
    folds : (n,) fold of each row
    test_inputs, test_target : (m, d), (m,) of the test rows, which no search sees
    normalisation : one of `learn.models.NORMALISATIONS`
    seed : of whatever the models draw
    scaling : of the target; the test rows' is as it stands
    """

    inputs: Values
    target: Values
    folds: Folds
    test_inputs: Values
    test_target: Values
    normalisation: str = "l2"
    seed: int = 0
    scaling: Scaling = UNSCALED


_held: dict[str, Training] = {}


def hold(training: Training | None, world: farm.World) -> None:
    """Give the master's training data to every process, once for all tasks; collective."""
    _held["training"] = world.broadcast(training)


def held() -> Training:
    """Return the data that all tasks of this process work on."""
    return _held["training"]
