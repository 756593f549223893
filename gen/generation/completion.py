"""Completion of a scene before a run: the sources, outputs and powers that databases record.

Before the first row is written, a user's function is called for contacts of the scene, which shows
its outputs. These contacts are solved again with twice the heights, twice the lengths and twice E*.
If an output changes by whole powers of two, the exponents are recorded as its powers, by which
surrogates scale it.
"""

import json
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import bem
from gen.arrays import Heights
from gen.distribution import limits
from gen.generation.accuracy import with_accuracy
from gen.generation.outputs import FunctionOutput, call_function, outputs_for_row
from gen.generation.plan import parameters
from gen.generation.sample import UNSOLVED, absolute_load, settings_of, surface_of
from gen.generators.function import PythonSurface
from gen.quantities import LOADS, PRESSURE, PURE, Powers
from gen.runtime.errors import InputError, SourceError
from gen.runtime.farm import Overtime, time_limit
from gen.runtime.user_code import load_function, source_hash
from gen.scene import Scene, load, require_distinct_names, require_expected_columns

TRIED_ROWS = 16
"""Number of first rows among which a row with a solution is looked for, to try a function on it."""

DOUBLED = (
    Powers(heights=1, lengths=0, modulus=0),
    Powers(heights=0, lengths=1, modulus=0),
    Powers(heights=0, lengths=0, modulus=1),
)
"""Sizes that are doubled to measure powers, one at a time in this order: heights, lengths, E*.

A size with the number 1 is doubled, a size with 0 keeps its value.
"""

WHOLE = 1e-6
"""Largest difference between a measured power and a whole number that rounding can explain."""

HALVINGS = 8
"""Largest number of loads that are tried, each of them half of the one before."""

LEAST_LOAD = 0.01
"""Load at which powers are measured if the smallest load of a scene is 0, as a share of the largest
load."""


@dataclass(frozen=True, eq=False)
class SampleProblem:
    """The contact problem of one sample of a scene, on which a user's function is tried."""

    scene: Scene
    row: int  # number of the sample
    heights: Heights  # heights of its surface [um], shape (nx, ny)
    load: float  # load in the scene's quantity, which need not be the planned one
    hardness: float | None  # hardness of the softer body [MPa]; None for elastic bodies
    layer: Mapping[
        str, float
    ]  # drawn numbers of the layer, as `Plan.layer_of` returns them

    def solve(self, doubled: Powers = PURE) -> bem.Contact:
        """Solve the contact, with heights, lengths or E* at twice their size.

        The load and the hardness change with them by their own powers, so the contact is a
        scaled copy of the original one: the same nodes touch.

        Parameters
        ----------
        doubled : Powers
            1 for each size that is doubled, 0 for each size that keeps its value. By default no
            size is doubled.

        Returns
        -------
        bem.Contact
            The solved contact.

        Raises
        ------
        bem.NoSolution
            If no contact has the load.
        bem.NotConverged
            If the solver needs more iterations than the scene allows.
        """
        settings = settings_of(self.scene, self.hardness, self.layer)
        if settings["hardness"] is not None:
            settings["hardness"] *= _doubling(PRESSURE.powers, doubled)
        if "body" in settings:
            settings["body"] = settings["body"].scaled(
                lengths=2.0**doubled.lengths, moduli=2.0**doubled.modulus
            )
        else:
            settings["modulus"] *= 2.0**doubled.modulus
        stretch = 2.0**doubled.lengths  # factor of all lengths along the surface
        settings["spacing"] = tuple(stretch * step for step in settings["spacing"])
        load = absolute_load(self.scene, self.heights, self.load)
        settings[load.kind] = load.value * _doubling(LOADS[load.kind].powers, doubled)
        side_x, side_y = self.scene.grid.sides  # [um]
        sides = (stretch * side_x, stretch * side_y)
        return bem.solve(self.heights * 2.0**doubled.heights, sides, **settings)


def _doubling(powers: Powers | None, doubled: Powers) -> float:
    """Return the factor by which a quantity changes if some sizes are doubled.

    The quantity scales with `powers` of these sizes. `doubled` has 1 for a doubled size, else 0.
    """
    # Loads and pressures have powers; other quantities may have None.
    assert powers is not None
    exponent = (
        powers.heights * doubled.heights
        + powers.lengths * doubled.lengths
        + powers.modulus * doubled.modulus
    )
    return 2.0**exponent


