"""The installation: its versions, its commit, and the command that adds a missing package.

A package index may not have the name asperity, or somebody else's package under it. So the commands
name this clone or the libraries.
"""

import importlib.metadata
import platform
import re
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
"""Folder that holds the packages: a clone if it has a pyproject.toml."""


def versions(packages: Iterable[str]) -> dict[str, str]:
    """Return the versions of Python and of the installed ones among packages, without imports."""
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
    git = REPOSITORY / ".git"
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


def command_for(extra: str) -> str:
    """Return the command that installs an extra of pyproject.toml."""
    beside = Path(sys.executable).with_name("pip")
    pip = ["pip"] if shutil.which("pip") == str(beside) else [sys.executable, "-m", "pip"]
    return shlex.join([*pip, "install", *_packages(extra)])


def _packages(extra: str) -> list[str]:
    """Return the arguments of `pip install`: this clone, or else the libraries of the extra."""
    if (REPOSITORY / "pyproject.toml").is_file():
        return ["-e", f"{REPOSITORY}[{extra}]"]
    try:
        requirements = importlib.metadata.requires("asperity") or []
    except importlib.metadata.PackageNotFoundError:
        return [f"{REPOSITORY}[{extra}]"]
    return _libraries(requirements, extra)


def _libraries(requirements: list[str], extra: str) -> list[str]:
    """Return the libraries of an extra that this system needs, with their versions."""
    libraries = []
    for requirement in requirements:
        library, _, marker = requirement.partition(";")
        if not re.search(rf"""extra == ["']{extra}["']""", marker):
            continue
        system = re.search(r"""sys_platform ([!=]=) ["'](\w+)["']""", marker)
        if system is None or (sys.platform == system[2]) == (system[1] == "=="):
            libraries.append(library.strip())
    return libraries
