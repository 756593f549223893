"""How a part was made: written beside its files once it is finished."""

import json
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field

from bench.circumstances import circumstances
from bench.page.inputs import Inputs, typed
from bench.page.part import Part
from gen.runtime import documents, output

SAME = ("commit", "versions", "machine")
"""What has to be as it was for a part to stay."""


class Machine(documents.Document):
    """Where a part was made; see `bench.circumstances`."""

    processor: str


class Record(documents.Document):
    """What a part's record has to hold: see `write`."""

    command: str
    code: Annotated[int, Field(ge=-64, le=255)]
    finished: bool
    seconds: Annotated[float, Field(ge=0, le=1e15)]
    told: list[str]
    inputs: dict[str, int]
    created: str
    commit: str
    machine: Machine
    versions: dict[str, str]


def record(part: Part, inputs: Inputs) -> dict[str, Any] | None:
    """How a part was made; None if it was not.

    Raises
    ------
    InputError
        If the record cannot be read.
    """
    return documents.read(path_of(part, inputs), Record)


def path_of(part: Part, inputs: Inputs) -> Path:
    """Where the record is."""
    return inputs.folder(part) / f"{part.name}.part.json"


def stays(part: Part, inputs: Inputs, found: dict[str, Any] | None) -> bool:
    """Whether a part need not be made: it is there, and made in the same way.

    A short run also leaves alone what a full one has made.
    """
    if found is None or not found["finished"]:
        return False
    if not inputs.full and found["command"] == inputs.full_command(part) != _command(part, inputs):
        return True
    now = circumstances()
    return bool(
        found["command"] == _command(part, inputs)
        and found["inputs"] == inputs.stamps(part)
        and all(found[name] == now[name] for name in SAME)
    )


def write(part: Part, inputs: Inputs, code: int, seconds: float, told: list[str]) -> dict[str, Any]:
    """Write down how a part was made, under the record's name only once it is whole."""
    crashed = any(line.startswith("Traceback") for line in told)
    found = {
        "command": _command(part, inputs),
        "code": code,
        "finished": code == 0 or (code == 1 and part.judges and not crashed),
        "seconds": round(seconds, 1),
        "told": told[-5:],
        "inputs": inputs.stamps(part),
        **circumstances(),
    }
    path = path_of(part, inputs)
    output.write(path, json.dumps(found, indent=2) + "\n")
    return found


def _command(part: Part, inputs: Inputs) -> str:
    return typed(inputs.arguments(part))
