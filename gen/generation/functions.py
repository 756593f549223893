"""Functions of the user's: outputs of each contact, and what a run records of them in its scene."""

import json
import math
from collections.abc import Mapping
from contextlib import suppress
from numbers import Real
from pathlib import Path
from typing import Any

import numpy as np

import bem
from gen.runtime.errors import InputError, SourceError
from gen.runtime.user_code import faults_of, load_function, source_hash, source_of
from gen.scene import PythonSurface, Scene, Store, resolved
from gen.scene.columns import require_own_names

TRIED_ROWS = 16
"""Rows of which the first one with a solution shows the outputs of the user's function."""


Output = tuple[float, str | None]
"""One output of a user's function: its value, and its unit where it gives one."""


def outputs_of(store: Store, contact: bem.Contact, row: int) -> dict[str, float]:
    """Call the user's function for a contact, and return the outputs that its database has.

    A SourceError says that it is gone, has changed, fails, or returns anything else.
    """
    expected = store.outputs or {}
    found = called(store, contact, row)
    place = f"{store.function}, row {row}: "
    if found.keys() != expected.keys():
        returned, wanted = (
            ", ".join(sorted(names)[:12]) or "nothing" for names in (found, expected)
        )
        raise SourceError(f"{place}returned {returned}; the database has {wanted}")
    for name, (value, unit) in found.items():
        if unit not in {None, expected[name]}:
            raise SourceError(f"{place}{name} is in {unit!r}; the database has {expected[name]!r}")
        least, most = store.bounds(name)
        if value < least or value > most:
            raise SourceError(
                f"{place}{name} is {value:g}; its bounds in the scene are {least:g} and {most:g}"
            )
    return {name: value for name, (value, _) in found.items()}


def called(store: Store, contact: bem.Contact, row: int) -> dict[Any, Output]:
    """Call the user's function for a contact, whose arrays cannot be changed."""
    contact.pressure.setflags(write=False)
    place = f"{store.function}, row {row}"
    if store.function is None or store.source is None:  # only a file that no run has made lacks it
        raise SourceError(f"{store.function}: the scene lacks the hash of its source")
    with faults_of(place):
        returned = load_function(store.function, store.source)(contact)
        if not isinstance(returned, Mapping):
            kind = type(returned).__name__
            raise SourceError(f"{place}: returned a {kind}, not a dictionary of numbers by names")
        return {name: _output(name, returned[name], place) for name in returned}


def _output(name: object, returned: Any, place: str) -> Output:
    """Read a number, or a pair of a number and its unit."""
    paired = isinstance(returned, tuple) and len(returned) == 2
    value, unit = returned if paired else (returned, None)
    if isinstance(value, np.ndarray | np.generic) and value.ndim == 0:
        value = value.item()
    if not isinstance(name, str):
        raise SourceError(f"{place}: the name {name!r} is not a text")
    if not isinstance(value, Real) or not isinstance(unit, str | None):
        shown = str(returned)[:60]
        raise SourceError(f"{place}: {name} is {shown!r}, not a number, or a number and its unit")
    try:
        return float(value), unit
    except OverflowError:  # a whole number of hundreds of digits
        return math.inf, unit


def completed(scene: Scene, home: Path | None = None) -> Scene:
    """Complete a scene by what its database records, and load the user's functions.

    The outputs that a scene does not list are those of its first row that has a solution, which is
    solved here. The result depends on the scene and the functions' sources only.
    """
    require_own_names(scene)
    scene = resolved(scene, home)
    if isinstance(scene.surface, PythonSurface):
        load_function(scene.surface.function, str(scene.surface.source))
    if scene.store.function is None:
        return scene
    source = scene.store.source or source_hash(scene.store.function)
    load_function(scene.store.function, source)
    scene = _storing(scene, source=source)
    scene.surface.make_ready(home)
    if scene.store.outputs is None:
        scene = _storing(scene, outputs=_first_outputs(scene))
        require_own_names(scene)
    return scene


def rehearse(scene: Scene) -> None:
    """Call the user's functions once, so that one that fails does so before a file is made."""
    if scene.store.function is None and not isinstance(scene.surface, PythonSurface):
        return
    from gen.generation.sample import first_contact

    found = first_contact(scene, TRIED_ROWS)
    if found and scene.store.function is not None:
        with suppress(ArithmeticError):
            outputs_of(scene.store, found[1], found[0])


def functions(scene: Scene) -> list[str]:
    """List the functions of the user's that a scene calls, each with the file of its module."""
    named = {getattr(scene.surface, "function", None), scene.store.function} - {None}
    return [f"{name} of {source_of(name)}" for name in sorted(map(str, named))]


def _storing(scene: Scene, **keys: object) -> Scene:
    """Return a scene with further keys of the table [store]."""
    content = json.loads(scene.text())
    content["store"] |= keys
    return Scene.from_text(json.dumps(content), f"{scene.store.function}")


def _first_outputs(scene: Scene) -> dict[str, str]:
    """Return the outputs of the first row that has a solution, with their units."""
    from gen.generation.sample import first_contact

    # Rows beyond the samples are tried too: a larger database has the same outputs.
    found = first_contact(scene, TRIED_ROWS)
    fault = f"none of the first {TRIED_ROWS} rows has a solution"
    try:
        if found is not None:
            outputs = called(scene.store, found[1], found[0])
            return {name: unit or "1" for name, (_, unit) in outputs.items()}
    except ArithmeticError as error:
        fault = f"row {found[0]}: {type(error).__name__}" if found else fault
    raise InputError(
        f"{scene.store.function}, {fault}, so its outputs are unknown; give store.outputs ="
        " { name = 'unit' }"
    )
