"""The fitted model of each target of a surrogate, and the file that keeps them.

    asperity surrogate
    format 9
    sha256 of all that follows, in hexadecimal digits
    length of the card, 8 bytes, little endian
    card: JSON with the card and the training ranges of the features
    models: a zip archive of skops, with pipelines of scikit-learn, arrays and numbers

The checksum detects damage. A file names types. Types that are not numbers, arrays or `REVIEWED`
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
    from learn.comparison.folder import Settings
    from learn.database_rows import Dataset

# rows that are predicted together: a kernel needs memory for these rows times the training rows
CHUNK = 2000

# Features of which models see the nearest value of the training. Moments of third and fourth order
# have heavy tails: a window of a honed map with a groove at its border may have a kurtosis of its
# peaks forty deviations from the mean. A radial basis function of long reach extrapolates like a
# polynomial there, and a few rows of this kind have had most of the squared error of all rows
# (`bench scans`). How far a moment is beyond those of the training decides little about the
# contact. The other features are left as they are: areas and forces of the coarse solve tell most
# where they are extrapolated. Flags see all features as they are.
MOMENTS = frozenset(name for name in PURE if "skewness" in name or "kurtosis" in name)
# Feature that models see as 0. In a training of self-affine surfaces it is noise, and tells only
# that a surface is not one of them. Flags and intervals see it.
UNSEEN = SKEWNESS

# number of the layout, which is raised whenever an older version would misread a file
FORMAT = 10
# format of 1.0.0, which learnt targets of a user's function without their dimension
WITHOUT_POWERS = 9
# formats of 1.0.0rc1 and before, whose intervals promise more than they hold
OLDER = range(3, 9)
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


@dataclass(frozen=True, eq=False)
class Clip:
    """Ranges that the features of a model do not leave; infinite for features without one."""

    low: Values  # (d,)
    high: Values  # (d,)

    def clipped(self, inputs: Values) -> Values:
        """Bring features into their ranges.

        Parameters
        ----------
        inputs : ndarray, shape (n, d)
            Features.

        Returns
        -------
        ndarray, shape (n, d)
            The nearest features within the ranges.
        """
        return np.asarray(np.clip(inputs, self.low, self.high))


def clip_of(train: Dataset) -> Clip:
    """Return the ranges that models of some training rows clip features to.

    Parameters
    ----------
    train : Dataset
        The training rows.

    Returns
    -------
    Clip
        The training ranges of moments, in sets without units, and 0 to 0 for `UNSEEN`.
    """
    names = np.array(train.features.columns)
    clipped = np.isin(names, list(MOMENTS)) & train.features.scaled
    low = np.where(clipped, train.inputs.min(axis=0), -np.inf)
    high = np.where(clipped, train.inputs.max(axis=0), np.inf)
    low[names == UNSEEN] = 0.0
    high[names == UNSEEN] = 0.0
    return Clip(low, high)


@dataclass(frozen=True, eq=False)
class Learnt:
    """The fitted model of one target."""

    column: str  # name of the target's column in `gen.schema`
    unit: str  # of the column
    # pipeline of scikit-learn: scaling of the features, and estimator of the scaled target
    pipeline: Any
    scaling: Scaling  # of the target over its scale
    calibration: Calibration  # intervals of the target over its scale
    clip: Clip  # ranges that the features do not leave
    # smallest and largest value of the column
    bounds: tuple[float, float] = (-np.inf, np.inf)
    # powers of heights, lengths and E* that the target scales with; None if they are unknown
    powers: Powers | None = None

    def raw(self, inputs: Values) -> Values:
        """Predict the target over its scale.

        Parameters
        ----------
        inputs : ndarray, shape (n, d)
            Features.

        Returns
        -------
        ndarray, shape (n,)
            Predictions over the scale of the target; NaN where a feature is NaN. They may be
            infinite far from the training.
        """
        (_, scaling), (_, model) = self.pipeline.steps
        predictions = np.full(len(inputs), np.nan)
        # `Surrogate.predict_rows` names rows without a finite prediction.
        with np.errstate(over="ignore", invalid="ignore"):
            for rows in _chunks(inputs):
                scaled = self.clip.clipped(inputs[rows])
                if scaling != "passthrough":
                    scaled = scaling.transform(scaled)
                predictions[rows] = np.reshape(_predict(model, scaled), -1)
            return self.scaling.restored(predictions)

    def mean_ends(
        self, raw: Values, level: float, inputs: Values
    ) -> tuple[Values, Values]:
        """Return the intervals of the mean over all surfaces of some parameters.

        Parameters
        ----------
        raw : ndarray, shape (n,)
            Predictions, from `raw`.
        level : float
            Coverage of the intervals, between 0 and 1.
        inputs : ndarray, shape (n, d)
            Features.

        Returns
        -------
        (ndarray, ndarray), each of shape (n,)
            Lower and upper ends, over the scale of the target; NaN where a feature is NaN.

        Raises
        ------
        InputError
            If the model is not the mean of a population.
        """
        from scipy.stats import norm

        model = self.pipeline.named_steps[STEP]
        if not hasattr(model, "coefficients_"):
            raise InputError(
                "the mean has an interval with --model population alone: fit one"
            )
        errors = np.full(len(inputs), np.nan)
        for rows in _chunks(inputs):
            errors[rows] = model.error(self.pipeline[:-1].transform(inputs[rows]))
        half = norm.ppf((1 + level) / 2) * errors * self.scaling.deviation
        return raw - half, raw + half


def _chunks(inputs: Values) -> Iterator[Indices]:
    """Yield positions of rows without NaN that are predicted together, (k,)."""
    defined = np.flatnonzero(~np.isnan(inputs).any(axis=1))
    for start in range(0, defined.size, CHUNK):
        yield defined[start : start + CHUNK]


def _predict(model: Any, inputs: Values) -> Any:
    """Return the predictions of an estimator at scaled features (n, d), over the scaled target.

    Two estimators are evaluated here, to the numbers that scikit-learn gives.
    """
    if hasattr(model, "L_") and model.L_ is None:
        # A Gaussian process from a file has no factor, which scikit-learn 1.7 asks for.
        return model.kernel_(inputs, model.X_train_) @ model.alpha_
    if hasattr(model, "X_fit_") and model.kernel == "rbf":
        return _predict_by_radial_functions(model, inputs)
    return model.predict(inputs)


def _predict_by_radial_functions(model: Any, inputs: Values) -> Any:
    """Return the predictions of kernel ridge, (n,), without scikit-learn's checks of its rows."""
    centres = np.asarray(model.X_fit_, dtype=np.float64)
    gamma = model.gamma
    if gamma is None:
        gamma = 1.0 / centres.shape[1]
    # Squared distances by the binomial formula, in place: the matrix is the largest array of all.
    kernel = np.einsum("ij,ij->i", centres, centres) - 2.0 * (inputs @ centres.T)
    kernel += np.einsum("ij,ij->i", inputs, inputs)[:, None]
    np.maximum(kernel, 0.0, out=kernel)
    kernel *= -gamma
    np.exp(kernel, out=kernel)
    return kernel @ model.dual_coef_


