"""Write the scene of windows of measured maps: keys, and why they have their values."""

from __future__ import annotations

import json
import math
import textwrap
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

from gen.draft.proposal import (
    FEWEST_NODES,
    KAPPA,
    LOADS_PER_WINDOW,
    OVERLAP,
    WIDE,
    WINDOWS,
    Loads,
    Material,
    Proposal,
    known_texture,
)
from gen.draft.survey import FORM, MapSurvey, remarks
from gen.generators.scans import MOST_PATTERNS
from gen.maps.read import in_words
from gen.runtime.errors import InputError
from gen.runtime.files import atomic
from gen.runtime.terminal import to_type
from gen.scene import Scene
from gen.scene.faults import one_line

FEW_TILES = 10
"""Tiles from which the part that tests a surrogate, a fifth, holds two or more."""


def keys(proposal: Proposal, inputs: list[str], command: str, output: Path) -> Iterator[Key]:
    """Yield the keys of a scene with their comments."""
    used, left = len(proposal.used), len(proposal.looks) - len(proposal.used)
    yield Key(
        f"Windows of {used} measured map{'s' * (used != 1)}"
        + (f"; {left} file{'s' * (left != 1)} left out" if left else "")
        + f". Written by\n    {command}\nEvery value is a proposal: change what you know better."
        f" Then\n    {to_type('gen estimate')} {output}\n"
        f"    {to_type('gen run')} {output} -o {output.with_suffix('.h5')}\n"
        f"    {to_type('learn fit')} {output.with_suffix('.h5')} --features hybrid"
        f" -o {output.with_suffix('.surrogate')}"
    )
    yield Key("", "title", quoted(f"Windows of {used} measured map{'s' * (used != 1)}"))
    yield from _sizes(proposal)
    yield Key("", "[surface]")
    yield Key("", "generator", quoted("scans"))
    yield from _files(proposal, inputs, output.absolute().parent)
    yield from _windows(proposal)
    yield from _preparation(proposal)
    if given := {name: value for name, value in proposal.reading.of("reading").items() if value}:
        yield Key("As given to the command, for files that do not say it.", "[surface.reading]")
        yield from (Key("", name, quoted(value)) for name, value in given.items())
    yield from load_keys(proposal.loads, proposal.material)
    yield from contact_keys(
        proposal.material,
        "A window is a piece of a larger surface: its mirror images surround it, so that it has no"
        ' edges that carry too much. "free" is for bodies that end where the map does.',
    )


def _sizes(proposal: Proposal) -> Iterator[Key]:
    """Yield the numbers of samples and the seed."""
    nodes = sum(math.prod(known_texture(look).shape) for look in proposal.used)
    beside = nodes / proposal.nodes**2
    limits = {WINDOWS[0]: "the least that is proposed", WINDOWS[1]: "the most that is proposed"}
    why = limits.get(proposal.windows, f"some {OVERLAP} times as many, as they may overlap")
    yield Key(
        f"{proposal.windows} windows, each under {LOADS_PER_WINDOW} loads. The maps hold"
        f" {beside:.0f} windows side by side: {why}. A database can grow: raise samples, and run"
        " again.",
        "samples",
        str(proposal.windows * LOADS_PER_WINDOW),
    )
    yield Key(
        "Loads on one window share its cut and its statistics; more windows teach"
        " a surrogate more than more loads do.",
        "samples_per_surface",
        str(LOADS_PER_WINDOW),
    )
    yield Key("Another seed draws other windows and loads.", "seed", "2025")


def _files(proposal: Proposal, inputs: list[str], home: Path) -> Iterator[Key]:
    """Yield the list of files, those that are left out as comments; `home` is the scene's."""
    used = proposal.used
    if len(used) > MOST_PATTERNS:
        yield Key(
            f"A list may hold {MOST_PATTERNS} names: these are the folders and patterns as given."
            " Move the files away that the command has left out.",
            "files",
            f"[{', '.join(quoted(str(Path(name).expanduser().absolute())) for name in inputs)}]",
        )
        return
    width = max(len(quoted(_name(look.path, home))) for look in used) + 1
    lines = ["["]
    for look in proposal.looks:
        name = quoted(_name(look.path, home))
        if look.fault:
            lines.append(f"    # {name} is left out: {one_line(look.fault)}")
        else:
            lines.append(f"    {name + ',':<{width}}  # {_words(look)}")
    yield Key(
        "All maps count alike: a window comes from each of them with the same probability. Names"
        " count from the folder of this file on.",
        "files",
        "\n".join([*lines, "]"]),
    )


