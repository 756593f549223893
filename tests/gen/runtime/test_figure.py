"""Axes that every picture shares."""

import os
from itertools import pairwise
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import pytest

from gen import cli
from gen.runtime.figure import draw_parity, log_axis, new_figure, parity_axes


@pytest.mark.parametrize("values", [(2.1, 4.4), (7.0, 45.0), (1, 1e6)])
def test_a_logarithmic_axis_has_two_numbers_or_more_that_keep_apart(values):
    figure = new_figure(4, 3)
    panel = figure.subplots()
    panel.plot(values, values, "o")
    log_axis(panel.xaxis)
    log_axis(panel.yaxis)
    figure.draw_without_rendering()
    low, high = panel.get_xlim()
    numbers = [
        label.get_window_extent()
        for label in panel.get_xticklabels(which="both")
        if label.get_text() and low <= label.get_position()[0] <= high
    ]
    assert len(numbers) >= 2
    for left, right in pairwise(numbers):
        assert left.x1 <= right.x0


@pytest.mark.parametrize(
    ("truth", "scale"), [([0.01, 1.0, 90.0], "log"), ([-5.0, 2.0, 700.0], "linear")]
)
def test_predictions_over_decades_have_logarithmic_axes_and_none_is_lost(truth, scale):
    panel = new_figure(4, 3).subplots()
    truth = np.array(truth)
    parity_axes(panel, truth)
    assert panel.get_xscale() == panel.get_yscale() == scale
    assert panel.get_xlim() == panel.get_ylim()
    assert panel.get_xlim()[0] < truth.min() < truth.max() < panel.get_xlim()[1]
    draw_parity(panel, truth, np.array([-1e9, truth[1], 1e9]), label="model", ls="none")
    drawn = panel.lines[-1]
    np.testing.assert_allclose(
        drawn.get_ydata(), [panel.get_ylim()[0], truth[1], panel.get_ylim()[1]]
    )
    assert drawn.get_label() == "model\n2 beyond the axes"


LATIN = os.fsdecode(b"n\xfcrnberg \x1b")
"""A name of a file that is no UTF-8, and has a control character."""

DRAWING = {
    "describe": ["describe", f"{LATIN}.npy", "--side", "9", "--plot", f"{LATIN}.png"],
    "contact": ["contact", f"{LATIN}.npy", "--side", "9", "--delta", "0.1", "--plot", "a.svg"],
    "law": ["law", f"{LATIN}.npy", "--side", "9", "--pressure", "0.1,0.2", "--plot", "a.pdf"],
    "plot": ["plot", f"{LATIN}.h5", "-o", f"{LATIN}.svg"],
}


@pytest.mark.parametrize("name", DRAWING)
def test_every_name_of_a_file_can_be_drawn(tmp_path, monkeypatch, name):
    monkeypatch.chdir(tmp_path)
    np.save(f"{LATIN}.npy", np.random.default_rng(0).random((16, 16)))
    Path("small.toml").write_text("samples = 2\n[surface]\nnodes = 9\n")
    assert cli.main(["run", "small.toml", "-o", f"{LATIN}.h5"]) == 0
    assert cli.main(DRAWING[name]) == 0
    picture = Path(DRAWING[name][-1])
    assert picture.stat().st_size > 1000
    if picture.suffix == ".svg":
        ET.parse(picture)
