"""Numbers that users give to a contact: its loads, the material of the bodies, a gas in the gap.

Loads are typed as numbers or series of numbers. The material is E* of one elastic body or of two,
and the hardness of the softer one. All commands refuse the same numbers.
"""

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, Self

from gen.runtime.errors import InputError
from gen.runtime.terminal import quoted

if TYPE_CHECKING:
    import bem
    from gen.arrays import Heights

SMALLEST = 1e-38
LARGEST = 1e38
"""Bounds of lengths [um], loads, moduli, hardnesses [MPa] and conductivities [W/(m K)].

They are the bounds of single precision, in which the solver takes its steps and models see their
inputs. The upper bound is `bem.checks.LARGEST`, which is not imported here so that --help does not
wait for NumPy."""

MOST_VALUES = 100_000
"""Largest number of values of one option."""

DIGITS = 18
"""Largest number of digits of a whole number: enough for 2^59, and few enough for 64 bits."""

SERIES = re.compile(rf"([^:]+):([^:]+):\s*([0-9]{{1,{DIGITS}}})\s*(:\s*log\s*)?")
"""Pattern of start:stop:count, with groups for these and for an optional ":log"."""

LOADS = {
    "delta": f"give numbers from {SMALLEST:g} to {LARGEST:g} um, as 2, 1,2,5 or 5:45:9",
    "pressure": f"give pressures from 0 to {LARGEST:g} MPa, not all 0, as 0:100:20",
}
"""What to give for the loads of a law and of predictions, by the name of the option."""


class Heading(NamedTuple):
    """The name and the unit of a column for people."""

    label: str
    unit: str = ""


LAYER_COLUMNS = {
    "layer_thickness_um": Heading("layer", "um"),
    "layer_young_MPa": Heading("layer's Young's modulus", "MPa"),
    "layer_poisson": Heading("layer's Poisson's ratio"),
    "base": Heading("base of the layer"),
    "base_young_MPa": Heading("base's Young's modulus", "MPa"),
    "base_poisson": Heading("base's Poisson's ratio"),
}
"""Columns about a layer and its base."""


def columns_of_layer(body: "bem.Body") -> dict[str, float | str]:
    """Return the numbers of a layered body and of its base.

    Parameters
    ----------
    body : bem.Body
        Any body. Of two bodies in contact, the first one has the layer.

    Returns
    -------
    dict of str to float or str
        The numbers by columns of `LAYER_COLUMNS`, those of the base only if it is elastic; empty
        for half-spaces.
    """
    # here, so that --help does not wait for it
    from bem.bodies import HalfSpace, Layered, Pair

    if isinstance(body, Pair):
        body = body.first
    if not isinstance(body, Layered):
        return {}
    numbers: dict[str, float | str] = {
        "layer_thickness_um": body.thickness,
        "layer_young_MPa": body.modulus,
        "layer_poisson": body.poisson,
        "base": "rigid",
    }
    if isinstance(body.base, HalfSpace):
        numbers |= {
            "base": "elastic",
            "base_young_MPa": body.base.modulus,
            "base_poisson": body.base.poisson,
        }
    return numbers


class Gas(NamedTuple):
    """A gas that fills the gap and conducts heat."""

    conductivity: float  # [W/(m K)]
    # Jump distance [um]: the gap conducts as if it were wider by this, because molecules of the gas
    # fly about as far between two collisions as the gap is wide.
    jump_distance: float

    @classmethod
    def of_options(cls, conductivity: float | None, jump_distance: float | None) -> "Gas":
        """Return the gas of the options of `gen law`.

        Parameters
        ----------
        conductivity : float or None
            Conductivity [W/(m K)]; None if the option is left out.
        jump_distance : float or None
            Jump distance [um]; None if the option is left out.

        Returns
        -------
        Gas
            The gas.

        Raises
        ------
        InputError
            If an option is left out, or its number is not between `SMALLEST` and `LARGEST`.
        """
        return cls(
            conductivity=_required_of_gas("--gas-conductivity", conductivity, "W/(m K)"),
            jump_distance=_required_of_gas("--jump-distance", jump_distance, "um"),
        )

    @property
    def by_keys(self) -> dict[str, float]:
        """Conductivity and jump distance by their keys in documents, which end with the unit."""
        return {
            "gas_conductivity_W_per_m_K": self.conductivity,
            "gas_jump_distance_um": self.jump_distance,
        }

    def conductance(self, gap: "Heights") -> float:
        """Compute the conductance of the gas, k / (gap + M), as a mean over all nodes.

        Where bodies touch, the gap is 0 and conducts nothing: heat passes through the spots.

        Parameters
        ----------
        gap : ndarray, shape (nx, ny)
            Gap between the bodies [um].

        Returns
        -------
        float
            Conductance per nominal area [W/(mm2 K)].
        """
        import numpy as np

        conducting = self.conductivity / (gap + self.jump_distance)
        return float(np.where(gap > 0, conducting, 0.0).mean())