def _words(look: MapSurvey) -> str:
    """Describe a map that is used."""
    texture = known_texture(look)
    nodes = f"{look.shape[0]} x {look.shape[1]} nodes"
    rough = f"rms height {texture.rms_height:.3g} um, rms slope {texture.rms_slope:.3g}"
    return "; ".join([f"{nodes}, {rough}", *remarks(look)])


def _name(path: Path, home: Path) -> str:
    """Return the name of a file from a folder on, its whole path if it is elsewhere."""
    start = home.resolve()
    if not path.is_relative_to(start):
        return str(path)
    name = str(path.relative_to(start))
    return f"./{name}" if name.startswith("~") else name  # "~" is somebody's home


def _windows(proposal: Proposal) -> Iterator[Key]:
    """Yield the nodes of a window and the spacing of the maps."""
    nodes, tiling = proposal.nodes, proposal.tiling
    side = nodes * proposal.step
    said = (
        f"Windows of {nodes} x {nodes} nodes, {side:.4g} um wide. The maps are cut into"
        f" {tiling.total} tile{'s' * (tiling.total != 1)}; a window lies in one of them, and"
        " training and tests of surrogates share no tile."
    )
    if tiling.total < FEW_TILES:
        said += f" That is few: scores of a surrogate on {tiling.total} tiles mean little."
    single = [
        look.path.name for index, look in enumerate(proposal.used) if tiling.number(index) == 1
    ]
    if single:
        said += f" Only one tile, for training or for tests: {_names(single)}."
    yield Key(said + _width(side, proposal.length), "nodes", str(nodes))
    if proposal.spacing is None:
        yield Key(
            f"All maps have a node every {in_words(proposal.used[0].spacing)} um, and keep it."
            " With the key spacing they would be resampled to another one."
        )
        return
    spacings = [step for look in proposal.used for step in look.spacing]
    yield Key(
        f"um. The maps have a node every {min(spacings):.4g} to {max(spacings):.4g} um and are"
        " resampled to the coarsest of these: finer maps can lose detail (means over the new"
        " cells), coarser ones cannot gain it. Slopes, and with them elastic areas, are those of"
        " this spacing.",
        "spacing",
        number(proposal.spacing),
    )


def _width(side: float, length: float) -> str:
    """Compare a window's side with the autocorrelation length [um]; "" if that is unknown."""
    if math.isnan(length):
        return ""
    width = side / length
    said = (
        f" The autocorrelation length (Sal) of a middling map is {length:.3g} um: a window is"
        f" {width:.3g} of them wide."
    )
    if width < WIDE:
        said += (
            f" That is less than {WIDE:g}: the statistics of windows scatter more than those of"
            " larger patches; more nodes, or a coarser spacing, would make them wider."
        )
    return said


