"""The plane-strain modulus of one elastic body on a rigid one, or of two elastic bodies."""

from collections.abc import Sequence

from gen.runtime.errors import InputError
from gen.runtime.numbers import magnitude


def combined_modulus(
    young: Sequence[float], poisson: Sequence[float], e_star: float | None = None
) -> float:
    """E* with 1/E* = (1 - nu1^2)/E1 + (1 - nu2^2)/E2, one term where the other body is rigid.

    Parameters
    ----------
    young : one or two Young's moduli; 1 MPa unless given [MPa]
    poisson : as many Poisson's ratios, or none for 0 [1]
    e_star : E* itself, in place of both [MPa]

    Returns
    -------
    E* [MPa]

    Raises
    ------
    InputError
        For numbers that no material has, or too many of them
    """
    if e_star is not None:
        if young or poisson:
            raise InputError("--e-star stands in place of --young and --poisson: give one of them")
        if not magnitude(e_star):
            raise InputError(f"--e-star {e_star:g}: the modulus must be above 0 MPa, and finite")
        return e_star
    moduli = list(young) or [1.0]
    ratios = list(poisson) or [0.0] * len(moduli)
    if len(moduli) > 2 or len(ratios) != len(moduli):
        raise InputError(
            f"--young was given {len(young)} times, --poisson {len(poisson)} times: give each once,"
            " or twice for two elastic bodies"
        )
    for modulus, ratio in zip(moduli, ratios, strict=True):
        if not magnitude(modulus):
            raise InputError(f"--young {modulus:g}: the modulus must be above 0 MPa, and finite")
        if not -1 < ratio <= 0.5:
            raise InputError(f"--poisson {ratio:g}: must be above -1 and at most 0.5")
    return 1 / sum((1 - nu**2) / e for e, nu in zip(moduli, ratios, strict=True))
