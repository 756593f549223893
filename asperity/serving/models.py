"""The models of the server, the solver and surrogates, and the questions that clients ask them."""

import math
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path
from typing import Annotated, Protocol

from pydantic import BaseModel, ConfigDict, Field, FiniteFloat

import bem
from gen.arrays import Heights
from gen.distribution import is_drawn
from gen.generation.functions import completed
from gen.generation.sample import load_of, solve_contact, surface_numbered
from gen.runtime.errors import InputError
from gen.runtime.files import kind_of
from gen.scene import PythonSurface, ScanSurface, Scene, load, preset_names

AREA_FORCE_DELTA = 3  # number of the solver's outputs: area [%], force [uN] and Delta [um]
Vectors = list[list[FiniteFloat]]  # input or output of a model: vectors, each of one size


class Configuration(BaseModel):
    """Settings that a client may send with its input."""

    model_config = ConfigDict(extra="forbid", strict=True)

    surface: int = Field(default=0, ge=0, lt=2**32)  # its index, which decides its random numbers
    seed: int | None = None  # of the scene
    nodes: int | Annotated[list[int], Field(min_length=2, max_length=2)] | None = None  # x and y
    stiffness: bool = False  # whether the solver tells it too, as a fourth output


@dataclass(frozen=True)
class Inputs:
    """The inputs of a model: drawn parameters of the surface, load and hardness."""

    parameters: tuple[str, ...]  # the first vector if there are any
    load: str  # its quantity, see `gen.scene.load`; a vector of its own
    hardness: bool  # whether it is an input, the last vector

    @classmethod
    def of(cls, scene: Scene) -> "Inputs":
        """Return the inputs that a scene leaves open: drawn parameters, load, drawn hardness."""
        drawn = (name for name, given in scene.drawn_parameters.items() if is_drawn(given))
        return cls(tuple(drawn), scene.quantity, scene.contact.draws_hardness)

    @property
    def sizes(self) -> list[int]:
        """Sizes of the vectors."""
        surface = [len(self.parameters)] if self.parameters else []
        return [*surface, 1, *([1] if self.hardness else [])]


@dataclass(frozen=True)
class Question:
    """One contact problem that a client asks for."""

    scene: Scene  # with the client's parameters and configuration
    heights: Heights  # of its surface [um], (nx, ny)
    load: dict[str, float]  # "delta" [um], "pressure" [MPa] or "force" [uN]
    hardness: float | None  # [MPa], if it is an input


def question(
    scene: Scene, inputs: Inputs, vectors: Vectors, configuration: Configuration
) -> Question:
    """Turn vectors of these inputs' sizes and the client's settings into a contact problem.

    Raise InputError if a value is not allowed, with its name.
    """
    drawn = dict(zip(inputs.parameters, vectors[0], strict=True)) if inputs.parameters else {}
    hardness = vectors[-1][0] if inputs.hardness else None
    load = vectors[-2 if inputs.hardness else -1][0]
    for name, value in ((inputs.load, load), ("hardness", hardness)):
        if value is not None and not value > 0:
            raise InputError(f"input: {name} = {value:g}; allowed: a number above 0")
    if isinstance(scene.surface, ScanSurface) and configuration.nodes is not None:
        raise InputError("config.nodes: the surfaces are windows of maps, which have the scene's")
    asked = scene.with_parameters(drawn, nodes=configuration.nodes, seed=configuration.seed)
    heights = surface_numbered(asked, configuration.surface)
    given = load_of(asked, heights, load) if inputs.load == asked.quantity else {inputs.load: load}
    return Question(asked, heights, given, hardness)


class Unsolved(Exception):
    """A contact problem without a solution, or one that did not converge."""


class Model(Protocol):
    """A function of vectors, of the given sizes, that answers a client who knows it by its name."""

    name: str
    input_sizes: list[int]

    def output_sizes(self, config: Configuration) -> list[int]:
        """Return the sizes of the output vectors."""

    def evaluate(self, vectors: Vectors, config: Configuration) -> Vectors:
        """Return the outputs of inputs that have the right sizes."""


