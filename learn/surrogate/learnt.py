"""The fitted model of each target of a surrogate, and the file that keeps these models.

A file has these parts, in this order:

    asperity surrogate
    format 10
    sha256 of the parts below, in hexadecimal digits
    length of the next part, 8 bytes, little endian
    JSON with the card and the training ranges of the features
    zip archive of skops with the models: pipelines of scikit-learn, arrays and numbers

The checksum detects damage. A file names the types of its objects. If a type is not a number, an
array or in `REVIEWED`, the file is refused before anything is imported or made, so that no code of
a stranger runs. Compiled code of scikit-learn and XGBoost trusts the numbers of trees and vectors:
a forged file with a right checksum may still end the process or give any number.
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
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal
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
    Calibration,
    Distance,
    ErrorScale,
    Growth,
    Scores,
)

if TYPE_CHECKING:
    from learn.comparison.folder import Settings
    from learn.database_rows import Dataset

# Number of rows that are predicted together. A kernel needs memory for this number times the number
# of training rows.
CHUNK = 2000

# Features that models see clipped to the range of the training. Moments of third and fourth order
# have heavy tails: a window of a honed map with a groove at its border may have a kurtosis of its
# peaks that is forty deviations from the mean. There, a radial basis function with a large length
# extrapolates like a polynomial: a few rows of this kind had most of the squared error of all rows
# (`bench scans`). The distance of a moment from the range of the training has little effect on the
# contact. The other features are not clipped, because areas and forces of the coarse solve are most
# useful where they are extrapolated. Flags see all features as they are.
MOMENTS = frozenset(name for name in PURE if "skewness" in name or "kurtosis" in name)
# Feature that models see as 0. For self-affine surfaces it is noise: its only information is that
# a surface is of another kind. Flags and intervals see it as it is.
UNSEEN = SKEWNESS

# Number of the layout of a file. It is raised whenever an older version would misread a new file.
FORMAT = 10
# Format of 1.0.0, which can be read. It does not state the powers that targets scale with.
WITHOUT_POWERS = 9
# Formats of 1.0.0rc1 and before, which are refused: their intervals contain fewer new surfaces than
# their level states.
OLDER = range(3, 9)
# First lines of a file, with the number of the format and the checksum.
HEAD = re.compile(SURROGATE + rb"format (\d{1,9})\nsha256 ([0-9a-f]{64})\n")

# Name of an entry that a target has in a card if a comparison chose its settings: the target's
# folder in this comparison.
COMPARISON = "comparison"
# Cards of 1.0.0 and before have the folder in the entry "settings_from" only, after these words.
WORDS_BEFORE_FOLDER = ("tuned in ", "the baseline, by ")
# Largest number of letters of a library's error that a message quotes.
LONGEST_FAULT = 100

# Types of the objects that models consist of, besides numbers and arrays.
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
    """Ranges that features are clipped to before a model sees them."""

    low: Values  # (d,), smallest values; minus infinity for features that are not clipped
    high: Values  # (d,), largest values; infinity for features that are not clipped

    def clipped(self, inputs: Values) -> Values:
        """Clip features to their ranges.

        Parameters
        ----------
        inputs : ndarray, shape (n, d)
            Features.

        Returns
        -------
        ndarray, shape (n, d)
            The nearest values within the ranges; NaN stays NaN.
        """
        return np.asarray(np.clip(inputs, self.low, self.high))


def clip_of(train: Dataset) -> Clip:
    """Return the ranges that features are clipped to for models of some training rows.

    Parameters
    ----------
    train : Dataset
        The training rows.

    Returns
    -------
    Clip
        The training ranges of `MOMENTS` if features have no units, 0 to 0 for `UNSEEN`, and
        infinite ranges for all other features.
    """
    names = np.array(train.features.columns)
    is_clipped = np.isin(names, list(MOMENTS)) & train.features.scaled
    low = np.where(is_clipped, train.inputs.min(axis=0), -np.inf)
    high = np.where(is_clipped, train.inputs.max(axis=0), np.inf)
    low[names == UNSEEN] = 0.0
    high[names == UNSEEN] = 0.0
    return Clip(low=low, high=high)


@dataclass(frozen=True, eq=False)
class Learnt:
    """The fitted model of one target.

    The model predicts the target over its scale (`FeatureSet.scale`), standardised by `scaling`.
    """

    column: str  # name of the target's column in `gen.schema`
    unit: str  # unit of the column
    # fitted pipeline of scikit-learn with two steps: scaling of the features, and estimator
    pipeline: Any
    scaling: Scaling  # scaling between the target over its scale and the numbers that are learnt
    calibration: Calibration  # intervals of the target over its scale
    clip: Clip  # ranges that features are clipped to
    # smallest and largest possible value of the target, in its unit
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
        # The two steps are pairs of a name and an object.
        (_, scaling), (_, model) = self.pipeline.steps
        predictions = np.full(len(inputs), np.nan)
        # Warnings of infinite numbers are not needed: `Surrogate.predict_rows` names their rows.
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
        """Return the ends of intervals for the mean over all surfaces with given parameters.

        Parameters
        ----------
        raw : ndarray, shape (n,)
            Predictions over the scale of the target, from the method `raw`.
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
            If the model is not the mean of a population, which alone knows the error of the mean.
        """
        from scipy.stats import norm

        model = self.pipeline.named_steps[STEP]
        if not hasattr(model, "coefficients_"):  # `learn.population.Population` has them.
            raise InputError(
                "the mean has an interval with --model population alone: fit one"
            )
        errors = np.full(len(inputs), np.nan)
        for rows in _chunks(inputs):
            errors[rows] = model.error(self.pipeline[:-1].transform(inputs[rows]))
        # The error of the mean is normally distributed; (1 - level) / 2 of it is beyond each end.
        deviations = norm.ppf((1 + level) / 2)
        half = deviations * errors * self.scaling.deviation
        return raw - half, raw + half


def _chunks(inputs: Values) -> Iterator[Indices]:
    """Yield the positions of rows that are predicted together, (k,), `CHUNK` rows at most.

    `inputs` are the features of n rows, (n, d). Rows with a NaN among them are left out.
    """
    defined = np.flatnonzero(~np.isnan(inputs).any(axis=1))
    for start in range(0, defined.size, CHUNK):
        yield defined[start : start + CHUNK]


def _predict(model: Any, inputs: Values) -> Any:
    """Return the predictions of a fitted estimator at features, (n, d), as (n,) or (n, 1).

    Features and predictions are on the scale that the estimator was trained on.
    """
    if hasattr(model, "L_") and model.L_ is None:
        # A Gaussian process from a file lacks its factor, without which `predict` of scikit-learn
        # 1.7 fails although the mean does not need it.
        return model.kernel_(inputs, model.X_train_) @ model.alpha_
    if hasattr(model, "X_fit_") and model.kernel == "rbf":  # kernel ridge
        return _predict_by_radial_functions(model, inputs)
    return model.predict(inputs)


def _predict_by_radial_functions(model: Any, inputs: Values) -> Any:
    """Return the predictions of kernel ridge with radial functions at features, (n, d), as (n,).

    The estimator's own `predict` gives equal numbers but for rounding, and takes longer, because it
    checks its input.
    """
    centres = np.asarray(model.X_fit_, dtype=np.float64)
    gamma = model.gamma
    if gamma is None:
        gamma = 1.0 / centres.shape[1]  # the default of scikit-learn
    # Squared distances by |x|^2 + |c|^2 - 2 x c. The matrix is the largest array of a prediction,
    # so that it is computed in place.
    kernel = np.einsum("ij,ij->i", centres, centres) - 2.0 * (inputs @ centres.T)
    kernel += np.einsum("ij,ij->i", inputs, inputs)[:, None]
    np.maximum(kernel, 0.0, out=kernel)  # Rounding may have made small squares negative.
    kernel *= -gamma
    np.exp(kernel, out=kernel)
    return kernel @ model.dual_coef_


@dataclass(frozen=True, eq=False)
class Fit:
    """The fitted model of one target, with its settings, times and warnings."""

    learnt: Learnt  # the model
    settings: Settings  # settings of the estimator
    choosing: float  # processor time of the choice of settings [s]
    fitting: float  # processor time of the fit [s]
    remarks: tuple[str, ...]  # warnings of the fit
    # (n,), predictions of the training rows over the target's scale by models that have not seen
    # them; NaN for rows that do not calibrate. None if another database calibrates.
    left_out: Values | None = None


@dataclass(frozen=True, eq=False)
class Contents:
    """The contents of a surrogate's file."""

    card: dict[str, Any]  # data, settings and scores, from `learn.surrogate.card.make`
    learnt: Mapping[str, Learnt]  # models by the short names of their targets
    low: Values  # (d,), smallest value of each feature in the training
    high: Values  # (d,), largest value of each feature in the training
    distance: Distance  # measure of distances from the training


