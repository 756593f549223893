"""Contact as a function of numbers, which takes keyword arguments and returns an array.

Codes that ask many questions, for uncertainty, sensitivity, calibration or optimisation, call a
Python function with a value of each of their parameters. This module has two classes of these
functions: `SceneFunction` is the solver on the surfaces of a scene, with the number of nodes as its
fidelity, and `SurrogateFunction` is a surrogate. `asperity serve` answers with them. A surface that
several points of a call share is made once, and a surrogate predicts all points of a call together.
No call changes the answers of a later one: threads may share a function, and a pickled copy gives
equal answers.
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
from typing import TYPE_CHECKING, Any, Literal

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
from gen.quantities import DELTA, FORCE, MEAN_GAP, QUANTITIES, USUAL, stored_quantities
from gen.runtime.errors import InputError, input_errors
from gen.runtime.user_code import TRUSTED
from gen.scene import Scene, load

if TYPE_CHECKING:
    from learn.features.rows import Rows
    from learn.surrogate import Prediction, Surrogate

SOLVER_OUTPUTS = (
    *USUAL,
    *sorted(
        quantity.name
        for quantity in stored_quantities()
        if quantity.name not in USUAL and not quantity.per_node
    ),
)
"""Names of the outputs that the solver can give: columns with one number for each contact."""

DIFFERENTIABLE = (FORCE.name, DELTA.name, MEAN_GAP.name)
"""Names of the outputs of which the solver has derivatives."""

STEP = 1e-4
"""Relative step of an input, in the differences that give a surrogate's gradient."""

SURFACES = 2**32
"""Number of indices of surfaces; the largest index is one less."""

COVERAGE = Range(0, 1, "a coverage between 0 and 1, as 0.9")
"""Levels of intervals that are allowed, with the words of an error."""

Nodes = int | list[int] | None
"""Nodes along both axes, or a list of those along x and along y; None for those of the scene."""

Outside = Literal["warn", "nan", "raise"]
"""What a surrogate does with points outside its training; see `SurrogateFunction`."""


class Unsolved(ArithmeticError):
    """The error of a contact problem that has no solution, or did not converge."""


class OutsideTraining(UserWarning):
    """The warning of a surrogate that was asked outside its training."""


