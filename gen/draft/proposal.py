"""Propose windows of measured maps: choose their nodes, spacing, number and preparation."""

from __future__ import annotations

import math
import statistics
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

from gen.draft.survey import (
    MapSurvey,
    measure,
    require_usable,
    survey_maps,
    usable,
)
from gen.maps.filters import is_same
from gen.maps.library import Tiling
from gen.maps.needs import with_needed_steps
from gen.maps.read import Sides
from gen.maps.settings import Reading
from gen.runtime.errors import InputError

# Number of loads of each surface. Several loads on one surface cost less than one load on each of
# several surfaces.
LOADS_PER_SURFACE = 5
# Number of windows as a multiple of the number that fits side by side. More windows would only show
# the same heights again.
OVERLAP = 4
FEWEST_WINDOWS = 200
MOST_WINDOWS = 2000

# Possible numbers of nodes along a side of a window, the largest first. Cosine transforms of these
# lengths are fast.
SIZES = (256, 192, 128, 96, 64, 48, 32)
# Largest number of nodes along a side of a window, unless a window of this size is narrow compared
# with the texture.
USUAL = 128
# Smallest side of a window in autocorrelation lengths: the statistics of a window that is at least
# as wide are those of its map.
WIDE = 5.0
SHARE_OF_MAPS = 0.75  # smallest share of the maps that hold two windows along both axes
FINE = 0.8  # share of the maps whose spacing is at most the common one
# Maps whose spacing is above this multiple of the median spacing cannot set the common one.
COARSE = 4.0
# Maps whose spacing is above this multiple of the common one are left out. The excess over 1 is
# room for rounding.
COARSER = 1.001


@dataclass(frozen=True)
class Proposal:
    """The windows and the preparation that are chosen for maps, and the surveys of the maps."""

    surveys: list[MapSurvey]  # surveys of all files, also of files that are left out
    reading: Reading  # how files are read and prepared
    # distance of the nodes to which all maps are resampled [um]; None if they are not resampled,
    # because they share a spacing
    spacing: float | None
    nodes: int  # nodes along each side of a window
    width: float  # length of a window along x [um]
    windows: int  # number of windows
    # number of tiles: parts into which the used maps are cut, as large as a window or larger
    tiles: int

    @property
    def used(self) -> list[MapSurvey]:
        """Surveys of the maps that are used."""
        return usable(self.surveys)


def propose(
    paths: Sequence[Path], reading: Reading, advance: Callable[[], None] = lambda: None
) -> Proposal:
    """Choose the windows of a scene: read each map as it is, and again with its preparation.

    Parameters
    ----------
    paths : sequence of Path
        Files of the maps, at least one.
    reading : Reading
        Unit, lengths and channel for files that do not determine them. Steps of the
        preparation that it lacks are chosen for the maps.
    advance : callable
        Function without arguments that is called twice for each file, after each reading, to
        display the progress.

    Returns
    -------
    Proposal
        The windows and the preparation, and for each file why it is used or left out.

    Raises
    ------
    InputError
        If no map can be used, or all are too small for a window.
    """
    surveys = survey_maps(paths, reading, advance)
    spacing = common_spacing([survey.spacing for survey in require_usable(surveys)])
    surveys = [_unless_coarse(survey, spacing) for survey in surveys]
    reading = with_chosen_steps(reading, usable(surveys))
    measured = []
    for survey in surveys:
        if survey.fault:
            measured.append(survey)
        else:
            measured.append(measure(survey, reading, spacing).survey)
        advance()  # also for a file with a fault, which is not read again
    nodes = _nodes_for(require_usable(measured), spacing)
    surveys = [_unless_narrow(survey, nodes) for survey in measured]
    used = require_usable(surveys)
    spacing_along_x = spacing or used[0].spacing[0]
    shapes = tuple(survey.prepared for survey in used)
    return Proposal(
        surveys=surveys,
        reading=reading,
        spacing=spacing,
        nodes=nodes,
        width=nodes * spacing_along_x,
        windows=_number_of_windows(shapes, nodes),
        tiles=Tiling(shapes, (nodes, nodes)).total,
    )


def _unless_coarse(survey: MapSurvey, spacing: float | None) -> MapSurvey:
    """Return a survey, with a fault if its nodes are further apart than the common spacing [um].

    Return it unchanged if it has a fault already, or without a common spacing (None).
    """
    if survey.fault or spacing is None:
        return survey
    coarsest = max(survey.spacing)
    if coarsest <= COARSER * spacing:
        return survey
    fault = f"a node every {coarsest:.4g} um, most others have one every {spacing:g}"
    return replace(survey, fault=fault)


def _unless_narrow(survey: MapSurvey, nodes: int) -> MapSurvey:
    """Return a survey, with a fault if its prepared map holds no window of nodes x nodes.

    Return it unchanged if it has a fault already.
    """
    nx, ny = survey.prepared
    if survey.fault or min(nx, ny) >= nodes:
        return survey
    fault = f"{nx} x {ny} nodes hold no window of {nodes} x {nodes}"
    return replace(survey, fault=fault)


