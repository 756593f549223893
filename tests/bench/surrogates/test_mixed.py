"""Surrogates of both areas on mixed grids."""

import pytest

from bench.surrogates import mixed

pytestmark = pytest.mark.long


def test_every_set_of_grids_is_judged_with_both_areas(tmp_path, monkeypatch):
    monkeypatch.setattr(mixed, "GRIDS", (17, 33, 65))
    rows = mixed.mixed(tmp_path, 50)
    of_scene = [(row["trained_on"], row["judged_on"]) for row in rows if row["features"] == "scene"]
    every = "17 33 65"
    assert of_scene == [
        *(("17", "17"), ("33", "33"), ("65", "65")),
        *((every, "17"), (every, "33"), (every, "65"), ("17 33", "65")),
    ]
    unseen = {row["features"]: row for row in rows if row["trained_on"] == "17 33"}
    assert unseen["hybrid"]["continuum_nmae_percent"] < unseen["scene"]["continuum_nmae_percent"]
    biased = unseen["scene"]
    assert biased["count_bias_percent"] > biased["continuum_bias_percent"]
