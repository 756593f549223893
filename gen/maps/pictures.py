"""Pictures of surfaces: maps with colour bars, the distribution of heights and the spectrum."""

from __future__ import annotations

import math
import textwrap
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from gen.arrays import Heights, Values
from gen.maps.joining import JoinedSpectrum
from gen.maps.read import Sides, Topography
from gen.maps.texture import RadialSpectrum, SelfAffineFit
from gen.runtime.figure import save
from gen.runtime.terminal import shortened

LETTERS = 50  # letters in a line of a title above a panel as wide as half of a picture
# percentile at which a colour scale ends if a few outliers would otherwise take most of it
UPPER_PERCENTILE = 99


@dataclass(frozen=True)
class ColoursBeyond:
    """Colours of the values below and above a colour scale; the scale itself does not have them."""

    below: str  # name of a colour of matplotlib
    above: str  # name of a colour of matplotlib


BEYOND = {
    "viridis": ColoursBeyond(below="magenta", above="red"),
    "inferno_r": ColoursBeyond(below="deepskyblue", above="limegreen"),
}
"""Colours beyond the ends of colour maps, by the names of the maps."""

COLOURS = 20  # number of colours of spots: that of the colour map tab20
OBLONG = 4.0  # ratio of the sides above which a map is not to scale, but fills its panel
# colour of marked nodes (red, green, blue): no colour map of these pictures has it
CYAN = (0.09, 0.75, 0.81)
BINS = 80  # number of bars of the height distribution
CURVE_POINTS = 1000  # largest number of points of the bearing curve


@dataclass(frozen=True, eq=False)
class Map:
    """A field over a surface, and how it is drawn."""

    # values in `unit`, masked where nothing is drawn, shape (nx, ny); without a quantity they are
    # numbers of colours, from 0 to `COLOURS` - 1
    field: Values
    sides: Sides  # lengths of the patch along x and y [um]
    title: str
    quantity: str  # name of the quantity for the colour bar, "" for none
    unit: str  # unit of the quantity, "" for none
    colours: str  # name of a colour map of matplotlib: a key of `BEYOND` if there is a quantity
    # whether each node is drawn in `CYAN` instead, shape (nx, ny); None for no node
    marked: NDArray[np.bool_] | None = None


@dataclass(frozen=True)
class Extreme:
    """The value of a map that is farthest beyond one end of its colours."""

    node: tuple[int, int]  # indices of its node along x and y
    colour: str  # name of the colour of all values beyond this end
    words: str  # the value and the colour, for the title


@dataclass(frozen=True)
class ColourScale:
    """The ends of the colours of a map, with the outliers beyond them."""

    low: float  # value of the first colour, in the map's unit
    high: float  # value of the last colour, in the map's unit
    # The values farthest below `low` and above `high`, None if no value is beyond. They get a
    # circle and words, because a picture of a large map would average a single node away.
    below: Extreme | None = None
    above: Extreme | None = None

    @property
    def extend(self) -> Literal["neither", "min", "max", "both"]:
        """Ends beyond which there are values, in the words of matplotlib."""
        if self.below is not None and self.above is not None:
            return "both"
        if self.below is not None:
            return "min"
        if self.above is not None:
            return "max"
        return "neither"

    @property
    def extremes(self) -> list[Extreme]:
        """The farthest values beyond both ends, the low one first."""
        return [extreme for extreme in (self.below, self.above) if extreme is not None]

    @property
    def remark(self) -> str:
        """Words for the title on the values beyond the colours, "" if there are none."""
        if not self.extremes:
            return ""
        words = " and ".join(extreme.words for extreme in self.extremes)
        return f"beyond the colours: {words}"


