"""Compare the errors of `bem.solve_within`, and the bars of maps, with those on an exact grid.

Each contact is solved on its map, on an exact grid three to eight times as fine, and by
`solve_within` for errors of 3, 1 and 0.3 %. The exact grid has the same patch, the same load, and
Delta counted from the highest node of the map.
"""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from itertools import chain, islice
from multiprocessing import get_context
from typing import Any, Literal

import numpy as np
from scipy.special import erfinv, expit, logit

import bem
from bem.answers import ANSWERS
from bem.problem import pose
from bem.solving import solve_posed
from bem.threads import on_threads
from bench.accuracy.surfaces import (
    KINDS,
    LATER_KINDS,
    MEASURED,
    MeasuredMap,
    Sample,
    window_of_map,
)
from bench.files import Row
from bench.report import remark
from gen.arrays import Heights
from gen.quantities import MEAN_GAP
from gen.runtime.errors import InputError

ERRORS = (0.03, 0.01, 0.003)
"""Relative errors that are asked for, at 95 % [1]."""

LEAST_SHARE = 0.005
"""Smallest share of the patch that a load shall bring into contact [1]."""

MOST_SHARE = 0.99
"""Largest share of the patch that a load shall bring into contact [1]."""

YIELDING = 0.25
"""Share of the contacts whose bodies yield [1]."""

EXACT_RTOL = 1e-8
"""Tolerance of the solve on the exact grid [Delta]."""

LEAST_GAP = 1e-6
"""Smallest mean gap that is judged [Delta].

Below, the tolerances of both solves are no longer small against it; at full contact it is rounding.
"""

SEED = 7302
"""First number of the seeds of all samples, which keeps them apart from those of other studies."""

AREA = "area"
"""Name of the area in the continuum among the answers that can be asked for."""

ENOUGH_IN_WAVE = 8.0
"""Fewest nodes in the shortest wave with which most contacts should be answered."""

ALL_KINDS = (*KINDS, MEASURED, *LATER_KINDS)
"""Names of all kinds of surfaces. The place of a name is a number of the seeds of its samples."""

LoadName = Literal["pressure", "force", "delta"]
"""Name of the quantity that is given."""

LOADS: tuple[LoadName, ...] = ("pressure", "force", "delta")
"""Names of all quantities that may be given."""


@dataclass(frozen=True)
class _Pressed:
    """A sample under a load, solved on its map and on the exact grid."""

    kind: str
    seed: int
    sample: Sample
    load: LoadName
    value: float  # of the load [MPa, uN or um, with E* = 1 MPa and a side of 1 um]
    settings: Mapping[str, Any]  # further arguments of `bem.solve`
    map_contact: bem.Contact
    exact: bem.Contact

    @property
    def answers(self) -> tuple[str, ...]:
        """Names of the answers that can be asked for.

        Delta is left out if it is given, otherwise the force. Answers without a true value are left
        out too, as the mean gap at full contact.
        """
        is_given = "delta" if self.load == "delta" else "force"
        names = [name for name in ANSWERS if name != is_given]
        return tuple(name for name in names if math.isfinite(self.true_value(name)))

    def true_value(self, answer: str) -> float:
        """Return an answer on the exact grid; NaN if it is 0 or infinite, or a gap of rounding."""
        value = float(ANSWERS[answer].value(self.exact))
        if answer == MEAN_GAP.name and value < LEAST_GAP * abs(self.exact.delta):
            return math.nan
        return value if value != 0 and math.isfinite(value) else math.nan

    def description(self) -> Row:
        """Return the columns that describe the contact."""
        return {
            "kind": self.kind,
            "seed": self.seed,
            "boundary": self.sample.boundary,
            "nodes": self.sample.nodes,
            "nodes_in_wave": self.sample.nodes_in_wave,
            "has_limit": self.sample.has_limit,
            "load": self.load,
            "yields": self.settings["hardness"] is not None,
            "area_percent": self.exact.continuum_area_percent,
        }