def _required_of_gas(option: str, value: float | None, unit: str) -> float:
    """Return the number of an option of a gas.

    Raises InputError if it is None, or not between `SMALLEST` and `LARGEST`.
    """
    if value is None:
        raise InputError(
            f"a gas needs --gas-conductivity and --jump-distance: {option} is missing"
        )
    return require_within(option, value, unit)


@dataclass(frozen=True)
class Series:
    """A part of the text of loads: start:stop:count, perhaps with :log, or a single number."""

    start: float
    stop: float
    count: int  # 1 for a single number
    even_ratio: bool  # whether neighbours have the same ratio, not the same difference

    @classmethod
    def of(cls, text: str) -> Self | None:
        """Parse a part of the text of loads.

        Parameters
        ----------
        text : str
            Text without a comma.

        Returns
        -------
        Series or None
            The series, which has the count 1 for a single number. None if the text is no number and
            no series, or if a series has fewer than 2 numbers, an end that is not finite, or ":log"
            with an end that is not above 0. A single number is not checked: it may be nan or inf.
        """
        match = SERIES.fullmatch(text)
        try:
            if match is None:
                number = float(text)
                return cls(start=number, stop=number, count=1, even_ratio=False)
            start, stop, count, log = match.groups()
            series = cls(
                start=float(start),
                stop=float(stop),
                count=int(count),
                even_ratio=log is not None,
            )
        except ValueError:
            return None
        if not series._has_steps():
            return None
        return series

    def _has_steps(self) -> bool:
        """Return whether a series has 2 numbers or more and possible ends.

        Ends are finite, and above 0 if neighbours have an even ratio.
        """
        if not (math.isfinite(self.start) and math.isfinite(self.stop)):
            return False
        if self.even_ratio and min(self.start, self.stop) <= 0:
            return False
        return self.count > 1

    def numbers(self) -> list[float]:
        """Return the `count` numbers from start to stop, both included."""
        if self.count == 1:
            return [self.start]
        import numpy as np  # here, so that --help does not wait for it

        if self.even_ratio:
            numbers = np.geomspace(self.start, self.stop, self.count)
        else:
            numbers = np.linspace(self.start, self.stop, self.count)
        return list(numbers.tolist())


def loads_from(load: str, text: str, advice: str = "") -> list[float]:
    """Parse loads: numbers, start:stop:count, or start:stop:count:log, with commas between them.

    Parameters
    ----------
    load : {"delta", "pressure", "force"}
        Kind of the loads, which is the name of the option that gives them; "force" only with
        `advice`.
    text : str
        The loads.
    advice : str
        End of the message if the loads cannot be parsed, as "give numbers". If it is given, only
        finite numbers of `LARGEST` or more in size are refused, and the caller has to check all
        others, also NaN and infinity. If it is "", the message ends with the text of `LOADS`, and
        the loads have to be those of a law: displacements above 0, or pressures of 0 or more that
        are not all 0.

    Returns
    -------
    list of float
        Loads in the order of the text [um, MPa or uN].

    Raises
    ------
    InputError
        If the text is no list of loads, has more than `MOST_VALUES` numbers, a finite number of
        `LARGEST` or more in size, or a load that is not allowed.
    """
    allowed = advice or LOADS[load]
    refusal = f"--{load} {quoted(text)}: {allowed}"
    values: list[float] = []
    for part in text.split(","):
        series = Series.of(part)
        if series is None:
            raise InputError(refusal)
        if len(values) + series.count > MOST_VALUES:
            raise InputError(
                f"--{load} {quoted(text)}: give {MOST_VALUES:,} values at most"
            )
        values += series.numbers()
    if advice:
        _refuse_beyond_largest(load, values)
    elif not _are_loads(load, values):
        raise InputError(refusal)
    return values