def colour_scale(surface_map: Map) -> ColourScale:
    """Choose the ends of the colours of a map so that a few outliers do not take most of them.

    Parameters
    ----------
    surface_map : Map
        The map.

    Returns
    -------
    ColourScale
        Colours from the smallest to the largest value. Each end by itself is at its percentile
        instead (`UPPER_PERCENTILE`, or 100 minus it) if the values beyond this percentile span more
        than half of the range between both percentiles. For a map without a quantity, the ends are
        0 and `COLOURS` - 1; if no value is drawn, 0 and 1.
    """
    field = surface_map.field
    values = np.ma.compressed(field)
    if not surface_map.quantity:
        return ColourScale(low=0.0, high=COLOURS - 1.0)
    if not values.size:
        return ColourScale(low=0.0, high=1.0)  # nothing is drawn
    smallest = float(values.min())
    largest = float(values.max())
    percentiles = np.percentile(values, [100 - UPPER_PERCENTILE, UPPER_PERCENTILE])
    first, last = percentiles.tolist()
    colours = BEYOND[surface_map.colours]
    ny = field.shape[1]
    low = smallest
    high = largest
    below = None
    above = None
    # Half of the range between both percentiles, below the lower and above the upper one.
    lower_bound = 1.5 * first - 0.5 * last
    upper_bound = 1.5 * last - 0.5 * first
    if smallest < lower_bound:
        low = first
        below = Extreme(
            node=divmod(int(np.ma.argmin(field)), ny),
            colour=colours.below,
            words=f"down to {smallest:.4g} {surface_map.unit} ({colours.below})",
        )
    if largest > upper_bound:
        high = last
        above = Extreme(
            node=divmod(int(np.ma.argmax(field)), ny),
            colour=colours.above,
            words=f"up to {largest:.4g} {surface_map.unit} ({colours.above})",
        )
    return ColourScale(low=low, high=high, below=below, above=above)


def plot_map(axis: Any, surface_map: Map, letters: int = LETTERS) -> None:
    """Draw a map into an axis, with a title, and with a colour bar if it has a quantity.

    The map is to scale unless one side is more than `OBLONG` times as long as the other.

    Parameters
    ----------
    axis : matplotlib.axes.Axes
        An empty axis, which is drawn into.
    surface_map : Map
        The map.
    letters : int, optional
        Largest number of letters in a line of the title.
    """
    width, length = surface_map.sides
    is_oblong = max(width, length) > OBLONG * min(width, length)
    scale = colour_scale(surface_map)
    image = axis.imshow(
        surface_map.field.T,
        origin="lower",
        extent=(0.0, width, 0.0, length),
        cmap=surface_map.colours,
        vmin=scale.low,
        vmax=scale.high,
        aspect="auto" if is_oblong else "equal",
    )
    _plot_extremes(axis, image, surface_map, scale)
    axis.set_facecolor("0.93")
    _plot_marked(axis, image, surface_map)
    if surface_map.quantity:
        # left, bottom, width and height in units of the axis: right of the map, and as high
        bar = axis.inset_axes((1.03, 0.0, 0.04, 1.0))
        label = f"{surface_map.quantity} [{surface_map.unit}]"
        axis.figure.colorbar(image, cax=bar, label=label, extend=scale.extend)
    lines = textwrap.wrap(surface_map.title, letters)
    lines += textwrap.wrap(scale.remark, letters)
    if is_oblong:
        lines.append("not to scale")
    axis.set_title("\n".join(lines), loc="left", fontsize=10, parse_math=False)
    axis.set(xlabel="x [µm]", ylabel="y [µm]")


def _plot_extremes(axis: Any, image: Any, surface_map: Map, scale: ColourScale) -> None:
    """Colour the values beyond the scale of a map's image, and circle the farthest ones."""
    if not scale.extremes:
        return
    colours = BEYOND[surface_map.colours]
    scaled = image.get_cmap().with_extremes(under=colours.below, over=colours.above)
    image.set_cmap(scaled)
    nx, ny = surface_map.field.shape
    width, length = surface_map.sides
    for extreme in scale.extremes:
        ix, iy = extreme.node
        axis.plot(
            (ix + 0.5) * width / nx,
            (iy + 0.5) * length / ny,
            "o",
            ms=9,
            mfc="none",
            mec=extreme.colour,
            scalex=False,
            scaley=False,
        )


def _plot_marked(axis: Any, image: Any, surface_map: Map) -> None:
    """Draw the marked nodes of a map in cyan over its image."""
    marked = surface_map.marked
    if marked is None or not marked.any():
        return
    nx, ny = marked.shape
    colours = np.zeros((ny, nx, 4))  # transparent
    colours[marked.T] = (*CYAN, 1.0)
    axis.imshow(
        colours,
        origin="lower",
        interpolation="nearest",
        extent=image.get_extent(),
        aspect=image.axes.get_aspect(),
    )


