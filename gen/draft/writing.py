"""Write scenes for maps: TOML with comments that give the reasons for the values.

Beside this module are templates of the three kinds of scenes: `windows.toml.in` for windows of
maps, `like.toml.in` for surfaces of a self-affine law, and `population.toml.in` for surfaces of a
population. Two tables that all kinds have are in `load.toml.in` and `contact.toml.in`. A
placeholder of a template is a name after a dollar sign; `filled` puts texts in place of the
placeholders.
"""

from __future__ import annotations

import json
import re
import statistics
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from string import Template

from gen.draft.likeness import NODES, Likeness, rounded
from gen.draft.populations import LikeMaps
from gen.draft.press import KAPPA
from gen.draft.proposal import LOADS_PER_SURFACE, Proposal
from gen.draft.survey import MapSurvey, remarks
from gen.generators.scans import MOST_PATTERNS
from gen.maps.read import spacing_text
from gen.maps.settings import READ, Reading
from gen.material import Bodies
from gen.runtime.errors import InputError
from gen.runtime.files import atomic
from gen.runtime.terminal import command_to_type, printable
from gen.scene import Scene

SURFACES = 600  # number of surfaces in a scene like a map

# largest factor between a wavelength or the rms slope of the map and that of a surface
SPREAD = 1.25
# largest difference between the Hurst exponents of the map and of a surface
HURST_SPREAD = 0.05

# Fewest tiles without a warning. With fewer, the test part (a fifth of them) has less than two.
FEW_TILES = 10

# Nodes in contact under the smallest load. With fewer, the area is a count of single nodes.
FEWEST_NODES = 50
LARGEST_AREA = 0.4  # approximate share of the patch in contact under the largest load
# largest mean pressure, as a share of the hardness; there is no equilibrium from 1 upwards
LARGEST_PRESSURE = 0.5


def scene_of_windows(
    proposal: Proposal, bodies: Bodies, inputs: Sequence[str], command: str, output: Path
) -> str:
    """Return the text of a scene of windows of maps, with comments that give the reasons.

    Parameters
    ----------
    proposal : Proposal
        The surveys of the maps, and the windows and the preparation that were chosen for them.
    bodies : Bodies
        Material of the contact.
    inputs : sequence of str
        Names of maps as the user gave them: files, folders or patterns. They are listed only if
        there are too many maps to list each of them.
    command : str
        The command line, which a comment quotes.
    output : Path
        The file that will hold the scene. Names of maps in its folder are relative to the folder.

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
    warning_of_few_tiles = ""
    if proposal.tiles < FEW_TILES:
        warning_of_few_tiles = "# That is few: scores of a surrogate on them mean little."
    slopes = [survey.rms_slope for survey in used]
    texts = {
        **_beginning(title, output, command, surfaces=proposal.windows),
        "fit": _fit_command(output),
        "files": _list_of_files(proposal, inputs, output.absolute().parent),
        "width": f"{proposal.width:.4g}",
        "tiles": _counted(proposal.tiles, "tile"),
        "few_tiles": warning_of_few_tiles,
        "nodes": str(proposal.nodes),
        "spacing": _spacing(proposal),
        **_preparation(proposal),
        "reading": _reading_table(proposal.reading),
        "load": _load_table(bodies, slopes, nodes=proposal.nodes**2),
        "contact": _contact_keys(bodies),
    }
    return filled(_template("windows"), texts)


def scene_like(likeness: Likeness, bodies: Bodies, command: str, output: Path) -> str:
    """Return the text of a scene of self-affine surfaces like a map, with comments.

    Parameters
    ----------
    likeness : Likeness
        The survey of the map, the law that fits it, and the roughness of surfaces that follow the
        law.
    bodies : Bodies
        Material of the contact.
    command : str
        The command line, which a comment quotes.
    output : Path
        The file that will hold the scene.

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
    slope = likeness.rms_slope
    doubt = ""
    if likeness.doubt:
        doubt = f"# DOUBTFUL: {likeness.doubt}. Windows of the map are safer: `gen scene MAP`."
    texts = {
        "name": printable(name),
        **_beginning(title, output, command, surfaces=SURFACES),
        "preparation": likeness.reading.options_of_steps,
        "step": f"{likeness.spacing:g}",
        "nodes": str(NODES),
        "side": repr(rounded(NODES * likeness.spacing, 6)),
        **_law(likeness),
        "slope": f"{slope:.3g}",
        "map_slope": f"{likeness.windows.rms_slope:.3g}",
        "height": f"{likeness.rms_height:.3g}",
        "map_height": f"{likeness.windows.rms_height:.3g}",
        "doubt": doubt,
        "rms_slope": _range(rounded(slope / SPREAD, 3), rounded(slope * SPREAD, 3)),
        "load": _load_table(bodies, [likeness.survey.rms_slope], nodes=NODES**2),
        "contact": _contact_keys(bodies),
    }
    return filled(_template("like"), texts)