class SolverModel:
    """The solver: parameters of a surface and a load in; area [%], force [uN], Delta [um] out.

    On request the stiffness of the contact [N/m] is a fourth output; it takes one more linear
    solve.
    """

    def __init__(self, scene: Scene, name: str) -> None:
        # As a surrogate knows it: parameters of a scene's own in alphabetical order.
        self.scene, self.name = Scene.from_text(completed(scene).text()), name
        self._inputs = Inputs.of(self.scene)
        self.input_sizes = self._inputs.sizes

    def output_sizes(self, config: Configuration) -> list[int]:
        """Return the sizes of the output vectors, one number each."""
        return [1] * (AREA_FORCE_DELTA + config.stiffness)

    def evaluate(self, vectors: Vectors, config: Configuration) -> Vectors:
        """Solve one contact problem."""
        asked = question(self.scene, self._inputs, vectors, config)
        try:
            contact = solve_contact(
                asked.scene, asked.heights, hardness=asked.hardness, **asked.load
            )
            stiffness = [[contact.stiffness]] if config.stiffness else []
        except bem.OutOfRange as error:
            raise InputError(str(error)) from None
        except (bem.NoSolution, bem.NotConverged, ArithmeticError) as error:
            raise Unsolved(str(error)) from None
        except MemoryError:
            raise Unsolved("memory has run out: give fewer nodes") from None
        return [[contact.area_percent], [contact.force], [contact.delta], *stiffness]


class SurrogateModel:
    """A surrogate: the same inputs; value, both ends of the interval, and 1 inside the training.

    Every target is a vector of four numbers: predicted value, low and high end of its 90 %
    interval, and 1 where the question lies inside what the surrogate was trained on, else 0. Where
    the scene of the training gives pressures or forces, the load is still Delta [um], unless the
    surrogate has learnt the scene's own numbers: then it is theirs, and no surface is made.
    """

    def __init__(self, path: Path) -> None:
        from learn.features.scene import HARDNESSES, SCENE
        from learn.surrogate import Surrogate

        self.name = path.stem
        self.surrogate = Surrogate.load(path)
        self._names: list[str] = []  # of a scene's own numbers, in the order of the vectors
        if self.surrogate.features.name == SCENE:
            *drawn, load = self.surrogate.features.names
            hard = [name for name in drawn if name in HARDNESSES]
            parameters = tuple(name for name in drawn if name not in HARDNESSES)
            self._inputs = Inputs(parameters, load, bool(hard))
            self._names, self.input_sizes = [*parameters, load, *hard], self._inputs.sizes
            return
        self.scene = Scene.from_text(self.surrogate.card["scene"], str(path))
        if isinstance(self.scene.surface, PythonSurface):
            raise InputError(
                f"{path}: its surfaces come from {self.scene.surface.function}, and no code runs"
                " for a surrogate; give `learn predict` the surfaces themselves"
            )
        inputs = Inputs.of(self.scene)
        limits = self.surrogate.hardness_limits  # of all databases of the training
        self._inputs = replace(
            inputs,
            load=inputs.load if inputs.load.startswith("delta") else "delta",
            hardness=limits is not None and limits[0] < limits[1],
        )
        self.input_sizes = self._inputs.sizes

    def output_sizes(self, config: Configuration) -> list[int]:
        """Return the sizes of the output vectors, four numbers each."""
        return [4] * len(self.surrogate.learnt)

    def evaluate(self, vectors: Vectors, config: Configuration) -> Vectors:
        """Predict one contact problem."""
        if config.stiffness:
            raise InputError("config.stiffness: a surrogate predicts its targets alone")
        if self._names and config != Configuration():
            raise InputError("config: the surrogate answers for all surfaces of the parameters")
        if self._names:
            numbers = dict(zip(self._names, chain.from_iterable(vectors), strict=True))
            predicted = self.surrogate.predict_rows(self.surrogate.of_numbers(numbers))
        else:
            asked = question(self.scene, self._inputs, vectors, config)
            predicted = self.surrogate.predict(
                asked.heights, asked.scene.sides, asked.load["delta"], hardness=asked.hardness
            )
        from learn.surrogate.model import calibrated_by

        parts = predicted.values, predicted.low, predicted.high
        output = [[float(part[name][0]) for part in parts] for name in self.surrogate.learnt]
        for name, (value, *ends) in zip(self.surrogate.learnt, output, strict=True):
            if math.isfinite(value) and not all(map(math.isfinite, ends)):
                raise Unsolved(
                    f"{name}: its 90 % interval has no end, and JSON has no such number: the"
                    f" surrogate was calibrated by {calibrated_by(self.surrogate.card)} only: fit"
                    " it to more"
                )
        return [[*numbers, float(predicted.inside[0])] for numbers in output]


def model_of(source: str) -> Model:
    """Make the model of a shipped scene by its name, or of the file of a scene or a surrogate.

    Raise InputError if it is neither, or cannot be served.
    """
    path = Path(source)
    if source not in preset_names() and path.is_file() and kind_of(path) == "surrogate":
        return SurrogateModel(path)
    return SolverModel(load(source), source if source in preset_names() else path.stem)
