"""Completion of a scene before a run: the sources, outputs and powers that databases record.

The outputs of a user's function are tried on contacts of the scene before the first row is written.
These contacts are solved again at twice the heights, twice the lengths and twice E*: where the
outputs change by whole powers of two, surrogates know how they scale.
"""

import json
import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import bem
from gen.arrays import Heights
from gen.distribution import limits
from gen.generation.outputs import FunctionOutput, call_function, outputs_for_row
from gen.generation.plan import parameters
from gen.generation.sample import absolute_load, settings_of, surface_of
from gen.generators.function import PythonSurface
from gen.quantities import LOADS, PRESSURE, PURE, Powers
from gen.runtime.errors import InputError, SourceError
from gen.runtime.farm import Overtime, time_limit
from gen.runtime.user_code import load_function, source_hash
from gen.scene import Scene, require_distinct_names

TRIED_ROWS = 16
"""Rows, of which the first one with a solution shows the outputs of a function."""

UNSOLVED = (
    ArithmeticError,
    np.linalg.LinAlgError,
    InputError,
    bem.NoSolution,
    bem.NotConverged,
)
"""Exceptions of samples that have no solution."""

DOUBLED = (Powers(1, 0, 0), Powers(0, 1, 0), Powers(0, 0, 1))
"""What is doubled to measure powers: heights, lengths, E*."""

WHOLE = 1e-6  # largest distance of a measured power from a whole number
HALVINGS = 8  # loads that are tried, each half of the last one, until one has a solution
LEAST_LOAD = 0.01  # load that stands for an end at 0, over the largest load


@dataclass(frozen=True, eq=False)
class SampleProblem:
    """The contact problem of one sample of a scene, on which a user's function is tried."""

    scene: Scene
    row: int  # number of the sample
    heights: Heights  # [um], (nx, ny)
    load: float  # in the scene's quantity
    hardness: float | None  # of the sample, where the scene draws it [MPa]

    def solve(self, doubled: Powers = PURE) -> bem.Contact:
        """Solve the contact, with heights, lengths or E* at twice their size.

        Parameters
        ----------
        doubled : Powers
            1 for what is doubled, 0 for what stays.

        Returns
        -------
        bem.Contact
            The contact; load and hardness are scaled so that it is the same but for its units.

        Raises
        ------
        bem.NoSolution
            If no contact has the load.
        bem.NotConverged
            If the solver needs more iterations than the scene allows.
        """
        settings = settings_of(self.scene, self.hardness)
        if settings["hardness"] is not None:
            settings["hardness"] *= _doubling(PRESSURE.powers, doubled)
        settings["modulus"] *= 2.0**doubled.modulus
        longer = 2.0**doubled.lengths
        settings["spacing"] = tuple(longer * step for step in settings["spacing"])
        load = absolute_load(self.scene, self.heights, self.load)
        settings["delta"] = None
        settings[load.kind] = load.value * _doubling(LOADS[load.kind].powers, doubled)
        along_x, along_y = self.scene.grid.sides
        sides = (longer * along_x, longer * along_y)
        return bem.solve(self.heights * 2.0**doubled.heights, sides, **settings)


def _doubling(powers: Powers | None, doubled: Powers) -> float:
    """Return the factor of a quantity with these powers when some sizes are doubled."""
    assert powers is not None  # every load has them
    exponent = (
        powers.heights * doubled.heights
        + powers.lengths * doubled.lengths
        + powers.modulus * doubled.modulus
    )
    return 2.0**exponent