@dataclass(frozen=True, eq=False)
class Fit:
    """The fitted model of one target, and how it was fitted."""

    learnt: Learnt
    settings: Settings  # of the estimator
    choosing: float  # processor time of the choice of settings [s]
    fitting: float  # processor time of the fit [s]
    remarks: tuple[str, ...]  # warnings of the fit
    # (n,) predictions of the training rows over the target's scale, by models that have not seen
    # their group, NaN for rows that do not calibrate; None if another database calibrates
    left_out: Values | None = None


@dataclass(frozen=True, eq=False)
class Contents:
    """What the file of a surrogate keeps."""

    card: dict[str, Any]  # data, settings and scores
    learnt: Mapping[str, Learnt]  # models by the short names of their targets
    low: Values  # (d,), smallest features of the training
    high: Values  # (d,), largest features of the training
    distance: Distance  # distances from the training


@contextmanager
def _quick_import() -> Iterator[None]:
    """Have skops imported without its list of all estimators of scikit-learn.

    To make this list of types to trust, it would import all of scikit-learn.
    """
    from sklearn import utils

    all_estimators = utils.all_estimators
    utils.all_estimators = lambda *_, **__: []
    try:
        yield
    finally:
        utils.all_estimators = all_estimators


def write_contents(path: Path, contents: Contents) -> None:
    """Write the file of a surrogate, whole or not at all.

    Parameters
    ----------
    path : Path
        The file to write.
    contents : Contents
        The surrogate.

    Raises
    ------
    InputError
        If the file cannot be written.
    ValueError
        If a model is of a type that is not `REVIEWED`.
    """
    with _quick_import():
        from skops import io
    models = {
        "distance": vars(contents.distance),
        "targets": {name: _packed(learnt) for name, learnt in contents.learnt.items()},
    }
    archive = io.dumps(models, compression=ZIP_DEFLATED, compresslevel=1)
    strangers = set(io.get_untrusted_types(data=archive)) - set(REVIEWED)
    if strangers:
        raise ValueError(f"models of {', '.join(sorted(strangers))} are not kept")
    card = json.dumps(
        {
            "card": contents.card,
            "low": contents.low.tolist(),
            "high": contents.high.tolist(),
        }
    ).encode()
    body = len(card).to_bytes(8, "little") + card + archive
    digest = hashlib.sha256(body).hexdigest()
    with atomic(path, "surrogate") as file:
        file.write(SURROGATE + f"format {FORMAT}\nsha256 {digest}\n".encode())
        file.write(body)


