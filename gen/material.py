"""What users give to a contact by numbers: its loads, and the material of the bodies.

Loads are typed as numbers or series of them; the material is E* of one body or of two, and the
hardness; a gas may fill the gap. The same numbers are refused everywhere.
"""

import math
import re
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple, Self

from gen.runtime.errors import InputError
from gen.runtime.terminal import quoted

if TYPE_CHECKING:
    from gen.arrays import Heights

SMALLEST, LARGEST = 1e-38, 1e38
"""Ends of lengths [um], loads, moduli, hardnesses [MPa] and conductivities [W/(m K)]: those of
single precision, in which the solver takes its steps and models see their inputs. The end above is
`bem.checks.LARGEST`, which is not imported here so that --help does not wait for NumPy."""

MOST = 100_000  # most values of one option
DIGITS = 18  # most digits of a whole number: enough for 2^59, and few enough for 64 bits
SERIES = re.compile(rf"([^:]+):([^:]+):\s*([0-9]{{1,{DIGITS}}})\s*(:\s*log\s*)?")
"""Start, stop and count of a series, and perhaps the mark of an even ratio."""

LOADS = {
    "delta": f"give numbers from {SMALLEST:g} to {LARGEST:g} um, as 2, 1,2,5 or 5:45:9",
    "pressure": f"give pressures from 0 to {LARGEST:g} MPa, not all 0, as 0:100:20",
}
"""Advice for the loads of a law and of predictions."""


class Gas(NamedTuple):
    """A gas that fills the gap and conducts heat."""

    conductivity: float  # [W/(m K)]
    # Jump distance [um]: what the gap is wider by for a gas whose molecules fly as far as it is.
    jump_distance: float

    @classmethod
    def of_options(cls, conductivity: float | None, jump_distance: float | None) -> "Gas":
        """Return the gas of the options of `gen law`, which needs both."""
        given = {"--gas-conductivity": conductivity, "--jump-distance": jump_distance}
        for (option, value), unit in zip(given.items(), ("W/(m K)", "um"), strict=True):
            if value is None:
                raise InputError(
                    f"a gas needs {' and '.join(given)}: {option} is missing"
                )
            require_within(option, value, unit)
        return cls(conductivity, jump_distance)  # type: ignore[arg-type]

    def conductance(self, gap: "Heights") -> float:
        """Return the mean over all nodes, where a gap [um] is open, of k / (gap + M) [W/(mm2 K)].

        Where bodies touch, the gap is 0 and the heat that passes is that of the spots.
        """
        import numpy as np

        conducting = self.conductivity / (gap + self.jump_distance)
        return float(np.where(gap > 0, conducting, 0.0).mean())


def loads_from(load: str, text: str, advice: str = "") -> list[float]:
    """Parse loads: numbers, start:stop:count, or start:stop:count:log, with commas between them.

    They are displacements above 0 [um], or nominal pressures of 0 or more, not all 0 [MPa]; or
    numbers of either sign, where the caller has other `advice` for messages. Raise InputError for
    anything else, numbers beyond `LARGEST`, or more than `MOST` numbers.
    """
    allowed, values = advice or LOADS[load], list[float]()
    for part in text.split(","):
        series = SERIES.fullmatch(part)
        start, stop, count, log = series.groups() if series else (part, part, "1", None)
        try:
            ends = [float(start), float(stop)]
        except ValueError:
            raise InputError(f"--{load} {quoted(text)}: {allowed}") from None
        finite = all(map(math.isfinite, ends)) and (not log or min(ends) > 0)
        if series and not (finite and int(count) > 1):
            raise InputError(f"--{load} {quoted(text)}: {allowed}")
        if len(values) + int(count) > MOST:
            raise InputError(f"--{load} {quoted(text)}: give {MOST:,} values at most")
        if not series:
            values.append(ends[0])
            continue
        import numpy as np  # here, so that --help does not wait for it

        values += (np.geomspace if log else np.linspace)(
            ends[0], ends[1], int(count)
        ).tolist()
    zero = load == "pressure"  # whether 0 is allowed
    within = all(SMALLEST < value < LARGEST or (zero and value == 0) for value in values)
    if (
        advice
    ):  # the solver says which of them it takes; it also names those that are not finite
        beyond = [value for value in values if LARGEST <= abs(value) < math.inf]
        if beyond:
            raise InputError(f"--{load} {beyond[0]:g}: must be below {LARGEST:g}")
    elif not (within and any(values)):
        raise InputError(f"--{load} {quoted(text)}: {allowed}")
    return values


