"""The loop of a growth: look, generate the rows of the next size, and look again; then its report.

The processes of the run compute the rows, as many as the time allows, and the master writes them.
"""

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from gen import database
from gen.arrays import Columns
from gen.database import Reader, Writer
from gen.generation.completion import completed
from gen.generation.run import blocks_of
from gen.generation.sample import compute_rows
from gen.generation.trial import doubts_before
from gen.runtime import farm
from gen.runtime.errors import InputError
from gen.runtime.figure import draw_parity, log_axis, parity_axes
from gen.runtime.terminal import RunProgress, command_to_type, echo, print_columns
from gen.scene import Scene, differences
from gen.schema import Status
from learn import dataset
from learn.database_rows import Dataset
from learn.dataset import TARGETS, Request, results, short_name
from learn.executor import Ended, Executor, within
from learn.features.scene import SCENE
from learn.grow.accuracy import (
    EXPONENTS,
    POINTS,
    RISK,
    Accuracy,
    Curve,
    Look,
    advise,
    judge,
    parted,
    size,
    size_with,
)
from learn.metrics import LEVEL
from learn.split import Split, require_tiles
from learn.surrogate import fitting
from learn.surrogate.model import Surrogate

GROWTH = 2.0  # exponent with which the time of a look grows with the rows

WORTH = 0.05
"""Rows of a round over those that there are, at least, if the budget is to be spent on them."""

EARLIEST = (
    7  # number of the smallest size at which a growth gives up by its learning curve
)
PATIENT = (
    4  # number of the size from which on rows that are too few for a fit are an error
)

Ending = Literal["met", "budget", "rows", "hopeless", "interrupted"]

COLOUR, MARK = "tab:blue", "tab:red"

WORDS: dict[Ending, str] = {
    "met": "The mark is met",
    "budget": "The budget is used up before the mark is met",
    "rows": "The allowed rows are used up before the mark is met",
    "hopeless": "The mark is out of reach of this model with these features",
}
"""Why a growth has ended, if no signal has come."""


def stock(path: Path) -> tuple[int, int, float]:
    """Count a database's rows before the first one that is pending, and all; it may not exist yet.

    The time that the finished ones took comes third, surfaces included [s]. A part is refused.
    """
    if not path.exists():
        return 0, 0, 0.0
    with Reader(path) as reader:
        if reader.rows != range(reader.scene.samples):
            raise InputError(
                f"{path}: is a part: {command_to_type('gen merge')} makes it whole"
            )
        status = reader.column("status")
        seconds = reader.column("solve_seconds") + reader.column("surface_seconds")
    pending = np.flatnonzero(status == Status.PENDING)
    finished = int(pending[0]) if pending.size else len(status)
    return finished, len(status), float(np.nansum(seconds[status != Status.PENDING]))


