"""Windows of measured maps for scenes.

The maps of a scene are opened once by every process: prepared by the first, found by the others. A
window's place needs the numbers of the maps' nodes only, which the scene of a database holds.
"""

from collections.abc import Iterable, Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gen.arrays import Heights
from gen.maps import library
from gen.maps.settings import Preparation, in_words_of_scenes
from gen.maps.windows import Pairing, Tiling, Window, cut, drawn, facing
from gen.runtime.errors import InputError, SourceError
from gen.scene import ScanSurface, Scene
from gen.scene.scans import Found, ScannedMap

_OPEN: dict[ScanSurface, library.Library] = {}
"""Prepared maps of the scenes of this process."""


def resolved(scene: Scene, home: Path | None) -> Scene:
    """MapSurvey for the maps of a scene, and prepare them unless that has been done.

    Parameters
    ----------
    scene : Scene
        A scene of windows.
    home : Path or None
        Folder for the prepared maps, that of the database; None for a temporary one.

    Returns
    -------
    Scene
        The scene with its maps: places, contents, nodes, and their common spacing.

    Raises
    ------
    InputError
        If a map is missing, cannot be prepared, is smaller than the window, or has another
        spacing, or if the scene asks for what maps of this spacing cannot have.
    """
    assert isinstance(scene.surface, ScanSurface)
    if scene.surface.found is not None:
        open_maps(scene, home, sources=True)
        return scene
    found = _looked_for(scene, home)
    surface = scene.surface.model_copy(update={"found": found})
    if isinstance(surface.against, tuple):
        other = _looked_for(opposite(scene), home)
        _require_company(found, other)
        surface = surface.model_copy(update={"against_found": other})
    # Read anew: some rules of a scene need the spacing of its maps.
    text = scene.model_copy(update={"surface": surface}).text()
    return Scene.from_text(text, "the scene with its maps")


def opposite(scene: Scene) -> Scene:
    """Return the scene of the second body's windows, for a scene that has one."""
    assert isinstance(scene.surface, ScanSurface)
    return scene.model_copy(update={"surface": scene.surface.opposite()})


def _looked_for(scene: Scene, home: Path | None) -> Found:
    """MapSurvey for the maps of one body, and prepare them unless that has been done."""
    from gen.maps.files import digests, map_files

    settings = _settings(scene)
    paths = map_files(settings.files, Path.cwd())
    sha256s = digests(paths)
    maps = library.prepared(paths, sha256s, _wanted(scene), home)
    found = Found(
        spacing=maps.spacing,
        maps=tuple(
            ScannedMap(file=str(path), sha256=sha256, nodes=shape)
            for path, sha256, shape in zip(paths, sha256s, maps.shapes, strict=True)
        ),
    )
    _OPEN[settings.model_copy(update={"found": found})] = maps
    return found


def _require_company(first: Found, second: Found) -> None:
    """Refuse maps of two bodies with other spacings, and maps that both have."""
    if first.spacing != second.spacing:
        spacings = " and ".join("{:g} x {:g}".format(*each.spacing) for each in (first, second))
        raise InputError(
            f"the maps of both bodies have a node every {spacings} um: give surface.spacing, to"
            " which all are resampled"
        )
    known = {each.sha256 for each in first.maps}
    for each in second.maps:
        if each.sha256 in known:
            raise InputError(
                f"{each.file}: is one of files and of against: against = 'another' takes a second"
                " window of the same map, otherwise a surrogate would be tested on nodes that it"
                " was trained on"
            )


def open_maps(
    scene: Scene, home: Path | None, *, sources: bool = False, verify: bool = True
) -> None:
    """Open the maps of a database's scene in this process.

    Parameters
    ----------
    scene : Scene
        A scene with its maps.
    home : Path or None
        Folder of the database, with the prepared maps.
    sources : bool
        Whether the files of the maps have to be there and unchanged. Without it, maps that have
        been prepared are enough.
    verify : bool
        Whether to compare prepared maps with their SHA-256. One process of a run does so.

    Raises
    ------
    SourceError
        If a map is missing, or is another one than the database was made of.
    """
    assert isinstance(scene.surface, ScanSurface)
    if isinstance(scene.surface.against, tuple):
        open_maps(opposite(scene), home, sources=sources, verify=verify)
    settings = _settings(scene)
    if settings in _OPEN and not sources:
        return
    try:
        kept = None if sources else _kept(scene, home, verify=verify)
        _OPEN[settings] = _fitting(kept or _prepared(scene, home), settings.known())
    except SourceError:
        raise
    except InputError as error:
        raise SourceError(str(error)) from None


def _kept(scene: Scene, home: Path | None, *, verify: bool) -> library.Library | None:
    """Return maps of a database's scene that have been prepared; None if none are kept."""
    sha256s = [each.sha256 for each in _settings(scene).known().maps]
    return library.opened(sha256s, _wanted(scene), home, verify=verify)


def _prepared(scene: Scene, home: Path | None) -> library.Library:
    """Find the files of the maps of a database's scene again, and prepare them if need be."""
    from gen.maps.files import located

    maps = _settings(scene).known().maps
    paths = [located(Path(each.file), each.sha256, home) for each in maps]
    return library.prepared(paths, [each.sha256 for each in maps], _wanted(scene), home)


