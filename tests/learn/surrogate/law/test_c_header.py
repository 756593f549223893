"""C headers: they compile, interpolate, and say what they are."""

import math
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from laws import STEEL, column, rows_of, run

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


@needs_compiler
def test_two_headers_work_in_one_program(work):
    ask = ["--side", "1000", "--delta", "0.5,6,12,20", "--header"]
    run("law", "hybrid.surrogate", "many/s0.npy", *ask, "steel-2.h", *STEEL, "--csv", "steel.csv")
    run("law", "hybrid.surrogate", "many", *ask, "soft.h", "--csv", "soft.csv")
    free = ["--solver", "--boundary", "free"]
    run("law", "many", *ask, "solved.h", *free, "--pressure", "0.001,0.002")
    texts, expected = [], []
    for name in ("steel_2", "soft"):
        for against, argument, suffix in (
            ("delta_um", "{:.17g}", ""),
            ("pressure_MPa", "{:.17g}", "_at_pressure"),
        ):
            rows = rows_of(f"{name.removesuffix('_2')}.csv", against)
            for row in [*rows, {**rows[-1], against: "1e9"}]:
                for end in ("", "_low", "_high"):
                    at = argument.format(float(row[against]))
                    texts.append(f"asperity_{name}_area{suffix}{end}({at})")
                    expected.append(float(row[f"area_percent{end}"] or "nan"))
    own = [
        "asperity_solved_area_at_pressure(0.0)",
        "asperity_solved_delta_at_pressure(0.0005) / asperity_solved_delta_at_pressure(0.001)",
        "asperity_solved_delta_at_pressure_high(0.001) > asperity_solved_delta_at_pressure(0.001)",
        "asperity_steel_2_area_tangent(1e9)",
        "asperity_solved_mean_gap_at_pressure_low(-1.0) == asperity_solved_mean_gap_low(0.0)",
    ]
    lines = [f'printf("%.17g\\n", (double)({text}));' for text in [*texts, *own]]
    done = compiled(program(*lines, headers=("steel-2.h", "soft.h", "solved.h", "soft.h")))
    assert done.returncode == 0, done.stderr
    said = subprocess.run(["./main"], capture_output=True, text=True, check=True, timeout=60).stdout
    found = [float(line) for line in said.split()]
    np.testing.assert_allclose(found[:-5], expected, rtol=1e-12)
    assert np.isnan(expected).any(), "the NAN of unknown ground was seen"
    assert found[-5:] == [0.0, 0.5, 1.0, 0.0, 1.0]


@needs_compiler
def test_a_header_says_what_it_is_and_a_second_of_its_name_is_an_error(work):
    ask = ["--side", "1000", "--solver", "--header"]
    Path("other").mkdir()
    run("law", "many/s0.npy", "--delta", "5,9", *ask, "steel.h")
    run("law", "many/s1.npy", "--delta", "5,9", *ask, "other/steel.h")
    text = Path("steel.h").read_text()
    said = " ".join(text.partition("*/")[0].replace("\n *", "").split())
    assert "E* = 1 MPa" in said
    assert "Surface: many/s0.npy" in said
    assert "python -m learn law many/s0.npy --delta 5,9 --header steel.h --solver" in said
    assert "asperity 0" in said or "asperity 1" in said
    assert "Made: 20" in said
    assert "Beyond the ends of the tables, values are constant" in said
    assert "No functions _low and _high. Band: none, one surface was solved" in said
    line = 'printf("%g\\n", asperity_steel_area(1.0));'
    assert compiled(program(line, headers=("steel.h", "steel.h"))).returncode == 0
    done = compiled(program(line, headers=("steel.h", "other/steel.h")))
    assert done.returncode == 1
    assert "two laws are named asperity_steel: give one of the headers another file" in done.stderr


@needs_compiler
@pytest.mark.parametrize(
    "folder",
    ["x*\\\n/\nint evil = 1;\n", "a*/int evil;/*", "b*??/\n/ int evil;", "\x1b[2Jµ\\", "c/*/**/d"],
)
def test_a_name_cannot_end_the_comment_of_a_header(work, folder):
    place = Path(folder)
    place.mkdir(parents=True)
    shutil.copy("many/s0.npy", place / "s.npy")
    run("law", place / "s.npy", "--side", "1000", "--solver", "--delta", "9", "--header", "a.h")
    text = Path("a.h").read_bytes()
    comment, _, code = text.decode("ascii").partition("\n */\n")
    assert "evil" not in code
    assert "*/" not in comment
    assert not set(b"\\?\x1b\r") & set(comment.encode())
    assert compiled(program('printf("%g\\n", asperity_a_area(1.0));', headers=["a.h"])).stderr == ""


PROGRAM = r"""
#include <stdio.h>
#include "law.h"
int main(void)
{
    for (int i = -2; i <= 50; ++i) {
        double d = 0.9 * i;
        double p = 1e-4 * i;
        printf("%.17g %.17g %.17g %.17g %.17g\n", asperity_law_pressure(d), asperity_law_area(d),
               asperity_law_pressure_tangent(d), asperity_law_mean_gap_at_pressure(p),
               asperity_law_delta_at_pressure_tangent(p));
    }
    return 0;
}
"""


@pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler")
def test_the_header_compiles_and_interpolates(work):
    ask = ["law", "hybrid.surrogate", "many/s0.npy", "--side", 1000, "--delta", "2:40:12"]
    run(*ask, "--csv", "law.csv", "--header", "law.h")
    (work / "main.c").write_text(PROGRAM)
    build = ["cc", "-std=c99", "-Wall", "-Wextra", "-Werror", "main.c", "-o", "main"]
    subprocess.run(build, check=True, timeout=60)
    said = subprocess.run(["./main"], check=True, capture_output=True, text=True, timeout=60).stdout
    found = np.array([[float(each) for each in line.split()] for line in said.splitlines()])
    rows = rows_of("law.csv")
    by_delta = [row for row in rows if row["against"] == "delta_um"]
    by_pressure = [row for row in rows if row["against"] == "pressure_MPa"]
    steps = np.arange(-2, 51)
    delta, pressure = 0.9 * steps, 1e-4 * steps
    over, force = column(by_delta, "delta_um"), column(by_delta, "pressure_MPa")
    np.testing.assert_allclose(found[:, 0], np.interp(delta, over, force), rtol=1e-12)
    area = np.interp(delta, over, column(by_delta, "area_percent"))
    np.testing.assert_allclose(found[:, 1], area, rtol=1e-12)
    # The tangent is that of the interpolation: differences between neighbours inside a segment.
    segment = np.searchsorted(over, delta, side="right") - 1
    inside = (delta > 0) & (delta < over[-1])
    slopes = np.diff(force) / np.diff(over)
    np.testing.assert_allclose(found[inside, 2], slopes[segment[inside]], rtol=1e-9)
    assert found[0, 2] == 0
    at, gap = column(by_pressure, "pressure_MPa"), column(by_pressure, "mean_gap_um")
    np.testing.assert_allclose(found[:, 3], np.interp(pressure, at, gap), rtol=1e-12)
    assert (found[(pressure > 0) & (pressure < at[-1]), 4] > 0).all()
    assert not math.isnan(found.sum())
