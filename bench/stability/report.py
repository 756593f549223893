"""The command: runs the tables that are asked for, prints them, writes them."""

from collections.abc import Sequence
from importlib import import_module
from pathlib import Path

from bench.stability.sheet import Sheet
from gen.runtime.errors import InputError
from gen.runtime.output import check_folder

TABLES = ("solver", "loads", "surfaces", "models")
"""Tables by the name of their package, in the order of their printing."""


def report(folder: Path | None = None, *, full: bool = False, of: Sequence[str] = ()) -> bool:
    """Run tables, print them, and write a CSV file of each where a folder is given.

    Parameters
    ----------
    folder : to write into, made where there is none
    full : the slow cases too
    of : names of `TABLES`, none for all

    Returns
    -------
    Whether every case passed

    Raises
    ------
    InputError
        if there is no such table, or the folder cannot be written to, before anything is run
    """
    unknown = [name for name in of if name not in TABLES]
    if unknown:
        raise InputError(f"--of {unknown[0]!r}: give one of {', '.join(TABLES)}")
    if folder is not None:
        check_folder(folder)
    passed = True
    for name in TABLES:
        if of and name not in of:
            continue
        table = sheet(name)
        results = table.results(full=full)
        table.show(results)
        if folder is not None:
            table.write(folder, results)
        passed &= all(result.passed for result in results)
    return passed


def sheet(name: str) -> Sheet:
    """A table by its name; what the others need is not imported."""
    found: Sheet = import_module(f"bench.stability.{name}.sheet").SHEET
    return found