def asked_and_got(
    contacts: int,
    maps: Sequence[MeasuredMap] = (),
    kinds: Sequence[str] = (),
    processes: int = 2,
) -> list[Row]:
    """Ask for errors on contacts of every kind, and compare with an exact grid.

    Prints the progress on standard error.

    Parameters
    ----------
    contacts : int
        Number of contacts of each kind.
    maps : sequence of MeasuredMap
        Measured maps; if there are any, their windows are one more kind.
    kinds : sequence of str
        Names of the kinds; empty for all kinds.
    processes : int
        Number of processes that share the work. The rows do not depend on it.

    Returns
    -------
    list of Row
        A row for each answer of each contact. Column `asked_for` is "area" where the area was asked
        for alone, "all" where all answers were asked for together, and "map" for the 90 % bars of
        the map. Column `asked_percent` has the error that was asked for, NaN for the map.

    Raises
    ------
    InputError
        If there is no such kind. The kind of measured maps needs maps.
    """
    possible_kinds = [kind for kind in ALL_KINDS if maps or kind != MEASURED]
    for kind in kinds:
        if kind not in possible_kinds:
            raise InputError(f"--kinds {kind}: give some of {', '.join(possible_kinds)}")
    drawn_kinds = kinds or possible_kinds
    tasks = [(kind, seed) for kind in drawn_kinds for seed in range(contacts)]
    judge = partial(_rows_of_contact, maps)
    rows_by_contact = _mapped(judge, tasks, processes)
    rows: list[Row] = []
    for kind in drawn_kinds:
        of_kind = list(chain.from_iterable(islice(rows_by_contact, contacts)))
        remark(f"{kind}: {len({row['seed'] for row in of_kind})} contacts")
        rows += of_kind
    return rows


def _mapped(
    work: Callable[[tuple[str, int]], list[Row]],
    tasks: Sequence[tuple[str, int]],
    processes: int,
) -> Iterator[list[Row]]:
    """Yield the rows of each task, in the order of the tasks, from one process or several."""
    if processes == 1:
        yield from map(work, tasks)
        return
    with ProcessPoolExecutor(processes, get_context("spawn")) as pool:
        yield from pool.map(work, tasks, chunksize=4)


def _rows_of_contact(maps: Sequence[MeasuredMap], task: tuple[str, int]) -> list[Row]:
    """Return the rows of a contact; `task` has its kind and its seed.

    There are no rows if the drawn load has no solution or brings nothing into contact.
    """
    kind, seed = task
    random = np.random.default_rng((SEED, ALL_KINDS.index(kind), seed))
    if kind == MEASURED:
        sample = window_of_map(maps, random)
    else:
        sample = {**KINDS, **LATER_KINDS}[kind](random)
    with on_threads(1):
        try:
            pressed = _pressed(kind, seed, sample, random)
        except (bem.NoSolution, bem.NotConverged):
            return []
        if pressed.exact.contact_nodes == 0:
            return []
        return [*_rows_of_map(pressed), *_rows_of_errors(pressed)]


def _pressed(
    kind: str, seed: int, sample: Sample, random: np.random.Generator
) -> _Pressed:
    """Draw a load and solve the contact on both grids.

    A share of the patch between `LEAST_SHARE` and `MOST_SHARE` is drawn, with uniform log-odds. The
    mean pressure is the one under which this share touches in Persson's theory of Gaussian surfaces
    (2001, J. Chem. Phys. 115, 3840).
    """
    heights = sample.heights(sample.nodes)
    lowest = float(logit(LEAST_SHARE))
    highest = float(logit(MOST_SHARE))
    share = float(expit(random.uniform(lowest, highest)))
    pressure = _rms_of_full_contact(sample, heights) * math.sqrt(2) * float(erfinv(share))
    hardness = None
    if random.random() < YIELDING:
        hardness = pressure * random.uniform(1.2, 12)
    load = LOADS[int(random.integers(len(LOADS)))]
    settings: dict[str, Any] = {
        "boundary": sample.boundary,
        "hardness": hardness,
        "body": sample.body,
    }
    spacing = (1 / sample.nodes, sample.aspect / sample.nodes)
    problem = pose(heights, 1.0, None, pressure=pressure, spacing=spacing, **settings)
    # With a datum, though it is 0, the cells of all grids cover the same patch.
    contact = solve_posed(replace(problem, datum=0.0))
    if load == "delta" and contact.contact_nodes == heights.size:
        load = "pressure"  # beyond full contact Delta does not tell the force
    value = {"pressure": pressure, "force": contact.force, "delta": contact.delta}[load]
    delta = None
    force = None
    if load == "delta":
        delta = contact.delta
        problem = pose(heights, 1.0, delta, spacing=spacing, **settings)
        contact = solve_posed(replace(problem, datum=0.0))
    else:
        force = contact.force
    fine = sample.heights(sample.exact_nodes)
    finer = sample.exact_nodes / sample.nodes
    exact_problem = pose(
        fine,
        1.0,
        delta,
        force=force,
        spacing=(spacing[0] / finer, spacing[1] / finer),
        rtol=EXACT_RTOL,
        **settings,
    )
    # Delta counts from the highest node of the map, which may be below that of the exact grid.
    datum = float(heights.max() - fine.max())
    return _Pressed(
        kind=kind,
        seed=seed,
        sample=sample,
        load=load,
        value=value,
        settings={**settings, "spacing": spacing},
        map_contact=contact,
        exact=solve_posed(replace(exact_problem, datum=datum)),
    )


