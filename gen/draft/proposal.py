"""Propose windows of measured maps: their nodes, spacing and number, and the preparation."""

from __future__ import annotations

import math
import statistics
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

from gen.draft.survey import (
    MapSurvey,
    common_threshold,
    measure,
    require_usable,
    survey_maps,
    usable,
)
from gen.maps.filters import is_same
from gen.maps.library import Tiling
from gen.maps.read import Sides
from gen.maps.settings import Reading
from gen.runtime.errors import InputError

# loads of each surface: a ladder of loads on one surface costs less than as many surfaces
LOADS_PER_SURFACE = 5
OVERLAP = 4  # windows over the number that lie side by side: more would show the same heights again
FEWEST_WINDOWS = 200
MOST_WINDOWS = 2000

# nodes a side of the windows, the widest first; cosine transforms of these numbers are fast
SIZES = (256, 192, 128, 96, 64, 48, 32)
USUAL = 128  # nodes a side, more only where these are narrow beside the texture
# sides of a window in autocorrelation lengths from which its statistics are those of the map
WIDE = 5.0
SHARE_OF_MAPS = 0.75  # share of the maps that have to hold two windows along both axes
FINE = 0.8  # share of the maps that are not coarsened for the sake of the others
# spacing over the median one from which maps are left out, however many they are
COARSE = 4.0
# spacing of a map over the common one above which the map is left out
COARSER = 1.001


@dataclass(frozen=True)
class Proposal:
    """A scene of windows of maps, with the reasons for its values."""

    surveys: list[MapSurvey]  # all files
    reading: Reading  # how files are read and prepared
    # spacing to which all maps are resampled; None if they share theirs [um]
    spacing: float | None
    nodes: int  # nodes along each side of a window
    width: float  # length of a window along x [um]
    windows: int  # number of windows
    tiles: int  # number of tiles of the maps that are used

    @property
    def used(self) -> list[MapSurvey]:
        """Surveys of the maps that are used."""
        return usable(self.surveys)


