"""The tables of a scene for the contact, the loads and the optional columns."""

import math
import sys
from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Any, Literal, Self, TypeAlias

from pydantic import AfterValidator, Field, Strict, create_model, model_validator

from gen.distribution import (
    SPANNED,
    AboveZero,
    AtLeastZero,
    Distribution,
    Number,
    Positive,
    Table,
    conflict,
    is_drawn,
    limits,
)
from gen.doubts import material_doubts
from gen.generators.function import FUNCTION_WORDS, Function, Hash, checked_names
from gen.material import Bodies, ElasticBody, LayeredBody
from gen.material import Layer as BondedLayer
from gen.quantities import LAYER_MODULUS, LAYER_THICKNESS, stored_quantities

if TYPE_CHECKING:
    from bem import Layered

Quantity = Literal[
    "delta", "delta/height_rms", "pressure", "pressure/(E* slope_rms)", "force"
]

UNITS: dict[Quantity, str] = {
    "delta": "um",
    "delta/height_rms": "1",
    "pressure": "MPa",
    "pressure/(E* slope_rms)": "1",
    "force": "uN",
}
"""Units of the quantities in which a scene can give its loads."""

HARDNESS = (
    "a finite number above 0, or [low, high] with 0 < low <= high [{}], or a distribution"
)
"""Allowed hardnesses in words; the braces are replaced by the unit."""

PIECES = "one or more { share = ..., range = [low, high] }, their shares sum to 1"

Unit = Annotated[str, Field(pattern=r"^[^\p{C}\p{Zl}\p{Zp}]{1,20}$")]
"""Unit of a user's output: 1 to 20 printable letters, which fit into a line of a table."""


OF_LAYER = "a finite number above 0, or [low, high], or a distribution [{}]"
"""Allowed numbers of a layer in words; the braces are replaced by the unit."""


class Layer(Table):
    """A layer that is bonded to the body of `[contact]`, or to a rigid one."""

    thickness: AboveZero = Field(description=OF_LAYER.format("um"))
    modulus: AboveZero = Field(description=OF_LAYER.format("MPa"))
    poisson: Annotated[Number, Field(gt=-1, le=0.5)] = Field(
        default=0.0, description="Poisson's ratio, a number above -1, at most 0.5"
    )
    base: Literal["elastic", "rigid"] = "elastic"

    @property
    def numbers(self) -> dict[str, Distribution]:
        """Thickness [um] and modulus [MPa], drawn or not, by the names of their columns."""
        return {LAYER_THICKNESS: self.thickness, LAYER_MODULUS: self.modulus}

    @property
    def drawn(self) -> dict[str, Distribution]:
        """Distributions of the numbers that are drawn for every sample, by the names of columns."""
        return {name: number for name, number in self.numbers.items() if is_drawn(number)}


def _span_text(distribution: Distribution) -> str:
    """Return a number, or the limits of a distribution, as text."""
    low, high = limits(distribution)
    if low == high:
        return f"{low:.6g}"
    return f"{low:.6g} to {high:.6g}"


