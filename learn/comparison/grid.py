"""Grids of candidates: which candidates differ, which of them one fit serves, what a fit costs.

The candidates of a grid are all combinations of its values. A candidate's canonical settings leave
out settings that its kernel or solver ignores, and give one name to values that lead to the same
computation. The reduction is exact: `tests/learn/comparison/test_search.py` compares scores with
those of scikit-learn's own grid search.

Kernels measure distances, and the paper's Table 2 has them between rows of unit length, 2 at most.
Between rows of d standardised features they are about sqrt(2 d), which is 7 for 23 features: there
gamma is some thousandths, and a length is about 10. So kernel methods have grids of their own
(`SCALED`) for features without units. The targets of these features have mean 0 and deviation 1
over the training rows as well. The tables name the grid that was searched.

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
"""Values of an estimator's settings, by name: a candidate, or what is put on top of a baseline."""

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
        # Lengths are chosen by cross-validation, not by likelihood: at unit amplitude and for small
        # alphas the likelihood is largest at a length of 0.
        "optimizer": [None],
    },
    "kernel-ridge": {
        "alpha": [1e-8, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 0.1],
        "gamma": [1e-4, 3e-4, 1e-3, 3e-3, 1e-2, 3e-2, 0.1],
        "kernel": ["rbf", "linear"],
    },
}
"""Grids for features without units where Table 2's do not fit; the other models keep theirs."""

SCALED_OPTIMA: dict[str, SettingValues] = {
    "svm": {"C": 100.0, "epsilon": 0.01, "gamma": 0.01, "kernel": "rbf"},
    "gaussian-process": {"alpha": 1e-5, "kernel__length_scale": 10.0, "optimizer": None},
    "kernel-ridge": {"alpha": 1e-4, "gamma": 3e-3, "kernel": "rbf"},
}
"""Points of these grids that serve where nothing was searched."""

TABLE_2 = "Table 2"  # name of the paper's grids in results and tables
NO_GRID = "none: chooses by itself"  # name in tables of a model without a grid


@dataclass(frozen=True)
class SearchSpace:
    """Values of a model's settings that a search tries."""

    name: str  # of the grid, in results and tables
    values: Space  # to try, by setting
    default: SettingValues  # point of the values that serves where nothing was searched


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
        The paper's Table 2, or the grid for features without units. The population mean has no
        values.
    """
    if model == POPULATION.name:
        return SearchSpace(NO_GRID, {}, {})
    if model in SCALED and (features == SCENE or chosen(features).scaled):
        return SearchSpace(
            "for features without units", SCALED[model], SCALED_OPTIMA[model]
        )
    return SearchSpace(TABLE_2, SPACES[model], OPTIMA[model])


def baseline(model: str, features: str) -> SettingValues:
    """Return settings of a baseline that differ from its library's and from the paper's.

    The paper's Gaussian process has a kernel of length 1, over which standardised rows are not
    correlated at all (R2 below 0). For these rows it gets the length that gamma = 1 / d means,
    which is scikit-learn's choice for the same kernel in kernel ridge.

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
"""Settings on top of a baseline that make it its library's own, for baselines that are not.

scikit-learn's Gaussian process fits amplitude and length of its kernel.
"""

LIBRARY_ROWS = 1000
"""Training rows of such a model at most: a step of its optimiser takes their third power."""

LEAST_JUDGED = 10
"""Candidates that have to be judged over five folds of all rows before a search has a winner."""

BEYOND = 3  # values that a search tries at most beyond either end of a setting's values
SMALLEST = {"min_samples_split": 2}  # smallest whole numbers of settings; 1 of all others


def reach(name: str, values: list[Any]) -> list[Any]:
    """Return the values of a setting with those that a search may try beyond both ends.

    Parameters
    ----------
    name : str
        Name of the setting.
    values : list
        Values of the grid.

    Returns
    -------
    list
        Numbers in ascending order, which go on in the ratio of the last two. Nothing lies beyond
        zero. Fewer than three values, or values that are not all numbers, are returned unchanged.
    """
    if len(values) < 3 or not all(isinstance(value, int | float) for value in values):
        return values
    chain = sorted(values)
    for _ in range(BEYOND):
        lower = _next_value(name, chain[1], chain[0])
        if lower is not None and lower not in chain:
            chain.insert(0, lower)
        upper = _next_value(name, chain[-2], chain[-1])
        if upper is not None and upper not in chain:
            chain.append(upper)
    return chain


