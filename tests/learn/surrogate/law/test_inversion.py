"""Laws at given pressures: the curves over Delta, inverted."""

import numpy as np
from laws import column, rows_of, run
from scipy.interpolate import PchipInterpolator

from gen.law.points import Points
from learn.surrogate.law import inversion


def test_an_interval_at_given_pressure_is_that_of_the_force_read_the_other_way(work):
    ask = ["law", "hybrid.surrogate", "many/s1.npy", "--side", "1000", "--delta", "6:40:35"]
    run(*ask, "--pressure", "0.002:0.017:6", "--csv", "law.csv")
    over = [row for row in rows_of("law.csv", "delta_um") if row["pressure_MPa_low"]]
    at = rows_of("law.csv", "pressure_MPa")
    assert all(row["delta_um_low"] for row in at)
    delta, pressure = column(over, "delta_um"), column(at, "pressure_MPa")
    for end, other in (("low", "high"), ("high", "low")):
        ends = column(at, f"delta_um_{end}")
        reached = PchipInterpolator(delta, column(over, f"pressure_MPa_{other}"))(ends)
        np.testing.assert_allclose(reached, pressure, rtol=2e-3)
        area = PchipInterpolator(delta, column(over, f"area_percent_{end}"))(ends)
        np.testing.assert_allclose(column(at, f"area_percent_{end}"), area, rtol=2e-3)
        gap = PchipInterpolator(delta, column(over, f"mean_gap_um_{other}"))(ends)
        np.testing.assert_allclose(column(at, f"mean_gap_um_{other}"), gap, rtol=2e-3)


def test_the_inverse_of_a_law_knows_its_level_stretches():
    """A force predicted as 0 up to some Delta: a small pressure is reached behind that."""
    delta = np.array([0.0, 1.0, 2.0, 3.0, 4.0])
    values = {
        "delta_um": delta,
        "area_percent": delta,
        "mean_gap_um": 4 - delta,
        "closure_um": delta,
    }
    values["pressure_MPa"] = np.array([0.0, 1.0, 2.0, 3.0, 4.0])
    low = {**values, "pressure_MPa": np.array([0.0, 0.0, 0.0, 1.0, 2.0])}
    high = {**values, "pressure_MPa": values["pressure_MPa"] + [0, 1, 1, 1, 1]}
    points = Points(values, low, high, ("",) * 5)
    found = inversion.at_pressures(points, np.array([0.0, 1e-9, 2.0, 3.0]))
    np.testing.assert_allclose(found.values["delta_um"], [0, 0, 2, 3], atol=1e-6)
    np.testing.assert_allclose(found.low["delta_um"], [0, 0, 1, 2], atol=1e-6)
    np.testing.assert_allclose(found.high["delta_um"], [0, 2, 4, np.nan], atol=1e-2)
    assert found.endless == ("", "", "", "its interval ends beyond the last displacement")
    unknown = Points(values, low, high, ("", "", "", "", "far"))
    found = inversion.at_pressures(unknown, np.array([0.5, 2.0, 3.5]))
    assert found.reasons == ("", "", "far")
    assert found.endless[:2] == ("", "its interval ends where far")
