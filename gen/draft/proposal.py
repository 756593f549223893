"""Survey measured maps, and propose a scene for them: windows, or surfaces like one."""

from __future__ import annotations

import math
import statistics
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np

from gen.arrays import Heights, Values
from gen.doubts import STEEP
from gen.maps.filters import MOST_HOLES, fitted_polynomial, is_same, resampled
from gen.maps.library import Tiling
from gen.maps.outliers import (
    local_medians,
    refuse_overflowing_heights,
    scatter_of,
    with_code_warnings,
)
from gen.maps.prepare import FLAT, MANY_SPIKES, least_squares, prepare
from gen.maps.read import Sides, Topography, in_words, read
from gen.maps.settings import SPIKE, Reading, in_scene_words
from gen.maps.texture import (
    SelfAffineFit,
    areal_parameters,
    fit_self_affine,
    radial_spectrum,
)
from gen.runtime.errors import InputError
from gen.runtime.files import digest
from gen.runtime.terminal import print_columns
from gen.spectral import SelfAffineSpectrum, generate_spectral
from gen.statistics import rms_slope

# share of the variance about the mean plane that a quadratic form holds at least: less may be a
# long wave of the roughness
FORM = 0.9


@dataclass
class MapSurvey:
    """The content of a file, and its roughness after the preparation; NaN before it is known."""

    path: Path  # the file
    fault: str = ""  # why the file cannot be used, "" if it can
    shape: tuple[int, int] = (
        0,
        0,
    )  # nodes along x and y; (0, 0) of a file that cannot be read
    spacing: Sides = (math.nan, math.nan)  # distance of the nodes along x and y [um]
    unit: str = ""  # unit of the heights in the file, "" if it names none
    missing: int = 0  # number of nodes without a height
    spikes: Spikes | None = None  # spikes, None of a file that cannot be used
    tilt: Sides = (math.nan, math.nan)  # slopes of the mean plane along x and y [1]
    form: float = (
        0.0  # share of the variance about the mean plane that a quadratic takes out [1]
    )
    prepared: tuple[int, int] = (0, 0)  # nodes along x and y after the preparation
    rms_height: float = math.nan  # [um]
    rms_slope: float = math.nan  # between neighbouring nodes, as in databases [1]
    # autocorrelation length Sal of ISO 25178, NaN if half of the map is too short for it [um]
    length: float = math.nan
    warnings: tuple[
        str, ...
    ] = ()  # one line for each value that may stand for missing heights


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
    refuse_overflowing_heights(topography)
    codes = with_code_warnings(replace(topography, warnings=())).warnings
    look.warnings = tuple(in_scene_words(warning, look.path) for warning in codes)
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
            float(np.nanvar(heights - fitted_polynomial(heights, degree)))
            for degree in (1, 2)
        )
        look.form = 1.0 - quadratic / plane if plane else 0.0
        look.spikes = find_spikes(heights)
        tilt = least_squares(topography).tilt
        look.tilt = tilt.x, tilt.y


def _without_name(error: InputError, path: Path) -> str:
    """Take the name of its file out of an error message, and an option that scenes do not have."""
    fault = str(error).removeprefix(str(path)).lstrip(":, ")
    return fault.replace(", or overrule the file by --override-scale", "")


