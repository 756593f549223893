"""The loop of a growth: look, generate the rows of the next size, and look again; then its report.

The processes of the run compute the rows, as many as the time allows, and the master writes them.
"""

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

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
    Judged,
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

EARLIEST = 7
"""Number of the smallest size at which a growth gives up by its learning curve."""

PATIENT = 4
"""Number of the size from which on rows that are too few for a fit are an error."""

Ending = Literal["met", "budget", "rows", "hopeless", "interrupted"]

COLOUR, MARK = "tab:blue", "tab:red"

WORDS: dict[Ending, str] = {
    "met": "The mark is met",
    "budget": "The budget is used up before the mark is met",
    "rows": "The allowed rows are used up before the mark is met",
    "hopeless": "The mark is out of reach of this model with these features",
}
"""Why a growth has ended, if no signal has come."""


@dataclass(frozen=True)
class Stock:
    """Rows of a database."""

    finished: int  # rows before the first one that is pending
    rows: int  # all rows
    seconds: float  # time that the finished ones took, surfaces included [s]


def stock(path: Path) -> Stock:
    """Count the rows of a database.

    Parameters
    ----------
    path : Path
        The database; it may not exist yet.

    Returns
    -------
    Stock
        Its rows, none if there is no such file.

    Raises
    ------
    InputError
        If the file is no whole database.
    """
    if not path.exists():
        return Stock(0, 0, 0.0)
    with Reader(path) as reader:
        if reader.rows != range(reader.scene.samples):
            raise InputError(
                f"{path}: is a part: {command_to_type('gen merge')} makes it whole"
            )
        status = reader.column("status")
        seconds = reader.column("solve_seconds") + reader.column("surface_seconds")
    pending = np.flatnonzero(status == Status.PENDING)
    finished = int(pending[0]) if pending.size else len(status)
    taken = float(np.nansum(seconds[status != Status.PENDING]))
    return Stock(finished, len(status), taken)


class End(NamedTuple):
    """The end of a growth."""

    reason: Ending
    last: (
        Look | None
    )  # last surrogate with its errors; None after a stop before the first one


@dataclass(frozen=True)
class LookTime:
    """Rows and time of a look."""

    rows: int
    seconds: float  # [s]


