"""Contact as a function of numbers: keyword arguments in, an array out.

Codes that ask many questions, for uncertainty, sensitivity, calibration or optimisation, call a
Python function with a value of each of their parameters. Here are two: the solver on the surfaces
of a scene, with the number of nodes as its fidelity, and a surrogate. `asperity serve` answers with
the same objects. No call changes them: threads may share one, and a copy that was pickled answers
as the original does.
"""

import math
from abc import ABC, abstractmethod
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple, SupportsInt

import numpy as np
from numpy.typing import ArrayLike

import bem
from gen.arrays import Heights, Values
from gen.distribution import is_drawn
from gen.generation.completion import completed
from gen.generation.sample import load_of, solve_contact, surface_numbered
from gen.generators.function import PythonSurface
from gen.generators.scans import ScanSurface
from gen.quantities import DELTA, FORCE, QUANTITIES, USUAL, stored_quantities
from gen.runtime.errors import InputError
from gen.runtime.user_code import TRUSTED
from gen.scene import Scene, load

KNOWN = (
    *USUAL,
    *sorted(
        quantity.name
        for quantity in stored_quantities()
        if quantity.name not in USUAL and not quantity.per_node
    ),
)
"""Outputs that the solver may be asked for: columns that have one number of each contact."""

STEP = 1e-4
"""Relative step of the differences that are a surrogate's gradient."""


class Unsolved(ArithmeticError):
    """A contact problem without a solution, or one that did not converge."""


@dataclass(frozen=True)
class Inputs:
    """The inputs of a function: drawn parameters of the surface, load and hardness."""

    parameters: tuple[str, ...]
    load: str  # its quantity, see `gen.scene.load`
    hardness: str = ""  # its name, if it is an input

    @classmethod
    def of(cls, scene: Scene) -> "Inputs":
        """Return the inputs that a scene leaves open: drawn parameters, load, drawn hardness."""
        drawn = (name for name, given in scene.drawn_parameters.items() if is_drawn(given))
        return cls(tuple(drawn), scene.quantity, "hardness" * scene.contact.draws_hardness)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the keyword arguments, in order; a load that is a quotient is called `load`."""
        load = self.load if self.load.isidentifier() else "load"
        return (*self.parameters, load, *([self.hardness] if self.hardness else []))

    @property
    def sizes(self) -> list[int]:
        """Sizes of the vectors of UM-Bridge: parameters if there are any, load, hardness."""
        surface = [len(self.parameters)] if self.parameters else []
        return [*surface, 1, *([1] if self.hardness else [])]


class Where(NamedTuple):
    """Which surface is asked for, on which grid; the scene's own nodes and seed if None."""

    surface: int = 0
    nodes: int | list[int] | None = None
    seed: int | None = None


@dataclass(frozen=True)
class Question:
    """One contact problem."""

    scene: Scene  # with the parameters and the grid that are asked for
    heights: Heights  # of its surface [um], (nx, ny)
    load: dict[str, float]  # "delta" [um], "pressure" [MPa] or "force" [uN]
    hardness: float | None  # [MPa], if it is an input

    @classmethod
    def of(
        cls, scene: Scene, inputs: Inputs, numbers: Mapping[str, float], where: Where
    ) -> "Question":
        """Turn numbers by the names of the inputs into a contact problem.

        Raise InputError if a value is not allowed, with its name.
        """
        values = [numbers[name] for name in inputs.names]
        drawn = dict(zip(inputs.parameters, values, strict=False))
        load, hardness = numbers[inputs.names[len(drawn)]], numbers.get(inputs.hardness)
        for name, value in ((inputs.load, load), ("hardness", hardness)):
            if value is not None and not value > 0:
                raise InputError(f"input: {name} = {value:g}; allowed: a number above 0")
        if isinstance(scene.surface, ScanSurface) and where.nodes is not None:
            raise InputError("nodes: the surfaces are windows of maps, which have the scene's")
        asked = scene.with_parameters(drawn, nodes=where.nodes, seed=where.seed)
        heights, kind = surface_numbered(asked, where.surface), inputs.load
        given = load_of(asked, heights, load) if kind == asked.quantity else {kind: load}
        return cls(asked, heights, given, hardness)


