"""Completion of a scene before a run: the sources, outputs and dimensions that databases record.

The outputs of a user's function are tried on contacts of the scene before the first row is written.
These contacts are solved again at twice the heights, twice the lengths and twice E*: where the
outputs change by whole powers of two, surrogates know how they scale.
"""

import json
import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import bem
from gen.arrays import Heights
from gen.distribution import limits
from gen.generation.plan import parameters
from gen.generation.sample import (
    Output,
    called,
    load_of,
    outputs_of,
    settings_of,
    surface_of,
)
from gen.generators.function import PythonSurface
from gen.quantities import LOADS, PRESSURE, PURE, Powers
from gen.runtime.errors import InputError, SourceError
from gen.runtime.farm import Overtime, time_limit
from gen.runtime.user_code import load_function, source_hash
from gen.scene import Scene, require_distinct_names

TRIED_ROWS = (
    16  # rows, of which the first one with a solution shows the outputs of a function
)
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
HALVINGS = 8  # of a load without a solution, before no powers are measured
LEAST_LOAD = 0.01  # load that stands for an end at 0, over the largest load


@dataclass(frozen=True, eq=False)
class Trial:
    """A contact problem of a scene, on which a function of the user's is tried."""

    scene: Scene
    row: int
    heights: Heights  # [um], (nx, ny)
    load: float  # in the scene's quantity
    hardness: float | None  # of the row, where the scene draws it [MPa]

    def contact(self, doubled: Powers = PURE) -> bem.Contact:
        """Solve the contact, with heights, lengths or E* at twice their size.

        Parameters
        ----------
        doubled : Powers
            1 for what is doubled, 0 for what stays.

        Returns
        -------
        bem.Contact
            The contact; load and hardness are scaled so that it is the same but for its units.
        """
        settings = settings_of(self.scene, self.hardness)
        ((kind, load),) = load_of(self.scene, self.heights, self.load).items()
        if settings["hardness"] is not None:
            settings["hardness"] *= _doubling(PRESSURE.powers, doubled)
        settings["modulus"] *= 2.0**doubled.modulus
        longer = 2.0**doubled.lengths
        settings["spacing"] = tuple(longer * step for step in settings["spacing"])
        loads: dict[str, Any] = {
            "delta": None,
            kind: load * _doubling(LOADS[kind].powers, doubled),
        }
        along_x, along_y = self.scene.grid.sides
        sides = (longer * along_x, longer * along_y)
        return bem.solve(self.heights * 2.0**doubled.heights, sides, **loads, **settings)


def _doubling(powers: Powers | None, doubled: Powers) -> float:
    """Return the factor of a load of some powers where some sizes are doubled."""
    assert powers is not None  # every load has them
    return 2.0 ** sum(
        power * double for power, double in zip(powers, doubled, strict=True)
    )


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
            _bounded_trial(scene, limit)
    if function is None:
        return scene
    source = scene.store.source or source_hash(function)
    load_function(function, source)
    scene = _storing(scene, source=source)
    scene.surface.make_ready(home)
    if scene.store.outputs is not None and not rehearsed:
        return scene
    scene = _with_outputs(scene, str(function), limit)
    require_distinct_names(scene)
    if rehearsed:
        scene = _storing(scene, powers=measured_powers(scene, limit) or None)
    return scene


def _with_outputs(scene: Scene, function: str, limit: float | None) -> Scene:
    """Try the function on the first row that has a solution; take its outputs if none are listed.

    A SourceError says what is wrong with the outputs; InputError is raised if they stay unknown.
    """
    trial: Trial | None = None
    try:
        with time_limit(limit):
            trial = first_trial(scene)
            if trial is None:
                fault = f"none of the first {TRIED_ROWS} rows has a solution"
            elif scene.store.outputs is not None:
                outputs_of(scene.store, trial.contact(), trial.row)
            else:
                outputs = called(scene.store, trial.contact(), trial.row)
                units = {name: unit or "1" for name, (_, unit) in outputs.items()}
                return _storing(scene, outputs=units)
    except ArithmeticError as error:
        fault = f"row {trial.row if trial else 0}: {type(error).__name__}"
    except Overtime:
        fault = f"its trial on one row takes longer than --sample-limit {limit:g} s"
    if scene.store.outputs is not None:
        return scene
    raise InputError(
        f"{function}, {fault}, so its outputs are unknown; give store.outputs = {{ name = 'unit' }}"
    )


