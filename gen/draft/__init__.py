"""Draft a scene for measured maps: survey them, choose, print, write it.

`gen.draft.proposal` looks at maps, and chooses windows or a law.
"""

from __future__ import annotations

import json
import re
import statistics
from collections.abc import Sequence
from pathlib import Path

from gen.draft.proposal import (
    AROUND,
    EXPONENTS,
    FORM,
    LOADS_PER_SURFACE,
    NODES,
    SURFACES,
    Likeness,
    Proposal,
    print_looks,
    propose,
    propose_like,
    remarks,
    rounded,
)
from gen.generators.scans import MOST_PATTERNS
from gen.maps.library import map_files
from gen.maps.read import in_words
from gen.maps.settings import Reading, as_option
from gen.material import Bodies
from gen.runtime.errors import InputError
from gen.runtime.files import Output, atomic, check_outputs
from gen.runtime.terminal import RunProgress, command_to_type, echo, printable
from gen.scene import Scene

FEW_TILES = (
    10  # tiles from which the part that tests a surrogate, a fifth, holds two or more
)
# nodes in contact under the smallest load; fewer count the grid rather than the area
FEWEST_NODES = 50
LARGEST_AREA = 0.4  # share of the patch in contact under the largest load, about
YIELDING = 0.5  # largest mean pressure over the hardness; at 1 there is no equilibrium
# contact area times E* rms slope over the load for light loads; the theories say 1.6 and 2.5
KAPPA = 2.0


def draft(
    inputs: list[str],
    like: Path | None,
    output: Path,
    reading: Reading,
    bodies: Bodies,
    command: str,
) -> None:
    """Look at maps, or at one to be like, print what is found, and write a scene."""
    if bool(inputs) == (like is not None):
        raise InputError(
            "give measured maps (files, folders or patterns) for a scene of their windows, or"
            " --like MAP for surfaces like one of them"
        )
    require_new(output)
    check_outputs([Output(output, "--output")])
    doubts: list[str] = []
    if like is not None:
        found = propose_like(like, reading)
        looks = [found.look]
        print_looks(looks)
        scene = write(output, scene_like(found, bodies, command, output))
        made = f"self-affine surfaces like {like.name}"
        doubts += [f"{found.doubt}: windows of the map are safer"] if found.doubt else []
    else:
        paths = map_files(inputs, Path.cwd())
        with RunProgress(2 * len(paths), noun="readings") as progress:
            proposed = propose(paths, reading, lambda: progress.advance(1, 0))
        looks = proposed.looks
        print_looks(looks)
        scene = write(output, scene_of_windows(proposed, bodies, inputs, command, output))
        made = (
            f"{proposed.windows} windows of {proposed.nodes} x {proposed.nodes} nodes of"
            f" {len(proposed.used)} of {len(paths)} maps, {scene.samples} samples"
        )
    doubts += [
        f"{look.path.name}: {warning}" for look in looks for warning in look.warnings
    ]
    for doubt in (*scene.contact.doubts, *doubts):
        echo(f"warning: {doubt}", err=True)
    echo(f"wrote {output}: {made}")


def scene_of_windows(
    proposal: Proposal, bodies: Bodies, inputs: list[str], command: str, output: Path
) -> str:
    """Return a scene of windows of maps, with comments that say why it has its values."""
    nodes, tiles = proposal.nodes, proposal.tiles
    few = "\n# That is few: scores of a surrogate on them mean little." * (
        tiles < FEW_TILES
    )
    steps = [look.spacing for look in proposal.used]
    spacing = f"# All maps have a node every {in_words(steps[0])} um, and keep it."
    if proposal.spacing is not None:
        apart = [step for each in steps for step in each]
        spacing = f"""\
# um; the maps have a node every {min(apart):.4g} to {max(apart):.4g} um. Finer maps can lose
# detail, coarser ones cannot gain it.
spacing = {float(proposal.spacing)!r}"""
    given = [
        (name, value) for name, value in proposal.reading.of("reading").items() if value
    ]
    keys = "\n".join(f"{name} = {quoted(value)}" for name, value in given)
    reading = (
        f"\n# For files that do not say it.\n[surface.reading]\n{keys}\n" if given else ""
    )
    database, surrogate = (
        printable(str(output.with_suffix(suffix))) for suffix in (".h5", ".surrogate")
    )
    fit = f"{command_to_type('learn fit')} {database} --features hybrid -o {surrogate}"
    title = f"Windows of {len(steps)} measured map{'s' * (len(steps) != 1)}"
    return f"""\
# {title}. Written by
#     {printable(command)}
# Every value is a proposal: change what you know better. Then
{_head(title, output, proposal.windows, f"#     {fit}")}
[surface]
generator = "scans"

# All maps count alike. Names count from the folder of this file on.
files = [
{_files(proposal, inputs, output.absolute().parent)}
]

# Windows {proposal.width:.4g} um wide. The maps are cut into {tiles} tile{"s" * (tiles != 1)}; a
# window lies in one of them, and training and tests of surrogates share no tile.{few}
nodes = {nodes}

{spacing}

{_preparation(proposal)}{reading}
{_loads(bodies, [look.rms_slope for look in proposal.used], nodes**2)}
# A window is a piece of a larger surface: mirrored, it has no edges that carry too much. "free" is
# for bodies that end where the map does.
{_contact(bodies)}"""


