"""Tables of a contact law."""

import numpy as np
import pytest

from gen.runtime.errors import InputError
from learn.surrogate.law.curves import QUANTITIES, tabulated
from learn.surrogate.law.points import Points


def test_a_law_that_is_not_finite_is_refused():
    """Found by the fuzzer, with weights of 1e308 in a surrogate."""
    at = np.array([0.0, 1.0, 2.0])
    values = dict.fromkeys((*QUANTITIES, "delta_um"), at) | {"force_uN": np.array([0, 1, np.inf])}
    with pytest.raises(InputError, match="force_uN of the law has values that are not finite"):
        tabulated("delta_um", at, [Points(values, reasons=("", "", ""))], 0.9)
