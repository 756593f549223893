"""Grids of candidates: how they differ, which of them share a fit, and the cost of a fit.

The candidates of a grid are all combinations of its values. Several candidates may lead to one
computation. Canonical settings, which leave out settings that a kernel or solver ignores and have
one value in place of equivalent ones, are then equal. This reduction is exact:
`tests/learn/comparison/test_search.py` compares scores with those of scikit-learn's own grid
search.

Kernels depend on distances between rows. For the paper's Table 2, rows have unit length and
distances are 2 at most. Between rows of d standardised features distances are about sqrt(2 d),
which is 7 for 23 features, so that gamma is some thousandths, and a length about 10. Kernel methods
therefore have other grids (`SCALED`) for features without units. Targets of these features have
mean 0 and deviation 1 over the training rows, too. Tables name the grid that was searched.

In the story of the paper's tables this is the step from the values of Table 2
(`learn.comparison.paper`) to the candidates that `learn.comparison.search` fits.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from itertools import pairwise
from math import log2, sqrt
from typing import Any

from learn.comparison.paper import OPTIMA, SPACES, Space
from learn.features import SETS, chosen
from learn.features.scene import SCENE
from learn.models import POPULATION, Model

SettingValues = dict[str, Any]
"""Values of an estimator's settings by their names, on top of the settings of the baseline."""

SCALED: dict[str, Space] = {
    "svm": {
        "C": [1.0, 10.0, 100.0, 1000.0],
        "epsilon": [0.01, 0.1],
        "gamma": [3e-4, 1e-3, 3e-3, 1e-2, 3e-2],
        "kernel": ["rbf"],
    },
    "gaussian-process": {
        "alpha": [1e-7, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1],
        "kernel__length_scale": [3.0, 5.0, 10.0, 20.0, 30.0],
        # Without an optimizer, cross-validation chooses the length instead of the likelihood, which
        # is largest at a length of 0 for unit amplitude and small alphas.
        "optimizer": [None],
    },
    "kernel-ridge": {
        "alpha": [1e-8, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 0.1],
        "gamma": [1e-4, 3e-4, 1e-3, 3e-3, 1e-2, 3e-2, 0.1],
        "kernel": ["rbf", "linear"],
    },
}
"""Grids for features without units, by model. Other models have the grids of Table 2."""

SCALED_OPTIMA: dict[str, SettingValues] = {
    "svm": {"C": 100.0, "epsilon": 0.01, "gamma": 0.01, "kernel": "rbf"},
    "gaussian-process": {"alpha": 1e-5, "kernel__length_scale": 10.0, "optimizer": None},
    "kernel-ridge": {"alpha": 1e-4, "gamma": 3e-3, "kernel": "rbf"},
}
"""Points of the grids `SCALED` that are used without a search, by model."""

TABLE_2 = "Table 2"  # name of the paper's grids in results and tables
# in tables, in place of the grid that the mean of a population does not have
NO_GRID = "none: chooses by itself"


@dataclass(frozen=True)
class SearchSpace:
    """The values of a model's settings that a search tries."""

    name: str  # name of the grid in results and tables
    values: Space  # values by setting
    default: SettingValues  # point of the grid that is used without a search


def space_of(model: str, features: str) -> SearchSpace:
    """Return the values that a search of a model tries.

    Parameters
    ----------
    model : str
        Name of the model.
    features : str
        Name of the feature set.

    Returns
    -------
    SearchSpace
        A grid of the paper's Table 2, or one of `SCALED` for features without units. The space of
        the mean of a population has no values.
    """
    if model == POPULATION.name:
        return SearchSpace(NO_GRID, {}, {})
    if model in SCALED and (features == SCENE or chosen(features).scaled):
        return SearchSpace(
            "for features without units", SCALED[model], SCALED_OPTIMA[model]
        )
    return SearchSpace(TABLE_2, SPACES[model], OPTIMA[model])