def _next_value(name: str, inner: float, end: float) -> float | None:
    """Return the value that follows an inner and an end value of a setting.

    It is None beside zero. A whole number is not below the smallest one of the setting.
    """
    if inner <= 0 or end <= 0:
        return None
    value = float(f"{end * end / inner:.2g}")
    if isinstance(end, int):
        return max(int(value), SMALLEST.get(name, 1))
    return value


class Grid:
    """A grid of candidates of a model: those of them that differ, and those that one fit serves.

    Boosting whose first trees are no model of their own (DART, linear, stopped early) must not be
    among the candidates: one fit serves all numbers of trees. The number of inputs decides which
    `max_features` are the same: the square root of 23 and its logarithm are both 4.

    Parameters
    ----------
    model : Model
        The model.
    space : Space
        Values to try, by setting.
    inputs : int
        Number of features.
    candidates : iterable of dict
        All candidates, by which a grid goes beyond the ends of its space; all combinations of the
        space if empty.

    Attributes
    ----------
    candidates : list of dict
        In the order of scikit-learn's ParameterGrid, then those beyond the ends of the space.
    differing : dict
        Canonical settings by name (`key`), in the order of their first candidate.
    first : dict
        The first candidate of each of these names.
    families : list of tuple of str
        Names of the candidates that one fit serves.
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
            common = {k: v for k, v in settings.items() if k != model.shared}
            families.setdefault(key(common), []).append(name)
        self.families = [tuple(names) for names in families.values()]

    def name_of(self, settings: SettingValues) -> str:
        """Return the name of a candidate.

        Parameters
        ----------
        settings : dict
            Values by setting, canonical or not.

        Returns
        -------
        str
            Name of its canonical settings; "" if they are not in the grid.
        """
        name = key(canonical_settings(self.model, settings, self.inputs))
        return name if name in self.differing else ""

    def ends(self, settings: SettingValues) -> SettingValues:
        """Return the settings of a candidate that lie at an end of all values that were tried.

        Parameters
        ----------
        settings : dict
            A candidate of this grid.

        Returns
        -------
        dict
            The next value beyond the end, by setting, in alphabetical order. Settings that make no
            difference are left out.
        """
        canonical = canonical_settings(self.model, settings, self.inputs)
        following = {}
        for name in sorted(settings.keys() & canonical.keys()):
            chain = reach(name, self.space[name])
            place = chain.index(settings[name])
            neighbours = chain[max(place - 1, 0) : place] + chain[place + 1 : place + 2]
            for value in neighbours:
                if all(candidate[name] != value for candidate in self.candidates):
                    following[name] = value
        return following

    def extended(self, winner: SettingValues) -> "Grid":
        """Return the grid with further candidates beyond the ends at which a winner lies.

        Parameters
        ----------
        winner : dict
            A candidate of this grid.

        Returns
        -------
        Grid
            All candidates of this grid, then the further ones. These have the winner's settings but
            for the one that goes on, and all values of the setting that one fit serves.
        """
        shared = self.model.shared
        candidates = [*self.candidates]
        for name, value in self.ends(winner).items():
            further = {**winner, name: value}
            if shared in winner and shared != name:
                candidates += [{**further, shared: v} for v in self.space[shared]]
            else:
                candidates.append(further)
        return Grid(self.model, self.space, self.inputs, candidates)


@dataclass(frozen=True)
class Task:
    """One fit: the candidates that it serves, and the fold that it leaves out."""

    model: str
    # By name. Candidates differ only in the setting of which one fit serves all values.
    candidates: dict[str, SettingValues]
    fold: int  # left out of the training, and predicted
    rows: int  # for training at most
    baseline: bool = False  # True without the settings that candidates share


def canonical_settings(
    model: Model, candidate: Mapping[str, Any], inputs: int
) -> SettingValues:
    """Reduce a candidate to the settings that make a difference.

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
        Settings by name. Two candidates with equal ones lead to the same computation.
    """
    ignored = _ignored_settings(model.name, candidate)
    settings = {name: value for name, value in candidate.items() if name not in ignored}
    if model.name == "mlp":
        # The length of the training belongs to the name, for fits of another length differ.
        settings = {**model.tuned, **settings}
    if model.name in {"decision-tree", "random-forest"}:
        _merge_equal_trees(settings)
    if "max_features" in settings:
        settings["max_features"] = _number_of_features(settings["max_features"], inputs)
    return settings


def _ignored_settings(model: str, candidate: Mapping[str, Any]) -> set[str]:
    """Return the names of settings that have no effect on a candidate's predictions."""
    kernel = candidate.get("kernel")
    ignored = set()
    if model == "gradient-boost":
        ignored.add("criterion")  # has no effect in today's library
    if model == "svm":
        ignored.add("cache_size")  # memory, not mathematics
        if kernel != "poly":
            ignored.add("degree")
    if kernel == "linear":
        ignored.add("gamma")
    if model == "mlp" and candidate.get("solver") != "sgd":
        ignored.add("learning_rate")
    return ignored