@contextmanager
def _quick_import() -> Iterator[None]:
    """Make imports of skops quick, within a `with` statement.

    When it is imported, skops lists all estimators of scikit-learn as types to trust, for which it
    imports all of scikit-learn. Within the statement that list is empty.
    """
    from sklearn import utils

    all_estimators = utils.all_estimators
    utils.all_estimators = lambda *_, **__: []
    try:
        yield
    finally:
        utils.all_estimators = all_estimators


def write_contents(path: Path, contents: Contents) -> None:
    """Write the file of a surrogate.

    An error leaves no partly written file.

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
        If a model contains a type that is not `REVIEWED`.
    """
    with _quick_import():
        from skops import io
    models = {
        "distance": vars(contents.distance),
        "targets": {name: _packed(learnt) for name, learnt in contents.learnt.items()},
    }
    archive = io.dumps(models, compression=ZIP_DEFLATED, compresslevel=1)
    strange_types = set(io.get_untrusted_types(data=archive)) - set(REVIEWED)
    if strange_types:
        raise ValueError(f"models of {', '.join(sorted(strange_types))} are not kept")
    card_and_ranges = json.dumps(
        {
            "card": contents.card,
            "low": contents.low.tolist(),
            "high": contents.high.tolist(),
        }
    ).encode()
    body = len(card_and_ranges).to_bytes(8, "little") + card_and_ranges + archive
    digest = hashlib.sha256(body).hexdigest()
    with atomic(path, "surrogate") as file:
        file.write(SURROGATE + f"format {FORMAT}\nsha256 {digest}\n".encode())
        file.write(body)


