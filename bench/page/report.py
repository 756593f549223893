"""`python -m bench run` and `python -m bench page`: the parts made, and the page of them."""

from collections.abc import Sequence
from pathlib import Path

from bench.databases import of_the_paper
from bench.page.html import PAGE, write_page
from bench.page.inputs import COMPARISON, Inputs
from bench.page.part import Part
from bench.page.parts import DATABASE, PARTS, ROWS
from bench.page.run import Outcome, Remark, make
from gen.runtime.errors import InputError
from gen.runtime.output import check_folder, make_folder
from gen.scene import load


def run(
    output: Path,
    remark: Remark,
    *,
    full: bool = False,
    database: Path | None = None,
    comparison: Path | None = None,
    only: Sequence[str] = (),
) -> tuple[Path, Outcome]:
    """Make the parts that are missing, and the page of all that are there.

    Parameters
    ----------
    output : Path
        Folder of the page; made if there is none.
    remark : callable
        Told how far it is.
    full : bool
        True for everything, False for what fits into ten minutes.
    database, comparison : Path or None
        Database of the paper preset, and folder of `learn compare` and `learn tune`; made in the
        folder if None.
    only : sequence of str
        Names of parts; all if empty.

    Raises
    ------
    InputError
        If a name is unknown, a given file cannot be used or the folder cannot be written to.
    """
    inputs = _inputs(output, database, comparison, full=full)
    parts = _chosen(only, inputs, comparison)
    check_folder(output, PAGE)
    make_folder(output)
    if any("{database}" in (part.full if full else part.quick) for part in parts):
        rows = load("paper").samples if full else ROWS
        of_the_paper(database, (output / DATABASE).parent, rows)
    outcome = make(parts, inputs, remark, lambda: write_page(PARTS, inputs))
    return write_page(PARTS, inputs), outcome


def page(output: Path, *, full: bool = False, comparison: Path | None = None) -> Path:
    """Write the page of what a folder holds, and make nothing.

    Raises
    ------
    InputError
        If there is no such folder, or it cannot be written to.
    """
    if not output.is_dir():
        raise InputError(f"{output} is not a folder; `python -m bench run -o {output}` makes one")
    return write_page(PARTS, _inputs(output, None, comparison, full=full))


def _inputs(output: Path, database: Path | None, comparison: Path | None, *, full: bool) -> Inputs:
    return Inputs(output, database or output / DATABASE, comparison or output / COMPARISON, full)


def _chosen(only: Sequence[str], inputs: Inputs, given: Path | None) -> list[Part]:
    """Return the parts of this run; a comparison that was given is not ours to add to."""
    names = {part.name: part for part in PARTS}
    for name in only:
        if name not in names:
            raise InputError(f"--only {name}: give one of {', '.join(names)}")
        if not inputs.full and not names[name].quick:
            raise InputError(f"--only {name}: takes long, and needs --full")
    if given is not None and not given.is_dir():
        raise InputError(f"--comparison {given}: give a folder of learn compare or learn tune")
    wanted = [part for part in PARTS if not only or part.name in only]
    return [part for part in wanted if inputs.folder(part) != given]