def shear_shares(text: str) -> tuple[float, ...]:
    """Parse the value of the option --shear: numbers or series, with commas between them.

    Parameters
    ----------
    text : str
        Shear forces over the force at which the bodies slide; "" for none.

    Returns
    -------
    tuple of float
        The shares, in the order of the text.

    Raises
    ------
    InputError
        If the text is no list of numbers, or one is not from 0 to below 1.
    """
    if not text:
        return ()
    advice = "give shares of the sliding force, as 0.5, 0.2,0.8 or start:stop:count"
    shares = loads_from("shear", text, advice)
    for share in shares:
        if not 0 <= share < 1:
            raise InputError(
                f"--shear {share:g}: must be at least 0 and below 1, at which the bodies slide"
            )
    return tuple(shares)


def _refuse_beyond_largest(load: str, values: Sequence[float]) -> None:
    """Raise InputError for a finite number that is `LARGEST` or more in size.

    Numbers that are not finite pass: the solver refuses them with a message of its own.
    """
    for value in values:
        if LARGEST <= abs(value) < math.inf:
            raise InputError(f"--{load} {value:g}: must be below {LARGEST:g}")


def _are_loads(load: str, values: Sequence[float]) -> bool:
    """Return whether numbers are loads of a law.

    They have to be between `SMALLEST` and `LARGEST`. Some pressures may be 0, too, but not all.
    """
    if not any(values):
        return False  # all loads are 0
    nonzero = [value for value in values if value != 0]
    has_zeros = len(nonzero) < len(values)
    if has_zeros and load != "pressure":
        return False  # only a pressure may be 0
    return all(SMALLEST < value < LARGEST for value in nonzero)


def require_within(option: str, value: float, unit: str, what: str = "") -> float:
    """Refuse a number that is not between `SMALLEST` and `LARGEST`.

    Parameters
    ----------
    option : str
        Option that gave the number, as "--hardness".
    value : float
        The number.
    unit : str
        Its unit.
    what : str
        Name of the quantity for the message, as "the hardness"; "" if the option names it.

    Returns
    -------
    float
        `value`, unchanged.

    Raises
    ------
    InputError
        If the number is not above `SMALLEST` and below `LARGEST`.
    """
    if SMALLEST < value < LARGEST:
        return value
    rule = f"must be between {SMALLEST:g} and {LARGEST:g} {unit}"
    if what:
        rule = f"{what} {rule}"
    raise InputError(f"{option} {value:g}: {rule}")


INCOMPRESSIBLE = 0.5
"""Poisson's ratio of a body that keeps its volume."""


class ElasticBody(NamedTuple):
    """The only elastic body of a contact whose other body is rigid."""

    young: float  # Young's modulus [MPa]
    poisson: float  # Poisson's ratio

    @property
    def text(self) -> str:
        """Both numbers in words."""
        return f"{self.young:.6g} MPa (Poisson's ratio {self.poisson:.6g})"


@dataclass(frozen=True)
class Friction:
    """Friction between two elastic bodies, and Poisson's ratio of both."""

    coefficient: float  # f, above 0
    poisson: float  # of both bodies

    @classmethod
    def of_options(
        cls,
        coefficient: float,
        young: Sequence[float] | None,
        poisson: Sequence[float] | None,
        *,
        like_bodies: bool,
    ) -> Self:
        """Return the friction of two bodies whose normal and tangential contacts are independent.

        These contacts are independent if the elastic constants of both bodies are alike, or if a
        rigid body is pressed on an elastic one whose Poisson's ratio is 0.5.

        Parameters
        ----------
        coefficient : float
            Coefficient of friction.
        young : sequence of float or None
            Young's moduli of one elastic body or of two [MPa].
        poisson : sequence of float or None
            Poisson's ratio of each elastic body; None or empty for 0.
        like_bodies : bool
            True to take two unlike bodies for alike: Poisson's ratio is then the mean of both
            ratios, weighted by the compliances of the bodies in shear.

        Returns
        -------
        Friction
            The friction.

        Raises
        ------
        InputError
            If the coefficient is not above 0, Young's moduli are missing, or the bodies are not
            alike.
        """
        if not 0 < coefficient < LARGEST:
            raise InputError(
                f"--friction {coefficient:g}: must be above 0 and below {LARGEST:g}"
            )
        if not young:
            raise InputError(
                "--friction needs Poisson's ratio: give --young and --poisson, twice for two"
                " elastic bodies"
            )
        ratios = list(poisson or [0.0] * len(young))
        if len(young) == 1:
            if ratios[0] != INCOMPRESSIBLE:
                raise InputError(
                    f"--friction with a rigid body on an elastic one of --poisson {ratios[0]:g}:"
                    " pressures shift such a pair, unless the ratio is 0.5; for two like bodies"
                    " give --young and --poisson twice"
                )
            return cls(coefficient=coefficient, poisson=ratios[0])
        are_alike = young[0] == young[1] and ratios[0] == ratios[1]
        if not are_alike and not like_bodies:
            raise InputError(
                f"--friction between unlike bodies (--young {young[0]:g} and {young[1]:g}"
                f" MPa, --poisson {ratios[0]:g} and {ratios[1]:g}): pressures shift them;"
                " --like-bodies neglects this"
            )
        # Half of the compliances in shear, 1 / (2 G).
        compliances = [(1 + nu) / e for e, nu in zip(young, ratios, strict=True)]
        total = sum(compliances)
        shares = [compliance / total for compliance in compliances]
        mean_ratio = shares[0] * ratios[0] + shares[1] * ratios[1]
        return cls(coefficient=coefficient, poisson=mean_ratio)