@dataclass(frozen=True)
class Inputs:
    """The names of the inputs of a function: drawn parameters, load, and numbers of the bodies."""

    parameters: tuple[str, ...]  # parameters of the surface
    # quantity of the load: one of `gen.scene.tables.UNITS`, as scenes name it, or for a surrogate
    # one of `learn.features.scene.LOADS`
    load: str
    # "hardness" [MPa] or "hardness_ratio", the hardness over E* [1]; "" if it is no input
    hardness: str = ""
    layer: tuple[
        str, ...
    ] = ()  # thickness [um] and modulus [MPa] of a layer that are inputs

    @classmethod
    def of(cls, scene: Scene) -> "Inputs":
        """Return the inputs that a scene leaves open: parameters, load, hardness and layer.

        Parameters
        ----------
        scene : Scene
            A completed scene.

        Returns
        -------
        Inputs
            The inputs, without the numbers that have fixed values.
        """
        drawn = [
            name for name, value in scene.drawn_parameters.items() if is_drawn(value)
        ]
        hardness = ""
        if scene.contact.draws_hardness:
            hardness = "hardness"
        layer: tuple[str, ...] = ()
        if scene.contact.layer is not None:
            layer = tuple(scene.contact.layer.drawn)
        return cls(
            parameters=tuple(drawn), load=scene.quantity, hardness=hardness, layer=layer
        )

    @property
    def load_name(self) -> str:
        """Name of the load's keyword argument: its quantity, or "load" for a relative load.

        The quantity of a relative load, as "delta/height_rms", cannot be a name in Python.
        """
        if self.load.isidentifier():
            return self.load
        return "load"

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the keyword arguments: parameters and load, then hardness and layer if any."""
        names = (*self.parameters, self.load_name)
        if self.hardness:
            names = (*names, self.hardness)
        return (*names, *self.layer)

    @property
    def sizes(self) -> list[int]:
        """Sizes of the input vectors of UM-Bridge.

        The parameters are one vector, if there are any, and the numbers of the layer the last one.
        Load and hardness have one each.
        """
        sizes = []
        if self.parameters:
            sizes.append(len(self.parameters))
        sizes.append(1)  # the load
        if self.hardness:
            sizes.append(1)
        if self.layer:
            sizes.append(len(self.layer))
        return sizes


@dataclass(frozen=True, eq=False)
class Points:
    """The n points of a call, which share a grid and a seed.

    Attributes
    ----------
    numbers : mapping of str to ndarray, shape (n,)
        Values of each of `Inputs.names` by its name.
    surface : ndarray of int, shape (n,)
        Index of the surface of each point, which decides the surface's random numbers.
    nodes : int, list of int or None
        Nodes along both axes, or along x and along y; those of the scene if None.
    seed : int or None
        Seed of the surfaces; that of the scene if None.
    """

    numbers: Mapping[str, Values]
    surface: Indices
    nodes: Nodes = None
    seed: int | None = None

    @property
    def leave_surface_open(self) -> bool:
        """True if all points have the surface 0, and neither nodes nor a seed is given."""
        return self.nodes is None and self.seed is None and not self.surface.any()


@dataclass(frozen=True, eq=False)
class OneSurface:
    """A surface, and the k points of a call that have it.

    Attributes
    ----------
    scene : Scene
        The scene with the parameters and the grid of these points.
    heights : ndarray, shape (nx, ny)
        Heights of the surface [um].
    places : ndarray of int, shape (k,)
        Places of these points among all points of the call.
    kind : str
        Quantity of the loads: "delta", "pressure" or "force".
    loads : ndarray, shape (k,)
        Loads of the points [um, MPa or uN].
    hardness : ndarray, shape (k,), or None
        Hardness of each point, if it is an input [MPa].
    layer : dict of str to ndarray, shape (k,)
        Numbers of the layer of each point that are inputs: thickness [um] and modulus [MPa].
    """

    scene: Scene
    heights: Heights
    places: Indices
    kind: str
    loads: Values
    hardness: Values | None
    layer: dict[str, Values]

    def layer_of(self, number: int) -> dict[str, float]:
        """Return the numbers of the layer of a point that are inputs.

        Parameters
        ----------
        number : int
            Number of the point among those of the surface; 0 for the first one.

        Returns
        -------
        dict of str to float
            Thickness [um] and modulus [MPa], by the names of their columns.
        """
        return {name: float(values[number]) for name, values in self.layer.items()}

    def bodies(self) -> "list[bem.Layered]":
        """Return the body of each point, if it has a layer; an empty list for half-spaces."""
        bodies = []
        for number in range(self.places.size):
            body = self.scene.contact.body(self.layer_of(number))
            if body is not None:
                bodies.append(body)
        return bodies


def surfaces_of(scene: Scene, inputs: Inputs, points: Points) -> Iterator[OneSurface]:
    """Make the surfaces of the points of a call, each once, in the order of their first points.

    Parameters
    ----------
    scene : Scene
        The scene, whose parameters the points set.
    inputs : Inputs
        Names of the numbers of the points: parameters, load and hardness. The hardness is in MPa,
        because only surrogates of a scene's own numbers take a ratio, and these make no surfaces.
    points : Points
        The points; if there are none, nothing is yielded.

    Yields
    ------
    OneSurface
        A surface with all points that share its parameters and its index.

    Raises
    ------
    InputError
        If a value is not allowed; the message names it. Also if a surface cannot be made.
    """
    _require_positive(inputs, points)
    if isinstance(scene.surface, ScanSurface) and points.nodes is not None:
        raise InputError(
            "nodes: the surfaces are windows of maps, which have the scene's"
        )
    for places in _points_by_surface(inputs, points):
        first = int(places[0])
        parameters = {
            name: float(points.numbers[name][first]) for name in inputs.parameters
        }
        fixed = scene.with_parameters(parameters, nodes=points.nodes, seed=points.seed)
        heights = surface_numbered(fixed, int(points.surface[first]))
        given_loads = points.numbers[inputs.load_name][places]
        kind: str = inputs.load
        loads = given_loads
        # A load of the scene's quantity may be relative to the heights of the surface. Another
        # quantity is one that a surrogate has learnt: these loads are absolute.
        if inputs.load == fixed.quantity:
            kind, loads = absolute_load(fixed, heights, given_loads)
        hardness: Values | None = None
        if inputs.hardness:
            hardness = points.numbers[inputs.hardness][places]
        yield OneSurface(
            scene=fixed,
            heights=heights,
            places=places,
            kind=kind,
            loads=loads,
            hardness=hardness,
            layer={name: points.numbers[name][places] for name in inputs.layer},
        )


def _require_positive(inputs: Inputs, points: Points) -> None:
    """Refuse loads, hardnesses and numbers of layers that are not finite and above 0."""
    for name in (inputs.load_name, inputs.hardness, *inputs.layer):
        if name not in points.numbers:  # no hardness
            continue
        values = points.numbers[name]
        is_allowed = (values > 0) & (values < np.inf)
        wrong = values[~is_allowed]
        if wrong.size:
            raise InputError(f"input: {name} = {wrong[0]:g}; allowed: a number above 0")


def _points_by_surface(inputs: Inputs, points: Points) -> list[Indices]:
    """Return the places of the points of each surface, (k,) each, by the surface's first point.

    Points with equal parameters and equal index share a surface. Without points the list is empty.
    """
    if not points.surface.size:
        return []
    parameters = [points.numbers[name] for name in inputs.parameters]
    keys = np.column_stack([points.surface, *parameters])
    _, group, sizes = np.unique(keys, axis=0, return_inverse=True, return_counts=True)
    # A stable sort keeps the points of each group in their order.
    places = np.argsort(group.ravel(), kind="stable")
    places_of_groups = np.split(places, np.cumsum(sizes)[:-1])
    return sorted(places_of_groups, key=lambda places: int(places[0]))


class Function(ABC):
    """A function of the numbers that a scene leaves open.

    Attributes
    ----------
    inputs : Inputs
        The numbers.
    outputs : tuple of str
        Names of the numbers of an answer, in order.
    """

    inputs: Inputs
    outputs: tuple[str, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the keyword arguments, all of which have to be given."""
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
        """Compute the outputs at one point, or at each point of arrays.

        Parameters
        ----------
        surface : int or array of int
            Index of the surface, which decides its random numbers.
        nodes : int or sequence of two int, optional
            Nodes along both axes, or along x and y: the fidelity. By default those of the scene.
        seed : int, optional
            Seed of the surfaces; that of the scene if left out.
        job_id, num_procs, experiment_dir, experiment_name : object
            Arguments that drivers of many jobs add; ignored.
        **numbers : float or array
            A value for each of `names`: parameters of the surface, load, hardness [MPa]. Arrays are
            broadcast to one shape, with `surface` too.

        Returns
        -------
        ndarray, shape (..., outputs)
            The outputs in the order of `outputs`, after the dimensions of the arrays.

        Raises
        ------
        InputError
            If a name is missing or unknown, a value is not allowed or no real number, arrays have
            shapes that do not broadcast, a surface cannot be made, or a surrogate refuses a point
            outside its training.
        Unsolved
            If a contact has no solution, or the solver did not converge.
        """
        points, shape = self._points(numbers, surface, nodes, seed)
        return self._answers(points).reshape(*shape, len(self.outputs))

    @abstractmethod
    def _answers(self, points: Points) -> Values:
        """Return the outputs of the n points of a call, (n, outputs)."""

    def gradient(
        self,
        *,
        surface: int = 0,
        nodes: int | Sequence[int] | None = None,
        seed: int | None = None,
        **numbers: float,
    ) -> Values:
        """Compute the derivatives of outputs by inputs that are cheap; all others are NaN.

        The solver has the derivatives of force, Delta and mean gap by the load, and by parameters
        to which all heights are proportional (`rms_height`, `rms_slope`, `sigma0`). They come from
        linear solves, and hold as long as the contact set stays. A surrogate has the derivatives
        of all outputs but `inside`, from differences.

        Parameters
        ----------
        surface, nodes, seed : int, optional
            Surface, fidelity and seed, as in a call.
        **numbers : float
            A value for each of `names`.

        Returns
        -------
        ndarray, shape (outputs, inputs)
            Derivatives in the order of `outputs` and `names`.

        Raises
        ------
        InputError
            As in a call, and if an array has more than one number.
        Unsolved
            As in a call, and if the linear solve does not converge.
        """
        point, shape = self._points(numbers, surface, nodes, seed)
        if math.prod(shape) != 1:
            raise InputError(f"numbers of shape {shape}: a gradient is that at one point")
        return self._slopes(point)

    @abstractmethod
    def _slopes(self, point: Points) -> Values:
        """Return the derivatives of `gradient`, (outputs, inputs); `point` is a single point."""

    def _points(
        self,
        numbers: Mapping[str, ArrayLike],
        surface: ArrayLike,
        nodes: int | Sequence[int] | None,
        seed: int | None,
    ) -> tuple[Points, tuple[int, ...]]:
        """Check the arguments of a call; return its points, and the shape of its arrays.

        The n points are the places of arrays that are broadcast to this shape. InputError is raised
        for a name that is missing or unknown, for values that are no real numbers, for an index of
        a surface that is not allowed, and for arrays that do not broadcast. Other arguments are
        not checked here.
        """
        if numbers.keys() != set(self.names):
            passed = ", ".join(numbers) or "nothing"
            raise InputError(
                f"{passed} given: the function takes {', '.join(self.names)}"
            )
        with input_errors("input"):
            arrays = {name: real_array(name, numbers[name]) for name in self.names}
            arrays["surface"] = real_array("surface", surface)
        shape = _broadcast_shape(arrays)
        flat = {
            name: np.broadcast_to(array, shape).ravel() for name, array in arrays.items()
        }
        indices = _surface_indices(flat.pop("surface"))
        if isinstance(nodes, Sequence):
            nodes = list(nodes)
        return Points(numbers=flat, surface=indices, nodes=nodes, seed=seed), shape