def measure(
    look: MapSurvey, reading: Reading, spacing: float | None = None
) -> Topography | None:
    """Prepare a map as the scene will, note its roughness, and return it; None at a fault."""
    try:
        topography = prepare(read(look.path, reading), reading)
        if spacing is not None:
            topography = resampled(topography, (spacing, spacing))
    except InputError as error:
        look.fault = _without_name(error, look.path)
        return None
    heights, slope = topography.heights, rms_slope(topography.heights, topography.spacing)
    look.prepared = heights.shape[0], heights.shape[1]
    look.rms_height, look.rms_slope = float(heights.std()), slope
    look.length = areal_parameters(topography).values["Sal"]
    if slope < FLAT:
        look.fault = f"its rms slope is {slope:.2g}: check the unit of its heights"
        return None
    return topography


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
    signed = heights - local_medians(heights)
    distances = np.abs(signed / scatter_of(signed, heights))
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
    """Choose a threshold between all surfaces and spikes, or just below the nearest spike."""
    nearest = min((each.nearest for each in found), default=math.inf)
    if math.isinf(nearest):
        return None
    surface = max(each.surface for each in found)
    middle = math.sqrt(surface * nearest) if surface < nearest else 0.98 * nearest
    return (
        float(f"{middle:.2g}") if surface < float(f"{middle:.2g}") < nearest else middle
    )


def print_looks(looks: Sequence[MapSurvey]) -> None:
    """Print a line for each file: its content, and whether it is used or why not."""
    rows = []
    for look in looks:
        known = {
            "nodes": f"{look.shape[0]} x {look.shape[1]}",
            "spacing um": in_words(look.spacing, 4),
            "unit": look.unit or "um?",
            "holes %": f"{100 * look.missing / max(1, math.prod(look.shape)):.2g}",
            "spikes": str(look.spikes.number) if look.spikes else "-",
            "tilt": f"{max(map(abs, look.tilt)):.2g}",
            "rms height um": f"{look.rms_height:.3g}",
            "rms slope": f"{look.rms_slope:.3g}",
        }
        cells = [
            cell.replace("nan", "-") if look.shape[0] else "-" for cell in known.values()
        ]
        use = f"no: {look.fault}" if look.fault else "; ".join(["yes", *remarks(look)])
        rows.append([look.path.name, *cells, use])
    print_columns(rows, ["map", *known, "use"], right=known.keys() - {"unit"})


# loads of each surface: a ladder of loads on one surface costs less than as many surfaces
LOADS_PER_SURFACE = 5
OVERLAP = 4  # windows over the number that lie side by side: more would show the same heights again
WINDOWS = (200, 2000)  # smallest and largest number of windows


@dataclass(frozen=True)
class Proposal:
    """A scene of windows of maps, with the reasons for its values."""

    looks: list[MapSurvey]  # all files
    used: list[MapSurvey]  # those without a fault
    reading: Reading  # how files are read and prepared
    spacing: (
        float | None
    )  # spacing to which all maps are resampled; None if they share theirs [um]
    nodes: int  # nodes along each side of a window
    width: float  # length of a window along x [um]
    windows: int  # number of windows
    tiles: int  # number of tiles of the maps that are used


def propose(
    paths: Sequence[Path], reading: Reading, looked: Callable[[], None] = lambda: None
) -> Proposal:
    """Look at maps twice, raw and prepared, and choose windows."""
    looks = survey(paths, reading, looked)
    require_used(looks)
    spacing = common_spacing([look.spacing for look in looks if not look.fault])
    for look in looks:
        if (
            not look.fault
            and spacing is not None
            and (wide := max(look.spacing)) > 1.001 * spacing
        ):
            look.fault = (
                f"a node every {wide:.4g} um, most others have one every {spacing:g}"
            )
    reading = with_steps(reading, [look for look in looks if not look.fault])
    for look in looks:
        if not look.fault:
            measure(look, reading, spacing)
        looked()
    used = require_used(looks)
    step = max(used[0].spacing) if spacing is None else spacing
    known = [each.length for each in used if not math.isnan(each.length)]
    length = statistics.median(known) if known else math.nan
    nodes = window_nodes([each.prepared for each in used], length / step)
    if nodes is None:
        raise InputError(
            f"the maps are too small for windows: all have fewer than {SIZES[-1]} nodes a side"
        )
    for look in used:
        if min(shape := look.prepared) < nodes:
            look.fault = (
                f"{shape[0]} x {shape[1]} nodes hold no window of {nodes} x {nodes}"
            )
    used = require_used(looks)
    beside = sum(math.prod(each.prepared) for each in used) / nodes**2
    windows = 10 * round(min(max(OVERLAP * beside, WINDOWS[0]), WINDOWS[1]) / 10)
    width = nodes * (used[0].spacing[0] if spacing is None else spacing)
    tiles = Tiling(tuple(each.prepared for each in used), (nodes, nodes)).total
    return Proposal(looks, used, reading, spacing, nodes, width, windows, tiles)


