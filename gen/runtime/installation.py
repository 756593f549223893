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

REPOSITORY = Path(__file__).resolve().parents[2]  # a clone if it has a pyproject.toml


def versions(packages: Iterable[str]) -> dict[str, str]:
    """Return the versions of Python and of the installed ones among packages, without imports."""
    installed = {"python": platform.python_version()}
    for name in packages:
        with suppress(importlib.metadata.PackageNotFoundError):
            own = name == "asperity"
            installed[name] = VERSION if own else importlib.metadata.version(name)
    return installed


def git_commit() -> str:
    """Return the commit that this code runs from or was built from, "" without one."""
    git = REPOSITORY / ".git"  # read, as starting a process from an MPI rank is unsafe
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
        packed = (
            line.partition(" ") for line in (git / "packed-refs").read_text().splitlines()
        )
        return next((commit for commit, _, name in packed if name == reference), "")
    except OSError:
        return ""


def command_for(extra: str) -> str:
    """Return how an extra of pyproject.toml is installed."""
    if not (REPOSITORY / "pyproject.toml").is_file():
        return f"install Asperity again, with its extra {extra!r}"
    beside = Path(sys.executable).with_name("pip")
    pip = ["pip"] if shutil.which("pip") == str(beside) else [sys.executable, "-m", "pip"]
    return shlex.join([*pip, "install", "-e", f"{REPOSITORY}[{extra}]"])