@dataclass
class Growth:
    """A growth of a database, which is all its state, and of the surrogate of its rows."""

    request: Request
    mark: float  # largest nMAE of every target that is asked for [%]
    most: int  # rows of the database at most
    scene: Scene
    executor: Executor  # computes rows and features
    say: Callable[[str], None]  # called with lines for the user
    stopping: Callable[[], bool] = lambda: False  # asked between rows
    until: float = math.inf  # time of `time.time` at which the budget ends [s]
    row: float = (
        0.0  # time in which all workers together make one row, 0 if not known [s]
    )
    seen: tuple[int, float] = (1, 0.0)  # rows of the last look, and its time [s]
    # Errors of all looks, by the rows of the database and the target.
    errors: dict[int, dict[str, Accuracy]] = field(default_factory=dict)

    def grow(self) -> tuple[Ending, Look | None]:
        """Grow until the surrogate is as accurate as asked for.

        Return why it ends, and the last surrogate with its errors. The same call goes on after a
        stop or a kill. InputError is raised if the input cannot be used, or the budget is too small
        for a first surrogate.
        """
        (path,), most, per_surface = (
            self.request.databases,
            self.most,
            self.scene.samples_per_surface,
        )
        whole = completed(self.scene, path.parent, rehearsed=True)
        with database.lock(path):
            _refuse_others(self.request, whole)
            for doubt in doubts_before(whole, most):
                self.say(f"warning: {doubt}")
            wanted = max(stock(path)[1], min(size(0, per_surface), most))
            last = None
            while True:
                rows = self.generate(whole, wanted)
                began, found, fault = time.time(), None, "no fit has ended"
                if last is not None and rows == last.rows and not self.stopping():
                    return "budget", last  # it does not suffice for another row
                try:
                    if not self.stopping():
                        found = self.look(rows)
                except InputError as error:
                    if last is not None or rows >= min(most, size(PATIENT, per_surface)):
                        raise
                    fault = str(error)
                last, self.seen = found or last, (max(rows, 1), time.time() - began)
                ending = self._ending(rows, last)
                if last is None and ending == "budget":
                    raise InputError(
                        f"the budget sufficed for {rows} rows, but for no surrogate ({fault}); the"
                        " same command goes on"
                    )
                if ending is not None:
                    return ending, last
                if last is None:
                    self.say(f"{rows} rows are too few: {fault}")
                wanted = min(size(size_with(rows + 1, per_surface), per_surface), most)

    def _ending(self, rows: int, last: Look | None) -> Ending | None:
        """Return why a growth ends after a look, None if it goes on."""
        if self.stopping():
            return "interrupted"
        if last is not None and last.met:
            return "met"
        if last is not None and rows >= self.most:
            return "rows"
        if last is not None and last.advice is not None and math.isinf(last.advice):
            # The mark is out of reach for the curve; at first only if it is for the steepest one.
            error = last.judged[last.worst].accuracy.nmae
            steepest = error * (rows / self.most) ** EXPONENTS[1]
            if steepest > self.mark or last.number >= EARLIEST:
                return "hopeless"
        return None if self.suffices(rows, max(WORTH * rows, 1.0)) else "budget"

    def look(self, rows: int) -> Look | None:
        """Fit a surrogate to the finished rows, judge it and save it; None after a stop.

        Its errors join those of the looks before. InputError is raised if there are too few rows to
        fit or to judge.
        """
        request = self.request
        sets = dataset.read(request, self.executor, self.stopping, common=True)
        if not sets:
            return None
        require_tiles(sets[0])
        sets = [each.at(np.flatnonzero(each.rows < rows)) for each in sets]
        parts = parted(sets, request.seed)
        done = within(_fitted, (request, sets, parts), None, self.until)
        if isinstance(done, Ended):
            return None
        surrogate, lines = done
        for line in lines:
            self.say(line)
        judged = {
            target: judge(surrogate.learnt[target], each.at(parts.test))
            for target, each in zip(request.targets, sets, strict=True)
        }
        number = size_with(rows, self.scene.samples_per_surface)
        found = Look(rows, number, self.mark, surrogate, judged, parts)
        surrogate.card["grown"] = {
            "mark": self.mark,
            "met": found.met,
            "rows": rows,
            "errors": {name: each.accuracy.error for name, each in judged.items()},
            "bounds": {name: found.bound(name) for name in judged},
        }
        surrogate.save(request.output)
        self.errors[rows] = {name: each.accuracy for name, each in judged.items()}
        if len(self.errors) >= POINTS:
            nmae = np.array([each[found.worst].nmae for each in self.errors.values()])
            curve = Curve(np.array([*self.errors], dtype=float), nmae)
            advice = None if found.met else advise(found, curve, self.most, sets[0])
            found = replace(found, curve=curve, advice=advice)
        self.say(found.in_words())
        return found

    def suffices(self, rows: int, more: float) -> bool:
        """Tell whether the budget suffices for more rows than some, and for the look after them."""
        seen, seconds = self.seen
        look = seconds * math.pow(max((rows + more) / seen, 1.0), GROWTH)
        return self.until - time.time() - look >= more * self.row

    def generate(self, scene: Scene, rows: int) -> int:
        """Give the database a number of rows at least, or make it; return how many are finished.

        The caller holds `gen.database.lock`. The scene is one from
        `gen.generation.sample.completed`, whose number of samples does not count. A stop, or a
        kill, leaves a database that the same call goes on with. InputError is raised if the file is
        of another scene, or cannot be written.
        """
        (path,), wider = (
            self.request.databases,
            scene.model_copy(update={"samples": rows}),
        )
        (before, _, seconds), workers = stock(path), self.executor.world.workers
        if before and not self.row:
            self.row = seconds / before / workers
        if before >= rows:
            return before
        database.open_or_create(path, wider)
        scene.surface.make_ready(path.parent)
        with Writer(path, wider) as writer:
            pending = writer.pending()
            todo = sum(map(len, pending))
            with RunProgress(todo, "rows") as progress:
                progress.say(f"{path}: {todo} new rows, {before} there")
                made, began = 0, time.time()

                def take(block: range, columns: Columns) -> None:
                    nonlocal made
                    writer.write_block(block.start, block.stop, columns)
                    made += len(block)
                    self.row = (time.time() - began) / made
                    failed = int(np.count_nonzero(columns["status"] == Status.FAILED))
                    progress.advance(len(block), failed=failed)

                # Rows in the hands of the workers are finished before another look.
                hands = farm.IN_FLIGHT * workers if workers > 1 else 1
                blocks = blocks_of(writer.scene, pending, workers)
                if self.until < math.inf:  # a stop waits for the tasks under way
                    blocks = (range(row, row + 1) for block in blocks for row in block)
                self.executor.run(
                    _compute,
                    (writer.scene, path.parent),
                    blocks,
                    take,
                    stopping=lambda: (
                        self.stopping() or not self.suffices(before + made, hands)
                    ),
                )
            writer.confirm()
        return stock(path)[0]


