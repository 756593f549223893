"""Databases as a stranger could craft them: refused before a column is touched."""

import time
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from gen.database import create
from gen.scene import Scene

SCENE = "samples = 24\n[surface]\nnodes = 9\n"
COLUMN = "force"
VICTIM = b"precious" * 64

Crafting = Callable[[h5py.File, Path], None]


def prepare(folder: Path) -> dict[str, Path]:
    """Write the scene, the victim and all crafted databases; return their paths by name."""
    (folder / "scene.toml").write_text(SCENE)
    (folder / "longer.toml").write_text(SCENE.replace("24", "30"))
    (folder / "victim").write_bytes(VICTIM)
    whole = folder / "whole.h5"
    create(whole, Scene.parse(SCENE, "scene"))
    content = whole.read_bytes()
    paths = {}
    for name, (craft, _) in CRAFTED.items():
        paths[name] = folder / f"{name}.h5"
        paths[name].write_bytes(content)
        with h5py.File(paths[name], "r+", libver=("v108", "v110"), locking=False) as file:
            craft(file, folder)
    return paths


def made(**options: Any) -> Crafting:
    """A column made anew in another way."""

    def craft(file: h5py.File, folder: Path) -> None:
        rows = len(file[COLUMN])
        del file[COLUMN]
        file.create_dataset(COLUMN, **{"shape": (rows,), "dtype": "f8", **options})

    return craft


def put(content: Callable[[h5py.File, Path], Any], name: str = COLUMN) -> Crafting:
    """Something else in the place of a column or a group."""

    def craft(file: h5py.File, folder: Path) -> None:
        found = content(file, folder)
        del file[name]
        file[name] = found

    return craft


def external(file: h5py.File, folder: Path) -> None:
    made(external=[(str(folder / "victim"), 0, 24 * 8)])(file, folder)


def virtual(file: h5py.File, folder: Path) -> None:
    layout = h5py.VirtualLayout(shape=(24,), dtype="f8")
    layout[:] = h5py.VirtualSource(str(folder / "whole.h5"), "delta", shape=(24,))
    del file[COLUMN]
    file.create_virtual_dataset(COLUMN, layout)


def named_type(file: h5py.File, folder: Path) -> None:
    file["double"] = np.dtype("f8")
    made(dtype=file["double"])(file, folder)


def huge(file: h5py.File, folder: Path) -> None:
    """Declare 1e9 rows, in columns that never took their place."""
    scene = Scene.parse(SCENE.replace("24", "1000000000"), "scene")
    for name, value in (("scene", scene.text()), ("scene_hash", scene.fingerprint())):
        set_text(file, name, value)
    file.attrs.modify("samples", scene.samples)
    found: list[str] = []
    file.visititems(
        lambda name, node: found.append(name) if "long_name" in node.attrs else None
    )
    for name in found:
        kind = file[name].dtype
        del file[name]
        file.create_dataset(name, shape=(scene.samples,), dtype=kind)


def set_text(file: h5py.File, name: str, value: str) -> None:
    data = value.encode()
    del file.attrs[name]
    file.attrs.create(name, data, dtype=h5py.string_dtype("utf-8", len(data)))


def attribute(name: str, value: object = None) -> Crafting:
    """An attribute with another value, or none."""

    def craft(file: h5py.File, folder: Path) -> None:
        del file.attrs[name]
        if value is not None:
            file.attrs[name] = value

    return craft


def versions(text: str) -> Crafting:
    return lambda file, folder: set_text(file, "versions", text)


CRAFTED: dict[str, tuple[Crafting, str]] = {
    "external": (external, "another file"),
    "external-link": (
        put(lambda _, folder: h5py.ExternalLink(str(folder / "whole.h5"), f"/{COLUMN}")),
        "link",
    ),
    "soft-link": (put(lambda *_: h5py.SoftLink("/delta")), "link"),
    "linked-group": (put(lambda *_: h5py.SoftLink("/elsewhere"), "runtime"), "link"),
    "same-dataset": (put(lambda file, _: file["delta"]), "on top of"),
    "virtual": (virtual, "virtual"),
    "chunked": (made(chunks=(8,)), "chunks"),
    "wrong-type": (made(dtype="f4"), "type f8"),
    "named-type": (named_type, "type f8"),
    "wrong-shape": (made(shape=(25,)), "(24,)"),
    "no-data": (made(shape=None), "(24,)"),
    "group": (put(lambda file, _: file.create_group("made")), COLUMN),
    "type": (put(lambda *_: np.dtype("f8")), COLUMN),
    "no-group": (put(lambda *_: np.zeros(24), "runtime"), "runtime/"),
    "never-allocated": (made(), "do not fit"),
    "huge": (huge, "1000000000 rows"),
    **{
        f"no-{name}": (attribute(name), f"lacks the attribute '{name}'")
        for name in ("title", "versions", "physics_forced", "scene_hash")
    },
    "text-in-a-heap": (attribute("title", "of variable length"), "'title'"),
    "number-for-a-text": (attribute("title", 3), "'title'"),
    "text-for-a-number": (attribute("physics", np.bytes_("4")), "'physics'"),
    "other-rows": (attribute("samples", 23), "not the one that it was made with"),
    "versions-list": (versions("[]"), "is damaged"),
    "versions-deep": (versions("[" * 60_000), "is damaged"),
}
"""What is crafted, and a word of the refusal."""

KINDS = (
    *("external", "external-link", "soft-link", "virtual", "chunked", "wrong-type"),
    *("named-type", "wrong-shape", "group", "type", "huge", "no-title", "no-versions"),
)
"""One of each kind: commands that open databases in one and the same way need no more."""

COMMANDS: dict[str, list[str]] = {
    "gen run": ["run", "scene.toml", "-o", "FILE"],
    "gen extend": ["run", "longer.toml", "-o", "FILE"],
    "gen info": ["info", "FILE"],
    "gen check": ["check", "FILE"],
    "gen merge": ["merge", "FILE", "-o", "merged.h5"],
    "gen merge with": ["merge", "whole.h5", "FILE", "-o", "merged.h5"],
    "gen plot": ["plot", "FILE", "-o", "plot.png"],
    "learn fit": ["fit", "FILE", "-o", "new.surrogate"],
    "learn compare": ["compare", "FILE", "-o", "new"],
    "learn tune": ["tune", "FILE", "-o", "new"],
    "learn importance": ["importance", "FILE", "-o", "new"],
    "learn law": ["law", "FILE", "--solver", "--csv", "law.csv"],
}
"""Every command that reads databases; `learn law` needs a surrogate, x.surrogate, as well."""


def refuse(
    main: Callable[[list[str]], int], command: str, names: Iterable[str], capsys: Any
) -> None:
    """Ask a command for crafted files in this folder: one line, code 2, nothing changed."""
    before = contents()
    for name in names:
        file, word = f"{name}.h5", CRAFTED[name][1]
        began = time.process_time()
        assert (
            main([file if each == "FILE" else each for each in COMMANDS[command]]) == 2
        ), name
        assert time.process_time() - began < 60, name
        said = capsys.readouterr().err
        assert said.count("\n") == 1, said
        assert file in said, said
        assert word in said, said
    assert contents() == before
    assert before["victim"] == VICTIM


def contents() -> dict[str, bytes]:
    """All files of this folder."""
    return {str(path): path.read_bytes() for path in Path().rglob("*") if path.is_file()}