def _packed(learnt: Learnt) -> dict[str, Any]:
    """Return the model of a target as a pipeline of the libraries' types, arrays and numbers."""
    estimator = _without_derived(learnt.pipeline.named_steps[STEP])
    trees = None
    if hasattr(estimator, "estimators_"):
        trees = _trees_of(estimator)
        estimator.estimators_ = estimator.estimators_[:1]
    pipeline = copy(learnt.pipeline)
    pipeline.steps = [pipeline.steps[0], (STEP, estimator)]
    # The distances of the calibration are those of the surrogate, which the file has once.
    calibration = learnt.calibration
    return {
        "column": learnt.column,
        "unit": learnt.unit,
        "pipeline": pipeline,
        "trees": trees,
        "scaling": vars(learnt.scaling),
        "clip": (learnt.clip.low, learnt.clip.high),
        "bounds": learnt.bounds,
        "powers": learnt.powers and tuple(learnt.powers),
        "scores": [tuple(scores) for scores in calibration.scores],
        "usual": vars(calibration.usual),
        "grows": calibration.distance is not None and tuple(calibration.growth),
        "root": calibration.root,
    }


def _without_derived(estimator: Any) -> Any:
    """Return a copy of a fitted estimator without what predictions do not need.

    Kernel ridge becomes scikit-learn's own. A Gaussian process loses its factor, as large as its
    rows squared, and the mean of a population its predictions of the training rows.
    """
    from sklearn.kernel_ridge import KernelRidge

    if isinstance(estimator, KernelRidge):
        copied = KernelRidge()
        vars(copied).update(vars(estimator))
    else:
        copied = copy(estimator)
    if hasattr(copied, "L_"):
        copied.L_ = None
    vars(copied).pop("left_out_", None)
    return copied


def _members_of(ensemble: Any) -> list[Any]:
    """Return the trees of an ensemble in their order."""
    return list(np.ravel(np.array(ensemble.estimators_, dtype=object)).tolist())


def _trees_of(ensemble: Any) -> dict[str, Values]:
    """Return all trees of an ensemble of scikit-learn in four arrays.

    In the archive each of some thousand trees would take ten small files, and a millisecond.
    """
    states = [member.tree_.__getstate__() for member in _members_of(ensemble)]
    return {
        "counts": np.array([state["node_count"] for state in states]),
        "depths": np.array([state["max_depth"] for state in states]),
        "nodes": np.concatenate([state["nodes"] for state in states]),
        "values": np.concatenate([state["values"] for state in states]),
    }


