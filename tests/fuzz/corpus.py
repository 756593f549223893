"""Sound files, made by the commands themselves, and what is done to them once they are damaged."""

import json
import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from gen.runtime.errors import InputError
from tests.fuzz.child import run

SCENE = """title = "Sound"
samples = 60
samples_per_surface = 2
seed = 7
[surface]
nodes = 9
hurst = [0.5, 0.8]
sigma0 = [10.0, 15.0]
[delta]
pieces = [{ share = 1.0, range = [5.0, 45.0] }]
[contact]
kernel = "uniform-pressure"
max_iterations = 1000
[store]
mean_gap = true
"""

PATIENCE = 300.0
"""Seconds that a command may take while the sound files are made."""

Command = tuple[str, ...]


@dataclass(frozen=True)
class Kind:
    """Patterns of files to damage, commands for them (VICTIM), and what these need beside."""

    victims: tuple[str, ...]
    commands: tuple[Command, ...]
    beside: tuple[str, ...] = ()


LEARN = ("--model", "decision-tree", "--target", "area")
SURFACE = ("surface.npy", "--side", "100")

KINDS: dict[str, Kind] = {
    "scene": Kind(
        ("scene.toml",),
        (
            ("gen", "run", "VICTIM", "-o", "new.h5", "--dry-run"),
            ("gen", "run", "VICTIM", "-o", "new.h5", "--rows", "0:2"),
            ("gen", "run", "VICTIM", "-o", "rows.h5"),
            ("gen", "estimate", "VICTIM"),
        ),
        ("rows.h5",),
    ),
    "database": Kind(
        ("rows.h5", "fields.h5"),
        (
            ("gen", "info", "VICTIM"),
            ("gen", "check", "VICTIM", "--recompute", "2"),
            ("gen", "plot", "VICTIM", "-o", "new.png"),
            ("gen", "merge", "VICTIM", "-o", "new.h5"),
            ("gen", "run", "scene.toml", "-o", "VICTIM"),
            ("gen", "run", "scene.toml", "-o", "VICTIM", "--retry-failed"),
            ("gen", "run", "longer.toml", "-o", "VICTIM"),
            ("learn", "fit", "VICTIM", "-o", "new.surrogate", *LEARN),
            ("learn", "compare", "VICTIM", "-o", "new", *LEARN),
            (
                "learn",
                "law",
                "tree.surrogate",
                "VICTIM",
                "--delta",
                "5:10:3",
                "--surfaces",
                "2",
            ),
        ),
        ("scene.toml", "longer.toml", "tree.surrogate"),
    ),
    "surrogate": Kind(
        ("tree.surrogate", "ridge.surrogate", "boosted.surrogate"),
        (
            ("learn", "card", "VICTIM"),
            ("learn", "predict", "VICTIM", *SURFACE, "--delta", "1,2", "-o", "new.csv"),
            ("learn", "law", "VICTIM", *SURFACE, "--delta", "1:9:3", "--header", "new.h"),
            ("learn", "fit", "rows.h5", "-o", "VICTIM", *LEARN),
        ),
        ("surface.npy", "rows.h5"),
    ),
    "surface": Kind(
        ("surface.npy", "surface.txt"),
        (
            ("gen", "describe", "VICTIM", "--side", "100"),
            (
                "gen",
                "contact",
                "VICTIM",
                "--side",
                "100",
                "--delta",
                "1",
                "--csv",
                "new.csv",
            ),
            (
                "gen",
                "contact",
                "VICTIM",
                "--side",
                "100",
                "--pressure",
                "0:0.1:3",
                "--fill",
            ),
            (
                "gen",
                "describe",
                "VICTIM",
                "--side",
                "100",
                "--against",
                "VICTIM",
                "--shift",
                "9,0",
            ),
            (
                "learn",
                "predict",
                "tree.surrogate",
                "VICTIM",
                "--side",
                "100",
                "--delta",
                "1",
            ),
        ),
        ("tree.surrogate",),
    ),
    "comparison": Kind(
        ("found/area/comparison.json", "found/area/*/*.json*", "found/area/*/*-tree.csv"),
        (
            ("learn", "show", "found", "--no-pictures"),
            ("learn", "show", "found"),
            ("learn", "fit", "rows.h5", "-o", "new.surrogate", "--from", "found", *LEARN),
            ("learn", "compare", "rows.h5", "-o", "found", *LEARN),
            ("learn", "tune", "rows.h5", "-o", "found", "--budget", "1s", *LEARN),
            ("learn", "importance", "rows.h5", "-o", "found", *LEARN),
        ),
        ("found", "rows.h5"),
    ),
    "page": Kind(
        ("page/hertz/*.json", "page/hertz/*.csv"), (("bench", "page", "page"),), ("page",)
    ),
}

