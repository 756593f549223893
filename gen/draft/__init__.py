"""Draft a scene for measured maps: survey the maps, choose the values, write the scene.

`gen.draft.survey` reads maps and measures their roughness. `gen.draft.proposal` chooses windows of
the maps, `gen.draft.likeness` fits a self-affine law to one map, and `gen.draft.populations` fits a
population to maps of one kind or to scans of one surface: `gen.draft.bands` determines spectra,
`gen.draft.joined` joins those of scans, `gen.draft.height_curve` fits the distribution of heights,
`gen.draft.curve_choice` chooses between its two forms, and `gen.draft.imperfections` separates pits
and dust. `gen.draft.judge` compares surfaces with a map by the contact, which `gen.draft.press`
solves, and `gen.draft.writing` writes the scene.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from gen.arrays import Heights
from gen.draft.joined import judged_scan, surface_at_nodes
from gen.draft.judge import (
    Judgement,
    Maker,
    compare_parts,
    judge_surfaces,
    print_judgement,
    print_reach,
)
from gen.draft.likeness import NODES as LAW_NODES
from gen.draft.likeness import NoLaw, propose_like
from gen.draft.populations import LikeMaps, propose_joined, propose_population
from gen.draft.proposal import propose
from gen.draft.survey import MapSurvey, print_surveys
from gen.draft.writing import (
    require_new,
    scene_like,
    scene_of_population,
    scene_of_windows,
    write,
)
from gen.maps.filters import fitted_polynomial
from gen.maps.library import map_files
from gen.maps.read import Topography
from gen.maps.settings import Reading
from gen.material import Bodies
from gen.population import Population, generate_like
from gen.runtime.errors import InputError
from gen.runtime.files import Output, atomic, check_outputs
from gen.runtime.terminal import RunProgress, echo
from gen.scene import Scene
from gen.surface import Random


@dataclass(frozen=True)
class Draft:
    """A scene that was written for maps."""

    scene: Scene
    summary: str  # description of the surfaces, for the last line that the command prints
    surveys: list[MapSurvey]  # surveys of all files, also of files that are left out
    # why self-affine surfaces may not be like the map; "" without such a reason, or for windows
    doubt: str = ""
    # sentences on properties of the maps that surfaces of a population do not have
    remarks: Sequence[str] = ()


@dataclass(frozen=True)
class _Order:
    """What the user wants of a scene for maps."""

    output: Path  # the file to write the scene to
    reading: Reading  # how files are read
    bodies: Bodies  # material of the contact
    command: str  # the command line, which a comment of the scene quotes
    generator: str  # generator of surfaces like maps; "" to choose it by the contact
    join: bool  # whether the maps are scans of one surface at different magnifications


def draft(
    inputs: Sequence[str],
    like: Sequence[Path],
    output: Path,
    reading: Reading,
    bodies: Bodies,
    command: str,
    generator: str = "",
    *,
    join: bool = False,
) -> None:
    """Write a scene for maps; print a table of the maps, warnings, and what has been written.

    Warnings go to standard error.

    Parameters
    ----------
    inputs : sequence of str
        Files, folders or patterns of the maps for a scene of windows; empty if `like` is given.
    like : sequence of Path
        Maps of one kind for a scene of surfaces like them; empty if `inputs` is given.
    output : Path
        The file to write the scene to, which must not exist.
    reading : Reading
        Unit, lengths and channel for files that do not determine them, and steps of the
        preparation that are not to be chosen for the maps.
    bodies : Bodies
        Material of the contact.
    command : str
        The command line, which a comment of the scene quotes.
    generator : {"", "spectral", "like"}
        Generator of surfaces like the maps; by default it is chosen by the contact.
    join : bool, optional
        Whether the maps `like` are scans of one surface at different magnifications.

    Raises
    ------
    InputError
        If not exactly one of `inputs` and `like` is given, `generator` or `join` does not suit
        them, the file cannot be written, no map can be used, or no surfaces can be like the maps
        `like`.
    """
    if bool(inputs) == bool(like):
        raise InputError(
            "give measured maps (files, folders or patterns) for a scene of their windows, or"
            " --like MAP for surfaces like them"
        )
    if generator and not like:
        raise InputError("--generator: needs --like; maps alone give their windows")
    if generator not in {"", "spectral", "like"}:
        raise InputError(
            f"--generator {generator!r}: give spectral (a self-affine law) or like (the map's own"
            " spectrum)"
        )
    if join and (len(like) < 2 or generator == "spectral"):
        raise InputError(
            "--join: give two or more --like, scans of one surface at different magnifications,"
            " and no --generator spectral"
        )
    if generator == "spectral" and len(like) > 1:
        raise InputError(
            "--generator spectral: a law is that of one map; give one --like"
        )
    require_new(output)
    check_outputs([Output(output, "--output")])
    order = _Order(
        output=output,
        reading=reading,
        bodies=bodies,
        command=command,
        generator=generator,
        join=join,
    )
    drafted = _draft_like(order, like) if like else _draft_windows(order, inputs)
    for warning in _warnings(drafted):
        echo(f"warning: {warning}", err=True)
    echo(f"wrote {output}: {drafted.summary}")


def _draft_like(order: _Order, paths: Sequence[Path]) -> Draft:
    """Write a scene of surfaces like maps, of the kind that the contact finds most like them.

    For a single map they are those of a self-affine law if one fits and the map is of its kind.
    Otherwise they have the maps' own spectrum. If a map is not of that kind either, they are
    windows of the maps. A generator that the user wants is taken whatever the verdict is.
    """
    _require_new_population(order.output)
    if order.join:
        return _draft_joined(order, paths)
    if len(paths) == 1 and order.generator != "like":
        drafted = _draft_law(order, paths[0])
        if drafted is not None:
            return drafted
    like = propose_population(paths, order.reading)
    print_surveys(like.surveys)
    _print_preparation(like.reading, like.surveys)
    judgements = _judged_population(order, like)
    verdicts = [judgement.verdict for judgement in judgements]
    if "not of its kind" in verdicts and not order.generator:
        echo("windows of the maps are taken instead (--generator like insists)")
        try:
            return _draft_windows(order, [str(path) for path in paths])
        except InputError as fault:
            echo(f"warning: no windows can be cut: {fault}", err=True)
    drafted = _draft_population(order, like)
    if set(verdicts) != {"of its kind"}:
        faults = [judgement.sentence for judgement in judgements]
        return replace(drafted, remarks=[*drafted.remarks, *faults])
    return drafted


def _draft_joined(order: _Order, paths: Sequence[Path]) -> Draft:
    """Write a scene of surfaces with the joined spectrum of scans, and return it.

    The surfaces are compared with the finest scan, and at the nodes of the widest scan with this
    one. The finest scan lacks the long waves, so that its rms height is a matter of chance. The
    verdict by the widest scan decides, as that by a single map does, see `_draft_like`. If the map
    is not of the kind of the surfaces, the windows are those of the widest scan.
    """
    like = propose_joined(paths, order.reading)
    joined = like.joined
    assert joined is not None  # `propose_joined` has joined the scans
    print_surveys(like.surveys)
    _print_preparation(like.reading, like.surveys)
    for scan in joined.scans:
        waves = scan.range
        echo(
            f"{Path(scan.name).name}: waves of {waves.longest:.4g} to"
            f" {waves.shortest:.4g} um (limit: {waves.limit})"
        )
    finest = joined.finest
    judgement = _judged(
        finest.topography,
        partial(_levelled_surface, like.population),
        order.bodies,
        like.nodes,
        f"levelled surfaces with the joined spectrum and {Path(finest.name).name}",
    )
    widest = judged_scan(joined)
    if widest is not finest:
        judgement = _judged_at_nodes(order, like.population, widest.topography)
        if judgement.verdict == "not of its kind" and not order.generator:
            name = Path(widest.name).name
            echo(f"windows of {name} are taken instead (--generator like insists)")
            return _draft_windows(order, [widest.name])
    drafted = _draft_population(order, like)
    if judgement.verdict == "of its kind":
        return drafted
    return replace(drafted, remarks=[*drafted.remarks, judgement.sentence])


def _judged_at_nodes(
    order: _Order, population: Population, scan: Topography
) -> Judgement:
    """Judge a scan by surfaces of a joined population at its nodes, and print the judgement."""

    def make(shape: tuple[int, int], random: Random) -> Heights:
        """Make a surface [um] at nodes of the scan."""
        surface = surface_at_nodes(population, shape, scan.spacing, random)
        return _levelled(surface)

    judgement = judge_surfaces(scan.heights, scan.spacing, make, order.bodies)
    name = Path(scan.name).name
    print_judgement(judgement, f"levelled surfaces at the nodes of {name}")
    return judgement


def _levelled_surface(
    population: Population, shape: tuple[int, int], random: Random
) -> Heights:
    """Make a surface [um] with the nodes `shape`, less its mean plane."""
    return _levelled(_surface_like(population, 1.0, shape, random))


def _levelled(surface: Heights) -> Heights:
    """Return a surface less its mean plane, as a scan is levelled [um]."""
    return np.asarray(surface - fitted_polynomial(surface, degree=1))


def _judged_population(order: _Order, like: LikeMaps) -> list[Judgement]:
    """Judge each map of a population by the contact, and print the judgements."""
    population = like.population
    judgements = []
    for survey, fitted_map, source in zip(
        like.surveys, like.maps, population.maps, strict=True
    ):
        scale = source.rms_height / like.median_rms_height
        topography = fitted_map.topography
        judgement = _judged(
            topography,
            partial(_surface_like, population, scale),
            order.bodies,
            like.nodes,
            f"surfaces with the spectrum of {survey.path.name}",
        )
        judgements.append(judgement)
    return judgements


def _judged(
    topography: Topography, make: Maker, bodies: Bodies, nodes: int, kind: str
) -> Judgement:
    """Judge a map by the contact; print the judgement, and whether features reach the map's.

    `nodes` are those along each side of the scene's patches, and `kind` says in the plural what
    the surfaces are.
    """
    heights = topography.heights
    spacing = topography.spacing
    judgement = judge_surfaces(heights, spacing, make, bodies)
    print_judgement(judgement, kind)
    print_reach(compare_parts(heights, spacing, make, nodes))
    return judgement


def _surface_like(
    population: Population, scale: float, shape: tuple[int, int], random: Random
) -> Heights:
    """Make a surface [um] out of a period as long as the maps, or as the surface if it is longer.

    `scale` is its rms height over that of the population [1], `shape` its nodes along x and y.
    """
    nx, ny = (max(pair) for pair in zip(shape, population.nodes, strict=True))
    return scale * generate_like(population, shape, (nx, ny), random)


def _print_preparation(reading: Reading, surveys: Sequence[MapSurvey]) -> None:
    """Print how maps were prepared, as options of `gen describe`, and what it changes."""
    options = reading.options_of_steps
    echo(f"prepared by {options}; give these to gen describe for the same numbers")
    for survey in surveys:
        if survey.effect:
            echo(f"{survey.path.name}: {survey.effect}")


def _draft_law(order: _Order, path: Path) -> Draft | None:
    """Write a scene of self-affine surfaces like a map, print its survey, and return the scene.

    Return None, and say why, if no law fits the map or the map is not of the kind of its surfaces.
    A law that the user wants is taken whatever the verdict is, and NoLaw is raised without one.
    """
    try:
        likeness = propose_like(path, order.reading)
    except NoLaw as fault:
        if order.generator == "spectral":
            raise
        echo(f"{fault}: surfaces get the spectrum of the map itself")
        return None
    topography = likeness.topography
    try:
        judgement = _judged(
            topography,
            likeness.generate,
            order.bodies,
            LAW_NODES,
            f"surfaces of the self-affine law of {path.name}",
        )
    except InputError as fault:  # the law's waves are too short for the map's grid
        echo(f"no surfaces of its law on its grid: {fault}")
        return None
    if judgement.verdict != "of its kind" and order.generator != "spectral":
        echo("surfaces get the spectrum of the map itself (--generator spectral insists)")
        return None
    print_surveys([likeness.survey])
    _print_preparation(likeness.reading, [likeness.survey])
    text = scene_like(likeness, order.bodies, order.command, order.output)
    scene = write(order.output, text)
    doubt = likeness.doubt
    if judgement.verdict != "of its kind":
        doubt = judgement.sentence
    return Draft(
        scene=scene,
        summary=f"self-affine surfaces like {path.name}",
        surveys=[likeness.survey],
        doubt=doubt,
    )


def _population_file(output: Path) -> Path:
    """Return the file of the population beside a scene."""
    return output.with_suffix(".population.json")


def _require_new_population(output: Path) -> None:
    """Raise InputError if there is a file at the place of a new scene's population."""
    path = _population_file(output)
    if path.exists():
        raise InputError(
            f"{path}: is there already, and another scene may need it: give another --output, or"
            " move it away"
        )