def _restore_trees(ensemble: Any, trees: Mapping[str, Values]) -> None:
    """Put all trees into an ensemble of which a file keeps the first one."""
    first = _members_of(ensemble)[0]
    tree_type, sizes, _ = first.tree_.__reduce__()
    counts = trees["counts"].tolist()
    depths = trees["depths"].tolist()
    members = []
    start = 0
    for count, depth in zip(counts, depths, strict=True):
        nodes = slice(start, start + count)
        member = copy(first)
        member.tree_ = tree_type(*sizes)
        member.tree_.__setstate__(
            {
                "max_depth": depth,
                "node_count": count,
                "nodes": trees["nodes"][nodes],
                "values": trees["values"][nodes],
            }
        )
        members.append(member)
        start += count
    if isinstance(ensemble.estimators_, np.ndarray):  # gradient boosting has a column
        ensemble.estimators_ = np.array(members, dtype=object).reshape(-1, 1)
    else:
        ensemble.estimators_ = members


def read_contents(path: Path) -> Contents:
    """Read the file of a surrogate.

    Models that another version of scikit-learn made predict one row, as a trial.

    Parameters
    ----------
    path : Path
        The file.

    Returns
    -------
    Contents
        The surrogate.

    Raises
    ------
    InputError
        If the file is no surrogate, is damaged, has another format, or its models cannot be used
        with the libraries installed here.
    """
    file = read_file(path)
    try:
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")  # models of another version of their library
            return _contents_of(file)
    except (
        Exception
    ) as error:  # any error of a library about content that it does not know
        if is_shortage(error):
            raise
        fault = printable(" ".join(str(error).split())[:100])
        versions = ", ".join(
            f"{name} {number}" for name, number in file.card["versions"].items() if number
        )
        raise InputError(
            f"{path}: its models cannot be used here ({fault}); it was made with"
            f" {printable(versions)}: {_how_to_fit_anew(path, file.card)}"
        ) from None


@dataclass(frozen=True, eq=False)
class SurrogateFile:
    """The file of a surrogate, of which the models are not unpacked."""

    card: dict[str, Any]  # data, settings and scores
    low: Values  # (d,), smallest features of the training
    high: Values  # (d,), largest features of the training
    archive: bytes  # of skops, with the models


def _contents_of(file: SurrogateFile) -> Contents:
    """Unpack the models of a file, and try them if another scikit-learn has made them."""
    import sklearn

    with _quick_import():
        from skops import io
    models = io.loads(file.archive, trusted=list(REVIEWED))
    distance = Distance(**models["distance"])
    learnt = {
        name: _unpacked(models["targets"][name], distance)
        for name in file.card["targets"]
    }
    if sklearn.__version__ != file.card["versions"].get("scikit-learn"):
        row = file.low[None]
        for target in learnt.values():
            target.calibration.ends(target.raw(row), 0.5, row)
    return Contents(file.card, learnt, file.low, file.high, distance)


def _unpacked(packed: Mapping[str, Any], distance: Distance) -> Learnt:
    """Return the model of a target that `_packed` has packed."""
    growth = GROWTH
    if packed["grows"]:
        growth = Growth(*packed["grows"])
    calibration = Calibration(
        scores=tuple(Scores(*scores) for scores in packed["scores"]),
        usual=ErrorScale(**packed["usual"]),
        distance=distance if packed["grows"] else None,
        root=packed["root"],
        growth=growth,
    )
    pipeline = packed["pipeline"]
    if packed["trees"] is not None:
        _restore_trees(pipeline.named_steps[STEP], packed["trees"])
    return Learnt(
        column=packed["column"],
        unit=packed["unit"],
        pipeline=pipeline,
        scaling=Scaling(**packed["scaling"]),
        calibration=calibration,
        clip=Clip(*packed["clip"]),
        bounds=packed["bounds"],
        powers=_powers_of(packed),
    )