class Contact(Table):
    """The material, the boundary and the discretisation of the contact, and the accuracy."""

    kernel: Literal["uniform-pressure", "concentrated-force"] = "uniform-pressure"
    far_field: Literal["rigid", "compliant"] = "rigid"
    # The text of a scene leaves out a free boundary, so that older scenes keep their fingerprints.
    boundary: Literal["free", "periodic", "mirror"] = "free"
    spacing: Literal["side/(n-1)", "side/n"] = "side/(n-1)"
    modulus: Positive = Field(
        default=1.0, description="Young's modulus, a finite number above 0 [MPa]"
    )
    poisson: Annotated[Number, Field(gt=-1, le=0.5)] = Field(
        default=0.0, description="Poisson's ratio, a number above -1, at most 0.5"
    )
    rtol: Annotated[Number, Field(gt=1e-14, lt=1)] = Field(
        default=2e-7, description="a number between 1e-14 and 1"
    )
    max_iterations: Annotated[int, Field(ge=1, le=1_000_000)] = Field(
        default=1000, description="a whole number from 1 to 1000000"
    )
    # Both hardnesses of elastic bodies are None. The text of a scene leaves them out.
    hardness: AboveZero | None = Field(default=None, description=HARDNESS.format("MPa"))
    hardness_ratio: AboveZero | None = Field(
        default=None, description=HARDNESS.format("E*")
    )
    # The text of a scene leaves out a layer that is None.
    layer: Layer | None = Field(default=None, description="a table [contact.layer]")

    @model_validator(mode="after")
    def _require_what_goes_together(self) -> Self:
        """Refuse keys that do not go with boundary or layer, and impossible hardnesses."""
        if self.boundary != "free":
            self._require("spacing", "side/n")
            self._require("far_field", "rigid")
            self._require("kernel", "uniform-pressure")
        if self.layer is not None:
            self._require_what_goes_with_a_layer(self.layer)
        if self.hardness is not None and self.hardness_ratio is not None:
            raise conflict(
                "hardness [MPa] and hardness_ratio [E*] are both given: give one"
            )
        if self.hardness_limits is None:  # no hardness is given
            return self
        if self.far_field == "compliant":
            raise conflict("a hardness needs far_field = 'rigid', not 'compliant'")
        for limit in self.hardness_limits:
            if not sys.float_info.min <= limit <= sys.float_info.max:
                raise conflict("the hardness is beyond what numbers hold [MPa]")
        return self

    def _require_what_goes_with_a_layer(self, layer: Layer) -> None:
        """Refuse keys of `[contact]` that do not go with a layer."""
        if (self.kernel, self.far_field) != ("uniform-pressure", "rigid"):
            raise conflict(
                "a layer needs kernel = 'uniform-pressure' and far_field = 'rigid', not"
                f" '{self.kernel}' and '{self.far_field}'"
            )
        if layer.base == "rigid" and (self.modulus != 1.0 or self.poisson != 0.0):
            raise conflict(
                "layer.base = 'rigid' has no modulus: leave out contact.modulus and contact.poisson"
            )
        if is_drawn(layer.modulus) and self.hardness_ratio is not None:
            raise conflict(
                "hardness_ratio needs one E*, and layer.modulus is drawn: give hardness [MPa]"
            )

    def layered_body(self, layer_numbers: Mapping[str, float]) -> LayeredBody | None:
        """Return the layer of a sample, and what it lies on.

        Parameters
        ----------
        layer_numbers : mapping of str to float
            Those of the thickness [um] and the modulus [MPa] of its layer that are drawn, by the
            names in `Layer.drawn`.

        Returns
        -------
        LayeredBody or None
            The layered body, pressed against a rigid one; None for half-spaces.
        """
        if self.layer is None:
            return None
        base: ElasticBody | None = None
        if self.layer.base == "elastic":
            base = ElasticBody(young=self.modulus, poisson=self.poisson)
        # Drawn numbers take the places of the smallest ones; a number that is fixed has no others.
        numbers = {
            LAYER_THICKNESS: limits(self.layer.thickness).smallest,
            LAYER_MODULUS: limits(self.layer.modulus).smallest,
            **layer_numbers,
        }
        layer = BondedLayer(
            thickness=numbers[LAYER_THICKNESS],
            material=ElasticBody(numbers[LAYER_MODULUS], self.layer.poisson),
            on_rigid=base is None,
        )
        return LayeredBody(layer=layer, base=base, other=None)

    def body(self, layer_numbers: Mapping[str, float]) -> "Layered | None":
        """Return the layered body of a sample as `bem.solve` takes it.

        Parameters
        ----------
        layer_numbers : mapping of str to float
            Drawn numbers of its layer, see `layered_body`.

        Returns
        -------
        bem.Layered or None
            The body; None for half-spaces.
        """
        layered = self.layered_body(layer_numbers)
        if layered is None:
            return None
        return layered.alone

    def _require(self, key: str, allowed: str) -> None:
        """Raise an error unless a key has the only value allowed on a patch without edges."""
        value = getattr(self, key)
        if value != allowed:
            raise conflict(
                f"boundary = '{self.boundary}' needs {key} = '{allowed}', not '{value}'"
            )

    @property
    def e_star(self) -> float:
        """Plane-strain modulus E* = E / (1 - nu^2) [MPa].

        If there is a layer, its modulus and Poisson's ratio are taken. A drawn modulus counts with
        the geometric mean of its limits.
        """
        if self.layer is not None:
            low, high = limits(self.layer.modulus)
            return math.sqrt(low) * math.sqrt(high) / (1 - self.layer.poisson**2)
        return self.modulus / (1 - self.poisson**2)

    @property
    def e_star_limits(self) -> tuple[float, float]:
        """Smallest and largest E* of the samples, equal unless a layer's modulus is drawn [MPa]."""
        if self.layer is None:
            return self.e_star, self.e_star
        low, high = limits(self.layer.modulus)
        plane_strain = 1 - self.layer.poisson**2
        return low / plane_strain, high / plane_strain

    @property
    def layer_text(self) -> str:
        """The layer and its base in words; "" for half-spaces."""
        if self.layer is None:
            return ""
        base = f"{self.modulus:.6g} MPa (Poisson's ratio {self.poisson:.6g})"
        if self.layer.base == "rigid":
            base = "a rigid base"
        return (
            f"{_span_text(self.layer.thickness)} um of {_span_text(self.layer.modulus)} MPa"
            f" (Poisson's ratio {self.layer.poisson:.6g}) on {base}"
        )

    @property
    def hardness_unit(self) -> float:
        """Unit in which the scene gives its hardness: E* for a ratio, otherwise 1 MPa [MPa]."""
        if self.hardness_ratio is None:
            return 1.0
        return self.e_star

    @property
    def hardness_limits(self) -> tuple[float, float] | None:
        """Smallest and largest hardness [MPa], equal for a fixed one; None for elastic bodies."""
        hardness = self.hardness or self.hardness_ratio
        if hardness is None:
            return None
        low, high = limits(hardness)
        return low * self.hardness_unit, high * self.hardness_unit

    @property
    def doubts(self) -> list[str]:
        """A list of one warning about a material that no solid has, or an empty list.

        It warns of a modulus above that of any solid, and of a hardness [MPa] that does not suit
        the modulus. Nothing is checked if neither a modulus nor a hardness in MPa is given. A
        hardness in multiples of E* is never checked.
        """
        if self.hardness is None and not self.has_modulus:
            return []
        hardnesses: tuple[float | None, ...] = (None,)  # the modulus is checked alone
        if self.hardness is not None:
            hardnesses = limits(self.hardness)
        for hardness in hardnesses:
            bodies = Bodies(
                e_star=self.e_star, hardness=hardness, has_modulus=self.has_modulus
            )
            doubts = material_doubts(bodies)
            if doubts:
                return doubts  # the other limit of the hardness would give a similar line
        return []

    @property
    def has_modulus(self) -> bool:
        """Whether the modulus differs from the default, or there is a layer.

        This stands in for whether the user gave a modulus, because the scene of a database has all
        keys.
        """
        return self.modulus != 1.0 or self.layer is not None

    @property
    def draws_hardness(self) -> bool:
        """Whether a hardness is drawn for every sample."""
        hardness = self.hardness or self.hardness_ratio
        return hardness is not None and is_drawn(hardness)