def require_used(looks: Sequence[MapSurvey]) -> list[MapSurvey]:
    """Return the maps that can be used; refuse files of which none can."""
    used = [look for look in looks if not look.fault]
    if not used:
        others = f", and {len(looks) - 1} more files" if len(looks) > 1 else ""
        raise InputError(f"no map can be used: {looks[0].path}: {looks[0].fault}{others}")
    return used


def with_steps(reading: Reading, looks: Sequence[MapSurvey]) -> Reading:
    """Choose the steps of the preparation by the spikes, form and holes found in the maps."""
    spikes = [look.spikes for look in looks if look.spikes is not None]
    return replace(
        reading,
        despike=common_threshold(spikes),
        level="quadratic" if any(look.form > FORM for look in looks) else "plane",
        fill=any(look.missing for look in looks),
    )


# nodes a side of the windows, the widest first; cosine transforms of these numbers are fast
SIZES = (256, 192, 128, 96, 64, 48, 32)
USUAL = 128  # nodes a side, more only where these are narrow beside the texture
# sides of a window in autocorrelation lengths from which its statistics are those of the map
WIDE = 5.0
MOST_MAPS = 0.75  # share of the maps that have to hold two windows along both axes
FINE = 0.8  # share of the maps that are not coarsened for the sake of the others
COARSE = (
    4.0  # spacing over the median one from which maps are left out, however many they are
)


def common_spacing(spacings: Sequence[Sides]) -> float | None:
    """Choose the spacing [um] that `FINE` of the maps reach, None if all have the same."""
    first = spacings[0]
    if all(is_same(*pair) for each in spacings for pair in zip(each, first, strict=True)):
        return None
    coarsest = sorted(max(each) for each in spacings)
    limit = COARSE * statistics.median(coarsest)
    kept = [each for each in coarsest if each <= limit]
    place = min(math.ceil(FINE * len(spacings)), len(kept)) - 1
    return float(f"{kept[place]:.6g}")


def window_nodes(shapes: Sequence[tuple[int, int]], length: float) -> int | None:
    """Choose the nodes along each side of the windows, None if all maps are too small.

    Most maps hold two windows side by side along both axes, for training and for testing, or one
    if no size fits twice. They are wider than usual where an autocorrelation length [nodes] asks.
    """
    sides = [min(shape) for shape in shapes if min(shape) >= SIZES[-1]]
    narrower = dict(pairwise(SIZES))
    wanted = [each for each in SIZES if each <= USUAL or narrower[each] < WIDE * length]
    for windows in (2, 1):
        for size in wanted:
            if sides and sum(each >= windows * size for each in sides) >= MOST_MAPS * len(
                sides
            ):
                return size
    return None


def rounded(value: float, digits: int = 2) -> float:
    """Round a number to some significant digits."""
    return float(f"{value:.{digits}g}")


NODES = 128  # nodes along each side of the surfaces
SURFACES = 600  # number of surfaces
# factor by which the lengths and the slope of the population differ from the map's, at most
AROUND = 1.25
EXPONENTS = 0.05  # distance of the population's Hurst exponents from the map's, at most
# factor by which a spectrum is off its law, or heights are off the map's, if the law is doubtful:
# isotropic made maps have 1.1
UNLIKE = 1.4
LAY = 1.25  # ratio of the slopes along both axes from which a map has a lay
TRIED = 8  # surfaces that are generated to compare them with the map
# period of the surfaces in sides of the patch, the generator's for patches without a period
PERIOD = 2


