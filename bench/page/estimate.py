"""The time that a run is going to take, by the records of earlier runs."""

from collections.abc import Sequence

from bench.circumstances import RESULTS
from bench.files import read_toml
from bench.page.inputs import Inputs
from bench.page.parts import Part
from bench.page.record import read


def seconds(part: Part, inputs: Inputs) -> float | None:
    """Return the time that a part took [s]: here, by the same command, else where it was measured.

    Full runs have records among the published results, short ones a table of their own. None where
    neither knows the part.
    """
    making = inputs.making(part)
    here = read(making.path)
    if here is not None and here.finished and here.command == making.command:
        return here.seconds
    if not inputs.full:
        measured: dict[str, float] = read_toml("page/short")["seconds"]
        return measured.get(part.name)
    folder = part.folder or part.name
    there = read(RESULTS / folder / f"{part.name}.part.json")
    return there.seconds if there is not None and there.seconds else None


def told(time: float | None) -> str:
    """Say a time in a few characters."""
    if time is None:
        return "not known"
    return f"{time:.0f} s" if time < 100 else f"{time / 60:.0f} min"


def plan(parts: Sequence[Part], inputs: Inputs, kept: Sequence[bool]) -> str:
    """List the parts of a run with their times, those that stay as they are, and the sum."""
    times = [seconds(part, inputs) for part in parts]
    lines = [
        f"{part.name:24} {'is there' if stays else told(time):>9}  {part.title}"
        for part, time, stays in zip(parts, times, kept, strict=True)
    ]
    left = [time for time, stays in zip(times, kept, strict=True) if not stays]
    known = sum(time for time in left if time is not None)
    unknown = sum(time is None for time in left)
    more = f" and {unknown} of an unknown time" if unknown else ""
    lines.append(f"{len(left)} parts to make: {told(known)} by earlier records{more}")
    return "\n".join(lines)
