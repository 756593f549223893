"""Surfaces of a population that was fitted to measured maps.

The file of the population is read once, when a run begins. The scene in the database holds its
content, so that neither the file nor the maps are needed afterwards.
"""

from __future__ import annotations

import functools
import hashlib
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, Self

from pydantic import Field, PlainValidator, ValidationInfo, model_validator
from pydantic_core import PydanticCustomError

from gen.arrays import Heights
from gen.distribution import AboveZero, Table, conflict
from gen.generators.function import Hash
from gen.population import LARGEST_FILE, Population, generate_like
from gen.runtime.errors import InputError
from gen.runtime.files import read_bytes
from gen.spectral import MOST_PERIOD_NODES, OR_DRAWN
from gen.surface import (
    NODES,
    Drawn,
    GeneratedSurface,
    Grid,
    Nodes,
    Parameters,
    Patch,
    Random,
    pair,
)

# Largest length of the period out of which a patch without periodic borders is cut, in sides of the
# patch. The period is shorter if the longest waves of the maps are.
LONGEST_PERIOD = 2
FEWEST_PERIOD_NODES = 4  # nodes along an axis of a period that holds a wave


def _file(value: object, info: ValidationInfo) -> str:
    """Validate the key `population`: return the path of the file.

    A relative path starts from the folder of the scene's file, if the context of the validation has
    the key "folder". Raise PydanticCustomError for a value that is no name.
    """
    if not isinstance(value, str) or not value.strip():
        raise PydanticCustomError("file", "not a name")
    if info.context is None:
        return value
    return str(info.context["folder"].absolute() / Path(value).expanduser())


File = Annotated[str, PlainValidator(_file)]


class RecordedPopulation(Table):
    """The population that a run has found: the content of its file."""

    sha256: Hash = Field(description="the SHA-256 of the file's content")
    text: str = Field(max_length=LARGEST_FILE, description="the file's content")

    @model_validator(mode="after")
    def _require_content_of_hash(self) -> Self:
        """Refuse a text that has another SHA-256 or is no population."""
        if hashlib.sha256(self.text.encode()).hexdigest() != self.sha256:
            raise conflict("the content of the population is not that of its SHA-256")
        try:
            self.population  # noqa: B018
        except InputError as error:
            raise conflict(str(error)) from None
        return self

    @property
    def population(self) -> Population:
        """The population."""
        return _parsed(self.text)


@functools.lru_cache(maxsize=8)
def _parsed(text: str) -> Population:
    """Return the population with a text; each process parses it once."""
    return Population.parse(text, "the population")


