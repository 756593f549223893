"""Contact as a function of numbers: keyword arguments in, an array out.

Codes that ask many questions, for uncertainty, sensitivity, calibration or optimisation, call a
Python function with a value of each of their parameters. Here are two: the solver on the surfaces
of a scene, with the number of nodes as its fidelity, and a surrogate. `asperity serve` answers with
the same objects. Points that share a surface make it once, and a surrogate predicts all points of a
call together. No call changes what a later one answers: threads may share a function, and a copy
that was pickled answers as the original does.
"""

import math
import warnings
from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from threading import Lock
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import ArrayLike

import bem
from bem.checks import Range, real_array, real_number
from gen.arrays import Heights, Indices, Values
from gen.distribution import is_drawn
from gen.generation.completion import completed
from gen.generation.sample import absolute_load, solve_contact, surface_numbered
from gen.generators.function import PythonSurface
from gen.generators.scans import ScanSurface
from gen.quantities import DELTA, FORCE, QUANTITIES, USUAL, stored_quantities
from gen.runtime.errors import InputError, input_errors
from gen.runtime.user_code import TRUSTED
from gen.scene import Scene, load

if TYPE_CHECKING:
    from learn.features.rows import Rows
    from learn.surrogate import Prediction, Surrogate

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

SURFACES = 2**32
"""Indices of surfaces are below this number."""

COVERAGE = Range(0, 1, "a coverage between 0 and 1, as 0.9")

Nodes = int | list[int] | None
"""Nodes a side, or along both axes; those of the scene if None."""

Outside = Literal["warn", "nan", "raise"]
"""What a surrogate does with points outside its training."""


class Unsolved(ArithmeticError):
    """A contact problem without a solution, or one that did not converge."""


class OutsideTraining(UserWarning):
    """The warning of a surrogate that was asked outside its training."""