def _bounded_trial(scene: Scene, limit: float | None) -> None:
    """Make and solve the first row, so that a generator that fails does so before a run."""
    try:
        with time_limit(limit):
            first_trial(scene)
    except Overtime:
        return  # the run leaves such rows pending, and says so


def first_trial(scene: Scene) -> Trial | None:
    """Return the first row that has a solution, of `TRIED_ROWS`, perhaps beyond the samples.

    Parameters
    ----------
    scene : Scene
        A scene that knows its sources. A larger database has the same outputs, so that rows
        beyond its samples count too.

    Returns
    -------
    Trial or None
        The contact problem of the row, which has been solved once; None if no row has a solution.

    Raises
    ------
    SourceError
        If the user's generator fails.
    """
    plan = parameters(scene, 0, TRIED_ROWS)
    for row in range(TRIED_ROWS):
        try:
            heights = surface_of(scene, plan, row)
            trial = Trial(
                scene, row, heights, float(plan.load[row]), plan.hardness_of(row)
            )
            trial.contact()
        except SourceError:
            raise
        except UNSOLVED:
            continue
        return trial
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
        not the same in all three contacts, or that are 0 in one of them.
    """
    try:
        trials = _trials_over_the_loads(scene, limit)
        measured = [_powers_at(trial, limit) for trial in trials]
    except (
        Overtime,
        *UNSOLVED,
    ):  # SourceError is an InputError: the run itself will meet it
        return {}
    if not measured:
        return {}
    first, *others = measured
    return {
        name: powers
        for name, powers in first.items()
        if all(other.get(name) == powers for other in others)
    }


def _trials_over_the_loads(scene: Scene, limit: float | None) -> Iterator[Trial]:
    """Yield the problems at both ends and the middle of the loads, on the first surface.

    A load without a solution, as beyond full contact, is halved until it has one.
    """
    with time_limit(limit):
        first = first_trial(scene)
    if first is None:
        return
    ends = [limits(piece.range) for piece in scene.pieces]
    high = max(end for _, end in ends)
    low = min(end for end, _ in ends) or LEAST_LOAD * high
    for load in (low, (low + high) / 2, high):
        for halving in range(HALVINGS):
            trial = Trial(
                scene, first.row, first.heights, load / 2**halving, first.hardness
            )
            try:
                with time_limit(limit):
                    trial.contact()
            except UNSOLVED:
                continue
            yield trial
            break
        else:
            raise bem.NoSolution(f"no contact at load {load:g}")


def _powers_at(trial: Trial, limit: float | None) -> dict[str, Powers]:
    """Measure the powers of all outputs on one contact; leave out those that have none."""
    outputs = _called_on(trial, PURE, limit)
    changed = [_called_on(trial, doubled, limit) for doubled in DOUBLED]
    powers = {}
    for name, (value, _) in outputs.items():
        ratios = [_power(value, other[name][0]) for other in changed if name in other]
        whole = [round(ratio) for ratio in ratios if ratio is not None]
        if len(whole) == len(DOUBLED):
            powers[name] = Powers(*whole)
    return powers


def _called_on(trial: Trial, doubled: Powers, limit: float | None) -> dict[Any, Output]:
    """Call the user's function for a contact some of whose sizes are doubled."""
    with time_limit(limit):
        return called(trial.scene.store, trial.contact(doubled), trial.row)


def _power(value: float, doubled: float) -> float | None:
    """Return the power of two between a value and the one at a doubled size, if it is whole."""
    if not (value and doubled and math.isfinite(value) and math.isfinite(doubled)):
        return None
    ratio = doubled / value
    if not 0 < ratio < math.inf:
        return None
    power = math.log2(ratio)
    return power if abs(power - round(power)) <= WHOLE else None


def _storing(scene: Scene, **keys: object) -> Scene:
    """Return a scene with further keys of the table [store]."""
    content = json.loads(scene.text())
    content["store"] |= keys
    return Scene.from_text(json.dumps(content), "the scene with its outputs")
