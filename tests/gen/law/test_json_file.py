"""Laws as JSON."""

import os

import numpy as np
import pandas as pd
from strict import json_of


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
