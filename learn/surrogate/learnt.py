"""What a surrogate has learnt of each target, and the file that keeps it.

    asperity surrogate
    format 9
    sha256 of all that follows, in hexadecimal digits
    length of the card, 8 bytes, little endian
    card: JSON with the card and the training ranges of the features
    models: a zip archive of skops, with pipelines of scikit-learn, arrays and numbers

The checksum detects damage. A file names types; those that are not numbers, arrays or `REVIEWED`
are refused before anything is imported or made, so that no code of a stranger runs. Compiled code
of scikit-learn and XGBoost trusts the numbers of trees and vectors: a file that was forged with a
right checksum may end the process or give any number.
"""

from __future__ import annotations

import hashlib
import json
import re
import shlex
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from copy import copy
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any
from zipfile import ZIP_DEFLATED

import numpy as np

from gen.arrays import Indices, Values
from gen.quantities import QUANTITIES, Powers
from gen.runtime.errors import InputError
from gen.runtime.files import SURROGATE, atomic, kind_of, require_file
from gen.runtime.memory import is_shortage
from gen.runtime.terminal import command_to_type, printable
from learn.features.columns import PURE, SKEWNESS
from learn.features.sets import SETS, Scaling
from learn.models import STEP
from learn.surrogate.interval import (
    GROWTH,
    Calibration,
    Distance,
    ErrorScale,
    Growth,
    Scores,
)

if TYPE_CHECKING:
    from learn.database_rows import Dataset
    from learn.surrogate.model import Surrogate

PART = 2000  # rows that are predicted together: a kernel needs memory for rows times training rows

# Features of which models see the nearest value of the training, and flags their own. Moments of
# third and fourth order have heavy tails: a window of a honed map with a groove at its border may
# have a kurtosis of its peaks forty deviations from the mean. A radial basis function of long reach
# extrapolates like a polynomial there, and a few rows of this kind have had most of the squared
# error of all rows (`bench scans`). How large a moment is beyond those of the training decides
# little about the contact. The other features are left as they are: areas and forces of the coarse
# solve tell most where they are extrapolated.
MOMENTS = frozenset(name for name in PURE if "skewness" in name or "kurtosis" in name)
# Feature that models see as 0: in a training of self-affine surfaces it is noise, and tells only
# that another surface is none of them. Flags and intervals see it.
UNSEEN = SKEWNESS
# ends, each (d,), of the ranges that features are clipped to; infinite for those that are not
Clip = tuple[Values, Values]

FORMAT = 10  # number of the layout. It is raised whenever an older version would misread a file
# Of 1.0.0, whose targets that a user's function gave are learnt without their dimension.
WITHOUT_POWERS = 9
OLDER = range(3, 9)  # of 1.0.0rc1 and before, whose intervals promise more than they hold
HEAD = re.compile(SURROGATE + rb"format (\d{1,9})\nsha256 ([0-9a-f]{64})\n")

# types, besides numbers and arrays, of which models are made
REVIEWED = (
    "learn.population.Population",
    "sklearn.dummy.DummyRegressor",
    "sklearn.ensemble._forest.RandomForestRegressor",
    "sklearn.ensemble._gb.GradientBoostingRegressor",
    "sklearn.ensemble._weight_boosting.AdaBoostRegressor",
    "sklearn.gaussian_process._gpr.GaussianProcessRegressor",
    "sklearn.gaussian_process.kernels.ConstantKernel",
    "sklearn.gaussian_process.kernels.Product",
    "sklearn.gaussian_process.kernels.RBF",
    "sklearn.gaussian_process.kernels.Sum",
    "sklearn.gaussian_process.kernels.WhiteKernel",
    "sklearn.kernel_ridge.KernelRidge",
    "sklearn.neural_network._multilayer_perceptron.MLPRegressor",
    "sklearn.neural_network._stochastic_optimizers.AdamOptimizer",
    "sklearn.neural_network._stochastic_optimizers.SGDOptimizer",
    "sklearn.pipeline.Pipeline",
    "sklearn.preprocessing._data.MinMaxScaler",
    "sklearn.preprocessing._data.Normalizer",
    "sklearn.preprocessing._data.StandardScaler",
    "sklearn.svm._classes.SVR",
    "sklearn.tree._classes.DecisionTreeRegressor",
    "sklearn.tree._tree.Tree",
    "xgboost.core.Booster",
    "xgboost.sklearn.XGBRegressor",
)


