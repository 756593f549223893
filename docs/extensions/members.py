"""Members of public classes that their pages of the manual list.

Fields are described by the docstring of their class. What a class has from another library, such as
pydantic's methods, is left out.
"""

import importlib
import inspect
import re
from pathlib import Path

HOUSE = frozenset(("asperity", "bem", "gen", "learn"))
"""Packages whose members are listed."""

BLOCK = re.compile(r"^\.\. currentmodule:: (\S+)$(.*?)^```$", re.DOTALL | re.MULTILINE)


def public_names(page: str) -> list[str]:
    """Return the full names of the functions and classes that a page of the interface lists."""
    names = []
    for module, block in BLOCK.findall(page):
        listed = re.findall(r"^   ([A-Za-z]\S*)$", block, flags=re.MULTILINE)
        names += [f"{module}.{name}" for name in listed]
    return names


def class_of(full_name: str) -> type | None:
    """Import what has a name; None if it is no class."""
    module_name, _, name = full_name.rpartition(".")
    member = getattr(importlib.import_module(module_name), name)
    return member if inspect.isclass(member) else None


def documented(cls: type) -> dict[str, list[str]]:
    """Return the names of the public methods and properties of a class, in alphabetical order."""
    methods = []
    attributes = []
    for name in dir(cls):
        member = inspect.getattr_static(cls, name)
        if (
            name.startswith("_")
            or not _is_of_house(cls, name)
            or not inspect.getdoc(member)
        ):
            continue
        value = getattr(cls, name)
        if inspect.isfunction(value) or inspect.ismethod(value):
            methods.append(name)
        elif hasattr(member, "__get__"):
            attributes.append(name)
    return {"methods": methods, "attributes": attributes}


def _is_of_house(cls: type, name: str) -> bool:
    """Return whether a class that has a member itself is one of the house."""
    homes = [home for home in cls.__mro__ if name in vars(home)]
    return bool(homes) and homes[0].__module__.partition(".")[0] in HOUSE


def documented_members(folder: Path) -> dict[str, dict[str, list[str]]]:
    """Return the members of all classes that the pages in a folder list, by their full names."""
    members = {}
    for page in sorted(folder.glob("*.md")):
        for full_name in public_names(page.read_text(encoding="utf-8")):
            cls = class_of(full_name)
            if cls is not None:
                members[full_name] = documented(cls)
    return members