def _rms_of_full_contact(sample: Sample, heights: Heights) -> float:
    """Return the rms of the pressure that flattens a surface [MPa].

    `heights` are those of the sample's map. On a half-space the result is E* times half of the rms
    slope. On a layer each wave has its own stiffness; the map is continued by its mirror images.
    """
    if sample.body is None:
        along, across = (float(np.diff(heights, axis=axis).std()) for axis in (0, 1))
        return math.hypot(along, across / sample.aspect) * sample.nodes / 2
    along_both = np.concatenate([heights, heights[::-1]])
    mirrored = np.concatenate([along_both, along_both[:, ::-1]], axis=1)
    waves = np.abs(np.fft.fft2(mirrored, norm="forward")).ravel()[1:]
    numbers = np.pi * np.fft.fftfreq(2 * sample.nodes, 1 / (2 * sample.nodes))
    wave_numbers = np.hypot.outer(numbers, numbers / sample.aspect).ravel()[1:]
    return float(np.linalg.norm(waves * sample.body.stiffness(wave_numbers)))


def _rows_of_map(pressed: _Pressed) -> list[Row]:
    """Return a row with the 90 % bar of each answer on the map itself."""
    contact = pressed.map_contact
    estimate = contact.grid_error()
    rows = []
    for answer in pressed.answers:
        value = float(ANSWERS[answer].value(contact))
        row = _Judged(pressed, asked_for="map", asked_error=math.nan, answer=answer)
        if not estimate.verdicts[answer] or value == 0 or not math.isfinite(value):
            rows.append(row.unanswered("not resolved"))
            continue
        bar = ANSWERS[answer].bar(estimate) / abs(value)
        rows.append(row.answered(value, bar, contact.pressure.shape[0]))
    return rows


def _rows_of_errors(pressed: _Pressed) -> list[Row]:
    """Return the rows of all errors that are asked for: of the area alone, and of all answers."""
    rows = []
    for error in ERRORS:
        rows += _rows_of_error(pressed, "area", error, (AREA,))
        rows += _rows_of_error(pressed, "all", error, pressed.answers)
    return rows


def _rows_of_error(
    pressed: _Pressed, asked_for: str, error: float, answers: Sequence[str]
) -> list[Row]:
    """Ask for some answers within an error, and return a row for each of them."""
    judged = [
        _Judged(pressed, asked_for=asked_for, asked_error=error, answer=answer)
        for answer in answers
    ]
    heights = pressed.sample.heights(pressed.sample.nodes)
    try:
        contact = bem.solve_within(
            heights,
            1.0,
            dict.fromkeys(answers, error),
            threads=1,
            **{pressed.load: pressed.value},
            **pressed.settings,
        )
    except (bem.NotReachable, bem.NoSolution, bem.NotConverged) as refusal:
        return [row.unanswered(str(refusal)) for row in judged]
    assert contact.budget is not None  # for mypy: solve_within always returns it
    rows = []
    for row in judged:
        value = float(ANSWERS[row.answer].value(contact))
        bar = contact.budget.errors[row.answer].total
        rows.append(row.answered(value, bar, contact.pressure.shape[0]))
    return rows


@dataclass(frozen=True)
class _Judged:
    """An answer of a contact whose error was asked for, or whose bar on the map is judged."""

    pressed: _Pressed
    asked_for: str  # "area", "all" answers, or "map" for the bar of the map
    asked_error: float  # relative error [1]; NaN for the bar of the map
    answer: str  # name of the answer

    def answered(self, value: float, bar: float, grid: int) -> Row:
        """Return the row of a value with its bar [1], on a grid of `grid` nodes along x."""
        true_value = self.pressed.true_value(self.answer)
        return {
            **self._beginning(),
            "answered": True,
            "grid": grid,
            "bar_percent": 100 * bar,
            "off_percent": 100 * abs(value / true_value - 1),
            "reason": "",
        }

    def unanswered(self, reason: str) -> Row:
        """Return the row of an answer that was refused, with the reason."""
        return {
            **self._beginning(),
            "answered": False,
            "grid": "",
            "bar_percent": "",
            "off_percent": "",
            "reason": reason,
        }

    def _beginning(self) -> Row:
        """Return the first columns of a row."""
        return {
            **self.pressed.description(),
            "asked_for": self.asked_for,
            "asked_percent": 100 * self.asked_error,
            "answer": self.answer,
        }