def baseline(model: str, features: str) -> SettingValues:
    """Return the settings of a baseline that differ from the paper's baseline.

    The paper's Gaussian process has a kernel of length 1, with which standardised rows are not
    correlated at all (R2 below 0). For d standardised features, its length is that of gamma =
    1 / d, the default of scikit-learn's kernel ridge.

    Parameters
    ----------
    model : str
        Name of the model.
    features : str
        Name of the feature set.

    Returns
    -------
    dict
        Values by setting; empty for most baselines.
    """
    if model == "gaussian-process" and chosen(features).scaled:
        return {"kernel__length_scale": round(sqrt(len(SETS[features].columns) / 2), 4)}
    return {}


LIBRARY: dict[str, SettingValues] = {
    "gaussian-process": {"kernel": None, "optimizer": "fmin_l_bfgs_b"}
}
"""The library's own settings, for models whose baseline has other settings, by model.

scikit-learn's Gaussian process fits amplitude and length of its kernel. The paper's is fixed.
"""

LIBRARY_ROWS = 1000
"""Largest number of training rows of models in `LIBRARY`: times grow with its third power."""

LEAST_JUDGED = 10
"""Smallest number of candidates that are judged on all folds of all rows for a winner."""

BEYOND = 3
"""Largest number of values that a search tries beyond either end of a setting's values."""

INPUTS = 23
"""Number of features that estimates of work assume: that of the paper."""

SMALLEST = {"min_samples_split": 2}
"""Smallest possible values of settings that are whole numbers; 1 for all other settings."""


def reach(name: str, values: list[Any]) -> list[Any]:
    """Return the values of a setting, and the values that a search may try beyond both ends.

    Parameters
    ----------
    name : str
        Name of the setting.
    values : list
        Values of the grid.

    Returns
    -------
    list
        Numbers in ascending order. Beyond an end, numbers go on in the ratio of the last two; there
        are none beyond a zero. Fewer than three values, or values that are not all numbers, are
        returned unchanged.
    """
    are_numbers = all(isinstance(value, int | float) for value in values)
    if len(values) < 3 or not are_numbers:
        return values
    chain = sorted(values)
    for _ in range(BEYOND):
        lower = _next_value(name, inner=chain[1], end=chain[0])
        if lower is not None and lower not in chain:
            chain.insert(0, lower)
        upper = _next_value(name, inner=chain[-2], end=chain[-1])
        if upper is not None and upper not in chain:
            chain.append(upper)
    return chain


def _next_value(name: str, inner: float, end: float) -> float | None:
    """Return the next value of setting `name` beyond `end`, in the ratio of `end` to `inner`.

    `inner` is the neighbour of `end` among the values. The next value is end^2 / inner, rounded to
    two digits; for a whole number at least the setting's number in `SMALLEST`, or 1. It is None if
    `inner` or `end` is not above 0.
    """
    if inner <= 0 or end <= 0:
        return None
    value = float(f"{end * end / inner:.2g}")
    if isinstance(end, int):  # The setting is a whole number.
        return max(int(value), SMALLEST.get(name, 1))
    return value