class Layer(NamedTuple):
    """A layer that is bonded to an elastic base or to a rigid one."""

    thickness: float  # [um]
    material: ElasticBody  # of the layer itself
    on_rigid: bool  # whether the base is rigid

    @classmethod
    def of(
        cls,
        thickness: float | None,
        young: float | None,
        poisson: float | None,
        base: str,
    ) -> Self | None:
        """Return the layer of the options --layer-*; a number is None if its option is left out.

        Parameters
        ----------
        thickness : float or None
            Thickness [um].
        young : float or None
            Young's modulus of the layer [MPa].
        poisson : float or None
            Poisson's ratio of the layer; None for 0.
        base : {"elastic", "rigid"}
            Kind of the body below the layer.

        Returns
        -------
        Layer or None
            The layer; None if all numbers are None and the base is elastic.

        Raises
        ------
        InputError
            If a number is out of range, or a thickness or a modulus is missing.
        """
        numbers = {
            "--layer-thickness": thickness,
            "--layer-young": young,
            "--layer-poisson": poisson,
            "--layer-base rigid": None if base == "elastic" else base,
        }
        named = [option for option, value in numbers.items() if value is not None]
        if not named:
            return None
        if thickness is None or young is None:
            missing = "--layer-thickness" if thickness is None else "--layer-young"
            raise InputError(f"{named[0]}: a layer needs {missing}, too")
        require_within("--layer-thickness", thickness, "um", "the thickness")
        require_within("--layer-young", young, "MPa", "the modulus")
        ratio = poisson or 0.0
        _require_poisson("--layer-poisson", ratio)
        return cls(
            thickness=thickness,
            material=ElasticBody(young=young, poisson=ratio),
            on_rigid=base == "rigid",
        )