@dataclass(frozen=True)
class Likeness:
    """A self-affine law for a map, and surfaces that follow it."""

    look: MapSurvey  # the map
    reading: Reading  # how it is read and prepared
    fit: SelfAffineFit  # law of its spectrum
    # the same law as the generator takes it, with the stretch of a lay
    spectrum: SelfAffineSpectrum
    step: float  # distance of the nodes [um]
    # rms slope of the waves with which generated surfaces have the map's slope between nodes [1]
    slope: float
    # rms height [um] and rms slope between nodes [1] of windows of the map, medians
    windows: tuple[float, float]
    height: float  # rms height of the generated surfaces, median [um]
    doubt: str  # why the surfaces are not like the map, "" if they are


def propose_like(path: Path, reading: Reading) -> Likeness:
    """Fit a self-affine law to a map, and generate a few surfaces to see how like they are."""
    [look] = require_used(survey([path], reading))
    reading = with_steps(reading, [look])
    if (topography := measure(look, reading)) is None:
        raise InputError(f"no map can be used: {path}: {look.fault}")
    (dx, dy), heights = topography.spacing, topography.heights
    along_x, along_y = (
        rms_slope(heights, (dx, math.inf)),
        rms_slope(heights, (math.inf, dy)),
    )
    lay = along_y / along_x if along_x else 1.0
    # Wavelengths along x over those along y; those of a stretched spectrum are along y.
    stretch = 1.0 if 1 / LAY < lay < LAY else rounded(lay)
    isotropic = replace(
        topography, sides=(topography.sides[0] / stretch, topography.sides[1])
    )
    aspect = areal_parameters(isotropic).values["Str"]
    fit = fit_self_affine(isotropic, radial_spectrum(isotropic), aspect)
    if isinstance(fit, str):
        raise InputError(f"{path}: no self-affine law fits it: {fit}")
    step = float(f"{min(topography.spacing):.6g}")
    law, shortest = (
        fit.spectrum,
        2.02 * step * max(1.0, 1 / stretch),
    )  # waves that the grid holds
    cut_off = rounded(max(law.cut_off, shortest), 3)
    roll_off = max(rounded(law.roll_off, 3), cut_off)
    spectrum = SelfAffineSpectrum(rounded(law.hurst), roll_off, cut_off, stretch)
    period = PERIOD * NODES
    generated = [  # as the scene will, with waves whose rms slope is 1
        generate_spectral(
            (period, period),
            period * step,
            spectrum,
            np.random.default_rng(seed),
            rms_slope=1.0,
        )[:NODES, :NODES]
        for seed in range(TRIED)
    ]
    x, y = (range(0, max(1, nodes - NODES + 1), NODES) for nodes in heights.shape)
    cut = [heights[i : i + NODES, j : j + NODES] for i in x for j in y]
    windows = _medians(cut, topography.spacing)
    height, unscaled = _medians(generated, (step, step))
    slope = windows[1] / unscaled  # of the waves, where that between nodes is the map's
    height *= slope
    off, doubt = max(height / windows[0], windows[0] / height), ""
    if off > UNLIKE:
        doubt = f"rms heights of generated surfaces are off the map's by a factor of {off:.2g}"
    elif fit.scatter > UNLIKE:
        doubt = f"the map's spectrum is off the law by a factor of {fit.scatter:.2g}"
    slope = rounded(slope, 3)
    return Likeness(look, reading, fit, spectrum, step, slope, windows, height, doubt)


def _medians(
    surfaces: list[Heights], spacing: tuple[float, float]
) -> tuple[float, float]:
    """Return the medians of rms height [um] and rms slope."""
    return (
        float(np.median([surface.std() for surface in surfaces])),
        float(np.median([rms_slope(surface, spacing) for surface in surfaces])),
    )