class Grid:
    """A grid of candidates of a model, reduced to candidates that differ.

    One fit serves candidates that differ in one setting only (`Model.shared`), as all numbers of
    trees. Boosting whose first trees are not a model themselves (DART, linear, stopped early) must
    therefore not be among the candidates.

    Parameters
    ----------
    model : Model
        The model.
    space : Space
        Values to try, by setting.
    inputs : int
        Number of features. It decides which values of `max_features` are equal: the square root of
        23 and its logarithm are both 4.
    candidates : iterable of dict
        All candidates, for a grid with candidates beyond the ends of the space. If empty, the
        candidates are all combinations of the space.

    Attributes
    ----------
    candidates : list of dict
        All candidates in the order of scikit-learn's ParameterGrid, then those beyond the ends.
    differing : dict of str to dict
        Different canonical settings by their name (`key`), in the order of their first candidates.
    first : dict of str to dict
        The first candidate with these canonical settings, by their name.
    families : list of tuple of str
        Names of the differing candidates, grouped by the fit that serves them.
    """

    def __init__(
        self,
        model: Model,
        space: Space,
        inputs: int,
        candidates: Iterable[SettingValues] = (),
    ) -> None:
        from sklearn.model_selection import ParameterGrid

        self.model = model
        self.space = space
        self.inputs = inputs
        self.candidates: list[SettingValues] = [*(candidates or ParameterGrid(space))]
        self.differing: dict[str, SettingValues] = {}
        self.first: dict[str, SettingValues] = {}
        families: dict[str, list[str]] = {}
        for candidate in self.candidates:
            settings = canonical_settings(model, candidate, inputs)
            name = key(settings)
            if name in self.first:
                continue
            self.first[name] = candidate
            self.differing[name] = settings
            common = {
                setting: value
                for setting, value in settings.items()
                if setting != model.shared
            }
            families.setdefault(key(common), []).append(name)
        self.families = [tuple(names) for names in families.values()]

    def name_of(self, settings: SettingValues) -> str:
        """Return the name of a candidate.

        Parameters
        ----------
        settings : dict
            Values by setting of the candidate; they need not be canonical.

        Returns
        -------
        str
            Name of the canonical settings; "" if the grid does not have them.
        """
        name = key(canonical_settings(self.model, settings, self.inputs))
        if name in self.differing:
            return name
        return ""

    def ends(self, settings: SettingValues) -> SettingValues:
        """Return the next value of each setting whose value is at an end of the values tried.

        No candidate of this grid has the next value.

        Parameters
        ----------
        settings : dict
            A candidate of this grid.

        Returns
        -------
        dict
            The next value in the series of the setting (`reach`), by the name of the setting in
            alphabetical order. Three kinds of settings are left out: settings that are at no end,
            settings whose series has no further value, and settings that the kernel or solver of
            the candidate ignores.
        """
        canonical = canonical_settings(self.model, settings, self.inputs)
        beyond = {}
        for name in sorted(settings.keys() & canonical.keys()):
            chain = reach(name, self.space[name])
            place = chain.index(settings[name])
            # The value before this one and the value after it; the ends of the chain have only one.
            neighbours = chain[max(place - 1, 0) : place] + chain[place + 1 : place + 2]
            for value in neighbours:
                # A neighbour that no candidate has is beyond an end of the values tried.
                if all(candidate[name] != value for candidate in self.candidates):
                    beyond[name] = value
        return beyond

    def extended(self, winner: SettingValues) -> "Grid":
        """Return a grid with additional candidates beyond the ends that a winner is at.

        Parameters
        ----------
        winner : dict
            A candidate of this grid.

        Returns
        -------
        Grid
            All candidates of this grid, then the additional ones: for each setting of the winner at
            an end, its settings with the next value beyond this end.
        """
        shared = self.model.shared
        candidates = [*self.candidates]
        for name, value in self.ends(winner).items():
            beyond_end = {**winner, name: value}
            if shared in winner and shared != name:
                # The fit of the additional candidate serves all values of the shared setting.
                candidates += [
                    {**beyond_end, shared: shared_value}
                    for shared_value in self.space[shared]
                ]
            else:
                candidates.append(beyond_end)
        return Grid(self.model, self.space, self.inputs, candidates)


@dataclass(frozen=True)
class Task:
    """A fit of a search: the candidates that it serves, and the fold that it leaves out."""

    model: str  # name of the model
    # canonical settings by name; candidates differ in the setting `Model.shared` only
    candidates: dict[str, SettingValues]
    fold: int  # fold that is left out of the training, and predicted
    rows: int  # largest number of training rows
    # True for the baseline, which lacks the settings that all candidates of a search share
    baseline: bool = False


def canonical_settings(
    model: Model, candidate: Mapping[str, Any], inputs: int
) -> SettingValues:
    """Reduce a candidate to its canonical settings.

    Two candidates with equal canonical settings lead to the same computation.

    Parameters
    ----------
    model : Model
        The model.
    candidate : mapping
        Values by setting.
    inputs : int
        Number of features.

    Returns
    -------
    dict
        Values by setting.
    """
    ignored = _ignored_settings(model.name, candidate)
    settings = {name: value for name, value in candidate.items() if name not in ignored}
    if model.name == "mlp":
        # Fits with another largest number of iterations differ. So this number, which all
        # candidates share, is part of the settings and of their name.
        settings = {**model.tuned, **settings}
    if model.name in {"decision-tree", "random-forest"}:
        _merge_equal_trees(settings)
    if "max_features" in settings:
        settings["max_features"] = _number_of_features(settings["max_features"], inputs)
    return settings


