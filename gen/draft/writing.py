"""Write scenes for maps: TOML with comments that say why the scene has its values."""

from __future__ import annotations

import json
import re
import statistics
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from string import Template

from gen.draft import templates
from gen.draft.likeness import NODES, Likeness, rounded
from gen.draft.proposal import LOADS_PER_SURFACE, Proposal
from gen.draft.survey import MapSurvey, remarks
from gen.generators.scans import MOST_PATTERNS
from gen.maps.read import spacing_text
from gen.maps.settings import Reading
from gen.material import Bodies
from gen.runtime.errors import InputError
from gen.runtime.files import atomic
from gen.runtime.terminal import command_to_type, printable
from gen.scene import Scene

SURFACES = 600  # number of self-affine surfaces
# factor by which the lengths and the slope of the population differ from the map's, at most
SPREAD = 1.25
EXPONENTS = 0.05  # distance of the population's Hurst exponents from the map's, at most

# tiles from which the part that tests a surrogate, a fifth, holds two or more
FEW_TILES = 10
# nodes in contact under the smallest load; fewer count the grid rather than the area
FEWEST_NODES = 50
LARGEST_AREA = 0.4  # share of the patch in contact under the largest load, about
YIELDING = 0.5  # largest mean pressure over the hardness; at 1 there is no equilibrium
# contact area times E* rms slope over the load for light loads; the theories say 1.6 and 2.5
KAPPA = 2.0


def scene_of_windows(
    proposal: Proposal, bodies: Bodies, inputs: Sequence[str], command: str, output: Path
) -> str:
    """Return a scene of windows of maps, with comments that say why it has its values.

    Parameters
    ----------
    proposal : Proposal
        The maps, and the windows and the preparation that were chosen for them.
    bodies : Bodies
        Material of the contact.
    inputs : sequence of str
        Names of maps as the user gave them: files, folders or patterns.
    command : str
        The command line, for the comments.
    output : Path
        The file that the scene is for: names of maps are relative to its folder.

    Returns
    -------
    str
        The scene in TOML.

    Raises
    ------
    InputError
        If TOML cannot hold the name of a map.
    """
    used = proposal.used
    title = f"Windows of {_counted(len(used), 'measured map')}"
    few_tiles = ""
    if proposal.tiles < FEW_TILES:
        few_tiles = templates.FEW_TILES
    slopes = [survey.rms_slope for survey in used]
    return filled(
        templates.WINDOWS,
        {
            **_beginning(title, output, command, proposal.windows),
            "fit": _fit_command(output),
            "files": _files(proposal, inputs, output.absolute().parent),
            "width": f"{proposal.width:.4g}",
            "tiles": _counted(proposal.tiles, "tile"),
            "few_tiles": few_tiles,
            "nodes": str(proposal.nodes),
            "spacing": _spacing(proposal),
            **_preparation(proposal),
            "reading": _reading(proposal.reading),
            "load": _load(bodies, slopes, proposal.nodes**2),
            "contact": _contact(bodies),
        },
    )


def scene_like(likeness: Likeness, bodies: Bodies, command: str, output: Path) -> str:
    """Return a scene of self-affine surfaces like a map, with comments.

    Parameters
    ----------
    likeness : Likeness
        The map, the law that fits it, and the roughness of surfaces that follow the law.
    bodies : Bodies
        Material of the contact.
    command : str
        The command line, for the comments.
    output : Path
        The file that the scene is for.

    Returns
    -------
    str
        The scene in TOML.

    Raises
    ------
    InputError
        If TOML cannot hold the name of the map.
    """
    name = likeness.survey.path.name
    title = f"Self-affine surfaces like {name}"
    slope = likeness.slope
    return filled(
        templates.LIKE,
        {
            "name": printable(name),
            **_beginning(title, output, command, SURFACES),
            "preparation": _preparation_options(likeness.reading),
            "step": f"{likeness.step:g}",
            "nodes": str(NODES),
            "side": repr(rounded(NODES * likeness.step, 6)),
            **_law(likeness),
            "slope": f"{slope:.3g}",
            "map_slope": f"{likeness.windows.rms_slope:.3g}",
            "height": f"{likeness.height:.3g}",
            "map_height": f"{likeness.windows.rms_height:.3g}",
            "doubt": _if_any(templates.DOUBT, "doubt", likeness.doubt),
            "rms_slope": _range(rounded(slope / SPREAD, 3), rounded(slope * SPREAD, 3)),
            "load": _load(bodies, [likeness.survey.rms_slope], NODES**2),
            "contact": _contact(bodies),
        },
    )


