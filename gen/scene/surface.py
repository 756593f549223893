"""The rough surfaces of a scene: a table for each kind of generator."""

import math
from typing import Annotated, Any, Literal, Self, TypeVar

from pydantic import (
    AfterValidator,
    Discriminator,
    Field,
    PlainValidator,
    Tag,
    model_validator,
)
from pydantic_core import PydanticCustomError

from gen.runtime.errors import InputError
from gen.scene.distribution import (
    AboveZero,
    AnyNumber,
    AtLeastZero,
    Distribution,
    FromZeroToOne,
    limits,
)
from gen.scene.scans import FILES, Files, Found, Preparation, Reading, files
from gen.scene.table import Positive, Table
from gen.scene.user_function import FUNCTION_WORDS, Function, Hash, named

T = TypeVar("T", int, float)

ROUNDING = 1e-12
"""Share by which rounding may take a wave beyond a limit, as in `gen.spectral`."""

FARTHEST = 1e30
"""Largest roll-off over the longest wave: beyond it has no effect, and its powers overflow."""

MOST_NODES = 4097
"""Largest number of nodes along an axis."""

MOST_PERIOD_NODES = 4 * MOST_NODES
"""Largest number of nodes along an axis of a surface's period: its waves take 10 GB."""


def _power_of_two_plus_one(nodes: int) -> int:
    """Refuse a number of nodes that random midpoint displacement cannot make."""
    if (nodes - 1) & (nodes - 2):
        raise ValueError(f"{nodes} - 1 is not a power of two")
    return nodes


def _nodes(value: object) -> int | tuple[int, int]:
    """Accept a number of nodes for both axes, or one for each."""
    pair: tuple[Any, ...] = tuple(value) if isinstance(value, list | tuple) else (value, value)
    if len(pair) != 2 or not all(
        isinstance(number, int) and not isinstance(number, bool) and 2 <= number <= MOST_NODES
        for number in pair
    ):
        raise PydanticCustomError("nodes", "not a number of nodes or a pair of them")
    return (pair[0], pair[1]) if isinstance(value, list | tuple) else int(pair[0])


def _side(value: object) -> float | tuple[float, float]:
    """Accept a length for both axes, or one for each."""
    pair: tuple[Any, ...] = tuple(value) if isinstance(value, list | tuple) else (value, value)
    if len(pair) != 2 or not all(
        isinstance(length, int | float) and not isinstance(length, bool) and 0 < length < 1e300
        for length in pair
    ):
        raise PydanticCustomError("side", "not a length or a pair of them")
    lengths = float(pair[0]), float(pair[1])
    return lengths if isinstance(value, list | tuple) else lengths[0]


Nodes = Annotated[int | tuple[int, int], PlainValidator(_nodes)]
Side = Annotated[float | tuple[float, float], PlainValidator(_side)]
NODES = f"a whole number from 2 to {MOST_NODES}, or one for each axis, [nx, ny]"
SIDE = "a finite number above 0, or one for each axis, [x, y] [um]"


def _pair(value: T | tuple[T, T]) -> tuple[T, T]:
    """Return a value for each axis."""
    return value if isinstance(value, tuple) else (value, value)


def _another(value: object) -> str | tuple[str, ...]:
    """Accept the only second body that a generator can make."""
    if value != ANOTHER:
        raise PydanticCustomError("another", "not the word")
    return ANOTHER


def _another_or_files(value: object) -> str | tuple[str, ...]:
    """Accept another window of the same maps, or the files of other maps."""
    return ANOTHER if value == ANOTHER else files(value)


ANOTHER = "another"
"""Second rough body of the same population."""

Another = Annotated[str | tuple[str, ...], PlainValidator(_another)]
AnotherOrFiles = Annotated[str | tuple[str, ...], PlainValidator(_another_or_files)]


