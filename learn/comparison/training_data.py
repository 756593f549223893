"""The data that all fits of one target share."""

from dataclasses import dataclass

from learn.arrays import Folds, Values
from learn.models import UNSCALED, Scaling


@dataclass(frozen=True, eq=False)
class Training:
    """Training and test rows of one target, with the choices that all fits have in common.

    Attributes
    ----------
    inputs : ndarray, shape (n, d)
        Inputs of the training rows.
    target : ndarray, shape (n,)
        Target of the training rows as the models see it: divided by `scaling`.
    folds : ndarray, shape (n,)
        Fold of each training row.
    test_inputs : ndarray, shape (m, d)
        Inputs of the test rows, which no search sees.
    test_target : ndarray, shape (m,)
        Target of the test rows, not scaled.
    normalisation : str
        One of `learn.models.NORMALISATIONS`.
    seed : int
        Seed of the models' random draws.
    scaling : Scaling
        Scaling of the target.
    """

    inputs: Values
    target: Values
    folds: Folds
    test_inputs: Values
    test_target: Values
    normalisation: str = "l2"
    seed: int = 0
    scaling: Scaling = UNSCALED

    @property
    def rows(self) -> int:
        """Number of training rows."""
        return self.target.size

    @property
    def columns(self) -> int:
        """Number of inputs."""
        return int(self.inputs.shape[1])