class LayeredBody(NamedTuple):
    """A layer, the elastic body below it, and the other body."""

    layer: Layer
    base: ElasticBody | None  # None if the base is rigid
    # The body that is pressed on the layer; None if it is rigid.
    other: ElasticBody | None

    @classmethod
    def of(cls, body: "bem.Layered") -> Self:
        """Return the bodies of a contact in which a rigid body is pressed on a layered one.

        Parameters
        ----------
        body : bem.Layered
            The body as `bem.solve` takes it.

        Returns
        -------
        LayeredBody
            The layered body, without another elastic one.
        """
        layer = Layer(
            thickness=body.thickness,
            material=ElasticBody(young=body.modulus, poisson=body.poisson),
            on_rigid=body.base == "rigid",
        )
        base: ElasticBody | None = None
        if body.base != "rigid":
            base = ElasticBody(young=body.base.modulus, poisson=body.base.poisson)
        return cls(layer=layer, base=base, other=None)

    @property
    def alone(self) -> "bem.Layered":
        """The layered body without the other one."""
        import bem  # here, so that --help does not wait for it

        base: bem.HalfSpace | Literal["rigid"] = "rigid"
        if self.base is not None:
            base = bem.HalfSpace(*self.base)
        return bem.Layered(self.layer.thickness, *self.layer.material, base)

    @property
    def body(self) -> "bem.Body":
        """The layered body as `bem.solve` takes it, or the pair of both elastic bodies."""
        import bem  # here, so that --help does not wait for it
        from bem.bodies import Pair

        if self.other is None:
            return self.alone
        return Pair(self.alone, bem.HalfSpace(*self.other))

    @property
    def layer_compliance(self) -> float:
        """Compression of the layer alone by a uniform pressure of 1 MPa [um / MPa].

        It is the same on any base, because the layer is under uniaxial strain. It is 0 for an
        incompressible layer.
        """
        on_rigid = LayeredBody(layer=self.layer, base=None, other=None)
        return on_rigid.body.mean_compliance

    @property
    def e_star(self) -> float:
        """E* of the surfaces: of the layer, and of the other body if that is elastic [MPa]."""
        surfaces = [self.layer.material]
        if self.other is not None:
            surfaces.append(self.other)
        modulus = combined_modulus(
            [surface.young for surface in surfaces],
            [surface.poisson for surface in surfaces],
        )
        assert modulus is not None  # it is None without any modulus
        return modulus

    @property
    def text(self) -> str:
        """The layer, its base and an elastic other body, as "5 um of 3 MPa (...) on ..."."""
        base = "a rigid base"
        if self.base is not None:
            base = self.base.text
        text = f"{self.layer.thickness:.6g} um of {self.layer.material.text} on {base}"
        if self.other is not None:
            text += f", against {self.other.text}"
        return text


class Bodies(NamedTuple):
    """Material of the bodies in contact: E* and the hardness of the softer one [MPa].

    E* is that of the surfaces: of a layer, not of what it lies on.
    """

    e_star: float
    hardness: float | None = None  # None for elastic bodies
    # True if the user gave E* or Young's modulus. Warnings depend on it, see `gen.doubts`.
    has_modulus: bool = False
    # The elastic body, if the user gave exactly one Young's modulus; None otherwise.
    only: ElasticBody | None = None
    # The bodies if one of them has a layer; None for half-spaces.
    layered: LayeredBody | None = None

    @classmethod
    def of(
        cls,
        young: Sequence[float] | None,
        poisson: Sequence[float] | None,
        e_star: float | None,
        hardness: float | None,
    ) -> Self:
        """Return the bodies of the options.

        Without any number E* is 1 MPa. With one Poisson's ratio alone, Young's modulus is 1 MPa.

        Parameters
        ----------
        young : sequence of float or None
            Young's moduli of one elastic body or of two [MPa].
        poisson : sequence of float or None
            Poisson's ratio of each elastic body; None or empty for 0.
        e_star : float or None
            E*, in place of moduli and ratios [MPa].
        hardness : float or None
            Hardness of the softer body [MPa]; None for elastic bodies.

        Returns
        -------
        Bodies
            The bodies.

        Raises
        ------
        InputError
            If a number is out of range, E* comes with moduli or ratios, there are more than two
            moduli or not as many ratios as moduli, or a hardness comes without a modulus.
        """
        has_modulus = bool(young) or e_star is not None
        if hardness is not None:
            require_within("--hardness", hardness, "MPa", "the hardness")
        if hardness is not None and not has_modulus:
            raise InputError(
                f"--hardness {hardness:g}: give the modulus too (--young or --e-star), which is 1"
                " MPa without these options"
            )
        modulus = combined_modulus(young, poisson, e_star)
        if modulus is None:
            modulus = 1.0
        only: ElasticBody | None = None
        if young and len(young) == 1:
            ratio = poisson[0] if poisson else 0.0
            only = ElasticBody(young=young[0], poisson=ratio)
        return cls(e_star=modulus, hardness=hardness, has_modulus=has_modulus, only=only)

    @classmethod
    def with_layer(
        cls,
        layer: Layer,
        young: Sequence[float] | None,
        poisson: Sequence[float] | None,
        e_star: float | None,
        hardness: float | None,
    ) -> Self:
        """Return the bodies of the options, the first of which has a layer.

        Parameters
        ----------
        layer : Layer
            The layer.
        young, poisson : sequence of float or None
            Young's modulus [MPa] and Poisson's ratio of the body below the layer, then of the other
            body if that is elastic, too. On a rigid base there is neither.
        e_star : float or None
            Has to be None: E* of a half-space does not tell its shear modulus.
        hardness : float or None
            Hardness of the softer surface [MPa]; None for elastic bodies.

        Returns
        -------
        Bodies
            The bodies.

        Raises
        ------
        InputError
            If a number is out of range, or the options do not go with the layer.
        """
        if e_star is not None:
            raise InputError(
                "--e-star does not tell the material below a layer: give --young and --poisson"
            )
        if layer.on_rigid and (young or poisson):
            raise InputError(
                "--layer-base rigid: leave out --young and --poisson, a rigid base has neither"
            )
        if not (layer.on_rigid or young):
            raise InputError(
                "--layer-thickness: give --young of the body below the layer, or --layer-base rigid"
            )
        if hardness is not None:
            require_within("--hardness", hardness, "MPa", "the hardness")
        combined_modulus(young, poisson)  # checks the numbers
        moduli = list(young or [])
        ratios = list(poisson or [0.0] * len(moduli))
        elastic: list[ElasticBody | None] = [
            ElasticBody(*body) for body in zip(moduli, ratios, strict=True)
        ]
        while len(elastic) < 2:
            elastic.append(None)  # a rigid body
        base, other = elastic
        layered = LayeredBody(layer=layer, base=base, other=other)
        return cls(
            e_star=layered.e_star, hardness=hardness, has_modulus=True, layered=layered
        )

    @property
    def elastic_settings(self) -> dict[str, Any]:
        """Arguments of `bem.solve` about the elastic material of the bodies."""
        if self.layered is None:
            return {"modulus": self.e_star}
        return {"body": self.layered.body}

    @property
    def hardness_ratio(self) -> float | None:
        """Hardness over E*; None for elastic bodies."""
        return None if self.hardness is None else self.hardness / self.e_star

    @property
    def text(self) -> str:
        """E* and, if there is one, the hardness in words, for titles and records."""
        modulus = f"E* = {self.e_star:.6g} MPa"
        if self.layered is not None:
            modulus += f", layer of {self.layered.text}"
        if self.hardness is None:
            return modulus
        return f"{modulus}, hardness = {self.hardness:.6g} MPa"