def _broadcast_shape(arrays: Mapping[str, Values]) -> tuple[int, ...]:
    """Return the shape to which the arrays of a call are broadcast.

    Raises InputError, with the shapes of the arrays, if they do not broadcast.
    """
    try:
        return np.broadcast_shapes(*(array.shape for array in arrays.values()))
    except ValueError:
        shapes = ", ".join(
            f"{name} {array.shape}" for name, array in arrays.items() if array.ndim
        )
        raise InputError(
            f"input: arrays of shapes {shapes} do not belong together: give arrays of one"
            " length, or shapes that NumPy broadcasts"
        ) from None


def _surface_indices(numbers: Values) -> Indices:
    """Return indices of surfaces, (n,), as integers; refuse numbers that are no indices."""
    is_index = (numbers >= 0) & (numbers < SURFACES) & (numbers == np.floor(numbers))
    wrong = numbers[~is_index]
    if wrong.size:
        raise InputError(
            f"surface = {wrong[0]:g}: allowed: a whole number from 0 to {SURFACES - 1}"
        )
    return numbers.astype(np.int64)


class SceneFunction(Function):
    """The solver on the surfaces of a scene.

    Parameters
    ----------
    scene : Scene or str
        A scene, the name of a shipped one, or the path of a TOML file.
    outputs : sequence of str
        Names from `SOLVER_OUTPUTS`, which are columns of a database: area_percent, force, delta, or
        others as mean_gap, stiffness, continuum_area_percent or hydraulic_aperture_x. By default
        the first three.
    trust : bool
        True to run the Python function that the scene names for its surfaces. A scene with such a
        function is refused otherwise, unless the command line trusts it.

    Raises
    ------
    InputError
        If the scene cannot be used, or an output is unknown.
    """

    def __init__(
        self, scene: Scene | str, outputs: Sequence[str] = USUAL, *, trust: bool = False
    ) -> None:
        self.outputs = _require_available(SOLVER_OUTPUTS, outputs)
        self._trust = trust or TRUSTED.get()
        with self._trusted():
            if isinstance(scene, str):
                scene = load(scene)
            # By way of its text, the scene has its parameters in alphabetical order, as the scene
            # in the file of a surrogate has.
            self.scene = Scene.from_text(completed(scene).text())
        self.inputs = Inputs.of(self.scene)

    def _answers(self, points: Points) -> Values:
        """Solve the contact of each point, surface by surface; return the outputs, (n, outputs)."""
        answers = np.empty((points.surface.size, len(self.outputs)))
        with self._trusted(), _solver_errors():
            for surface in surfaces_of(self.scene, self.inputs, points):
                for number, place in enumerate(surface.places):
                    contact = _solved(surface, number)
                    for column, name in enumerate(self.outputs):
                        answers[place, column] = float(QUANTITIES[name].of(contact))
        return answers

    def _slopes(self, point: Points) -> Values:
        """Return the derivatives of the outputs by the inputs at one point, (outputs, inputs).

        They are NaN except those of `DIFFERENTIABLE` outputs by the load, and by parameters to
        which all heights are proportional unless these are 0.
        """
        with self._trusted(), _solver_errors():
            (surface,) = surfaces_of(self.scene, self.inputs, point)
            slopes = ContactSlopes(_solved(surface, 0))
            derivatives = np.full((len(self.outputs), len(self.names)), np.nan)
            for row, output in enumerate(self.outputs):
                if output not in DIFFERENTIABLE:
                    continue
                for column, name in enumerate(self.names):
                    value = float(point.numbers[name][0])
                    if name == self.inputs.load_name:
                        derivatives[row, column] = slopes.by_load(output, value)
                    elif self._scales_heights(name) and value != 0:
                        derivatives[row, column] = slopes.by_scale(
                            output, value, load_scales=self._load_is_relative(surface)
                        )
        return derivatives

    def _scales_heights(self, name: str) -> bool:
        """Return whether all heights are proportional to an input."""
        parameter = self.scene.surface.PARAMETERS.get(name)
        return parameter is not None and parameter.scales_heights

    def _load_is_relative(self, surface: OneSurface) -> bool:
        """Return whether loads are given relative to the rms height or slope of a surface."""
        return surface.kind != self.inputs.load

    @contextmanager
    def _trusted(self) -> Iterator[None]:
        """Let the function that the scene names run in this context, if this object trusts it."""
        token = TRUSTED.set(self._trust)
        try:
            yield
        finally:
            TRUSTED.reset(token)