def filled(template: str, texts: Mapping[str, str]) -> str:
    """Fill the gaps of a template.

    A line that holds nothing but the $name of an empty text is left out, and so is all but the
    first of several empty lines.

    Parameters
    ----------
    template : str
        Lines with $names.
    texts : mapping of str to str
        A text for each name, of one line or several.

    Returns
    -------
    str
        The filled template.
    """
    lines = []
    for line in template.splitlines(keepends=True):
        stands_alone = line.startswith("$")
        if stands_alone and texts.get(line.strip().removeprefix("$")) == "":
            continue
        lines.append(Template(line).substitute(texts))
    return re.sub(r"\n{3,}", "\n\n", "".join(lines))


def _if_any(template: str, name: str, text: str) -> str:
    """Fill the only gap of a template by a text; nothing if the text is empty."""
    if not text:
        return ""
    return filled(template, {name: text})


def _counted(number: int, noun: str) -> str:
    """Return a number with its noun, as "1 tile" and "3 tiles"."""
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"


def _beginning(title: str, output: Path, command: str, surfaces: int) -> dict[str, str]:
    """Return what both kinds of scenes begin with: commands, title and numbers of samples."""
    scene = printable(str(output))
    database = _beside(output, ".h5")
    return {
        "title": title,
        "command": printable(command),
        "estimate": f"{command_to_type('gen estimate')} {scene}",
        "run": f"{command_to_type('gen run')} {scene} -o {database}",
        "quoted_title": quoted(title),
        "surfaces": str(surfaces),
        "loads_per_surface": str(LOADS_PER_SURFACE),
        "samples": str(surfaces * LOADS_PER_SURFACE),
    }


def _fit_command(output: Path) -> str:
    """Return the command that fits a surrogate to the database of a scene."""
    fit = command_to_type("learn fit")
    return f"{fit} {_beside(output, '.h5')} --features hybrid -o {_beside(output, '.surrogate')}"


def _beside(output: Path, suffix: str) -> str:
    """Return the name of a file beside the scene, in printable letters."""
    return printable(str(output.with_suffix(suffix)))


def _files(proposal: Proposal, inputs: Sequence[str], home: Path) -> str:
    """Return the list of files, with those that are left out as comments; `home` is the scene's.

    Of more maps than a list may hold, the names that the user gave are listed instead.
    """
    if len(proposal.used) > MOST_PATTERNS:
        paths = [Path(name).expanduser().absolute() for name in inputs]
        return "\n".join(f"    {quoted(str(path))}," for path in paths)
    home = home.resolve()
    return "\n".join(_file_line(survey, home) for survey in proposal.surveys)


def _file_line(survey: MapSurvey, home: Path) -> str:
    """Return the line of a map, whose name is relative to a folder if the map is in it."""
    name = str(survey.path)
    if survey.path.is_relative_to(home):
        name = str(survey.path.relative_to(home))
        if name.startswith("~"):  # which would stand for somebody's home
            name = f"./{name}"
    if survey.fault:
        return f"    # {quoted(name)} is left out: {printable(survey.fault)}"
    comment = "; ".join([f"rms slope {survey.rms_slope:.3g}", *remarks(survey)])
    return f"    {quoted(name)},  # {comment}"


def _spacing(proposal: Proposal) -> str:
    """Return the key `spacing`, or a comment if all maps keep theirs."""
    used = proposal.used
    if proposal.spacing is None:
        return filled(templates.SAME_SPACING, {"spacing": spacing_text(used[0].spacing)})
    distances = [distance for survey in used for distance in survey.spacing]
    return filled(
        templates.SPACING,
        {
            "finest": f"{min(distances):.4g}",
            "coarsest": f"{max(distances):.4g}",
            "spacing": repr(float(proposal.spacing)),
        },
    )