def scene_of_population(
    like: LikeMaps, bodies: Bodies, command: str, output: Path, population: Path
) -> str:
    """Return the text of a scene of surfaces of a population, with comments.

    Parameters
    ----------
    like : LikeMaps
        The population, and the maps to which it was fitted.
    bodies : Bodies
        Material of the contact.
    command : str
        The command line, which a comment quotes.
    output : Path
        The file that will hold the scene.
    population : Path
        The file of the population, in the same folder.

    Returns
    -------
    str
        The scene in TOML.

    Raises
    ------
    InputError
        If TOML cannot hold the name of a map.
    """
    names = [survey.path.name for survey in like.surveys]
    title = f"Surfaces like {names[0]}"
    if len(names) > 1:
        title = f"Surfaces like {len(names)} maps"
    fitted = like.population
    slopes = [survey.rms_slope for survey in like.surveys]
    remarks = [f"# NOTE: {remark}." for remark in fitted.remarks]
    if fitted.parts is not None:
        remarks.append(
            f"# Each surface is like one of {len(fitted.parts.members)} parts of the maps, which"
            " differ from place to\n# place. With other nodes, surfaces have the mean spectrum"
            " and heights."
        )
    map_nx, map_ny = fitted.nodes
    if like.nodes < max(map_nx, map_ny):
        remarks.append(
            "# Patches smaller than the maps are for surrogates. The law and the scatter of a joint"
            " as large as\n# the maps are those of gen law with nodes ="
            f" [{max(like.nodes, map_nx)}, {max(like.nodes, map_ny)}]."
        )
    texts = {
        "names": printable(", ".join(names)),
        **_beginning(title, output, command, surfaces=SURFACES),
        "fit": _fit_command(output),
        "preparation_of_maps": _steps_of_preparation(like),
        "population": quoted(population.name),
        "step": spacing_text(fitted.spacing, 4),
        "shortest": f"{fitted.shortest:.4g}",
        "longest": " x ".join(f"{length:.4g}" for length in fitted.longest),
        "remarks": "\n".join(remarks),
        "nodes": str(like.nodes),
        "scale": _scale(like),
        "load": _load_table(bodies, slopes, nodes=like.nodes**2),
        "contact": _contact_keys(bodies),
    }
    return filled(_template("population"), texts)


def _steps_of_preparation(like: LikeMaps) -> str:
    """Return a sentence on how the maps were prepared."""
    noun = "The map was" if len(like.surveys) == 1 else "The maps were"
    return f"{noun} prepared by {like.reading.options_of_steps}."


def _scale(like: LikeMaps) -> str:
    """Return the key `scale`, with a comment on the rms heights of the maps."""
    if like.joined is not None:
        return "# Heights over those of the joined spectrum.\nscale = 1.0"
    if len(like.surveys) == 1:
        return (
            "# Heights over those of the map. One map does not tell how they scatter: give a range"
            " if\n# you know it, as [0.9, 1.1].\nscale = 1.0"
        )
    smallest, largest = like.scales
    low = rounded(smallest, 3)
    high = rounded(largest, 3)
    return (
        "# Heights over those of the median map, as far as they scatter among the maps.\n"
        f"scale = {_range(low, high)}"
    )


def _template(name: str) -> str:
    """Return the text of the template `name`.toml.in, a file beside this module."""
    return (files("gen.draft") / f"{name}.toml.in").read_text(encoding="utf-8")


def filled(template: str, texts: Mapping[str, str]) -> str:
    """Put texts in place of the placeholders of a template.

    A line is left out if it consists of a placeholder alone and the text for it is empty. Several
    empty lines in a row become one.

    Parameters
    ----------
    template : str
        Lines with placeholders, as "nodes = $nodes".
    texts : mapping of str to str
        A text of any number of lines for each placeholder, by its name without the dollar sign.

    Returns
    -------
    str
        The filled template.
    """
    lines = []
    for line in template.splitlines(keepends=True):
        # the text for a line that is only a placeholder; None for any other line
        text_of_line = texts.get(line.strip().removeprefix("$"))
        if line.startswith("$") and text_of_line == "":
            continue
        lines.append(Template(line).substitute(texts))
    return re.sub(r"\n{3,}", "\n\n", "".join(lines))