def _head(title: str, output: Path, surfaces: int, then: str = "") -> str:
    """Return the numbers of a scene, and the commands that use it."""
    scene, database = (
        printable(str(each)) for each in (output, output.with_suffix(".h5"))
    )
    return f"""\
#     {command_to_type("gen estimate")} {scene}
#     {command_to_type("gen run")} {scene} -o {database}
{then}
title = {quoted(title)}

# {surfaces} surfaces, each under {LOADS_PER_SURFACE} loads. A database can grow: raise samples.
samples = {surfaces * LOADS_PER_SURFACE}
samples_per_surface = {LOADS_PER_SURFACE}
seed = 2025
"""


def _files(proposal: Proposal, inputs: list[str], home: Path) -> str:
    """Return the list of files, those that are left out as comments; `home` is the scene's."""
    if len(proposal.used) > MOST_PATTERNS:  # more names than a list may hold
        names = (quoted(str(Path(name).expanduser().absolute())) for name in inputs)
        return "\n".join(f"    {name}," for name in names)
    lines, home = [], home.resolve()
    for look in proposal.looks:
        name = str(look.path)
        if look.path.is_relative_to(home):
            name = str(look.path.relative_to(home))
            name = f"./{name}" if name.startswith("~") else name  # "~" is somebody's home
        if look.fault:
            lines.append(f"    # {quoted(name)} is left out: {printable(look.fault)}")
            continue
        said = "; ".join([f"rms slope {look.rms_slope:.3g}", *remarks(look)])
        lines.append(f"    {quoted(name)},  # {said}")
    return "\n".join(lines)


def _preparation(proposal: Proposal) -> str:
    """Return the table of the preparation."""
    used, steps = proposal.used, proposal.reading
    despike, fill = "# No map has spikes: no despike.", "# No map has holes: no fill."
    if steps.despike is not None:
        spikes = [
            look.spikes.number for look in used if look.spikes and look.spikes.number
        ]
        despike = f"""\
# {len(spikes)} of {len(used)} maps have spikes, {sum(spikes)} nodes in all: the highest would set
# Delta's zero.
despike = {steps.despike!r}"""
    level = f"the maps are tilted by up to {max(max(map(abs, look.tilt)) for look in used):.2g}"
    if steps.level != "plane":
        curved = printable(next(look.path.name for look in used if look.form > FORM))
        level = f"{curved} and the like are curved: form rather than roughness"
    if steps.fill:
        holes = sum(look.missing > 0 for look in used)
        fill = f"# {holes} of {len(used)} maps have holes.\nfill = true"
    return f"""\
# The options of `gen contact`; every map goes through all steps.
[surface.preparation]
{despike}

# As {level}.
level = {quoted(steps.level)}

{fill}
"""


def scene_like(likeness: Likeness, bodies: Bodies, command: str, output: Path) -> str:
    """Return a scene of self-affine surfaces like a map, with comments."""
    name, steps = likeness.look.path.name, likeness.reading
    taken = [f"despike {steps.despike:g}"] if steps.despike is not None else []
    taken += [f"level {steps.level}"] + ["fill"] * steps.fill
    prepared = " ".join(as_option(each) for each in taken)
    fit, spectrum, (height, slope) = likeness.fit, likeness.spectrum, likeness.windows
    remarked = f"\n# The fit says: {'; '.join(fit.remarks)}." if fit.remarks else ""
    hurst = max(0.0, spectrum.hurst - EXPONENTS), min(1.0, spectrum.hurst + EXPONENTS)
    roll_off = (
        max(spectrum.roll_off / AROUND, spectrum.cut_off),
        spectrum.roll_off * AROUND,
    )
    doubt = ""
    if likeness.doubt:
        doubt = f"\n# DOUBTFUL: {likeness.doubt}. Windows of the map are safer: `gen scene MAP`."
    stretch = f"""
# The map has a lay: wavelengths along x over those along y, which are the ones above.
stretch = {spectrum.stretch!r}
"""
    return f"""\
# Self-affine surfaces around {printable(name)}, a start for a population of your own. Written by
#     {printable(command)}
# The map was prepared by {prepared}. Then
{_head(f"Self-affine surfaces like {name}", output, SURFACES)}
[surface]
generator = "spectral"

# The map's spacing, {likeness.step:g} um.
nodes = {NODES}
side = {rounded(NODES * likeness.step, 6)!r}  # um

# The fit to the map's radial power spectrum: Hurst exponent {fit.spectrum.hurst:.2f}, roll-off
# {fit.spectrum.roll_off:.3g} um, cut-off {fit.spectrum.cut_off:.3g} um, {fit.decades:.2g} decades;
# the spectrum is off the law by a factor of {fit.scatter:.2g} (rms).{remarked}
hurst = {span(*(rounded(each, 3) for each in hurst))}
roll_off = {span(*(rounded(each, 4) for each in roll_off))}
cut_off = {spectrum.cut_off!r}

# With {likeness.slope:.3g}, generated surfaces have the map's rms slope between nodes, {slope:.3g},
# and an rms height of {likeness.height:.3g} um, where windows of the map have {height:.3g} um
# (medians).{doubt}
rms_slope = {span(rounded(likeness.slope / AROUND, 3), rounded(likeness.slope * AROUND, 3))}
{stretch if spectrum.stretch != 1.0 else ""}
{_loads(bodies, [likeness.look.rms_slope], NODES**2)}
# As for windows of maps. "periodic" would make each surface its own period.
{_contact(bodies)}"""