def propose(
    paths: Sequence[Path], reading: Reading, advance: Callable[[], None] = lambda: None
) -> Proposal:
    """Read maps twice, raw and prepared, and choose the windows of a scene.

    Parameters
    ----------
    paths : sequence of Path
        Files of the maps, at least one.
    reading : Reading
        How files are read that do not say it themselves.
    advance : callable
        Function that is called after each of both readings of a file, for a display of the
        progress.

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
    reading = with_steps(reading, usable(surveys))
    measured = []
    for survey in surveys:
        if survey.fault:
            measured.append(survey)
        else:
            measured.append(measure(survey, reading, spacing).survey)
        advance()
    nodes = _nodes_for(require_usable(measured), spacing)
    surveys = [_unless_narrow(survey, nodes) for survey in measured]
    used = require_usable(surveys)
    step = spacing or used[0].spacing[0]
    shapes = tuple(survey.prepared for survey in used)
    return Proposal(
        surveys=surveys,
        reading=reading,
        spacing=spacing,
        nodes=nodes,
        width=nodes * step,
        windows=_number_of_windows(shapes, nodes),
        tiles=Tiling(shapes, (nodes, nodes)).total,
    )


def _unless_coarse(survey: MapSurvey, spacing: float | None) -> MapSurvey:
    """Return a survey with a fault if its nodes are further apart than the common spacing [um]."""
    if survey.fault or spacing is None:
        return survey
    widest = max(survey.spacing)
    if widest <= COARSER * spacing:
        return survey
    fault = f"a node every {widest:.4g} um, most others have one every {spacing:g}"
    return replace(survey, fault=fault)


def _unless_narrow(survey: MapSurvey, nodes: int) -> MapSurvey:
    """Return a survey with a fault if its prepared map holds no window of nodes x nodes."""
    nx, ny = survey.prepared
    if survey.fault or min(nx, ny) >= nodes:
        return survey
    fault = f"{nx} x {ny} nodes hold no window of {nodes} x {nodes}"
    return replace(survey, fault=fault)


def _nodes_for(used: Sequence[MapSurvey], spacing: float | None) -> int:
    """Choose the nodes a side of windows; without a spacing [um] maps keep the one that they share.

    Raise InputError if all maps are too small.
    """
    step = spacing or max(used[0].spacing)
    lengths = [survey.length for survey in used if not math.isnan(survey.length)]
    length = math.nan
    if lengths:
        length = statistics.median(lengths)
    nodes = window_nodes([survey.prepared for survey in used], length / step)
    if nodes is None:
        raise InputError(
            f"the maps are too small for windows: all have fewer than {SIZES[-1]} nodes a side"
        )
    return nodes


def _number_of_windows(shapes: Sequence[tuple[int, int]], nodes: int) -> int:
    """Choose the number of windows of nodes x nodes for the area of all maps, a multiple of 10."""
    side_by_side = sum(nx * ny for nx, ny in shapes) / nodes**2
    number = min(max(OVERLAP * side_by_side, FEWEST_WINDOWS), MOST_WINDOWS)
    return 10 * round(number / 10)


def with_steps(reading: Reading, surveys: Sequence[MapSurvey]) -> Reading:
    """Choose the steps of the preparation by the spikes, form and holes of the maps.

    Parameters
    ----------
    reading : Reading
        How files are read.
    surveys : sequence of MapSurvey
        Surveys of the maps without a fault, as their files have them.

    Returns
    -------
    Reading
        The same reading with the keys `despike`, which is None if no map has spikes, `level`, a
        quadratic if a map is curved, and `fill`, for maps with holes.
    """
    spikes = [survey.spikes for survey in surveys if survey.spikes is not None]
    is_curved = any(survey.is_curved for survey in surveys)
    return replace(
        reading,
        despike=common_threshold(spikes),
        level="quadratic" if is_curved else "plane",
        fill=any(survey.missing > 0 for survey in surveys),
    )


def common_spacing(spacings: Sequence[Sides]) -> float | None:
    """Choose a spacing that the share `FINE` of the maps reach.

    Parameters
    ----------
    spacings : sequence of pair of float
        Distance of the nodes of each map along x and y, of one map or more [um].

    Returns
    -------
    float or None
        The spacing [um]; None if all maps have the same one but for rounding.
    """
    first = spacings[0]
    if all(is_same(x, first[0]) and is_same(y, first[1]) for x, y in spacings):
        return None
    coarsest = sorted(max(spacing) for spacing in spacings)
    limit = COARSE * statistics.median(coarsest)
    kept = [spacing for spacing in coarsest if spacing <= limit]
    place = min(math.ceil(FINE * len(spacings)), len(kept)) - 1
    return float(f"{kept[place]:.6g}")


def window_nodes(shapes: Sequence[tuple[int, int]], length: float) -> int | None:
    """Choose the nodes along each side of the windows.

    Most maps hold two windows side by side along both axes, for training and for testing, or one
    if no size fits twice. Windows are wider than usual where an autocorrelation length asks.

    Parameters
    ----------
    shapes : sequence of pair of int
        Nodes of each map along x and y.
    length : float
        Autocorrelation length of the maps in nodes; NaN if it is not known.

    Returns
    -------
    int or None
        One of `SIZES`; None if all maps are too small.
    """
    sides = [min(shape) for shape in shapes if min(shape) >= SIZES[-1]]
    if not sides:
        return None
    sizes = _sizes_for(length)
    for windows in (2, 1):
        for size in sizes:
            maps = sum(side >= windows * size for side in sides)
            if maps >= SHARE_OF_MAPS * len(sides):
                return size
    return None


def _sizes_for(length: float) -> list[int]:
    """List the sizes of windows, the widest first, that a texture of a length [nodes] asks for.

    A size above the usual one is in the list if the next smaller one is too narrow.
    """
    narrower = dict(pairwise(SIZES))
    return [size for size in SIZES if size <= USUAL or narrower[size] < WIDE * length]