@dataclass(frozen=True, eq=False)
class ContactSlopes:
    """Derivatives of the answers of a contact by its load and by the scale of its heights.

    Attributes
    ----------
    contact : bem.Contact
        The contact, at one point of the inputs.
    """

    contact: bem.Contact

    def by_load(self, output: str, load: float) -> float:
        """Differentiate an answer by the load of a call.

        Parameters
        ----------
        output : str
            One of `DIFFERENTIABLE`.
        load : float
            The load of the call, to which Delta or the force of the contact is proportional; not 0
            [any unit].

        Returns
        -------
        float
            Derivative [unit of the output / unit of the load].

        Raises
        ------
        ArithmeticError
            If the load is 0, or a linear solve does not converge.
        """
        return self._per_load(output) * self._absolute_load / load

    def by_scale(self, output: str, scale: float, *, load_scales: bool) -> float:
        """Differentiate an answer by a parameter to which all heights are proportional.

        Parameters
        ----------
        output : str
            One of `DIFFERENTIABLE`.
        scale : float
            Value of the parameter, not 0 [any unit].
        load_scales : bool
            Whether the Delta or the force that the load fixes is proportional to the parameter too.

        Returns
        -------
        float
            Derivative [unit of the output / unit of the parameter].

        Raises
        ------
        Unsolved
            If the contact has no gradient, see `bem.Contact.gradient`.
        ArithmeticError
            If a linear solve does not converge. `Unsolved` is a kind of it.
        """
        derivative = 0.0  # of the output that the load fixes
        if output != self._fixed_output:
            try:
                by_heights = self.contact.gradient(output)
            except ValueError as error:
                raise Unsolved(str(error)) from None
            derivative = float((by_heights * self.contact.problem.heights).sum()) / scale
        if load_scales:
            derivative += self._per_load(output) * self._absolute_load / scale
        return derivative

    @property
    def _fixed_output(self) -> str:
        """Name of the output that the load fixes: "delta" or "force"."""
        return FORCE.name if self.contact.problem.delta is None else DELTA.name

    @property
    def _absolute_load(self) -> float:
        """Delta [um] or the force [uN], whichever the load fixes."""
        return float(getattr(self.contact, self._fixed_output))

    def _per_load(self, output: str) -> float:
        """Differentiate an output by Delta [um] or the force [uN], whichever the load fixes."""
        if output == self._fixed_output:
            return 1.0
        stiffness = self.contact.loading_stiffness  # dF / dDelta [uN / um]
        per_delta = stiffness
        if output == MEAN_GAP.name:
            per_delta = self.contact.mean_gap_slope
        if self._fixed_output == DELTA.name:
            return per_delta
        if output == DELTA.name:
            return 1 / stiffness
        return per_delta / stiffness