def _counted(number: int, noun: str) -> str:
    """Return a number with its noun, as "1 tile" and "3 tiles"."""
    if number == 1:
        return f"1 {noun}"
    return f"{number} {noun}s"


def _beginning(title: str, output: Path, command: str, surfaces: int) -> dict[str, str]:
    """Return texts for the beginning of all kinds of scenes, by placeholder.

    They are the title, commands for the user to type, and the numbers of surfaces and samples.
    """
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
    """Return the command that fits a surrogate to the database of the scene `output`."""
    fit = command_to_type("learn fit")
    database = _beside(output, ".h5")
    surrogate = _beside(output, ".surrogate")
    return f"{fit} {database} --features hybrid -o {surrogate}"


def _beside(output: Path, suffix: str) -> str:
    """Return the scene's path with another suffix, in printable letters."""
    return printable(str(output.with_suffix(suffix)))


def _list_of_files(proposal: Proposal, inputs: Sequence[str], folder: Path) -> str:
    """Return the lines of the list `files`: one for each map, a comment if the map is left out.

    The list may hold at most `MOST_PATTERNS` names. If more maps are used, the lines are the names
    that the user gave, `inputs`. `folder` is the folder of the scene.
    """
    if len(proposal.used) > MOST_PATTERNS:
        paths = [Path(name).expanduser().absolute() for name in inputs]
        return "\n".join(f"    {quoted(str(path))}," for path in paths)
    folder = folder.resolve()
    return "\n".join(_line_of_file(survey, folder) for survey in proposal.surveys)


def _line_of_file(survey: MapSurvey, folder: Path) -> str:
    """Return the line of one map; its name is relative to `folder` if the map is in this folder."""
    name = str(survey.path)
    if survey.path.is_relative_to(folder):
        name = str(survey.path.relative_to(folder))
        # Without "./" a scene takes a leading ~ for a home folder.
        if name.startswith("~"):
            name = f"./{name}"
    if survey.fault:
        return f"    # {quoted(name)} is left out: {printable(survey.fault)}"
    comment = "; ".join([f"rms slope {survey.rms_slope:.3g}", *remarks(survey)])
    return f"    {quoted(name)},  # {comment}"


def _spacing(proposal: Proposal) -> str:
    """Return the key `spacing`, or only a comment if the maps keep the spacing that they share."""
    used = proposal.used
    if proposal.spacing is None:
        shared = spacing_text(used[0].spacing)
        return f"# All maps have a node every {shared} um, and keep it."
    spacings = [spacing for survey in used for spacing in survey.spacing]
    finest = f"{min(spacings):.4g}"
    coarsest = f"{max(spacings):.4g}"
    return (
        f"# um; the maps have a node every {finest} to {coarsest} um. Finer maps can lose\n"
        "# detail, coarser ones cannot gain it.\n"
        f"spacing = {float(proposal.spacing)!r}"
    )


def _preparation(proposal: Proposal) -> dict[str, str]:
    """Return texts for the keys of the preparation and the reasons for them, by placeholder."""
    used = proposal.used
    reading = proposal.reading
    despike = "# No map has spikes: no despike."
    if reading.despike is not None:
        despike = _despike(used, reading.despike)
    fill = "# No map has holes: no fill."
    if reading.fill:
        maps_with_holes = [survey for survey in used if survey.missing > 0]
        fill = f"# {len(maps_with_holes)} of {len(used)} maps have holes.\nfill = true"
    return {
        "despike": despike,
        "reason_for_level": _reason_for_level(used, reading.level),
        "level": quoted(reading.level),
        "fill": fill,
    }


def _despike(used: Sequence[MapSurvey], threshold: float) -> str:
    """Return the key `despike` with its threshold, and a comment with the numbers of spikes."""
    numbers = [survey.spikes.number for survey in used if survey.spikes]
    maps_with_spikes = sum(number > 0 for number in numbers)
    if maps_with_spikes == 0:
        return f"# As --despike says.\ndespike = {threshold!r}"
    return (
        f"# {maps_with_spikes} of {len(used)} maps have spikes, {sum(numbers)} nodes in all:"
        " the highest would set\n"
        "# Delta's zero.\n"
        f"despike = {threshold!r}"
    )