class Function(ABC):
    """A function of the numbers that a scene leaves open.

    Attributes
    ----------
    inputs : Inputs
        What these numbers are.
    outputs : tuple of str
        Names of the numbers of an answer.
    """

    inputs: Inputs
    outputs: tuple[str, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the keyword arguments, each of which has to be given."""
        return self.inputs.names

    def __call__(
        self,
        *,
        surface: ArrayLike = 0,
        nodes: int | Sequence[int] | None = None,
        seed: int | None = None,
        job_id: object = None,
        num_procs: object = None,
        experiment_dir: object = None,
        experiment_name: object = None,
        **numbers: ArrayLike,
    ) -> Values:
        """Answer one question, or one for each element of arrays.

        Parameters
        ----------
        surface : int or array of int
            Index of the surface, which decides its random numbers.
        nodes : int or pair of int, optional
            Nodes a side, the fidelity; those of the scene if left out.
        seed : int, optional
            Seed of the surfaces; that of the scene if left out.
        job_id, num_procs, experiment_dir, experiment_name : object
            What drivers of many jobs pass along; ignored.
        **numbers : float or array
            A value for each of `names`: parameters of the surface, load, hardness [MPa].

        Returns
        -------
        ndarray, shape (..., outputs)
            The outputs, behind the dimensions that arrays broadcast to.

        Raises
        ------
        InputError
            If a name is missing or unknown, or a value is not allowed.
        Unsolved
            If a contact has no solution, or the solver did not converge.
        """
        self._require(numbers)
        index, *values = np.broadcast_arrays(surface, *(numbers[name] for name in self.names))
        rows = [
            self.answer(
                dict(zip(self.names, map(float, row), strict=True)), _where(at, nodes, seed)
            )
            for at, *row in zip(index.flat, *(each.flat for each in values), strict=True)
        ]
        return np.reshape(rows, (*index.shape, len(self.outputs)))

    def answer(self, numbers: Mapping[str, float], where: Where) -> list[float]:
        """Answer one question.

        Parameters
        ----------
        numbers : mapping of str to float
            A value for each of `names`.
        where : Where
            Surface, nodes and seed.

        Returns
        -------
        list of float
            The outputs.
        """
        return self._answer(numbers, where)

    @abstractmethod
    def _answer(self, numbers: Mapping[str, float], where: Where) -> list[float]:
        """Return what `answer` does."""

    def gradient(
        self,
        *,
        surface: int = 0,
        nodes: int | Sequence[int] | None = None,
        seed: int | None = None,
        **numbers: float,
    ) -> Values:
        """Return the derivatives of outputs by inputs that are cheap; the others are NaN.

        The solver has those of force and Delta by the load, by one linear solve. A surrogate has
        all, by differences.

        Parameters
        ----------
        surface, nodes, seed : int, optional
            As in a call.
        **numbers : float
            A value for each of `names`.

        Returns
        -------
        ndarray, shape (outputs, inputs)
            Derivatives in the order of `outputs` and `names`.
        """
        self._require(numbers)
        return self._slopes(numbers, _where(surface, nodes, seed))

    @abstractmethod
    def _slopes(self, numbers: Mapping[str, float], where: Where) -> Values:
        """Return what `gradient` does."""

    def _require(self, numbers: Collection[str]) -> None:
        """Refuse names that are missing or unknown."""
        if {*numbers} != {*self.names}:
            given = ", ".join(numbers) or "nothing"
            raise InputError(f"{given} given: the function takes {', '.join(self.names)}")


def _where(surface: SupportsInt, nodes: int | Sequence[int] | None, seed: int | None) -> Where:
    """Return a surface on a grid, with nodes as scenes have them."""
    return Where(int(surface), list(nodes) if isinstance(nodes, Sequence) else nodes, seed)


class SceneFunction(Function):
    """The solver on the surfaces of a scene.

    Parameters
    ----------
    scene : Scene or str
        A scene, the name of a shipped one, or the path of a TOML file.
    outputs : sequence of str
        Columns of a database: area_percent, force, delta, or others as mean_gap, stiffness,
        continuum_area_percent or hydraulic_aperture_x.
    trust : bool
        Whether to run the function of the user's own that makes the scene's surfaces.
    """

    def __init__(
        self, scene: Scene | str, outputs: Sequence[str] = USUAL, *, trust: bool = False
    ) -> None:
        if unknown := {*outputs} - {*KNOWN}:
            raise InputError(f"{', '.join(sorted(unknown))}: outputs are {', '.join(KNOWN)}")
        self.outputs, self._trust = tuple(outputs), trust or TRUSTED.get()
        token = TRUSTED.set(self._trust)
        try:  # as a surrogate knows it: parameters of a scene's own in alphabetical order
            read = load(scene) if isinstance(scene, str) else scene
            self.scene = Scene.from_text(completed(read).text())
        finally:
            TRUSTED.reset(token)
        self.inputs = Inputs.of(self.scene)

    def _answer(self, numbers: Mapping[str, float], where: Where) -> list[float]:
        """Solve one contact problem."""
        contact, _ = self._solved(numbers, where)
        try:
            return [float(QUANTITIES[name].of(contact)) for name in self.outputs]
        except ArithmeticError as error:
            raise Unsolved(str(error)) from None

    def _slopes(self, numbers: Mapping[str, float], where: Where) -> Values:
        """Return derivatives of force and Delta by the load; see `gradient`."""
        contact, per_load = self._solved(numbers, where)
        found = np.full((len(self.outputs), len(self.names)), np.nan)
        stiffness = contact.loading_stiffness
        per_delta, per_force = 1.0, stiffness  # of Delta, and of the force
        if contact.problem.delta is None:
            per_delta, per_force = 1 / stiffness, 1.0
        for row, name in enumerate(self.outputs):
            if name == DELTA.name:
                found[row, len(self.inputs.parameters)] = per_delta * per_load
            elif name == FORCE.name:
                found[row, len(self.inputs.parameters)] = per_force * per_load
        return found

    def _solved(self, numbers: Mapping[str, float], where: Where) -> tuple[bem.Contact, float]:
        """Solve one contact problem; also return Delta [um] or force [uN] per unit of the input."""
        token = TRUSTED.set(self._trust)
        try:
            asked = Question.of(self.scene, self.inputs, numbers, where)
            contact = solve_contact(
                asked.scene, asked.heights, hardness=asked.hardness, **asked.load
            )
        except bem.OutOfRange as error:
            raise InputError(str(error)) from None
        except (bem.NoSolution, bem.NotConverged, ArithmeticError) as error:
            raise Unsolved(str(error)) from None
        except MemoryError:
            raise Unsolved("memory has run out: give fewer nodes") from None
        finally:
            TRUSTED.reset(token)
        ((kind, load),) = asked.load.items()
        area = (
            math.prod(contact.problem.spacing) * contact.pressure.size if kind == "pressure" else 1
        )
        return contact, load * area / numbers[self.names[len(self.inputs.parameters)]]


class SurrogateFunction(Function):
    """A surrogate; its outputs are the predictions of its targets.

    The load is Delta [um], or the pressure [MPa] that the surrogate has learnt. One of the scene's
    own numbers takes theirs, and no surface is made. Intervals are of 90 %, or the largest level
    below that the surrogate reaches: `level`.

    Parameters
    ----------
    path : Path or str
        File of the surrogate.
    """

    def __init__(self, path: Path | str) -> None:
        from learn.features.scene import HARDNESSES, SCENE
        from learn.surrogate import Surrogate
        from learn.surrogate.interval import level_of

        self._path = Path(path).absolute()
        self.surrogate = Surrogate.load(self._path)
        self.level = level_of(self.surrogate, None)
        self.outputs = tuple(self.surrogate.learnt)
        self.of_scene = self.surrogate.features.name == SCENE
        if self.of_scene:
            *drawn, load = self.surrogate.features.names
            hard = [name for name in drawn if name in HARDNESSES]
            parameters = tuple(name for name in drawn if name not in HARDNESSES)
            self.inputs = Inputs(parameters, load, *hard)
            return
        self.scene = Scene.from_text(self.surrogate.card["scene"], str(path))
        if isinstance(self.scene.surface, PythonSurface):
            raise InputError(
                f"{path}: its surfaces come from {self.scene.surface.function}, and no code runs"
                " for a surrogate; give `learn predict` the surfaces themselves"
            )
        inputs, load = Inputs.of(self.scene), self.surrogate.features.load
        limits = self.surrogate.hardness_limits  # of all databases of the training
        self.inputs = replace(
            inputs,
            load=inputs.load if inputs.load.startswith(load) else load,
            hardness="hardness" if limits is not None and limits[0] < limits[1] else "",
        )

    def __reduce__(self) -> tuple[type, tuple[Path]]:
        """Read the file again where a copy is unpickled: no estimator travels."""
        return SurrogateFunction, (self._path,)

    def _answer(self, numbers: Mapping[str, float], where: Where) -> list[float]:
        """Predict one contact problem."""
        return [value for value, *_ in self.predicted(numbers, where)]

    def predicted(self, numbers: Mapping[str, float], where: Where) -> list[list[float]]:
        """Predict one contact problem, with intervals.

        Parameters
        ----------
        numbers : mapping of str to float
            A value for each of `names`.
        where : Where
            Surface, nodes and seed.

        Returns
        -------
        list of list of float
            For each output its value, both ends of its interval of `level`, and 1 inside the
            training, or 0 outside.
        """
        if self.of_scene and where != Where():
            raise InputError("config: the surrogate answers for all surfaces of the parameters")
        if self.of_scene:
            *_, load = self.surrogate.features.names
            given = {load if name == "load" else name: each for name, each in numbers.items()}
            found = self.surrogate.predict_rows(self.surrogate.of_numbers(given), level=self.level)
        else:
            asked = Question.of(self.scene, self.inputs, numbers, where)
            on_surface = self.surrogate.for_surface(asked.heights, asked.scene.sides)
            (given_load,) = asked.load.values()
            found = on_surface.predict(given_load, hardness=asked.hardness, level=self.level)
        parts, inside = (found.values, found.low, found.high), float(found.inside[0])
        return [[*(float(part[name][0]) for part in parts), inside] for name in self.outputs]

    def _slopes(self, numbers: Mapping[str, float], where: Where) -> Values:
        """Return differences of the predictions; see `gradient`."""
        columns = []
        for name in self.names:
            step = STEP * abs(numbers[name])
            more, less = (
                np.array(self._answer({**numbers, name: numbers[name] + way}, where))
                for way in (step, -step)
            )
            columns.append((more - less) / (2 * step))
        return np.stack(columns, axis=1)