class GeneratedSurface(Table):
    """Rules of every table of surfaces, which the plan and the solver rely on."""

    # Without the key the other body is flat.
    against: Another | None = Field(
        default=None,
        description="'another', for a second rough body: another surface of the same parameters",
    )

    def shape(self, *, edgeless: bool) -> tuple[int, int]:
        """Return the nodes along x and y of the solved grid."""
        raise NotImplementedError

    def sides(self, *, cells: bool) -> tuple[float, float]:
        """Return the lengths of the patch along x and y [um].

        `cells` tells whether they are those of all cells rather than of the outer nodes.
        """
        raise NotImplementedError

    def has_sides(self) -> bool:
        """Tell whether the lengths of the patch are known."""
        return True

    def drawn(self) -> dict[str, Distribution]:
        """Return the distributions of the parameters that are drawn for each surface."""
        return {}

    def fault_on(self, spacing: tuple[float, float], boundary: str) -> str:
        """Return why some surfaces cannot be made with a spacing [um] and a boundary, or ""."""
        return ""

    def places(self) -> frozenset[str]:
        """Return the names of the columns that say where a surface was taken from."""
        return frozenset()

    def relevant(self, content: dict[str, Any]) -> dict[str, Any]:
        """Return the keys of the table that change results, given all its keys."""
        return content


class DisplacedSurface(GeneratedSurface):
    """Surfaces of random midpoint displacement.

    The defaults are the paper's (section 3.2, Table 1). The paper does not give `sigma0`: its
    default is calibrated so that the 22 statistics have the ranges of Table 1.
    """

    generator: Literal["diamond-square", "midpoint"] = Field(
        default="diamond-square",
        description="'diamond-square', 'midpoint', 'spectral', 'scans' or 'python'",
    )
    nodes: Annotated[int, Field(ge=3, le=MOST_NODES), AfterValidator(_power_of_two_plus_one)] = (
        Field(default=129, description="2^k + 1 nodes a side, a whole number from 3 to 4097")
    )
    side: Positive = Field(default=1000.0, description="a finite number above 0 [um]")
    hurst: FromZeroToOne = Field(
        default=(0.5, 0.8),
        description="two numbers [low, high] with 0 <= low <= high <= 1, one number, or a"
        " distribution",
    )
    sigma0: AtLeastZero = Field(
        default=(10.0, 15.0),
        description="two finite numbers [low, high] with 0 <= low <= high, one number, or a"
        " distribution [um]",
    )

    def shape(self, *, edgeless: bool) -> tuple[int, int]:
        """Return 2^k nodes along both axes on a patch without edges, otherwise 2^k + 1."""
        return (self.nodes - edgeless,) * 2

    def sides(self, *, cells: bool) -> tuple[float, float]:
        """Return the side twice [um]."""
        return self.side, self.side

    def drawn(self) -> dict[str, Distribution]:
        """Return the Hurst exponent [1] and the first displacements' deviation [um]."""
        return {"hurst": self.hurst, "sigma0": self.sigma0}


class GridSurface(GeneratedSurface):
    """Rules of surfaces on any rectangular grid."""

    nodes: Nodes = Field(default=128, description=NODES)
    side: Side = Field(default=1000.0, description=SIDE)

    def shape(self, *, edgeless: bool) -> tuple[int, int]:
        """Return the given nodes along x and y."""
        return _pair(self.nodes)

    def sides(self, *, cells: bool) -> tuple[float, float]:
        """Return the lengths of the patch along x and y [um]."""
        return _pair(self.side)


def _smooth(nodes: int) -> int:
    """Return the first number from `nodes` on without prime factors above 5: it transforms fast."""
    while True:
        rest = nodes
        for factor in (2, 3, 5):
            while rest % factor == 0:
                rest //= factor
        if rest == 1:
            return nodes
        nodes += 1