def _powers_of(packed: Mapping[str, Any]) -> Powers | None:
    """Return the powers of a target; files of 1.0.0 do not state those of contact quantities."""
    if "powers" in packed:
        return packed["powers"] and Powers(*packed["powers"])
    quantity = QUANTITIES.get(packed["column"])
    if quantity is None or not quantity.stored:
        return None
    return quantity.powers


def read_file(path: Path) -> SurrogateFile:
    """Read the file of a surrogate, but do not unpack its models.

    Parameters
    ----------
    path : Path
        The file.

    Returns
    -------
    SurrogateFile
        Card, training ranges and the archive of the models.

    Raises
    ------
    InputError
        If the file cannot be read, is no surrogate, is damaged or has another format.
    """
    try:
        content = require_file(path).read_bytes()
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror or error}") from None
    head = HEAD.match(content)
    if head is None:
        database = "; it is a database" if kind_of(path) == "database" else ""
        raise InputError(
            f"{path}: is no surrogate{database}: {command_to_type('learn fit')} makes one of a"
            " database"
        )
    number = int(head[1])
    other_format = f"{path}: has format {number}, this version reads {FORMAT}: "
    if number not in {*OLDER, WITHOUT_POWERS, FORMAT}:
        raise InputError(f"{other_format}fit it anew with {command_to_type('learn fit')}")
    body = memoryview(content)[head.end() :]
    if hashlib.sha256(body).hexdigest() != head[2].decode():
        raise InputError(
            f"{path}: is damaged: its checksum is not that of its content; restore it from a copy"
            " or fit it anew"
        )
    try:
        file = _split(body)
        remedy = _how_to_fit_anew(path, file.card) if number in OLDER else ""
    except (ValueError, TypeError, KeyError, RecursionError, MemoryError) as error:
        fault = printable(f"{type(error).__name__}: {error}"[:100])
        raise InputError(
            f"{path}: is no surrogate that could be read ({fault})"
        ) from None
    if remedy:
        raise InputError(other_format + remedy)
    return file


def _split(body: memoryview) -> SurrogateFile:
    """Split what follows the head of a file into card, training ranges and archive."""
    end = 8 + int.from_bytes(body[:8], "little")
    content = json.loads(bytes(body[8:end]))
    return SurrogateFile(
        card=content["card"],
        low=np.array(content.get("low", ()), dtype=np.float64),
        high=np.array(content.get("high", ()), dtype=np.float64),
        archive=bytes(body[end:]),
    )


def _how_to_fit_anew(path: Path, card: Mapping[str, Any]) -> str:
    """Return "fit it anew: " and the command that does so, as far as the card tells."""
    # The card of a single database has the entries of that database itself.
    databases = [entry["database"] for entry in card.get("databases", [card])]
    area_max = None
    if card.get("area_max") is not None:
        area_max = f"{card['area_max']:g}"
    normalisation = None
    if card["normalisation"] != SETS[card["features"]].normalisation:
        normalisation = card["normalisation"]
    options = {
        "--model": card["model"],
        "--features": card["features"],
        "--target": ",".join(card["targets"]),
        "--seed": str(card["seed"]),
        "--blocks": card.get("blocks"),
        "--load": card.get("load"),
        "--area-max": area_max,
        "--normalise": normalisation,
        "--calibrate-on": card.get("calibration", {}).get("database"),
        "--from": _comparison_of(card),
    }
    words = ["learn", "fit", *databases]
    for option, value in options.items():
        if value:
            words += [option, value]
    words += ["-o", path]
    command = " ".join(shlex.quote(str(word)) for word in words)
    return f"fit it anew: {command_to_type(printable(command))}"


def _comparison_of(card: Mapping[str, Any]) -> Path | None:
    """Return the comparison folder that the settings of a surrogate come from, if they do."""
    from learn.comparison.folder import folder_of_origin

    target = next(iter(card["targets"].values()))
    folder = folder_of_origin(str(target["settings_from"]))
    if folder is None:
        return None
    return folder.parent
