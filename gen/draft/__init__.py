"""Draft a scene for measured maps: survey the maps, choose the values, write the scene.

`gen.draft.survey` reads maps and measures their roughness. `gen.draft.proposal` chooses windows of
the maps, `gen.draft.likeness` fits a self-affine law to one map, `gen.draft.populations` fits a
population to maps of one kind, and `gen.draft.writing` writes the scene.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from gen.draft.likeness import NoLaw, propose_like
from gen.draft.populations import propose_population
from gen.draft.proposal import propose
from gen.draft.survey import MapSurvey, print_surveys
from gen.draft.writing import (
    require_new,
    scene_like,
    scene_of_population,
    scene_of_windows,
    write,
)
from gen.maps.library import map_files
from gen.maps.settings import Reading
from gen.material import Bodies
from gen.runtime.errors import InputError
from gen.runtime.files import Output, atomic, check_outputs
from gen.runtime.terminal import RunProgress, echo
from gen.scene import Scene


@dataclass(frozen=True)
class Draft:
    """A scene that was written for maps."""

    scene: Scene
    summary: str  # description of the surfaces, for the last line that the command prints
    surveys: list[MapSurvey]  # surveys of all files, also of files that are left out
    # why self-affine surfaces may not be like the map; "" without such a reason, or for windows
    doubt: str = ""
    # what surfaces of a population do not share with the maps
    remarks: Sequence[str] = ()


def draft(
    inputs: Sequence[str],
    like: Sequence[Path],
    output: Path,
    reading: Reading,
    bodies: Bodies,
    command: str,
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
        Unit, lengths and channel for files that do not determine them.
    bodies : Bodies
        Material of the contact.
    command : str
        The command line, which a comment of the scene quotes.

    Raises
    ------
    InputError
        If not exactly one of `inputs` and `like` is given, the file cannot be written, no map can
        be used, or no surfaces can be like the maps `like`.
    """
    if bool(inputs) == bool(like):
        raise InputError(
            "give measured maps (files, folders or patterns) for a scene of their windows, or"
            " --like MAP for surfaces like them"
        )
    require_new(output)
    check_outputs([Output(output, "--output")])
    if like:
        drafted = _draft_like(like, output, reading, bodies, command)
    else:
        drafted = _draft_windows(inputs, output, reading, bodies, command)
    for warning in _warnings(drafted):
        echo(f"warning: {warning}", err=True)
    echo(f"wrote {output}: {drafted.summary}")


def _draft_like(
    paths: Sequence[Path], output: Path, reading: Reading, bodies: Bodies, command: str
) -> Draft:
    """Write a scene of surfaces like maps: by a self-affine law if one fits a single map."""
    _require_new_population(output)
    if len(paths) == 1:
        try:
            return _draft_law(paths[0], output, reading, bodies, command)
        except NoLaw as fault:
            echo(f"{fault}: surfaces get the spectrum of the map itself")
    return _draft_population(paths, output, reading, bodies, command)


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


def _draft_law(
    path: Path, output: Path, reading: Reading, bodies: Bodies, command: str
) -> Draft:
    """Print the survey of a map, write a scene of self-affine surfaces like it, and return it.

    Raise NoLaw if no self-affine law fits the map.
    """
    likeness = propose_like(path, reading)
    print_surveys([likeness.survey])
    text = scene_like(likeness, bodies, command, output)
    scene = write(output, text)
    return Draft(
        scene=scene,
        summary=f"self-affine surfaces like {path.name}",
        surveys=[likeness.survey],
        doubt=likeness.doubt,
    )


def _draft_population(
    paths: Sequence[Path], output: Path, reading: Reading, bodies: Bodies, command: str
) -> Draft:
    """Print the surveys of maps, write their population and a scene of it, and return the scene."""
    population_file = _population_file(output)
    like = propose_population(paths, reading)
    print_surveys(like.surveys)
    text = scene_of_population(like, bodies, command, output, population_file)
    Scene.parse(text, str(output))  # before the first file is written
    with atomic(population_file, replace=False) as file:
        file.write(like.population.text.encode())
    scene = write(output, text)
    echo(f"wrote {population_file}: the spectrum in bands and the quantiles of heights")
    names = ", ".join(path.name for path in paths)
    return Draft(
        scene=scene,
        summary=f"surfaces like {names}",
        surveys=like.surveys,
        remarks=list(like.population.remarks),
    )


def _draft_windows(
    inputs: Sequence[str], output: Path, reading: Reading, bodies: Bodies, command: str
) -> Draft:
    """Print the surveys of maps, write a scene of their windows, and return it."""
    paths = map_files(inputs, Path.cwd())
    # Each file is read twice: as it is, and then with the preparation that suits all maps.
    with RunProgress(2 * len(paths), noun="readings") as progress:
        proposal = propose(paths, reading, advance=lambda: progress.advance(rows=1))
    print_surveys(proposal.surveys)
    text = scene_of_windows(proposal, bodies, inputs, command, output)
    scene = write(output, text)
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
