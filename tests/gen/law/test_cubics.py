"""Laws as cubics: a header as a C compiler takes it."""

import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from gen.law import cubics
from gen.law.cubics import Between, Function, short_name
from gen.law.curves import slopes
from gen.maps.settings import Reading
from gen.quantities import CONTINUUM, IN_LAWS
from tests.bem.waves import random_waves

COMPILER = ["cc", "-std=c99", "-Wall", "-Wextra", "-Werror"]
needs_compiler = pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler")


def compiled(texts, *headers):
    """How the compiler ends on a program that prints some numbers."""
    lines = ["#include <stdio.h>", *(f'#include "{name}"' for name in headers)]
    lines += ["int main(void)", "{"]
    lines += [f'printf("%.17g\\n", (double)({text}));' for text in texts]
    Path("main.c").write_text("\n".join([*lines, "return 0;", "}", ""]))
    compiling = [*COMPILER, "main.c", "-o", "main"]
    return subprocess.run(
        compiling, capture_output=True, text=True, check=False, timeout=60
    )


def said_by(texts, *headers):
    """The numbers that a C program prints."""
    done = compiled(texts, *headers)
    assert done.returncode == 0, done.stderr
    return np.array([float(line) for line in subprocess.check_output(["./main"]).split()])


NAMES = {
    "delta_um": (
        "area",
        "force",
        "mean_gap",
        "pressure",
        "closure",
        "stiffness",
        "conductance",
    ),
    "pressure_MPa": ("delta", "closure", "area", "mean_gap", "stiffness", "conductance"),
}
ENDS_OF = {"delta_um": "", "pressure_MPa": "_at_pressure"}


@needs_compiler
def test_two_laws_in_one_program_have_the_values_bands_and_tangents_of_their_tables(
    surfaces, run
):
    conducting = ["--conductivity", "50", "--hardness", "5000", "--no-check"]
    loads = ["--pressure", "1:100:6:log"]
    run("many", *loads, *conducting, "--csv", "many.csv", "--header", "many-2.h")
    run(
        "many/s0.npy",
        "--delta",
        "0.1:0.5:5",
        *conducting,
        "--csv",
        "one.csv",
        "--header",
        "one.h",
    )
    texts, expected = [], []
    for law, ends in (("many_2", ("", "_low", "_high")), ("one", ("",))):
        rows = pd.read_csv(f"{law.removesuffix('_2')}.csv")
        for against, names in NAMES.items():
            for _, row in rows[rows.against == against].iterrows():
                for name in names:
                    (column,) = [
                        each
                        for each in rows.columns
                        if each in IN_LAWS and short_name(each) == name
                    ]
                    own = f"asperity_{law}_{name}{ENDS_OF[against]}"
                    texts += [f"{own}{end}({row[against]:.17g})" for end in ends]
                    expected += [row[f"{column}{end}"] for end in ends]
                    texts.append(f"{own}_tangent({row[against]:.17g})")
                    expected.append(row[f"{column}_slope"])
                if against == "pressure_MPa":  # the law of a contact element
                    texts.append(
                        f"asperity_{law}_pressure_at_closure({row.closure_um:.17g})"
                    )
                    expected.append(row.pressure_MPa)
    found = said_by(texts, "many-2.h", "one.h", "many-2.h")
    np.testing.assert_allclose(found, expected, rtol=1e-12)


@needs_compiler
def test_between_the_points_it_is_a_monotone_cubic_with_a_continuous_tangent(
    surfaces, run
):
    run(
        "many/s0.npy",
        "--pressure",
        "1:100:6:log",
        "--csv",
        "law.csv",
        "--header",
        "law.h",
    )
    at = np.concatenate([np.linspace(1e-9, 110, 300), np.geomspace(1, 100, 6)])
    for function in ("delta_at_pressure", "area_at_pressure", "stiffness_at_pressure"):
        own, step = f"asperity_law_{function}", 1e-6
        texts = [f"{own}({p + h:.17g})" for p in at for h in (-step, 0, step)]
        low, here, high = said_by(texts, "law.h").reshape(-1, 3).T
        tangent = said_by([f"{own}_tangent({p:.17g})" for p in at], "law.h")
        inside = (at > 2 * step) & (at < 100 - 2 * step)
        slopes = (high - low)[inside] / (2 * step)
        np.testing.assert_allclose(
            tangent[inside], slopes, rtol=1e-3, atol=1e-5 * slopes.max()
        )
        assert (np.diff(here[:300]) >= -1e-12 * here.max()).all()
        assert (tangent >= 0).all()
        # Continuous where the pieces of the cubic meet.
        ends = [
            f"{own}_tangent({p * (1 + h):.17g})"
            for p in np.geomspace(1, 100, 6)[:-1]
            for h in (-1e-12, 1e-12)
        ]
        before, behind = said_by(ends, "law.h").reshape(-1, 2).T
        np.testing.assert_allclose(before, behind, rtol=1e-8, atol=1e-9 * tangent.max())


