"""Where results come from: versions of packages, and the checkout's commit."""

import importlib.metadata
import platform
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path


def versions(packages: Iterable[str]) -> dict[str, str]:
    """Versions of Python and of those packages that are installed.

    Read from package lists, nothing is imported.
    """
    found = {"python": platform.python_version()}
    for name in packages:
        with suppress(importlib.metadata.PackageNotFoundError):
            found[name] = importlib.metadata.version(name)
    return found


def git_commit() -> str:
    """Commit of the checkout that this code runs from, "" if it is none.

    Read from git's files: starting a process from an MPI rank is unsafe on some interconnects.
    """
    git = Path(__file__).resolve().parents[1] / ".git"
    try:
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
