"""Survey measured maps: the content of each file, and its faults."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from gen.arrays import Heights
from gen.draft.spikes import Spikes, find_spikes
from gen.measured import form
from gen.measured.areal import areal_parameters
from gen.measured.preparation import FLAT, MOST_HOLES, STEEP, prepare, tilt
from gen.measured.resampling import resampled
from gen.measured.settings import Preparation
from gen.measured.topography import Sides, Topography, read
from gen.runtime.errors import InputError
from gen.scans.files import digest
from gen.scans.library import Reading
from gen.statistics import rms_slope

FORM = 0.9
"""Share of the variance about the mean plane that a quadratic form holds at least: less may be a
long wave of the roughness."""


@dataclass(frozen=True)
class MapSurvey:
    """The content of a file before any preparation.

    Attributes
    ----------
    path : Path
        The file.
    fault : str
        Why the file cannot be used, "" if it can.
    shape : tuple of int
        Nodes along x and y; (0, 0) of a file that cannot be read.
    spacing : tuple of float
        Distance of the nodes along x and y [um].
    unit : str
        Unit of the heights in the file, "" if it names none.
    missing : int
        Number of nodes without a height.
    spikes : Spikes or None
        Spikes, None of a file that cannot be read.
    tilt : tuple of float
        Slopes of the mean plane along x and y [1].
    form : float
        Share of the variance about the mean plane that a quadratic takes out [1].
    texture : Texture or None
        Roughness after the preparation; None before it is known.
    """

    path: Path
    fault: str = ""
    shape: tuple[int, int] = (0, 0)
    spacing: Sides = (math.nan, math.nan)
    unit: str = ""
    missing: int = 0
    spikes: Spikes | None = None
    tilt: Sides = (math.nan, math.nan)
    form: float = 0.0
    texture: Texture | None = None

    @property
    def holes(self) -> float:
        """Share of the nodes without a height [1]."""
        return self.missing / max(1, math.prod(self.shape))


@dataclass(frozen=True)
class Texture:
    """Roughness of a prepared map.

    Attributes
    ----------
    shape : tuple of int
        Nodes along x and y.
    rms_height : float
        Root mean square height [um].
    rms_slope : float
        Root mean square slope between neighbouring nodes, as in databases [1].
    length : float
        Autocorrelation length Sal of ISO 25178, NaN if half of the map is too short for it [um].
    """

    shape: tuple[int, int]
    rms_height: float
    rms_slope: float
    length: float


def survey(
    paths: Sequence[Path], reading: Reading, looked: Callable[[], None] = lambda: None
) -> list[MapSurvey]:
    """Look at files one by one.

    Parameters
    ----------
    paths : sequence of Path
        The files.
    reading : Reading
        How they are read.
    looked : callable
        Called after each file.

    Returns
    -------
    list of MapSurvey
        What they hold; of several files with the same content, the first can be used.
    """
    found: list[MapSurvey] = []
    contents: dict[str, Path] = {}
    for path in paths:
        found.append(_look(path, reading, contents))
        looked()
    return found


def _look(path: Path, reading: Reading, contents: dict[str, Path]) -> MapSurvey:
    """Look at a file and note its content."""
    try:
        sha256 = digest(path)
        if sha256 in contents:
            return MapSurvey(path, f"the same map as {contents[sha256].name}")
        topography = measured(path, reading)
        contents[sha256] = path
    except InputError as error:
        return MapSurvey(path, fault=_without_name(str(error), path))
    heights = topography.heights
    look = MapSurvey(
        path=path,
        fault=_fault(topography),
        shape=(heights.shape[0], heights.shape[1]),
        spacing=topography.spacing,
        unit=topography.unit,
        missing=topography.missing,
    )
    if look.fault:
        return look
    share = _form(heights)
    return replace(look, spikes=find_spikes(heights), tilt=tilt(topography), form=share)


def _without_name(fault: str, path: Path) -> str:
    """Take the name of its file out of an error message, and an option that scenes do not have."""
    fault = fault.removeprefix(str(path)).lstrip(":, ")
    return fault.replace(", or overrule the file by --override-scale", "")


def measured(path: Path, reading: Reading) -> Topography:
    """Read a map as scenes do; raise InputError if it cannot be read."""
    return read(path, reading.side, reading.unit, channel=reading.channel)


def _fault(topography: Topography) -> str:
    """Say why a map cannot be used, "" if it can."""
    heights = topography.heights
    share = topography.missing / heights.size
    if share > MOST_HOLES:
        return f"{100 * share:.3g} % of its heights are missing"
    if np.nanmax(heights) == np.nanmin(heights):
        return "all its heights are equal"
    if min(heights.shape) < 4:
        return f"{heights.shape[0]} x {heights.shape[1]} nodes are too few"
    return ""


def _form(heights: Heights) -> float:
    """Return the share of the variance about the mean plane that a quadratic takes out."""
    plane, quadratic = (
        float(np.nanvar(heights - form.fitted_polynomial(heights, degree))) for degree in (1, 2)
    )
    return 1.0 - quadratic / plane if plane else 0.0


def with_texture(
    look: MapSurvey, reading: Reading, preparation: Preparation, spacing: Sides | None
) -> MapSurvey:
    """Prepare a map as the scene will, and measure its roughness.

    Parameters
    ----------
    look : MapSurvey
        A map that can be used.
    reading : Reading
        How it is read.
    preparation : Preparation
        Steps of the preparation.
    spacing : tuple of float or None
        Spacing along x and y to resample it to [um]; None leaves its own.

    Returns
    -------
    MapSurvey
        The map with its texture, or with the reason why it cannot be used.
    """
    try:
        topography = prepare(measured(look.path, reading), preparation)
        if spacing is not None:
            topography = resampled(topography, spacing)
    except InputError as error:
        return replace(look, fault=_without_name(str(error), look.path))
    heights = topography.heights
    texture = Texture(
        shape=(heights.shape[0], heights.shape[1]),
        rms_height=float(heights.std()),
        rms_slope=rms_slope(heights, topography.spacing),
        length=areal_parameters(topography).values["Sal"],
    )
    fault = ""
    if texture.rms_slope < FLAT:
        fault = f"its rms slope is {texture.rms_slope:.2g}: check the unit of its heights"
    return replace(look, texture=texture, fault=fault)


def remarks(look: MapSurvey) -> list[str]:
    """List the remarks on a map that is used."""
    said = []
    if look.texture is not None and look.texture.rms_slope > STEEP:
        said.append(f"steep, above {STEEP:g}")
    if look.form > FORM:
        said.append("curved form")
    return said
