"""Surrogates' files that are damaged, or changed by somebody who computes the checksum anew.

`whole` makes a small surrogate of any kind, `damaged` and `crafted` make a file of another out of
it by a number alone, and `verdict` says what became of loading it and asking it. Run as a script,
it judges many in a process of its own: `judged` starts it, and says which file ended it.
"""

import hashlib
import io
import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import redirect_stdout
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
DATABASE = ROOT / "examples" / "sample.h5"
SILENCE = 30.0
"""Seconds after which a file counts as one that hangs."""

FEW: dict[str, dict[str, Any]] = {
    "decision-tree": {"max_depth": 5},
    "random-forest": {"n_estimators": 3, "max_depth": 4},
    "adaboost": {"n_estimators": 3},
    "xgboost": {"n_estimators": 3, "max_depth": 4},
    "gradient-boost": {"n_estimators": 3},
    "svm": {"kernel": "rbf"},
    "gaussian-process": {"kernel__length_scale": 10.0, "alpha": 1e-5},
    "kernel-ridge": {"kernel": "rbf", "gamma": 3e-3, "alpha": 1e-4},
    "mlp": {"hidden_layer_sizes": (8, 5), "solver": "lbfgs", "max_iter": 30},
}
"""Settings of small models of all nine kinds."""

SCALINGS = ("standard", "min-max", "none")

ODD = (None, True, "", "x", "inf", -1, 0, 1, 2, 7, 2**31, 10**400, 1e-300, 1e300, float("nan"))
ODD += (float("inf"), float("-inf"), [], {}, [[]], {"array": 0}, {"array": -1}, {"array": 10**9})
ODD += ("mlp", "xgboost", "kernel-ridge", "paper", "hybrid", "rbf", "poly", "l2", "none")
NUMBERS = (np.nan, np.inf, -np.inf, 0.0, -1.0, 1.0, 1e300, -1e300, 1e-300, 1e38, 2.0**31 - 1)
KINDS = ("<f8", "<f4", "<i4", "<i8", "|u1", "<c16", "|S8")


@lru_cache(maxsize=1)
def usable_rows() -> Any:
    from learn import dataset

    return dataset.read(DATABASE, "area", features="dimensionless")


@lru_cache(maxsize=32)
def whole(model: str, scaling: str = "standard") -> bytes:
    """The file of a small surrogate for the area, fitted to the sample's first surfaces."""
    from learn import split
    from learn.request import Request
    from learn.surrogate import Surrogate, card
    from learn.surrogate.fitting import fit_target
    from learn.surrogate.groups import near
    from learn.surrogate.settings import Settings

    request = Request(
        DATABASE, DATABASE, ("area",), (model,), None, scaling, "dimensionless", train_rows=50
    )
    rows = usable_rows()
    parts = split.draw(rows, 0, 50)
    train, held = parts.train[:40], parts.train[40:]
    settings = Settings(FEW[model], False, "given")
    fit = fit_target(request, rows.at(train), rows.at(held), parts.folds[:40], settings=settings)
    judged = card.judge(fit.learnt, rows, parts.test)
    judged |= {"settings": {}, "settings_from": "given", "remarks": []}
    sizes = {"train": train.size, "calibration": held.size, "test": parts.test.size}
    about = card.make(request, rows, train, sizes, {"area": judged})
    inputs = rows.inputs[train]
    low, high, distance = inputs.min(axis=0), inputs.max(axis=0), near(rows.at(train))
    surrogate = Surrogate(about, {"area": fit.learnt}, low, high, distance)
    with tempfile.TemporaryDirectory() as folder:
        surrogate.save(Path(folder) / "x.surrogate")
        return (Path(folder) / "x.surrogate").read_bytes()


def content(file: bytes) -> tuple[dict[str, Any], dict[str, Any]]:
    """Card and parts of a file."""
    from learn.surrogate import storage

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "x.surrogate"
        path.write_bytes(file)
        return storage.load(path)


