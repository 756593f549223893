"""How many contacts a second: surrogates, called in several ways, beside the solver."""

import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

import bem
from bench import databases
from bench.report import Report, remark
from bench.surrogates.fitting import request_for
from bench.surrogates.times import (
    DELTAS,
    LOADS,
    SIDE,
    Contacts,
    ladder_seconds,
    mean_seconds,
    median_seconds,
    new_contacts,
)
from bench.table import markdown
from learn.executor import Executor
from learn.features import SETS
from learn.surrogate import Surrogate
from learn.surrogate.model import OnSurface
from learn.surrogate.prediction import Rows
from learn.surrogate.training import fit

MODEL = "kernel-ridge"  # model that is fitted where no surrogate is given
BATCH = 10_000  # displacements, or rows of statistics, of one call
LAW = 40  # displacements of a law's table (`python -m learn law`)
HYBRID_BATCH = 200  # the same for features that press the surface at each displacement

WAYS: dict[str, dict[str, Any]] = {
    "with intervals and flags": {},
    "without": {"level": None, "reasons": False},
}


def throughput(surrogates: Mapping[str, Surrogate], surfaces: int) -> list[dict[str, Any]]:
    """Time a contact by the solver, and by each surrogate in every way to ask for it [s].

    The times are means over surfaces of the paper preset.
    """
    contacts = new_contacts(surfaces)
    remark(f"the solver on {surfaces} surfaces")
    single = mean_seconds(partial(bem.solve, each, SIDE, delta) for each, delta in contacts)
    timed = [
        ("bem.solve", "a surface and a displacement", single),
        ("bem.ladder", f"{LOADS} displacements on a surface", ladder_seconds(contacts)),
    ]
    for name, surrogate in surrogates.items():
        remark(name)
        timed += [(name, *rest) for rest in _surrogate(surrogate, contacts)]
    return [
        {"what": what, "how": how, "seconds": seconds, "solves": single / seconds}
        for what, how, seconds in timed
    ]


def fitted(given: Path | None, rows: int) -> dict[str, Surrogate]:
    """Fit kernel ridge with each feature set, to the same training rows as far as there are.

    A database of the paper preset is given, or generated with these rows and not kept.
    """
    surrogates = {}
    with tempfile.TemporaryDirectory() as folder:
        path = databases.of_the_paper(given, Path(folder), rows)
        for features in SETS:
            request = request_for(path, MODEL, features, area_max=None)
            request = replace(request, train_rows=rows if given else None)
            surrogate = fit(request, Executor(), remark)
            assert surrogate is not None
            surrogates[f"{MODEL}, {features}"] = surrogate
    return surrogates


def loaded(paths: Sequence[Path]) -> dict[str, Surrogate]:
    """Read surrogates from files; raise InputError if one is no surrogate."""
    return {path.name: Surrogate.load(path) for path in paths}


def report(rows: Sequence[dict[str, Any]]) -> Report:
    """Make a report of what was measured."""
    return Report({"throughput": rows}, text=markdown_table(rows))


def markdown_table(rows: Sequence[dict[str, Any]]) -> str:
    """Return lines of Markdown, numbers with three digits and no exponent."""
    lines = []
    for row in rows:
        numbers = 1e6 * row["seconds"], 1 / row["seconds"], row["solves"]
        texts = (f"{n:.3g}" if n < 1000 else f"{float(f'{n:.3g}'):,.0f}" for n in numbers)
        lines.append((row["what"], row["how"], *texts))
    header = ("what", "how", "us a contact", "contacts a second", "in the time of a solve")
    return markdown(header, lines)


def _surrogate(surrogate: Surrogate, contacts: Contacts) -> Iterator[tuple[str, float]]:
    """Time every way to call one: new surfaces, a surface that is known, rows of statistics."""
    calls = (partial(surrogate.predict, heights, SIDE, 10.0) for heights, _ in contacts)
    yield "a new surface, one displacement", mean_seconds(calls)
    known = surrogate.for_surface(contacts[0][0], SIDE)
    known.predict(10.0)
    most = HYBRID_BATCH if surrogate.features.needs_surface else BATCH
    for count, counted in ((1, "1 displacement"), (most, f"{most:,} displacements")):
        deltas = np.linspace(*DELTAS, count)
        for words, options in WAYS.items():
            seconds = median_seconds(partial(known.predict, deltas, **options)) / count
            yield f"for_surface, {counted}, {words}", seconds
    rows = _many(known)
    for words, options in WAYS.items():
        seconds = median_seconds(partial(surrogate.predict_rows, rows, **options)) / BATCH
        yield f"{BATCH:,} rows of features, {words}", seconds
    deltas = np.linspace(*DELTAS, LAW)
    law = known.predict(deltas, level=None).values[next(iter(surrogate.learnt))]
    asked = np.linspace(*DELTAS, BATCH)
    seconds = median_seconds(partial(np.interp, asked, deltas, law)) / BATCH
    yield f"its law, a table of {LAW} displacements, interpolated", seconds


def _many(known: OnSurface) -> Rows:
    """Return rows whose features are there: all that is left is the model."""
    few = known.rows(np.linspace(*DELTAS, 50))
    return few._replace(
        inputs=np.resize(few.inputs, (BATCH, few.inputs.shape[1])),
        statistics=np.resize(few.statistics, (BATCH, few.statistics.shape[1])),
        delta=np.resize(few.delta, BATCH),
    )
