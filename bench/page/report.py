"""`python -m bench run` and `python -m bench page`: the parts made, and the page of them."""

from collections.abc import Sequence
from pathlib import Path

from bench.databases import of_the_paper
from bench.page.html import PAGE, write_page
from bench.page.inputs import Inputs
from bench.page.part import Part
from bench.page.parts import PARTS, ROWS
from bench.page.run import Outcome, make
from gen.runtime.errors import InputError
from gen.runtime.output import check_folder, make_folder
from gen.scene import load


def run(inputs: Inputs, only: Sequence[str] = ()) -> tuple[Path, Outcome]:
    """Make the parts that are missing, of those named only, and the page of all that are there."""
    parts = _chosen(only, inputs)
    check_folder(inputs.output, PAGE)
    make_folder(inputs.output)
    if any("{database}" in inputs.template(part) for part in parts):
        rows = load("paper").samples if inputs.full else ROWS
        of_the_paper(inputs.database, inputs.files["database"].parent, rows)
    outcome = make(parts, inputs, lambda: write_page(PARTS, inputs))
    return write_page(PARTS, inputs), outcome


def page(inputs: Inputs) -> Path:
    """Write the page of what a folder holds, and make nothing."""
    folder = inputs.output
    if not folder.is_dir():
        raise InputError(f"{folder} is not a folder; `python -m bench run -o {folder}` makes one")
    return write_page(PARTS, inputs)


def _chosen(only: Sequence[str], inputs: Inputs) -> list[Part]:
    """Return the parts of this run; a comparison that was given is not ours to add to."""
    names = {part.name: part for part in PARTS}
    for name in only:
        if name not in names:
            raise InputError(f"--only {name}: give one of {', '.join(names)}")
        if not inputs.template(names[name]):
            raise InputError(f"--only {name}: takes long, and needs --full")
    given = inputs.comparison
    if given is not None and not given.is_dir():
        raise InputError(f"--comparison {given}: give a folder of learn compare or learn tune")
    wanted = [part for part in PARTS if not only or part.name in only]
    return [part for part in wanted if inputs.folder(part) != given]