def _require_available(
    available: Collection[str], outputs: Sequence[str]
) -> tuple[str, ...]:
    """Return the names of outputs as a tuple; refuse names that are not `available`."""
    unknown = set(outputs) - set(available)
    if unknown:
        raise InputError(
            f"{', '.join(sorted(unknown))}: outputs are {', '.join(available)}"
        )
    return tuple(outputs)


def _solved(surface: OneSurface, number: int) -> bem.Contact:
    """Solve the contact of a surface at one of its points; `number` is 0 for the first point."""
    hardness: float | None = None
    if surface.hardness is not None:
        hardness = float(surface.hardness[number])
    load: dict[str, Any] = {surface.kind: float(surface.loads[number])}
    return solve_contact(
        surface.scene,
        surface.heights,
        hardness=hardness,
        layer=surface.layer_of(number),
        **load,
    )


@contextmanager
def _solver_errors() -> Iterator[None]:
    """Turn errors of the solver in this context into InputError or `Unsolved`.

    Numbers whose products double precision cannot hold are an InputError. No solution, no
    convergence, arithmetic that fails and too little memory are `Unsolved`.
    """
    try:
        yield
    except bem.OutOfRange as error:
        raise InputError(str(error)) from None
    except (bem.NoSolution, bem.NotConverged, ArithmeticError) as error:
        raise Unsolved(str(error)) from None
    except MemoryError:
        raise Unsolved("memory has run out: give fewer nodes") from None


