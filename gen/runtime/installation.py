"""Tell versions and commit of this installation, and how to install a missing package.

No printed command installs a package by the name asperity, because a package index may have
somebody else's package under this name.
"""

import importlib.metadata
import platform
import shlex
import shutil
import sys
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path

from gen.runtime import VERSION

STAMP = "commit.txt"
"""File in the folder of this module, with the commit that an installed package was built from."""

REPOSITORY = Path(__file__).resolve().parents[2]
"""Folder that contains `gen`: a clone of the repository, or a folder of installed packages."""


def versions(packages: Iterable[str]) -> dict[str, str]:
    """Find the versions of Python and of some packages, without importing them.

    Parameters
    ----------
    packages : iterable of str
        Names of distributions, such as "scikit-learn".

    Returns
    -------
    dict of str to str
        Versions by name: that of "python", and that of each package that is installed. Packages
        that are not installed are left out, except that "asperity" counts as installed.
    """
    installed = {"python": platform.python_version()}
    for name in packages:
        if name == "asperity":  # the metadata of a clone may be older than its code
            installed[name] = VERSION
            continue
        with suppress(importlib.metadata.PackageNotFoundError):
            installed[name] = importlib.metadata.version(name)
    return installed


def git_commit() -> str:
    """Return the commit that this code is checked out at, or was built from.

    In a clone, the files of git are read, because starting git from a process of MPI is unsafe. A
    file that is written at the installation, as `STAMP`, would be out of date there: an editable
    clone changes without being installed again.

    Returns
    -------
    str
        Hexadecimal digits, or "" if the commit is unknown.
    """
    git = REPOSITORY / ".git"
    try:
        if not git.exists():
            return Path(__file__).with_name(STAMP).read_text(encoding="utf-8").strip()
        return _checked_out(git)
    except OSError:
        return ""


def _checked_out(git: Path) -> str:
    """Return the commit that a clone has checked out, "" if it is unknown.

    `git` is the folder ".git" of the clone, or the file ".git" that a linked work tree has instead.
    Raises OSError if git's files cannot be read.
    """
    if git.is_file():
        folder = git.read_text().removeprefix("gitdir:").strip()
        git = (git.parent / folder).resolve()
    head = (git / "HEAD").read_text().strip()
    if not head.startswith("ref: "):  # no branch is checked out
        return head
    reference = head.removeprefix("ref: ")
    # The main clone has the branches of a linked work tree.
    common = git / "commondir"
    if common.exists():
        git = (git / common.read_text().strip()).resolve()
    if (git / reference).exists():
        return (git / reference).read_text().strip()
    for line in (git / "packed-refs").read_text().splitlines():
        commit, _, name = line.partition(" ")
        if name == reference:
            return commit
    return ""


def command_for(extra: str) -> str:
    """Say in a message how to install an extra of this package.

    Parameters
    ----------
    extra : str
        Name of an extra in pyproject.toml, such as "plot".

    Returns
    -------
    str
        In a clone, the command of pip that installs its folder with the extra. Otherwise a clause,
        because it is unknown where the package was installed from.
    """
    if not (REPOSITORY / "pyproject.toml").is_file():
        return f"install Asperity again, with its extra {extra!r}"
    pip = [sys.executable, "-m", "pip"]
    pip_of_this_python = str(Path(sys.executable).with_name("pip"))
    # The short command, if it is that of this Python.
    if shutil.which("pip") == pip_of_this_python:
        pip = ["pip"]
    return shlex.join([*pip, "install", "-e", f"{REPOSITORY}[{extra}]"])
