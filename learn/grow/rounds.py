"""The loop of a growth, and the report at its end.

A growth generates the rows of one size of the database, fits a surrogate to them and judges it by
rows that are held out (a "look"). It goes on with the next size until the bounds of the errors of
all targets are at most the mark, which is the largest nMAE that the user accepts. All processes of
the run compute rows, and the master writes them to the database.
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
from gen.generation.completion import completed, recorded_scene
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
from learn.dataset import TARGETS, Request, results, unknown_target
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
    size,
    size_with,
    split_by_holdout,
)
from learn.metrics import LEVEL
from learn.split import Split, require_tiles
from learn.surrogate import fitting
from learn.surrogate.model import Surrogate

GROWTH = 2.0
"""Exponent with which the time of a look is expected to grow with the number of rows."""

WORTH = 0.05
"""Smallest share of new rows for which a growth goes on. If the budget allows fewer, it ends."""

EARLIEST = 7
"""Number of the smallest size (`learn.grow.accuracy.size`) at which the learning curve alone may
end a growth. At smaller sizes the curve is uncertain."""

PATIENT = 4
"""Number of the smallest size (`learn.grow.accuracy.size`) at which a growth ends with an error if
its rows are still too few for a fit."""

Ending = Literal["met", "budget", "rows", "hopeless", "interrupted"]
"""Reason for the end of a growth; "interrupted" is a signal, `WORDS` describes the other ones."""

INSIDE_COLOUR = "tab:blue"
"""Colour of the learning curve, and of predictions whose interval contains the truth."""

OUTSIDE_COLOUR = "tab:red"
"""Colour of the mark, and of predictions whose interval does not contain the truth."""

WORDS: dict[Ending, str] = {
    "met": "The mark is met",
    "budget": "The budget is used up before the mark is met",
    "rows": "The allowed rows are used up before the mark is met",
    "hopeless": "The mark is out of reach of this model with these features",
}
"""Beginning of the report for each reason."""


@dataclass(frozen=True)
class Stock:
    """The rows of a database."""

    finished: int  # number of rows before the first pending one
    rows: int  # number of all rows
    # time in which all done and failed rows were computed, with surfaces [s]
    seconds: float


def stock(path: Path) -> Stock:
    """Count the rows of a database, and add up their times.

    Parameters
    ----------
    path : Path
        The database, which may not exist yet.

    Returns
    -------
    Stock
        Numbers and time of the rows; zeros if the file does not exist.

    Raises
    ------
    InputError
        If the file is no database, or only a part of one.
    """
    if not path.exists():
        return Stock(finished=0, rows=0, seconds=0.0)
    with Reader(path) as reader:
        if reader.rows != range(reader.scene.samples):
            raise InputError(
                f"{path}: is a part: {command_to_type('gen merge')} makes it whole"
            )
        status = reader.column("status")
        seconds = reader.column("solve_seconds") + reader.column("surface_seconds")
    is_pending = status == Status.PENDING
    finished = len(status)
    if is_pending.any():
        finished = int(np.argmax(is_pending))
    return Stock(
        finished=finished,
        rows=len(status),
        seconds=float(np.nansum(seconds[~is_pending])),
    )


class End(NamedTuple):
    """The end of a growth."""

    reason: Ending
    last: Look | None  # the last look; None if a stop came before the first look


@dataclass(frozen=True)
class LookTime:
    """The time of a look."""

    rows: int  # number of rows of the look
    seconds: float  # duration of fit and judgement [s]


NO_LOOK = LookTime(rows=1, seconds=0.0)
"""Value of `Growth.last_look` before the first look: `suffices` then expects that a look takes no
time."""


@dataclass(frozen=True, eq=False)
class Attempt:
    """A look, or the reason why there is none."""

    look: Look | None
    fault: str  # why there is no look; not read if there is one


@dataclass(frozen=True, eq=False)
class FitOrder:
    """The input of a fit, which a second process makes if there is a budget."""

    request: Request
    sets: list[Dataset]  # one dataset for each target, with equal rows
    parts: Split  # training and test rows


@dataclass(frozen=True, eq=False)
class Fitted:
    """The result of a fit."""

    surrogate: Surrogate
    lines: list[str]  # lines for the user: scores and warnings


@dataclass(frozen=True)
class RowsOrder:
    """The data that all processes share when they compute rows."""

    scene: Scene
    folder: Path  # folder of the database, from which paths of maps start


def _never() -> bool:
    """Return False: without a signal, nothing stops a growth."""
    return False


@dataclass
class Growth:
    """A growth of a database and of the surrogate of its rows.

    The database is the whole state of a growth. After a stop or a kill, a second growth of an equal
    request continues with the rows of the database.
    """

    request: Request  # names one database, which need not exist yet
    mark: float  # largest nMAE that the user accepts for every target [%]
    row_limit: int  # largest number of rows of the database
    scene: Scene
    executor: Executor  # computes rows and features
    say: Callable[[str], None]  # called with each line for the user
    stopping: Callable[[], bool] = _never  # called between rows; True ends the growth
    until: float = math.inf  # time of `time.time` at which the budget ends [s]
    # Time in which all workers together compute a row, 0 before the first row [s].
    row_seconds: float = 0.0
    # Time of the last look, from which the time of the next one is estimated.
    last_look: LookTime = NO_LOOK
    # Errors of all looks, by the number of rows and the name of the target.
    errors: dict[int, dict[str, Accuracy]] = field(default_factory=dict)

    @property
    def path(self) -> Path:
        """Path of the database."""
        (path,) = self.request.databases
        return path

    @property
    def per_surface(self) -> int:
        """Number of rows of one surface."""
        return self.scene.samples_per_surface

    def grow(self) -> End:
        """Grow until the surrogate is as accurate as requested, or the growth has to end.

        The database is locked, and extended by rows. Each look writes the surrogate, and lines for
        the user by `say`. After a stop or a kill, the same call continues.

        Returns
        -------
        End
            Reason for the end, and the last look.

        Raises
        ------
        InputError
            If the input cannot be used, the budget is too small for a first surrogate, or rows are
            too few for a surrogate at the row limit or the size of number `PATIENT`.
        """
        scene = completed(
            self.scene,
            self.path.parent,
            rehearsed=True,
            recorded=recorded_scene(self.path, self.scene),
            watched=True,
        )
        with database.lock(self.path):
            _check_request(self.request, scene)
            for doubt in doubts_before(scene, self.row_limit):
                self.say(f"warning: {doubt}")
            smallest = min(size(0, self.per_surface), self.row_limit)
            first_size = max(stock(self.path).rows, smallest)
            return self._grow_from(scene, first_size)

    def _grow_from(self, scene: Scene, first_size: int) -> End:
        """Repeat rows and looks until the growth ends; return the reason and the last look.

        `first_size` is the number of rows of the first look. The caller holds the lock of the
        database.
        """
        size_wanted = first_size
        last: Look | None = None
        while True:
            rows = self.generate(scene, size_wanted)
            no_new_row = last is not None and rows == last.rows
            if no_new_row and not self.stopping():
                # The budget does not suffice for another row.
                return End(reason="budget", last=last)
            attempt = self._try_to_look(rows, required=last is not None)
            last = attempt.look or last
            ending = self._ending(rows, last)
            if last is None and ending == "budget":
                raise InputError(
                    f"the budget sufficed for {rows} rows, but for no surrogate"
                    f" ({attempt.fault}); the same command goes on"
                )
            if ending is not None:
                return End(reason=ending, last=last)
            if last is None:
                self.say(f"{rows} rows are too few: {attempt.fault}")
            following = size_with(rows + 1, self.per_surface)
            size_wanted = min(size(following, self.per_surface), self.row_limit)

    def _try_to_look(self, rows: int, *, required: bool) -> Attempt:
        """Look at the first `rows` rows of the database, and set `last_look`.

        If the rows are too few for a fit, or cannot be learnt, the attempt has no look. InputError
        is raised instead if a look is `required`, or if neither the row limit nor the size of
        number `PATIENT` has more than `rows` rows.
        """
        start = time.time()
        look = None
        fault = "no fit has ended"
        try:
            if not self.stopping():
                look = self.look(rows)
        except InputError as error:
            enough = min(self.row_limit, size(PATIENT, self.per_surface))
            if required or rows >= enough:
                raise
            fault = str(error)
        self.last_look = LookTime(rows=max(rows, 1), seconds=time.time() - start)
        return Attempt(look=look, fault=fault)

    def _ending(self, rows: int, last: Look | None) -> Ending | None:
        """Return the reason why a growth ends at a number of rows; None if it goes on."""
        if self.stopping():
            return "interrupted"
        if last is not None and last.met:
            return "met"
        # Without time for a look at the last rows, the budget ends the growth, and not the limit.
        if last is not None and last.rows >= self.row_limit:
            return "rows"
        if last is not None and self._is_hopeless(rows, last):
            return "hopeless"
        if self.suffices(rows, max(WORTH * rows, 1.0)):
            return None
        return "budget"

    def _is_hopeless(self, rows: int, last: Look) -> bool:
        """Tell whether the mark is out of reach of the learning curve within the row limit.

        Before the size of number `EARLIEST` the curve is uncertain. The mark is then out of reach
        only if the steepest curve (`EXPONENTS`) does not reach it either.
        """
        # None: there is no curve yet, or the mark is met.
        if last.advised_rows is None:
            return False
        # Infinite: the curve reaches the mark at no size up to the row limit.
        if math.isfinite(last.advised_rows):
            return False
        if last.number >= EARLIEST:
            return True
        nmae = last.judged[last.worst].accuracy.nmae
        steepest = EXPONENTS[1]
        smallest_nmae: float = nmae * (rows / self.row_limit) ** steepest
        return smallest_nmae > self.mark

    def look(self, rows: int) -> Look | None:
        """Fit a surrogate to the first rows of the database, judge it and save it.

        Its errors are added to `errors`, and written for the user by `say`.

        Parameters
        ----------
        rows : int
            Number of finished rows.

        Returns
        -------
        Look or None
            The judged surrogate; None after a stop, or at the end of the budget.

        Raises
        ------
        InputError
            If the rows cannot be learnt, or are too few to fit or to judge.
        """
        request = self.request
        sets = dataset.read(request, self.executor, self.stopping, common=True)
        if not sets:
            return None
        require_tiles(sets[0])
        sets = [target.at(np.flatnonzero(target.rows < rows)) for target in sets]
        parts = split_by_holdout(sets, request.seed)
        # The fit may take longer than the budget: it is a task that can be stopped.
        order = FitOrder(request=request, sets=sets, parts=parts)
        fitted = within(_fit, shared=order, task=None, until=self.until)
        if isinstance(fitted, Ended):
            return None
        for line in fitted.lines:
            self.say(line)
        judged = {}
        for name, target in zip(request.targets, sets, strict=True):
            learnt = fitted.surrogate.learnt[name]
            judged[name] = judge(learnt, target.at(parts.test))
        look = Look(
            rows=rows,
            number=size_with(rows, self.per_surface),
            row_limit=self.row_limit,
            mark=self.mark,
            surrogate=fitted.surrogate,
            judged=judged,
            parts=parts,
        )
        self._save(look)
        self.errors[rows] = {name: target.accuracy for name, target in judged.items()}
        if len(self.errors) >= POINTS:
            look = self._with_curve(look, sets[0])
        self.say(look.in_words())
        return look

    def _save(self, look: Look) -> None:
        """Write the surrogate of a look, with the errors of the look in its card."""
        errors = {}
        bounds = {}
        for name, judged in look.judged.items():
            errors[name] = judged.accuracy.standard_error
            bounds[name] = look.bound(name)
        look.surrogate.card["grown"] = {
            "mark": self.mark,
            "met": look.met,
            "rows": look.rows,
            "errors": errors,
            "bounds": bounds,
        }
        look.surrogate.save(self.request.output)

    def _with_curve(self, look: Look, rows: Dataset) -> Look:
        """Return a copy of a look with `curve` and `advised_rows`.

        `rows` is the dataset of the look for any of its targets.
        """
        curve = Curve(
            rows=np.array([*self.errors], dtype=float),
            nmae=np.array([errors[look.worst].nmae for errors in self.errors.values()]),
        )
        advised_rows = None
        if not look.met and look.rows < self.row_limit:
            advised_rows = advise(look, curve, rows)
        return replace(look, curve=curve, advised_rows=advised_rows)

    def suffices(self, rows: int, added: float) -> bool:
        """Estimate whether the budget suffices for further rows, and for the look after them.

        Parameters
        ----------
        rows : int
            Number of finished rows.
        added : float
            Number of further rows.

        Returns
        -------
        bool
            True if it suffices, by the times of the last look and of the rows of this growth.
        """
        ratio = max((rows + added) / self.last_look.rows, 1.0)
        look_seconds = self.last_look.seconds * math.pow(ratio, GROWTH)
        remaining = self.until - time.time()
        return remaining - look_seconds >= added * self.row_seconds

    def generate(self, scene: Scene, rows: int) -> int:
        """Compute rows until the database has at least a given number; create it if needed.

        The caller holds `gen.database.lock`. After a stop or a kill, the same call continues.

        Parameters
        ----------
        scene : Scene
            A scene from `gen.generation.completion.completed`. Its number of samples is not used.
        rows : int
            Number of rows that the database is to have.

        Returns
        -------
        int
            Number of finished rows; it is below `rows` only after a stop, or at the end of the
            budget.

        Raises
        ------
        InputError
            If the database is of another scene or cannot be written, or surfaces cannot be made.
        """
        enlarged = scene.model_copy(update={"samples": rows})
        before = stock(self.path)
        if before.finished and not self.row_seconds:
            workers = self.executor.world.workers
            self.row_seconds = before.seconds / before.finished / workers
        if before.finished >= rows:
            return before.finished
        database.open_or_create(self.path, enlarged)
        scene.surface.make_ready(self.path.parent)
        with Writer(self.path, enlarged) as writer:
            self._compute_pending(writer, before.finished)
            writer.confirm()
        return stock(self.path).finished

    def _compute_pending(self, writer: Writer, before: int) -> None:
        """Compute the pending rows of a database, and write them, until a stop or the budget's end.

        `before` is the number of finished rows. Sets `row_seconds`, and shows progress on standard
        error.
        """
        pending = writer.pending()
        number = sum(map(len, pending))
        workers = self.executor.world.workers
        computed = 0
        with RunProgress(number, "rows") as progress:
            progress.say(f"{self.path}: {number} new rows, {before} there")
            start = time.time()

            def write(block: range, columns: Columns) -> None:
                """Write a block, and estimate the time of a row anew."""
                nonlocal computed
                writer.write_block(block.start, block.stop, columns)
                computed += len(block)
                self.row_seconds = (time.time() - start) / computed
                failed = int(np.count_nonzero(columns["status"] == Status.FAILED))
                progress.advance(rows=len(block), failed=failed)

            # A stop waits for the rows that are being computed.
            under_way = 1
            if workers > 1:
                under_way = farm.IN_FLIGHT * workers

            def is_over() -> bool:
                """Tell whether to stop, so that the rows under way and a look fit the budget."""
                return self.stopping() or not self.suffices(before + computed, under_way)

            blocks = blocks_of(writer.scene, pending, workers)
            if self.until < math.inf:
                # Single rows are short tasks, so that a growth ends close to its budget.
                blocks = (range(row, row + 1) for block in blocks for row in block)
            shared = RowsOrder(scene=writer.scene, folder=self.path.parent)
            self.executor.run(_compute, shared, blocks, write, stopping=is_over)


def _fit(order: FitOrder, _: None) -> Fitted:
    """Fit a surrogate to the training rows of an order.

    `within` also passes a task, which is not used: the order has all data of the fit.
    """
    lines: list[str] = []
    surrogate = fitting.fit_parts(order.request, order.sets, order.parts, lines.append)
    return Fitted(surrogate=surrogate, lines=lines)


def _check_request(request: Request, scene: Scene) -> None:
    """Refuse targets that the scene does not store, and a database that is of another scene."""
    load = request.load or "delta"
    columns = results(scene, load)
    for target in request.targets:
        if TARGETS.get(target, target) not in columns:
            raise InputError(unknown_target(target, "the scene", columns, load))
    path = request.databases[0]
    # `generate` does not look at the scene of a database that has enough rows.
    if path.exists():
        with Reader(path) as reader:
            different = differences(reader.scene, scene)
        if different:
            raise InputError(
                f"{path} holds another scene; give another --output, or the file's own scene:",
                different,
            )


def _compute(shared: RowsOrder, block: range) -> Columns:
    """Compute a block of rows on any process; return their columns by name."""
    scene = shared.scene
    scene.surface.make_ready(shared.folder, verify=False)
    return compute_rows(scene, block.start, block.stop, rank=farm.this_world().rank)


def show(growth: Growth, ending: Ending, last: Look) -> None:
    """Print why a growth ended, and the errors of its last surrogate.

    Parameters
    ----------
    growth : Growth
        The growth, after its end.
    ending : Ending
        Reason for the end, other than "interrupted".
    last : Look
        The last look.
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
    if last.curve is not None:
        _show_curve(last.curve, last.worst)


