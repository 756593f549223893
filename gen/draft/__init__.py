"""Draft a scene for measured maps: survey them, choose, print, write keys and why they are so.

`gen.draft.survey` looks at maps, `gen.draft.proposal` chooses windows or a law, and loads.
"""

from __future__ import annotations

import json
import math
import textwrap
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

from gen.draft.proposal import (
    AROUND,
    EXPONENTS,
    FEWEST_NODES,
    KAPPA,
    LOADS_PER_SURFACE,
    NODES,
    SURFACES,
    WIDE,
    Likeness,
    Loads,
    Material,
    Proposal,
    known_texture,
    propose,
    propose_like,
    rounded,
)
from gen.draft.survey import FORM, MapSurvey, print_looks, remarks
from gen.generators.scans import MOST_PATTERNS
from gen.maps.library import map_files
from gen.maps.read import in_words
from gen.maps.settings import Reading, said
from gen.runtime.errors import InputError
from gen.runtime.files import Output, atomic, check_outputs
from gen.runtime.terminal import RunProgress, echo, to_type
from gen.scene import Scene
from gen.scene.faults import one_line

FEW_TILES = 10
"""Tiles from which the part that tests a surrogate, a fifth, holds two or more."""

WIDTH = 96
"""Largest length of a line of comments."""

SUFFIX = ".toml"
"""Suffix of scenes, by which folders of maps know that they are none."""


def draft(
    inputs: list[str],
    like: Path | None,
    output: Path,
    reading: Reading,
    material: Material,
    command: str,
) -> None:
    """Look at maps, or at one that surfaces are to be like, print what is found, write the scene.

    The command line is for the record. Raises InputError if there is not exactly one of the inputs
    and `like`, no map can be used, or the scene cannot be written.
    """
    if bool(inputs) == (like is not None):
        raise InputError(
            "give measured maps (files, folders or patterns) for a scene of their windows, or"
            " --like MAP for surfaces like one of them"
        )
    require_new(output)
    check_outputs([Output(output, "--output")])
    doubts: list[str] = []
    if like is not None:
        found = propose_like(like, reading, material)
        print_looks([found.look])
        scene = write(output, keys_like(found, command, output))
        made = f"self-affine surfaces like {like.name}"
        doubts += [f"{found.doubt}: windows of the map are safer"] if found.doubt else []
    else:
        paths = map_files(inputs, Path.cwd())
        with RunProgress(2 * len(paths), noun="readings") as progress:
            proposed = propose(paths, reading, material, lambda: progress.advance(1, 0))
        print_looks(proposed.looks)
        scene = write(output, keys(proposed, inputs, command, output))
        made = (
            f"{proposed.windows} windows of {proposed.nodes} x {proposed.nodes} nodes of"
            f" {len(proposed.used)} of {len(paths)} maps, {scene.samples} samples"
        )
    for doubt in (*scene.contact.doubts, *doubts):
        echo(f"warning: {doubt}", err=True)
    echo(f"wrote {output}: {made}")


class Key(NamedTuple):
    """A key of a scene, or a comment alone."""

    comment: str  # why the key has its value
    name: str = ""  # name of the key, [name] of a table, or "" of a comment alone
    value: str = ""  # value in TOML's notation; tables have none


def keys(proposal: Proposal, inputs: list[str], command: str, output: Path) -> Iterator[Key]:
    """Yield the keys of a scene of windows with their comments.

    The inputs are named as the user did, for scenes of more maps than a list may hold.
    """
    used, left = len(proposal.used), len(proposal.looks) - len(proposal.used)
    title = f"Windows of {used} measured map{'s' * (used != 1)}"
    others = f"; {left} file{'s' * (left != 1)} left out" if left else ""
    yield from _head(
        title,
        f"{title}{others}. Written by\n    {command}\nEvery value is a proposal: change what"
        " you know better.",
        output,
        f"\n    {to_type('learn fit')} {output.with_suffix('.h5')} --features hybrid"
        f" -o {output.with_suffix('.surrogate')}",
        proposal.windows,
    )
    yield Key("", "[surface]")
    yield Key("", "generator", quoted("scans"))
    yield from _files(proposal, inputs, output.absolute().parent)
    yield from _windows(proposal)
    yield from _preparation(proposal)
    if given := {name: value for name, value in proposal.reading.of("reading").items() if value}:
        yield Key("As given to the command, for files that do not say it.", "[surface.reading]")
        yield from (Key("", name, quoted(value)) for name, value in given.items())
    yield from _load_keys(proposal.loads, proposal.material)
    yield from _contact_keys(
        proposal.material,
        "A window is a piece of a larger surface: its mirror images surround it, so that it has no"
        ' edges that carry too much. "free" is for bodies that end where the map does.',
    )