def _packed(learnt: Learnt) -> dict[str, Any]:
    """Return the model of a target as a dictionary for skops; `_unpacked` is the inverse.

    Its entries are a pipeline of the libraries' types, arrays, numbers and texts.
    """
    estimator = _without_derived(learnt.pipeline.named_steps[STEP])
    trees = None
    if hasattr(estimator, "estimators_"):
        # The ensemble keeps its first tree, from which `_restore_trees` makes the others.
        trees = _trees_of(estimator)
        estimator.estimators_ = estimator.estimators_[:1]
    pipeline = copy(learnt.pipeline)
    pipeline.steps = [pipeline.steps[0], (STEP, estimator)]
    calibration = learnt.calibration
    # All targets have the measure of distances in common, which the file has once. "grows" is the
    # two numbers of the growth with this distance, or False for a calibration without a distance.
    grows: tuple[float, ...] | Literal[False] = False
    if calibration.distance is not None:
        grows = tuple(calibration.growth)
    powers = None
    if learnt.powers is not None:
        powers = tuple(learnt.powers)
    return {
        "column": learnt.column,
        "unit": learnt.unit,
        "pipeline": pipeline,
        "trees": trees,
        "scaling": vars(learnt.scaling),
        "clip": (learnt.clip.low, learnt.clip.high),
        "bounds": learnt.bounds,
        "powers": powers,
        "scores": [tuple(scores) for scores in calibration.scores],
        "usual": vars(calibration.usual),
        "grows": grows,
        "root": calibration.root,
    }