def _show_curve(curve: Curve, target: str) -> None:
    """Print the points and the exponent of the learning curve of a target."""
    pairs = zip(curve.rows, curve.nmae, strict=True)
    points = ", ".join(f"{error:.3g} % of {size:.0f}" for size, error in pairs)
    echo(
        f"learning curve of {target}: nMAE {points} rows; falls as n^-{curve.exponent:.2f}"
    )


def _show_ending(growth: Growth, ending: Ending, last: Look) -> None:
    """Print why a growth ended, and how the user can come closer to the mark.

    `ending` is a key of `WORDS`: growths that were interrupted are not shown.
    """
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
    advice = "ask for less, allow more --rows, or try other --features"
    if ending == "hopeless":
        echo(
            f"Within {growth.row_limit} rows, the most that are allowed, the learning curve does"
            f" not reach the mark: {advice}."
        )
        return
    if ending == "rows":
        # The same command would add no row.
        echo(f"No more than {growth.row_limit} rows are allowed: {advice}.")
        return
    needed_rows = last.needed_rows_text()
    if needed_rows:
        echo(f"{needed_rows[0].upper()}{needed_rows[1:]}. The same command goes on.")


def _line_of_errors(last: Look, target: str) -> list[str]:
    """Return the cells of a target in the table of errors, in the order of its columns."""
    judged = last.judged[target]
    card = last.surrogate.card["targets"][target]
    width = np.mean(judged.high - judged.low)
    return [
        target,
        f"{judged.accuracy.nmae:.2f}",
        f"{judged.accuracy.standard_error:.2f}",
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
        The last look of a growth.
    """
    curve_axis, parity_axis = figure.subplots(1, 2)
    _draw_parity(parity_axis, last)
    _draw_learning_curve(curve_axis, last)


def _draw_learning_curve(axis: Any, last: Look) -> None:
    """Draw the errors of all looks with their curve, the bound of the last one, and the mark."""
    if last.curve is not None:
        curve = last.curve
        axis.plot(curve.rows, curve.nmae, "o", color="0.4", ms=4, label="looks")
        # The curve goes on to eight times the rows of the last look.
        rows = np.geomspace(curve.rows[0], 8 * curve.rows[-1], 100)
        axis.plot(rows, curve.at(rows), color=INSIDE_COLOUR, label="n$^{-c}$")
    nmae = last.judged[last.worst].accuracy.nmae
    # An infinite bound cannot be drawn.
    up_to_bound = np.nan_to_num(last.bound(last.worst) - nmae, posinf=0.0)
    axis.errorbar(
        [last.rows],
        [nmae],
        [[0.0], [up_to_bound]],  # lengths of the bar below and above the point
        fmt="s",
        color="black",
        capsize=4,
        label="all rows, with their bound",
    )
    label = f"asked for, {last.mark:g} %"
    axis.axhline(last.mark, color=OUTSIDE_COLOUR, ls="--", label=label)
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
    _draw_predictions(axis, judged, judged.inside, INSIDE_COLOUR, "inside its interval")
    _draw_predictions(axis, judged, ~judged.inside, OUTSIDE_COLOUR, "outside")
    quantity = last.worst
    if unit != "1":
        quantity += f" [{unit}]"
    axis.set(xlabel=f"solved {quantity}", ylabel="predicted")
    axis.set_title(f"{judged.truth.size} rows held out for tests")
    axis.legend(fontsize=8, loc="upper left")


def _draw_predictions(
    axis: Any, judged: Judged, rows: NDArray[np.bool_], colour: str, name: str
) -> None:
    """Draw predictions with their intervals over the truth, where `rows`, (n,), is True.

    `name` is the label in the legend; the number of these rows is added.
    """
    truth = judged.truth[rows]
    # Ends beyond the axis would draw lines across the labels.
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
