"""Survey measured maps: the content of each file, its faults and its spikes, as a table."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from gen.arrays import Heights, Values
from gen.maps import filters
from gen.maps.filters import scaled_distances
from gen.maps.library import digest
from gen.maps.prepare import FLAT, MANY_SPIKES, MOST_HOLES, STEEP, prepare, resampled, tilt
from gen.maps.read import Sides, Topography, in_words, read
from gen.maps.settings import SPIKE, Reading
from gen.maps.texture import areal_parameters
from gen.runtime.errors import InputError
from gen.runtime.terminal import print_columns
from gen.statistics import rms_slope

# share of the variance about the mean plane that a quadratic form holds at least: less may be a
# long wave of the roughness
FORM = 0.9


@dataclass(frozen=True)
class Texture:
    """Roughness of a prepared map; NaN before it is known."""

    shape: tuple[int, int] = (0, 0)  # nodes along x and y
    rms_height: float = math.nan  # [um]
    rms_slope: float = math.nan  # between neighbouring nodes, as in databases [1]
    # autocorrelation length Sal of ISO 25178, NaN if half of the map is too short for it [um]
    length: float = math.nan


@dataclass(frozen=True)
class MapSurvey:
    """The content of a file before any preparation."""

    path: Path  # the file
    fault: str = ""  # why the file cannot be used, "" if it can
    shape: tuple[int, int] = (0, 0)  # nodes along x and y; (0, 0) of a file that cannot be read
    spacing: Sides = (math.nan, math.nan)  # distance of the nodes along x and y [um]
    unit: str = ""  # unit of the heights in the file, "" if it names none
    missing: int = 0  # number of nodes without a height
    spikes: Spikes | None = None  # spikes, None of a file that cannot be read
    tilt: Sides = (math.nan, math.nan)  # slopes of the mean plane along x and y [1]
    form: float = 0.0  # share of the variance about the mean plane that a quadratic takes out [1]
    texture: Texture = Texture()  # after the preparation

    @property
    def holes(self) -> float:
        """Share of the nodes without a height [1]."""
        return self.missing / max(1, math.prod(self.shape))


def survey(
    paths: Sequence[Path], reading: Reading, looked: Callable[[], None] = lambda: None
) -> list[MapSurvey]:
    """Look at files one by one."""
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
        topography = read(path, reading)
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
        float(np.nanvar(heights - filters.fitted_polynomial(heights, degree))) for degree in (1, 2)
    )
    return 1.0 - quadratic / plane if plane else 0.0


def with_texture(look: MapSurvey, reading: Reading, spacing: Sides | None) -> MapSurvey:
    """Prepare a map as the scene will, and measure its roughness."""
    try:
        topography = prepare(read(look.path, reading), reading)
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
    if look.texture.rms_slope > STEEP:
        said.append(f"steep, above {STEEP:g}")
    if look.form > FORM:
        said.append("curved form")
    return said


# ratio of the nearest spike's distance to that of the furthest other node which tells spikes from
# a surface whatever their number
GAP = 2.0
# largest share of the nodes that may be spikes if no gap separates them from the other nodes
FEW = 1e-3
# distance of the furthest of such spikes over that of the furthest share `FEW` of all nodes, at
# least: on made maps without spikes the ratio is at most 2 (sharp ridges)
APART = 2.5


class Spikes(NamedTuple):
    """Distances from the local median on both sides of the gap between surface and spikes."""

    surface: float  # largest distance of a node of the surface, in units of the scatter
    nearest: float  # smallest distance of a spike, infinite if there is none
    number: int  # number of spikes


def find_spikes(heights: Heights) -> Spikes:
    """Part the spikes of a map from its surface at the largest gap between their distances."""
    distances = np.abs(scaled_distances(heights))
    distances = np.sort(distances[~np.isnan(distances)])[::-1]
    high = np.maximum(distances, SPIKE)
    number = _before_gap(high, MANY_SPIKES, GAP)
    few = int(FEW * high.size)
    if not number and high[0] > APART * high[few]:
        number = _before_gap(high, FEW, 1.0)
    nearest = float(high[number - 1]) if number else math.inf
    return Spikes(float(high[number]), nearest, number)


def _before_gap(high: Values, share: float, least: float) -> int:
    """Return how many distances are before their largest gap, 0 if its ratio is too small."""
    ahead = high[: max(1, int(share * high.size)) + 1]
    ratios = ahead[:-1] / ahead[1:]
    place = int(np.argmax(ratios))
    return place + 1 if ratios[place] > least else 0


def common_threshold(found: Sequence[Spikes]) -> float | None:
    """Choose one threshold for several maps, None if none has a spike.

    It is in the middle between all surfaces and all spikes, of logarithms. Where no number parts
    them it is just below the nearest spike, and some nodes of other maps are taken for spikes.
    """
    nearest = min((each.nearest for each in found), default=math.inf)
    if math.isinf(nearest):
        return None
    surface = max(each.surface for each in found)
    middle = math.sqrt(surface * nearest) if surface < nearest else 0.98 * nearest
    return float(f"{middle:.2g}") if surface < float(f"{middle:.2g}") < nearest else middle


TITLES = (
    *("map", "nodes", "spacing um", "unit", "holes %", "spikes", "tilt", "rms height um"),
    *("rms slope", "use"),
)


def print_looks(looks: Sequence[MapSurvey]) -> None:
    """Print a line for each file: its content, and whether it is used or why not."""
    right = set(TITLES) - {"map", "unit", "use"}
    print_columns([_cells(look) for look in looks], TITLES, right)


def _cells(look: MapSurvey) -> list[str]:
    """Write the known facts of a file, and a dash for each unknown one."""
    use = f"no: {look.fault}" if look.fault else "; ".join(["yes", *remarks(look)])
    if not look.shape[0]:
        return [look.path.name, *["-"] * (len(TITLES) - 2), use]
    numbers = (
        f"{max(map(abs, look.tilt)):.2g}",
        f"{look.texture.rms_height:.3g}",
        f"{look.texture.rms_slope:.3g}",
    )
    return [
        look.path.name,
        f"{look.shape[0]} x {look.shape[1]}",
        in_words(look.spacing, 4),
        look.unit or "um?",
        f"{100 * look.holes:.2g}",
        "-" if look.spikes is None else str(look.spikes.number),
        *("-" if number == "nan" else number for number in numbers),
        use,
    ]