def _preparation(proposal: Proposal) -> dict[str, str]:
    """Return the steps of the preparation, with what they are for."""
    used = proposal.used
    steps = proposal.reading
    despike = "# No map has spikes: no despike."
    if steps.despike is not None:
        despike = _despike(used, steps.despike)
    fill = "# No map has holes: no fill."
    if steps.fill:
        maps_with_holes = [survey for survey in used if survey.missing > 0]
        counts = {"maps_with_holes": str(len(maps_with_holes)), "maps": str(len(used))}
        fill = filled(templates.FILL, counts)
    return {
        "despike": despike,
        "reason_for_level": _reason_for_level(used, steps.level),
        "level": quoted(steps.level),
        "fill": fill,
    }


def _despike(used: Sequence[MapSurvey], threshold: float) -> str:
    """Return the key `despike` with a threshold, and the number of spikes in the maps."""
    numbers = [survey.spikes.number for survey in used if survey.spikes]
    positive = [number for number in numbers if number > 0]
    return filled(
        templates.DESPIKE,
        {
            "maps_with_spikes": str(len(positive)),
            "maps": str(len(used)),
            "spikes": str(sum(positive)),
            "threshold": repr(threshold),
        },
    )


def _reason_for_level(used: Sequence[MapSurvey], level: str) -> str:
    """Say why maps are levelled: their largest slope, or the name of the first curved one."""
    if level == "plane":
        tilt = max(abs(slope) for survey in used for slope in survey.tilt)
        return f"the maps are tilted by up to {tilt:.2g}"
    first = next(survey for survey in used if survey.is_curved)
    name = printable(first.path.name)
    return f"{name} and the like are curved: form rather than roughness"


def _reading(reading: Reading) -> str:
    """Return the table of what files do not say; nothing if they say all."""
    keys = [
        f"{name} = {quoted(value)}"
        for name, value in reading.values_of("reading").items()
        if value
    ]
    return _if_any(templates.READING, "keys", "\n".join(keys))


def _preparation_options(reading: Reading) -> str:
    """Return the steps of a map's preparation as options of `gen contact`."""
    options = []
    if reading.despike is not None:
        options.append(f"--despike {reading.despike:g}")
    options.append(f"--level {reading.level}")
    if reading.fill:
        options.append("--fill")
    return " ".join(options)


def _law(likeness: Likeness) -> dict[str, str]:
    """Return the fit of a law and, around it, the ranges of a population's parameters."""
    fit = likeness.fit
    spectrum = likeness.spectrum
    lowest_hurst = max(0.0, spectrum.hurst - EXPONENTS)
    highest_hurst = min(1.0, spectrum.hurst + EXPONENTS)
    shortest_roll_off = max(spectrum.roll_off / SPREAD, spectrum.cut_off)
    longest_roll_off = spectrum.roll_off * SPREAD
    stretch = ""
    if spectrum.stretch != 1.0:
        stretch = filled(templates.STRETCH, {"stretch": repr(spectrum.stretch)})
    return {
        "fitted_hurst": f"{fit.spectrum.hurst:.2f}",
        "fitted_roll_off": f"{fit.spectrum.roll_off:.3g}",
        "fitted_cut_off": f"{fit.spectrum.cut_off:.3g}",
        "decades": f"{fit.decades:.2g}",
        "scatter": f"{fit.scatter:.2g}",
        "remarks": _if_any(templates.REMARKS, "remarks", "; ".join(fit.remarks)),
        "hurst": _range(rounded(lowest_hurst, 3), rounded(highest_hurst, 3)),
        "roll_off": _range(rounded(shortest_roll_off, 4), rounded(longest_roll_off, 4)),
        "cut_off": repr(spectrum.cut_off),
        "stretch": stretch,
    }


@dataclass(frozen=True)
class _Loads:
    """A range of loads, and what they mean."""

    quantity: str  # as the key of the scene has it
    smallest: float  # in the unit of the quantity
    largest: float
    meaning: str  # comment


def _load(bodies: Bodies, slopes: Sequence[float], nodes: int) -> str:
    """Return the table of loads on bodies, from first contacts to a large part of the surface.

    `slopes` are the rms slopes of surfaces [1], `nodes` the number of all nodes of a surface.
    """
    smallest_area = min(FEWEST_NODES / nodes, LARGEST_AREA / 10)
    if bodies.hardness is None:
        loads = _elastic_loads(smallest_area)
    else:
        middling = bodies.e_star * statistics.median(slopes) / KAPPA
        loads = _yielding_loads(smallest_area, middling, bodies.hardness)
    return filled(
        templates.LOAD,
        {
            "meaning": loads.meaning,
            "quantity": quoted(loads.quantity),
            "fewest_nodes": str(FEWEST_NODES),
            "range": _range(loads.smallest, loads.largest),
        },
    )