class SpectralSurface(GridSurface):
    """Self-affine surfaces with a given power spectrum and random phases."""

    generator: Literal["spectral"] = Field(description="'spectral'")
    hurst: FromZeroToOne = Field(
        default=0.8,
        description="a number from 0 to 1, [low, high] or a distribution of these",
    )
    roll_off: AboveZero = Field(
        description="a wavelength above 0, [low, high] or a distribution of these [um]"
    )
    cut_off: AboveZero = Field(
        description="a wavelength above 0, [low, high] or a distribution of these [um]"
    )
    rms_height: AtLeastZero | None = Field(
        default=None, description="a number from 0 on, [low, high] or a distribution of these [um]"
    )
    rms_slope: AtLeastZero | None = Field(
        default=None, description="a number from 0 on, [low, high] or a distribution of these"
    )
    stretch: AboveZero = Field(
        default=1.0,
        description="a number above 0, [low, high] or a distribution of these: wavelengths along x"
        " over those along y",
    )
    # Scenes that do not give it take 1 on periodic patches, otherwise 2.
    period: Annotated[float, Field(ge=1, le=16)] | None = Field(
        default=None, description="the surface's period in sides of the patch, from 1 to 16"
    )

    @model_validator(mode="after")
    def _require_one_rms(self) -> Self:
        """Refuse surfaces without a height, or with two, and a cut-off beyond the roll-off."""
        if (self.rms_height is None) == (self.rms_slope is None):
            raise PydanticCustomError("conflict", "give either rms_height or rms_slope")
        longest, shortest = limits(self.cut_off)[1], limits(self.roll_off)[0]
        if longest > shortest:
            raise PydanticCustomError(
                "conflict",
                f"cut_off is up to {longest:g} um and roll_off from {shortest:g} um on: the cut-off"
                " is the shorter wavelength",
            )
        return self

    def periods(self, boundary: str) -> float:
        """Return the surface's period in sides of a patch with a boundary [1]."""
        if self.period is not None:
            return self.period
        return 1.0 if boundary == "periodic" else 2.0

    def period_nodes(self, boundary: str) -> tuple[int, int]:
        """Return the nodes along x and y of a surface's period on a patch with a boundary.

        A period that is not the patch itself is rounded up to a number that suits transforms.
        """
        nx, ny = self.shape(edgeless=boundary != "free")
        if (periods := self.periods(boundary)) == 1.0:
            return nx, ny
        return _smooth(math.ceil(periods * nx)), _smooth(math.ceil(periods * ny))

    def fault_on(self, spacing: tuple[float, float], boundary: str) -> str:
        """Return why a wave may be too short for the grid, or too long for the period, or ""."""
        if max(self.period_nodes(boundary)) > MOST_PERIOD_NODES:
            nx, ny = self.period_nodes(boundary)
            return (
                f"its period has {nx} x {ny} nodes, {self.periods(boundary):g} times those of the"
                f" patch: give a shorter period, at most {MOST_PERIOD_NODES} nodes"
            )
        (shortest, longest), stretches = limits(self.cut_off), limits(self.stretch)
        finest = max(2 * spacing[0] / stretches[0], 2 * spacing[1])
        if shortest * (1 + ROUNDING) < finest:
            return (
                f"cut_off is from {shortest:g} um on; this grid holds waves of {finest:.6g} um"
                " and more: give a longer cut_off or more nodes"
            )
        periods = zip(self.period_nodes(boundary), spacing, (stretches[1], 1.0), strict=True)
        most = max(nodes * pitch / ratio if nodes > 2 else 0.0 for nodes, pitch, ratio in periods)
        if longest > most * (1 + ROUNDING):
            return (
                f"cut_off is up to {longest:g} um and the longest wave of the period {most:.6g} um:"
                " give a shorter cut_off"
            )
        if (beyond := limits(self.roll_off)[1]) > FARTHEST * most:
            return f"roll_off is up to {beyond:g} um: give at most {FARTHEST * most:g} um"
        return ""

    def drawn(self) -> dict[str, Distribution]:
        """Return Hurst exponent [1], wavelengths [um], rms height [um] or slope, and stretch."""
        names = ("hurst", "roll_off", "cut_off", "rms_height", "rms_slope", "stretch")
        values = {name: getattr(self, name) for name in names}
        return {name: value for name, value in values.items() if value is not None}


class PythonSurface(GridSurface):
    """Surfaces that a function of the user's makes: (shape, spacing, rng, **parameters)."""

    generator: Literal["python"] = Field(description="'python'")
    function: Function = Field(description=FUNCTION_WORDS)
    parameters: Annotated[dict[str, AnyNumber], AfterValidator(named)] = Field(
        default={}, description="a table of numbers, [low, high] and distributions by their names"
    )
    # Written when a run begins: the SHA-256 of the module's source.
    source: Hash | None = Field(default=None, description="the SHA-256 of the module's source")

    def drawn(self) -> dict[str, Distribution]:
        """Return the user's parameters."""
        return dict(self.parameters)