def load_scene(name: str) -> Scene:
    """Read the scene of a run.

    Parameters
    ----------
    name : str
        Name of a preset, or path of a scene's TOML file or of a database (`.h5`), whose recorded
        scene is taken.

    Returns
    -------
    Scene
        The scene.

    Raises
    ------
    InputError
        If there is no such scene, or the file cannot be used.
    """
    if Path(name).suffix.lower() != ".h5":
        return load(name)
    from gen.database import Reader  # here, because few runs begin with a database

    with Reader(Path(name)) as reader:
        return reader.scene


def recorded_scene(path: Path, scene: Scene) -> Scene | None:
    """Return the scene that a database has recorded, if a run has to know it.

    Parameters
    ----------
    path : Path
        The database, which need not exist.
    scene : Scene
        The scene of the run.

    Returns
    -------
    Scene or None
        The recorded scene; None if there is no database, or the scene asks for no accuracy.

    Raises
    ------
    InputError
        If the file is no database.
    """
    if scene.accuracy is None or not path.exists():
        return None
    from gen.database import Reader  # here, because few scenes ask for an accuracy

    with Reader(path) as reader:
        return reader.scene


def completed(
    scene: Scene,
    home: Path | None = None,
    *,
    rehearsed: bool = False,
    limit: float | None = None,
    recorded: Scene | None = None,
    watched: bool = False,
) -> Scene:
    """Complete a scene with everything that its database records, and load the user's functions.

    The hashes of the files and functions that the scene names are added. If the scene has a
    function but no list of outputs, the function is called for the first row that has a solution,
    and the outputs that it returns are added. If the scene asks for an accuracy, the grid that a
    trial finds is added, see `gen.generation.accuracy`. The result depends on the scene and the
    sources of its functions only.

    Parameters
    ----------
    scene : Scene
        The scene as it was read.
    home : Path, optional
        Folder of the database, in which prepared maps are kept for all processes. Without it they
        are kept in a temporary folder.
    rehearsed : bool
        Whether the user's functions are tried even if the outputs are listed, as before a new file
        is made. A function that fails then raises its error before the run, and the powers of the
        outputs are measured and added to the scene.
    limit : float, optional
        Largest time of a trial: making surfaces, solving contacts and calling the function [s].
        In the trial for an accuracy it is the largest time of each contact.
    recorded : Scene, optional
        The scene of the database if there is one already. The grid for an accuracy is taken from
        there, and no trial is made.
    watched : bool
        Whether the progress of the trial for an accuracy is printed on standard error.

    Returns
    -------
    Scene
        The scene as a database records it.

    Raises
    ------
    InputError
        If the scene names a file that is missing, if a parameter or an output has the name of
        something else, if the scene expects the mean of a column that it does not have, if the
        outputs stay unknown, or if no grid gives the accuracy.
    SourceError
        If a function of the user's fails or is not trusted. It is a kind of InputError.
    """
    require_distinct_names(scene)
    require_expected_columns(scene)
    if recorded is not None:
        scene = scene.with_accuracy_of(recorded)
    elif scene.needs_trial:
        scene = _with_accuracy(scene, limit, watched=watched)
    scene = scene.resolved(home)
    function = scene.store.function
    if isinstance(scene.surface, PythonSurface):
        load_function(scene.surface.function, scene.surface.source)
        # With a function for outputs, the trial of that function below tries the surfaces too.
        if rehearsed and function is None:
            _rehearse_surface(scene, limit)
    if function is None:
        return scene  # no outputs have to be found out
    source = scene.store.source or source_hash(function)
    load_function(function, source)
    scene = _storing(scene, source=source)
    scene.surface.make_ready(home)
    if scene.store.outputs is not None and not rehearsed:
        return scene
    scene = _with_outputs(scene, limit)
    # Checked again with the names of the outputs.
    require_distinct_names(scene)
    require_expected_columns(scene)
    if rehearsed:
        powers = measured_powers(scene, limit)
        scene = _storing(scene, powers=powers or None)  # an empty table is left out
    return scene


