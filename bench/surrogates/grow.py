"""The errors that `learn grow` promises, beside the true errors on fresh surfaces.

There are two populations: the surfaces of the scene `quick`, and windows of a folder of made maps.
Surrogates of each are grown for several seeds, with the default options of the command. They are
judged on a database of the same scene with another seed. Its surfaces are new; of the windows of
maps, only those in tiles that the growth has held out judge.
"""

import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from bench.databases import generated, preset_text
from bench.files import Row, read_toml
from bench.made_maps import ONE_INSTRUMENT, write_all
from bench.picture import new_figure
from bench.report import Report, remark
from gen.arrays import Indices
from gen.database import Reader
from gen.generators.scans import ScanSurface
from gen.runtime.errors import InputError
from gen.runtime.files import make_folder
from gen.scene import Scene
from learn import dataset
from learn.database_rows import Dataset
from learn.dataset import Request
from learn.executor import led
from learn.grow.accuracy import SHARE, Accuracy, Look, drawn_for_holdout, judge
from learn.grow.rounds import Growth, draw
from learn.split import TILE

FRESH_SEED = 77
"""Seed of the databases that judge, which is that of no growth."""

ROW_LIMIT = 20_000
"""Largest number of rows of a growth, the default of the command."""

FEWEST_FRESH = 20
"""Smallest number of fresh rows that is accepted."""

PICTURE = (10.0, 4.6)
"""Width and height of the picture of a growth [inch]."""


@dataclass(frozen=True)
class Population:
    """A population of surfaces, and the error to which its surrogates are grown."""

    name: str  # name in the table
    scene: str  # scene (TOML), without its numbers of rows and its seed
    mark: float  # largest nMAE that is asked for [%]
    first_seed: int  # seed of the first growth; the others have the following seeds


POPULATIONS = (
    Population(name="quick", scene=preset_text("quick"), mark=3.0, first_seed=2025),
    Population(
        name="maps",
        scene=read_toml("surrogates/scenes")["windows"]["scene"],
        mark=5.0,
        first_seed=2025,
    ),
)
"""The populations that are judged."""


@dataclass(frozen=True, eq=False)
class Grown:
    """A growth, and the true errors of its last surrogate."""

    population: Population
    seed: int  # seed of the scene
    ending: str  # why the growth ended
    last: Look  # the last surrogate, as the growth has judged it
    looks: int  # number of surrogates that were fitted and judged
    seconds: float  # wall-clock time [s]
    truth: dict[str, Accuracy]  # error of each target on fresh rows

    def rows(self) -> Iterator[Row]:
        """Yield a row of the table for each target."""
        for target, truth in self.truth.items():
            estimate = self.last.judged[target].accuracy
            yield {
                "population": self.population.name,
                "seed": self.seed,
                "asked": self.population.mark,
                "ending": self.ending,
                "rows": self.last.rows,
                "looks": self.looks,
                "seconds": self.seconds,
                "target": target,
                "nmae": estimate.nmae,
                "error": estimate.standard_error,
                "at_most": self.last.bound(target),
                "fresh_nmae": truth.nmae,
                "fresh_error": truth.standard_error,
                "fresh_surfaces": truth.groups,  # of windows of maps, their tiles
            }