def _ignored_settings(model: str, candidate: Mapping[str, Any]) -> set[str]:
    """Return the names of settings without an effect on the predictions of a candidate."""
    kernel = candidate.get("kernel")
    ignored = set()
    if model == "gradient-boost":
        ignored.add("criterion")  # without effect in today's library
    if model == "svm":
        ignored.add("cache_size")  # only memory
        if kernel != "poly":
            ignored.add("degree")
    if kernel == "linear":
        ignored.add("gamma")
    if model == "mlp" and candidate.get("solver") != "sgd":
        ignored.add("learning_rate")
    return ignored


def _merge_equal_trees(settings: SettingValues) -> None:
    """Change the settings of trees in place: settings that lead to equal trees become equal."""
    leaf = settings.get("min_samples_leaf", 1)
    split = settings.get("min_samples_split", 2)
    if isinstance(leaf, int) and isinstance(split, int):
        # A node that is split needs the samples of two leaves. scikit-learn raises the limit, too.
        settings["min_samples_split"] = max(split, 2 * leaf)
    if settings.get("criterion") == "friedman_mse":
        # Both criteria are equal for a single target.
        settings["criterion"] = "squared_error"


def _number_of_features(value: float | str | None, inputs: int) -> int:
    """Return the number of features that a value of `max_features` means in scikit-learn.

    `inputs` is the number of all features.
    """
    if value is None:
        return max(1, inputs)
    if value == "sqrt":
        return max(1, int(sqrt(inputs)))
    if value == "log2":
        return max(1, int(log2(inputs)))
    if isinstance(value, float):  # a share of the features
        return max(1, int(value * inputs))
    return max(1, int(value))


def key(settings: Mapping[str, Any], *, baseline: bool = False) -> str:
    """Write settings as one line of text, which is their name.

    Parameters
    ----------
    settings : mapping
        Values by setting.
    baseline : bool
        True for settings of a baseline, whose name differs from those of all candidates.

    Returns
    -------
    str
        As "alpha=0.1, kernel='rbf'" in alphabetical order; "baseline", or "baseline: alpha=0.1",
        for a baseline.
    """
    text = ", ".join(f"{name}={settings[name]!r}" for name in sorted(settings))
    if not baseline:
        return text
    if not text:
        return "baseline"
    return f"baseline: {text}"


def expected_work(task: Task) -> float:
    """Estimate the cost of a fit.

    Parameters
    ----------
    task : Task
        The fit.

    Returns
    -------
    float
        Estimated work relative to other fits of the model, in no unit. It decides the order of fits
        and the time that a progress bar shows.
    """
    candidates = [*task.candidates.values()]
    common = candidates[0]
    # `_largest` is 1 for a setting that is absent or no number.
    work = task.rows * _largest(candidates, "n_estimators")
    work = work * _largest(candidates, "max_features") * sqrt(_largest(candidates, "C"))
    for name in ("max_depth", "estimator__max_depth"):
        work *= min(_largest(candidates, name), 20)
    if common.get("criterion") == "absolute_error":
        work *= 5
    if common.get("loss") == "huber":  # Boosting evaluates it leaf by leaf.
        work *= 15
    if "hidden_layer_sizes" in common:
        sizes = common["hidden_layer_sizes"]
        weights_between_layers = sum(before * after for before, after in pairwise(sizes))
        weights_of_inputs = INPUTS * sizes[0]
        work *= weights_between_layers + weights_of_inputs
        if common.get("solver") == "lbfgs":  # The other solvers need fewer iterations.
            work *= 20
    if task.model == "kernel-ridge":
        if common.get("kernel") == "rbf":
            # The kernel matrix is built once, and factorised for the alpha of each candidate.
            work *= len(candidates)
        else:
            # The singular values of a linear kernel's features serve every alpha.
            work *= 0.01
    return work


def _largest(candidates: list[SettingValues], name: str) -> float:
    """Return the largest magnitude of a setting over candidates; 1 if it is a number in none."""
    values = (candidate.get(name) for candidate in candidates)
    magnitudes = [abs(value) for value in values if isinstance(value, int | float)]
    return float(max(magnitudes, default=1.0))