@dataclass(frozen=True)
class SurrogateOutput:
    """An output of a surrogate: a value, an end of its interval, or the flag of the training."""

    # short name, as "area"; "" for the flag, which is 1 inside the training and 0 outside
    target: str
    end: Literal["", "low", "high"] = ""  # of the interval; "" for the value
    mean: bool = False  # True for the mean over all surfaces of the parameters


def _outputs_of(surrogate: "Surrogate") -> dict[str, SurrogateOutput]:
    """Return all outputs of a surrogate by name: first the targets, then the further ones.

    A target with the name of a further output takes its place.
    """
    from learn.models import POPULATION

    outputs = {target: SurrogateOutput(target) for target in surrogate.learnt}
    further_outputs = {"inside": SurrogateOutput(target="")}
    for target in surrogate.learnt:
        further_outputs[f"{target}_low"] = SurrogateOutput(target, end="low")
        further_outputs[f"{target}_high"] = SurrogateOutput(target, end="high")
        if surrogate.features.of_scene:
            further_outputs[f"{target}_mean"] = SurrogateOutput(target, mean=True)
        if surrogate.card["model"] == POPULATION.name:
            low = SurrogateOutput(target, end="low", mean=True)
            high = SurrogateOutput(target, end="high", mean=True)
            further_outputs[f"{target}_mean_low"] = low
            further_outputs[f"{target}_mean_high"] = high
    for name, output in further_outputs.items():
        outputs.setdefault(name, output)
    return outputs


@dataclass(frozen=True, eq=False)
class RowsOfPoints:
    """The rows to predict for the n points of a call, surface by surface."""

    rows: "Rows"
    places: Indices  # (n,), place of each row's point among the points of the call


@dataclass(frozen=True, eq=False)
class PredictedPoints:
    """The outputs of a surrogate at the n points of a call."""

    outputs: Values  # (n, outputs)
    # For each point, why it is outside the training; "" if it is inside.
    reasons: list[str]