@dataclass
class Growth:
    """A growth of a database and of the surrogate of its rows.

    The database is the whole state of a growth: another growth of the same request goes on with it.
    """

    request: Request
    mark: float  # largest nMAE of every target that is asked for [%]
    most: int  # rows of the database at most
    scene: Scene
    executor: Executor  # computes rows and features
    say: Callable[[str], None]  # called with lines for the user
    stopping: Callable[[], bool] = lambda: (
        False
    )  # called between rows; True ends the growth
    until: float = math.inf  # time of `time.time` at which the budget ends [s]
    # Time in which all workers together compute one row, 0 if it is not known yet [s].
    row_seconds: float = 0.0
    last_look: LookTime = field(default_factory=lambda: LookTime(1, 0.0))
    # Errors of all looks, by the rows of the database and the target.
    errors: dict[int, dict[str, Accuracy]] = field(default_factory=dict)

    @property
    def path(self) -> Path:
        """The database."""
        (path,) = self.request.databases
        return path

    @property
    def per_surface(self) -> int:
        """Rows of one surface."""
        return self.scene.samples_per_surface

    def grow(self) -> End:
        """Grow until the surrogate is as accurate as requested, or the growth has to end.

        The database is locked, and gets further rows; the surrogate is written after each look. The
        same call goes on after a stop or a kill.

        Returns
        -------
        End
            Why the growth ends, and the last surrogate with its errors.

        Raises
        ------
        InputError
            If the input cannot be used, or the budget is too small for a first surrogate.
        """
        whole = completed(self.scene, self.path.parent, rehearsed=True)
        with database.lock(self.path):
            _refuse_others(self.request, whole)
            for doubt in doubts_before(whole, self.most):
                self.say(f"warning: {doubt}")
            smallest = min(size(0, self.per_surface), self.most)
            wanted = max(stock(self.path).rows, smallest)
            last: Look | None = None
            while True:
                rows = self.generate(whole, wanted)
                if last is not None and rows == last.rows and not self.stopping():
                    return End("budget", last)  # it does not suffice for another row
                look, fault = self._try_to_look(rows, required=last is not None)
                last = look or last
                ending = self._ending(rows, last)
                if last is None and ending == "budget":
                    raise InputError(
                        f"the budget sufficed for {rows} rows, but for no surrogate ({fault}); the"
                        " same command goes on"
                    )
                if ending is not None:
                    return End(ending, last)
                if last is None:
                    self.say(f"{rows} rows are too few: {fault}")
                following = size_with(rows + 1, self.per_surface)
                wanted = min(size(following, self.per_surface), self.most)

    def _try_to_look(self, rows: int, *, required: bool) -> tuple[Look | None, str]:
        """Look at the first rows and keep the time; return the look, or None and why there is none.

        Too few rows are an error if a look is required, or there are as many as a fit should need.
        """
        began = time.time()
        look = None
        fault = "no fit has ended"
        try:
            if not self.stopping():
                look = self.look(rows)
        except InputError as error:
            enough = min(self.most, size(PATIENT, self.per_surface))
            if required or rows >= enough:
                raise
            fault = str(error)
        self.last_look = LookTime(max(rows, 1), time.time() - began)
        return look, fault

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
        """Fit a surrogate to the first rows of the database, judge it and save it.

        Its errors are added to those of the looks before, and printed.

        Parameters
        ----------
        rows : int
            Number of finished rows.

        Returns
        -------
        Look or None
            The surrogate with its errors; None after a stop, or at the end of the budget.

        Raises
        ------
        InputError
            If there are too few rows to fit or to judge.
        """
        request = self.request
        sets = dataset.read(request, self.executor, self.stopping, common=True)
        if not sets:
            return None
        require_tiles(sets[0])
        sets = [target.at(np.flatnonzero(target.rows < rows)) for target in sets]
        parts = parted(sets, request.seed)
        fitted = within(_fitted, (request, sets, parts), None, self.until)
        if isinstance(fitted, Ended):
            return None
        surrogate, lines = fitted
        for line in lines:
            self.say(line)
        judged = {
            name: judge(surrogate.learnt[name], target.at(parts.test))
            for name, target in zip(request.targets, sets, strict=True)
        }
        number = size_with(rows, self.per_surface)
        look = Look(rows, number, self.mark, surrogate, judged, parts)
        self._save(look)
        accuracies = {name: target.accuracy for name, target in judged.items()}
        self.errors[rows] = accuracies
        if len(self.errors) >= POINTS:
            look = self._with_curve(look, sets[0])
        self.say(look.in_words())
        return look

    def _save(self, look: Look) -> None:
        """Write the surrogate of a look; its card says how accurate the surrogate is."""
        look.surrogate.card["grown"] = {
            "mark": self.mark,
            "met": look.met,
            "rows": look.rows,
            "errors": {
                name: target.accuracy.error for name, target in look.judged.items()
            },
            "bounds": {name: look.bound(name) for name in look.judged},
        }
        look.surrogate.save(self.request.output)

    def _with_curve(self, look: Look, rows: Dataset) -> Look:
        """Return a look with the learning curve of its worst target, and its advice."""
        sizes = np.array([*self.errors], dtype=float)
        nmae = np.array([targets[look.worst].nmae for targets in self.errors.values()])
        curve = Curve(sizes, nmae)
        advice = None if look.met else advise(look, curve, self.most, rows)
        return replace(look, curve=curve, advice=advice)

    def suffices(self, rows: int, more: float) -> bool:
        """Return whether the budget suffices for further rows, and for the look after them.

        Parameters
        ----------
        rows : int
            Number of rows that are finished.
        more : float
            Number of further rows.

        Returns
        -------
        bool
            An estimate by the times of the last look and of the rows of this call.
        """
        ratio = max((rows + more) / self.last_look.rows, 1.0)
        look = self.last_look.seconds * math.pow(ratio, GROWTH)
        return self.until - time.time() - look >= more * self.row_seconds

    def generate(self, scene: Scene, rows: int) -> int:
        """Give the database a number of rows at least, or make it.

        The caller holds `gen.database.lock`. A stop or a kill leaves a database that the same call
        goes on with.

        Parameters
        ----------
        scene : Scene
            A scene from `gen.generation.completion.completed`, whose number of samples does not
            count.
        rows : int
            Number of rows that are wanted.

        Returns
        -------
        int
            Number of rows that are finished; fewer than wanted after a stop, or at the end of the
            budget.

        Raises
        ------
        InputError
            If the file is of another scene, or cannot be written.
        """
        wider = scene.model_copy(update={"samples": rows})
        before = stock(self.path)
        if before.finished and not self.row_seconds:
            workers = self.executor.world.workers
            self.row_seconds = before.seconds / before.finished / workers
        if before.finished >= rows:
            return before.finished
        database.open_or_create(self.path, wider)
        scene.surface.make_ready(self.path.parent)
        with Writer(self.path, wider) as writer:
            self._compute_pending(writer, before.finished)
            writer.confirm()
        return stock(self.path).finished

    def _compute_pending(self, writer: Writer, before: int) -> None:
        """Compute the pending rows of a database that has some rows before, as time allows."""
        pending = writer.pending()
        number = sum(map(len, pending))
        workers = self.executor.world.workers
        made = 0
        with RunProgress(number, "rows") as progress:
            progress.say(f"{self.path}: {number} new rows, {before} there")
            began = time.time()

            def on_result(block: range, columns: Columns) -> None:
                nonlocal made
                writer.write_block(block.start, block.stop, columns)
                made += len(block)
                self.row_seconds = (time.time() - began) / made
                failed = int(np.count_nonzero(columns["status"] == Status.FAILED))
                progress.advance(len(block), failed=failed)

            # Rows in the hands of the workers are finished before another look.
            under_way = farm.IN_FLIGHT * workers if workers > 1 else 1

            def is_over() -> bool:
                return self.stopping() or not self.suffices(before + made, under_way)

            blocks = blocks_of(writer.scene, pending, workers)
            if self.until < math.inf:  # a stop waits for the tasks under way
                blocks = (range(row, row + 1) for block in blocks for row in block)
            shared = (writer.scene, self.path.parent)
            self.executor.run(_compute, shared, blocks, on_result, stopping=is_over)