class ScanSurface(GeneratedSurface):
    """Windows of measured maps."""

    generator: Literal["scans"] = Field(description="'scans'")
    files: Files = Field(description=FILES)
    nodes: Nodes = Field(default=128, description=NODES)
    spacing: Side | None = Field(default=None, description=SIDE)
    reading: Reading = Field(default=Reading(), description="a table of options as unit = 'nm'")
    preparation: Preparation = Field(
        default=Preparation(), description="a table of steps as level = 'plane'"
    )
    against: AnotherOrFiles | None = Field(
        default=None,
        description=f"'another', for a second window of a tile, or maps of another body: {FILES}",
    )
    # Written when a run begins, as the hash of a user's function.
    found: Found | None = Field(default=None, description="the maps that a run has found")
    against_found: Found | None = Field(
        default=None, description="the maps of the second body that a run has found"
    )

    def shape(self, *, edgeless: bool) -> tuple[int, int]:
        """Return the given nodes along x and y."""
        return _pair(self.nodes)

    def sides(self, *, cells: bool) -> tuple[float, float]:
        """Return the lengths of a window along x and y [um]; the maps have to be known."""
        maps, (nx, ny) = self.known(), _pair(self.nodes)
        return maps.spacing[0] * (nx - (not cells)), maps.spacing[1] * (ny - (not cells))

    def has_sides(self) -> bool:
        """Tell whether a run has found the maps, whose spacing decides."""
        return self.found is not None

    def known(self) -> Found:
        """Return the maps that a run has found; unknown before a run."""
        if self.found is None:
            raise InputError("the maps of this scene have not been looked for")
        return self.found

    def alone(self) -> Self:
        """Return the table of the first body's windows."""
        return self.model_copy(update={"against": None, "against_found": None})

    def opposite(self) -> Self:
        """Return the table of the second body's windows; there has to be one."""
        if self.against == ANOTHER:
            return self.alone()
        other = {"files": self.against, "found": self.against_found}
        return self.alone().model_copy(update=other)

    def places(self) -> frozenset[str]:
        """Return the columns of the map and of its tile."""
        return frozenset(("map", "tile"))

    def relevant(self, content: dict[str, Any]) -> dict[str, Any]:
        """Leave out where the maps are, once they are known by their contents."""
        if self.found is None:
            return content
        kept = {key: value for key, value in content.items() if key != "files"}
        kept["found"] = _contents(self.found)
        if self.against_found is not None:
            kept["against"] = _contents(self.against_found)
            del kept["against_found"]
        return kept


def _contents(found: Found) -> dict[str, Any]:
    """Return what identifies maps: their spacing, contents and nodes, not their places."""
    maps = tuple(
        f"{each.sha256}, {each.nodes[0]} x {each.nodes[1]}"  # short enough for a message
        for each in found.maps
    )
    return {"spacing": found.spacing, "number": len(maps), "maps": maps}


TAGS: dict[str, type[GeneratedSurface]] = {
    "<displaced>": DisplacedSurface,
    "<scans>": ScanSurface,
    "<spectral>": SpectralSurface,
    "<python>": PythonSurface,
}
"""Tables of surfaces by the tags that locations of errors have."""


def tag_of(value: object) -> str:
    """Return the tag of the rules for a table of surfaces, the paper's if it names no generator."""
    generator = (
        value.get("generator") if isinstance(value, dict) else getattr(value, "generator", None)
    )
    tag = f"<{generator}>"
    return tag if tag in TAGS else "<displaced>"


Surface = Annotated[
    Annotated[DisplacedSurface, Tag("<displaced>")]
    | Annotated[ScanSurface, Tag("<scans>")]
    | Annotated[SpectralSurface, Tag("<spectral>")]
    | Annotated[PythonSurface, Tag("<python>")],
    Discriminator(tag_of),
]
"""A table of surfaces by the rules of its generator."""
