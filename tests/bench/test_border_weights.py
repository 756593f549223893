"""The fit of the border's weights: its samples, its areas, and the weights of the product."""

from pathlib import Path

import numpy as np
import pytest

from bem.derived.border import WEIGHTS
from bench import border_weights
from bench.files import read_table

PUBLISHED = Path(border_weights.__file__).parent / "results/border-weights"


@pytest.mark.parametrize("aspect", [1.0, 3.0, 1 / 3])
def test_weighted_sums_of_a_sample_are_what_the_solver_takes_off_the_count(aspect):
    samples = border_weights._samples(4, aspect, 1.0, np.random.default_rng(2))
    for sample in samples:
        assert abs(sample.error_percent(WEIGHTS.ravel())) < 10
        assert sample.edges > 0


def test_sums_times_weights_give_the_area_of_the_contact():
    phases = np.array([0.4, 1.1])
    wave = border_weights.Wave((2, 1), phases, crossed=True, load=0.2, shape=(30, 24))
    contact = wave.pressed()
    sample = border_weights._sample(contact, wave.exact_area_percent(), crossed=True)
    nodes = contact.contact_nodes - sample.sums @ WEIGHTS.ravel()
    assert 100 * nodes / 720 == pytest.approx(contact.continuum_area_percent, rel=1e-12)


@pytest.mark.parametrize("crossed", [False, True])
def test_areas_of_waves_do_not_depend_on_their_angle(crossed):
    for periods in [(3, 0), (3, 2)]:
        wave = border_weights.Wave(periods, np.zeros(2), crossed, 0.3, (90, 90))
        area = wave.pressed().continuum_area_percent
        assert area == pytest.approx(wave.exact_area_percent(), rel=0.01)


def test_weights_are_fitted_for_each_term_and_number_of_aligned_edges():
    report = border_weights.border_weights(waves=24, aspect=1.0, length=1.0)
    weights = report.tables["border-weights"]
    assert [row["product"] for row in weights] == list(WEIGHTS.ravel())
    assert [row["aligned_edges"] for row in weights] == 4 * [0] + 4 * [1] + 4 * [2]
    areas = report.tables["border-areas"]
    assert sum(row["contacts"] for row in areas) == 24
    for row in areas:
        assert row["product_error_percent"] < row["count_error_percent"] / 4


def test_the_published_fit_gives_the_weights_of_the_product_within_one_percent():
    _, lines = read_table(PUBLISHED / "border-weights.csv")
    fitted = [float(line["fitted"]) for line in lines]
    assert fitted == pytest.approx(WEIGHTS.ravel(), rel=0.01)