def _fitted(
    data: tuple[Request, list[Dataset], Split], task: None
) -> tuple[Surrogate, list[str]]:
    """Fit a surrogate to rows that are divided; return it with the lines for the user."""
    request, sets, parts = data
    lines: list[str] = []
    surrogate = fitting.fit_parts(request, sets, parts, lines.append)
    return surrogate, lines


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


def show(growth: Growth, ending: Ending, last: Look) -> None:
    """Print the end of a growth, and the errors of its last surrogate.

    Parameters
    ----------
    growth : Growth
        The growth, after its end.
    ending : Ending
        Why it has ended.
    last : Look
        Its last surrogate with its errors.
    """
    card = last.surrogate.card
    rows = card["rows"]
    echo(
        f"{growth.request.output}: {card['title']}, {card['features']} features; {last.rows} rows"
        f" of {growth.path}: {rows['train']} train, {rows['calibration']} calibrate,"
        f" {rows['test']} held out by {rows.get('split_by', 'surface')},"
        f" {sum(rows['left_out'].values())} left out"
    )
    _show_ending(growth, ending, last)
    if card["features"] == SCENE:
        echo(
            "Errors are those of the mean over surfaces, intervals those of a new surface."
        )
    numbers = (
        "nMAE %",
        "its SE",
        "at most",
        "R2 %",
        f"in {100 * LEVEL:g} % interval",
        "mean width",
    )
    lines = [_line_of_errors(last, target) for target in last.judged]
    print_columns(lines, ("target", *numbers), right=numbers)
    curve = last.curve
    if curve is not None:
        pairs = zip(curve.rows, curve.nmae, strict=True)
        points = ", ".join(f"{error:.3g} % of {size:.0f}" for size, error in pairs)
        echo(
            f"learning curve of {last.worst}: nMAE {points} rows; falls as"
            f" n^-{curve.exponent:.2f}"
        )


