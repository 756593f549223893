"""Laws as JSON and as pictures."""

import os
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from strict import json_of

from gen.law import files
from gen.maps.settings import Reading
from gen.runtime.figure import new_figure


def test_tables_are_those_of_the_csv_and_nothing_is_infinite(surfaces, run):
    run("many", "--pressure", "1,10,1e6", "--json", "law.json", "--csv", "law.csv")
    content = json_of("law.json")
    assert content["format"] == "asperity contact law"
    assert content["version"] == 1
    assert content["e_star_MPa"] == 210e3 / (1 - 0.3**2)
    assert content["boundary"] == "mirror"
    over = content["tables"][1]
    rows = pd.read_csv("law.csv")
    rows = rows[rows.against == "pressure_MPa"]
    np.testing.assert_allclose(over["at"], rows.pressure_MPa)
    for name, curve in over["curves"].items():
        for part, end in (("value", ""), ("low", "_low"), ("high", "_high"), ("slope", "_slope")):
            values = np.array(curve[part], dtype=float)
            expected = rows[f"{name}{end}"].to_numpy(dtype=float)
            expected = np.where(np.isfinite(expected), expected, np.nan)
            np.testing.assert_array_equal(values, expected)
    assert over["at"] == [1, 10], "1e6 MPa is beyond full contact"


def test_names_of_files_that_are_no_text_have_question_marks(surfaces, run):
    name = os.fsdecode(b"many/s\xff.npy")
    (surfaces / "many/s0.npy").rename(name)
    run(name, "--pressure", "1,10", "--json", "law.json")
    assert "many/s?.npy" in str(json_of("law.json"))


@pytest.mark.parametrize(
    ("inputs", "conductivities"), [(("many/s0.npy",), None), (("many",), (50.0, 50.0))]
)
def test_curves_and_bands_stand_in_linear_and_log_axes(
    surfaces, make, monkeypatch, inputs, conductivities
):
    pytest.importorskip("matplotlib", reason="needs the extra plot")
    law = make(
        *inputs,
        pressure="0,1,10,1000000",
        e_star=2e5,
        conductivities=conductivities,
        stiffness=True,
        reading=Reading(side="100"),
    )
    figure = new_figure(12.0, 7.0)
    monkeypatch.setattr(files, "save", lambda *_: None)
    files.draw(figure, law, Path("law.png"))
    axes = figure.axes
    assert [axis.get_xscale() for axis in axes] == ["linear"] * 3 + ["log"] * 3
    assert axes[0].get_ylabel() == "closure [µm]"
    last = axes[2].get_ylabel()
    assert ("conductance" in last) == (conductivities is not None)
    for axis in axes:
        (line,) = axis.get_lines()
        assert len(line.get_xdata()) >= 2
        assert len(axis.collections) == (inputs == ("many",))
