"""A law in an input that FreeCAD wrote for CalculiX, changed as docs/how-to/freecad.md says.

`freecad-two-blocks.inp` is what the solver object of FreeCAD 0.20.2 wrote for two steel blocks of a
cubic millimetre with a contact constraint between two faces and a pressure of 20 MPa on the upper
one. The faces overlap by 0.1 um, so that FreeCAD tells them apart.
"""

import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from gen import cli
from tests.maps import waves

INPUT = Path(__file__).parent / "freecad-two-blocks.inp"
LAW = ("law", "surface.npy", "--side=100", "--young=210e3", "--poisson=0.3")
OVERLAP = 1e-4  # of the faces before they are pressed [mm]
PRESSURE = 20.0  # [MPa]


def with_law(text):
    """Put the law in place of the linear contact of FreeCAD's input."""
    block = re.compile(r"^\*SURFACE INTERACTION.*?(?=^\*\*)", re.DOTALL | re.MULTILINE)
    text, replaced = block.subn("*INCLUDE, INPUT=joint.inp\n", text)
    assert replaced == 1
    pair = r"^\*CONTACT PAIR, INTERACTION=\w+,TYPE=SURFACE TO SURFACE$"
    named = "*CONTACT PAIR, INTERACTION=JOINT, TYPE=SURFACE TO SURFACE"
    text, renamed = re.subn(pair, named, text, flags=re.MULTILINE)
    assert renamed == 1
    return text


def displacements(path):
    """Return the displacement along z of each node of a .frd file with one step [mm]."""
    text = path.read_text(encoding="ascii")
    table = text.partition(" DISP ")[2].partition("\n -3")[0]
    lines = [line for line in table.splitlines() if line.startswith(" -1")]
    return {int(line[3:13]): float(line[37:49]) for line in lines}


@pytest.mark.skipif(shutil.which("ccx") is None, reason="no CalculiX")
def test_the_input_of_freecad_closes_as_the_law_says(here):
    np.save("surface.npy", waves(24, 2))
    line = [*LAW, "--pressure=2:80:8:log", "--calculix=joint.inp", "--csv=joint.csv"]
    assert cli.main(line) == 0
    Path("blocks.inp").write_text(with_law(INPUT.read_text(encoding="ascii")), "ascii")
    subprocess.run(["ccx", "blocks"], cwd=here, check=True, capture_output=True)
    of_nodes = displacements(Path("blocks.frd"))
    lower = np.mean([of_nodes[node] for node in (5, 6, 7, 8)])
    upper = np.mean([of_nodes[node] for node in (101, 102, 103, 104)])
    closure = lower - upper + OVERLAP
    table = pd.read_csv("joint.csv")
    table = table[table.against == "pressure_MPa"]
    expected = np.interp(PRESSURE, table.pressure_MPa, table.closure_um)
    assert 1e3 * closure == pytest.approx(expected, rel=0.02)
