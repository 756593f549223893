"""The models of the server: the functions of `asperity.functions` as clients of UM-Bridge ask them.

A model takes vectors of numbers, and answers one point in each call.
"""

import warnings
from itertools import chain
from pathlib import Path
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field, FiniteFloat

from asperity.functions import (
    SURFACES,
    Function,
    OutsideTraining,
    SceneFunction,
    SurrogateFunction,
)
from gen.quantities import UNLOADING, USUAL
from gen.runtime.errors import InputError
from gen.runtime.files import kind_of
from gen.scene import Scene, load, preset_names

Vectors = list[list[FiniteFloat]]
"""Input of a model: its numbers in vectors, whose sizes the model states."""

Answer = list[list[float | None]]
"""Output of a model: vectors of numbers. None, which is null in JSON, is a number that does not
hold."""


class Configuration(BaseModel):
    """The settings that a client may send with its input."""

    model_config = ConfigDict(extra="forbid", strict=True)

    # Index of the surface, which decides its random numbers.
    surface: int = Field(default=0, ge=0, lt=SURFACES)
    seed: int | None = None  # of the surfaces; None for that of the scene
    # Nodes along both axes, or along x and y; None for those of the scene.
    nodes: int | Annotated[list[int], Field(min_length=2, max_length=2)] | None = None
    # True for the solver's stiffness, a fourth output; surrogates refuse it.
    stiffness: bool = False
    # True for the ends of a surrogate's intervals; the solver, which has none, ignores it.
    interval: bool = True


def _outputs(function: Function, vectors: Vectors, config: Configuration) -> list[float]:
    """Return the outputs of a function at one point, with the client's settings.

    The vectors have the sizes `Inputs.sizes` of the function. InputError and `Unsolved` of the
    function pass through.
    """
    # Joined, the vectors are a number for each of the names.
    values = chain.from_iterable(vectors)
    numbers: dict[str, Any] = dict(zip(function.names, values, strict=True))
    outputs = function(
        surface=config.surface, nodes=config.nodes, seed=config.seed, **numbers
    )
    return [float(output) for output in outputs]


class SolverModel:
    """The solver: parameters of a surface and a load in; area [%], force [uN], Delta [um] out.

    On request the stiffness of the contact [N/m] is a fourth output. It takes one more linear
    solve.

    Parameters
    ----------
    scene : Scene
        The scene whose surfaces are solved.
    name : str
        Name of the model for clients.
    """

    remark = ""  # text for the user when the model is served; "" for none

    def __init__(self, scene: Scene, name: str) -> None:
        self.name = name
        self._usual = SceneFunction(scene)
        self._with_stiffness = SceneFunction(scene, (*USUAL, UNLOADING.name))
        self.input_sizes = self._usual.inputs.sizes

    def output_sizes(self, config: Configuration) -> list[int]:
        """Return the sizes of the output vectors, which have one number each.

        Parameters
        ----------
        config : Configuration
            Settings of the client.

        Returns
        -------
        list of int
            A 1 for each output.
        """
        return [1] * len(self._function(config).outputs)

    def evaluate(self, vectors: Vectors, config: Configuration) -> Answer:
        """Solve one contact problem.

        Parameters
        ----------
        vectors : list of list of float
            Numbers in vectors of `input_sizes`.
        config : Configuration
            Settings of the client.

        Returns
        -------
        list of list of float
            The outputs, one in each vector.

        Raises
        ------
        InputError
            If a number or a setting is not allowed.
        asperity.functions.Unsolved
            If the contact has no solution, or the solver did not converge.
        """
        outputs = _outputs(self._function(config), vectors, config)
        return [[output] for output in outputs]

    def _function(self, config: Configuration) -> SceneFunction:
        """Return the function with the outputs that a client wants."""
        if config.stiffness:
            return self._with_stiffness
        return self._usual


class SurrogateModel:
    """A surrogate: the inputs of the solver in; for each target one vector out.

    A vector has four numbers: the predicted value, the low and the high end of its interval, and a
    flag, which is 1 if the question is inside the training of the surrogate, else 0. Intervals have
    the level 0.9, or the largest level below it that the surrogate reaches. Outside the training no
    interval holds, and both ends are None. On request a vector has only two numbers, the value and
    the flag.

    Parameters
    ----------
    path : Path
        File of the surrogate, whose name without suffix is that of the model for clients.

    Raises
    ------
    InputError
        If the file is no surrogate, or one whose surfaces come from a function.
    """

    def __init__(self, path: Path) -> None:
        from learn.surrogate.level import level_note

        self.name = path.stem
        targets = SurrogateFunction(path).outputs
        values_and_ends: list[str] = []
        for target in targets:
            values_and_ends += [target, f"{target}_low", f"{target}_high"]
        self._targets = targets
        self._with_ends = SurrogateFunction(path, (*values_and_ends, "inside"))
        self._without_ends = SurrogateFunction(path, (*targets, "inside"))
        self.input_sizes = self._with_ends.inputs.sizes
        self.remark = level_note(
            self._with_ends.surrogate, self._with_ends.level, requested=None
        )

    def output_sizes(self, config: Configuration) -> list[int]:
        """Return the sizes of the output vectors, one for each target.

        Parameters
        ----------
        config : Configuration
            Settings of the client.

        Returns
        -------
        list of int
            4 for each target with its interval, or 2 without.
        """
        size = 2
        if config.interval:
            size = 4
        return [size] * len(self._targets)

    def evaluate(self, vectors: Vectors, config: Configuration) -> Answer:
        """Predict one contact problem.

        Parameters
        ----------
        vectors : list of list of float
            Numbers in vectors of `input_sizes`.
        config : Configuration
            Settings of the client.

        Returns
        -------
        list of list of float or None
            For each target: value, ends of the interval if the client wants them, and flag.

        Raises
        ------
        InputError
            If a number or a setting is not allowed, or the client wants a stiffness.
        """
        if config.stiffness:
            raise InputError("config.stiffness: a surrogate predicts its targets alone")
        function = self._with_ends if config.interval else self._without_ends
        with warnings.catch_warnings():
            # The flag tells clients that a point is outside the training.
            warnings.simplefilter("ignore", OutsideTraining)
            *numbers, inside = _outputs(function, vectors, config)
        if not config.interval:
            return [[value, inside] for value in numbers]
        answer: Answer = []
        # Value, low end and high end of each target follow each other.
        triples = zip(numbers[::3], numbers[1::3], numbers[2::3], strict=True)
        for value, low, high in triples:
            if inside:
                answer.append([value, low, high, inside])
            else:
                answer.append([value, None, None, inside])
        return answer


Model = SolverModel | SurrogateModel
"""A model that clients ask by its name: `input_sizes`, `output_sizes` and `evaluate`."""


def model_of(source: str) -> Model:
    """Make the model of a scene or of a surrogate.

    Parameters
    ----------
    source : str
        Name of a shipped scene, or path of a scene or a surrogate.

    Returns
    -------
    SolverModel or SurrogateModel
        The model, named as the shipped scene or as the file without its suffix.

    Raises
    ------
    InputError
        If the source is neither a scene nor a surrogate, or cannot be served.
    """
    if source in preset_names():
        return SolverModel(load(source), source)
    path = Path(source)
    if path.is_file() and kind_of(path) == "surrogate":
        return SurrogateModel(path)
    return SolverModel(load(source), path.stem)
