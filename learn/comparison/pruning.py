"""Which candidates of a grid are the same model, and which share one fit.

A candidate's canonical settings are what the library makes of it: what the kernel or the solver
ignores is left out, and values that lead to the same computation get the same name. All of it is
exact; `tests/learn/test_search.py` compares scores with scikit-learn's own grid search.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import product
from math import log2, prod, sqrt
from typing import Any

from learn.comparison.spaces import Space
from learn.models import Model

Settings = dict[str, Any]


@dataclass(frozen=True)
class Grid:
    """A grid of candidates and what is left of it.

    Attributes
    ----------
    candidates : all points, in the order of scikit-learn's ParameterGrid
    canonical : number of the canonical settings of each candidate
    differing : the canonical settings, in the order of their first candidate
    families : numbers of canonical settings that one fit serves
    """

    candidates: tuple[Settings, ...]
    canonical: tuple[int, ...]
    differing: tuple[Settings, ...]
    families: tuple[tuple[int, ...], ...]

    @property
    def nominal(self) -> int:
        """Number of points of the grid."""
        return len(self.candidates)

    def served_by(self, family: int) -> tuple[Settings, ...]:
        """Return the canonical settings that one fit of a family serves."""
        return tuple(self.differing[number] for number in sorted(self.families[family]))

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
    """Find what differs in a grid.

    Parameters
    ----------
    model : from `learn.models`
    space : values to try, by setting
    inputs : number of inputs of the data: the square root of 23 and its logarithm are both 4
    """
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
    """Name the setting all of whose values one fit serves, "" if there is none."""
    return "alpha" if model.name == "kernel-ridge" else model.staged


def canonical_settings(model: Model, candidate: Mapping[str, Any], inputs: int) -> Settings:
    """Reduce a candidate to what makes a difference.

    Parameters
    ----------
    model : from `learn.models`
    candidate : settings by name
    inputs : number of inputs of the data

    Returns
    -------
    Settings that the estimator accepts and that give the same fit
    """
    return RULES.get(model.name, _unchanged)(dict(candidate), inputs)


def key(settings: Mapping[str, Any]) -> str:
    """Write settings as one line of text, the same for the same settings."""
    return ", ".join(f"{name}={settings[name]!r}" for name in sorted(settings))


def _unchanged(settings: Settings, inputs: int) -> Settings:
    return settings


def _trees(settings: Settings, inputs: int) -> Settings:
    """Decision trees and forests."""
    settings = _counted_inputs(settings, inputs)
    leaf, split = settings.get("min_samples_leaf", 1), settings.get("min_samples_split", 2)
    if isinstance(leaf, int) and isinstance(split, int):
        # Two leaves of this size need as many samples; scikit-learn raises the limit itself.
        settings["min_samples_split"] = max(split, 2 * leaf)
    if settings.get("criterion") == "friedman_mse":  # for one target, another name
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
"""How each model's settings are reduced; AdaBoost, XGBoost and the Gaussian process ignore none."""