def _head(title: str, about: str, output: Path, then: str, surfaces: int) -> Iterator[Key]:
    """Yield the comment above a scene, with the commands that use it, and its numbers."""
    yield Key(
        f"{about} Then\n    {to_type('gen estimate')} {output}\n"
        f"    {to_type('gen run')} {output} -o {output.with_suffix('.h5')}{then}"
    )
    yield Key("", "title", quoted(title))
    yield Key(
        f"{surfaces} surfaces, each under {LOADS_PER_SURFACE} loads, which share its statistics:"
        " more surfaces teach a surrogate more than more loads do. A database can grow: raise"
        " samples, and run again.",
        "samples",
        str(surfaces * LOADS_PER_SURFACE),
    )
    yield Key("", "samples_per_surface", str(LOADS_PER_SURFACE))
    yield Key("Another seed draws other surfaces and loads.", "seed", "2025")


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
    side, length = nodes * proposal.step, proposal.length
    words = (
        f"Windows of {nodes} x {nodes} nodes, {side:.4g} um wide. The maps are cut into"
        f" {tiling.total} tile{'s' * (tiling.total != 1)}; a window lies in one of them, and"
        " training and tests of surrogates share no tile."
    )
    if tiling.total < FEW_TILES:
        words += f" That is few: scores of a surrogate on {tiling.total} tiles mean little."
    if not math.isnan(length):
        words += (
            f" The autocorrelation length (Sal) of a middling map is {length:.3g} um: below"
            f" {WIDE:g} of them in a window its statistics scatter."
        )
    yield Key(words, "nodes", str(nodes))
    if proposal.spacing is None:
        spacing = in_words(proposal.used[0].spacing)
        yield Key(f"All maps have a node every {spacing} um, and keep it.")
        return
    spacings = [step for look in proposal.used for step in look.spacing]
    yield Key(
        f"um. The maps have a node every {min(spacings):.4g} to {max(spacings):.4g} um and are"
        " resampled to the coarsest of these: finer maps can lose detail, coarser ones cannot gain"
        " it. Slopes, and with them elastic areas, are those of this spacing.",
        "spacing",
        number(proposal.spacing),
    )


