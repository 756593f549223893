"""The material of the bodies of a prediction or a law."""

from typing import NamedTuple


class Bodies(NamedTuple):
    """Material of the bodies in contact.

    Attributes
    ----------
    e_star : float
        E* [MPa].
    hardness : float, optional
        Hardness of the softer body; None for elastic bodies [MPa].
    known : bool
        True if the user gave E*, so that warnings about pressures apply.
    """

    e_star: float
    hardness: float | None = None
    known: bool = False

    @property
    def hardness_ratio(self) -> float | None:
        """Hardness over E*; None for elastic bodies."""
        return None if self.hardness is None else self.hardness / self.e_star

    @property
    def text(self) -> str:
        """Description for titles and records."""
        hardness = "" if self.hardness is None else f", hardness = {self.hardness:.6g} MPa"
        return f"E* = {self.e_star:.6g} MPa{hardness}"