def completed(
    scene: Scene,
    home: Path | None = None,
    *,
    rehearsed: bool = False,
    limit: float | None = None,
) -> Scene:
    """Complete a scene by what its database records, and load the user's functions.

    The outputs that a scene does not list are those of its first row that has a solution, which is
    solved here. The result depends on the scene and the functions' sources only.

    Parameters
    ----------
    scene : Scene
        The scene as it was read.
    home : Path, optional
        Folder of the database, for what is prepared once for all processes.
    rehearsed : bool
        True before a file is made: the first row is solved anyway, so that a function that fails
        does so now, and the powers of the outputs are measured.
    limit : float, optional
        Largest time of each call of the user's function, with its contact [s].

    Returns
    -------
    Scene
        The scene as a database records it.

    Raises
    ------
    InputError
        If the scene names what is missing, or its outputs cannot be known. SourceError, an
        InputError, if a function of the user's fails or is not trusted.
    """
    require_distinct_names(scene)
    scene = scene.resolved(home)
    function = scene.store.function
    if isinstance(scene.surface, PythonSurface):
        load_function(scene.surface.function, scene.surface.source)
        if rehearsed and function is None:
            _rehearse_surface(scene, limit)
    if function is None:
        return scene
    source = scene.store.source or source_hash(function)
    load_function(function, source)
    scene = _storing(scene, source=source)
    scene.surface.make_ready(home)
    if scene.store.outputs is not None and not rehearsed:
        return scene
    scene = _with_outputs(scene, limit)
    require_distinct_names(scene)
    if rehearsed:
        scene = _storing(scene, powers=measured_powers(scene, limit) or None)
    return scene


def _with_outputs(scene: Scene, limit: float | None) -> Scene:
    """Try the function on the first row that has a solution; take its outputs if none are listed.

    A SourceError says what is wrong with the outputs; InputError is raised if they stay unknown.
    """
    store = scene.store
    problem: SampleProblem | None = None
    try:
        with time_limit(limit):
            problem = first_problem(scene)
            if problem is None:
                fault = f"none of the first {TRIED_ROWS} rows has a solution"
            elif store.outputs is not None:
                outputs_for_row(store, problem.solve(), problem.row)
            else:
                outputs = call_function(store, problem.solve(), problem.row)
                units = {name: output.unit or "1" for name, output in outputs.items()}
                return _storing(scene, outputs=units)
    except ArithmeticError as error:
        fault = f"row {problem.row if problem else 0}: {type(error).__name__}"
    except Overtime:
        fault = f"its trial on one row takes longer than --sample-limit {limit:g} s"
    if store.outputs is not None:
        return scene
    raise InputError(
        f"{store.function}, {fault}, so its outputs are unknown; give store.outputs ="
        " { name = 'unit' }"
    )


def _rehearse_surface(scene: Scene, limit: float | None) -> None:
    """Make and solve the first row, so that a generator that fails does so before a run."""
    try:
        with time_limit(limit):
            first_problem(scene)
    except Overtime:
        return  # the run leaves such rows pending, and tells the user


def first_problem(scene: Scene) -> SampleProblem | None:
    """Find the first row that has a solution, by solving the first `TRIED_ROWS` rows in turn.

    Parameters
    ----------
    scene : Scene
        A scene that knows its sources. A larger database has the same outputs, so that rows
        beyond its samples count too.

    Returns
    -------
    SampleProblem or None
        The contact problem of the row, which has been solved once; None if no row has a solution.

    Raises
    ------
    SourceError
        If the user's generator fails.
    """
    plan = parameters(scene, 0, TRIED_ROWS)
    for row in range(TRIED_ROWS):
        try:
            problem = SampleProblem(
                scene=scene,
                row=row,
                heights=surface_of(scene, plan, row),
                load=float(plan.load[row]),
                hardness=plan.hardness_of(row),
            )
            problem.solve()
        except SourceError:
            raise
        except UNSOLVED:
            continue
        return problem
    return None