def written(card: Any, parts: Any) -> bytes:
    """A file with a right checksum, whatever it holds: types that are not kept as well."""
    arrays: list[np.ndarray] = []

    def without(part: Any) -> Any:
        if isinstance(part, dict):
            return {name: without(each) for name, each in part.items()}
        if isinstance(part, list):
            return [without(each) for each in part]
        if isinstance(part, np.ndarray):
            arrays.append(part)
            return {"array": len(arrays) - 1}
        return part

    text: dict[str, Any] = {"card": card, "parts": without(parts)}
    text["arrays"] = [[each.dtype.str, each.shape] for each in arrays]
    return sealed(padded(json.dumps(text).encode(), b" "), arrays)


def padded(data: bytes, filler: bytes) -> bytes:
    return data + filler * (-len(data) % 8)


def sealed(text: bytes, arrays: list[np.ndarray]) -> bytes:
    body = len(text).to_bytes(8, "little") + text
    return signed(body + b"".join(padded(each.tobytes(), b"\0") for each in arrays))


def signed(body: bytes) -> bytes:
    """A file of this format with a right checksum."""
    digest = hashlib.sha256(body).hexdigest()
    return b"asperity surrogate\nformat 7\nsha256 " + digest.encode() + b"\n" + body


def damaged(file: bytes, number: int) -> bytes:
    """Bytes flipped, removed, inserted, doubled or cut off; never the file itself."""
    random = np.random.default_rng([1, number])
    spoilt = bytearray(file)
    head = len(file) if random.random() < 0.8 else 120
    for _ in range(random.integers(1, 4)):
        place, how = int(random.integers(min(head, len(spoilt)))), random.integers(5)
        if how <= 1:
            spoilt[place] ^= int(random.integers(1, 256))
        elif how == 2:
            del spoilt[place : place + int(random.integers(1, 40))]
        elif how == 3:
            spoilt[place:place] = random.bytes(int(random.integers(1, 40)))
        else:
            del spoilt[place:]
            spoilt += file[place + 1 :] if random.random() < 0.5 else b""
    return bytes(spoilt)


def crafted(file: bytes, number: int) -> bytes:
    """Something else in a place or two, and the checksum computed anew."""
    random = np.random.default_rng([2, number])
    if random.random() < 0.2:  # bytes of the text, of the table of arrays, of the arrays
        body = bytearray(file[file.index(b"\n", 40) + 1 :])
        end = len(body) if random.random() < 0.5 else int.from_bytes(body[:8], "little")
        for _ in range(random.integers(1, 4)):
            body[int(random.integers(end))] ^= int(random.integers(1, 256))
        return signed(bytes(body))
    card, parts = content(file)
    both = {"card": card, "parts": parts}
    for _ in range(random.integers(1, 3)):
        spots = list(places(both))
        about = "parts" if random.random() < 0.7 else "card"
        owner, key = pick(random, [spot[1:] for spot in spots if spot[0] == about])
        change(random, owner, key)
        if not isinstance(both["card"], dict) or not isinstance(both["parts"], dict):
            break
    return written(both["card"], both["parts"])


def places(both: dict[str, Any]) -> Iterator[tuple[str, Any, Any]]:
    """Everything that can be changed: card or parts, who holds it, by which key."""
    for about, part in both.items():
        waiting = [part]
        while waiting:
            owner = waiting.pop()
            keys = owner if isinstance(owner, dict) else range(len(owner))
            for key in keys:
                yield about, owner, key
                if isinstance(owner[key], dict | list):
                    waiting.append(owner[key])


def pick(random: np.random.Generator, among: Any) -> Any:
    return among[int(random.integers(len(among)))]


def change(random: np.random.Generator, owner: Any, key: Any) -> None:
    """Change one thing."""
    if isinstance(owner[key], np.ndarray) and random.random() < 0.85:
        owner[key] = other_array(random, owner[key])
    elif random.random() < 0.15:
        del owner[key]
    elif random.random() < 0.1 and isinstance(owner, list):
        owner.append(owner[key])
    else:
        owner[key] = pick(random, ODD)