def clip_of(train: Dataset) -> Clip:
    """Return the training ranges of the moments among the features, of sets without units."""
    names = np.array(train.features.columns)
    moment = np.isin(names, [*MOMENTS]) & train.features.scaled
    low = np.where(moment, train.inputs.min(axis=0), -np.inf)
    high = np.where(moment, train.inputs.max(axis=0), np.inf)
    return np.where(names == UNSEEN, 0.0, low), np.where(names == UNSEEN, 0.0, high)


@dataclass(frozen=True, eq=False)
class Learnt:
    """The fitted model of one target."""

    column: str  # in `gen.schema`
    unit: str  # of the column
    pipeline: (
        Any  # of scikit-learn: scaling and estimator of the scaled target over its scale
    )
    scaling: Scaling  # of the target over its scale
    calibration: Calibration  # intervals of the target over its scale
    clip: Clip  # ranges that the inputs do not leave
    bounds: tuple[float, float] = (
        -np.inf,
        np.inf,
    )  # least and largest value of the column
    # Of heights, lengths and E* that the target scales with; None for none, or none that is known.
    powers: Powers | None = None

    def raw(self, inputs: Values) -> Values:
        """Predict the target over its scale, (n,), at the features, (n, d); NaN where one is."""
        (_, scaling), (_, model) = self.pipeline.steps
        found = np.full(len(inputs), np.nan)
        with np.errstate(
            over="ignore", invalid="ignore"
        ):  # said by `predict_rows`, row by row
            for rows in _parts(inputs):
                seen = np.clip(inputs[rows], *self.clip)
                seen = seen if scaling == "passthrough" else scaling.transform(seen)
                if (
                    getattr(model, "L_", model) is None
                ):  # scikit-learn 1.7 asks for it for the mean
                    predicted = model.kernel_(seen, model.X_train_) @ model.alpha_
                elif getattr(model, "kernel", "") == "rbf" and hasattr(model, "X_fit_"):
                    # Kernel ridge, without scikit-learn's checks of its training rows.
                    centres = np.asarray(model.X_fit_, dtype=np.float64)
                    squares = np.einsum("ij,ij->i", centres, centres) - 2.0 * (
                        seen @ centres.T
                    )
                    squares += np.einsum("ij,ij->i", seen, seen)[:, None]
                    np.maximum(squares, 0.0, out=squares)
                    squares *= -(
                        1.0 / centres.shape[1] if model.gamma is None else model.gamma
                    )
                    predicted = np.exp(squares, out=squares) @ model.dual_coef_
                else:
                    predicted = model.predict(seen)
                found[rows] = np.reshape(predicted, -1)
            return self.scaling.restored(found)

    def mean_ends(
        self, raw: Values, level: float, inputs: Values
    ) -> tuple[Values, Values]:
        """Return both ends, each (n,), of the interval of the mean over all surfaces."""
        from scipy.stats import norm

        model = self.pipeline.named_steps[STEP]
        if not hasattr(model, "coefficients_"):
            raise InputError(
                "the mean has an interval with --model population alone: fit one"
            )
        errors = np.full(len(inputs), np.nan)
        for rows in _parts(inputs):
            errors[rows] = model.error(self.pipeline[:-1].transform(inputs[rows]))
        half = norm.ppf((1 + level) / 2) * errors * self.scaling.deviation
        return raw - half, raw + half


def _parts(inputs: Values) -> Iterator[Indices]:
    """Yield the rows, (k,), without NaN that are predicted together."""
    known = np.flatnonzero(~np.isnan(inputs).any(axis=1))
    for start in range(0, known.size, PART):
        yield known[start : start + PART]


@contextmanager
def _quick_import() -> Iterator[None]:
    """Let skops be imported without the list of all estimators that it would trust too.

    To make this list it imports all of scikit-learn.
    """
    from sklearn import utils

    every = utils.all_estimators
    utils.all_estimators = lambda *_, **__: []
    try:
        yield
    finally:
        utils.all_estimators = every