class SurrogateFunction(Function):
    """A surrogate as a function; it predicts all points of a call together.

    The load is Delta [um], or the pressure [MPa] that the surrogate has learnt. A surrogate of a
    scene's own numbers takes these numbers, and makes no surface. `level` is the coverage of its
    intervals.

    Parameters
    ----------
    path : Path or str
        File of the surrogate.
    outputs : sequence of str, optional
        Targets, as "area"; the ends of their intervals, as "area_low" and "area_high"; and
        "inside", 1 inside the training and 0 outside. A surrogate of a scene's own numbers also
        has the mean over all surfaces of the parameters, "area_mean". If its model is the
        population, it has the ends of the interval of this mean, "area_mean_low" and
        "area_mean_high". By default all targets.
    outside : {"warn", "nan", "raise"}
        What to do with points outside the training: "warn" answers them, and the first call with
        such a point gives an `OutsideTraining` warning; "nan" answers them with NaN, but for
        "inside"; "raise" refuses them with an InputError. Intervals do not hold outside: their ends
        are NaN.
    level : float, optional
        Coverage of the intervals. By default 0.9, or the largest level below it that the surrogate
        reaches.

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
        from learn.surrogate import Surrogate
        from learn.surrogate.level import level_of

        if outside not in {"warn", "nan", "raise"}:
            raise InputError(f"outside = {outside!r}: allowed: warn, nan, raise")
        if level is not None:
            with input_errors():
                level = float(real_number("level", level, COVERAGE))
        self._path = Path(path).absolute()
        self._outside = outside
        self._warned = False
        self._lock = Lock()
        self.surrogate = Surrogate.load(self._path)
        self.level = level_of(self.surrogate, level)
        self.of_scene = self.surrogate.features.of_scene
        if outputs is None:
            outputs = tuple(self.surrogate.learnt)
        available = _outputs_of(self.surrogate)
        self.outputs = _require_available(available, outputs)
        self._descriptions = [available[name] for name in self.outputs]
        if self.of_scene:
            self.inputs = _inputs_of_numbers(self.surrogate)
        else:
            self.scene = _scene_without_code(self.surrogate, path)
            self.inputs = _inputs_of_surfaces(self.surrogate, self.scene)

    def __reduce__(self) -> tuple[Callable[[Path], "SurrogateFunction"], tuple[Path]]:
        """Return the function and the arguments that make a copy when it is unpickled.

        The copy reads the file again, so that no estimator is pickled.
        """
        make_copy = partial(
            SurrogateFunction,
            outputs=self.outputs,
            outside=self._outside,
            level=self.level,
        )
        return make_copy, (self._path,)

    def _answers(self, points: Points) -> Values:
        """Predict the n points of a call together; return the outputs, (n, outputs)."""
        if points.surface.size == 0:
            return np.empty((0, len(self.outputs)))
        predicted = self._predicted(points)
        self._refuse_or_warn(predicted.reasons)
        return self._withheld(predicted.outputs, predicted.reasons)

    def _slopes(self, point: Points) -> Values:
        """Return central differences of the predictions, (outputs, inputs); see `gradient`."""
        numbers = {name: float(values[0]) for name, values in point.numbers.items()}
        # An input of 0 has the step of an input of 1.
        steps = {name: STEP * (abs(number) or 1.0) for name, number in numbers.items()}
        # The point itself, then two neighbours for each input: above and below.
        neighbours = [numbers]
        for name, step in steps.items():
            neighbours.append({**numbers, name: numbers[name] + step})
            neighbours.append({**numbers, name: numbers[name] - step})
        moved = {name: np.array([near[name] for near in neighbours]) for name in numbers}
        surfaces = np.repeat(point.surface, len(neighbours))
        predicted = self._predicted(replace(point, numbers=moved, surface=surfaces))
        reasons_of_point = predicted.reasons[:1]
        self._refuse_or_warn(reasons_of_point)
        above = predicted.outputs[1::2]
        below = predicted.outputs[2::2]
        widths = 2 * np.array(list(steps.values()))
        derivatives = (above - below) / widths[:, None]
        is_flag = [output.target == "" for output in self._descriptions]
        derivatives[:, is_flag] = np.nan
        # Before `.T` there is a row for each input; `_withheld` takes a reason for each row.
        return self._withheld(derivatives, reasons_of_point * len(steps)).T

    def _predicted(self, points: Points) -> PredictedPoints:
        """Predict the n points of a call, inside the training or not.

        Intervals are computed only if an output needs them.
        """
        question = self._rows(points)
        needs_ends = any(out.end and not out.mean for out in self._descriptions)
        needs_ends_of_mean = any(out.end and out.mean for out in self._descriptions)
        level = self.level if needs_ends else None
        prediction = self.surrogate.predict_rows(question.rows, level=level)
        # The values are equal; only the intervals of the mean need a second prediction.
        of_mean = prediction
        if needs_ends_of_mean:
            of_mean = self.surrogate.predict_rows(
                question.rows, level=self.level, mean=True
            )
        places = question.places
        outputs = np.empty((places.size, len(self._descriptions)))
        for column, output in enumerate(self._descriptions):
            source = of_mean if output.mean else prediction
            outputs[places, column] = _output(source, output)
        reasons = np.empty(places.size, dtype=object)
        reasons[places] = prediction.reasons
        return PredictedPoints(outputs=outputs, reasons=reasons.tolist())

    def _rows(self, points: Points) -> RowsOfPoints:
        """Return the rows to predict for the n points of a call.

        Raises InputError if a surrogate of a scene's own numbers is asked about a surface.
        """
        from learn.features.rows import joined

        if self.of_scene:
            if not points.leave_surface_open:
                raise InputError(
                    "config: the surrogate answers for all surfaces of the parameters"
                )
            rows = self.surrogate.of_numbers(points.numbers)
            return RowsOfPoints(rows=rows, places=np.arange(points.surface.size))
        parts: list[Rows] = []
        places: list[Indices] = []
        for surface in surfaces_of(self.scene, self.inputs, points):
            on_surface = self.surrogate.for_surface(surface.heights, surface.scene.sides)
            rows = on_surface.rows(
                surface.loads, hardness=surface.hardness, layered=surface.bodies()
            )
            parts.append(rows)
            places.append(surface.places)
        return RowsOfPoints(rows=joined(parts), places=np.concatenate(places))

    def _refuse_or_warn(self, reasons: Sequence[str]) -> None:
        """Refuse points outside the training, or warn of them in the first call that has any.

        `reasons` say for each point why it is outside; "" if it is inside. The argument `outside`
        of this object decides. Sets `_warned`.
        """
        outside = [reason for reason in reasons if reason]
        if not outside or self._outside == "nan":
            return
        text = (
            f"{len(outside)} of {len(reasons)} points lie outside what {self._path.name}"
            f" was trained on: {outside[0]}"
        )
        if self._outside == "raise":
            raise InputError(text)
        with self._lock:
            is_first = not self._warned
            self._warned = True
        if is_first:
            advice = 'the output "inside" tells which; further calls do not warn'
            # The warning names the line of the user's call, which is the fourth frame: the first
            # three are this method, `_answers` or `_slopes`, and the public method.
            warnings.warn(f"{text}; {advice}", OutsideTraining, stacklevel=4)

    def _withheld(self, outputs: Values, reasons: Sequence[str]) -> Values:
        """Set outputs, (n, outputs), that do not hold outside the training to NaN; return them.

        These are the ends of intervals, and all outputs but the flag if `outside` is "nan".
        `reasons` say for each of the n rows why it is outside; "" if it is inside. The array is
        changed in place.
        """
        is_outside = np.array([reason != "" for reason in reasons])
        for column, output in enumerate(self._descriptions):
            is_value = output.target != ""
            if output.end or (is_value and self._outside == "nan"):
                outputs[is_outside, column] = np.nan
        return outputs


def _inputs_of_numbers(surrogate: "Surrogate") -> Inputs:
    """Return the inputs of a surrogate of a scene's own numbers."""
    from learn.features.scene import HARDNESSES, LAYER_NUMBERS

    *drawn, load = surrogate.features.names  # the load is the last one
    parameters: list[str] = []
    hardness = ""
    layer: list[str] = []
    for name in drawn:
        if name in HARDNESSES:  # A scene gives one of them, or none.
            hardness = name
        elif name in LAYER_NUMBERS:
            layer.append(name)
        else:
            parameters.append(name)
    return Inputs(
        parameters=tuple(parameters), load=load, hardness=hardness, layer=tuple(layer)
    )