def _without_derived(estimator: Any) -> Any:
    """Return a copy of a fitted estimator without the attributes that predictions do not need.

    A Gaussian process loses its factor, a matrix of its training rows. The mean of a population
    loses its predictions of the training rows. Kernel ridge and a Gaussian process become
    scikit-learn's own classes.
    """
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.kernel_ridge import KernelRidge

    copied = copy(estimator)
    for reviewed in (GaussianProcessRegressor, KernelRidge):
        if isinstance(estimator, reviewed):
            # Models are fitted by a class of ours, which is not among `REVIEWED`.
            copied = reviewed()
            vars(copied).update(vars(estimator))
    if hasattr(copied, "L_"):
        copied.L_ = None
    vars(copied).pop("left_out_", None)
    return copied


def _members_of(ensemble: Any) -> list[Any]:
    """Return the fitted trees of an ensemble of scikit-learn in their order.

    Gradient boosting has them in an array of one column, other ensembles in a list.
    """
    return list(np.ravel(np.array(ensemble.estimators_, dtype=object)).tolist())


def _trees_of(ensemble: Any) -> dict[str, Values]:
    """Return all trees of an ensemble of scikit-learn as four arrays, by their names.

    "counts" and "depths" have the number of nodes and the depth of each tree. "nodes" and "values"
    have the nodes of all trees, one tree after the other. Arrays are quick to pack: each tree would
    take ten small files of the archive and a millisecond, and there may be some thousand trees.
    """
    states = [member.tree_.__getstate__() for member in _members_of(ensemble)]
    return {
        "counts": np.array([state["node_count"] for state in states]),
        "depths": np.array([state["max_depth"] for state in states]),
        "nodes": np.concatenate([state["nodes"] for state in states]),
        "values": np.concatenate([state["values"] for state in states]),
    }


def _restore_trees(ensemble: Any, trees: Mapping[str, Values]) -> None:
    """Set the `estimators_` of an ensemble that has only its first tree to all its trees.

    `trees` are the arrays from `_trees_of`.
    """
    first = _members_of(ensemble)[0]
    # The arguments that a tree is made with are numbers of features, classes and outputs. The state
    # of the first tree, the third part, is not needed.
    tree_type, arguments, _ = first.tree_.__reduce__()
    counts = trees["counts"].tolist()
    depths = trees["depths"].tolist()
    members = []
    start = 0
    for count, depth in zip(counts, depths, strict=True):
        nodes = slice(start, start + count)
        member = copy(first)
        member.tree_ = tree_type(*arguments)
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
    if isinstance(ensemble.estimators_, np.ndarray):
        # Gradient boosting has its trees in an array of one column.
        ensemble.estimators_ = np.array(members, dtype=object).reshape(-1, 1)
    else:
        ensemble.estimators_ = members


def read_contents(path: Path) -> Contents:
    """Read the file of a surrogate.

    If another version of scikit-learn made the models, they have to predict one row as a trial.

    Parameters
    ----------
    path : Path
        The file.

    Returns
    -------
    Contents
        The contents, with unpacked models.

    Raises
    ------
    InputError
        If the file is no surrogate, is damaged, has another format, or its models cannot be used
        with the libraries installed here.
    """
    file = read_file(path)
    try:
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            # Libraries warn of models that another version of them made.
            warnings.simplefilter("ignore")
            return _contents_of(file)
    # Libraries raise errors of any type about contents that they do not know.
    except Exception as error:
        if is_shortage(error):
            raise  # Memory or disk space is short, which is no fault of the file.
        in_one_line = " ".join(str(error).split())
        fault = printable(in_one_line[:LONGEST_FAULT])
        # A library that was not installed when the file was made has no number.
        libraries = file.card["versions"].items()
        versions = ", ".join(f"{name} {number}" for name, number in libraries if number)
        raise InputError(
            f"{path}: its models cannot be used here ({fault}); it was made with"
            f" {printable(versions)}: {_how_to_fit_anew(path, file.card)}"
        ) from None


@dataclass(frozen=True, eq=False)
class SurrogateFile:
    """The contents of a surrogate's file with models that are not unpacked."""

    card: dict[str, Any]  # data, settings and scores, from `learn.surrogate.card.make`
    low: Values  # (d,), smallest value of each feature in the training
    high: Values  # (d,), largest value of each feature in the training
    archive: bytes  # archive of skops with the models


