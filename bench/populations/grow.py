"""The promise of `learn grow` against the truth: growths to an error, judged on fresh rows.

Two populations, each with several seeds: the surfaces of the scene `quick`, and windows of a folder
of made maps, whose scene is drafted as the command does, with windows of 64 nodes a side. Fresh
rows are later rows of the same scene, one a surface; of maps those in tiles that are held out.
"""

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from bench.picture import new_figure
from bench.populations.made_maps import ONE_INSTRUMENT, write_all
from bench.report import Report, remark
from gen.draft.loads import Material
from gen.generation.completion import completed
from gen.generation.plan import parameters
from gen.generation.sample import compute_rows, surface_of
from gen.runtime.output import make_folder
from gen.scans.library import Reading
from gen.scene import Scene, load
from gen.schema import Reason, Status
from learn.executor import Executor
from learn.grow import picture, rounds
from learn.grow.accuracy import Accuracy, accuracy
from learn.grow.holdout import drawn
from learn.grow.pace import Pace
from learn.grow.population import Population, scene_of
from learn.grow.rounds import Grown, Order
from learn.request import Request
from learn.surrogate.model import Surrogate

Row = dict[str, Any]

MARKS = {"quick": 3.0, "maps": 5.0}
"""Populations, and the nMAE that each is to be grown to [%]."""

NODES = 64
"""Nodes a side of the windows of maps."""

FIRST = 1_000_000
"""First surface of the fresh rows, far behind those that a growth makes."""

MOST = 20_000
"""Most rows of a growth, the command's default."""


@dataclass(frozen=True, eq=False)
class Trial:
    """A growth and its truth.

    Attributes
    ----------
    population : str
        A key of `MARKS`.
    seed : int
        Seed of the scene.
    grown : Grown
        The growth.
    looks : int
        Surrogates that were fitted and judged.
    seconds : float
        Wall-clock time [s].
    truth : dict of str to Accuracy
        Error of each target on the fresh rows.
    """

    population: str
    seed: int
    grown: Grown
    looks: int
    seconds: float
    truth: dict[str, Accuracy]

    def rows(self) -> Iterator[Row]:
        """Yield a row of the table for each target."""
        last = self.grown.last
        assert last is not None
        for target, truth in self.truth.items():
            found = last.judged[target].accuracy
            yield {
                "population": self.population,
                "seed": self.seed,
                "asked": last.mark,
                "ending": self.grown.ending,
                "rows": last.rows,
                "looks": self.looks,
                "seconds": self.seconds,
                "target": target,
                "nmae": found.nmae,
                "error": found.error,
                "at_most": last.bound(target),
                "fresh_nmae": truth.nmae,
                "fresh_error": truth.error,
                "fresh_surfaces": truth.groups,
            }


def grow(
    folder: Path, fresh: int, seeds: int, marks: dict[str, float] | None = None
) -> list[Trial]:
    """Grow surrogates of each population, and judge them on fresh rows.

    Parameters
    ----------
    folder : Path
        Folder for maps, databases and surrogates; growths that are there go on.
    fresh : int
        Number of fresh rows.
    seeds : int
        Number of growths of each population, each of another seed.
    marks : dict of str to float, optional
        Populations and their marks; `MARKS` by default.
    """
    trials = []
    for population, mark in (MARKS if marks is None else marks).items():
        for number in range(seeds):
            scene = _scene(folder, population)
            scene = scene.model_copy(update={"seed": scene.seed + number})
            trials.append(_trial(folder, population, scene, mark, fresh))
            remark(_in_words(trials[-1]))
    return trials


def _scene(folder: Path, population: str) -> Scene:
    """Return the scene of a population; the maps are written where there are none."""
    if population != "maps":
        return load(population)
    maps = folder / "maps"
    if not maps.is_dir():  # some formats hold the time at which they were written
        write_all(maps, ONE_INSTRUMENT)
    steel = Material(young=210e3, poisson=0.3, known=True)
    drafted = Population(str(maps), Reading("", "", ""), steel, (), "python -m bench grow")
    scene = scene_of(drafted, folder / "maps.toml", remark)
    windows = scene.surface.model_copy(update={"nodes": NODES})
    return scene.model_copy(update={"surface": windows})


