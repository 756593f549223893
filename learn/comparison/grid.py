"""Grids of candidates: which there are, which differ, which one fit serves, what each fit costs.

A candidate's canonical settings leave out settings that its kernel or solver ignores, and give one
name to values that lead to the same computation. The reduction is exact:
`tests/learn/comparison/test_search.py` compares scores with scikit-learn's own grid search.

Kernels measure distances, and the paper's Table 2 has them between rows of unit length, 2 at most.
Between rows of d standardised features they are about sqrt(2 d), 7 for 23: there gamma is some
thousandths, and a length is about 10. So kernel methods have grids of their own (`SCALED`) for
features without units, whose targets have mean 0 and deviation 1 over the training rows as well;
the tables name the grid that was searched.
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

Settings = dict[str, Any]
"""Values by setting."""

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

SCALED_OPTIMA: dict[str, Settings] = {
    "svm": {"C": 100.0, "epsilon": 0.01, "gamma": 0.01, "kernel": "rbf"},
    "gaussian-process": {"alpha": 1e-5, "kernel__length_scale": 10.0, "optimizer": None},
    "kernel-ridge": {"alpha": 1e-4, "gamma": 3e-3, "kernel": "rbf"},
}
"""Points of these grids that serve where nothing was searched."""

TABLE_2 = "Table 2"  # name of the paper's grids in results and tables


def space_of(model: str, features: str) -> tuple[str, Space, Settings]:
    """Return the name in tables, and the values to try, of a model for a feature set.

    The settings that serve where nothing was searched come third: a point of the values.
    """
    if model == POPULATION.name:
        return "none: chooses by itself", {}, {}
    if model in SCALED and (features == SCENE or chosen(features).scaled):
        return "for features without units", SCALED[model], SCALED_OPTIMA[model]
    return TABLE_2, SPACES[model], OPTIMA[model]


def baseline(model: str, features: str) -> Settings:
    """Return settings of a baseline that differ from its library's and the paper's.

    The paper's Gaussian process has a kernel of length 1, over which standardised rows are not
    correlated at all (R2 below 0). There it gets the length that gamma = 1 / d means, which is
    scikit-learn's choice for the same kernel in kernel ridge.
    """
    if model == "gaussian-process" and chosen(features).scaled:
        return {"kernel__length_scale": round(sqrt(len(SETS[features].columns) / 2), 4)}
    return {}


LIBRARY: dict[str, Settings] = {
    "gaussian-process": {"kernel": None, "optimizer": "fmin_l_bfgs_b"}
}
"""Settings on top of a baseline that make it its library's own, where it is not.

