"""Where results come from: the versions of packages and the commit of the checkout."""

import importlib.metadata
import platform
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path

from gen.runtime.version import VERSION

STAMP = "commit.txt"
"""File beside this module with the commit that an installed package was built from."""


def versions(packages: Iterable[str]) -> dict[str, str]:
    """Return the versions of Python and of installed packages without importing them.

    Parameters
    ----------
    packages : iterable of str
        Names of packages in the package index; those that are not installed are left out.

    Returns
    -------
    dict of str
        Version of each package by its name.
    """
    installed = {"python": platform.python_version()}
    for name in packages:
        with suppress(importlib.metadata.PackageNotFoundError):
            own = name == "asperity"
            installed[name] = VERSION if own else importlib.metadata.version(name)
    return installed


def git_commit() -> str:
    """Return the commit of the checkout that this code runs from or was built from, "" without one.

    It is read from git's files, since starting a process from an MPI rank is unsafe on some
    interconnects.
    """
    git = Path(__file__).resolve().parents[2] / ".git"
    try:
        if not git.exists():
            return Path(__file__).with_name(STAMP).read_text(encoding="utf-8").strip()
        if git.is_file():  # a linked work tree
            git = (git.parent / git.read_text().removeprefix("gitdir:").strip()).resolve()
        head = (git / "HEAD").read_text().strip()
        if not head.startswith("ref: "):
            return head
        if (git / "commondir").exists():
            git = (git / (git / "commondir").read_text().strip()).resolve()
        reference = head.removeprefix("ref: ")
        if (git / reference).exists():
            return (git / reference).read_text().strip()
        packed = (line.partition(" ") for line in (git / "packed-refs").read_text().splitlines())
        return next((commit for commit, _, name in packed if name == reference), "")
    except OSError:
        return ""
