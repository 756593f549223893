"""Pictures of contacts: nothing cut or overlapping, and what they show."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from whole_pictures import assert_whole

import bem
from gen.runtime.figure import new_figure
from gen.surface import generate

pytest.importorskip("matplotlib", reason="needs the extra plot")

from matplotlib.backends.backend_agg import FigureCanvasAgg

from gen.maps import contact_pictures
from gen.maps.answers import AnswerOptions, answers
from gen.maps.contact_pictures import ContactCaptions, plot_contacts
from gen.material import Bodies

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
        patch.setattr(contact_pictures, "save", lambda *_: None)
        plot_contacts(figure, contacts[-1], rows, Path("contact.png"), captions)
    return figure


def titled(figure, text):
    """The axes with a text in their title or label."""
    return next(
        axis
        for axis in figure.axes
        if text in f"{axis.get_title(loc='left')} {axis.get_ylabel()}".splitlines()[0]
    )


@pytest.mark.few(1)
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