def require_within(option: str, value: float, unit: str, what: str = "") -> float:
    """Return a number that a user gave, or refuse it beyond `SMALLEST` and `LARGEST`.

    Parameters
    ----------
    option : str
        The option, as "--hardness".
    value : float
        The number.
    unit : str
        Its unit.
    what : str
        What it is, as "the hardness", where the option does not say so.

    Returns
    -------
    float
        The number.

    Raises
    ------
    InputError
        If the number is not above `SMALLEST` and below `LARGEST`.
    """
    if SMALLEST < value < LARGEST:
        return value
    must = f"{what} must" if what else "must"
    raise InputError(
        f"{option} {value:g}: {must} be between {SMALLEST:g} and {LARGEST:g} {unit}"
    )


class Bodies(NamedTuple):
    """Material of the bodies in contact: E* and the softer one's hardness [MPa]."""

    e_star: float
    hardness: float | None = None  # None for elastic bodies
    known: bool = (
        False  # whether the user gave E*, so that warnings about pressures apply
    )
    # Young's modulus [MPa] and Poisson's ratio of the only elastic body, if that was given
    only: tuple[float, float] | None = None

    @classmethod
    def of(
        cls,
        young: Sequence[float] | None,
        poisson: Sequence[float] | None,
        e_star: float | None,
        hardness: float | None,
    ) -> Self:
        """Return the bodies of the options, with an E* of 1 MPa without any."""
        known = bool(young) or e_star is not None
        if hardness is not None:
            require_within("--hardness", hardness, "MPa", "the hardness")
        if hardness is not None and not known:
            raise InputError(
                f"--hardness {hardness:g}: give the modulus too (--young or --e-star), which is 1"
                " MPa without these options"
            )
        combined = combined_modulus(young, poisson, e_star)
        only = (
            (young[0], poisson[0] if poisson else 0.0)
            if young and len(young) == 1
            else None
        )
        return cls(1.0 if combined is None else combined, hardness, known, only)

    @property
    def hardness_ratio(self) -> float | None:
        """Hardness over E*; None for elastic bodies."""
        return None if self.hardness is None else self.hardness / self.e_star

    @property
    def text(self) -> str:
        """Description for titles and records."""
        hardness = (
            "" if self.hardness is None else f", hardness = {self.hardness:.6g} MPa"
        )
        return f"E* = {self.e_star:.6g} MPa{hardness}"


def combined_modulus(
    young: Sequence[float] | None,
    poisson: Sequence[float] | None,
    e_star: float | None = None,
) -> float | None:
    """Compute E* of a contact [MPa], 1/E* = 1/E1* + 1/E2*, or 1/E1* if one body is rigid.

    That of a body is its plane-strain modulus, E1* = E1 / (1 - nu1^2). Without numbers it is None;
    `e_star` stands in place of moduli and ratios.
    """
    young, poisson = young or (), poisson or ()
    if e_star is not None:
        if young or poisson:
            raise InputError(
                "--e-star stands in place of --young and --poisson: give one of them"
            )
        return require_within("--e-star", e_star, "MPa", "the modulus")
    if not (young or poisson):
        return None
    moduli = list(young) or [1.0]
    ratios = list(poisson) or [0.0] * len(moduli)
    if len(moduli) > 2 or len(ratios) != len(moduli):
        raise InputError(
            f"--young was given {len(young)} times, --poisson {len(poisson)} times: give each once,"
            " or twice for two elastic bodies"
        )
    for modulus, ratio in zip(moduli, ratios, strict=True):
        require_within("--young", modulus, "MPa", "the modulus")
        if not -1 < ratio <= 0.5:
            raise InputError(f"--poisson {ratio:g}: must be above -1 and at most 0.5")
    return 1 / sum(1 / (e / (1 - nu**2)) for e, nu in zip(moduli, ratios, strict=True))