def _fitting(maps: library.Library, known: Found) -> library.Library:
    """Refuse maps that are read otherwise than when the database was made."""
    shapes = tuple(each.nodes for each in known.maps)
    if maps.shapes != shapes or maps.spacing != known.spacing:
        raise SourceError(
            "the maps are read with other nodes or another spacing than when the database was made:"
            f" {maps.shapes} every {maps.spacing} um, {shapes} every {known.spacing} um then"
        )
    return maps


def remarks(scene: Scene) -> list[str]:
    """Return lines about the maps of a scene for the user of a run: numbers, place and warnings."""
    assert isinstance(scene.surface, ScanSurface)
    if isinstance(scene.surface.against, tuple):
        bodies = (scene.model_copy(update={"surface": scene.surface.alone()}), opposite(scene))
        both = enumerate(map(remarks, bodies), start=1)
        return [_of_body(number, line) for number, lines in both for line in lines]
    settings = _settings(scene)
    maps, tiling = _OPEN[settings], _tiling(settings)
    dx, dy = maps.spacing
    step = f"{dx:g} um" if dx == dy else f"{dx:g} x {dy:g} um"
    size = f"{len(maps.maps)} maps with a node every {step}, {tiling.total} tiles"
    lines = [f"{size}; they are kept prepared in {maps.file}"]
    for each, prepared in zip(settings.known().maps, maps.maps, strict=True):
        lines += [f"warning: {Path(each.file).name}: {remark}" for remark in prepared.remarks]
    return lines


def _of_body(number: int, line: str) -> str:
    """Say in a remark which of two bodies it is about."""
    warning = "warning: "
    rest = line.removeprefix(warning)
    return f"{line[: len(line) - len(rest)]}body {number}: {rest}"


def places(scene: Scene, randoms: Iterable[np.random.Generator]) -> dict[str, NDArray[np.int32]]:
    """Return the maps and tiles of surfaces, from the stream of random numbers of each.

    Tiles of a second body's own maps are paired with those of the first: the tile is that pair.
    """
    settings, pairing = _settings(scene), _pairing(scene)
    tiling, square = _tiling(settings), _is_square(settings)
    windows = [drawn(random, tiling, square=square) for random in randoms]
    return {
        "map": np.array([window.map for window in windows], dtype=np.int32),
        "tile": np.array([pairing.group(window.tile) for window in windows], dtype=np.int32),
    }


def tile_groups(scene: Scene) -> int:
    """Return the number of groups of tiles, the values that the column `tile` can have.

    Parameters
    ----------
    scene : Scene
        A scene with its maps.
    """
    return _pairing(scene).groups


def surface_heights(
    scene: Scene, surface: int, parameters: Mapping[str, float], random: np.random.Generator
) -> Heights:
    """Cut a window out; parameters and result are those of `gen.populations.surface_heights`."""
    return _cut(scene, _window(scene, random))


def opposite_heights(
    scene: Scene,
    surface: int,
    parameters: Mapping[str, float],
    first: np.random.Generator,
    random: np.random.Generator,
) -> Heights:
    """Cut the second body's window out; see `gen.populations.opposite_heights`."""
    other = opposite(scene)
    tiles = _pairing(scene).partners(_window(scene, first).tile)
    settings = _settings(other)
    window = facing(random, _tiling(settings), tiles, square=_is_square(settings))
    return _cut(other, window)


def _window(scene: Scene, random: np.random.Generator) -> Window:
    """Draw the window of the first body."""
    settings = _settings(scene)
    return drawn(random, _tiling(settings), square=_is_square(settings))


def _cut(scene: Scene, window: Window) -> Heights:
    """Cut a window of the scene's maps out."""
    settings = _settings(scene)
    if settings not in _OPEN:
        open_maps(scene, None)
    heights = _OPEN[settings].maps[window.map].heights
    return cut(heights, window, settings.shape(edgeless=True))


def _pairing(scene: Scene) -> Pairing:
    """Return the groups of tiles that windows of both bodies come from."""
    assert isinstance(scene.surface, ScanSurface)
    first = _tiling(_settings(scene)).total
    if scene.surface.against is None:
        return Pairing(first, first)
    return Pairing(first, _tiling(_settings(opposite(scene))).total)


def _settings(scene: Scene) -> ScanSurface:
    """Return the table of the first body's windows."""
    assert isinstance(scene.surface, ScanSurface)
    return scene.surface.alone()


def _tiling(settings: ScanSurface) -> Tiling:
    """Return the tiles of a scene's maps."""
    shapes = tuple(each.nodes for each in settings.known().maps)
    return Tiling(shapes, settings.shape(edgeless=True))


def _is_square(settings: ScanSurface) -> bool:
    """Tell whether a window has the symmetries of the square."""
    (nx, ny), (dx, dy) = settings.shape(edgeless=True), settings.known().spacing
    return nx == ny and dx == dy


def _wanted(scene: Scene) -> library.Wanted:
    """Return how the files of a scene are to be read and prepared."""
    settings = _settings(scene)
    given = settings.spacing
    spacing = given if given is None or isinstance(given, tuple) else (given, given)
    preparation = Preparation(**settings.preparation.given())
    try:
        preparation.check()
    except InputError as error:
        raise InputError(f"surface.preparation: {in_words_of_scenes(str(error))}") from None
    return library.Wanted(
        scene.shape, spacing, preparation, library.Reading(**settings.reading.given())
    )