def _preparation(proposal: Proposal) -> Iterator[Key]:
    """Yield the table of the preparation."""
    used, steps = proposal.used, proposal.reading
    yield Key(
        "The options of `gen contact`; every map goes through all steps.", "[surface.preparation]"
    )
    if steps.despike is None:
        yield Key("No map has spikes, single nodes far above all others: no despike.")
    else:
        spikes = [look.spikes for look in used if look.spikes is not None and look.spikes.number]
        nearest, taken = min(each.nearest for each in spikes), sum(each.number for each in spikes)
        yield Key(
            f"{len(spikes)} of {len(used)} maps have spikes, {taken} nodes in all, {nearest:.3g} or"
            " more times the usual scatter away from their local median: the highest would set"
            " Delta's zero.",
            "despike",
            number(steps.despike),
        )
    tilt = max(max(map(abs, look.tilt)) for look in used)
    why = (
        f"The maps are tilted by up to {tilt:.2g}, as they lay under the instrument. A higher"
        ' degree ("quadratic", or form = N) would take long waves out of the roughness.'
    )
    if steps.level != "plane":
        curved = next(look.path.name for look in used if look.form > FORM)
        why = (
            f"A quadratic form holds over {100 * FORM:g} % of the variance about the mean plane of"
            f" {curved}: form rather than roughness. Others lose little by it."
        )
    yield Key(why, "level", quoted(steps.level))
    if steps.fill:
        holed = sum(look.missing > 0 for look in used)
        share = 100 * max(look.holes for look in used)
        yield Key(
            f"{holed} of {len(used)} maps have holes, up to {share:.2g} % of the nodes: filled"
            " between the heights of their rims.",
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


def keys_like(likeness: Likeness, command: str, output: Path) -> Iterator[Key]:
    """Yield the keys of a scene of self-affine surfaces like a map, with their comments."""
    name, steps = likeness.look.path.name, likeness.reading
    taken = [f"despike {steps.despike:g}"] if steps.despike is not None else []
    taken += [f"level {steps.level}"] + ["fill"] * steps.fill
    prepared = " ".join(said(each, "option") for each in taken)
    yield from _head(
        f"Self-affine surfaces like {name}",
        f"Self-affine surfaces around {name}, a start for a population of your own. Written by\n"
        f"    {command}\nThe map was prepared by {prepared}.",
        output,
        "",
        SURFACES,
    )
    fit, spectrum = likeness.fit, likeness.spectrum
    yield Key("", "[surface]")
    yield Key("", "generator", quoted("spectral"))
    yield Key(f"The map's spacing, {likeness.step:g} um.", "nodes", str(NODES))
    yield Key("um, nodes times spacing.", "side", number(rounded(NODES * likeness.step, 6)))
    found = f" The fit says: {'; '.join(fit.remarks)}." if fit.remarks else ""
    hurst = spectrum.hurst
    yield Key(
        f"The fit to the map's radial power spectrum: Hurst exponent {fit.spectrum.hurst:.2f},"
        f" roll-off {fit.spectrum.roll_off:.3g} um, cut-off {fit.spectrum.cut_off:.3g} um,"
        f" {fit.decades:.2g} decades; the spectrum is off the law by a factor of"
        f" {fit.scatter:.2g} (rms).{found} Ranges around it, by {EXPONENTS:g} and a factor of"
        f" {AROUND:g}, give a surrogate something to tell apart; single numbers give one spectrum.",
        "hurst",
        span(rounded(max(0.0, hurst - EXPONENTS), 3), rounded(min(1.0, hurst + EXPONENTS), 3)),
    )
    low = max(spectrum.roll_off / AROUND, spectrum.cut_off)
    yield Key(
        "um, the longest wavelength of the power law; longer waves have the same density.",
        "roll_off",
        span(rounded(low, 4), rounded(spectrum.roll_off * AROUND, 4)),
    )
    yield Key("um, the shortest wavelength of all.", "cut_off", number(spectrum.cut_off))
    height, slope = likeness.windows
    words = (
        f"With {likeness.slope:.3g}, generated surfaces have the map's rms slope between nodes,"
        f" {slope:.3g}, and an rms height of {likeness.height:.3g} um, where windows of the map"
        f" have {height:.3g} um (medians)."
    )
    if likeness.doubt:
        words += f" DOUBTFUL: {likeness.doubt}. Windows of the map are safer: `gen scene MAP`."
    slopes = rounded(likeness.slope / AROUND, 3), rounded(likeness.slope * AROUND, 3)
    yield Key(words, "rms_slope", span(*slopes))
    if spectrum.stretch != 1.0:
        yield Key(
            "The map has a lay: wavelengths along x over those along y, from its slopes along both"
            " axes. The wavelengths above are those along y.",
            "stretch",
            number(spectrum.stretch),
        )
    yield from _load_keys(likeness.loads, likeness.material)
    yield from _contact_keys(
        likeness.material,
        'As for windows of maps, which surrogates of this scene can then predict. "periodic" would'
        " make each surface its own period.",
    )


def _load_keys(loads: Loads, material: Material) -> Iterator[Key]:
    """Yield the table of the loads."""
    yield Key("", "[load]")
    small, large = loads.areas
    if loads.quantity == "pressure":
        why = (
            f"MPa, mean pressure over the patch. These loads bring about {small:.2g} to"
            f" {large:.2g} % of a middling surface into contact. The hardness,"
            f" {material.hardness or math.inf:g} MPa, is the pressure without equilibrium."
        )
    else:
        why = (
            "Mean pressure over E* times the surface's rms slope, from which the area of elastic"
            f" bodies follows: light loads bring about {KAPPA:g} times this share of a surface into"
            f" contact, so that rough and smooth ones have the same areas, from about {small:.2g} %"
            " on."
        )
    yield Key(why, "quantity", quoted(loads.quantity))
    yield Key(
        f"From some {FEWEST_NODES} nodes in contact, where areas begin to be more than a count of"
        " nodes, to a large part of the surface; log-uniform: small areas as often as large ones.",
        "range",
        f"{{ log_uniform = {span(loads.low, loads.high)} }}",
    )


def _contact_keys(material: Material, boundary: str) -> Iterator[Key]:
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
