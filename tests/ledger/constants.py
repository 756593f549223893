"""One number of the solver halved or doubled, to see which counts of the ledger depend on it."""

import importlib
import pkgutil
import sys
from collections.abc import Mapping

import bem
from gen.runtime.errors import InputError
from tests.ledger.counts import Counts, Entry, Key


def multiply_constant(name: str, factor: float) -> str:
    """Multiply a constant of `bem` in this process, wherever its module or another one reads it.

    Solves that ran before may have kept tables of the old value: call it in a fresh process.
    Defaults of parameters keep the old value.

    Parameters
    ----------
    name : str
        Dotted name of the constant, as "bem.active_set.ADVANCE".
    factor : float
        Factor on its value [1]. Whole numbers are rounded, and stay at least 1.

    Returns
    -------
    str
        Name, value before and value after, as a line of text.

    Raises
    ------
    InputError
        If the name is not that of a single number in `bem`.
    """
    for module in pkgutil.walk_packages(bem.__path__, "bem."):
        importlib.import_module(module.name)
    home, _, constant = name.rpartition(".")
    before = getattr(sys.modules.get(home), constant, None)
    if not home.startswith("bem.") or not isinstance(before, int | float):
        raise InputError(
            f"{name} is no number of bem: name one as bem.active_set.ADVANCE"
        )
    after: float = before * factor
    if isinstance(before, int):
        after = max(round(after), 1)
    for place, reader in list(sys.modules.items()):
        if place.startswith("bem.") and getattr(reader, constant, None) is before:
            setattr(reader, constant, after)
    return f"{name} = {after:g} instead of {before:g}"


def largest_change(entries: Mapping[Key, Entry], counts: Counts) -> str:
    """Return the largest relative change of a count, and the count's name, as a line of text."""
    changes = {
        key: count / max(entries[key].value, 1) - 1
        for key, count in counts.items()
        if key in entries
    }
    key = max(changes, key=lambda each: abs(changes[each]))
    return f"largest change: {changes[key]:+.1%} ({key})"