def _merge_equal_trees(settings: SettingValues) -> None:
    """Change settings of trees in place, so that those of equal trees become the same."""
    leaf = settings.get("min_samples_leaf", 1)
    split = settings.get("min_samples_split", 2)
    if isinstance(leaf, int) and isinstance(split, int):
        # A node that is split needs the samples of two leaves: scikit-learn raises the limit.
        settings["min_samples_split"] = max(split, 2 * leaf)
    if settings.get("criterion") == "friedman_mse":  # the same for a single target
        settings["criterion"] = "squared_error"


def _number_of_features(value: float | str | None, inputs: int) -> int:
    """Return the number of inputs, of all, that scikit-learn makes of `max_features`."""
    if value is None:
        return max(1, inputs)
    if value == "sqrt":
        return max(1, int(sqrt(inputs)))
    if value == "log2":
        return max(1, int(log2(inputs)))
    if isinstance(value, float):
        return max(1, int(value * inputs))
    return max(1, int(value))


def key(settings: Mapping[str, Any], *, baseline: bool = False) -> str:
    """Write settings as one line of text, which is their name.

    Parameters
    ----------
    settings : mapping
        Values by setting.
    baseline : bool
        Whether they are on top of the baseline's, and not a candidate.

    Returns
    -------
    str
        The name. No candidate of a grid has that of a baseline.
    """
    text = ", ".join(f"{name}={settings[name]!r}" for name in sorted(settings))
    if not baseline:
        return text
    return f"baseline: {text}" if text else "baseline"


def expected_work(task: Task) -> float:
    """Estimate the cost of a fit.

    Parameters
    ----------
    task : Task
        The fit.

    Returns
    -------
    float
        Work relative to other fits of the same model, for the order of fits and the time left.
    """
    candidates = [*task.candidates.values()]
    common = candidates[0]
    work = task.rows * _largest(candidates, "n_estimators")
    work = work * _largest(candidates, "max_features") * sqrt(_largest(candidates, "C"))
    for name in ("max_depth", "estimator__max_depth"):
        work *= min(_largest(candidates, name), 20)
    if common.get("criterion") == "absolute_error":
        work *= 5
    if common.get("loss") == "huber":  # boosting evaluates it leaf by leaf
        work *= 15
    if "hidden_layer_sizes" in common:
        sizes = common["hidden_layer_sizes"]
        work *= sum(a * b for a, b in pairwise(sizes)) + 23 * sizes[0]
        if common.get("solver") == "lbfgs":  # the other solvers end long before
            work *= 20
    if task.model == "kernel-ridge":
        work *= len(candidates) if common.get("kernel") == "rbf" else 0.01
    return work


def _largest(candidates: list[SettingValues], name: str) -> float:
    """Return the largest magnitude of a setting's numbers; 1 if there is no number."""
    values = (candidate.get(name) for candidate in candidates)
    magnitudes = [abs(value) for value in values if isinstance(value, int | float)]
    return float(max(magnitudes, default=1.0))
