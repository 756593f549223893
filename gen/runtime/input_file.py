"""Input files: regular ones only, since reading pipes and devices may never end."""

import stat
from pathlib import Path

from gen.runtime.errors import InputError

KINDS = {
    stat.S_IFIFO: "a pipe",
    stat.S_IFSOCK: "a socket",
    stat.S_IFCHR: "a device",
    stat.S_IFBLK: "a device",
}
"""Kinds of paths that are neither files nor folders."""


def require_file(path: Path) -> Path:
    """Refuse pipes, sockets and devices, which could block their reader for ever.

    Every reader of a file that a user names calls this before opening it. Folders and missing
    files pass, since the reader's own message says more.

    Parameters
    ----------
    path : Path
        File, or a link to it.

    Returns
    -------
    Path
        The same path.

    Raises
    ------
    InputError
        If the path is neither a file nor a folder.
    """
    try:
        kind = KINDS.get(stat.S_IFMT(path.stat().st_mode))
    except (OSError, ValueError):  # a null character in the path
        return path
    if kind:
        raise InputError(f"{path} is {kind}; give a file on a disk, as pipes cannot be read twice")
    return path
