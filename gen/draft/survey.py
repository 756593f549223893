"""Survey measured maps: what their files hold, and how rough they are after the preparation."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from gen.arrays import Heights, Values
from gen.doubts import STEEP
from gen.maps.areal import areal_parameters
from gen.maps.codes import refuse_overflowing_heights, with_code_warnings
from gen.maps.filters import MOST_HOLES, fitted_polynomial, resampled
from gen.maps.outliers import local_medians, scatter_of
from gen.maps.prepare import FLAT, MANY_SPIKES, least_squares, prepare
from gen.maps.read import Sides, Topography, read, spacing_text
from gen.maps.settings import SPIKE, Reading, in_scene_words
from gen.runtime.errors import InputError
from gen.runtime.files import digest
from gen.runtime.terminal import print_columns
from gen.statistics import rms_slope

# share of the variance about the mean plane that a quadratic form holds at least: less may be a
# long wave of the roughness
FORM = 0.9
FEWEST_NODES_A_SIDE = 4  # nodes along the shorter side of a map that can be used

# ratio of the distances of the nearest spike and the furthest other node from which nodes are
# spikes whatever their number
GAP = 2.0
# largest share of the nodes that may be spikes if no gap separates them from the other nodes
FEW_SPIKES = 1e-3
# smallest distance of the furthest of such spikes, over the distance that a share `FEW_SPIKES` of
# all nodes exceed: on made maps without spikes the ratio is at most 2 (sharp ridges)
FAR_SPIKE = 2.5


@dataclass(frozen=True)
class Spikes:
    """Distances from the local median on both sides of the gap between surface and spikes."""

    surface: float  # largest distance of a node of the surface, in units of the scatter
    nearest: float  # smallest distance of a spike, infinite if there is none
    number: int  # number of spikes


@dataclass(frozen=True)
class MapSurvey:
    """The content of a file, and its roughness after the preparation; NaN before it is known."""

    path: Path  # the file
    fault: str = ""  # why the file cannot be used, "" if it can
    # nodes along x and y; (0, 0) of a file that cannot be read
    shape: tuple[int, int] = (0, 0)
    spacing: Sides = (math.nan, math.nan)  # distance of the nodes along x and y [um]
    unit: str = ""  # unit of the heights in the file, "" if it names none
    missing: int = 0  # number of nodes without a height
    spikes: Spikes | None = None  # spikes, None of a file that cannot be used
    tilt: Sides = (math.nan, math.nan)  # slopes of the mean plane along x and y [1]
    # share of the variance about the mean plane that a quadratic takes out [1]
    form: float = 0.0
    prepared: tuple[int, int] = (0, 0)  # nodes along x and y after the preparation
    rms_height: float = math.nan  # [um]
    rms_slope: float = math.nan  # between neighbouring nodes, as in databases [1]
    # autocorrelation length Sal of ISO 25178, NaN if half of the map is too short for it [um]
    length: float = math.nan
    # one line for each value that may stand for missing heights
    warnings: tuple[str, ...] = ()

    @property
    def is_curved(self) -> bool:
        """Whether the map has a form that a quadratic takes out."""
        return self.form > FORM


@dataclass(frozen=True, eq=False)
class PreparedMap:
    """A map after the preparation, and what is known of it."""

    survey: MapSurvey
    topography: Topography | None  # None if the survey names a fault


def survey_maps(
    paths: Sequence[Path], reading: Reading, advance: Callable[[], None] = lambda: None
) -> list[MapSurvey]:
    """Read map files one by one and note their contents.

    Parameters
    ----------
    paths : sequence of Path
        The files.
    reading : Reading
        How files are read that do not say it themselves.
    advance : callable
        Function that is called after each file, for a display of the progress.

    Returns
    -------
    list of MapSurvey
        A survey of each file, in the order of `paths`. Its `fault` says why a file cannot be used:
        it cannot be read, holds no roughness, or has the same content as an earlier file.
    """
    surveys = []
    first_paths: dict[str, Path] = {}  # by the SHA-256 of their contents
    for path in paths:
        try:
            first = first_paths.setdefault(digest(path), path)
            if first is path:
                surveys.append(_survey_of(path, read(path, reading)))
            else:
                surveys.append(MapSurvey(path, fault=f"the same map as {first.name}"))
        except InputError as error:
            surveys.append(MapSurvey(path, fault=_without_name(error, path)))
        advance()
    return surveys


def _survey_of(path: Path, topography: Topography) -> MapSurvey:
    """Return the survey of a map as its file has it; refuse heights beyond what numbers hold."""
    refuse_overflowing_heights(topography)
    heights = topography.heights
    codes = with_code_warnings(replace(topography, warnings=())).warnings
    survey = MapSurvey(
        path,
        fault=_fault_of(topography),
        shape=(heights.shape[0], heights.shape[1]),
        spacing=topography.spacing,
        unit=topography.unit,
        missing=topography.missing,
        warnings=tuple(in_scene_words(warning, path) for warning in codes),
    )
    if survey.fault:
        return survey
    tilt = least_squares(topography).tilt
    return replace(
        survey,
        form=_share_of_form(heights),
        spikes=find_spikes(heights),
        tilt=(tilt.x, tilt.y),
    )


def _fault_of(topography: Topography) -> str:
    """Say why a map is of no use as its file has it: holes, equal heights, too few nodes; or ""."""
    heights = topography.heights
    nx, ny = heights.shape
    if topography.missing > MOST_HOLES * heights.size:
        share = 100 * topography.missing / heights.size
        return f"{share:.3g} % of its heights are missing"
    if np.nanmax(heights) == np.nanmin(heights):
        return "all its heights are equal"
    if min(nx, ny) < FEWEST_NODES_A_SIDE:
        return f"{nx} x {ny} nodes are too few"
    return ""


def _share_of_form(heights: Heights) -> float:
    """Return the share of the variance about the mean plane that a quadratic takes out [1]."""
    about_plane = float(np.nanvar(heights - fitted_polynomial(heights, 1)))
    about_quadratic = float(np.nanvar(heights - fitted_polynomial(heights, 2)))
    if about_plane == 0.0:
        return 0.0
    return 1.0 - about_quadratic / about_plane


def _without_name(error: InputError, path: Path) -> str:
    """Take the name of its file out of an error message, and an option that scenes do not have."""
    fault = str(error).removeprefix(str(path)).lstrip(":, ")
    return fault.replace(", or overrule the file by --override-scale", "")


def measure(
    survey: MapSurvey, reading: Reading, spacing: float | None = None
) -> PreparedMap:
    """Prepare a map as the scene will, and add its roughness to its survey.

    Parameters
    ----------
    survey : MapSurvey
        Survey of the map as its file has it, without a fault.
    reading : Reading
        How the file is read, and the steps of the preparation.
    spacing : float, optional
        Distance of the nodes to which the map is resampled [um]; its own by default.

    Returns
    -------
    PreparedMap
        The map and its completed survey; a survey with a fault and no map if it cannot be prepared
        or is flat.
    """
    try:
        topography = prepare(read(survey.path, reading), reading)
        if spacing is not None:
            topography = resampled(topography, (spacing, spacing))
    except InputError as error:
        fault = _without_name(error, survey.path)
        return PreparedMap(replace(survey, fault=fault), None)
    heights = topography.heights
    slope = rms_slope(heights, topography.spacing)
    measured = replace(
        survey,
        prepared=(heights.shape[0], heights.shape[1]),
        rms_height=float(heights.std()),
        rms_slope=slope,
        length=areal_parameters(topography).values["Sal"],
    )
    if slope < FLAT:
        fault = f"its rms slope is {slope:.2g}: check the unit of its heights"
        return PreparedMap(replace(measured, fault=fault), None)
    return PreparedMap(measured, topography)


def remarks(measured: MapSurvey) -> list[str]:
    """List the remarks on a map that is used.

    Parameters
    ----------
    measured : MapSurvey
        Survey of the map, with its roughness.

    Returns
    -------
    list of str
        A short text for a steep map, and one for a curved map.
    """
    texts = []
    if measured.rms_slope > STEEP:
        texts.append(f"steep, above {STEEP:g}")
    if measured.is_curved:
        texts.append("curved form")
    return texts


def usable(surveys: Sequence[MapSurvey]) -> list[MapSurvey]:
    """Return the maps without a fault.

    Parameters
    ----------
    surveys : sequence of MapSurvey
        Surveys of all files.

    Returns
    -------
    list of MapSurvey
        Those without a fault, in the same order.
    """
    return [survey for survey in surveys if not survey.fault]


def require_usable(surveys: Sequence[MapSurvey]) -> list[MapSurvey]:
    """Return the maps without a fault, of which there has to be one.

    Parameters
    ----------
    surveys : sequence of MapSurvey
        Surveys of all files, at least one.

    Returns
    -------
    list of MapSurvey
        Those without a fault, in the same order.

    Raises
    ------
    InputError
        If all have a fault; it tells the first one.
    """
    without_fault = usable(surveys)
    if not without_fault:
        first = surveys[0]
        message = f"no map can be used: {first.path}: {first.fault}"
        if len(surveys) > 1:
            message += f", and {len(surveys) - 1} more files"
        raise InputError(message)
    return without_fault


def find_spikes(heights: Heights) -> Spikes:
    """Find the spikes of a map by the distances of its nodes from their local medians.

    Spikes are the nodes beyond the largest gap between these distances. A few nodes are spikes
    without a wide gap, too, if the furthest of them is far from the surface.

    Parameters
    ----------
    heights : ndarray, shape (nx, ny)
        Heights, NaN where they are missing [um].

    Returns
    -------
    Spikes
        The number of spikes, and the distances on both sides of the gap.
    """
    from_medians = heights - local_medians(heights)
    distances = np.abs(from_medians / scatter_of(from_medians, heights))
    measured = distances[~np.isnan(distances)]
    falling = np.maximum(np.sort(measured)[::-1], SPIKE)
    number = _number_beyond_gap(falling, MANY_SPIKES, GAP)
    if number == 0 and falling[0] > FAR_SPIKE * falling[int(FEW_SPIKES * falling.size)]:
        number = _number_beyond_gap(falling, FEW_SPIKES, 1.0)
    nearest = math.inf
    if number > 0:
        nearest = float(falling[number - 1])
    return Spikes(surface=float(falling[number]), nearest=nearest, number=number)


def _number_beyond_gap(falling: Values, share: float, smallest_ratio: float) -> int:
    """Return how many of the falling distances are beyond the largest gap in a share of them.

    The gap is the largest ratio of neighbours; the number is 0 unless it exceeds `smallest_ratio`.
    """
    first = falling[: max(1, int(share * falling.size)) + 1]
    ratios = first[:-1] / first[1:]
    place = int(np.argmax(ratios))
    if ratios[place] <= smallest_ratio:
        return 0
    return place + 1


def common_threshold(spikes: Sequence[Spikes]) -> float | None:
    """Choose a threshold that takes out the spikes of all maps.

    Parameters
    ----------
    spikes : sequence of Spikes
        Spikes of the maps.

    Returns
    -------
    float or None
        Distance from the local median in units of the scatter, as the key `despike` has it: between
        all surfaces and the nearest spike or, if surfaces reach further, just below that spike.
        None if no map has spikes.
    """
    nearest = min((of_map.nearest for of_map in spikes), default=math.inf)
    if math.isinf(nearest):
        return None
    surface = max(of_map.surface for of_map in spikes)
    threshold = 0.98 * nearest
    if surface < nearest:
        threshold = math.sqrt(surface * nearest)
    two_digits = float(f"{threshold:.2g}")
    if surface < two_digits < nearest:
        return two_digits
    return threshold


def print_surveys(surveys: Sequence[MapSurvey]) -> None:
    """Print a line for each file: its content, and whether it is used or why not.

    Parameters
    ----------
    surveys : sequence of MapSurvey
        Surveys of the files, at least one.
    """
    table = [_cells(survey) for survey in surveys]
    titles = list(table[0])
    numbers = set(titles) - {"map", "unit", "use"}
    print_columns([list(cells.values()) for cells in table], titles, right=numbers)


def _cells(survey: MapSurvey) -> dict[str, str]:
    """Return the cells of a map's line by their titles; "-" stands for what is not known."""
    nx, ny = survey.shape
    tilt = max(abs(slope) for slope in survey.tilt)
    spikes = "-"
    if survey.spikes is not None:
        spikes = str(survey.spikes.number)
    properties = {
        "nodes": f"{nx} x {ny}",
        "spacing um": spacing_text(survey.spacing, 4),
        "unit": survey.unit or "um?",
        "holes %": f"{100 * survey.missing / max(1, nx * ny):.2g}",
        "spikes": spikes,
        "tilt": f"{tilt:.2g}",
        "rms height um": f"{survey.rms_height:.3g}",
        "rms slope": f"{survey.rms_slope:.3g}",
    }
    for title, text in properties.items():
        properties[title] = text.replace("nan", "-")
    if nx == 0:  # of a file that cannot be read
        properties = dict.fromkeys(properties, "-")
    use = "; ".join(["yes", *remarks(survey)])
    if survey.fault:
        use = f"no: {survey.fault}"
    return {"map": survey.path.name, **properties, "use": use}