def _contents_of(file: SurrogateFile) -> Contents:
    """Unpack the models of a file.

    If another version of scikit-learn made the models, they predict one row as a trial. Errors of
    libraries, of any type, pass through.
    """
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
        row = file.low[None]  # a row within the training ranges, (1, d)
        any_level = 0.5
        for target in learnt.values():
            target.calibration.ends(target.raw(row), any_level, row)
    return Contents(
        card=file.card,
        learnt=learnt,
        low=file.low,
        high=file.high,
        distance=distance,
    )


def _unpacked(packed: Mapping[str, Any], distance: Distance) -> Learnt:
    """Return the model of a target from the dictionary that `_packed` made of it.

    `distance` is the surrogate's measure of distances, which all targets have in common.
    """
    calibration = Calibration(
        scores=tuple(Scores(*scores) for scores in packed["scores"]),
        usual=ErrorScale(**packed["usual"]),
        root=packed["root"],
    )
    if packed["grows"]:
        calibration = replace(
            calibration, distance=distance, growth=Growth(*packed["grows"])
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
    """Return the powers that a packed target scales with; None if they are unknown."""
    if "powers" in packed:
        if packed["powers"] is None:
            return None
        return Powers(*packed["powers"])
    # Files of `WITHOUT_POWERS` do not state powers. Those of contact quantities are known; the
    # results of a user's function have none.
    quantity = QUANTITIES.get(packed["column"])
    if quantity is None or not quantity.stored:
        return None
    return quantity.powers


def read_file(path: Path) -> SurrogateFile:
    """Read the file of a surrogate without unpacking its models.

    Parameters
    ----------
    path : Path
        The file.

    Returns
    -------
    SurrogateFile
        Card, training ranges, and the archive of the models.

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
        remark_on_kind = ""
        if kind_of(path) == "database":
            remark_on_kind = "; it is a database"
        raise InputError(
            f"{path}: is no surrogate{remark_on_kind}: {command_to_type('learn fit')} makes one"
            " of a database"
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
    remedy = ""
    try:
        file = _split(body)
        if number in OLDER:
            remedy = _how_to_fit_anew(path, file.card)
    # The checksum is right: the file is not damaged, but was written with contents of another form.
    except (ValueError, TypeError, KeyError, RecursionError, MemoryError) as error:
        fault = printable(f"{type(error).__name__}: {error}"[:LONGEST_FAULT])
        raise InputError(
            f"{path}: is no surrogate that could be read ({fault})"
        ) from None
    if number in OLDER:
        raise InputError(other_format + remedy)
    return file


def _split(body: memoryview) -> SurrogateFile:
    """Split the body of a file, which follows its first lines, into its parts.

    Raises ValueError, TypeError or KeyError if the body is not as the module describes it.
    RecursionError or MemoryError may pass through.
    """
    # The first 8 bytes are the length of the JSON, which follows them.
    end = 8 + int.from_bytes(body[:8], "little")
    content = json.loads(bytes(body[8:end]))
    # Files of `OLDER` formats, which are refused afterwards, may lack the training ranges.
    return SurrogateFile(
        card=content["card"],
        low=np.array(content.get("low", ()), dtype=np.float64),
        high=np.array(content.get("high", ()), dtype=np.float64),
        archive=bytes(body[end:]),
    )


def _how_to_fit_anew(path: Path, card: Mapping[str, Any]) -> str:
    """Return "fit it anew: " and the command that does so, with the options that the card states.

    KeyError, TypeError or ValueError is raised if the card is malformed.
    """
    # The card of a single database has the entries of that database itself.
    databases = [entry["database"] for entry in card.get("databases", [card])]
    area_max = None
    if card.get("area_max") is not None:
        area_max = f"{card['area_max']:g}"
    normalisation = None  # An option is left out if its value is the default.
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
    """Return the comparison folder whose winners' settings a surrogate has, from its card.

    It is None if no comparison chose the settings.
    """
    # All targets have their settings from folders of one comparison.
    target = next(iter(card["targets"].values()))
    if COMPARISON in target:
        return Path(target[COMPARISON]).parent
    origin = str(target["settings_from"])
    for words in WORDS_BEFORE_FOLDER:
        if origin.startswith(words):
            return Path(origin.removeprefix(words)).parent
    return None