MADE: tuple[Command, ...] = (
    ("gen", "run", "scene.toml", "-o", "rows.h5"),
    ("gen", "run", "fields.toml", "-o", "fields.h5", "--rows", "0:4"),
    ("learn", "fit", "rows.h5", "-o", "tree.surrogate", "--model", "decision-tree"),
    ("learn", "fit", "rows.h5", "-o", "ridge.surrogate", "--model", "kernel-ridge"),
    ("learn", "fit", "rows.h5", "-o", "boosted.surrogate", "--model", "xgboost"),
    ("learn", "compare", "rows.h5", "-o", "found", *LEARN),
    ("learn", "tune", "rows.h5", "-o", "found", "--budget", "2s", *LEARN),
    ("bench", "run", "hertz", "-o", "page"),
)
"""The commands that make the sound files, in this order."""


def make(folder: Path, kinds: tuple[str, ...] = tuple(KINDS)) -> None:
    """Write the sound files of some kinds into an empty folder, by the commands that make them."""
    fields = (
        SCENE.replace("samples = 60", "samples = 6") + "heights = true\npressure = true\n"
    )
    (folder / "scene.toml").write_text(SCENE, encoding="utf-8")
    (folder / "longer.toml").write_text(SCENE.replace("60", "64"), encoding="utf-8")
    (folder / "fields.toml").write_text(fields, encoding="utf-8")
    heights = np.random.default_rng(3).normal(size=(9, 9))
    np.save(folder / "surface.npy", heights)
    np.savetxt(folder / "surface.txt", heights, fmt="%.4f")
    needed = (name for kind in kinds for name in KINDS[kind].victims + KINDS[kind].beside)
    wanted = {"rows.h5", *(name.partition("/")[0] for name in needed)}
    for command in MADE:
        if command[command.index("-o") + 1] in wanted:
            ended = run(command, folder, PATIENCE, memory=None)
            if ended.code:
                raise InputError(f"{' '.join(command)} fails: {ended.errors.strip()}")


Random = np.random.Generator
Mutator = Callable[[bytes, Random], bytes]

MOST = 4
"""Mutations of one file at most: more would hide each other."""

ODD: tuple[Any, ...] = (
    *(None, True, False, [], {}, [[]], [None], {"": None}, float("nan"), float("inf")),
    *(0, -1, 1, 2**31, 2**63, 10**30, 10**400, 0.5, -0.0, 1e-320, 1e308, 4097, 10**9),
    *(
        "",
        "x",
        "\x1b[31mred",
        "\x00",
        "é" * 300,
        "=1+1",
        "../../x",
        "9" * 5000,
        "nan",
        "\udcff",
    ),
)
"""Values that stand in for others."""

INTERESTING = (
    0,
    1,
    0x7F,
    0x80,
    0xFF,
    0x7FFF,
    0xFFFF,
    2**31 - 1,
    2**32 - 1,
    2**63 - 1,
    2**64 - 1,
)
"""Numbers at which types end."""

WORD = re.compile(rb"[A-Za-z_][A-Za-z0-9_/.]{3,31}")
NUMBER = re.compile(rb"-?\d+(\.\d+)?([eE][-+]?\d+)?")


def flipped(data: bytes, random: Random) -> bytes:
    """Flip one bit."""
    place = int(random.integers(len(data)))
    return (
        data[:place]
        + bytes([data[place] ^ 1 << int(random.integers(8))])
        + data[place + 1 :]
    )


def overwritten(data: bytes, random: Random) -> bytes:
    """Write a number at which a type ends over one, two, four or eight bytes."""
    length, place = int(random.choice((1, 2, 4, 8))), int(random.integers(len(data)))
    value = INTERESTING[int(random.integers(len(INTERESTING)))] % (1 << 8 * length)
    return data[:place] + value.to_bytes(length, "little") + data[place + length :]


