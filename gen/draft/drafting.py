"""Draft a scene for measured maps: look, choose, print, write."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from gen.draft import likeness, proposal, scene_text
from gen.draft.proposal import Material
from gen.draft.survey import print_looks
from gen.maps.files import map_files
from gen.maps.settings import Reading
from gen.runtime.errors import InputError
from gen.runtime.files import Output, check_outputs
from gen.runtime.terminal import RunProgress, echo


@dataclass(frozen=True)
class Order:
    """The maps, options and file of a scene to be written.

    Attributes
    ----------
    inputs : list of str
        Files, folders and patterns of maps.
    like : Path or None
        Map that self-affine surfaces are to be like, instead of `inputs`.
    output : Path
        File to write.
    reading : Reading
        How files are read.
    material : Material
        Elastic constants and hardness.
    command : str
        Command line, for the record.
    """

    inputs: list[str]
    like: Path | None
    output: Path
    reading: Reading
    material: Material
    command: str

    def check(self) -> None:
        """Refuse orders of nothing or of two things, and files that cannot be made.

        Raises
        ------
        InputError
            If there is not exactly one of the inputs and `like`, or the output cannot be written.
        """
        if bool(self.inputs) == (self.like is not None):
            raise InputError(
                "give measured maps (files, folders or patterns) for a scene of their windows, or"
                " --like MAP for surfaces like one of them"
            )
        scene_text.require_new(self.output)
        check_outputs([Output(self.output, "--output")])


def draft(order: Order) -> None:
    """Look at maps, print what was found, and write the scene.

    Parameters
    ----------
    order : Order
        What is to be drafted.

    Raises
    ------
    InputError
        If no map can be used, or the scene cannot be written.
    """
    order.check()
    if order.like is not None:
        like = likeness.propose(order.like, order.reading, order.material)
        print_looks([like.look])
        scene = scene_text.write(order.output, likeness.keys(like, order.command, order.output))
        unlike = [f"{like.doubt}: windows of the map are safer"] if like.doubt else []
        for doubt in (*scene.contact.doubts, *unlike):
            echo(f"warning: {doubt}", err=True)
        echo(f"wrote {order.output}: self-affine surfaces like {order.like.name}")
        return
    paths = map_files(order.inputs, Path.cwd())
    with RunProgress(2 * len(paths), noun="readings") as progress:
        proposed = proposal.propose(
            paths, order.reading, order.material, lambda: progress.advance(1, 0)
        )
    print_looks(proposed.looks)
    keys = scene_text.keys(proposed, order.inputs, order.command, order.output)
    scene = scene_text.write(order.output, keys)
    for doubt in scene.contact.doubts:
        echo(f"warning: {doubt}", err=True)
    used = len(proposed.used)
    echo(
        f"wrote {order.output}: {proposed.windows} windows of {proposed.nodes} x {proposed.nodes}"
        f" nodes of {used} of {len(paths)} maps, {scene.samples} samples"
    )