def _elastic_loads(smallest_area: float) -> _Loads:
    """Return loads over E* rms slope; the smallest brings this share of a patch into contact.

    The contact area of elastic bodies under a mean pressure p is about KAPPA p / (E* rms slope).
    """
    smallest = rounded(smallest_area / KAPPA)
    numbers = {"kappa": f"{KAPPA:g}", "smallest": f"{100 * KAPPA * smallest:.2g}"}
    return _Loads(
        quantity="pressure/(E* slope_rms)",
        smallest=smallest,
        largest=rounded(LARGEST_AREA / KAPPA),
        meaning=filled(templates.ELASTIC, numbers),
    )


def _yielding_loads(smallest_area: float, elastic: float, hardness: float) -> _Loads:
    """Return loads [MPa]; the smallest brings this share of a patch into contact.

    The contact area under a mean pressure p is about p / `elastic`, where `elastic` is E* rms slope
    / KAPPA [MPa], and at least p / `hardness`. It has two scales, so loads are pressures.
    """
    bearing = min(hardness, elastic)
    smallest = rounded(smallest_area * bearing)
    largest = rounded(min(LARGEST_AREA * bearing, YIELDING * hardness))
    numbers = {
        "smallest": f"{100 * smallest / bearing:.2g}",
        "largest": f"{100 * largest / bearing:.2g}",
        "hardness": f"{hardness:g}",
    }
    return _Loads("pressure", smallest, largest, filled(templates.YIELDING, numbers))


def _contact(bodies: Bodies) -> str:
    """Return the keys of the contact: the only elastic body, or one with the E* of both."""
    modulus, poisson = bodies.only or (bodies.e_star, 0.0)
    no_modulus = ""
    if not bodies.has_modulus:
        no_modulus = "# None was given: areas of elastic bodies hold for any."
    hardness = "# Metals yield: hardness = 2000.0 (MPa, steel) with loads as pressures."
    if bodies.hardness is not None:
        hardness = f"# MPa, of the softer body.\nhardness = {float(bodies.hardness)!r}"
    return filled(
        templates.CONTACT,
        {
            "no_modulus": no_modulus,
            "modulus": repr(float(modulus)),
            "poisson": repr(float(poisson)),
            "hardness": hardness,
        },
    )


def quoted(text: str) -> str:
    """Write a text in TOML's notation.

    Parameters
    ----------
    text : str
        Any text, also with quotation marks and control characters.

    Returns
    -------
    str
        The text in quotation marks, with escapes.

    Raises
    ------
    InputError
        If the text holds bytes that are no UTF-8, as names of files may.
    """
    try:
        text.encode()
    except UnicodeEncodeError:
        raise InputError(
            f"{text!r}: a scene is UTF-8, in which this name cannot be written; rename the file"
        ) from None
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


def _range(low: float, high: float) -> str:
    """Write a range in TOML's notation."""
    return f"[{float(low)!r}, {float(high)!r}]"


def require_new(path: Path) -> None:
    """Refuse a name that a scene cannot have, or that is taken.

    Parameters
    ----------
    path : Path
        The file to be written.

    Raises
    ------
    InputError
        If the name does not end in .toml, or there is a file of this name.
    """
    if path.suffix != ".toml":
        raise InputError(f"--output {path}: give a name that ends in .toml, as mine.toml")
    if path.exists():
        raise InputError(
            f"--output {path}: is there already, and may hold changes of yours: give another name,"
            " or move it away"
        )


def write(path: Path, text: str) -> Scene:
    """Write a scene to a file, but never over another one.

    Parameters
    ----------
    path : Path
        The file to be written.
    text : str
        The scene in TOML.

    Returns
    -------
    Scene
        The scene as `gen run` reads it.

    Raises
    ------
    InputError
        If the text is no scene, the file cannot be written, or another process has made it
        meanwhile.
    """
    scene = Scene.parse(text, str(path))
    content = text.encode()
    with atomic(path, replace=False) as file:
        file.write(content)
    if path.read_bytes() != content:
        require_new(path)
    return scene
