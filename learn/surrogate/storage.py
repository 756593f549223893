"""One file per surrogate, loaded without running code from it.

skops writes a zip archive of JSON and arrays; what it names is built only if its type is on a list:
skops' own of safe types, and the one below, reviewed by hand. A file that names anything else is
refused before anything of it is built.
"""

import warnings
from pathlib import Path
from typing import Any

import numpy as np

from gen.errors import InputError
from gen.input_file import require_file
from gen.output import whole

FORMAT = 2
KIND = "asperity surrogate"

REVIEWED = (
    # Ours: arrays and numbers, fit and predict.
    "learn.kernel_ridge.SafeKernelRidge",
    # Node arrays of trees, checked by scikit-learn's __setstate__.
    "sklearn.tree._tree.Tree",
    # Kernels are numbers and bounds; the operators hold two kernels.
    "sklearn.gaussian_process.kernels.RBF",
    "sklearn.gaussian_process.kernels.ConstantKernel",
    "sklearn.gaussian_process.kernels.WhiteKernel",
    "sklearn.gaussian_process.kernels.Product",
    "sklearn.gaussian_process.kernels.Sum",
    "sklearn.gaussian_process.kernels.DotProduct",
    # The optimiser's state that a perceptron keeps: arrays and numbers.
    "sklearn.neural_network._stochastic_optimizers.AdamOptimizer",
    "sklearn.neural_network._stochastic_optimizers.SGDOptimizer",
    # XGBoost's model, in its own format, read by its own reader.
    "xgboost.core.Booster",
    "xgboost.sklearn.XGBRegressor",
)
"""Types beyond skops' own that a surrogate may hold: none of them runs anything while it loads."""


def save(path: Path, content: dict[str, Any]) -> None:
    """Write a surrogate's content beside its place, then rename.

    Raises
    ------
    InputError
        If it cannot be written.
    """
    io = _skops()
    with whole(path, "surrogate") as file:
        io.dump({"kind": KIND, "format": FORMAT, **content}, file)


def load(path: Path) -> tuple[dict[str, Any], list[str]]:
    """Read a surrogate's content.

    Returns
    -------
    The content, and what its libraries say about it, a line each

    Raises
    ------
    InputError
        If it is no surrogate, of another format, damaged, or names types that are not on the lists.
    """
    io = _skops()
    try:
        data = require_file(path).read_bytes()
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror or error}") from None
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            _check_types(path, io.get_untrusted_types(data=data))
            content = io.loads(data, trusted=list(REVIEWED))
        except InputError:
            raise
        except Exception as error:  # a damaged file makes its readers raise nearly anything
            fault = printable(" ".join(str(error).split())[:100])
            from gen.database import is_database

            if is_database(path):
                fault = "it is a database: python -m learn fit makes a surrogate of it"
                raise InputError(f"{path}: is no surrogate; {fault}") from None
            raise InputError(
                f"{path}: is no surrogate that could be read ({type(error).__name__}: {fault})"
            ) from None
    if not isinstance(content, dict) or content.get("kind") != KIND:
        raise InputError(f"{path}: is no surrogate: make one with python -m learn fit")
    if content.get("format") != FORMAT:
        raise InputError(
            f"{path}: has format {content.get('format')!r}, this version reads {FORMAT}: fit it"
            " anew"
        )
    said = dict.fromkeys(printable(" ".join(str(each.message).split())) for each in caught)
    return content, list(said)


def _check_types(path: Path, named: list[str]) -> None:
    """Refuse a file that names a type that is on no list."""
    foreign = sorted(set(named) - set(REVIEWED))
    if foreign:
        shown = ", ".join(foreign[:3]) + (" ..." if len(foreign) > 3 else "")
        raise InputError(
            f"{path}: holds {printable(shown)}, which no surrogate needs: refused, nothing of it"
            " was loaded"
        )


def without_factor(process: Any) -> Any:
    """Take the Cholesky factor out of a Gaussian process: n^2 numbers that `factor` makes again."""
    kept = process.L_
    process.L_ = None
    return kept


def factor(process: Any) -> Any:
    """Cholesky factor of a Gaussian process's kernel matrix, as its fit makes it."""
    from scipy.linalg import cholesky

    kernel = process.kernel_(process.X_train_)
    kernel[np.diag_indices_from(kernel)] += process.alpha
    return cholesky(kernel, lower=True, check_finite=False)


def _skops() -> Any:
    try:
        import skops.io
    except ImportError:
        raise InputError("skops is not installed: pip install 'asperity[learn]'") from None
    return skops.io


def printable(text: str) -> str:
    """Nothing in a file may drive a terminal."""
    return "".join(character if character.isprintable() else "?" for character in text)
