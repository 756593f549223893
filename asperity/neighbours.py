"""Make sure that `import gen` finds Asperity's package, not another one of the same name.

The names `bem`, `gen`, `learn` and `bench` are short. A folder or a file of the user's, or another
distribution, may have the same name and stand first where Python looks for modules.
"""

import sys
from importlib.util import find_spec
from itertools import pairwise
from pathlib import Path

HOME = Path(__file__).resolve().parents[1]
"""Folder that holds Asperity's packages: a clone, or where a wheel was installed."""

MARK = "Asperity"
"""Word in the docstring of each of the packages."""

OWN_NAMES = {"bem"}
"""Packages from whose `__init__.py` our other packages import names. From the rest they import
modules, which an editable install finds beside a folder of the same name without `__init__.py`; the
packages of a wheel go before such folders.
"""


def fault(*packages: str) -> str:
    """Say in one line which package is not Asperity's, and what helps; "" if all of them are.

    Parameters
    ----------
    *packages : str
        Names of packages of Asperity. None of them is imported.
    """
    return next(filter(None, map(_fault_of, packages)), "")


def _fault_of(name: str) -> str:
    """Say why `import` would find another package, "" if it finds Asperity's."""
    ours, found = HOME / name / "__init__.py", _found(name)
    if not ours.is_file():
        return f"the package {name} is missing from {HOME}: install Asperity again"
    if found == ours:
        if MARK in ours.read_text(encoding="utf-8", errors="replace"):
            return ""
        return (
            f"{ours} is not Asperity's: another distribution has written its own package {name}"
            " over it; install Asperity into an environment of its own"
        )
    if found is None and name not in OWN_NAMES:
        return ""
    place = found or f"a folder {name} without __init__.py"
    return (
        f"`import {name}` finds {place} before Asperity's package in {ours.parent}: rename that"
        f" {name}, take its folder out of PYTHONPATH, or work in another folder"
    )


def require(importing: str, *packages: str) -> None:
    """Refuse to import a package whose neighbours are not Asperity's.

    Parameters
    ----------
    importing : str
        Name of the package that needs the others.
    *packages : str
        Names of the packages that it needs.

    Raises
    ------
    ImportError
        With one line that names the other package. Where the importing package is being started as
        a program (`python -m learn`), the line is printed and the program ends with code 2.
    """
    line = fault(*packages)
    if not line:
        return
    if ("-m", importing) in pairwise(sys.orig_argv):
        sys.stderr.write(f"{importing}: {line}\n")
        raise SystemExit(2)
    raise ImportError(f"{importing}: {line}", name=importing)


def _found(name: str) -> Path | None:
    """Return the file that `import` would run, None for a folder without one."""
    try:
        spec = find_spec(name)
    except ValueError:  # a module that somebody has made by hand and put into sys.modules
        return None
    return Path(spec.origin).resolve() if spec is not None and spec.origin else None