class LikeSurface(GeneratedSurface):
    """Surfaces like measured maps, of a population that `gen scene --like` has fitted.

    The population is recorded when `found` is set.
    """

    FOLLOWS_MAPS: ClassVar[bool] = True

    generator: Literal["like"]
    population: File = Field(
        description="the name of a file that gen scene --like has written"
    )
    nodes: Nodes = Field(default=128, description=NODES)
    scale: Annotated[AboveZero, Drawn("1", "heights over those of the population")] = (
        Field(default=1.0, description=f"a number above 0{OR_DRAWN}")
    )
    # None in the user's scene; a run writes it when it begins.
    found: RecordedPopulation | None = Field(
        default=None, description="the population that a run has found"
    )

    @property
    def is_complete(self) -> bool:
        """Override `GeneratedSurface.is_complete`: whether the population is recorded."""
        return self.found is not None

    def recorded_population(self) -> Population:
        """Return the population that a run has recorded in this table.

        Returns
        -------
        Population
            The population.

        Raises
        ------
        InputError
            If no run has recorded a population in this table.
        """
        if self.found is None:
            raise InputError("the population of this scene has not been looked for")
        return self.found.population

    def patch(self, boundary: str, *, cells: bool) -> Patch:
        """Override `GeneratedSurface.patch`: the nodes of the table, at the population's spacing.

        InputError unless the population is recorded.
        """
        dx, dy = self.recorded_population().spacing
        nx, ny = pair(self.nodes)
        if cells:
            return Patch(nodes=(nx, ny), sides=(dx * nx, dy * ny))
        return Patch(nodes=(nx, ny), sides=(dx * (nx - 1), dy * (ny - 1)))

    def relevant(self, content: dict[str, Any]) -> dict[str, Any]:
        """Return the keys and values on which results depend: the hash stands for the population.

        If no population is recorded, all keys are returned as they are.
        """
        if self.found is None:
            return content
        relevant = {key: content[key] for key in content.keys() - {"population"}}
        relevant["found"] = {"sha256": self.found.sha256}
        return relevant

    def sources(self) -> list[Path]:
        """Return a list of the population's file.

        The list is empty if the population is recorded and the file no longer exists.
        """
        path = Path(self.population)
        if self.found is not None and not path.is_file():
            return []
        return [path]

    def resolved(self, home: Path | None) -> Self:
        """Return the table with the content of the population's file.

        A table with a recorded population is returned as it is. InputError if the file is missing
        or no population.
        """
        if self.found is not None:
            return self
        try:
            content = read_bytes(Path(self.population), LARGEST_FILE)
            text = content.decode()
        except (FileNotFoundError, ValueError) as error:
            reason = "there is no such file"
            if not isinstance(error, FileNotFoundError):
                reason = f"no population: {error}"
            raise InputError(f"surface.population: {self.population}: {reason}") from None
        Population.parse(text, self.population)
        recorded = RecordedPopulation(
            sha256=hashlib.sha256(content).hexdigest(), text=text
        )
        return self.model_copy(update={"found": recorded})

    def remarks(self) -> list[str]:
        """Return lines about the population: its maps, waves and imperfections, and warnings.

        The warnings are the sentences on properties of the maps that the surfaces do not have.
        """
        population = self.recorded_population()
        names = ", ".join(source.name for source in population.maps)
        longest = " x ".join(f"{length:.4g}" for length in population.longest)
        dx, dy = population.spacing
        nx, ny = pair(self.nodes)
        lines = [
            f"surfaces like {names}; waves from {population.shortest:.4g} um on carry roughness"
        ]
        if population.imperfections:
            lines.append(
                "pits, dust and scratches of the maps are copied to random places; there are"
                f" {len(population.imperfections)} on the maps"
            )
        if population.parts is not None:
            part_x, part_y = population.parts.nodes
            lines.append(
                f"patches of {part_x} x {part_y} nodes are each like one of"
                f" {len(population.parts.members)} parts of the maps, which differ from place"
                " to place"
            )
        if any(
            side > length * (1 + 1e-9)
            for side, length in zip((nx * dx, ny * dy), population.longest, strict=True)
        ):
            lines.append(
                f"the maps tell of waves up to {longest} um: the spectrum of longer ones is"
                " continued flat"
            )
        lines += [f"warning: {remark}" for remark in population.remarks]
        return lines

    def period_nodes(self, grid: Grid) -> tuple[int, int]:
        """Return the nodes of a surface's period along both axes.

        If the borders of the patch are periodic, the period is the patch. Otherwise it is as long
        as the longest waves of the maps, but at least as long as the patch, and at most twice as
        long. It is then lengthened to numbers of nodes with fast Fourier transforms.

        Parameters
        ----------
        grid : Grid
            The grid of the patch.

        Returns
        -------
        tuple of int
            Nodes along x and y.
        """
        from scipy.fft import next_fast_len

        if grid.boundary == "periodic":
            return grid.shape
        of_maps = self.recorded_population().nodes
        nx, ny = (
            next_fast_len(
                max(patch, FEWEST_PERIOD_NODES, min(longest, LONGEST_PERIOD * patch)),
                real=True,
            )
            for patch, longest in zip(grid.shape, of_maps, strict=True)
        )
        return nx, ny

    def fault_on(self, grid: Grid) -> str:
        """Say why surfaces cannot be made on the grid; return "" if they can.

        The grid may have too few nodes for a wave, or too many.
        """
        nx, ny = self.period_nodes(grid)
        if min(nx, ny) < FEWEST_PERIOD_NODES:
            return (
                f"{nx} x {ny} nodes hold no wave: give at least {FEWEST_PERIOD_NODES}"
                " along both axes"
            )
        if max(nx, ny) > MOST_PERIOD_NODES:
            return f"its period has {nx} x {ny} nodes: give at most {MOST_PERIOD_NODES}"
        return ""

    def heights(
        self, grid: Grid, surface: int, parameters: Parameters, random: Random
    ) -> Heights:
        """Return a surface of the population; see `GeneratedSurface.heights`.

        If the period is longer than the patch, the surface is a corner of the period.
        """
        heights = generate_like(
            self.recorded_population(), grid.shape, self.period_nodes(grid), random
        )
        heights *= parameters["scale"]
        heights -= heights.min()
        return heights
