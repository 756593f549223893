"""C headers: they compile, are the cubics of the tables, and say what they are."""

import shutil
import subprocess
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from gen.law import c_header

COMPILER = ["cc", "-std=c99", "-Wall", "-Wextra", "-Werror"]


needs_compiler = pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler")


def program(*lines, headers=("steel-2.h", "soft.h")):
    included = "\n".join(f'#include "{name}"' for name in headers)
    body = "\n".join(lines)
    return f"#include <stdio.h>\n{included}\nint main(void)\n{{\n{body}\nreturn 0;\n}}\n"


def compiled(text):
    Path("main.c").write_text(text)
    return subprocess.run(
        [*COMPILER, "main.c", "-o", "main"], capture_output=True, text=True, check=False, timeout=60
    )


def said_by(texts, headers):
    """The numbers that a C program prints."""
    lines = [f'printf("%.17g\\n", (double)({text}));' for text in texts]
    done = compiled(program(*lines, headers=headers))
    assert done.returncode == 0, done.stderr
    run = subprocess.run(["./main"], capture_output=True, text=True, check=True, timeout=60)
    return np.array([float(line) for line in run.stdout.split()])


NAMES = {
    "delta_um": ("area", "force", "mean_gap", "pressure", "closure", "stiffness", "conductance"),
    "pressure_MPa": ("delta", "closure", "area", "mean_gap", "stiffness", "conductance"),
}
SUFFIXES = {"delta_um": "", "pressure_MPa": "_at_pressure"}


@needs_compiler
def test_two_laws_in_one_program_have_the_values_bands_and_tangents_of_their_tables(surfaces, run):
    conducting = ["--conductivity", "50", "--hardness", "5000"]
    loads = ["--pressure", "1:100:6:log"]
    run("many", *loads, *conducting, "--csv", "many.csv", "--header", "many-2.h")
    run("many/s0.npy", "--delta", "0.1:0.5:5", *conducting, "--csv", "one.csv", "--header", "one.h")
    texts, expected = [], []
    for table, law, ends in (
        ("many.csv", "many_2", ("", "_low", "_high")),
        ("one.csv", "one", ("",)),
    ):
        rows = pd.read_csv(table)
        for against, names in NAMES.items():
            for _, row in rows[rows.against == against].iterrows():
                for name in names:
                    (column,) = [each for each in rows.columns if c_header.SHORT.get(each) == name]
                    own = f"asperity_{law}_{name}{SUFFIXES[against]}"
                    texts += [f"{own}{end}({row[against]:.17g})" for end in ends]
                    expected += [row[f"{column}{end}"] for end in ends]
                    texts.append(f"{own}_tangent({row[against]:.17g})")
                    expected.append(row[f"{column}_slope"])
                if against == "pressure_MPa":  # the law of a contact element
                    texts.append(f"asperity_{law}_pressure_at_closure({row.closure_um:.17g})")
                    expected.append(row.pressure_MPa)
    found = said_by(texts, ["many-2.h", "one.h", "many-2.h"])
    np.testing.assert_allclose(found, expected, rtol=1e-12)


@needs_compiler
def test_between_the_points_it_is_a_monotone_cubic_with_a_continuous_tangent(surfaces, run):
    run("many/s0.npy", "--pressure", "1:100:6:log", "--csv", "law.csv", "--header", "law.h")
    at = np.concatenate([np.linspace(1e-9, 110, 300), np.geomspace(1, 100, 6)])
    for function in ("delta_at_pressure", "area_at_pressure", "stiffness_at_pressure"):
        own, step = f"asperity_law_{function}", 1e-6
        texts = [f"{own}({p + h:.17g})" for p in at for h in (-step, 0, step)]
        low, here, high = said_by(texts, ["law.h"]).reshape(-1, 3).T
        tangent = said_by([f"{own}_tangent({p:.17g})" for p in at], ["law.h"])
        inside = (at > 2 * step) & (at < 100 - 2 * step)
        slopes = (high - low)[inside] / (2 * step)
        np.testing.assert_allclose(tangent[inside], slopes, rtol=1e-3, atol=1e-5 * slopes.max())
        assert (np.diff(here[:300]) >= -1e-12 * here.max()).all()
        assert (tangent >= 0).all()
        # Continuous where the pieces of the cubic meet.
        ends = [f"{own}_tangent({p * (1 + h):.17g})" for p in np.geomspace(1, 100, 6)[:-1]
                for h in (-1e-12, 1e-12)]  # fmt: skip
        before, behind = said_by(ends, ["law.h"]).reshape(-1, 2).T
        np.testing.assert_allclose(before, behind, rtol=1e-8, atol=1e-9 * tangent.max())


@needs_compiler
def test_a_header_says_what_it_is_and_a_second_of_its_name_is_an_error(surfaces, run):
    Path("other").mkdir()
    run("many/s0.npy", "--delta", "0.1,0.2", "--header", "steel.h")
    run("many/s1.npy", "--delta", "0.1,0.2", "--header", "other/steel.h")
    text = Path("steel.h").read_text()
    said = " ".join(text.partition("*/")[0].replace("\n *", "").split())
    assert "E* = 230769.23076923075 MPa" in said
    assert "Surface: many/s0.npy" in said
    assert "python -m gen law many/s0.npy --delta 0.1,0.2" in said
    assert "asperity 0" in said or "asperity 1" in said
    assert "Made: 20" in said
    assert "Beyond the ends of the tables, values are constant" in said
    assert "Band: the error of the grid, 9 times in 10" in said
    line = 'printf("%g\\n", asperity_steel_area(1.0));'
    assert compiled(program(line, headers=("steel.h", "steel.h"))).returncode == 0
    done = compiled(program(line, headers=("steel.h", "other/steel.h")))
    assert done.returncode == 1
    assert "two laws are named asperity_steel: give one of the headers another file" in done.stderr


@needs_compiler
@pytest.mark.parametrize("folder", ["x*\\\n/\nint evil = 1;\n", "b*??/\n/ int evil;"])
def test_a_name_cannot_end_the_comment_of_a_header(surfaces, run, folder):
    place = Path(folder)
    place.mkdir(parents=True)
    shutil.copy("many/s0.npy", place / "s.npy")
    run(place / "s.npy", "--delta", "0.1,0.2", "--header", "a.h")
    text = Path("a.h").read_bytes()
    comment, _, code = text.decode("ascii").partition("\n */\n")
    assert "evil" not in code
    assert "*/" not in comment
    assert not set(b"\\?\x1b\r") & set(comment.encode())
    assert compiled(program('printf("%g\\n", asperity_a_area(1.0));', headers=["a.h"])).stderr == ""