def _draft_population(order: _Order, like: LikeMaps) -> Draft:
    """Write a population and a scene of it, and return the scene."""
    output = order.output
    population_file = _population_file(output)
    text = scene_of_population(like, order.bodies, order.command, output, population_file)
    Scene.parse(text, str(output))  # before the first file is written
    with atomic(population_file, replace=False) as file:
        file.write(like.population.text.encode())
    scene = write(output, text)
    imperfections = len(like.population.imperfections)
    echo(
        f"wrote {population_file}: the spectrum in bands, the quantiles of heights, and the"
        f" imperfections of the maps, of which there are {imperfections or 'none'}"
    )
    names = ", ".join(survey.path.name for survey in like.surveys)
    return Draft(
        scene=scene,
        summary=f"surfaces like {names}, patches of {_compared(like)}",
        surveys=like.surveys,
        remarks=like.population.remarks,
    )


def _compared(like: LikeMaps) -> str:
    """Return the nodes of the patches of a scene, and those of the maps if they are more."""
    map_nx, map_ny = like.population.nodes
    patches = f"{like.nodes} x {like.nodes} nodes"
    if like.nodes >= max(map_nx, map_ny):
        return patches
    return f"{patches} (maps: {map_nx} x {map_ny}; for their law change nodes)"


def _draft_windows(order: _Order, inputs: Sequence[str]) -> Draft:
    """Print the surveys of maps, write a scene of their windows, and return it."""
    paths = map_files(inputs, Path.cwd())
    # Each file is read twice: as it is, and then with the preparation that suits all maps.
    with RunProgress(2 * len(paths), noun="readings") as progress:
        proposal = propose(paths, order.reading, advance=lambda: progress.advance(rows=1))
    print_surveys(proposal.surveys)
    _print_preparation(proposal.reading, proposal.surveys)
    text = scene_of_windows(proposal, order.bodies, inputs, order.command, order.output)
    scene = write(order.output, text)
    summary = (
        f"{proposal.windows} windows of {proposal.nodes} x {proposal.nodes} nodes of"
        f" {len(proposal.used)} of {len(paths)} maps, {scene.samples} samples"
    )
    return Draft(scene=scene, summary=summary, surveys=proposal.surveys)


def _warnings(drafted: Draft) -> list[str]:
    """Return warnings about the contact, the self-affine law, and the heights of the maps."""
    warnings = list(drafted.scene.contact.doubts)
    if drafted.doubt:
        warnings.append(f"{drafted.doubt}: windows of the map are safer")
    warnings += drafted.remarks
    for survey in drafted.surveys:
        warnings += [f"{survey.path.name}: {warning}" for warning in survey.warnings]
    return warnings