def _fitted(
    data: tuple[Request, list[Dataset], Split], task: None
) -> tuple[Surrogate, list[str]]:
    """Fit a surrogate to rows that are divided; return the lines for the user too."""
    lines: list[str] = []
    return fitting.fit_parts(*data, lines.append), lines


def _refuse_others(request: Request, scene: Scene) -> None:
    """Refuse targets that the scene does not store, and a database of another scene."""
    path, known = request.databases[0], results(scene, request.load or "delta")
    for target in request.targets:
        if TARGETS.get(target, target) not in known:
            names = ", ".join(short_name(column) for column in known)
            raise InputError(f"--target {target!r}: the scene stores {names}")
    if path.exists():  # also where it has rows enough
        with Reader(path) as reader:
            different = differences(reader.scene, scene)
        if different:
            raise InputError(
                f"{path} holds another scene; give another --output, or the file's own scene:",
                different,
            )


def _compute(shared: tuple[Scene, Path], block: range) -> Columns:
    """Compute a block of the rows of a scene, whose database lies in a folder."""
    scene, folder = shared
    scene.surface.make_ready(folder, verify=False)
    return compute_rows(scene, block.start, block.stop, rank=farm.this_world().rank)


def show(growth: Growth, ending: Ending, found: Look) -> None:
    """Print the end of a growth with its last surrogate."""
    card, worst, request = found.surrogate.card, found.worst, growth.request
    parts, path = card["rows"], request.databases[0]
    echo(
        f"{request.output}: {card['title']}, {card['features']} features; {found.rows} rows of"
        f" {path}: {parts['train']} train, {parts['calibration']} calibrate, {parts['test']} held"
        f" out by {parts.get('split_by', 'surface')}, {sum(parts['left_out'].values())} left out"
    )
    accuracy, bound = found.judged[worst].accuracy, found.bound(worst)
    said = (
        f"{WORDS[ending]}: nMAE of {worst} {accuracy.nmae:.2f} %, at most {bound:.2f} %,"
    )
    said += f" asked: {found.mark:g} %."
    if found.met:
        said += (
            " However often a growth looks, it accepts too large an error with a probability of"
            f" {100 * RISK:g} % at most."
        )
    echo(said)
    if ending == "hopeless":
        echo(
            f"Within {growth.most} rows, the most that are allowed, the learning curve does not"
            " come to it: ask for less, allow more --rows, or try other --features."
        )
    elif not found.met and found.asked_for():
        asked = found.asked_for()
        echo(f"{asked[0].upper()}{asked[1:]}. The same command goes on.")
    if card["features"] == SCENE:
        echo(
            "Errors are those of the mean over surfaces, intervals those of a new surface."
        )
    rows = []
    for name, judged in found.judged.items():
        about = card["targets"][name]
        numbers = judged.accuracy.nmae, judged.accuracy.error, found.bound(name)
        inside, width = 100 * judged.inside.mean(), np.mean(judged.high - judged.low)
        cells = [f"{each:.2f}" for each in (*numbers, about["scores"]["r2"])]
        rows.append([name, *cells, f"{inside:.1f} %", f"{width:.3g} {about['unit']}"])
    held = f"in {100 * LEVEL:g} % interval"
    titles = ("nMAE %", "its SE", "at most", "R2 %", held, "mean width")
    print_columns(rows, ("target", *titles), right=titles)
    if (curve := found.curve) is not None:
        pairs = zip(curve.rows, curve.nmae, strict=True)
        points = ", ".join(f"{error:.3g} % of {size:.0f}" for size, error in pairs)
        echo(
            f"learning curve of {worst}: nMAE {points} rows; falls as n^-{curve.exponent:.2f}"
        )


