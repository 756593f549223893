"""`python -m bench run` and `python -m bench page`: the parts made, and the page of them."""

from collections.abc import Sequence
from pathlib import Path

from bench.page.html import PAGE, write_page
from bench.page.inputs import COMPARISON, Inputs
from bench.page.part import Part
from bench.page.parts import DATABASE, PARTS, ROWS
from bench.page.run import Outcome, Remark, make
from gen.runtime.errors import InputError
from gen.runtime.output import check_folder, make_folder


def run(
    output: Path,
    remark: Remark,
    *,
    full: bool = False,
    database: Path | None = None,
    comparison: Path | None = None,
    only: Sequence[str] = (),
) -> tuple[Path, Outcome]:
    """Make what is missing, and the page of all that is there.

    Parameters
    ----------
    output : folder of the page; made if there is none
    remark : told how far it is
    full : everything, instead of what fits into ten minutes
    database : of the paper preset; generated into the folder if none is given
    comparison : folder of `learn compare` and `learn tune`; made in the folder if none is given
    only : names of parts; all if none

    Returns
    -------
    The page, and how it went

    Raises
    ------
    InputError
        If a name is unknown, a given file cannot be used or the folder cannot be written to.
    """
    parts = _chosen(only, full=full)
    inputs = _inputs(output, full=full, database=database, comparison=comparison)
    if comparison is not None and not comparison.is_dir():
        raise InputError(f"--comparison {comparison}: give a folder of learn compare or learn tune")
    if comparison is not None:  # it is there, and not ours to add to
        parts = [part for part in parts if inputs.folder(part) != comparison]
    check_folder(output, PAGE)
    make_folder(output)
    if any("{database}" in (part.full if full else part.quick) for part in parts):
        _find_database(output, database, remark, full=full)
    outcome = make(parts, inputs, remark, lambda: write_page(PARTS, inputs))
    return write_page(PARTS, inputs), outcome


def page(
    output: Path,
    *,
    full: bool = False,
    database: Path | None = None,
    comparison: Path | None = None,
) -> Path:
    """Write the page of what a folder holds, and make nothing.

    Raises
    ------
    InputError
        If there is no such folder, or it cannot be written to.
    """
    if not output.is_dir():
        raise InputError(f"{output} is not a folder; `python -m bench run -o {output}` makes one")
    inputs = _inputs(output, full=full, database=database, comparison=comparison)
    return write_page(PARTS, inputs)


def _inputs(output: Path, *, full: bool, database: Path | None, comparison: Path | None) -> Inputs:
    return Inputs(
        output=output,
        database=database or output / DATABASE,
        comparison=comparison or output / COMPARISON,
        full=full,
    )


def _chosen(only: Sequence[str], *, full: bool) -> list[Part]:
    names = {part.name: part for part in PARTS}
    for name in only:
        if name not in names:
            raise InputError(f"--only {name}: give one of {', '.join(names)}")
        if not full and not names[name].quick:
            raise InputError(f"--only {name}: takes long, and needs --full")
    return [part for part in PARTS if not only or part.name in only]


def _find_database(output: Path, given: Path | None, remark: Remark, *, full: bool) -> None:
    """Check the database that was given, or generate what is missing in our own."""
    from bench.databases import of_the_paper
    from gen.scene import load

    rows = load("paper").samples if full else ROWS
    of_the_paper(given, (output / DATABASE).parent, rows, remark)