def plot_surface(
    figure: Any,
    topography: Topography,
    spectrum: RadialSpectrum,
    fit: SelfAffineFit | str,
    picture: Path,
    *,
    directional: bool,
) -> None:
    """Draw heights, height distribution, bearing curve and spectrum of a surface.

    The picture is written to a file. An existing file is replaced.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
        An empty figure, which is drawn into.
    topography : Topography
        The surface, without holes.
    spectrum : RadialSpectrum
        Power spectrum of the surface.
    fit : SelfAffineFit or str
        The law of the spectrum, or the reason why it has none.
    picture : Path
        File of the picture.
    directional : bool
        Whether the surface has a lay; then the spectra of its profiles along x and along y are
        drawn beside its radial spectrum.

    Raises
    ------
    InputError
        If the file cannot be written.
    """
    top, bottom = figure.subfigures(2, 1, height_ratios=[1.12, 1.0])
    map_axis, distribution_axis = top.subplots(1, 2, width_ratios=[1.15, 1.0])
    figure.suptitle(shortened(topography.name), fontsize=11, parse_math=False)
    heights = topography.heights
    surface_map = Map(
        field=heights,
        sides=topography.sides,
        title=f"heights, {heights.shape[0]} x {heights.shape[1]} nodes",
        quantity="height",
        unit="µm",
        colours="viridis",
    )
    plot_map(map_axis, surface_map)
    _plot_distribution(distribution_axis, heights)
    if directional:
        radial, profiles = bottom.subplots(1, 2)
        _plot_spectrum(radial, spectrum, fit, LETTERS)
        _plot_profile_spectra(profiles, spectrum)
    else:
        _plot_spectrum(bottom.subplots(), spectrum, fit, 2 * LETTERS)
    save(figure, picture)


def plot_joined(figure: Any, joined: JoinedSpectrum, picture: Path) -> None:
    """Draw a joined spectrum and the spectrum of each scan, thick at the waves that the scan knows.

    The picture is written to a file. An existing file is replaced.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
        An empty figure, which is drawn into.
    joined : JoinedSpectrum
        The spectrum and its scans.
    picture : Path
        File of the picture.

    Raises
    ------
    InputError
        If the file cannot be written.
    """
    axis = figure.subplots()
    fit = joined.fit
    _plot_spectrum(axis, joined.spectrum, fit, 2 * LETTERS)
    for number, scan in enumerate(joined.scans):
        colour = f"C{number % 10}"
        waves = scan.range
        label = f"{shortened(scan.name)}: {waves.longest:.3g} to {waves.shortest:.3g} µm"
        axis.loglog(
            scan.in_all_bins.wavenumbers,
            scan.in_all_bins.density,
            color=colour,
            lw=0.8,
            alpha=0.7,
        )
        axis.loglog(
            scan.in_range.wavenumbers,
            scan.in_range.density,
            color=colour,
            lw=2.5,
            label=label.replace("$", r"\$"),
        )
    axis.legend(loc="lower left", fontsize="small")
    save(figure, picture)


def _plot_note(axis: Any, note: str) -> None:
    """Write a note into an axis without curves, and remove the numbers of the axis."""
    axis.text(0.5, 0.5, note, ha="center", transform=axis.transAxes)
    axis.set(xticks=[], yticks=[])


def _plot_distribution(axis: Any, heights: Heights) -> None:
    """Draw the distribution of heights [um] as bars, and the bearing curve as a line.

    The bearing curve is the share of the surface above each height. A flat surface has a note
    instead.
    """
    axis.set_title("height distribution and bearing curve", loc="left", fontsize=10)
    axis.set_ylabel("height above the mean [µm]")
    axis.set_xlabel("share of the surface per µm [%]", color="tab:blue")
    falling = np.sort(heights.ravel() - heights.mean())[::-1]
    if falling[0] == falling[-1]:
        _plot_note(axis, "flat surface")
        return
    counts, edges = np.histogram(falling, BINS)
    shares_per_um = 100.0 * counts / falling.size / np.diff(edges)
    axis.stairs(
        shares_per_um,
        edges,
        orientation="horizontal",
        fill=True,
        color="tab:blue",
        alpha=0.35,
    )
    axis.set_xlim(left=0.0)
    bearing = axis.twiny()
    places = np.linspace(0, falling.size - 1, CURVE_POINTS).astype(int)
    places = np.unique(places)
    shares_above = 100.0 * (places + 1) / falling.size
    bearing.plot(shares_above, falling[places], color="tab:red", lw=1.5)
    bearing.set_xlim(0, 100)
    bearing.set_xlabel("bearing curve: share of the surface above [%]", color="tab:red")
    axis.axhline(0.0, color="k", lw=0.6, ls=":")