def write_parts(path: Path, surrogate: Surrogate) -> None:
    """Write a surrogate, whole or not at all."""
    with _quick_import():
        from skops import io
    models = {
        "distance": vars(surrogate.distance),
        "targets": {name: _packed(each) for name, each in surrogate.learnt.items()},
    }
    archive = io.dumps(models, compression=ZIP_DEFLATED, compresslevel=1)
    if strangers := set(io.get_untrusted_types(data=archive)) - set(REVIEWED):
        raise ValueError(f"models of {', '.join(sorted(strangers))} are not kept")
    ranges = {"low": surrogate.low.tolist(), "high": surrogate.high.tolist()}
    card = json.dumps({"card": surrogate.card} | ranges).encode()
    body = len(card).to_bytes(8, "little") + card + archive
    digest = hashlib.sha256(body).hexdigest()
    with atomic(path, "surrogate") as written:
        written.write(SURROGATE + f"format {FORMAT}\nsha256 {digest}\n".encode())
        written.write(body)


def _packed(learnt: Learnt) -> dict[str, Any]:
    """Return the model of a target as a pipeline of the libraries' types, arrays and numbers.

    Ensembles of scikit-learn keep their first tree only, and all trees are in arrays: each of some
    thousand trees would take ten small files in the archive, and a millisecond.
    """
    from sklearn.kernel_ridge import KernelRidge

    fitted = learnt.pipeline.named_steps[STEP]  # without what can be computed again
    intervals = (
        learnt.calibration
    )  # without the distances, which are those of the surrogate
    kept = KernelRidge() if isinstance(fitted, KernelRidge) else copy(fitted)
    vars(kept).update(vars(fitted))
    if hasattr(
        kept, "L_"
    ):  # the factor of a Gaussian process, as large as its rows squared
        kept.L_ = None
    vars(kept).pop("left_out_", None)  # predictions of the training rows
    trees = None
    if hasattr(kept, "estimators_"):
        members = np.ravel(np.array(kept.estimators_, dtype=object)).tolist()
        states = [each.tree_.__getstate__() for each in members]
        trees = {
            "counts": np.array([each["node_count"] for each in states]),
            "depths": np.array([each["max_depth"] for each in states]),
            "nodes": np.concatenate([each["nodes"] for each in states]),
            "values": np.concatenate([each["values"] for each in states]),
        }
        kept.estimators_ = kept.estimators_[:1]
    pipeline = copy(learnt.pipeline)
    pipeline.steps = [pipeline.steps[0], (STEP, kept)]
    return {
        "column": learnt.column,
        "unit": learnt.unit,
        "pipeline": pipeline,
        "trees": trees,
        "scaling": vars(learnt.scaling),
        "clip": learnt.clip,
        "bounds": learnt.bounds,
        "powers": learnt.powers and tuple(learnt.powers),
        "scores": [tuple(each) for each in intervals.scores],
        "usual": vars(intervals.usual),
        "grows": intervals.distance is not None and tuple(intervals.growth),
        "root": intervals.root,
    }


def _with_trees(estimator: Any, trees: dict[str, Values]) -> None:
    """Put all trees into an ensemble that `_packed` has left its first one."""
    first = np.ravel(np.array(estimator.estimators_, dtype=object))[0]
    kind, sizes, _ = first.tree_.__reduce__()
    members, start = [], 0
    for count, depth in zip(
        trees["counts"].tolist(), trees["depths"].tolist(), strict=True
    ):
        inside = slice(start, start + count)
        own = {"nodes": trees["nodes"][inside], "values": trees["values"][inside]}
        member = copy(first)
        member.tree_ = kind(*sizes)
        member.tree_.__setstate__({"max_depth": depth, "node_count": count, **own})
        members.append(member)
        start += count
    if isinstance(estimator.estimators_, np.ndarray):  # of gradient boosting, a column
        estimator.estimators_ = np.array(members, dtype=object).reshape(-1, 1)
    else:
        estimator.estimators_ = members


