"""The models of the server: functions of the solver and of surrogates, of vectors of UM-Bridge."""

from itertools import chain
from pathlib import Path
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field, FiniteFloat

from asperity.functions import SceneFunction, SurrogateFunction, Where
from gen.quantities import QUANTITIES, USUAL
from gen.runtime.errors import InputError
from gen.runtime.files import kind_of
from gen.scene import Scene, load, preset_names

STIFFNESS = QUANTITIES["stiffness"]  # of unloading, a fourth output on request

Vectors = list[list[FiniteFloat]]  # input or output of a model: vectors, each of one size


class Configuration(BaseModel):
    """Settings that a client may send with its input."""

    model_config = ConfigDict(extra="forbid", strict=True)

    surface: int = Field(default=0, ge=0, lt=2**32)  # its index, which decides its random numbers
    seed: int | None = None  # of the scene
    nodes: int | Annotated[list[int], Field(min_length=2, max_length=2)] | None = None  # x and y
    stiffness: bool = False  # whether the solver tells it too, as a fourth output

    @property
    def where(self) -> Where:
        """The surface that is asked for."""
        return Where(self.surface, self.nodes, self.seed)


class SolverModel:
    """The solver: parameters of a surface and a load in; area [%], force [uN], Delta [um] out.

    On request the stiffness of the contact [N/m] is a fourth output; it takes one more linear
    solve.
    """

    remark = ""  # what a user is told of the model when it is served

    def __init__(self, scene: Scene, name: str) -> None:
        self.name = name
        self._functions = [SceneFunction(scene), SceneFunction(scene, (*USUAL, STIFFNESS.name))]
        self.input_sizes = self._functions[0].inputs.sizes

    def output_sizes(self, config: Configuration) -> list[int]:
        """Return the sizes of the output vectors, one number each."""
        return [1] * len(self._functions[config.stiffness].outputs)

    def evaluate(self, vectors: Vectors, config: Configuration) -> Vectors:
        """Solve one contact problem."""
        function = self._functions[config.stiffness]
        numbers = dict(zip(function.names, chain.from_iterable(vectors), strict=True))
        return [[number] for number in function.answer(numbers, config.where)]


class SurrogateModel:
    """A surrogate: the same inputs; value, both ends of the interval, and 1 inside the training.

    Every target is a vector of four numbers: predicted value, low and high end of its interval, and
    1 where the question lies inside what the surrogate was trained on, else 0. Intervals are of
    90 %, or the largest level below that the surrogate reaches.
    """

    def __init__(self, path: Path) -> None:
        from learn.surrogate.interval import level_note

        self.name, self._function = path.stem, SurrogateFunction(path)
        self.input_sizes = self._function.inputs.sizes
        self.remark = level_note(self._function.surrogate, self._function.level, None)

    def output_sizes(self, config: Configuration) -> list[int]:
        """Return the sizes of the output vectors, four numbers each."""
        return [4] * len(self._function.outputs)

    def evaluate(self, vectors: Vectors, config: Configuration) -> Vectors:
        """Predict one contact problem."""
        if config.stiffness:
            raise InputError("config.stiffness: a surrogate predicts its targets alone")
        numbers = dict(zip(self._function.names, chain.from_iterable(vectors), strict=True))
        return self._function.predicted(numbers, config.where)


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
