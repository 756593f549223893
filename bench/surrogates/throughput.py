"""How many contacts a second: surrogates, called in several ways, beside the solver."""

import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import astuple, dataclass, fields
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import bem
from bench.page.content import Content, Table
from bench.surrogates import databases
from bench.surrogates.clock import mean_seconds, median_seconds
from bench.surrogates.costs import LOADS
from bench.surrogates.databases import OTHER_SEED
from bench.table import write_table
from gen.arrays import Heights
from gen.generation.plan import parameters
from gen.generation.sample import surface_of
from gen.scene import Scene, load
from learn.executor import Executor
from learn.features import SETS, chosen
from learn.request import Request
from learn.surrogate import Surrogate
from learn.surrogate.model import OnSurface
from learn.surrogate.training import fit

Values = NDArray[np.float64]

BATCH = 10_000
"""Displacements, or rows of statistics, of one call."""

LAW = 40
"""Displacements of a law's table (`python -m learn law`)."""

PRESSED_BATCH = 200
"""The same for features that press the surface at each displacement."""


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
    """Time solver and surrogates.

    Parameters
    ----------
    surrogates : by the name that the table calls them
    surfaces : number of surfaces of the paper preset that the times are means over
    remark : told how far it is

    Returns
    -------
    The solver's lines first
    """
    scene = load("paper").model_copy(update={"seed": OTHER_SEED})
    plan = parameters(scene, 0, surfaces)
    heights = [surface_of(scene, plan, row) for row in range(surfaces)]
    remark(f"the solver on {surfaces} surfaces")
    timed = list(_solver(heights, plan.delta.tolist(), scene))
    solve = timed[0][2]
    for name, surrogate in surrogates.items():
        remark(name)
        timed += [(name, *rest) for rest in _surrogate(surrogate, heights, scene.surface.side)]
    return [Speed(what, how, seconds, solve / seconds) for what, how, seconds in timed]


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
        path = databases.of_the_paper(given, Path(folder), rows, remark)
        found = {}
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
            found[f"{model}, {features}"] = surrogate
    return found


def loaded(paths: Sequence[Path]) -> dict[str, Surrogate]:
    """Read surrogates from files.

    Raises
    ------
    InputError
        If one is no surrogate.
    """
    return {path.name: Surrogate.load(path) for path in paths}


def markdown_table(speeds: Sequence[Speed]) -> str:
    """Lines of Markdown."""
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


def write_report(folder: Path, speeds: Sequence[Speed]) -> Path:
    """Write `throughput.csv`.

    Raises
    ------
    InputError
        If the folder cannot be written to.
    """
    header = [field.name for field in fields(Speed)]
    return write_table(folder / "throughput.csv", header, map(astuple, speeds))


def contents(folder: Path) -> list[Content]:
    """List what a page shows of a folder that `write_report` has written."""
    return [
        Table(
            folder / "throughput.csv",
            "Processor time of one contact, by surrogates called singly and in batches and by the"
            " solver; `solves` is how many of them fit into the time of one solve.",
        )
    ]


def _solver(
    heights: Sequence[Heights], deltas: Sequence[float], scene: Scene
) -> Iterator[tuple[str, str, float]]:
    side, loads = scene.surface.side, np.linspace(5.0, 45.0, LOADS)
    pairs = zip(heights, deltas, strict=True)
    single = mean_seconds(partial(bem.solve, each, side, delta) for each, delta in pairs)
    ladder = mean_seconds(partial(_ladder, each, side, loads) for each in heights) / loads.size
    yield "bem.solve", "a surface and a displacement", single
    yield "bem.ladder", f"{loads.size} displacements on a surface", ladder


def _ladder(heights: Heights, side: float, deltas: Values) -> None:
    for _ in bem.ladder(heights, side, deltas):
        pass


def _surrogate(
    surrogate: Surrogate, heights: Sequence[Heights], side: float
) -> Iterator[tuple[str, float]]:
    """Every way to call one: new surfaces, a surface that is known, rows of statistics."""
    new = partial(surrogate.predict, side=side, delta=10.0)
    yield "a new surface, one displacement", mean_seconds(partial(new, each) for each in heights)
    known = surrogate.for_surface(heights[0], side)
    known.predict(10.0)
    most = PRESSED_BATCH if surrogate.features.needs_surface else BATCH
    for count in (1, most):
        deltas = np.linspace(5.0, 45.0, count)
        for words, options in WAYS.items():
            seconds = median_seconds(partial(known.predict, deltas, **options)) / count
            yield f"for_surface, {_displacements(count)}, {words}", seconds
    yield from _rows(surrogate, known)
    deltas = np.linspace(5.0, 45.0, LAW)
    law = known.predict(deltas, level=None).values[next(iter(surrogate.learnt))]
    asked = np.linspace(5.0, 45.0, BATCH)
    seconds = median_seconds(partial(np.interp, asked, deltas, law)) / BATCH
    yield f"its law, a table of {LAW} displacements, interpolated", seconds


WAYS: dict[str, dict[str, Any]] = {
    "with intervals and flags": {},
    "without": {"level": None, "reasons": False},
}


def _rows(surrogate: Surrogate, known: OnSurface) -> Iterator[tuple[str, float]]:
    """Rows whose features are there: all that is left is the model."""
    few = known.rows(np.linspace(5.0, 45.0, 50))
    rows = few._replace(
        inputs=np.resize(few.inputs, (BATCH, few.inputs.shape[1])),
        statistics=np.resize(few.statistics, (BATCH, few.statistics.shape[1])),
        delta=np.resize(few.delta, BATCH),
    )
    for words, options in WAYS.items():
        seconds = median_seconds(partial(surrogate.predict_rows, rows, **options)) / BATCH
        yield f"{BATCH:,} rows of features, {words}", seconds


def _displacements(count: int) -> str:
    return "1 displacement" if count == 1 else f"{count:,} displacements"