scikit-learn's Gaussian process fits amplitude and length of its kernel.
"""

LIBRARY_ROWS = 1000
"""Training rows of such a model at most: each step of its optimiser takes their third power."""

LEAST_JUDGED = 10
"""Candidates that have to be judged over five folds of all rows before a search has a winner."""

BEYOND = 3  # values that a search tries at most beyond each end of a setting's values
SMALLEST = {"min_samples_split": 2}  # smallest whole numbers of settings; 1 of all others


def reach(name: str, values: list[Any]) -> list[Any]:
    """Return the values of a setting with those that a search may try beyond, in ascending order.

    Numbers go on in the ratio of the last two. Nothing lies beyond zero, and nothing beyond fewer
    than three numbers, or values that are no numbers.
    """
    if len(values) < 3 or not all(isinstance(value, int | float) for value in values):
        return values
    chain = sorted(values)
    for upwards in (False, True) * BEYOND:
        near, end = chain[-2:] if upwards else chain[1::-1]
        if near <= 0 or end <= 0:
            continue
        further = float(f"{end * end / near:.2g}")
        if isinstance(end, int):
            further = max(int(further), SMALLEST.get(name, 1))
        if further not in chain:
            chain.insert(len(chain) * upwards, further)
    return chain


class Grid:
    """A grid of candidates of a model: those of them that differ, and what one fit serves.

    Boosting whose first trees are no model of their own (DART, linear, stopped early) must not be
    among them: one fit serves all numbers of trees. The number of inputs decides which
    `max_features` are the same: the square root of 23 and its logarithm are both 4.

    Attributes
    ----------
    candidates : list of Settings
        In the order of scikit-learn's ParameterGrid, then those beyond the ends of the space.
    differing : dict
        Canonical settings by name (`key`), in the order of their first candidate.
    first : dict
        These candidates by the same names.
    families : list of tuple of str
        Names of those that one fit serves.
    """

    def __init__(
        self, model: Model, space: Space, inputs: int, candidates: Iterable[Settings] = ()
    ) -> None:
        from sklearn.model_selection import ParameterGrid

        self.model, self.space, self.inputs = model, space, inputs
        self.candidates: list[Settings] = [*(candidates or ParameterGrid(space))]
        self.differing: dict[str, Settings] = {}
        self.first: dict[str, Settings] = {}
        families: dict[str, list[str]] = {}
        for candidate in self.candidates:
            settings = canonical_settings(model, candidate, inputs)
            name = key(settings)
            if name not in self.first:
                self.first[name], self.differing[name] = candidate, settings
                family = key({k: v for k, v in settings.items() if k != model.shared})
                families.setdefault(family, []).append(name)
        self.families = [tuple(names) for names in families.values()]

    def name_of(self, settings: Settings) -> str:
        """Return the name of the canonical settings of others, "" if the grid lacks them."""
        name = key(canonical_settings(self.model, settings, self.inputs))
        return name if name in self.differing else ""

    def ends(self, settings: Settings) -> Settings:
        """Return the next value of each setting with which a candidate lies at an end of it all."""
        found = {}
        for name in (
            settings.keys() & canonical_settings(self.model, settings, self.inputs).keys()
        ):
            chain = reach(name, self.space[name])
            place = chain.index(settings[name])
            for value in (
                *chain[max(place - 1, 0) : place],
                *chain[place + 1 : place + 2],
            ):
                if not any(candidate[name] == value for candidate in self.candidates):
                    found[name] = value
        return dict(sorted(found.items()))

    def extended(self, winner: Settings) -> "Grid":
        """Return the grid with further candidates where a winner lies at an end.

        They have the winner's settings but for the one that goes on, and all values that one fit
        serves.
        """
        shared, further = self.model.shared, [*self.candidates]
        for name, value in self.ends(winner).items():
            next_one = {**winner, name: value}
            served = self.space[shared] if shared in winner and shared != name else []
            further += [{**next_one, shared: each} for each in served] or [next_one]
        return Grid(self.model, self.space, self.inputs, further)


@dataclass(frozen=True)
class Task:
    """One fit: the candidates that it serves, and the fold that it leaves out."""

    model: str
    candidates: dict[
        str, Settings
    ]  # by name; differ only in the setting that one fit serves
    fold: int  # left out of the training, and predicted
    rows: int  # for training at most
    baseline: bool = (
        False  # True for the baseline, without the settings that candidates share
    )


def canonical_settings(
    model: Model, candidate: Mapping[str, Any], inputs: int
) -> Settings:
    """Reduce a candidate to the settings that make a difference, for data of some inputs."""
    name, kernel = model.name, candidate.get("kernel")
    tree = name in {"decision-tree", "random-forest"}
    ignored = {
        "criterion": name == "gradient-boost",  # has no effect any more
        "cache_size": name == "svm",  # memory, not mathematics
        "degree": name == "svm" and kernel != "poly",
        "gamma": kernel == "linear",
        "learning_rate": name == "mlp" and candidate.get("solver") != "sgd",
    }
    settings = {each: value for each, value in candidate.items() if not ignored.get(each)}
    if name == "mlp":  # the name says the length of the training
        settings = {**model.tuned, **settings}
    leaf, split = (
        settings.get("min_samples_leaf", 1),
        settings.get("min_samples_split", 2),
    )
    if tree and isinstance(leaf, int) and isinstance(split, int):
        # A node that is split needs the samples of two leaves: scikit-learn raises the limit.
        settings["min_samples_split"] = max(split, 2 * leaf)
    if (
        tree and settings.get("criterion") == "friedman_mse"
    ):  # the same for a single target
        settings["criterion"] = "squared_error"
    if "max_features" in settings:  # the number of inputs that scikit-learn makes of it
        wanted = settings["max_features"]
        named = {None: inputs, "sqrt": int(sqrt(inputs)), "log2": int(log2(inputs))}
        share = int(wanted * inputs) if isinstance(wanted, float) else wanted
        settings["max_features"] = max(1, named.get(wanted, share))
    return settings


def key(settings: Mapping[str, Any], *, baseline: bool = False) -> str:
    """Write settings as one line of text; no candidate of a grid has that of the baseline."""
    text = ", ".join(f"{name}={settings[name]!r}" for name in sorted(settings))
    return ": ".join(filter(None, ["baseline", text])) if baseline else text


def expected_work(task: Task) -> float:
    """Guess the relative cost of a task of one model, for the order of tasks and the time left."""
    served = [*task.candidates.values()]
    common = served[0]

    def most(name: str) -> float:
        numbers = [
            each[name] for each in served if isinstance(each.get(name), int | float)
        ]
        return float(max(map(abs, numbers), default=1.0))

    work = task.rows * most("n_estimators") * most("max_features") * sqrt(most("C"))
    for name in ("max_depth", "estimator__max_depth"):
        work *= min(most(name), 20)
    work *= 5 if common.get("criterion") == "absolute_error" else 1
    work *= (
        15 if common.get("loss") == "huber" else 1
    )  # boosting evaluates it leaf by leaf
    if "hidden_layer_sizes" in common:
        sizes = common["hidden_layer_sizes"]
        work *= sum(a * b for a, b in pairwise(sizes)) + 23 * sizes[0]
        work *= (
            20 if common.get("solver") == "lbfgs" else 1
        )  # others end by themselves long before
    if task.model == "kernel-ridge":
        work *= len(served) if common.get("kernel") == "rbf" else 0.01
    return work
