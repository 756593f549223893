"""Completion of a scene by what only a run knows: hashes of sources, names of outputs."""

import json
from contextlib import suppress
from pathlib import Path

from gen.runtime.errors import InputError
from gen.runtime.user_code import load_function, source_hash, source_of
from gen.scene import PythonSurface, Scene
from gen.scene.columns import require_own_names

TRIED_ROWS = 16
"""Rows of which the first one with a solution shows the outputs of the user's function."""


def completed(scene: Scene, home: Path | None = None) -> Scene:
    """Complete a scene by the entries that its database records, and try the user's functions.

    The outputs that a scene does not list are those of its first row that has a solution, which is
    solved here. The result depends on the scene and the functions' sources only.

    Parameters
    ----------
    scene : Scene
        A scene that has been read from a file.
    home : Path, optional
        Folder of the database, for maps that are prepared; a temporary folder if it is left out.

    Returns
    -------
    Scene
        The scene as a database records it; the same one if everything stands in the scene.

    Raises
    ------
    InputError
        If something that the scene names is missing, a function cannot be loaded, or fails for the
        first row, or names of parameters or outputs are those of other columns.
    """
    require_own_names(scene)
    scene = scene.resolved(home)
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
    """Call a scene's functions once, so that one that fails does so before there is a database.

    Parameters
    ----------
    scene : Scene
        A scene that `completed` has returned.

    Raises
    ------
    SourceError
        If a function fails for the first surface, or for the first contact that has a solution.
    """
    if scene.store.function is None and not isinstance(scene.surface, PythonSurface):
        return
    from gen.generation.own_outputs import outputs_of
    from gen.generation.sample import first_contact, first_surface

    if scene.store.function is None:
        first_surface(scene)
    elif found := first_contact(scene, TRIED_ROWS):
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
    from gen.generation.own_outputs import called
    from gen.generation.sample import first_contact

    # Rows beyond the samples are tried too: a larger database has the same outputs.
    found = first_contact(scene, TRIED_ROWS)
    if found is None:
        raise InputError(
            f"{scene.store.function}: none of the first {TRIED_ROWS} rows has a solution that would"
            " show its outputs; give store.outputs = { name = 'unit' }"
        )
    row, contact = found
    try:
        outputs = called(scene.store, contact, row)
    except ArithmeticError as error:
        raise InputError(
            f"{scene.store.function}, row {row}: {type(error).__name__}, so its outputs are"
            " unknown; give store.outputs = { name = 'unit' }"
        ) from error
    return {name: output.unit or "1" for name, output in outputs.items()}