@dataclass(frozen=True)
class Inputs:
    """The inputs of a function: drawn parameters of the surface, load and hardness."""

    parameters: tuple[str, ...]
    load: str  # its quantity, see `gen.scene.load`
    hardness: str = ""  # its name, if it is an input

    @classmethod
    def of(cls, scene: Scene) -> "Inputs":
        """Return the inputs that a scene leaves open: drawn parameters, load, drawn hardness."""
        drawn = (
            name for name, given in scene.drawn_parameters.items() if is_drawn(given)
        )
        return cls(
            tuple(drawn), scene.quantity, "hardness" * scene.contact.draws_hardness
        )

    @property
    def load_name(self) -> str:
        """Name of the load's keyword argument: `load` where its quantity is a quotient."""
        return self.load if self.load.isidentifier() else "load"

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the keyword arguments, in order."""
        return (
            *self.parameters,
            self.load_name,
            *([self.hardness] if self.hardness else []),
        )

    @property
    def sizes(self) -> list[int]:
        """Sizes of the vectors of UM-Bridge: parameters if there are any, load, hardness."""
        surface = [len(self.parameters)] if self.parameters else []
        return [*surface, 1, *([1] if self.hardness else [])]


@dataclass(frozen=True, eq=False)
class Points:
    """Questions to a function, n of them, which share a grid and a seed.

    Attributes
    ----------
    numbers : mapping of str to ndarray, shape (n,)
        The values of each keyword argument.
    surface : ndarray of int, shape (n,)
        Indices of the surfaces, which decide their random numbers.
    nodes : int, list of int or None
        Nodes a side or along both axes; those of the scene if None.
    seed : int or None
        Seed of the surfaces; that of the scene if None.
    """

    numbers: Mapping[str, Values]
    surface: Indices
    nodes: Nodes = None
    seed: int | None = None

    @property
    def of_scene(self) -> bool:
        """True if the points leave surface, nodes and seed as the scene has them."""
        return self.nodes is None and self.seed is None and not self.surface.any()


@dataclass(frozen=True, eq=False)
class OneSurface:
    """A surface, and the points that ask about it.

    Attributes
    ----------
    scene : Scene
        The scene with the parameters and the grid of these points.
    heights : ndarray, shape (nx, ny)
        Heights of the surface [um].
    places : ndarray of int, shape (k,)
        Places of the points among all points.
    kind : str
        "delta", "pressure" or "force": what the loads are.
    loads : ndarray, shape (k,)
        Loads of the points [um, MPa or uN].
    hardness : ndarray, shape (k,), or None
        Hardness of each point, if it is an input [MPa].
    """

    scene: Scene
    heights: Heights
    places: Indices
    kind: str
    loads: Values
    hardness: Values | None


def surfaces_of(scene: Scene, inputs: Inputs, points: Points) -> Iterator[OneSurface]:
    """Make the surfaces that points ask about, each once, in the order of their first points.

    Parameters
    ----------
    scene : Scene
        The scene, whose parameters the points set.
    inputs : Inputs
        What the numbers of the points are.
    points : Points
        The points.

    Yields
    ------
    OneSurface
        A surface with all points that share its parameters and its index.

    Raises
    ------
    InputError
        If a value is not allowed, with its name.
    """
    for name in (inputs.load_name, inputs.hardness):
        values = points.numbers.get(name, np.ones(1))
        wrong = values[~(values > 0)]
        if wrong.size:
            raise InputError(f"input: {name} = {wrong[0]:g}; allowed: a number above 0")
    if isinstance(scene.surface, ScanSurface) and points.nodes is not None:
        raise InputError(
            "nodes: the surfaces are windows of maps, which have the scene's"
        )
    parameters = [points.numbers[name] for name in inputs.parameters]
    keys = np.column_stack([points.surface, *parameters])
    _, group, sizes = np.unique(keys, axis=0, return_inverse=True, return_counts=True)
    order = np.argsort(group.ravel(), kind="stable")
    groups = np.split(order, np.cumsum(sizes)[:-1]) if order.size else []
    for places in sorted(groups, key=lambda group: int(group[0])):
        place = int(places[0])
        drawn = {name: float(points.numbers[name][place]) for name in inputs.parameters}
        fixed = scene.with_parameters(drawn, nodes=points.nodes, seed=points.seed)
        heights = surface_numbered(fixed, int(points.surface[place]))
        loads = points.numbers[inputs.load_name][places]
        kind = inputs.load
        if kind == fixed.quantity:
            kind, loads = absolute_load(fixed, heights, loads)
        hardness = points.numbers[inputs.hardness][places] if inputs.hardness else None
        yield OneSurface(fixed, heights, places, kind, loads, hardness)


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
            If a name is missing or unknown, a value is not allowed or no real number, or arrays
            have shapes that do not broadcast.
        Unsolved
            If a contact has no solution, or the solver did not converge.
        """
        points, shape = self._points(numbers, surface, nodes, seed)
        return self._answers(points).reshape(*shape, len(self.outputs))

    @abstractmethod
    def _answers(self, points: Points) -> Values:
        """Return the outputs of n points, (n, outputs)."""

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
        those of all outputs but `inside`, by differences.

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

        Raises
        ------
        InputError, Unsolved
            As in a call; also for arrays of more than one number.
        """
        point, shape = self._points(numbers, surface, nodes, seed)
        if math.prod(shape) != 1:
            raise InputError(f"numbers of shape {shape}: a gradient is that at one point")
        return self._slopes(point)

    @abstractmethod
    def _slopes(self, point: Points) -> Values:
        """Return what `gradient` does, at one point."""

    def _points(
        self,
        numbers: Mapping[str, ArrayLike],
        surface: ArrayLike,
        nodes: int | Sequence[int] | None,
        seed: int | None,
    ) -> tuple[Points, tuple[int, ...]]:
        """Check what a caller has passed; return it as points, and the shape of the answer."""
        if {*numbers} != {*self.names}:
            passed = ", ".join(numbers) or "nothing"
            raise InputError(
                f"{passed} given: the function takes {', '.join(self.names)}"
            )
        with input_errors("input"):
            arrays = {name: real_array(name, numbers[name]) for name in self.names}
            arrays["surface"] = real_array("surface", surface)
        try:
            shape = np.broadcast_shapes(*(array.shape for array in arrays.values()))
        except ValueError:
            shapes = ", ".join(
                f"{n} {each.shape}" for n, each in arrays.items() if each.ndim
            )
            raise InputError(
                f"input: arrays of shapes {shapes} do not belong together: give arrays of one"
                " length, or shapes that NumPy broadcasts"
            ) from None
        flat = {
            name: np.broadcast_to(array, shape).ravel() for name, array in arrays.items()
        }
        index = flat.pop("surface")
        wrong = index[~((index >= 0) & (index < SURFACES) & (index == np.floor(index)))]
        if wrong.size:
            raise InputError(
                f"surface = {wrong[0]:g}: allowed: a whole number from 0 to {SURFACES - 1}"
            )
        grid = list(nodes) if isinstance(nodes, Sequence) else nodes
        return Points(flat, index.astype(np.int64), grid, seed), shape


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
        self.outputs = _among(KNOWN, outputs)
        self._trust = trust or TRUSTED.get()
        with self._trusted():  # as a surrogate knows it: parameters in alphabetical order
            read = load(scene) if isinstance(scene, str) else scene
            self.scene = Scene.from_text(completed(read).text())
        self.inputs = Inputs.of(self.scene)

    def _answers(self, points: Points) -> Values:
        """Solve the contact problems, surface by surface."""
        answers = np.empty((points.surface.size, len(self.outputs)))
        with self._trusted(), _in_words():
            for surface in surfaces_of(self.scene, self.inputs, points):
                for number, place in enumerate(surface.places):
                    contact = _solved(surface, number)
                    answers[place] = [
                        float(QUANTITIES[name].of(contact)) for name in self.outputs
                    ]
        return answers

    def _slopes(self, point: Points) -> Values:
        """Return derivatives of force and Delta by the load; see `gradient`."""
        with self._trusted(), _in_words():
            (surface,) = surfaces_of(self.scene, self.inputs, point)
            contact = _solved(surface, 0)
            stiffness = contact.loading_stiffness
        load = float(surface.loads[0])
        if surface.kind == "pressure":
            load *= math.prod(contact.problem.spacing) * contact.pressure.size
        per_load = load / float(point.numbers[self.inputs.load_name][0])
        of_delta, of_force = per_load, stiffness * per_load
        if contact.problem.delta is None:
            of_delta, of_force = per_load / stiffness, per_load
        derivatives = np.full((len(self.outputs), len(self.names)), np.nan)
        for row, name in enumerate(self.outputs):
            if name == DELTA.name:
                derivatives[row, len(self.inputs.parameters)] = of_delta
            elif name == FORCE.name:
                derivatives[row, len(self.inputs.parameters)] = of_force
        return derivatives

    @contextmanager
    def _trusted(self) -> Iterator[None]:
        """Let the scene's function run, if this object trusts it."""
        token = TRUSTED.set(self._trust)
        try:
            yield
        finally:
            TRUSTED.reset(token)


