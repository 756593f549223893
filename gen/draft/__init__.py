"""Draft a scene for measured maps: survey them, choose, print, write it.

`gen.draft.survey` reads maps, `gen.draft.proposal` chooses windows of them, `gen.draft.likeness` a
self-affine law like one of them, and `gen.draft.writing` writes the scene.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from gen.draft.likeness import propose_like
from gen.draft.proposal import propose
from gen.draft.survey import MapSurvey, print_surveys
from gen.draft.writing import require_new, scene_like, scene_of_windows, write
from gen.maps.library import map_files
from gen.maps.settings import Reading
from gen.material import Bodies
from gen.runtime.errors import InputError
from gen.runtime.files import Output, check_outputs
from gen.runtime.terminal import RunProgress, echo
from gen.scene import Scene


@dataclass(frozen=True)
class Draft:
    """A scene that was written for maps."""

    scene: Scene
    summary: str  # what the scene is made of, for the last line of the command
    surveys: list[MapSurvey]  # all files that were read
    doubt: str = ""  # why surfaces are not like the map, "" if they are or are windows


def draft(
    inputs: Sequence[str],
    like: Path | None,
    output: Path,
    reading: Reading,
    bodies: Bodies,
    command: str,
) -> None:
    """Write a scene for maps, and print a table of the maps, warnings and what was written.

    Parameters
    ----------
    inputs : sequence of str
        Names of maps for a scene of their windows: files, folders or patterns; empty with `like`.
    like : Path, optional
        A map for a scene of self-affine surfaces like it.
    output : Path
        The scene's file, which must not exist.
    reading : Reading
        How maps are read that do not say it themselves.
    bodies : Bodies
        Material of the contact.
    command : str
        The command line, for the comments of the scene.

    Raises
    ------
    InputError
        If not exactly one of `inputs` and `like` is given, the file cannot be written, or no map
        can be used.
    """
    if bool(inputs) == (like is not None):
        raise InputError(
            "give measured maps (files, folders or patterns) for a scene of their windows, or"
            " --like MAP for surfaces like one of them"
        )
    require_new(output)
    check_outputs([Output(output, "--output")])
    if like is not None:
        written = _draft_like(like, output, reading, bodies, command)
    else:
        written = _draft_windows(inputs, output, reading, bodies, command)
    for doubt in _doubts(written):
        echo(f"warning: {doubt}", err=True)
    echo(f"wrote {output}: {written.summary}")


def _draft_like(
    path: Path, output: Path, reading: Reading, bodies: Bodies, command: str
) -> Draft:
    """Print a survey of a map, and write a scene of self-affine surfaces like it."""
    likeness = propose_like(path, reading)
    print_surveys([likeness.survey])
    scene = write(output, scene_like(likeness, bodies, command, output))
    summary = f"self-affine surfaces like {path.name}"
    return Draft(scene, summary, [likeness.survey], likeness.doubt)


def _draft_windows(
    inputs: Sequence[str], output: Path, reading: Reading, bodies: Bodies, command: str
) -> Draft:
    """Print a survey of maps, and write a scene of their windows."""
    paths = map_files(inputs, Path.cwd())
    with RunProgress(2 * len(paths), noun="readings") as progress:
        proposal = propose(paths, reading, lambda: progress.advance(1, 0))
    print_surveys(proposal.surveys)
    text = scene_of_windows(proposal, bodies, inputs, command, output)
    scene = write(output, text)
    summary = (
        f"{proposal.windows} windows of {proposal.nodes} x {proposal.nodes} nodes of"
        f" {len(proposal.used)} of {len(paths)} maps, {scene.samples} samples"
    )
    return Draft(scene, summary, proposal.surveys)


def _doubts(written: Draft) -> list[str]:
    """List the reasons to doubt a scene: of its contact, its law and the heights of its maps."""
    doubts = list(written.scene.contact.doubts)
    if written.doubt:
        doubts.append(f"{written.doubt}: windows of the map are safer")
    for survey in written.surveys:
        doubts += [f"{survey.path.name}: {warning}" for warning in survey.warnings]
    return doubts
