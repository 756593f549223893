"""Survey measured maps: the content of their files, and their roughness after the preparation."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from gen.doubts import STEEP
from gen.maps.areal import areal_parameters
from gen.maps.codes import refuse_overflowing_heights, with_code_warnings
from gen.maps.filters import MOST_HOLES, resampled
from gen.maps.needs import FEWEST_NODES_A_SIDE, MapNeeds, Spikes
from gen.maps.prepare import FLAT, effect_of_steps, least_squares, prepare
from gen.maps.read import Sides, Topography, read, spacing_text
from gen.maps.settings import Reading, in_scene_words
from gen.runtime.errors import InputError
from gen.runtime.files import digest
from gen.runtime.terminal import print_columns
from gen.statistics import rms_slope


@dataclass(frozen=True)
class MapSurvey:
    """The content of a file, and the roughness of its map after the preparation.

    Properties that are not known, or not known yet, have their default values.
    """

    path: Path  # the file
    fault: str = ""  # why the file cannot be used; "" if it can
    # nodes along x and y in the file; (0, 0) if it cannot be read
    shape: tuple[int, int] = (0, 0)
    # distance of the nodes along x and y in the file [um]
    spacing: Sides = (math.nan, math.nan)
    unit: str = ""  # unit of the heights in the file; "" if the file names none
    missing: int = 0  # number of nodes without a height
    spikes: Spikes | None = None  # None if the file cannot be used
    tilt: Sides = (math.nan, math.nan)  # slopes of the mean plane along x and y [1]
    # share of the variance about the mean plane that a quadratic surface explains [1]
    form: float = 0.0
    prepared: tuple[int, int] = (0, 0)  # nodes along x and y after the preparation
    rms_height: float = math.nan  # after the preparation [um]
    # after the preparation; slopes are those between neighbouring nodes, as in databases [1]
    rms_slope: float = math.nan
    # autocorrelation length Sal of ISO 25178 after the preparation [um]; NaN if the
    # autocorrelation does not fall far enough within half of the map
    length: float = math.nan
    # a line for each height that occurs so often that it may be a code for missing heights
    warnings: tuple[str, ...] = ()
    # sentence on the roughness before and after the preparation; "" if it has hardly changed
    effect: str = ""

    @property
    def needs(self) -> MapNeeds:
        """The faults of the map, for which steps of the preparation are chosen."""
        return MapNeeds(spikes=self.spikes, form=self.form, missing=self.missing)

    @property
    def is_curved(self) -> bool:
        """Whether the map has a form that a quadratic surface explains."""
        return self.needs.is_curved


@dataclass(frozen=True, eq=False)
class PreparedMap:
    """A map after the preparation, and its survey."""

    survey: MapSurvey
    topography: Topography | None  # the prepared map; None if the survey has a fault


def survey_maps(
    paths: Sequence[Path], reading: Reading, advance: Callable[[], None] = lambda: None
) -> list[MapSurvey]:
    """Read files of maps, and survey each map as its file has it, without preparation.

    Parameters
    ----------
    paths : sequence of Path
        The files.
    reading : Reading
        Unit, lengths and channel for files that do not determine them.
    advance : callable
        Function without arguments that is called after each file, to display the progress.

    Returns
    -------
    list of MapSurvey
        The survey of each file, in the order of `paths`. A file that cannot be read, whose map
        cannot be used, or that has the content of an earlier file has a `fault`. The roughness
        after the preparation is missing; `measure` adds it.
    """
    surveys = []
    first_paths: dict[str, Path] = {}  # by the SHA-256 of their contents
    for path in paths:
        try:
            first = first_paths.setdefault(digest(path), path)
            if first is path:
                surveys.append(_survey_of(path, read(path, reading)))
            else:
                fault = f"the same map as {first.name}"
                surveys.append(MapSurvey(path, fault=fault))
        except InputError as error:
            surveys.append(MapSurvey(path, fault=_fault_in_scene_words(error, path)))
        advance()
    return surveys


def _survey_of(path: Path, topography: Topography) -> MapSurvey:
    """Return the survey of a map that was read from a file, without preparation.

    Raise InputError if squares of the heights would exceed the largest number.
    """
    refuse_overflowing_heights(topography)
    heights = topography.heights
    # Only the warnings about codes for missing heights are kept, not those from reading the file.
    code_warnings = with_code_warnings(replace(topography, warnings=())).warnings
    survey = MapSurvey(
        path,
        fault=_fault_of(topography),
        shape=(heights.shape[0], heights.shape[1]),
        spacing=topography.spacing,
        unit=topography.unit,
        missing=topography.missing,
        warnings=tuple(in_scene_words(warning, path) for warning in code_warnings),
    )
    if survey.fault:  # the map may have too few heights for the properties below
        return survey
    tilt = least_squares(topography).tilt
    needs = MapNeeds.of(heights)
    return replace(
        survey,
        form=needs.form,
        spikes=needs.spikes,
        tilt=(tilt.x, tilt.y),
    )


def _fault_of(topography: Topography) -> str:
    """Say why a map cannot be used; return "" if it can.

    The reasons are too many holes, equal heights, and too few nodes.
    """
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


def _fault_in_scene_words(error: InputError, path: Path) -> str:
    """Return an error's message without the name of the file at its beginning.

    Advice to use an option that scenes do not have is left out too.
    """
    fault = str(error).removeprefix(str(path)).lstrip(":, ")
    return fault.replace(", or overrule the file by --override-scale", "")


def measure(
    survey: MapSurvey, reading: Reading, spacing: float | None = None
) -> PreparedMap:
    """Read a map, prepare it as the scene will, and measure its roughness.

    Parameters
    ----------
    survey : MapSurvey
        Survey of the map by `survey_maps`, without a fault.
    reading : Reading
        How the file is read, and the steps of the preparation.
    spacing : float, optional
        Distance of the nodes to which the map is resampled [um]. By default the map is not
        resampled.

    Returns
    -------
    PreparedMap
        The prepared map, and its survey with the roughness. If the map cannot be prepared or is
        flat, the survey has a fault and there is no map.
    """
    try:
        as_measured = read(survey.path, reading)
        topography = prepare(as_measured, reading)
        effect = effect_of_steps(as_measured, topography)
        if spacing is not None:
            topography = resampled(topography, (spacing, spacing))
    except InputError as error:
        fault = _fault_in_scene_words(error, survey.path)
        return PreparedMap(survey=replace(survey, fault=fault), topography=None)
    heights = topography.heights
    slope = rms_slope(heights, topography.spacing)
    measured = replace(
        survey,
        prepared=(heights.shape[0], heights.shape[1]),
        rms_height=float(heights.std()),
        rms_slope=slope,
        length=areal_parameters(topography).values["Sal"],
        effect=effect,
    )
    if slope < FLAT:
        fault = f"its rms slope is {slope:.2g}: check the unit of its heights"
        return PreparedMap(survey=replace(measured, fault=fault), topography=None)
    return PreparedMap(survey=measured, topography=topography)


def remarks(measured: MapSurvey) -> list[str]:
    """Return remarks on a map that is used: that it is steep, and that it is curved.

    Parameters
    ----------
    measured : MapSurvey
        Survey of the map, with its roughness.

    Returns
    -------
    list of str
        A few words for each of the two properties that the map has; an empty list if it is neither
        steep nor curved.
    """
    texts = []
    if measured.rms_slope > STEEP:
        texts.append(f"steep, above {STEEP:g}")
    if measured.is_curved:
        texts.append("curved form")
    return texts


def usable(surveys: Sequence[MapSurvey]) -> list[MapSurvey]:
    """Return the surveys without a fault.

    Parameters
    ----------
    surveys : sequence of MapSurvey
        Surveys of files.

    Returns
    -------
    list of MapSurvey
        The surveys without a fault, in the given order; an empty list if all have one.
    """
    return [survey for survey in surveys if not survey.fault]


def require_usable(surveys: Sequence[MapSurvey]) -> list[MapSurvey]:
    """Return the surveys without a fault, and raise InputError if there is none.

    Parameters
    ----------
    surveys : sequence of MapSurvey
        Surveys of files, at least one.

    Returns
    -------
    list of MapSurvey
        The surveys without a fault, in the given order; at least one.

    Raises
    ------
    InputError
        If all surveys have a fault. The message gives the fault of the first one.
    """
    without_fault = usable(surveys)
    if not without_fault:
        first = surveys[0]
        message = f"no map can be used: {first.path}: {first.fault}"
        if len(surveys) > 1:
            message += f", and {len(surveys) - 1} more files"
        raise InputError(message)
    return without_fault


def print_surveys(surveys: Sequence[MapSurvey]) -> None:
    """Print a table with a line for each file: its properties, and whether it is used or why not.

    Parameters
    ----------
    surveys : sequence of MapSurvey
        Surveys of the files, at least one.
    """
    table = [_cells(survey) for survey in surveys]
    titles = list(table[0])
    right_aligned = set(titles) - {"map", "unit", "use"}
    rows = [list(cells.values()) for cells in table]
    print_columns(rows, titles, right=right_aligned)


def _cells(survey: MapSurvey) -> dict[str, str]:
    """Return the cells of a file's line in the table, by the titles of the columns.

    The cell of a property that is not known is "-".
    """
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
    if nx == 0:  # The file cannot be read.
        properties = dict.fromkeys(properties, "-")
    use = "; ".join(["yes", *remarks(survey)])
    if survey.fault:
        use = f"no: {survey.fault}"
    return {"map": survey.path.name, **properties, "use": use}