class Piece(Table):
    """One piece of a distribution of loads: a share of the samples, with loads in one range."""

    share: Annotated[Positive, Field(le=1)] = Field(
        description="the share of the samples in this range, a number above 0, at most 1"
    )
    range: AtLeastZero = Field(description=SPANNED)


def _shares_of_one(pieces: tuple[Piece, ...]) -> tuple[Piece, ...]:
    """Return the pieces unchanged; raise ValueError if their shares do not sum to 1."""
    total = sum(piece.share for piece in pieces)
    if abs(total - 1.0) > 1e-9:
        raise ValueError(f"the shares sum to {total:.10g}")
    return pieces


Pieces = Annotated[tuple[Piece, ...], Strict(False), AfterValidator(_shares_of_one)]


def _with_pieces(content: Any) -> Any:
    """Return the content of a table of loads, in which one piece has replaced the key `range`.

    Return content without this key unchanged; raise an error if both keys are given.
    """
    if not isinstance(content, dict) or "range" not in content:
        return content
    if "pieces" in content:
        raise conflict("range and pieces are both given: give one")
    completed = dict(content)
    completed["pieces"] = [{"share": 1.0, "range": completed.pop("range")}]
    return completed


class Delta(Table):
    """Distribution of the far-field displacement: the paper's controlled sampling (section 3.2)."""

    pieces: Pieces = Field(
        default=(
            Piece(share=0.75, range=(5.0, 25.0)),
            Piece(share=0.25, range=(25.0, 45.0)),
        ),
        description=f"range = [low, high], or pieces: {PIECES}",
    )

    _range = model_validator(mode="before")(_with_pieces)


