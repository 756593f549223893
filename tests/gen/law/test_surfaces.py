"""The loads of a law of populations, which scenes give in several quantities."""

import textwrap

import numpy as np
import pytest
from small_populations import POPULATIONS

from gen.law.surfaces import read_subjects
from gen.maps.settings import Reading
from gen.runtime.errors import InputError
from gen.runtime.user_code import TRUSTED
from gen.statistics import rms_slope


def subjects(folder, *names, boundary="free"):
    paths = [folder / f"{name}.toml" for name in names]
    for name, path in zip(names, paths, strict=True):
        path.write_text(textwrap.dedent(POPULATIONS[name]))
    return read_subjects([str(path) for path in paths], 3, Reading(), boundary, print)


def test_displacements_over_the_rms_height_reach_what_every_surface_was_given(tmp_path):
    found = subjects(tmp_path, "relative")
    rms = [float(each.heights.std()) for each in found.surfaces]
    kind, loads = found.loads(5, 1.0)
    assert kind == "delta"
    np.testing.assert_allclose(loads, np.linspace(0.3 * min(rms), 2.0 * min(rms), 5))


def test_pressures_over_the_modulus_and_the_slope_follow_the_modulus_of_the_law(tmp_path):
    found = subjects(tmp_path, "spectral")
    slopes = [rms_slope(each.heights, each.spacing) for each in found.surfaces]
    for e_star in (1.0, 230e3):
        kind, loads = found.loads(4, e_star)
        wanted = e_star * min(slopes) * np.geomspace(0.05, 0.5, 4)
        assert kind == "pressure"
        np.testing.assert_allclose(loads, wanted)


def test_forces_become_pressures_and_pressures_stay(tmp_path):
    kind, loads = subjects(tmp_path, "force", boundary="periodic").loads(3, 5.0)
    assert kind == "pressure"
    np.testing.assert_allclose(loads, np.linspace(10.0, 200.0, 3) / (500.0 * 400.0))
    trust = TRUSTED.set(True)
    kind, loads = subjects(tmp_path, "python", boundary="mirror").loads(3, 5.0)
    TRUSTED.reset(trust)
    assert kind == "pressure"
    np.testing.assert_allclose(loads, np.linspace(0.001, 0.02, 3))


def test_loads_that_scenes_do_not_say_are_asked_for(tmp_path):
    with pytest.raises(InputError, match="others pressures: give --delta or --pressure"):
        subjects(tmp_path, "relative", "spectral").loads(3, 1.0)
    np.save(tmp_path / "s.npy", np.random.default_rng(0).normal(size=(9, 9)))
    found = read_subjects([str(tmp_path / "s.npy")], 3, Reading(side="10"), "free", print)
    assert found.loads(3, 1.0) is None