@needs_compiler
def test_past_the_end_a_joint_is_as_stiff_as_at_its_last_point(surfaces, run):
    """Pressure, force, Delta and closure go on; what has a bound or none that is known stays."""
    conducting = ["--conductivity", "50", "--csv", "many.csv", "--header", "many.h"]
    run("many", "--pressure", "1:100:6:log", *conducting, "--no-check")
    rows = pd.read_csv("many.csv")
    going_on = {"delta", "closure", "force", "pressure"}
    functions = [("pressure_at_closure", rows.closure_um.dropna().iloc[-1], ("",), True)]
    for against, names in NAMES.items():
        last = rows[rows.against == against][against].iloc[-1]
        for name in names:
            function = f"{name}{ENDS_OF[against]}"
            functions.append((function, last, ("", "_low", "_high"), name in going_on))
    beyond = 1 + np.array([0.0, 1e-3, 0.5, 20.0])
    texts = [
        f"asperity_many_{function}{end}({last * share:.17g})"
        for function, last, ends, _ in functions
        for end in (*ends, "_tangent")
        for share in beyond
    ]
    numbers = iter(said_by(texts, "many.h").reshape(-1, beyond.size))
    for function, last, ends, goes_on in functions:
        for _ in ends:
            values = next(numbers)
            if not goes_on:
                np.testing.assert_allclose(
                    values, values[0], rtol=1e-14, err_msg=function
                )
                continue
            slopes = np.diff(values) / np.diff(last * beyond)
            assert slopes[0] > 0, function
            np.testing.assert_allclose(slopes, slopes[0], rtol=1e-6)
        tangents = next(numbers)
        if goes_on:
            assert (tangents == tangents[0]).all(), function
            assert tangents[0] > 0, function
        else:
            assert (tangents[1:] == 0).all(), function


def test_a_cubic_that_ends_level_goes_on_with_the_slope_of_its_last_interval():
    at, values = np.array([0.0, 1.0, 11.0]), np.array([0.0, 1.0, 1.5])
    assert slopes(at, values, 0.0)[-1] == pytest.approx(0.0, abs=1e-12)
    assert cubics._slopes_that_go_on(at, values)[-1] == pytest.approx(0.05)


@needs_compiler
def test_unknown_ends_of_a_band_are_no_numbers(surfaces, make):
    law = make(
        "many", pressure="1,10", e_star=2e5, stiffness=True, reading=Reading(side="100")
    )
    area, at = law.over_delta.curves["area_percent"], law.over_delta.at
    unknown = replace(area, low=np.where(np.arange(area.low.size) == 1, np.nan, area.low))
    curves = replace(
        law.over_delta, curves={**law.over_delta.curves, "area_percent": unknown}
    )
    cubics.write_header(Path("law.h"), replace(law, over_delta=curves))
    places = (at[1], (at[0] + at[1]) / 2, at[2])
    found = said_by([f"asperity_law_area_low({place:.17g})" for place in places], "law.h")
    assert np.isnan(found).tolist() == [True, True, False]


def test_a_header_names_a_band_of_the_area_over_delta_alone(here, make):
    np.save("waves.npy", 100 * random_waves(1, 4, 0.8, 1)(48))
    law = make(
        "waves.npy",
        delta="1,2",
        pressure="0.001,2000",
        e_star=230e3,
        boundary="periodic",
        grid_error=True,
        reading=Reading(side="100"),
    )
    assert law.over_delta.resolved.tolist() == [True] * 3
    assert law.over_pressure.resolved.tolist() == [False, True]
    cubics.write_header(Path("law.h"), law)
    text = Path("law.h").read_text()
    area = f"asperity_law_{short_name(CONTINUUM.in_laws)}"
    assert f"{area}_low(" in text
    assert f"{area}_at_pressure_low(" not in text
    assert "Functions _low and _high of the area in the continuum alone" in text


@needs_compiler
def test_a_header_says_what_it_is_and_a_second_of_its_name_is_an_error(surfaces, run):
    Path("other").mkdir()
    run("many/s0.npy", "--delta", "0.1,0.2", "--header", "steel.h")
    run("many/s1.npy", "--delta", "0.1,0.2", "--header", "other/steel.h")
    text = Path("steel.h").read_text()
    said = " ".join(text.partition("*/")[0].replace("\n *", "").split())
    for words in (
        "E* = 230769.23076923075 MPa",
        "Surface: many/s0.npy",
        "Made: 20",
        "python -m gen law many/s0.npy --delta 0.1,0.2",
        "Pressure, force, Delta and closure follow their last slope beyond",
        "Band: the error of the grid, 9 times in 10",
    ):
        assert words in said
    assert compiled(["asperity_steel_area(1.0)"], "steel.h", "steel.h").returncode == 0
    done = compiled(["asperity_steel_area(1.0)"], "steel.h", "other/steel.h")
    assert done.returncode == 1
    assert (
        "two laws are named asperity_steel: give one of the headers another file"
        in done.stderr
    )


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
    assert compiled(["asperity_a_area(1.0)"], "a.h").stderr == ""


@pytest.mark.parametrize("goes_on", [True, False])
def test_the_deviation_is_that_of_the_cubic_that_is_written(goes_on):
    """Where a law ends level, functions that go on are written with another last slope."""
    at = np.arange(4.0)
    function = Function(
        name="force",
        argument="delta",
        at=at,
        values=np.array([0.0, 1.0, 3.0, 3.2]),
        goes_on=goes_on,
        tangent=True,
        between=Between(
            at=np.array([2.5]), values=np.array([3.0]), inside=np.array([True])
        ),
    )
    assert (function.slopes[-1] > 0) == goes_on
    middle = 3.1 + (function.slopes[2] - function.slopes[3]) / 8  # cubic of Hermite
    assert function.deviation.inside == pytest.approx(middle / 3.0 - 1, rel=1e-12)