def _scene_without_code(surrogate: "Surrogate", path: Path | str) -> Scene:
    """Return the scene of a surrogate's training; refuse one whose surfaces a function makes.

    `path` is the file of the surrogate in messages.
    """
    scene = Scene.from_text(surrogate.card["scene"], str(path))
    if isinstance(scene.surface, PythonSurface):
        raise InputError(
            f"{path}: its surfaces come from {scene.surface.function}, and no code runs"
            " for a surrogate; give `learn predict` the surfaces themselves"
        )
    return scene


def _inputs_of_surfaces(surrogate: "Surrogate", scene: Scene) -> Inputs:
    """Return the inputs of a surrogate of surfaces, which a scene makes.

    The load is the scene's, if the surrogate has learnt this load, relative or not; otherwise the
    learnt one. The hardness is an input if it differs between the databases of the training or
    inside one. The numbers of a layer are inputs if the scene draws them.
    """
    inputs = Inputs.of(scene)
    load = surrogate.features.load
    # The scene's load is the learnt one or relative to the surface, as "delta/height_rms".
    if inputs.load.startswith(load):
        load = inputs.load
    limits = surrogate.hardness_limits
    hardness = ""
    if limits is not None and limits[0] < limits[1]:
        hardness = "hardness"
    return replace(inputs, load=load, hardness=hardness)


def _output(prediction: "Prediction", output: SurrogateOutput) -> Values:
    """Return one output of n predicted points, (n,).

    If the output is an end of an interval, the prediction must have been made with intervals.
    """
    if not output.target:
        return prediction.inside.astype(np.float64)
    if output.end == "low":
        return prediction.low[output.target]
    if output.end == "high":
        return prediction.high[output.target]
    return prediction.values[output.target]