def other_array(random: np.random.Generator, array: np.ndarray) -> np.ndarray:
    """An array with other entries, of another size, shape or type."""
    how, size = random.integers(8), array.size
    flat = array.reshape(-1).copy()
    if how <= 2 and size:
        with np.errstate(all="ignore"):
            some = random.integers(size, size=pick(random, (1, 1, size)))
            values = np.array(pick(random, NUMBERS))
            if array.dtype.kind == "i":
                values = pick(random, (-2, -1, 0, 1, size - 1, size, 2**31 - 1, -(2**31)))
            flat[some] = np.asarray(values).astype(array.dtype)
        return flat.reshape(array.shape)
    if how == 3 and size:
        first, second = random.integers(size, size=2)
        flat[[first, second]] = flat[[second, first]]
        return flat.reshape(array.shape)
    if how == 4:
        return array[: int(random.integers(len(array) + 1))]
    if how == 5:
        return np.concatenate([array, array])
    if how == 6:
        return array.reshape(pick(random, ((-1, 1), (1, -1), (-1,), (1, 1, -1))))
    content = array.tobytes()
    return np.frombuffer(content[: len(content) // 16 * 16], dtype=pick(random, KINDS))


@lru_cache(maxsize=1)
def question() -> tuple[Any, Any]:
    """Statistics and Delta of three rows that training has seen or not."""
    described = usable_rows().described[[0, 50, 150]]
    return described[:, 1:], described[:, 0]


def verdict(path: Path) -> dict[str, Any]:
    """What becomes of a file: a line that refuses it, or values and whether each is inside."""
    from gen.runtime.errors import InputError
    from learn.surrogate import Surrogate, card

    try:
        surrogate = Surrogate.load(path)
        statistics, delta = question()
        rows = surrogate.of_statistics(statistics, delta, 1000.0)
        found = surrogate.predict_rows(rows, std=True)
        with redirect_stdout(io.StringIO()):
            card.show(surrogate)
    except InputError as error:
        return {"refused": str(error)}
    values = [list(map(float, each)) for each in found.values.values()]
    return {"values": values, "inside": found.inside.tolist()}


def mutant(model: str, scaling: str, way: str, number: int) -> bytes:
    """A file, by its name."""
    return {"damaged": damaged, "crafted": crafted}[way](whole(model, scaling), number)


def judged(
    names: list[tuple[str, str, str, int]], silence: float = SILENCE
) -> list[tuple[tuple[str, str, str, int], dict[str, Any]]]:
    """Judge files in a process of its own; one that ends it, or does not end, has no verdict.

    Parameters
    ----------
    names : arguments of `mutant`
    silence : seconds after which a file counts as one that hangs

    Returns
    -------
    For each file its name and verdict: `verdict`'s, {"ended": signal or code}, {"hangs": seconds},
    or {"raised": error}
    """
    found: list[tuple[tuple[str, str, str, int], dict[str, Any]]] = []
    while len(found) < len(names):
        left = names[len(found) :]
        with tempfile.TemporaryDirectory() as folder:
            said = Path(folder) / "said"
            said.touch()
            with subprocess.Popen(
                [sys.executable, "-W", "error", __file__, folder], cwd=ROOT, stdin=subprocess.PIPE
            ) as child:
                assert child.stdin is not None
                child.stdin.write(json.dumps(left).encode())
                child.stdin.close()
                why = watched(child, said, silence)
            lines = said.read_text().splitlines()
        found += [(name, json.loads(line)) for name, line in zip(left, lines, strict=False)]
        if len(lines) < len(left):
            found.append((left[len(lines)], why))
    return found


def watched(child: subprocess.Popen, said: Path, silence: float) -> dict[str, Any]:
    """Wait for a process that writes lines; end it when it has been silent for too long."""
    size, since = 0, time.monotonic()
    while child.poll() is None:
        if said.stat().st_size != size:
            size, since = said.stat().st_size, time.monotonic()
        if time.monotonic() - since > silence:
            child.kill()
            child.wait()
            return {"hangs": silence}
        time.sleep(0.05)
    return {"ended": child.returncode}


def main(folder: Path) -> None:
    """Judge the files that stand on the standard input, a line each."""
    path = folder / "x.surrogate"
    with (folder / "said").open("w", buffering=1) as said:
        for name in json.load(sys.stdin):
            path.write_bytes(mutant(*name))
            try:
                found = verdict(path)
            except Exception as error:  # what no file may do
                found = {"raised": f"{type(error).__name__}: {error}"}
            said.write(json.dumps(found) + "\n")


if __name__ == "__main__":
    import os

    for library in ("OMP", "OPENBLAS", "MKL"):
        os.environ[f"{library}_NUM_THREADS"] = "1"
    sys.path.insert(0, str(ROOT))
    main(Path(sys.argv[1]))
