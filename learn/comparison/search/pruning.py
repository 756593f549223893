"""Reduce a grid to the candidates that differ, and group those that share one fit.

A candidate's canonical settings leave out settings that its kernel or solver ignores, and give one
name to values that lead to the same computation. The reduction is exact:
`tests/learn/comparison/search/test_grid_search.py` compares scores with scikit-learn's own grid
search.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from math import log2, prod, sqrt
from typing import Any

from learn.comparison.search.spaces import Space
from learn.comparison.search.staged import require_served
from learn.models import MODELS, Model

Settings = dict[str, Any]


@dataclass(frozen=True)
class Grid:
    """A grid of candidates, and those of them that differ.

    Attributes
    ----------
    candidates : tuple of dict
        All points, in the order of scikit-learn's ParameterGrid.
    canonical : tuple of int
        Number of the canonical settings of each candidate.
    differing : tuple of dict
        The canonical settings, in the order of their first candidate.
    families : tuple of tuple of int
        Numbers of the canonical settings that one fit serves.
    """

    candidates: tuple[Settings, ...]
    canonical: tuple[int, ...]
    differing: tuple[Settings, ...]
    families: tuple[tuple[int, ...], ...]

    @property
    def nominal(self) -> int:
        """Number of points of the grid."""
        return len(self.candidates)

    @cached_property
    def family_of(self) -> dict[int, int]:
        """The family of every differing candidate, by its number."""
        return {number: place for place, family in enumerate(self.families) for number in family}

    def served_by(self, family: int) -> tuple[Settings, ...]:
        """Return the canonical settings that one fit of a family serves."""
        return tuple(self.differing[number] for number in sorted(self.families[family]))

    def number_of(self, settings: Settings) -> int | None:
        """Return the number of canonical settings, None if the grid lacks them."""
        names = [key(each) for each in self.differing]
        return names.index(key(settings)) if key(settings) in names else None

    def first(self, number: int) -> Settings:
        """Return the first candidate with these canonical settings."""
        return self.candidates[self.canonical.index(number)]


def points(space: Space) -> list[Settings]:
    """List all points of a space in the order of scikit-learn's ParameterGrid."""
    names = sorted(space)
    return [dict(zip(names, values, strict=True)) for values in product(*map(space.get, names))]  # type: ignore[arg-type]


def size(space: Space) -> int:
    """Return the number of points of a space."""
    return prod(map(len, space.values()))


def grid(model: Model, space: Space, inputs: int) -> Grid:
    """Find the candidates of a grid that differ.

    Parameters
    ----------
    model : Model
        The model.
    space : dict
        Values to try, by setting.
    inputs : int
        Number of inputs of the data: it decides which of `max_features` are the same. The square
        root of 23 and its logarithm are both 4.

    Raises
    ------
    InputError
        If one fit does not serve all numbers of trees of the space.
    """
    require_served(model, space)
    candidates = points(space)
    numbers: dict[str, int] = {}
    differing: list[Settings] = []
    canonical = []
    shared: dict[str, list[int]] = {}
    for candidate in candidates:
        settings = canonical_settings(model, candidate, inputs)
        name = key(settings)
        if name not in numbers:
            numbers[name] = len(differing)
            family = {k: v for k, v in settings.items() if k != shared_fit(model)}
            shared.setdefault(key(family), []).append(len(differing))
            differing.append(settings)
        canonical.append(numbers[name])
    families = tuple(tuple(family) for family in shared.values())
    return Grid(tuple(candidates), tuple(canonical), tuple(differing), families)


def shared_fit(model: Model) -> str:
    """Return the name of the setting whose values share one fit, "" if there is none."""
    return "alpha" if model.name == "kernel-ridge" else model.staged


def canonical_settings(model: Model, candidate: Mapping[str, Any], inputs: int) -> Settings:
    """Reduce a candidate to the settings that make a difference.

    Parameters
    ----------
    model : Model
        The model.
    candidate : mapping
        Values by setting.
    inputs : int
        Number of inputs of the data.

    Returns
    -------
    dict
        Settings that the estimator accepts and that give the same fit.
    """
    return RULES.get(model.name, _unchanged)(dict(candidate), inputs)


def key(settings: Mapping[str, Any]) -> str:
    """Write settings as one line of text, the same for the same settings."""
    return ", ".join(f"{name}={settings[name]!r}" for name in sorted(settings))


def baseline_key(settings: Mapping[str, Any]) -> str:
    """Write the settings of the baseline as one line of text, which no candidate of a grid has."""
    return f"baseline: {key(settings)}" if settings else "baseline"


def _unchanged(settings: Settings, inputs: int) -> Settings:
    return settings


def _trees(settings: Settings, inputs: int) -> Settings:
    """Reduce the settings of decision trees and forests."""
    settings = _counted_inputs(settings, inputs)
    leaf, split = settings.get("min_samples_leaf", 1), settings.get("min_samples_split", 2)
    if isinstance(leaf, int) and isinstance(split, int):
        # A node that is split needs the samples of two leaves: scikit-learn raises the limit.
        settings["min_samples_split"] = max(split, 2 * leaf)
    if settings.get("criterion") == "friedman_mse":  # the same for a single target
        settings["criterion"] = "squared_error"
    return settings


def _gradient_boost(settings: Settings, inputs: int) -> Settings:
    settings.pop("criterion", None)  # has no effect any more
    return _counted_inputs(settings, inputs)


def _counted_inputs(settings: Settings, inputs: int) -> Settings:
    """Give `max_features` as the number of inputs that scikit-learn makes of it."""
    if "max_features" in settings:
        wanted = settings["max_features"]
        if wanted is None:
            number = inputs
        elif wanted == "sqrt":
            number = max(1, int(sqrt(inputs)))
        elif wanted == "log2":
            number = max(1, int(log2(inputs)))
        elif isinstance(wanted, float):
            number = max(1, int(wanted * inputs))
        else:
            number = wanted
        settings["max_features"] = number
    return settings


def _support_vectors(settings: Settings, inputs: int) -> Settings:
    settings.pop("cache_size", None)  # memory, not mathematics
    kernel = settings.get("kernel", "rbf")
    if kernel != "poly":
        settings.pop("degree", None)
    if kernel == "linear":
        settings.pop("gamma", None)
    return settings


def _kernel_ridge(settings: Settings, inputs: int) -> Settings:
    if settings.get("kernel", "linear") == "linear":
        settings.pop("gamma", None)
    return settings


def _perceptron(settings: Settings, inputs: int) -> Settings:
    """Reduce the settings of perceptrons, and name the length of the training.

    Fits of folders that are older, which ended after 200 epochs, are other candidates.
    """
    settings = {**MODELS["mlp"].tuned, **settings}
    if settings.get("solver", "adam") != "sgd":
        settings.pop("learning_rate", None)
    return settings


RULES: dict[str, Callable[[Settings, int], Settings]] = {
    "decision-tree": _trees,
    "random-forest": _trees,
    "gradient-boost": _gradient_boost,
    "svm": _support_vectors,
    "kernel-ridge": _kernel_ridge,
    "mlp": _perceptron,
}
"""Reductions by model; AdaBoost, XGBoost and the Gaussian process ignore no setting."""
