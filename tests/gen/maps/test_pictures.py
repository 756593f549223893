"""Pictures of surfaces and axes: nothing is cut, whatever is drawn."""

import os
from itertools import pairwise
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import pytest
from databases import database_of
from whole_pictures import assert_whole

from gen import cli
from gen.runtime.figure import draw_parity, log_axis, new_figure, parity_axes
from gen.spectral import SelfAffineSpectrum, generate_spectral

pytest.importorskip("matplotlib", reason="needs the extra plot")

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_rgba

from gen.maps import pictures
from gen.maps.pictures import Map

ROUGH = generate_spectral(
    (129, 129),
    1000.0,
    SelfAffineSpectrum(0.7, 250, 16.5),
    np.random.default_rng(1),
    rms_height=2.0,
)
LAY = np.add.outer(np.random.default_rng(2).normal(size=40), np.zeros(40))
SHAPES = {
    "square": (ROUGH, "1000"),
    "directional": (LAY + 1e-2 * ROUGH[:40, :40], "39"),
    "directional and small": (LAY[:6, :5], "5,4"),
    "flat": (np.zeros((20, 20)), "100"),
    "tiny": (1e-300 * ROUGH, "1000"),
    "lost": (1e9 + 1e-6 * ROUGH, "1000"),
}


@pytest.mark.few(2)
@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("shape", SHAPES)
def test_every_surface_is_drawn_and_nothing_is_cut(shape, here, monkeypatch, capsys):
    heights, side = SHAPES[shape]
    np.save("surface.npy", heights)
    figures, save = [], pictures.save
    monkeypatch.setattr(
        pictures,
        "save",
        lambda figure, path: figures.append(figure) or save(figure, path),
    )
    assert cli.main(["describe", "surface.npy", "--side", side, "--plot", "one.png"]) == 0
    assert (here / "one.png").read_bytes().startswith(b"\x89PNG")
    assert "self-affine law" in capsys.readouterr().out
    (figure,) = figures
    titles = [axis.get_title(loc="left") for axis in figure.axes]
    assert ("power spectra of profiles" in titles) == shape.startswith("directional")
    labels = [axis.get_xlabel() for axis in figure.axes]
    assert "wavenumber q = 2π / wavelength [1/µm]" in labels
    assert_whole(figure, FigureCanvasAgg(figure).get_renderer())


def map_with(value):
    """The drawn map of a rough surface with one node at a value [um], and its colour bar."""
    heights = 0.1 * ROUGH[:40, :40] / np.abs(ROUGH).max()
    heights[7, 3] = value
    figure = new_figure(6, 5)
    axis = figure.subplots()
    pictures.plot_map(
        axis, Map(heights, (39.0, 39.0), "heights", "height", "µm", "viridis")
    )
    return axis, axis.images[0].colorbar


@pytest.mark.parametrize(
    ("value", "extend", "colour", "words"),
    [
        (-0.5, "min", "magenta", "down to -0.5 µm (magenta)"),
        (0.7, "max", "red", "up to 0.7 µm (red)"),
        (0.0, "neither", None, ""),
    ],
)
def test_what_is_beyond_the_colours_has_its_arrow_colour_and_words(
    value, extend, colour, words
):
    axis, bar = map_with(value)
    assert bar.extend == extend
    image = axis.images[0]
    drawn = image.cmap(image.norm(image.get_array()[3, 7]))
    title = axis.get_title(loc="left")
    if colour is None:
        assert title == "heights"
    else:
        assert drawn == to_rgba(colour)
        [circle] = axis.lines
        assert circle.get_markeredgecolor() == colour
        assert circle.get_xydata().tolist() == [[7.5 * 39 / 40, 3.5 * 39 / 40]]
        assert title.endswith(f"beyond the colours: {words}")
    others = np.delete(image.get_array().ravel(), 3 * 40 + 7)
    assert bar.vmax - bar.vmin < 1.1 * np.ptp(others)


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
    low, high = panel.get_ylim()
    np.testing.assert_allclose(drawn.get_ydata(), [low, truth[1], high])
    assert drawn.get_label() == "model\n2 beyond the axes"


LATIN = os.fsdecode(b"n\xfcrnberg \x1b")
"""A name of a file that is no UTF-8, and has a control character."""

DRAWING = {
    "describe": ["describe", f"{LATIN}.npy", "--side", "9", "--plot", f"{LATIN}.png"],
    "contact": [
        "contact",
        f"{LATIN}.npy",
        "--side",
        "9",
        "--delta",
        "0.1",
        "--plot",
        "a.svg",
    ],
    "law": [
        "law",
        f"{LATIN}.npy",
        "--side",
        "9",
        "--pressure",
        "0.1,0.2",
        "--plot",
        "a.pdf",
    ],
    "plot": ["plot", f"{LATIN}.h5", "-o", f"{LATIN}.svg"],
}


@pytest.mark.few(2)
@pytest.mark.parametrize("name", DRAWING)
def test_every_name_of_a_file_can_be_drawn(here, name):
    np.save(f"{LATIN}.npy", np.random.default_rng(0).random((16, 16)))
    database_of(here, "samples = 2\n[surface]\nnodes = 9\n").rename(f"{LATIN}.h5")
    assert cli.main(DRAWING[name]) == 0
    picture = Path(DRAWING[name][-1])
    assert picture.stat().st_size > 1000
    if picture.suffix == ".svg":
        ET.parse(picture)
