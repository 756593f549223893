"""The command that installs a missing package into this installation of Asperity.

A package index may not have the name asperity, or somebody else's package under it. So the commands
name this clone, the file or the address that Asperity was installed from, or else the libraries.
"""

import importlib.metadata
import json
import re
import shlex
import shutil
import sys
from pathlib import Path
from urllib.parse import unquote, urlsplit

REPOSITORY = Path(__file__).resolve().parents[2]
"""Folder that holds the packages: a clone if it has a pyproject.toml."""


def command_for(extra: str) -> str:
    """Return the command that installs an extra.

    Parameters
    ----------
    extra : str
        Name of an extra in pyproject.toml.
    """
    beside = Path(sys.executable).with_name("pip")
    pip = ["pip"] if shutil.which("pip") == str(beside) else [sys.executable, "-m", "pip"]
    return shlex.join([*pip, "install", *_packages(extra)])


def _packages(extra: str) -> list[str]:
    """Return the arguments of `pip install`."""
    if (REPOSITORY / "pyproject.toml").is_file():
        return ["-e", f"{REPOSITORY}[{extra}]"]
    try:
        ours = importlib.metadata.distribution("asperity")
    except importlib.metadata.PackageNotFoundError:
        return [f"{REPOSITORY}[{extra}]"]
    origin = json.loads(ours.read_text("direct_url.json") or "{}")
    url = str(origin.get("url", ""))
    local = Path(unquote(urlsplit(url).path))
    if url.startswith("file:"):
        if local.exists():
            return [f"{local}[{extra}]"]
    elif url:
        version = origin.get("vcs_info", {})
        prefix = f"{version['vcs']}+" if version else ""
        commit = f"@{version['commit_id']}" if version else ""
        return [f"asperity[{extra}] @ {prefix}{url}{commit}"]
    return _libraries(ours.requires or [], extra)


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
