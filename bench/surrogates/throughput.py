"""How many contacts a second: surrogates, called in several ways, beside the solver."""

import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

import bem
from bench import databases
from bench.page.content import Content, Table
from bench.report import Report
from bench.surrogates.answer_times import DELTAS, LOADS, NewSurfaces, ladder_seconds, new_surfaces
from bench.surrogates.clock import mean_seconds, median_seconds
from learn.executor import Executor
from learn.features import SETS, chosen
from learn.request import Request
from learn.surrogate import Surrogate
from learn.surrogate.model import OnSurface
from learn.surrogate.training import fit

BATCH = 10_000
"""Displacements, or rows of statistics, of one call."""

LAW = 40
"""Displacements of a law's table (`python -m learn law`)."""

HYBRID_BATCH = 200
"""The same for features that press the surface at each displacement."""

WAYS: dict[str, dict[str, Any]] = {
    "with intervals and flags": {},
    "without": {"level": None, "reasons": False},
}


@dataclass(frozen=True)
class Speed:
    """One way to ask for contacts.

    Attributes
    ----------
    what : is asked
    how : and how
    seconds : processor time of one contact [s]
    solves : contacts in the time of one solve
    """

    what: str
    how: str
    seconds: float
    solves: float


def throughput(
    surrogates: dict[str, Surrogate], surfaces: int, remark: Callable[[str], None]
) -> list[Speed]:
    """Time solver and surrogates; the solver's lines come first.

    Parameters
    ----------
    surrogates : by the name that the table calls them
    surfaces : number of surfaces of the paper preset that the times are means over
    remark : told how far it is
    """
    new = new_surfaces(surfaces)
    remark(f"the solver on {surfaces} surfaces")
    solve = partial(bem.solve, side=new.side)
    single = mean_seconds(partial(solve, heights, delta=delta) for heights, delta in new.contacts)
    timed = [
        ("bem.solve", "a surface and a displacement", single),
        ("bem.ladder", f"{LOADS} displacements on a surface", ladder_seconds(new, LOADS)),
    ]
    for name, surrogate in surrogates.items():
        remark(name)
        timed += [(name, *rest) for rest in _surrogate(surrogate, new)]
    return [Speed(what, how, seconds, single / seconds) for what, how, seconds in timed]


def fitted(
    given: Path | None, rows: int, remark: Callable[[str], None], model: str = "kernel-ridge"
) -> dict[str, Surrogate]:
    """Fit a surrogate with each feature set, of the same training rows as far as there are.

    Parameters
    ----------
    given : database of the paper preset, None to generate one that is not kept
    rows : of the database, or to train on at most
    remark : told about the fits
    model : its name
    """
    with tempfile.TemporaryDirectory() as folder:
        path = databases.of_the_paper(given, Path(folder), rows)
        surrogates = {}
        for features in SETS:
            request = Request(
                database=path,
                output=Path(folder),
                models=(model,),
                features=features,
                normalisation=chosen(features).normalisation,
                train_rows=rows if given else None,
            )
            surrogate = fit(request, Executor(), remark)
            assert surrogate is not None
            surrogates[f"{model}, {features}"] = surrogate
    return surrogates


def loaded(paths: Sequence[Path]) -> dict[str, Surrogate]:
    """Read surrogates from files.

    Raises
    ------
    InputError
        If one is no surrogate.
    """
    return {path.name: Surrogate.load(path) for path in paths}


def report(speeds: Sequence[Speed]) -> Report:
    """Make a report of what was measured."""
    return Report({"throughput": speeds}, text=markdown_table(speeds))


def contents(folder: Path) -> list[Content]:
    """List what a folder of this report holds, with what to see in it."""
    return [
        Table(
            folder / "throughput.csv",
            "Processor time of one contact, by surrogates called singly and in batches and by the"
            " solver; `solves` is how many of them fit into the time of one solve.",
        )
    ]


def markdown_table(speeds: Sequence[Speed]) -> str:
    """Return lines of Markdown."""
    lines = ["| what | how | us a contact | contacts a second | in the time of a solve |"]
    lines.append("|---|---|---|---|---|")
    lines += [
        f"| {each.what} | {each.how} | {_rounded(1e6 * each.seconds)}"
        f" | {_rounded(1 / each.seconds)} | {_rounded(each.solves)} |"
        for each in speeds
    ]
    return "\n".join(lines)


def _rounded(number: float) -> str:
    """Three digits, and no exponent."""
    return f"{number:.3g}" if number < 1000 else f"{float(f'{number:.3g}'):,.0f}"


def _surrogate(surrogate: Surrogate, new: NewSurfaces) -> Iterator[tuple[str, float]]:
    """Time every way to call one: new surfaces, a surface that is known, rows of statistics."""
    unknown = partial(surrogate.predict, side=new.side, delta=10.0)
    calls = (partial(unknown, heights) for heights in new.heights)
    yield "a new surface, one displacement", mean_seconds(calls)
    known = surrogate.for_surface(new.heights[0], new.side)
    known.predict(10.0)
    most = HYBRID_BATCH if surrogate.features.needs_surface else BATCH
    for count, counted in ((1, "1 displacement"), (most, f"{most:,} displacements")):
        deltas = np.linspace(*DELTAS, count)
        for words, options in WAYS.items():
            seconds = median_seconds(partial(known.predict, deltas, **options)) / count
            yield f"for_surface, {counted}, {words}", seconds
    yield from _rows(surrogate, known)
    deltas = np.linspace(*DELTAS, LAW)
    law = known.predict(deltas, level=None).values[next(iter(surrogate.learnt))]
    asked = np.linspace(*DELTAS, BATCH)
    seconds = median_seconds(partial(np.interp, asked, deltas, law)) / BATCH
    yield f"its law, a table of {LAW} displacements, interpolated", seconds


def _rows(surrogate: Surrogate, known: OnSurface) -> Iterator[tuple[str, float]]:
    """Time rows whose features are there: all that is left is the model."""
    few = known.rows(np.linspace(*DELTAS, 50))
    rows = few._replace(
        inputs=np.resize(few.inputs, (BATCH, few.inputs.shape[1])),
        statistics=np.resize(few.statistics, (BATCH, few.statistics.shape[1])),
        delta=np.resize(few.delta, BATCH),
    )
    for words, options in WAYS.items():
        seconds = median_seconds(partial(surrogate.predict_rows, rows, **options)) / BATCH
        yield f"{BATCH:,} rows of features, {words}", seconds