def _among(known: Collection[str], outputs: Sequence[str]) -> tuple[str, ...]:
    """Return outputs, or refuse those that are unknown."""
    if unknown := {*outputs} - {*known}:
        raise InputError(f"{', '.join(sorted(unknown))}: outputs are {', '.join(known)}")
    return tuple(outputs)


def _solved(surface: OneSurface, number: int) -> bem.Contact:
    """Solve the contact of a surface at the load of one of its points."""
    hardness = None if surface.hardness is None else float(surface.hardness[number])
    load = {surface.kind: float(surface.loads[number])}
    return solve_contact(surface.scene, surface.heights, hardness=hardness, **load)


@contextmanager
def _in_words() -> Iterator[None]:
    """Turn what the solver raises into the errors of a function."""
    try:
        yield
    except bem.OutOfRange as error:
        raise InputError(str(error)) from None
    except (bem.NoSolution, bem.NotConverged, ArithmeticError) as error:
        raise Unsolved(str(error)) from None
    except MemoryError:
        raise Unsolved("memory has run out: give fewer nodes") from None


@dataclass(frozen=True)
class Part:
    """What an output of a surrogate is."""

    target: str  # short name, as "area"; "" for the flag of points inside the training
    end: Literal["", "low", "high"] = ""  # of the interval; "" for the value
    mean: bool = False  # True for the mean over all surfaces of the parameters