def _preparation(proposal: Proposal) -> Iterator[Key]:
    """Yield the table of the preparation."""
    used, steps = proposal.used, proposal.reading
    yield Key(
        "The options of `gen contact`; every map goes through all steps.", "[surface.preparation]"
    )
    if steps.despike is None:
        yield Key("No map has spikes, single nodes far above all others: no despike.")
    else:
        yield from _despike(used, steps.despike)
    tilts = [max(map(abs, look.tilt)) for look in used]
    if steps.level == "plane":
        why = (
            f"The maps are tilted by up to {max(tilts):.2g}, as they lay under the instrument. Of"
            f" none a quadratic takes out {100 * FORM:g} % of the variance that the plane leaves: a"
            ' higher degree ("quadratic", or form = N) would take long waves out of the roughness.'
        )
    else:
        curved = [look.path.name for look in used if look.form > FORM]
        why = (
            f"A quadratic form holds over {100 * FORM:g} % of the variance about the mean plane of"
            f" {_names(curved)}: form rather than roughness. The others lose little by it."
        )
    yield Key(why, "level", quoted(steps.level))
    if steps.fill:
        holed = [look for look in used if look.missing]
        worst = max(holed, key=lambda look: look.holes)
        yield Key(
            f"{len(holed)} of {len(used)} maps have holes, {worst.path.name} the most"
            f" ({100 * worst.holes:.2g} % of its nodes): filled between the heights of their rims.",
            "fill",
            "true",
        )
    else:
        yield Key("No map has holes: no fill.")
    finest = 4 * max(max(look.spacing) for look in used)
    yield Key(
        "No filter: the shortest waves carry much of the slope, which decides elastic areas. Where"
        f' they are an instrument\'s noise, filter = "{finest:.4g}:" would take out those below'
        f" {finest:.4g} um, four nodes."
    )


def _despike(used: list[MapSurvey], threshold: float) -> Iterator[Key]:
    """Yield the threshold of spikes, and the number of nodes that it takes out."""
    spiky = [look for look in used if look.spikes is not None and look.spikes.number]
    surface = max(look.spikes.surface for look in used if look.spikes is not None)
    nearest = min(look.spikes.nearest for look in spiky if look.spikes is not None)
    taken = sum(look.spikes.number for look in spiky if look.spikes is not None)
    said = (
        f"{len(spiky)} of {len(used)} maps have spikes, {taken} nodes in all, {nearest:.3g} or more"
        " times the usual scatter away from their local median: the highest would set Delta's zero."
    )
    if surface < threshold:
        said += f" Other nodes, ridges and edges of grooves, are within {surface:.3g}."
    else:
        more = {
            look.path.name: int((look.spikes.distances > threshold).sum()) - look.spikes.number
            for look in used
            if look.spikes is not None
        }
        cut = [f"{name} ({count})" for name, count in more.items() if count > 0]
        said += (
            f" No threshold parts them from the ridges of all maps, up to {surface:.3g}: it takes"
            f" further nodes out of {_names(cut)}."
        )
    yield Key(said, "despike", number(threshold))


def load_keys(loads: Loads, material: Material) -> Iterator[Key]:
    """Yield the table of the loads."""
    low, middle, high = loads.slopes
    yield Key("", "[load]")
    small, large = loads.areas
    if loads.quantity == "pressure":
        elastic = material.e_star * middle / KAPPA
        hardness = material.hardness or math.inf
        why = "the hardness" if hardness < elastic else "E* times half of the rms slope"
        yield Key(
            f"MPa, mean pressure over the patch. A middling surface (rms slope {middle:.2g}) has"
            f" contact where its pressure is about {min(elastic, hardness):.4g} MPa, {why}, so that"
            f" these loads bring about {small:.2g} to {large:.2g} % of it into contact."
            f" The hardness, {hardness:g} MPa, is the pressure without equilibrium.",
            "quantity",
            quoted("pressure"),
        )
    else:
        yield Key(
            "Mean pressure over E* times the surface's rms slope, from which the area of elastic"
            f" bodies follows: light loads bring about {KAPPA:g} times this share of a surface into"
            f" contact, so that rough and smooth ones have the same areas, from about {small:.2g} %"
            f" on. Here rms slopes go from {low:.2g} to {high:.2g}"
            + (
                f" and E* is {material.e_star:.6g} MPa: {low * loads.low * material.e_star:.2g} to"
                f" {high * loads.high * material.e_star:.2g} MPa."
                if material.known
                else "; E* is 1 MPa, which the areas do not depend on."
            ),
            "quantity",
            quoted(loads.quantity),
        )
    yield Key(
        f"From some {FEWEST_NODES} nodes in contact, where areas begin to be more than a count of"
        " nodes, to a large part of the surface; log-uniform: small areas as often as large ones.",
        "range",
        f"{{ log_uniform = {span(loads.low, loads.high)} }}",
    )