def _nodes_for(used: Sequence[MapSurvey], spacing: float | None) -> int:
    """Choose the nodes along each side of the windows for the surveys of the maps that are used.

    `spacing` is the common spacing [um], or None for maps that keep the spacing that they share.
    Raise InputError if all maps are too small.
    """
    node_distance = spacing or max(used[0].spacing)
    known_lengths = [survey.length for survey in used if not math.isnan(survey.length)]
    length = math.nan
    if known_lengths:
        length = statistics.median(known_lengths)
    shapes = [survey.prepared for survey in used]
    nodes = window_nodes(shapes, length / node_distance)
    if nodes is None:
        raise InputError(
            f"the maps are too small for windows: all have fewer than {SIZES[-1]} nodes a side"
        )
    return nodes


def _number_of_windows(shapes: Sequence[tuple[int, int]], nodes: int) -> int:
    """Choose the number of windows of nodes x nodes for the area of all maps.

    `shapes` are the nodes of the maps along x and y. The number is a multiple of 10.
    """
    nodes_of_maps = sum(nx * ny for nx, ny in shapes)
    side_by_side = nodes_of_maps / nodes**2
    number = min(max(OVERLAP * side_by_side, FEWEST_WINDOWS), MOST_WINDOWS)
    return 10 * round(number / 10)


def with_chosen_steps(reading: Reading, surveys: Sequence[MapSurvey]) -> Reading:
    """Choose the steps of the preparation for the spikes, the form and the holes of maps.

    Parameters
    ----------
    reading : Reading
        How files are read, and steps that the user has given.
    surveys : sequence of MapSurvey
        Surveys of the usable maps, measured before any preparation (`survey_maps`).

    Returns
    -------
    Reading
        A copy of `reading` with the chosen steps beside the given ones, see
        `gen.maps.needs.with_needed_steps`.
    """
    return with_needed_steps(reading, [survey.needs for survey in surveys])


def common_spacing(spacings: Sequence[Sides]) -> float | None:
    """Choose a spacing for all maps: the share `FINE` of them have this spacing or a finer one.

    The spacing of a map is that of the axis along which its nodes are further apart. A map whose
    spacing is more than `COARSE` times the median cannot set the common one.

    Parameters
    ----------
    spacings : sequence of pair of float
        Distances of the nodes along x and y of each map, for at least one map [um].

    Returns
    -------
    float or None
        The spacing [um]; None if all maps have the same spacing along both axes, apart from
        rounding, so that none needs to be resampled.
    """
    first = spacings[0]
    if all(is_same(x, first[0]) and is_same(y, first[1]) for x, y in spacings):
        return None
    of_maps = sorted(max(spacing) for spacing in spacings)
    limit = COARSE * statistics.median(of_maps)
    eligible = [spacing for spacing in of_maps if spacing <= limit]
    number_of_maps = min(math.ceil(FINE * len(spacings)), len(eligible))
    common = eligible[number_of_maps - 1]
    return float(f"{common:.6g}")


def window_nodes(shapes: Sequence[tuple[int, int]], length: float) -> int | None:
    """Choose the nodes along each side of the windows.

    The largest size is chosen of which at least the share `SHARE_OF_MAPS` of the maps hold two
    windows side by side along both axes, one for training and one for testing. If there is none,
    the largest size is chosen of which this share of the maps hold one window. Sizes above `USUAL`
    are considered only for long autocorrelation lengths.

    Parameters
    ----------
    shapes : sequence of pair of int
        Nodes of each map along x and y.
    length : float
        Autocorrelation length of the maps in distances of the nodes; NaN if it is not known.

    Returns
    -------
    int or None
        One of `SIZES`; None if no map holds the smallest size. Shares are taken of the maps that
        hold the smallest size.
    """
    sides = [min(shape) for shape in shapes if min(shape) >= SIZES[-1]]
    if not sides:
        return None
    sizes = _sizes_for(length)
    for windows in (2, 1):  # number of windows side by side
        for size in sizes:
            large_enough = sum(side >= windows * size for side in sides)  # number of maps
            if large_enough >= SHARE_OF_MAPS * len(sides):
                return size
    return None


def nodes_like(shape: tuple[int, int], length: float) -> int:
    """Choose the nodes along each side of surfaces like a map.

    Parameters
    ----------
    shape : pair of int
        Nodes of the map along x and y.
    length : float
        Autocorrelation length of the map in distances of the nodes; NaN if it is not known.

    Returns
    -------
    int
        One of `SIZES` that suits the length. It is not larger than the map, unless the map is
        smaller than the smallest size.
    """
    sizes = [size for size in _sizes_for(length) if size <= min(shape)]
    return max(sizes, default=SIZES[-1])


def _sizes_for(length: float) -> list[int]:
    """Return the sizes of windows that suit an autocorrelation length, the largest first.

    `length` is in distances of the nodes; NaN if it is not known. Sizes up to `USUAL` always suit
    it. A larger one does if the next smaller one is narrower than `WIDE` autocorrelation lengths.
    """
    next_smaller = dict(pairwise(SIZES))
    return [size for size in SIZES if size <= USUAL or next_smaller[size] < WIDE * length]
