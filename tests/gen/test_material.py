"""Moduli of one elastic body and of two, and refusals of impossible ones."""

import pytest

from gen.material import combined_modulus
from gen.runtime.errors import InputError


def test_moduli_combine() -> None:
    assert combined_modulus([], []) == 1
    assert combined_modulus([210e3], [0.3]) == pytest.approx(210e3 / 0.91)
    both = 1 / (0.91 / 210e3 + 0.75 / 3e3)
    assert combined_modulus([210e3, 3e3], [0.3, 0.5]) == pytest.approx(both)
    assert combined_modulus([], [], 7.0) == 7
    assert combined_modulus([2.0, 2.0], []) == 1


@pytest.mark.parametrize(
    ("young", "poisson", "e_star", "message"),
    [
        ([1.0, 2.0], [0.3], None, "--young was given 2 times, --poisson 1 times"),
        ([1.0] * 3, [], None, "--young was given 3 times"),
        ([0.0], [], None, "--young 0"),
        ([1.0], [0.6], None, "--poisson 0.6"),
        ([1.0], [], 2.0, "--e-star stands in place"),
        ([], [], -2.0, "--e-star -2"),
    ],
)
def test_moduli_that_no_material_has_are_refused(
    young: list[float], poisson: list[float], e_star: float | None, message: str
) -> None:
    with pytest.raises(InputError, match=message):
        combined_modulus(young, poisson, e_star)
