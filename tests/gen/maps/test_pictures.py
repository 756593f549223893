"""Pictures of one surface and of its contacts: nothing cut or overlapping, whatever is drawn."""

import os
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import pytest
from databases import database_of

import bem
from gen import cli
from gen.runtime.figure import draw_parity, log_axis, new_figure, parity_axes
from gen.spectral import SelfAffineSpectrum, generate_spectral
from gen.surface import generate

pytest.importorskip("matplotlib", reason="needs the extra plot")

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_rgba

from gen.maps import pictures
from gen.maps.contacts import AnswerOptions, answers
from gen.maps.pictures import ContactCaptions, Map, plot_contacts
from gen.material import Bodies

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


def assert_whole(figure, renderer):
    """Whether nothing is cut at any border."""
    box, (width, height) = figure.get_tightbbox(renderer), figure.get_size_inches()
    assert min(box.x0, box.y0) >= 0, "something is cut on the left or below"
    assert (box.x1 <= width, box.y1 <= height) == (True, True), "something is cut"


FRACTAL = generate("diamond-square", 33, 0.7, 5.0, np.random.default_rng(4))
E_STAR = 2e5
NAME = "a folder/with $ signs_and {braces}/" + 40 * "long " + "scan.x3p"
WARNING = "pressures are above what most materials bear, " * 5

ONE, DECADES, FROM_NOTHING = [2.0], [0.01, 0.1, 4.0], [0.0, 3.0]
PATCHES = {
    "oblong": (FRACTAL[:, :9], (100.0, 25.0), FROM_NOTHING),
    "tall sliver": (FRACTAL[:5], (3.0, 100.0), ONE),
    "yielding": (FRACTAL, (100.0, 100.0), DECADES),
}


def drawn(contacts, **changes):
    """A figure as it would be written, without the work of drawing its pixels."""
    figure = new_figure(11, 8.2, dpi=110)
    captions = ContactCaptions(
        name=NAME,
        load="delta",
        bodies=Bodies(E_STAR, contacts[0].problem.hardness, has_modulus=True),
        warnings=(),
        options=AnswerOptions(),
    )
    captions = replace(captions, **changes)
    rows = [
        {answer.column: answer.value for answer in answers(contact, AnswerOptions())}
        for contact in contacts
    ]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(pictures, "save", lambda *_: None)
        plot_contacts(figure, contacts[-1], rows, Path("contact.png"), captions)
    return figure


def titled(figure, text):
    """The axes with a text in their title or label."""
    return next(
        axis
        for axis in figure.axes
        if text in f"{axis.get_title(loc='left')} {axis.get_ylabel()}".splitlines()[0]
    )


@pytest.mark.few(2)
@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("shape", PATCHES)
def test_nothing_is_cut_or_overlaps(shape):
    heights, sides, deltas = PATCHES[shape]
    hardness = 4000.0 if "yielding" in shape else None
    contacts = list(bem.ladder(heights, sides, deltas, modulus=E_STAR, hardness=hardness))
    figure = drawn(contacts, warnings=(WARNING, "short"))
    renderer = FigureCanvasAgg(figure).get_renderer()
    figure.get_layout_engine().execute(figure)
    assert_whole(figure, renderer)
    section = titled(figure, "section at")
    assert section.get_window_extent(renderer).height > 1.2 * figure.dpi  # inches
    legend = section.get_legend().get_window_extent(renderer)
    assert not legend.overlaps(section._left_title.get_window_extent(renderer))
    left, spots = (titled(figure, text) for text in ("heights", "contact"))
    title = spots._left_title.get_window_extent(renderer)
    assert not title.overlaps(section.get_tightbbox(renderer))
    assert not left.get_tightbbox(renderer).overlaps(spots.get_tightbbox(renderer))


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


PRESSURES = {"linear": [1.0, 3.0, 10.0], "log": [3.0, 0.1, 30.0]}  # [MPa]


def law_over(pressures):
    """The figure of the law of a surface over pressures [MPa]."""
    sides = (100.0, 100.0)
    contacts = list(bem.ladder(FRACTAL, sides, pressures=pressures, modulus=1e4))
    return drawn(contacts, load="pressure")


@pytest.mark.parametrize("scale", PRESSURES)
def test_axes_of_a_law_are_logarithmic_over_decades(scale):
    figure = law_over(PRESSURES[scale])
    gap = titled(figure, "mean gap [µm]")
    area = titled(figure, "contact area [%]")
    assert gap.get_xscale() == area.get_xscale() == area.get_yscale() == scale


@pytest.mark.parametrize("scale", PRESSURES)
def test_laws_have_the_gap_over_rising_loads(scale):
    gap = titled(law_over(PRESSURES[scale]), "mean gap [µm]")
    loads, gaps = gap.lines[0].get_data()
    np.testing.assert_allclose(loads, sorted(PRESSURES[scale]), rtol=1e-6)
    assert sorted(gaps, reverse=True) == list(gaps)


def pressed(pressure):
    """The contact of a surface under a mean pressure [MPa]."""
    return bem.solve(FRACTAL, 100.0, pressure=pressure, modulus=E_STAR)


def test_gap_and_flux_take_the_place_of_heights_and_pressure():
    contact = pressed(1e-2)
    figure = drawn([contact], options=AnswerOptions(flow=True))
    assert titled(figure, "gap: connects")
    assert titled(figure, f"flux along x: flow factor {contact.flow().factor:.3g}")


def test_spots_take_the_place_of_the_gap_if_there_is_the_flux_too():
    figure = drawn([pressed(1e7)], options=AnswerOptions(spots=True, flow=True))
    assert titled(figure, "1 spots")


def test_a_contact_that_seals_has_no_flow():
    figure = drawn([pressed(1e7)], options=AnswerOptions(flow=True))
    assert titled(figure, "flux along x: no flow")


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