def load_parts(
    path: Path,
) -> tuple[dict[str, Any], dict[str, Learnt], Values, Values, Distance]:
    """Read the fields of a `Surrogate`, after a trial if another scikit-learn has made it."""
    import sklearn

    card, low, high, archive = read(path)
    learnt: dict[str, Learnt] = {}
    try:
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")  # models of another version of their library
            with _quick_import():
                from skops import io
            models = io.loads(archive, trusted=list(REVIEWED))
            distance = Distance(**models["distance"])
            for name in card["targets"]:
                part = models["targets"][name]
                grows = part["grows"]  # a law, or False
                intervals = Calibration(
                    tuple(Scores(*each) for each in part["scores"]),
                    ErrorScale(**part["usual"]),
                    distance if grows else None,
                    part["root"],
                    Growth(*grows) if grows else GROWTH,
                )
                own = part["pipeline"], Scaling(**part["scaling"]), intervals
                ranges = part["clip"], part["bounds"], _powers_of(part)
                learnt[name] = Learnt(part["column"], part["unit"], *own, *ranges)
                if part["trees"] is not None:
                    _with_trees(part["pipeline"].named_steps[STEP], part["trees"])
                if sklearn.__version__ != card["versions"].get("scikit-learn"):
                    intervals.ends(learnt[name].raw(low[None]), 0.5, low[None])
    except Exception as error:  # what a library says of content that it does not know
        if is_shortage(error):
            raise
        fault = printable(" ".join(str(error).split())[:100])
        made = ", ".join(
            f"{name} {number}" for name, number in card["versions"].items() if number
        )
        raise InputError(
            f"{path}: its models cannot be used here ({fault}); it was made with"
            f" {printable(made)}: {_anew(path, card)}"
        ) from None
    return card, learnt, low, high, distance


def _powers_of(part: Mapping[str, Any]) -> Powers | None:
    """Return the powers of a target; older files leave out those of the quantities of contacts."""
    if "powers" in part:
        return part["powers"] and Powers(*part["powers"])
    quantity = QUANTITIES.get(part["column"])
    return quantity.powers if quantity is not None and quantity.stored else None


def read(path: Path) -> tuple[dict[str, Any], Values, Values, bytes]:
    """Read card, both ends of the training ranges, (d,), and archive of a surrogate's file."""
    try:
        data = require_file(path).read_bytes()
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror or error}") from None
    head = HEAD.match(data)
    if head is None:
        what = "; it is a database" if kind_of(path) == "database" else ""
        raise InputError(
            f"{path}: is no surrogate{what}: {command_to_type('learn fit')} makes one of a database"
        )
    other = f"{path}: has format {int(head[1])}, this version reads {FORMAT}: "
    if int(head[1]) not in (*OLDER, WITHOUT_POWERS, FORMAT):
        raise InputError(f"{other}fit it anew with {command_to_type('learn fit')}")
    body = memoryview(data)[head.end() :]
    if hashlib.sha256(body).hexdigest() != head[2].decode():
        raise InputError(
            f"{path}: is damaged: its checksum is not that of its content; restore it from a copy"
            " or fit it anew"
        )
    try:
        length = 8 + int.from_bytes(body[:8], "little")
        content = json.loads(bytes(body[8:length]))
        card = content["card"]
        older = _anew(path, card) if int(head[1]) in OLDER else ""
        low, high = (
            np.array(content.get(end, ()), dtype=np.float64) for end in ("low", "high")
        )
    except (ValueError, TypeError, KeyError, RecursionError, MemoryError) as error:
        fault = printable(f"{type(error).__name__}: {error}"[:100])
        raise InputError(
            f"{path}: is no surrogate that could be read ({fault})"
        ) from None
    if older:
        raise InputError(other + older)
    return card, low, high, bytes(body[length:])


def _anew(path: Path, card: Mapping[str, Any]) -> str:
    """Say by which command a surrogate is fitted anew, as far as its card tells."""
    databases = [each["database"] for each in card.get("databases", [card])]
    own = card["normalisation"] != SETS[card["features"]].normalisation
    options = {
        "--model": card["model"],
        "--features": card["features"],
        "--target": ",".join(card["targets"]),
        "--seed": str(card["seed"]),
        "--blocks": card.get("blocks"),
        "--load": card.get("load"),
        "--area-max": None if card.get("area_max") is None else f"{card['area_max']:g}",
        "--normalise": card["normalisation"] if own else None,
        "--calibrate-on": card.get("calibration", {}).get("database"),
    }
    first = next(iter(card["targets"].values()))
    if origin := re.search(r"(?:tuned in|, by) (.*)", first["settings_from"]):
        options["--from"] = Path(origin[1]).parent
    given = [word for name, value in options.items() if value for word in (name, value)]
    command = " ".join(
        shlex.quote(str(word)) for word in [*databases, *given, "-o", path]
    )
    return f"fit it anew: {command_to_type(printable(f'learn fit {command}'))}"