def _loads(bodies: Bodies, slopes: Sequence[float], nodes: int) -> str:
    """Return the table of loads, from first contacts that the grid resolves to a large part of it.

    The contact area under a mean pressure p is about KAPPA p / (E* rms slope) of an elastic
    body, and at least p / hardness: with a hardness there are two scales, and loads are pressures.
    """
    smallest = min(FEWEST_NODES / nodes, LARGEST_AREA / 10)
    if bodies.hardness is None:
        quantity = "pressure/(E* slope_rms)"
        low, high = rounded(smallest / KAPPA), rounded(LARGEST_AREA / KAPPA)
        small = 100 * KAPPA * low
        why = f"""\
# Mean pressure over E* times the surface's rms slope: light loads bring about {KAPPA:g} times this
# share of a surface into contact, rough or smooth, from about {small:.2g} % on."""
    else:
        quantity = "pressure"
        bearing = min(bodies.hardness, bodies.e_star * statistics.median(slopes) / KAPPA)
        low = rounded(smallest * bearing)
        high = rounded(min(LARGEST_AREA * bearing, YIELDING * bodies.hardness))
        small, large = 100 * low / bearing, 100 * high / bearing
        why = f"""\
# MPa, mean pressure over the patch.
# These loads bring about {small:.2g} to {large:.2g} % of a middling surface into contact.
# The hardness, {bodies.hardness:g} MPa, is the pressure without equilibrium."""
    return f"""\
[load]
{why}
quantity = {quoted(quantity)}

# From some {FEWEST_NODES} nodes in contact, where areas begin to be more than a count of nodes, to
# a large part of the surface; log-uniform: small areas as often as large ones.
range = {{ log_uniform = {span(low, high)} }}

[contact]"""


def _contact(bodies: Bodies) -> str:
    """Return the keys of the contact, the boundary first."""
    young, poisson = bodies.only or (bodies.e_star, 0.0)
    unknown = (
        ""
        if bodies.known
        else "\n# None was given: areas of elastic bodies hold for any."
    )
    hardness = "# Metals yield: hardness = 2000.0 (MPa, steel) with loads as pressures."
    if bodies.hardness is not None:
        hardness = f"# MPa, of the softer body.\nhardness = {float(bodies.hardness)!r}"
    return f"""\
boundary = "mirror"

# MPa, Young's modulus of an elastic body on a rigid one; E* = modulus / (1 - poisson^2).{unknown}
modulus = {float(young)!r}
poisson = {float(poisson)!r}

{hardness}
"""


def quoted(text: str) -> str:
    """Write a text in TOML's notation; refuse bytes that are no UTF-8, as names of files have."""
    try:
        text.encode()
    except UnicodeEncodeError:
        raise InputError(
            f"{text!r}: a scene is UTF-8, in which this name cannot be written; rename the file"
        ) from None
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


def span(low: float, high: float) -> str:
    """Write a range in TOML's notation."""
    return f"[{float(low)!r}, {float(high)!r}]"


def require_new(path: Path) -> None:
    """Refuse a name that a scene cannot have, or that is taken."""
    if path.suffix != ".toml":
        raise InputError(f"--output {path}: give a name that ends in .toml, as mine.toml")
    if path.exists():
        raise InputError(
            f"--output {path}: is there already, and may hold changes of yours: give another name,"
            " or move it away"
        )


def write(path: Path, text: str) -> Scene:
    """Write a scene, never over another file, and return it as `gen run` reads it."""
    text = re.sub(r"\n{3,}", "\n\n", text)
    scene = Scene.parse(text, str(path))
    with atomic(path, replace=False) as file:
        file.write(text.encode())
    if path.read_bytes() != text.encode():
        require_new(path)
    return scene
