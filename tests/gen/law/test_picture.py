"""Pictures of laws."""

from pathlib import Path

import pytest

pytest.importorskip("matplotlib", reason="needs the extra plot")

from gen.law import picture
from gen.runtime.figure import new_figure


@pytest.mark.parametrize("conductivities", [None, (50.0, 50.0)])
@pytest.mark.parametrize("inputs", [("many/s0.npy",), ("many",)])
def test_curves_and_bands_stand_in_linear_and_log_axes(
    surfaces, make, monkeypatch, inputs, conductivities
):
    from gen.option_groups import Reading

    law = make(
        *inputs,
        pressure="0,1,10,1000000",
        e_star=2e5,
        conductivities=conductivities,
        stiffness=True,
        reading=Reading(side="100"),
    )
    figure = new_figure(12.0, 7.0)
    monkeypatch.setattr(picture, "save", lambda *_: None)
    picture.draw(figure, law, Path("law.png"))
    axes = figure.axes
    assert [axis.get_xscale() for axis in axes] == ["linear"] * 3 + ["log"] * 3
    assert axes[0].get_ylabel() == "closure [µm]"
    last = axes[2].get_ylabel()
    assert ("conductance" in last) == (conductivities is not None)
    for axis in axes:
        (line,) = axis.get_lines()
        assert len(line.get_xdata()) >= 2
        assert len(axis.collections) == (inputs == ("many",))


def test_a_picture_is_written(surfaces, run):
    run("many", "--pressure", "1,10", "--plot", "law.png")
    assert Path("law.png").read_bytes().startswith(b"\x89PNG")