def _with_accuracy(scene: Scene, limit: float | None, *, watched: bool) -> Scene:
    """Return a scene with the grid and the tolerance that a trial finds for its accuracy.

    Maps are prepared in a temporary folder, because nothing may be written into the folder of the
    database unless such a grid is found. Raises the errors of
    `gen.generation.accuracy.with_accuracy`.
    """
    if scene.store.function is not None:
        # A function that is missing or not trusted is refused before the trial and not after it.
        source_hash(scene.store.function)
    with TemporaryDirectory() as folder:
        resolved = scene.resolved(Path(folder))
        if isinstance(resolved.surface, PythonSurface):
            load_function(resolved.surface.function, resolved.surface.source)
        with_grid = with_accuracy(resolved, limit, watched=watched)
    return scene.with_accuracy_of(with_grid)


def _with_outputs(scene: Scene, limit: float | None) -> Scene:
    """Try the function on the first row that has a solution, and return the scene with its outputs.

    If the scene lists its outputs, the outputs of the function are compared with this list, and the
    scene is returned unchanged. Otherwise the names and units of the function's outputs are added.
    `limit` is the largest time of the trial [s]. Raises SourceError if the function fails or its
    outputs are not the listed ones, and InputError if outputs are not listed and the trial finds
    none.
    """
    store = scene.store
    problem: SampleProblem | None = None
    try:
        with time_limit(limit):
            problem = first_problem(scene)
            if problem is None:
                fault = f"none of the first {TRIED_ROWS} rows has a solution"
            elif store.outputs is not None:
                # Called only for the errors that it raises.
                outputs_for_row(store, problem.solve(), problem.row)
            else:
                outputs = call_function(store, problem.solve(), problem.row)
                units = {name: output.unit or "1" for name, output in outputs.items()}
                return _storing(scene, outputs=units)
    except ArithmeticError as error:
        row = 0 if problem is None else problem.row
        fault = f"row {row}: {type(error).__name__}"
    except Overtime:
        fault = f"its trial on one row takes longer than --sample-limit {limit:g} s"
    if store.outputs is not None:
        return scene  # the outputs are known, also if the trial had no result
    raise InputError(
        f"{store.function}, {fault}, so its outputs are unknown; give store.outputs ="
        " { name = 'unit' }"
    )


def _rehearse_surface(scene: Scene, limit: float | None) -> None:
    """Make and solve the first rows, so that a generator that fails does so before a run.

    Raises SourceError if the user's generator fails. The trial ends without an error as soon as a
    row has a solution, after `TRIED_ROWS` rows, or after the largest time `limit` [s].
    """
    try:
        with time_limit(limit):
            first_problem(scene)
    except Overtime:
        return  # the run leaves slow rows pending, and tells the user


def first_problem(scene: Scene) -> SampleProblem | None:
    """Find the first row that has a solution, by solving the first `TRIED_ROWS` rows in turn.

    Parameters
    ----------
    scene : Scene
        A scene with the hashes of its sources. If it has fewer samples than `TRIED_ROWS`, rows
        beyond its samples are tried too, so that a larger database of the scene has the same
        outputs.

    Returns
    -------
    SampleProblem or None
        The contact problem of the row at its planned load; None if no row has a solution.

    Raises
    ------
    SourceError
        If the user's generator fails.
    """
    plan = parameters(scene, start=0, stop=TRIED_ROWS)
    for row in range(TRIED_ROWS):
        try:
            problem = SampleProblem(
                scene=scene,
                row=row,
                heights=surface_of(scene, plan, row),
                load=float(plan.load[row]),
                hardness=plan.hardness_of(row),
                layer=plan.layer_of(row),
            )
            problem.solve()  # to see whether there is a solution
        except SourceError:
            raise  # the user's function is wrong, not this row
        except UNSOLVED:
            continue
        return problem
    return None