def _trial(folder: Path, population: str, scene: Scene, mark: float, fresh: int) -> Trial:
    """Grow a surrogate of a scene and judge it."""
    home = folder / "databases"
    make_folder(home)
    name = f"{population}-{scene.seed}"
    request = Request(
        database=home / f"{name}.h5",
        output=home / f"{name}.surrogate",
        targets=("area", "force"),
        models=("kernel-ridge",),
        normalisation="standard",
        features="hybrid",
        roots=True,
    )
    looks, began = 0, time.monotonic()

    def say(line: str) -> None:
        nonlocal looks
        looks += "; asked: " in line
        remark(line)

    order, pace = Order(request, mark, MOST), Pace(None, 1)
    grown = rounds.grow(order, scene, Executor(), pace, say, lambda: False)
    seconds = time.monotonic() - began
    assert grown.last is not None
    whole = completed(scene, home)
    truth = judged_on_fresh(grown.last.surrogate, whole, fresh)
    return Trial(population, scene.seed, grown, looks, seconds, truth)


def judged_on_fresh(surrogate: Surrogate, scene: Scene, count: int) -> dict[str, Accuracy]:
    """Solve fresh rows of a scene, predict them, and return the error of each target."""
    truths: list[list[float]] = []
    predicted: list[list[float]] = []
    groups: list[int] = []
    columns = [each.column for each in surrogate.learnt.values()]
    for row in _fresh_rows(scene):
        if len(truths) == count:
            break
        solved, plan = compute_rows(scene, row, row + 1), parameters(scene, row, row + 1)
        if solved["status"][0] != Status.DONE or solved["reason"][0] != Reason.NONE:
            continue
        asked = surrogate.for_surface(surface_of(scene, plan, 0), scene.sides)
        found = asked.predict(float(solved["delta"][0]), hardness=plan.hardness_of(0))
        truths.append([float(solved[column][0]) for column in columns])
        predicted.append([float(found.values[target][0]) for target in surrogate.learnt])
        groups.append(int(solved["tile"][0]) if "tile" in solved else row)
    truth, prediction = np.array(truths), np.array(predicted)
    return {
        target: accuracy(
            np.abs(prediction[:, place] - truth[:, place]), truth[:, place], np.array(groups)
        )
        for place, target in enumerate(surrogate.learnt)
    }


def _fresh_rows(scene: Scene) -> Iterator[int]:
    """Yield the first row of each later surface, of maps those in tiles that are held out."""
    from gen.populations.scans import tile_groups

    surface = FIRST
    while True:
        row = surface * scene.samples_per_surface
        places = parameters(scene, row, row + 1).places
        surface += 1
        if "tile" in places:
            tiles = np.asarray(places["tile"], dtype=np.int64)
            if not drawn(tiles, scene.seed, min(5, tile_groups(scene)))[0]:
                continue
        yield row


def report(trials: Sequence[Trial]) -> Report:
    """Make a report: the table, the picture of the first growth of each population, words."""
    pictures = {}
    for trial in trials:
        last = trial.grown.last
        if last is not None and trial.population not in pictures:
            figure = new_figure(picture.WIDTH, picture.HEIGHT)
            picture.draw(figure, last, trial.grown.curve)
            pictures[trial.population] = figure
    return Report(
        {"grow": [row for trial in trials for row in trial.rows()]},
        pictures=pictures,
        text="\n".join(map(_in_words, trials)),
        text_name="grow",
    )


def _in_words(trial: Trial) -> str:
    """Return the time of a growth, and its promise beside the truth, as a line."""
    last = trial.grown.last
    assert last is not None
    ended = "met" if last.met else f"not met ({trial.grown.ending})"
    errors = "; ".join(
        f"{target}: nMAE {last.judged[target].accuracy.nmae:.2f} %, at most"
        f" {last.bound(target):.2f} %; on {truth.groups} fresh surfaces or tiles"
        f" {truth.nmae:.2f} +- {truth.error:.2f} %"
        for target, truth in trial.truth.items()
    )
    return (
        f"{trial.population}, seed {trial.seed}: {last.mark:g} % {ended} with {last.rows} rows in"
        f" {trial.looks} looks and {trial.seconds:.0f} s; {errors}"
    )
