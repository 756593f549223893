"""Survey measured maps: the content of each file, its faults and its spikes, as a table."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from gen.arrays import Heights, Values
from gen.maps.filters import fitted_polynomial, local_medians
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


@dataclass
class MapSurvey:
    """The content of a file, and its roughness after the preparation; NaN before it is known."""

    path: Path  # the file
    fault: str = ""  # why the file cannot be used, "" if it can
    shape: tuple[int, int] = (0, 0)  # nodes along x and y; (0, 0) of a file that cannot be read
    spacing: Sides = (math.nan, math.nan)  # distance of the nodes along x and y [um]
    unit: str = ""  # unit of the heights in the file, "" if it names none
    missing: int = 0  # number of nodes without a height
    spikes: Spikes | None = None  # spikes, None of a file that cannot be used
    tilt: Sides = (math.nan, math.nan)  # slopes of the mean plane along x and y [1]
    form: float = 0.0  # share of the variance about the mean plane that a quadratic takes out [1]
    prepared: tuple[int, int] = (0, 0)  # nodes along x and y after the preparation
    rms_height: float = math.nan  # [um]
    rms_slope: float = math.nan  # between neighbouring nodes, as in databases [1]
    # autocorrelation length Sal of ISO 25178, NaN if half of the map is too short for it [um]
    length: float = math.nan


def survey(
    paths: Sequence[Path], reading: Reading, looked: Callable[[], None] = lambda: None
) -> list[MapSurvey]:
    """Look at files one by one."""
    found: list[MapSurvey] = []
    contents: dict[str, Path] = {}
    for path in paths:
        look = MapSurvey(path)
        found.append(look)
        try:
            known = contents.setdefault(digest(path), path)
            if known is path:
                _look(look, read(path, reading))
            else:
                look.fault = f"the same map as {known.name}"
        except InputError as error:
            look.fault = _without_name(error, path)
        looked()
    return found


def _look(look: MapSurvey, topography: Topography) -> None:
    """Note what a file holds."""
    heights, missing = topography.heights, topography.missing
    nx, ny = look.shape = heights.shape[0], heights.shape[1]
    look.spacing, look.unit, look.missing = topography.spacing, topography.unit, missing
    if missing > MOST_HOLES * heights.size:
        look.fault = f"{100 * missing / heights.size:.3g} % of its heights are missing"
    elif np.nanmax(heights) == np.nanmin(heights):
        look.fault = "all its heights are equal"
    elif min(nx, ny) < 4:
        look.fault = f"{nx} x {ny} nodes are too few"
    else:
        plane, quadratic = (
            float(np.nanvar(heights - fitted_polynomial(heights, degree))) for degree in (1, 2)
        )
        look.form = 1.0 - quadratic / plane if plane else 0.0
        look.spikes, look.tilt = find_spikes(heights), tilt(topography)


def _without_name(error: InputError, path: Path) -> str:
    """Take the name of its file out of an error message, and an option that scenes do not have."""
    fault = str(error).removeprefix(str(path)).lstrip(":, ")
    return fault.replace(", or overrule the file by --override-scale", "")


def measure(look: MapSurvey, reading: Reading, spacing: Sides | None) -> None:
    """Prepare a map as the scene will, and note its roughness."""
    try:
        topography = prepare(read(look.path, reading), reading)
        if spacing is not None:
            topography = resampled(topography, spacing)
    except InputError as error:
        look.fault = _without_name(error, look.path)
        return
    heights, slope = topography.heights, rms_slope(topography.heights, topography.spacing)
    look.prepared = heights.shape[0], heights.shape[1]
    look.rms_height, look.rms_slope = float(heights.std()), slope
    look.length = areal_parameters(topography).values["Sal"]
    if slope < FLAT:
        look.fault = f"its rms slope is {slope:.2g}: check the unit of its heights"


def remarks(look: MapSurvey) -> list[str]:
    """List the remarks on a map that is used."""
    steep, curved = look.rms_slope > STEEP, look.form > FORM
    return [f"steep, above {STEEP:g}"] * steep + ["curved form"] * curved


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
    medians, scatter = local_medians(heights)
    distances = np.abs((heights - medians) / scatter)
    high = np.maximum(np.sort(distances[~np.isnan(distances)])[::-1], SPIKE)
    number = _before_gap(high, MANY_SPIKES, GAP)
    if not number and high[0] > APART * high[int(FEW * high.size)]:
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
    rows = []
    for look in looks:
        known = [
            f"{look.shape[0]} x {look.shape[1]}",
            in_words(look.spacing, 4),
            look.unit or "um?",
            f"{100 * look.missing / max(1, math.prod(look.shape)):.2g}",
            str(look.spikes.number) if look.spikes else "-",
            f"{max(map(abs, look.tilt)):.2g}",
            f"{look.rms_height:.3g}",
            f"{look.rms_slope:.3g}",
        ]
        cells = [cell.replace("nan", "-") if look.shape[0] else "-" for cell in known]
        use = f"no: {look.fault}" if look.fault else "; ".join(["yes", *remarks(look)])
        rows.append([look.path.name, *cells, use])
    print_columns(rows, TITLES, right=set(TITLES) - {"map", "unit", "use"})