def _show_ending(growth: Growth, ending: Ending, last: Look) -> None:
    """Print why a growth has ended, and what could be done about it."""
    accuracy = last.judged[last.worst].accuracy
    text = (
        f"{WORDS[ending]}: nMAE of {last.worst} {accuracy.nmae:.2f} %, at most"
        f" {last.bound(last.worst):.2f} %, asked: {last.mark:g} %."
    )
    if last.met:
        text += (
            " However often a growth looks, it accepts too large an error with a probability of"
            f" {100 * RISK:g} % at most."
        )
    echo(text)
    if ending == "hopeless":
        echo(
            f"Within {growth.most} rows, the most that are allowed, the learning curve does not"
            " come to it: ask for less, allow more --rows, or try other --features."
        )
        return
    needed = last.needed_rows()
    if needed and not last.met:
        echo(f"{needed[0].upper()}{needed[1:]}. The same command goes on.")


def _line_of_errors(last: Look, target: str) -> list[str]:
    """Return the cells of the printed table of errors for a target."""
    judged = last.judged[target]
    card = last.surrogate.card["targets"][target]
    width = np.mean(judged.high - judged.low)
    return [
        target,
        f"{judged.accuracy.nmae:.2f}",
        f"{judged.accuracy.error:.2f}",
        f"{last.bound(target):.2f}",
        f"{card['scores']['r2']:.2f}",
        f"{100 * judged.inside.mean():.1f} %",
        f"{width:.3g} {card['unit']}",
    ]


def draw(figure: Any, last: Look) -> None:
    """Draw the worst target of a look: its learning curve and its predictions.

    Parameters
    ----------
    figure : Figure
        An empty figure of matplotlib, into which two axes are drawn.
    last : Look
        The surrogate with its errors.
    """
    axis, parity = figure.subplots(1, 2)
    _draw_parity(parity, last)
    if last.curve is not None:
        curve = last.curve
        axis.plot(curve.rows, curve.nmae, "o", color="0.4", ms=4, label="looks")
        rows = np.geomspace(curve.rows[0], 8 * curve.rows[-1], 100)
        axis.plot(rows, curve.at(rows), color=COLOUR, label="n$^{-c}$")
    nmae = last.judged[last.worst].accuracy.nmae
    above = np.nan_to_num(last.bound(last.worst) - nmae, posinf=0.0)
    axis.errorbar(
        [last.rows],
        [nmae],
        [[0.0], [above]],
        fmt="s",
        color="black",
        capsize=4,
        label="all rows, with their bound",
    )
    axis.axhline(last.mark, color=MARK, ls="--", label=f"asked for, {last.mark:g} %")
    axis.set(xlabel="rows of the database", ylabel="nMAE [%]")
    axis.set_title(f"Learning curve, {last.worst}")
    log_axis(axis.xaxis)
    log_axis(axis.yaxis)
    axis.grid(visible=True, which="major", color="0.9")
    axis.legend(fontsize=8)


def _draw_parity(axis: Any, last: Look) -> None:
    """Draw predictions of the worst target, with their intervals, over the truth."""
    judged = last.judged[last.worst]
    unit = last.surrogate.learnt[last.worst].unit
    parity_axes(axis, judged.truth)
    _draw_predictions(axis, judged, judged.inside, COLOUR, "inside its interval")
    _draw_predictions(axis, judged, ~judged.inside, MARK, "outside")
    quantity = last.worst if unit == "1" else f"{last.worst} [{unit}]"
    axis.set(xlabel=f"solved {quantity}", ylabel="predicted")
    axis.set_title(f"{judged.truth.size} rows held out for tests")
    axis.legend(fontsize=8, loc="upper left")


def _draw_predictions(
    axis: Any, judged: Judged, rows: NDArray[np.bool_], colour: str, name: str
) -> None:
    """Draw the predictions of some rows, (n,), with their intervals, over the truth."""
    truth = judged.truth[rows]
    ends = np.clip([judged.low[rows], judged.high[rows]], *axis.get_ylim())
    axis.vlines(truth, ends[0], ends[1], color=colour, alpha=0.25, lw=1)
    draw_parity(
        axis,
        truth,
        judged.prediction[rows],
        label=f"{name} ({truth.size})",
        color=colour,
        marker=".",
        ms=4,
        ls="none",
    )