def draw(figure: Any, found: Look) -> None:
    """Draw the worst target, with its learning curve if there is one, into an empty figure."""
    axis, parity = figure.subplots(1, 2)
    _draw_parity(parity, found)
    if (curve := found.curve) is not None:
        axis.plot(curve.rows, curve.nmae, "o", color="0.4", ms=4, label="looks")
        rows = np.geomspace(curve.rows[0], 8 * curve.rows[-1], 100)
        axis.plot(rows, curve.at(rows), color=COLOUR, label="n$^{-c}$")
    nmae = found.judged[found.worst].accuracy.nmae
    bound = np.nan_to_num(found.bound(found.worst) - nmae, posinf=0.0)
    look = {
        "fmt": "s",
        "color": "black",
        "capsize": 4,
        "label": "all rows, with their bound",
    }
    axis.errorbar([found.rows], [nmae], [[0.0], [bound]], **look)
    axis.axhline(found.mark, color=MARK, ls="--", label=f"asked for, {found.mark:g} %")
    axis.set(xlabel="rows of the database", ylabel="nMAE [%]")
    axis.set_title(f"Learning curve, {found.worst}")
    log_axis(axis.xaxis)
    log_axis(axis.yaxis)
    axis.grid(visible=True, which="major", color="0.9")
    axis.legend(fontsize=8)


def _draw_parity(axis: Any, found: Look) -> None:
    """Draw predictions with their intervals over the truth."""
    judged, unit = found.judged[found.worst], found.surrogate.learnt[found.worst].unit
    parity_axes(axis, judged.truth)
    for chosen, colour, name in (
        (judged.inside, COLOUR, "inside its interval"),
        (~judged.inside, MARK, "outside"),
    ):
        truth, prediction = judged.truth[chosen], judged.prediction[chosen]
        ends = np.clip([judged.low[chosen], judged.high[chosen]], *axis.get_ylim())
        axis.vlines(truth, ends[0], ends[1], color=colour, alpha=0.25, lw=1)
        label, look = f"{name} ({truth.size})", {"marker": ".", "ms": 4, "ls": "none"}
        draw_parity(axis, truth, prediction, label=label, color=colour, **look)
    quantity = found.worst if unit == "1" else f"{found.worst} [{unit}]"
    axis.set(xlabel=f"solved {quantity}", ylabel="predicted")
    axis.set_title(f"{judged.truth.size} rows held out for tests")
    axis.legend(fontsize=8, loc="upper left")