def measured_powers(scene: Scene, limit: float | None = None) -> dict[str, Powers]:
    """Measure with which powers of heights, lengths and E* the outputs of a function scale.

    One surface is solved at three loads: the smallest one of the scene, the largest one and their
    mean. At each load, the outputs are compared with the outputs at twice the heights, at twice the
    lengths and at twice E*.

    Parameters
    ----------
    scene : Scene
        A scene with a function and its outputs.
    limit : float, optional
        Largest time of each contact with its call of the function [s].

    Returns
    -------
    dict of str to Powers
        The powers by the names of the outputs. An output is left out if it is 0 or not finite at a
        load, or if its powers are not whole numbers or differ between the loads. The result is
        empty if no row has a solution, no contact is found at one of the loads, the function fails,
        or a contact takes too long.
    """
    try:
        problems = _problems_over_the_loads(scene, limit)
        measured = [_powers_at(problem, limit) for problem in problems]
    except (Overtime, *UNSOLVED):
        # This includes a SourceError: the run itself meets it again, and tells the user.
        return {}
    if not measured:
        return {}  # none of the first rows has a solution
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
    """Yield three problems on the surface of the first row that has a solution, or none.

    Their loads are the smallest load of the scene, the mean of the smallest and the largest one,
    and the largest one. Each load is halved until it has a solution, see `_solvable`. Nothing is
    yielded if none of the first rows has a solution. `limit` is the largest time for finding the
    first problem, and for each trial of a load [s]; Overtime is raised beyond it.
    """
    with time_limit(limit):
        first = first_problem(scene)
    if first is None:
        return  # there is no surface to try the loads on
    ranges = [limits(piece.range) for piece in scene.pieces]
    largest = max(ends.largest for ends in ranges)
    smallest = min(ends.smallest for ends in ranges)
    if smallest == 0.0:  # outputs of bodies without a load are 0, or say nothing
        smallest = LEAST_LOAD * largest
    for tried_load in (smallest, (smallest + largest) / 2, largest):
        yield _solvable(first, tried_load, limit)


def _solvable(first: SampleProblem, load: float, limit: float | None) -> SampleProblem:
    """Return the problem `first` with another load, which is halved until there is a solution.

    A load beyond full contact, for example, has none. The solution is not kept. `limit` is the
    largest time for each of the `HALVINGS` loads [s]; Overtime is raised beyond it. Raises
    bem.NoSolution if no load has a solution.
    """
    for halvings in range(HALVINGS):
        problem = replace(first, load=load / 2**halvings)
        try:
            with time_limit(limit):
                problem.solve()
        except UNSOLVED:
            continue
        return problem
    raise bem.NoSolution(f"no contact at load {load:g}")


def _powers_at(problem: SampleProblem, limit: float | None) -> dict[str, Powers]:
    """Measure the powers of the outputs on one contact; return them by the outputs' names.

    An output without a whole power of heights, of lengths or of E* is left out. `limit` is the
    largest time for each of the four contacts [s]; Overtime is raised beyond it.
    """
    outputs = _outputs_at(problem, PURE, limit)
    outputs_doubled = [_outputs_at(problem, doubled, limit) for doubled in DOUBLED]
    powers = {}
    for name, output in outputs.items():
        measured = []  # the whole powers among those of heights, lengths and E*, in this order
        for outputs_of_copy in outputs_doubled:
            power = _power(output, outputs_of_copy.get(name))
            if power is not None:
                measured.append(power)
        if len(measured) == len(DOUBLED):
            powers[name] = Powers(*measured)
    return powers


def _outputs_at(
    problem: SampleProblem, doubled: Powers, limit: float | None
) -> dict[str, FunctionOutput]:
    """Solve a contact with some sizes doubled, and return the function's outputs by their names.

    `doubled` has 1 for each size that is doubled, else 0. Overtime is raised if this takes longer
    than `limit` [s].
    """
    with time_limit(limit):
        return call_function(problem.scene.store, problem.solve(doubled), problem.row)


def _power(before: FunctionOutput, after: FunctionOutput | None) -> int | None:
    """Return the whole power of two by which doubling a size has changed an output.

    `before` is the output of the original contact, and `after` that of the contact with the doubled
    size, or None if the function has not returned it. Return None if the output is missing then, if
    one of the two values is 0 or not finite, if the sign has changed, or if the power is not a
    whole number.
    """
    if after is None:
        return None  # the function has not returned this output again
    if before.value == 0.0 or after.value == 0.0:
        return None  # a zero does not show any power
    if not (math.isfinite(before.value) and math.isfinite(after.value)):
        return None
    ratio = after.value / before.value
    if not 0 < ratio < math.inf:
        return None  # the sign has changed, or the ratio is beyond all floats
    power = math.log2(ratio)
    nearest = round(power)
    if abs(power - nearest) > WHOLE:
        return None  # the output does not scale with a whole power
    return nearest


def _storing(scene: Scene, **keys: object) -> Scene:
    """Return a copy of a scene with some keys of its table [store] added or replaced."""
    content = json.loads(scene.text())
    content["store"] |= keys
    return Scene.from_text(json.dumps(content), "the scene with its outputs")