def grow(folder: Path, fresh: int, seeds: int) -> Report:
    """Grow surrogates of each population, and judge them on fresh rows.

    Progress is printed on standard error.

    Parameters
    ----------
    folder : Path
        Folder of the report. Maps are written into its folder `maps`, databases and surrogates into
        `databases`. A growth whose files exist is continued.
    fresh : int
        Number of rows of each database that judges, `FEWEST_FRESH` or more. Of windows of maps
        about a fifth judges: those in tiles that the growth has held out.
    seeds : int
        Number of growths of each population, each with a seed of its own.

    Returns
    -------
    Report
        Table `grow`, with a row for each growth and target, and a picture of the first growth of
        each population.

    Raises
    ------
    InputError
        If there are too few fresh rows.
    """
    if fresh < FEWEST_FRESH:
        raise InputError(f"--fresh {fresh}: give {FEWEST_FRESH} or more")
    # Some formats hold the time of writing, so that maps written again would be other files.
    if not (folder / "maps").is_dir():
        write_all(folder / "maps", ONE_INSTRUMENT)
    home = folder / "databases"
    make_folder(home)
    growths: list[Grown] = []
    for population in POPULATIONS:
        text = f"samples = {fresh}\nseed = {FRESH_SEED}\n{population.scene}"
        judging = generated(home, f"{population.name}-fresh", text)
        for seed in range(population.first_seed, population.first_seed + seeds):
            growths.append(_grown(home, population, seed, judging))
            remark(_in_words(growths[-1]))
    return Report(
        {"grow": [row for growth in growths for row in growth.rows()]},
        pictures=_pictures(growths),
    )


def _grown(home: Path, population: Population, seed: int, judging: Path) -> Grown:
    """Grow a surrogate of a population, and judge it on the database `judging`."""
    name = f"{population.name}-{seed}"
    text = f"samples = {ROW_LIMIT}\nseed = {seed}\n{population.scene}"
    scene = Scene.parse(text, str(home / f"{name}.toml"), home)
    request = Request(
        databases=(home / f"{name}.h5",),
        output=home / f"{name}.surrogate",
        targets=("area", "force"),
        models=("kernel-ridge",),
        normalisation="standard",
        features="hybrid",
        roots=True,
    )
    began = time.monotonic()
    with led() as executor:
        growth = Growth(
            request=request,
            mark=population.mark,
            row_limit=ROW_LIMIT,
            scene=scene,
            executor=executor,
            say=remark,
        )
        ending, last = growth.grow()
    # Only a signal or a budget ends a growth before its first look.
    assert last is not None
    return Grown(
        population=population,
        seed=seed,
        ending=ending,
        last=last,
        looks=len(growth.errors),
        seconds=time.monotonic() - began,
        truth=_truth(last, request, judging, seed),
    )


def _truth(last: Look, request: Request, judging: Path, seed: int) -> dict[str, Accuracy]:
    """Return the error of each target on the rows of a database that the growth has not seen.

    `seed` is that of the growth. Of windows of maps, only those in tiles that it has held out
    judge.
    """
    sets = dataset.read(replace(request, databases=(judging,)), common=True)
    unseen = _unseen(sets[0], judging, seed)
    truth = {}
    for target, rows in zip(request.targets, sets, strict=True):
        learnt = last.surrogate.learnt[target]
        truth[target] = judge(learnt, rows.at(unseen)).accuracy
    return truth


def _unseen(rows: Dataset, judging: Path, seed: int) -> Indices:
    """Return the positions of rows of a database that a growth with this seed has not seen."""
    surface = rows.origins[0].scene.surface
    if not isinstance(surface, ScanSurface):
        return np.arange(rows.size)  # all surfaces are new
    with Reader(judging) as reader:
        tiles = np.asarray(reader.column(TILE), dtype=np.int64)[rows.rows]
    length = min(SHARE, surface.tile_groups())
    return np.flatnonzero(drawn_for_holdout(tiles, seed, length))


def _pictures(growths: list[Grown]) -> dict[str, Any]:
    """Draw the first growth of each population, as the command does."""
    pictures: dict[str, Any] = {}
    for growth in growths:
        name = growth.population.name
        if name not in pictures:
            pictures[name] = new_figure(*PICTURE)
            draw(pictures[name], growth.last)
    return pictures


def _in_words(growth: Grown) -> str:
    """Return a line about the end of a growth."""
    errors = ", ".join(
        f"{target} {truth.nmae:.2f} %" for target, truth in growth.truth.items()
    )
    return (
        f"{growth.population.name}, seed {growth.seed}: {growth.ending} with"
        f" {growth.last.rows} rows; on fresh surfaces {errors}"
    )