def linked(data: bytes, random: Random) -> bytes:
    """Copy eight bytes over eight others: in HDF5, an address over another, or a length."""
    source, target = (
        8 * int(place) for place in random.integers(-(-len(data) // 8), size=2)
    )
    return data[:target] + data[source : source + 8] + data[target + 8 :]


def renamed(data: bytes, random: Random) -> bytes:
    """Write the beginning of one name that stands in the file over another."""
    words = list(WORD.finditer(data))
    if len(words) < 2:
        return flipped(data, random)
    one, other = (
        words[int(place)] for place in random.choice(len(words), 2, replace=False)
    )
    name = other[0][: len(one[0])].ljust(len(one[0]), b"_")
    return data[: one.start()] + name + data[one.end() :]


def cut(data: bytes, random: Random) -> bytes:
    """Lose the end."""
    return data[: int(random.integers(len(data)))]


def shifted(data: bytes, random: Random) -> bytes:
    """Lose a piece in the midst, have it twice, or have zeros in its place."""
    start = int(random.integers(len(data)))
    stop = min(len(data), start + int(random.integers(1, 65)))
    middle = (b"", 2 * data[start:stop], bytes(stop - start))[int(random.integers(3))]
    return data[:start] + middle + data[stop:]


def renumbered(data: bytes, random: Random) -> bytes:
    """Have an odd text in place of a number."""
    numbers = list(NUMBER.finditer(data))
    if not numbers:
        return shifted(data, random)
    found = numbers[int(random.integers(len(numbers)))]
    return data[: found.start()] + _text(random) + data[found.end() :]


def relined(data: bytes, random: Random) -> bytes:
    """Lose a line, have it twice, or have an odd value after its equals sign or comma."""
    lines = data.split(b"\n")
    place = int(random.integers(len(lines)))
    name, sign, _ = lines[place].partition(b"=" if b"=" in lines[place] else b",")
    odd = name + sign + b" " + _text(random)
    lines[place : place + 1] = ([], 2 * [lines[place]], [odd])[int(random.integers(3))]
    return b"\n".join(lines)


def restructured(data: bytes, random: Random) -> bytes:
    """Change one value of a JSON document: another type, missing, renamed, nested, too deep."""
    try:
        document = json.loads(data)
    except (ValueError, RecursionError):
        return shifted(data, random)
    places = list(_places(document))
    if not places:
        return data + b" "
    parent, key = places[int(random.integers(len(places)))]
    how = int(random.integers(6))
    if how == 0:
        del parent[key]
    elif how == 1 and isinstance(parent, dict):
        parent[str(key) + "_"] = parent.pop(key)
    elif how == 2:
        parent[key] = [parent[key]]
    else:
        parent[key] = "deep" if how == 3 else ODD[int(random.integers(len(ODD)))]
    return json.dumps(document).replace('"deep"', "[" * 3000 + "]" * 3000).encode()


BYTES: tuple[Mutator, ...] = (flipped, overwritten, cut, shifted)
BY_ENDING: dict[str, tuple[Mutator, ...]] = {
    ".h5": (*BYTES, linked, linked, renamed, renamed, renumbered),
    ".json": (restructured, restructured, restructured, renumbered, *BYTES),
    ".toml": (relined, relined, renumbered, renumbered, renamed, *BYTES),
    ".npy": (renumbered, renamed, *BYTES),
    **dict.fromkeys((".jsonl", ".csv", ".txt"), (relined, renumbered, renamed, *BYTES)),
}
"""What is done to a file, by the ending of its name; to others, bytes are changed."""


def damaged(data: bytes, name: str, random: Random) -> bytes:
    """Damage the content of a file with a name; `random` decides everything."""
    mutators = BY_ENDING.get(name[name.rfind(".") :], BYTES)
    for _ in range(int(random.integers(1, MOST + 1))):
        if data:
            data = mutators[int(random.integers(len(mutators)))](data, random)
    return data


def _text(random: Random) -> bytes:
    """An odd value as a text."""
    value = ODD[int(random.integers(len(ODD)))]
    text = value if isinstance(value, str) else json.dumps(value)
    return text.encode(errors="surrogatepass")


def _places(document: Any) -> Any:
    """Every container of a document with each of its keys."""
    keys = document.keys() if isinstance(document, dict) else range(len(document))
    for key in list(keys):
        yield document, key
        if isinstance(document[key], dict | list):
            yield from _places(document[key])
