"""Pictures of one surface and of its contacts: nothing cut or overlapping, whatever is drawn."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import bem
from gen import cli
from gen.spectral import SelfAffineSpectrum, generate_spectral

pytest.importorskip("matplotlib", reason="needs the extra plot")

from matplotlib.backends.backend_agg import FigureCanvasAgg

from gen.maps import pictures
from gen.maps.pictures import CYAN, Subject, draw_contacts, section_line
from gen.runtime.figure import new_figure
from gen.surface import generate

ROUGH = generate_spectral(
    (129, 129), 1000.0, SelfAffineSpectrum(0.7, 250, 16.5), np.random.default_rng(1), rms_height=2.0
)
SHAPES = {
    "square": (ROUGH, "1000"),
    "flat": (np.zeros((20, 20)), "100"),
    "tiny": (1e-300 * ROUGH, "1000"),
    "lost": (1e9 + 1e-6 * ROUGH, "1000"),
}


@pytest.mark.few(3)
@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("shape", SHAPES)
def test_every_surface_is_drawn_and_nothing_is_cut(shape, tmp_path, monkeypatch, capsys):
    heights, side = SHAPES[shape]
    monkeypatch.chdir(tmp_path)
    np.save("surface.npy", heights)
    figures, save = [], pictures.save
    monkeypatch.setattr(
        pictures, "save", lambda figure, path: figures.append(figure) or save(figure, path)
    )
    assert cli.main(["describe", "surface.npy", "--side", side, "--plot", "one.png"]) == 0
    assert (tmp_path / "one.png").read_bytes().startswith(b"\x89PNG")
    assert "self-affine law" in capsys.readouterr().out
    (figure,) = figures
    renderer = FigureCanvasAgg(figure).get_renderer()
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


def drawn(contacts: list[bem.Contact], **changes: Any) -> Any:
    """A figure as it would be written, without the work of drawing its pixels."""
    figure = new_figure(11, 8.2, dpi=110)
    subject = {"name": NAME, "load": "delta", "material": True, "warnings": (), **changes}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(pictures, "save", lambda *_: None)
        draw_contacts(figure, contacts, Subject(**subject), Path("contact.png"))
    return figure


def titled(figure: Any, text: str) -> Any:
    """The axes with a text in their title or label."""
    return next(
        axis
        for axis in figure.axes
        if text in f"{axis.get_title(loc='left')} {axis.get_ylabel()}".splitlines()[0]
    )


@pytest.mark.few(4)
@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("shape", PATCHES)
def test_nothing_is_cut_or_overlaps(shape):
    heights, sides, deltas = PATCHES[shape]
    hardness = 4000.0 if "yielding" in shape else None
    contacts = list(bem.ladder(heights, sides, deltas, modulus=E_STAR, hardness=hardness))
    figure = drawn(contacts, warnings=(WARNING, "short"))
    renderer = FigureCanvasAgg(figure).get_renderer()
    figure.get_layout_engine().execute(figure)
    box, (width, height) = figure.get_tightbbox(renderer), figure.get_size_inches()
    assert min(box.x0, box.y0) >= 0, "something is cut on the left or below"
    assert box.x1 <= width, "something is cut on the right"
    assert box.y1 <= height, "something is cut above"
    section = titled(figure, "section at")
    assert section.get_window_extent(renderer).height > 1.2 * figure.dpi  # inches
    legend = section.get_legend().get_window_extent(renderer)
    assert not legend.overlaps(section._left_title.get_window_extent(renderer))
    left, spots = (titled(figure, text) for text in ("heights", "contact"))
    title = spots._left_title.get_window_extent(renderer)
    assert not title.overlaps(section.get_tightbbox(renderer))
    assert not left.get_tightbbox(renderer).overlaps(spots.get_tightbbox(renderer))


def test_titles_say_file_load_and_material():
    contacts = list(bem.ladder(FRACTAL, (100.0, 100.0), [1.0, 2.0], modulus=E_STAR))
    figure = drawn(contacts, warnings=("beware",))
    title = figure.get_suptitle()
    assert title.startswith("a folder/with $")
    assert title.splitlines()[0].endswith("scan.x3p")
    for said in ("last of 2 loads: Δ = 2 µm, force ", " N, mean pressure ", "E* = 200 GPa"):
        assert said in title
    assert "beware" in figure.get_supxlabel()
    alone = drawn(contacts[:1], name="scan.x3p", material=False)
    assert alone.get_suptitle().startswith("scan.x3p\nΔ = 1 µm")
    assert "no material given" in alone.get_suptitle()


def test_laws_have_the_gap_and_logarithmic_axes_over_decades():
    for pressures, scale in (([1.0, 3.0, 10.0], "linear"), ([3.0, 0.1, 30.0], "log")):
        contacts = list(bem.ladder(FRACTAL, (100.0, 100.0), pressures=pressures, modulus=1e4))
        figure = drawn(contacts, load="pressure")
        gap, area = titled(figure, "mean gap [µm]"), titled(figure, "contact area [%]")
        assert gap.get_xscale() == area.get_xscale() == area.get_yscale() == scale
        loads, gaps = gap.lines[0].get_data()
        np.testing.assert_allclose(loads, sorted(pressures), rtol=1e-6)
        assert sorted(gaps, reverse=True) == list(gaps)


def test_one_spike_does_not_set_the_colours():
    spiky = FRACTAL.copy()
    spiky[20, 10] += 8
    (contact,) = bem.ladder(spiky, (100.0, 100.0), [15.0], modulus=E_STAR)
    limits = titled(drawn([contact]), "contact: ").images[0].get_clim()
    assert limits[1] == pytest.approx(np.percentile(contact.pressure[contact.pressure > 0], 99))


def test_yielded_nodes_have_a_colour_of_their_own():
    (elastic,) = bem.ladder(FRACTAL, (100.0, 100.0), [6.0], modulus=E_STAR)
    (contact,) = bem.ladder(FRACTAL, (100.0, 100.0), [6.0], modulus=E_STAR, hardness=4000.0)
    assert contact.yielded_percent > 0
    figure = drawn([contact])
    assert "E* = 200 GPa, hardness 4 GPa" in figure.get_suptitle()
    spots = titled(figure, "contact: ")
    assert f"{contact.yielded_percent:.3g} % yielded (cyan)" in spots.get_title(loc="left")
    pressures, marks = (image.get_array() for image in spots.images)
    yielded = contact.pressure.T == 4000.0
    np.testing.assert_array_equal(marks[..., 3] == 1.0, yielded)
    np.testing.assert_array_equal(marks[yielded], np.tile((*CYAN, 1.0), (yielded.sum(), 1)))
    assert np.ma.getmaskarray(pressures)[yielded].all()
    assert pressures.max() < 4000.0
    assert [text.get_text() for text in titled(figure, "section at").get_legend().texts] == [
        "rough body",
        "half-space",
        "in contact",
        "yielded",
    ]
    figure = drawn([elastic])
    assert len(titled(figure, "contact: ").images) == 1
    assert "hardness" not in figure.get_suptitle()


def bumps(nx: int, ny: int, *places: tuple[int, int]) -> np.ndarray:
    """A flat surface with bumps."""
    heights = np.zeros((nx, ny))
    for place in places:
        heights[place] = 1.0
    return heights


@pytest.mark.parametrize(
    ("heights", "sides", "expected"),
    [
        (bumps(20, 20, (5, 8)), (19.0, 19.0), (0, 8)),
        (bumps(20, 20, (0, 8)), (19.0, 19.0), (0, 8)),  # at a border: across it
        (bumps(8, 20, (4, 3)), (7.0, 19.0), (1, 4)),  # along the longer side
        (bumps(20, 20, (0, 0)), (19.0, 19.0), (0, 0)),  # there is no other contact
    ],
)
def test_sections_run_through_the_contact(heights, sides, expected):
    assert section_line(bem.solve(heights, side=sides, delta=0.1)) == expected