def _require_poisson(option: str, ratio: float) -> None:
    """Refuse a Poisson's ratio, given by an option, that no material has."""
    if not -1 < ratio <= INCOMPRESSIBLE:
        raise InputError(f"{option} {ratio:g}: must be above -1 and at most 0.5")


def combined_modulus(
    young: Sequence[float] | None,
    poisson: Sequence[float] | None,
    e_star: float | None = None,
) -> float | None:
    """Compute E* of a contact, 1/E* = 1/E1* + 1/E2*, or 1/E1* if one body is rigid.

    E1* = E1 / (1 - nu1^2) is the plane-strain modulus of a body (K. L. Johnson, Contact Mechanics,
    1985, section 4.2).

    Parameters
    ----------
    young : sequence of float or None
        Young's moduli of one elastic body or of two [MPa]; 1 MPa if there is one ratio alone.
    poisson : sequence of float or None
        Poisson's ratio of each elastic body; None or empty for 0.
    e_star : float or None
        E*, in place of moduli and ratios [MPa].

    Returns
    -------
    float or None
        E* [MPa]; None without any number.

    Raises
    ------
    InputError
        If a number is out of range, E* comes with moduli or ratios, there are more than two moduli,
        or not as many ratios as moduli.
    """
    if e_star is not None:
        if young or poisson:
            raise InputError(
                "--e-star stands in place of --young and --poisson: give one of them"
            )
        return require_within("--e-star", e_star, "MPa", "the modulus")
    if not (young or poisson):
        return None
    moduli = list(young or [1.0])
    ratios = list(poisson or [0.0] * len(moduli))
    if len(moduli) > 2 or len(ratios) != len(moduli):
        raise InputError(
            f"--young was given {len(young or ())} times, --poisson {len(poisson or ())} times:"
            " give each once, or twice for two elastic bodies"
        )
    for modulus, ratio in zip(moduli, ratios, strict=True):
        require_within("--young", modulus, "MPa", "the modulus")
        _require_poisson("--poisson", ratio)
    # 1 / E1*, and 1 / E2* if there is a second elastic body.
    inverses = [1 / (e / (1 - nu**2)) for e, nu in zip(moduli, ratios, strict=True)]
    return 1 / sum(inverses)