class Load(Table):
    """Distribution of the loads, which are displacements, pressures or forces.

    The loads of "delta/height_rms" are displacements divided by the rms height of their surface.
    The loads of "pressure/(E* slope_rms)" are pressures divided by E* and by the rms slope of their
    surface.
    """

    quantity: Quantity
    pieces: Pieces = Field(description=f"range = [low, high], or pieces: {PIECES}")

    _range = model_validator(mode="before")(_with_pieces)


Flag = Annotated[bool | None, AfterValidator(lambda on: on or None)]
"""Flag of `[store]` that becomes None if it is false. The text of a scene leaves it out then, so
that older scenes, which do not have the key, keep their fingerprints."""


def _keys_of_quantities() -> type[Table]:
    """Make a subclass of `Table` with a key for each quantity that scenes have to ask for."""
    keys: dict[str, Any] = {}  # pairs of the type and the default of each key
    for quantity in stored_quantities():
        if quantity.stored != "asked":
            continue  # scenes do not ask for it
        if quantity.early:
            # The text of a scene has these oldest keys even if they are false, which its
            # fingerprint needs.
            keys[quantity.name] = (bool, False)
        else:
            # Left out of the text if it is false, see `Flag`.
            keys[quantity.name] = (Flag, None)
    return create_model("StoredQuantities", __base__=Table, **keys)


if TYPE_CHECKING:
    StoredQuantities: TypeAlias = Table
else:
    StoredQuantities = _keys_of_quantities()


class Store(StoredQuantities):
    """Optional columns of a database: further quantities, and outputs of a user's function."""

    function: Function | None = Field(
        default=None,
        description=f"{FUNCTION_WORDS}, whose outputs of each contact become columns",
    )
    # Without this key a run takes the outputs that the function returns for the first contact, and
    # records them in the database.
    outputs: (
        Annotated[dict[str, Unit], Field(min_length=1), AfterValidator(checked_names)]
        | None
    ) = Field(
        default=None,
        description="a table of the function's outputs, { name = 'unit' }, of 1 to 20 letters",
    )
    least: dict[str, float] | None = Field(
        default=None, description="a table of bounds of outputs, { name = least value }"
    )
    most: dict[str, float] | None = Field(
        default=None, description="a table of bounds of outputs, { name = largest value }"
    )
    # A run writes the powers and the source when it begins. The powers are measured on the function
    # and change no row.
    powers: dict[str, Annotated[tuple[int, int, int], Strict(False)]] | None = Field(
        default=None,
        description="a table of powers of heights, lengths and E*, { name = [1, 1, 1] }",
    )
    source: Hash | None = Field(
        default=None, description="the SHA-256 of the module's source"
    )

    @model_validator(mode="after")
    def _require_function_and_ordered_bounds(self) -> Self:
        """Refuse keys about outputs without a function, and a least value not below the largest."""
        for name in ("outputs", "powers", "source", "least", "most"):
            if self.function is None and getattr(self, name) is not None:
                raise conflict(f"{name} needs function, which gives them")
        for name in self.least or ():
            low, high = self.bounds(name)
            if not low < high:
                raise conflict(
                    f"least.{name} = {low:g} is not below most.{name} = {high:g}"
                )
        return self

    def wants(self, quantity: str) -> bool:
        """Tell whether databases of the scene have the column of an optional quantity.

        Parameters
        ----------
        quantity : str
            Name of the quantity, which is a key of this table.

        Returns
        -------
        bool
            True if the key is true; False if it is false or not given.
        """
        return bool(getattr(self, quantity))

    def bounds(self, name: str) -> tuple[float, float]:
        """Return the bounds of an output of a user's function.

        Parameters
        ----------
        name : str
            Name of the output.

        Returns
        -------
        tuple of two float
            Least and largest allowed value, in the unit of the output. Without a bound in the scene
            they are minus infinity and infinity.
        """
        low = (self.least or {}).get(name, -math.inf)
        high = (self.most or {}).get(name, math.inf)
        return low, high