def _reason_for_level(used: Sequence[MapSurvey], level: str) -> str:
    """Say why maps are levelled by `level`, in words that continue a sentence after "As".

    For "plane" the reason is the largest tilt, for "quadratic" that maps are curved. The user may
    have given either of them, or another level, for maps without this reason.
    """
    if level == "plane":
        tilt = max(abs(slope) for survey in used for slope in survey.tilt)
        return f"the maps are tilted by up to {tilt:.2g}"
    first_curved = next((survey for survey in used if survey.is_curved), None)
    if level != "quadratic" or first_curved is None:
        return "--level says"
    name = printable(first_curved.path.name)
    return f"{name} and the like are curved: form rather than roughness"


def _reading_table(reading: Reading) -> str:
    """Return the table `[surface.reading]`; "" if the user has given none of its keys."""
    keys = [
        f"{name} = {quoted(value)}"
        for name, value in reading.values_of(READ).items()
        if value
    ]
    if not keys:
        return ""
    return "\n".join(["# For files that do not say it.", "[surface.reading]", *keys])


def _law(likeness: Likeness) -> dict[str, str]:
    """Return texts for the fit and for the parameters of the surfaces, by placeholder.

    The parameters are ranges around the law with which surfaces are generated.
    """
    fit = likeness.fit
    fitted = fit.spectrum
    generated = likeness.spectrum
    lowest_hurst = max(0.0, generated.hurst - HURST_SPREAD)
    highest_hurst = min(1.0, generated.hurst + HURST_SPREAD)
    shortest_roll_off = max(generated.roll_off / SPREAD, generated.cut_off)
    longest_roll_off = generated.roll_off * SPREAD
    remarks_on_fit = ""
    if fit.remarks:
        remarks_on_fit = f"# The fit says: {'; '.join(fit.remarks)}."
    return {
        "fitted_hurst": f"{fitted.hurst:.2f}",
        "fitted_roll_off": f"{fitted.roll_off:.3g}",
        "fitted_cut_off": f"{fitted.cut_off:.3g}",
        "decades": f"{fit.decades:.2g}",
        "scatter": f"{fit.scatter:.2g}",
        "remarks": remarks_on_fit,
        "hurst": _range(rounded(lowest_hurst, 3), rounded(highest_hurst, 3)),
        "roll_off": _range(rounded(shortest_roll_off, 4), rounded(longest_roll_off, 4)),
        "cut_off": repr(generated.cut_off),
        "stretch": _stretch(generated.stretch),
    }


def _stretch(stretch: float) -> str:
    """Return the key `stretch` with a comment; "" for a stretch of 1, which is the default."""
    if stretch == 1.0:
        return ""
    return (
        "# The map has a lay: wavelengths along x over those along y, which are the ones above.\n"
        f"stretch = {stretch!r}"
    )


@dataclass(frozen=True)
class _Loads:
    """A range of loads, and the comment about it."""

    quantity: str  # value of the scene's key `quantity`
    smallest: float  # in the unit of the quantity
    largest: float  # in the unit of the quantity
    meaning: str  # lines of a comment that say what the loads do


def _load_table(bodies: Bodies, slopes: Sequence[float], nodes: int) -> str:
    """Return the table `[load]`, with loads from first contacts to a large contact area.

    Loads of elastic bodies are relative to E* rms slope; loads of bodies that yield are pressures.
    `slopes` are the rms slopes of the maps [1], `nodes` is the number of all nodes of a surface.
    """
    # The second limit keeps the range wide on small grids, where `FEWEST_NODES` are a large share.
    smallest_area = min(FEWEST_NODES / nodes, LARGEST_AREA / 10)
    if bodies.hardness is None:
        loads = _elastic_loads(smallest_area)
    else:
        elastic_scale = bodies.e_star * statistics.median(slopes) / KAPPA
        loads = _yielding_loads(smallest_area, elastic_scale, bodies.hardness)
    texts = {
        "meaning": loads.meaning,
        "quantity": quoted(loads.quantity),
        "fewest_nodes": str(FEWEST_NODES),
        "range": _range(loads.smallest, loads.largest),
    }
    return filled(_template("load"), texts).removesuffix("\n")