def measured_powers(scene: Scene, limit: float | None = None) -> dict[str, Powers]:
    """Measure with which powers of heights, lengths and E* the outputs of a function scale.

    Each output is compared on three contacts, at both ends and the middle of the scene's loads,
    with those at twice the heights, twice the lengths and twice E*.

    Parameters
    ----------
    scene : Scene
        A scene with a function and its outputs.
    limit : float, optional
        Largest time of each contact and its call [s].

    Returns
    -------
    dict of str to Powers
        The powers of outputs by their names. Outputs are left out whose powers are not whole, or
        not the same in all three contacts, or that are 0 in one of them. The result is empty if a
        contact has no solution, the function fails, or the time is not enough.
    """
    try:
        problems = _problems_over_the_loads(scene, limit)
        measured = [_powers_at(problem, limit) for problem in problems]
    except (Overtime, *UNSOLVED):
        # Of these, a SourceError is met again by the run itself, which tells the user.
        return {}
    if not measured:
        return {}
    powers = measured[0]
    for powers_at_load in measured[1:]:
        powers = {
            name: power
            for name, power in powers.items()
            if powers_at_load.get(name) == power
        }
    return powers


def _problems_over_the_loads(
    scene: Scene, limit: float | None
) -> Iterator[SampleProblem]:
    """Yield three problems on the surface of the first row that has a solution.

    Their loads are the smallest, the middle and the largest one of the scene. A load without a
    solution, as beyond full contact, is halved until it has one; NoSolution is raised if that is
    not enough. None is yielded if no row has a solution. `limit` is the largest time for finding
    the first problem, and for each trial after it [s]; Overtime is raised beyond it.
    """
    with time_limit(limit):
        first = first_problem(scene)
    if first is None:
        return
    ends = [limits(piece.range) for piece in scene.pieces]
    largest = max(high for _, high in ends)
    smallest = min(low for low, _ in ends) or LEAST_LOAD * largest
    for load in (smallest, (smallest + largest) / 2, largest):
        yield _solvable(first, load, limit)


def _solvable(first: SampleProblem, load: float, limit: float | None) -> SampleProblem:
    """Return the problem on the surface of `first` at a load, halved until there is a solution."""
    for halving in range(HALVINGS):
        problem = SampleProblem(
            first.scene, first.row, first.heights, load / 2**halving, first.hardness
        )
        try:
            with time_limit(limit):
                problem.solve()
        except UNSOLVED:
            continue
        return problem
    raise bem.NoSolution(f"no contact at load {load:g}")


def _powers_at(problem: SampleProblem, limit: float | None) -> dict[str, Powers]:
    """Measure the powers of all outputs on one contact; leave out those that have none."""
    outputs = _outputs_at(problem, PURE, limit)
    outputs_doubled = [_outputs_at(problem, doubled, limit) for doubled in DOUBLED]
    powers = {}
    for name, output in outputs.items():
        measured = []
        for doubled in outputs_doubled:
            power = _power(output, doubled.get(name))
            if power is not None:
                measured.append(power)
        if len(measured) == len(DOUBLED):
            powers[name] = Powers(*measured)
    return powers


def _outputs_at(
    problem: SampleProblem, doubled: Powers, limit: float | None
) -> dict[str, FunctionOutput]:
    """Call the user's function for a contact some of whose sizes are doubled."""
    with time_limit(limit):
        return call_function(problem.scene.store, problem.solve(doubled), problem.row)


def _power(before: FunctionOutput, after: FunctionOutput | None) -> int | None:
    """Return the whole power of two by which doubling a size changes an output, or None."""
    if after is None:
        return None
    if not (before.value and after.value):
        return None
    if not (math.isfinite(before.value) and math.isfinite(after.value)):
        return None
    ratio = after.value / before.value
    if not 0 < ratio < math.inf:
        return None
    power = math.log2(ratio)
    nearest = round(power)
    return nearest if abs(power - nearest) <= WHOLE else None


def _storing(scene: Scene, **keys: object) -> Scene:
    """Return a scene with further keys of the table [store]."""
    content = json.loads(scene.text())
    content["store"] |= keys
    return Scene.from_text(json.dumps(content), "the scene with its outputs")
