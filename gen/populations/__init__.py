"""Populations of surfaces: for each generator of a scene, how it makes one surface."""

import importlib
from collections.abc import Iterable, Mapping
from pathlib import Path
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from gen.arrays import Heights
from gen.runtime.errors import InputError
from gen.runtime.user_code import source_hash
from gen.scene import PythonSurface, ScanSurface, Scene

MODULES: Mapping[str, str] = MappingProxyType(
    {
        "diamond-square": "gen.populations.displaced",
        "midpoint": "gen.populations.displaced",
        "spectral": "gen.populations.spectral",
        "scans": "gen.populations.scans",
        "python": "gen.populations.function",
    }
)
"""Modules that make the surfaces of each generator."""


def surface_heights(
    scene: Scene, surface: int, parameters: Mapping[str, float], random: np.random.Generator
) -> Heights:
    """Make one surface of a scene, a pure function of the scene and the surface's index.

    Parameters
    ----------
    scene : Scene
        The scene, whose generator decides.
    surface : int
        Index of the surface.
    parameters : mapping of str to float
        The parameters that were drawn for this surface, by their names.
    random : numpy.random.Generator
        The surface's own stream of random numbers.

    Returns
    -------
    ndarray, shape of `scene.shape`
        Heights above the lowest node [um].

    Raises
    ------
    InputError
        If the generator cannot make the surface, for example of a map that is gone, or if its
        numbers leave double precision.
    """
    # Modules are imported when a scene asks for them.
    module = importlib.import_module(MODULES[scene.surface.generator])
    try:
        heights: Heights = module.surface_heights(scene, surface, parameters, random)
    except ArithmeticError as error:
        raise InputError(
            f"surface {surface} cannot be made in double precision ({type(error).__name__}): give"
            " other parameters"
        ) from error
    return heights


def opposite_heights(
    scene: Scene,
    surface: int,
    parameters: Mapping[str, float],
    first: np.random.Generator,
    random: np.random.Generator,
) -> Heights:
    """Make the second rough body that a surface is pressed against.

    Parameters
    ----------
    scene : Scene
        A scene with `surface.against`.
    surface : int
        Index of the surface.
    parameters : mapping of str to float
        The parameters of the surface, which its second body shares.
    first, random : numpy.random.Generator
        The surface's own stream of random numbers, and the second body's.

    Returns
    -------
    ndarray, shape of `scene.shape`
        Heights above the lowest node [um].

    Raises
    ------
    InputError
        As `surface_heights`.
    """
    if isinstance(scene.surface, ScanSurface):
        from gen.populations import scans

        return scans.opposite_heights(scene, surface, parameters, first, random)
    return surface_heights(scene, surface, parameters, random)


def resolved(scene: Scene, home: Path | None = None) -> Scene:
    """Complete a scene by hashes of the files and sources that its surfaces depend on.

    Parameters
    ----------
    scene : Scene
        A scene that has been read from a file.
    home : Path, optional
        Folder of the database, for what is prepared once for all processes; a temporary folder if
        it is left out.

    Returns
    -------
    Scene
        The scene as a database records it; the same one if everything stands in the scene.

    Raises
    ------
    InputError
        If something that the scene names is missing.
    """
    if isinstance(scene.surface, PythonSurface) and scene.surface.source is None:
        known = scene.surface.model_copy(update={"source": source_hash(scene.surface.function)})
        return scene.model_copy(update={"surface": known})
    if isinstance(scene.surface, ScanSurface):
        from gen.populations import scans

        return scans.resolved(scene, home)
    return scene


def make_ready(
    scene: Scene, home: Path | None, *, sources: bool = False, verify: bool = True
) -> None:
    """Open the files that the surfaces of a database's scene are made from, in this process.

    Parameters
    ----------
    scene : Scene
        The scene of a database.
    home : Path or None
        Folder of the database.
    sources : bool
        Whether files that the surfaces come from have to be there, even if what was prepared of
        them is kept.
    verify : bool
        Whether to look for damage in what is kept; the master does, and its workers follow it.

    Raises
    ------
    SourceError
        If something is missing, or another one than the database was made of.
    """
    if isinstance(scene.surface, ScanSurface):
        from gen.populations import scans

        scans.open_maps(scene, home, sources=sources, verify=verify)


def remarks(scene: Scene) -> list[str]:
    """Return lines for the user of a run about its material and the source of its surfaces."""
    lines = [f"warning: {line}" for line in scene.contact.doubts]
    if isinstance(scene.surface, ScanSurface):
        from gen.populations import scans

        lines += scans.remarks(scene)
    return lines


def places(scene: Scene, randoms: Iterable[np.random.Generator]) -> dict[str, NDArray[np.int32]]:
    """Return where surfaces were taken from, by the names of the columns.

    Parameters
    ----------
    scene : Scene
        The scene.
    randoms : iterable of numpy.random.Generator
        The own stream of random numbers of each surface.
    """
    if isinstance(scene.surface, ScanSurface):
        from gen.populations import scans

        return scans.places(scene, randoms)
    return {}