def _elastic_loads(smallest_area: float) -> _Loads:
    """Return loads of elastic bodies: mean pressures over E* rms slope [1].

    `smallest_area` is the share of the patch in contact under the smallest load.
    """
    smallest = rounded(smallest_area / KAPPA)
    smallest_percent = 100 * KAPPA * smallest
    return _Loads(
        quantity="pressure/(E* slope_rms)",
        smallest=smallest,
        largest=rounded(LARGEST_AREA / KAPPA),
        meaning=(
            "# Mean pressure over E* times the surface's rms slope: light loads bring about"
            f" {KAPPA:g} times this\n"
            "# share of a surface into contact, rough or smooth, from about"
            f" {smallest_percent:.2g} % on."
        ),
    )


def _yielding_loads(
    smallest_area: float, elastic_scale: float, hardness: float
) -> _Loads:
    """Return loads of bodies that yield: mean pressures [MPa].

    A mean pressure p brings at least the share p / `hardness` of the patch into contact, and about
    p / `elastic_scale` while few nodes yield; both scales are in MPa. The larger of the two shares
    is taken. `smallest_area` is the share under the smallest load.
    """
    scale = min(hardness, elastic_scale)
    smallest = rounded(smallest_area * scale)
    largest = rounded(min(LARGEST_AREA * scale, LARGEST_PRESSURE * hardness))
    smallest_percent = 100 * smallest / scale
    largest_percent = 100 * largest / scale
    return _Loads(
        quantity="pressure",
        smallest=smallest,
        largest=largest,
        meaning=(
            "# MPa, mean pressure over the patch.\n"
            f"# These loads bring about {smallest_percent:.2g} to {largest_percent:.2g} % of a"
            " middling surface into contact.\n"
            f"# The hardness, {hardness:g} MPa, is the pressure without equilibrium."
        ),
    )


def _contact_keys(bodies: Bodies) -> str:
    """Return the keys of the table `[contact]`, with comments.

    They describe one elastic body on a rigid one: the body that the user gave, or a body with the
    given E* and a Poisson's ratio of 0.
    """
    modulus = bodies.e_star
    poisson = 0.0
    if bodies.only is not None:
        modulus = bodies.only.young
        poisson = bodies.only.poisson
    no_modulus = ""
    if not bodies.has_modulus:
        no_modulus = "# None was given: areas of elastic bodies hold for any."
    hardness = "# Metals yield: hardness = 2000.0 (MPa, steel) with loads as pressures."
    if bodies.hardness is not None:
        hardness = f"# MPa, of the softer body.\nhardness = {float(bodies.hardness)!r}"
    texts = {
        "no_modulus": no_modulus,
        "modulus": repr(float(modulus)),
        "poisson": repr(float(poisson)),
        "hardness": hardness,
    }
    return filled(_template("contact"), texts).removesuffix("\n")


def quoted(text: str) -> str:
    """Write a text as a string of TOML.

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
        If the text is the name of a file whose bytes are not UTF-8.
    """
    try:
        text.encode()
    except UnicodeEncodeError:
        raise InputError(
            f"{text!r}: a scene is UTF-8, in which this name cannot be written; rename the file"
        ) from None
    # JSON's strings are TOML's, but for one control character that TOML wants escaped.
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


def _range(low: float, high: float) -> str:
    """Write a range as an array of TOML."""
    return f"[{float(low)!r}, {float(high)!r}]"


def require_new(path: Path) -> None:
    """Refuse a path that does not end in .toml, or at which there is a file.

    Parameters
    ----------
    path : Path
        Path of the scene to be written.

    Raises
    ------
    InputError
        If the path is refused. The message names the option --output.
    """
    if path.suffix != ".toml":
        raise InputError(
            f"--output {path}: give a name that ends in .toml, such as mine.toml"
        )
    if path.exists():
        raise InputError(
            f"--output {path}: is there already, and may hold changes of yours: give another name,"
            " or move it away"
        )


def write(path: Path, text: str) -> Scene:
    """Write a scene to a new file, and never replace another file.

    Parameters
    ----------
    path : Path
        Path of the new file.
    text : str
        The scene in TOML.

    Returns
    -------
    Scene
        The scene as `gen run` reads it.

    Raises
    ------
    InputError
        If the text is no valid scene, the file cannot be written, or another process has made a
        file of this name meanwhile.
    """
    scene = Scene.parse(text, str(path))
    content = text.encode()
    with atomic(path, replace=False) as file:
        file.write(content)
    if path.read_bytes() != content:  # `atomic` has kept another process's file
        require_new(path)
    return scene
