"""Files that commands read: regular ones, which end, and which nobody has to write to first."""

import stat
from pathlib import Path

from gen.runtime.errors import InputError

KINDS = {
    stat.S_IFIFO: "a pipe",
    stat.S_IFSOCK: "a socket",
    stat.S_IFCHR: "a device",
    stat.S_IFBLK: "a device",
}
"""What is no regular file, nor a folder."""


def require_file(path: Path) -> Path:
    """Refuse what could block its reader for ever: pipes, sockets and devices.

    Every reader of a file that a user names calls this before it opens the file. Folders, and paths
    at which nothing stands, pass: whoever opens them can say more.

    Parameters
    ----------
    path : the file; a link stands for what it leads to

    Returns
    -------
    The path

    Raises
    ------
    InputError
        If something else than a file or a folder stands there.
    """
    try:
        kind = KINDS.get(stat.S_IFMT(path.stat().st_mode))
    except (OSError, ValueError):  # a null character in the path
        return path
    if kind:
        raise InputError(f"{path} is {kind}; give a file on a disk, as pipes cannot be read twice")
    return path