def contact_keys(material: Material, boundary: str) -> Iterator[Key]:
    """Yield the table of the contact; `boundary` says why patches are mirrored."""
    yield Key("", "[contact]")
    yield Key(boundary, "boundary", quoted("mirror"))
    said = "MPa, Young's modulus of an elastic body on a rigid one; E* = modulus / (1 - poisson^2)."
    if not material.known:
        said += (
            " None was given: with 1 MPa the pressures and forces of an elastic contact are to be"
            " multiplied by your E*, and its areas hold for any."
        )
    yield Key(said, "modulus", number(material.young))
    yield Key("", "poisson", number(material.poisson))
    if material.hardness is None:
        yield Key(
            "Without a hardness bodies are elastic at any pressure. Metals yield: hardness = 2000.0"
            " (MPa, steel) with loads as pressures, see the option --hardness of `gen scene`."
        )
    else:
        yield Key(
            "MPa, of the softer body, which yields there; [low, high] would draw one for each"
            " sample.",
            "hardness",
            number(material.hardness),
        )


def _names(names: list[str], most: int = 3) -> str:
    """List the first names, then say how many more there are."""
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return ", ".join(names[:most]) + more


WIDTH = 96
"""Largest length of a line of comments."""


class Key(NamedTuple):
    """A key of a scene, or a comment alone."""

    comment: str  # why the key has its value
    name: str = ""  # name of the key, [name] of a table, or "" of a comment alone
    value: str = ""  # value in TOML's notation; tables have none


def document(keys: Iterable[Key]) -> str:
    """Write keys with their comments, an empty line before each comment and each table."""
    lines: list[str] = []
    for key in keys:
        comments = [
            f"# {line}".rstrip()
            for paragraph in key.comment.splitlines()
            for line in _wrapped(one_line(paragraph))
        ]
        opens = key.name.startswith("[")
        if lines and (opens or (comments and not lines[-1].startswith("["))):
            lines.append("")
        lines += comments
        if key.name:
            lines.append(key.name if opens else f"{key.name} = {key.value}")
    return "\n".join(lines) + "\n"


def _wrapped(paragraph: str) -> list[str]:
    """Wrap a paragraph, but not a command, which is indented."""
    if paragraph.startswith("    "):
        return [paragraph]
    return textwrap.wrap(paragraph, WIDTH, break_long_words=False)


def quoted(text: str) -> str:
    """Write a text in TOML's notation.

    Raises InputError if the text holds bytes that are no UTF-8, as some names of files do.
    """
    try:
        text.encode()
    except UnicodeEncodeError:
        raise InputError(
            f"{text!r}: a scene is UTF-8, in which this name cannot be written; rename the file"
        ) from None
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


def number(value: float) -> str:
    """Write a number in TOML's notation, with all its digits."""
    return repr(float(value))


def span(low: float, high: float) -> str:
    """Write a range in TOML's notation."""
    return f"[{number(low)}, {number(high)}]"


SUFFIX = ".toml"
"""Suffix of scenes, by which folders of maps know that they are none."""


def require_new(path: Path) -> None:
    """Refuse a name that a scene cannot have, or that is taken.

    Raises InputError if the name has another suffix, or there is such a file.
    """
    if path.suffix != SUFFIX:
        example = path.name.partition(".")[0] or "mine"
        raise InputError(
            f"--output {path}: give a name that ends in {SUFFIX}, as {example}{SUFFIX}"
        )
    if path.exists():
        raise InputError(
            f"--output {path}: is there already, and may hold changes of yours: give another name,"
            " or move it away"
        )


def write(path: Path, keys: Iterable[Key]) -> Scene:
    """Write a scene, never over another file, and return it as `gen run` reads it.

    Raises InputError if the file cannot be written, or another process has made it meanwhile.
    """
    text = document(keys)
    scene = Scene.parse(text, str(path))
    require_new(path)
    with atomic(path, replace=False) as file:
        file.write(text.encode())
    if path.read_bytes() != text.encode():
        require_new(path)
    return scene
