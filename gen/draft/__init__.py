"""Draft a scene for a folder of measured maps: survey them, choose, print, write."""

from __future__ import annotations

from pathlib import Path

from gen.draft import likeness, proposal, scene_text
from gen.draft.proposal import Material
from gen.draft.survey import print_looks
from gen.maps.files import map_files
from gen.maps.settings import Reading
from gen.runtime.errors import InputError
from gen.runtime.files import Output, check_outputs
from gen.runtime.terminal import RunProgress, echo


def draft(
    inputs: list[str],
    like: Path | None,
    output: Path,
    reading: Reading,
    material: Material,
    command: str,
) -> None:
    """Look at maps, print what was found, and write the scene.

    Raises InputError if there is not exactly one of the inputs and `like`, no map can be used,
    or the scene cannot be written.
    """
    if bool(inputs) == (like is not None):
        raise InputError(
            "give measured maps (files, folders or patterns) for a scene of their windows, or"
            " --like MAP for surfaces like one of them"
        )
    scene_text.require_new(output)
    check_outputs([Output(output, "--output")])
    if like is not None:
        found = likeness.propose(like, reading, material)
        print_looks([found.look])
        scene = scene_text.write(output, likeness.keys(found, command, output))
        unlike = [f"{found.doubt}: windows of the map are safer"] if found.doubt else []
        for doubt in (*scene.contact.doubts, *unlike):
            echo(f"warning: {doubt}", err=True)
        echo(f"wrote {output}: self-affine surfaces like {like.name}")
        return
    paths = map_files(inputs, Path.cwd())
    with RunProgress(2 * len(paths), noun="readings") as progress:
        proposed = proposal.propose(paths, reading, material, lambda: progress.advance(1, 0))
    print_looks(proposed.looks)
    keys = scene_text.keys(proposed, inputs, command, output)
    scene = scene_text.write(output, keys)
    for doubt in scene.contact.doubts:
        echo(f"warning: {doubt}", err=True)
    used = len(proposed.used)
    echo(
        f"wrote {output}: {proposed.windows} windows of {proposed.nodes} x {proposed.nodes}"
        f" nodes of {used} of {len(paths)} maps, {scene.samples} samples"
    )
