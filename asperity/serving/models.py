"""The models of the server: functions of the solver and of surrogates, of vectors of UM-Bridge."""

import warnings
from itertools import chain
from pathlib import Path
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field, FiniteFloat

from asperity.functions import (
    Function,
    OutsideTraining,
    SceneFunction,
    SurrogateFunction,
)
from gen.quantities import UNLOADING, USUAL
from gen.runtime.errors import InputError
from gen.runtime.files import kind_of
from gen.scene import Scene, load, preset_names

Vectors = list[list[FiniteFloat]]  # input of a model: vectors, each of one size
Answer = list[
    list[float | None]
]  # its output; None, which is null in JSON, for what does not hold


class Configuration(BaseModel):
    """Settings that a client may send with its input."""

    model_config = ConfigDict(extra="forbid", strict=True)

    surface: int = Field(
        default=0, ge=0, lt=2**32
    )  # its index, which decides its random numbers
    seed: int | None = None  # of the scene
    nodes: int | Annotated[list[int], Field(min_length=2, max_length=2)] | None = (
        None  # x and y
    )
    stiffness: bool = False  # whether the solver tells it too, as a fourth output
    interval: bool = True  # whether a surrogate tells the ends of its intervals


def _answered(function: Function, vectors: Vectors, config: Configuration) -> list[float]:
    """Return the outputs of a function, with the client's settings."""
    numbers: dict[str, Any] = dict(
        zip(function.names, chain.from_iterable(vectors), strict=True)
    )
    outputs = function(
        surface=config.surface, nodes=config.nodes, seed=config.seed, **numbers
    )
    return [float(output) for output in outputs]


class SolverModel:
    """The solver: parameters of a surface and a load in; area [%], force [uN], Delta [um] out.

    On request the stiffness of the contact [N/m] is a fourth output; it takes one more linear
    solve.
    """

    remark = ""  # what a user is told of the model when it is served

    def __init__(self, scene: Scene, name: str) -> None:
        self.name = name
        self._functions = [
            SceneFunction(scene),
            SceneFunction(scene, (*USUAL, UNLOADING.name)),
        ]
        self.input_sizes = self._functions[0].inputs.sizes

    def output_sizes(self, config: Configuration) -> list[int]:
        """Return the sizes of the output vectors, one number each."""
        return [1] * len(self._functions[config.stiffness].outputs)

    def evaluate(self, vectors: Vectors, config: Configuration) -> Answer:
        """Solve one contact problem."""
        return [
            [number]
            for number in _answered(self._functions[config.stiffness], vectors, config)
        ]


class SurrogateModel:
    """A surrogate: the same inputs; value, both ends of the interval, and 1 inside the training.

    Every target is a vector of four numbers: predicted value, low and high end of its interval, and
    1 where the question lies inside what the surrogate was trained on, else 0. Intervals are of
    90 %, or the largest level below that the surrogate reaches. None holds outside: both ends are
    None there. On request a vector has two numbers, value and flag.
    """

    def __init__(self, path: Path) -> None:
        from learn.surrogate.level import level_note

        self.name = path.stem
        targets = SurrogateFunction(path).outputs
        ends = [f"{target}{end}" for target in targets for end in ("", "_low", "_high")]
        self._targets = targets
        with_ends = SurrogateFunction(path, (*ends, "inside"))
        self._functions = [SurrogateFunction(path, (*targets, "inside")), with_ends]
        self.input_sizes = with_ends.inputs.sizes
        self.remark = level_note(with_ends.surrogate, with_ends.level, None)

    def output_sizes(self, config: Configuration) -> list[int]:
        """Return the sizes of the output vectors: four numbers each, or two."""
        return [4 if config.interval else 2] * len(self._targets)

    def evaluate(self, vectors: Vectors, config: Configuration) -> Answer:
        """Predict one contact problem."""
        if config.stiffness:
            raise InputError("config.stiffness: a surrogate predicts its targets alone")
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", OutsideTraining)  # the flag tells clients
            *numbers, inside = _answered(
                self._functions[config.interval], vectors, config
            )
        if not config.interval:
            return [[value, inside] for value in numbers]
        answer: Answer = []
        for value, *ends in zip(numbers[::3], numbers[1::3], numbers[2::3], strict=True):
            answer.append([value, *(end if inside else None for end in ends), inside])
        return answer


Model = SolverModel | SurrogateModel
"""A function of vectors, of given sizes, that answers a client who knows it by its name."""


def model_of(source: str) -> Model:
    """Make the model of a shipped scene by its name, or of the file of a scene or a surrogate.

    Raise InputError if it is neither, or cannot be served.
    """
    path = Path(source)
    if source not in preset_names() and path.is_file() and kind_of(path) == "surrogate":
        return SurrogateModel(path)
    return SolverModel(load(source), source if source in preset_names() else path.stem)
