"""The installation: its versions, its commit, and the command that adds a missing package.

No command names asperity: a package index may have somebody else's package under that name.
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
"""File beside this module with the commit that an installed package was built from."""

REPOSITORY = Path(__file__).resolve().parents[2]
"""Folder of the packages; it has a pyproject.toml if it is a clone."""


def versions(packages: Iterable[str]) -> dict[str, str]:
    """Return the versions of Python and of packages, without importing them.

    Parameters
    ----------
    packages : iterable of str
        Names of distributions, such as "scikit-learn".

    Returns
    -------
    dict of str to str
        Version of "python", and by its name that of each package that is installed. "asperity" is
        always among the latter if it is named.
    """
    installed = {"python": platform.python_version()}
    for name in packages:
        if name == "asperity":  # a clone may be newer than its installation
            installed[name] = VERSION
            continue
        with suppress(importlib.metadata.PackageNotFoundError):
            installed[name] = importlib.metadata.version(name)
    return installed


def git_commit() -> str:
    """Return the commit that this code is checked out at or was built from, "" if it is unknown.

    Git's files are read, because starting git from a process of MPI is unsafe. A version file that
    setuptools writes would not do: a clone that is installed editably moves on without being
    installed again.
    """
    git = REPOSITORY / ".git"
    try:
        if not git.exists():
            return Path(__file__).with_name(STAMP).read_text(encoding="utf-8").strip()
        return _checked_out(git)
    except OSError:
        return ""


def _checked_out(git: Path) -> str:
    """Return the commit that a clone is at, "" if it is unknown; OSError without git's files.

    `git` is the folder ".git", or the file of that name that a linked work tree has.
    """
    if git.is_file():
        folder = git.read_text().removeprefix("gitdir:").strip()
        git = (git.parent / folder).resolve()
    head = (git / "HEAD").read_text().strip()
    if not head.startswith("ref: "):
        return head
    reference = head.removeprefix("ref: ")
    if (
        git / "commondir"
    ).exists():  # branches of a linked work tree are the main clone's
        git = (git / (git / "commondir").read_text().strip()).resolve()
    if (git / reference).exists():
        return (git / reference).read_text().strip()
    for line in (git / "packed-refs").read_text().splitlines():
        commit, _, name = line.partition(" ")
        if name == reference:
            return commit
    return ""


def command_for(extra: str) -> str:
    """Return the command that installs an extra, for a message.

    Parameters
    ----------
    extra : str
        Name of an extra in pyproject.toml, such as "plot".

    Returns
    -------
    str
        A command of pip for a clone; otherwise words, as it is unknown where the package is from.
    """
    if not (REPOSITORY / "pyproject.toml").is_file():
        return f"install Asperity again, with its extra {extra!r}"
    pip = [sys.executable, "-m", "pip"]
    if shutil.which("pip") == str(Path(sys.executable).with_name("pip")):
        pip = ["pip"]
    return shlex.join([*pip, "install", "-e", f"{REPOSITORY}[{extra}]"])