WAVENUMBER = "wavenumber q = 2π / wavelength [1/µm]"  # label of the axes of spectra


def _plot_profile_spectra(axis: Any, spectrum: RadialSpectrum) -> None:
    """Draw the mean power spectra of the profiles along x and along y, or a note if both are 0."""
    axis.set_title("power spectra of profiles", loc="left", fontsize=10)
    axis.set(xlabel=WAVENUMBER, ylabel="profiles' power spectrum [µm$^3$]")
    curves = {"along x": spectrum.along_x, "along y": spectrum.along_y}
    if not any((density > 0.0).any() for density in curves.values()):
        _plot_note(axis, "no wave")
        return
    for name, density in curves.items():
        shown = np.isfinite(density) & (density > 0.0)
        wavenumbers = spectrum.wavenumbers[shown]
        axis.loglog(wavenumbers, density[shown], ".-", ms=4, lw=1, label=name)
    axis.grid(alpha=0.3)
    axis.legend(loc="lower left", fontsize="small")


def _plot_spectrum(
    axis: Any, spectrum: RadialSpectrum, fit: SelfAffineFit | str, letters: int
) -> None:
    """Draw the radial power spectrum, and its law if `fit` is one, or a note if there is no wave.

    `letters` is the largest number of letters in a line of the title.
    """
    title = _spectrum_title(fit, letters)
    axis.set_title(title, loc="left", fontsize=10)
    axis.set(xlabel=WAVENUMBER, ylabel="radial power spectrum C [µm$^4$]")
    shown = np.isfinite(spectrum.density) & (spectrum.density > 0.0)
    if not shown.any():
        _plot_note(axis, "no wave")
        return
    axis.set_xlim(spectrum.edges[0, 0], spectrum.edges[-1, 1])
    densities = spectrum.density[shown]
    axis.loglog(spectrum.wavenumbers[shown], densities, ".", color="0.45", ms=5)
    axis.grid(alpha=0.3)
    if not isinstance(fit, str):
        _plot_self_affine_law(axis, spectrum, fit, float(densities.min()))


def _spectrum_title(fit: SelfAffineFit | str, letters: int) -> str:
    """Return the title of a spectrum: the numbers of its law, or the reason why it has none.

    The reason is broken into lines of at most `letters` letters.
    """
    if isinstance(fit, str):
        reason = f"radial power spectrum; no self-affine law: {fit}"
        return textwrap.fill(reason, letters)
    law = (
        f"radial power spectrum: Hurst exponent {fit.spectrum.hurst:.3g} over"
        f" {fit.decades:.2g} decades, rms height {fit.rms_height:.4g} µm"
    )
    return "; ".join((law, *fit.remarks))


def _plot_self_affine_law(
    axis: Any, spectrum: RadialSpectrum, fit: SelfAffineFit, smallest: float
) -> None:
    """Draw a law, shade the range of its fit, and mark its roll-off and its cut-off.

    `smallest` is the smallest density above 0 of the spectrum [um^4]; it bounds the axis.
    """
    last = 2 * math.pi / fit.spectrum.cut_off
    axis.axvspan(spectrum.edges[0, 0], last, color="tab:orange", alpha=0.1, lw=0)
    wavenumbers = np.geomspace(2 * math.pi / fit.longest, last, 300)
    # The law is equal in all directions: take waves along x.
    law = fit.level * fit.spectrum.density(qx=wavenumbers, qy=np.zeros(1))
    label = "self-affine law, in the range of the fit"
    axis.loglog(wavenumbers, law, color="tab:orange", lw=2, label=label)
    if fit.spectrum.roll_off < fit.longest:
        _plot_wavelength(axis, "roll-off", fit.spectrum.roll_off, ":")
    _plot_wavelength(axis, "cut-off", fit.spectrum.cut_off, "--")
    # Beyond a cut-off there may be nothing but rounding, which must not flatten the curve.
    axis.set_ylim(bottom=max(smallest, 1e-3 * float(law.min())) / 2)
    axis.legend(loc="lower left", fontsize="small")


def _plot_wavelength(axis: Any, name: str, wavelength: float, style: str) -> None:
    """Draw a vertical line of a style of matplotlib at the wavenumber of a wavelength [um].

    `name` and the wavelength are its label. The axis has wavenumbers [1/um].
    """
    label = f"{name} {wavelength:.4g} µm"
    axis.axvline(2 * math.pi / wavelength, color="k", lw=0.9, ls=style, label=label)