def _parts_of(surrogate: "Surrogate") -> dict[str, Part]:
    """Return what a surrogate may be asked for, by the names of the outputs."""
    from learn.models import POPULATION

    parts = {target: Part(target) for target in surrogate.learnt}
    further = {"inside": Part("")}
    for target in surrogate.learnt:
        further[f"{target}_low"] = Part(target, "low")
        further[f"{target}_high"] = Part(target, "high")
        if surrogate.features.of_scene:
            further[f"{target}_mean"] = Part(target, mean=True)
        if surrogate.card["model"] == POPULATION.name:
            further[f"{target}_mean_low"] = Part(target, "low", mean=True)
            further[f"{target}_mean_high"] = Part(target, "high", mean=True)
    return parts | {name: part for name, part in further.items() if name not in parts}


class SurrogateFunction(Function):
    """A surrogate as a function; it predicts all points of a call together.

    The load is Delta [um], or the pressure [MPa] that the surrogate has learnt. One of the scene's
    own numbers takes theirs, and no surface is made. Intervals are of 90 %, or the largest level
    below that the surrogate reaches: `level`.

    Parameters
    ----------
    path : Path or str
        File of the surrogate.
    outputs : sequence of str, optional
        Targets, as "area"; the ends of their intervals, as "area_low" and "area_high"; and
        "inside", 1 inside the training and 0 outside. A surrogate of a scene's own numbers also
        has the mean over all surfaces of the parameters, "area_mean", and one of the model
        population the ends of its interval, "area_mean_low" and "area_mean_high". All targets if
        left out.
    outside : str
        What to do with points outside the training: "warn" gives the first call with such points
        an `OutsideTraining` warning, "nan" answers them with NaN, "raise" refuses them.
        Intervals do not hold there: their ends are NaN.
    level : float, optional
        Coverage of the intervals; 90 %, or the largest level below that the surrogate reaches, if
        left out.

    Raises
    ------
    InputError
        If the file is no surrogate, an argument is not allowed, or the surrogate does not reach the
        level.
    """

    def __init__(
        self,
        path: Path | str,
        outputs: Sequence[str] | None = None,
        *,
        outside: Outside = "warn",
        level: float | None = None,
    ) -> None:
        from learn.features.scene import HARDNESSES
        from learn.surrogate import Surrogate
        from learn.surrogate.level import level_of

        if outside not in {"warn", "nan", "raise"}:
            raise InputError(f"outside = {outside!r}: allowed: warn, nan, raise")
        self._path = Path(path).absolute()
        if level is not None:
            with input_errors():
                level = float(real_number("level", level, COVERAGE))
        self._outside = outside
        self._warned = False
        self._lock = Lock()
        self.surrogate = Surrogate.load(self._path)
        self.level = level_of(self.surrogate, level)
        self.of_scene = self.surrogate.features.of_scene
        known = _parts_of(self.surrogate)
        self.outputs = _among(
            known, tuple(self.surrogate.learnt if outputs is None else outputs)
        )
        self._parts = [known[name] for name in self.outputs]
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

    def __reduce__(self) -> tuple[Callable[[Path], "SurrogateFunction"], tuple[Path]]:
        """Read the file again where a copy is unpickled: no estimator travels."""
        remade = partial(
            SurrogateFunction,
            outputs=self.outputs,
            outside=self._outside,
            level=self.level,
        )
        return remade, (self._path,)

    def _answers(self, points: Points) -> Values:
        """Predict all points together."""
        if points.surface.size == 0:
            return np.empty((0, len(self.outputs)))
        columns, reasons = self._columns(points)
        self._tell(reasons)
        return self._withheld(columns, reasons)

    def _slopes(self, point: Points) -> Values:
        """Return differences of the predictions; see `gradient`."""
        numbers = {name: float(values[0]) for name, values in point.numbers.items()}
        steps = {name: STEP * (abs(number) or 1.0) for name, number in numbers.items()}
        places = [numbers]
        for name, step in steps.items():
            places.append({**numbers, name: numbers[name] + step})
            places.append({**numbers, name: numbers[name] - step})
        moved = {name: np.array([place[name] for place in places]) for name in numbers}
        near = replace(
            point, numbers=moved, surface=np.repeat(point.surface, len(places))
        )
        columns, reasons = self._columns(near)
        self._tell(reasons[:1])
        more, less = columns[1::2], columns[2::2]
        derivatives = (more - less) / (2 * np.array([*steps.values()])[:, None])
        derivatives[:, [part.target == "" for part in self._parts]] = np.nan
        return self._withheld(derivatives, reasons[:1] * len(steps)).T

    def _columns(self, points: Points) -> tuple[Values, list[str]]:
        """Predict n points: the outputs, (n, outputs), and why each is outside the training."""
        rows, places = self._rows(points)
        ends = any(part.end and not part.mean for part in self._parts)
        prediction = self.surrogate.predict_rows(rows, level=self.level if ends else None)
        means = prediction
        if any(part.end and part.mean for part in self._parts):
            means = self.surrogate.predict_rows(rows, level=self.level, mean=True)
        columns = np.empty((places.size, len(self._parts)))
        for column, part in enumerate(self._parts):
            columns[places, column] = _output(means if part.mean else prediction, part)
        reasons = np.empty(places.size, dtype=object)
        reasons[places] = prediction.reasons
        return columns, reasons.tolist()

    def _rows(self, points: Points) -> tuple["Rows", Indices]:
        """Return rows to predict, and the place of each among the n points."""
        from learn.features.rows import joined

        if self.of_scene:
            if not points.of_scene:
                raise InputError(
                    "config: the surrogate answers for all surfaces of the parameters"
                )
            names = dict(zip(self.names, self.surrogate.features.names, strict=True))
            numbers = {names[name]: values for name, values in points.numbers.items()}
            return self.surrogate.of_numbers(numbers), np.arange(points.surface.size)
        parts, places = [], []
        for surface in surfaces_of(self.scene, self.inputs, points):
            on_surface = self.surrogate.for_surface(surface.heights, surface.scene.sides)
            parts.append(on_surface.rows(surface.loads, hardness=surface.hardness))
            places.append(surface.places)
        return joined(parts), np.concatenate(places)

    def _tell(self, reasons: Sequence[str]) -> None:
        """Refuse points outside the training, or warn of the first ones."""
        outside = [reason for reason in reasons if reason]
        if not outside or self._outside == "nan":
            return
        text = (
            f"{len(outside)} of {len(reasons)} points lie outside what {self._path.name} was"
            f" trained on: {outside[0]}"
        )
        if self._outside == "raise":
            raise InputError(text)
        with self._lock:
            first = not self._warned
            self._warned = True
        if first:
            advice = 'the output "inside" tells which; further calls do not warn'
            warnings.warn(f"{text}; {advice}", OutsideTraining, stacklevel=4)

    def _withheld(self, columns: Values, reasons: Sequence[str]) -> Values:
        """Take out of n answers, (n, outputs), what does not hold outside the training."""
        outside = np.array([reason != "" for reason in reasons])
        for column, part in enumerate(self._parts):
            if part.end or (part.target and self._outside == "nan"):
                columns[outside, column] = np.nan
        return columns


def _output(prediction: "Prediction", part: Part) -> Values:
    """Return one output of n predicted points, (n,)."""
    if not part.target:
        return prediction.inside.astype(np.float64)
    if part.end == "low":
        return prediction.low[part.target]
    if part.end == "high":
        return prediction.high[part.target]
    return prediction.values[part.target]
