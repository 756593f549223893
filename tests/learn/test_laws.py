"""Laws at the loads asked for, their bands, and what is withheld on unknown ground."""

import csv
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from scipy.interpolate import PchipInterpolator

from gen import cli as gen_cli
from gen.generation.plan import parameters
from gen.generation.sample import solve_contact, surface_of
from gen.scene import Scene
from learn import Surrogate, cli
from learn.surrogate.law import inversion
from learn.surrogate.law.points import Points

STEEL = ["--young", "210e3", "--poisson", "0.3"]
LOADS = ["--pressure", "100:2000:4"]
COLUMNS = ("delta_um", "area_percent", "mean_gap_um")
COMPILER = ["cc", "-std=c99", "-Wall", "-Wextra", "-Werror"]
needs_compiler = pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler")


def run(*arguments, ends=0):
    assert cli.main([str(argument) for argument in arguments]) == ends


def rows_of(path, against=None):
    with Path(path).open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    return [row for row in rows if against is None or row["against"] == against]


def column(rows, name):
    return np.array([float(row[name]) for row in rows])


def solved_by_gen(surface, *load):
    arguments = ["contact", surface, "--side", "1000", *load, *STEEL, "--csv", "gen.csv"]
    assert gen_cli.main(arguments) == 0
    return rows_of("gen.csv")


def test_the_solver_solves_at_the_pressures_asked_for(work, capsys):
    """Not on a grid of Delta, between which it would interpolate; a surrogate is not needed."""
    contacts = solved_by_gen("many/s0.npy", *LOADS)
    ask = ["many/s0.npy", "--side", "1000", "--solver", *LOADS, *STEEL, "--csv", "law.csv"]
    for before in ([], ["hybrid.surrogate"], ["dimensionless.surrogate"]):
        capsys.readouterr()
        run("law", *before, *ask)
        said = " ".join(capsys.readouterr().out.split())
        assert "solved contact by contact" in said
        assert "band: none, one surface was solved" in said
        found = rows_of("law.csv", "pressure_MPa")
        assert column(found, "pressure_MPa").tolist() == [100 + i * 1900 / 3 for i in range(4)]
        for name in COLUMNS:
            np.testing.assert_allclose(column(found, name), column(contacts, name), rtol=1e-6)
            assert {row[f"{name}_low"] + row[f"{name}_high"] for row in found} == {""}
        over_delta = rows_of("law.csv", "delta_um")[1:]
        np.testing.assert_allclose(
            column(over_delta, "force_uN"), column(contacts, "force_uN"), rtol=1e-6
        )
        assert f"{float(found[1]['delta_um']):.4g}" in said, "the pressures asked for are printed"
        assert "warning: from Delta" in said
        assert "where most materials yield" in said


def test_a_solved_population_has_bands_at_given_delta_and_pressure(work):
    files = [f"many/s{seed}.npy" for seed in range(3)]
    run("law", "many", "--side", "1000", "--solver", *LOADS, *STEEL, "--csv", "law.csv")
    contacts = [solved_by_gen(file, *LOADS) for file in files]
    found = rows_of("law.csv", "pressure_MPa")
    for name in COLUMNS:
        every = np.array([column(each, name) for each in contacts])
        np.testing.assert_allclose(column(found, name), every.mean(axis=0), rtol=1e-6)
        for end, share in (("low", 0.05), ("high", 0.95)):
            ends = column(found, f"{name}_{end}")
            np.testing.assert_allclose(ends, np.quantile(every, share, axis=0), rtol=1e-6)
        assert (column(found, f"{name}_low") < column(found, f"{name}_high")).all()
    over_delta = rows_of("law.csv", "delta_um")[1:]
    np.testing.assert_allclose(column(over_delta, "delta_um"), column(found, "delta_um"))
    deltas = ",".join(row["delta_um"] for row in over_delta)
    contacts = [solved_by_gen(file, "--delta", deltas) for file in files]
    for name in ("area_percent", "force_uN", "mean_gap_um", "pressure_MPa"):
        every = np.array([column(each, name) for each in contacts])
        np.testing.assert_allclose(column(over_delta, name), every.mean(axis=0), rtol=1e-6)
        ends = column(over_delta, f"{name}_high")
        np.testing.assert_allclose(ends, np.quantile(every, 0.95, axis=0), rtol=1e-6)


SCENE = """
samples = 9
[surface]
nodes = 17
[contact]
kernel = "concentrated-force"
far_field = "compliant"
spacing = "side/n"
modulus = 100.0
poisson = 0.3
"""


def test_a_scene_is_solved_as_it_says(work, capsys):
    """Its kernel, far field, spacing and modulus; and over its range of Delta unless told."""
    Path("mirco.toml").write_text(SCENE)
    scene = Scene.parse(SCENE, "mirco.toml")
    run("law", "mirco.toml", "--solver", "--surfaces", "2", "--delta", "2,5", "--csv", "law.csv")
    assert f"E* = {100 / 0.91:g} MPa" in capsys.readouterr().out
    found = rows_of("law.csv", "delta_um")[1:]
    plan = parameters(scene, 0, 2)
    for row in found:
        contacts = [
            solve_contact(scene, surface_of(scene, plan, surface), float(row["delta_um"]))
            for surface in range(2)
        ]
        assert float(row["force_uN"]) == pytest.approx(np.mean([each.force for each in contacts]))
        pressure = np.mean([each.force for each in contacts]) / (17 * scene.spacing) ** 2
        assert float(row["pressure_MPa"]) == pytest.approx(pressure)
    run(
        "law", "hybrid.surrogate", "mirco.toml", "--surfaces", "2", "--delta", "5", "--csv", "p.csv"
    )
    (predicted,) = rows_of("p.csv", "delta_um")[1:]
    cells = float(predicted["force_uN"]) / float(predicted["pressure_MPa"])
    assert cells == pytest.approx((17 * scene.spacing) ** 2)
    Path("rigid.toml").write_text(SCENE.replace('far_field = "compliant"', ""))
    run("law", "rigid.toml", "--solver", "--surfaces", "2", "--csv", "law.csv")
    deltas = column(rows_of("law.csv", "delta_um"), "delta_um")
    np.testing.assert_allclose(deltas, [0, *np.linspace(5, 45, 40)])


def test_a_predicted_population_has_bands_at_given_pressure(work):
    ask = ["--side", "1000", "--delta", "4:40:13", "--pressure", "0.002:0.02:4", "--csv"]
    run("law", "hybrid.surrogate", "many", *ask, "predicted.csv")
    run("law", "hybrid.surrogate", "many", *ask, "solved.csv", "--solver")
    for against in ("delta_um", "pressure_MPa"):
        predicted, solved = (rows_of(f"{name}.csv", against) for name in ("predicted", "solved"))
        predicted, solved = zip(
            *[
                (one, other)
                for one, other in zip(predicted, solved, strict=True)
                if one["area_percent_low"] and float(one[against])
            ],
            strict=True,
        )
        assert len(predicted) >= 3
        names = set(COLUMNS) - {against}
        for name in names:
            low, high = (column(predicted, f"{name}_{end}") for end in ("low", "high"))
            assert (low < column(predicted, name)).all()
            assert (column(predicted, name) < high).all()
            for end in ("", "_low", "_high"):
                np.testing.assert_allclose(
                    column(predicted, f"{name}{end}"), column(solved, f"{name}{end}"), rtol=0.1
                )


def test_an_interval_at_given_pressure_is_that_of_the_force_read_the_other_way(work):
    ask = ["law", "hybrid.surrogate", "many/s1.npy", "--side", "1000", "--delta", "6:40:35"]
    run(*ask, "--pressure", "0.002:0.02:7", "--csv", "law.csv")
    over = [row for row in rows_of("law.csv", "delta_um") if row["pressure_MPa_low"]]
    at = rows_of("law.csv", "pressure_MPa")
    assert all(row["delta_um_low"] for row in at)
    delta, pressure = column(over, "delta_um"), column(at, "pressure_MPa")
    for end, other in (("low", "high"), ("high", "low")):
        ends = column(at, f"delta_um_{end}")
        reached = PchipInterpolator(delta, column(over, f"pressure_MPa_{other}"))(ends)
        np.testing.assert_allclose(reached, pressure, rtol=2e-3)
        area = PchipInterpolator(delta, column(over, f"area_percent_{end}"))(ends)
        np.testing.assert_allclose(column(at, f"area_percent_{end}"), area, rtol=2e-3)
        gap = PchipInterpolator(delta, column(over, f"mean_gap_um_{other}"))(ends)
        np.testing.assert_allclose(column(at, f"mean_gap_um_{other}"), gap, rtol=2e-3)


def test_the_inverse_of_a_law_knows_its_level_stretches():
    """A force predicted as 0 up to some Delta: a small pressure is reached behind that."""
    delta = np.array([0.0, 1.0, 2.0, 3.0, 4.0])
    values = {"delta_um": delta, "area_percent": delta, "mean_gap_um": 4 - delta}
    values["pressure_MPa"] = np.array([0.0, 1.0, 2.0, 3.0, 4.0])
    low = {**values, "pressure_MPa": np.array([0.0, 0.0, 0.0, 1.0, 2.0])}
    high = {**values, "pressure_MPa": values["pressure_MPa"] + [0, 1, 1, 1, 1]}
    points = Points(values, low, high, ("",) * 5)
    found = inversion.at_pressures(points, np.array([0.0, 1e-9, 2.0, 3.0]))
    np.testing.assert_allclose(found.values["delta_um"], [0, 0, 2, 3], atol=1e-6)
    np.testing.assert_allclose(found.low["delta_um"], [0, 0, 1, 2], atol=1e-6)
    np.testing.assert_allclose(found.high["delta_um"], [0, 2, 4, np.nan], atol=1e-2)
    assert found.endless == ("", "", "", "its interval ends beyond the last displacement")
    unknown = Points(values, low, high, ("", "", "", "", "far"))
    found = inversion.at_pressures(unknown, np.array([0.5, 2.0, 3.5]))
    assert found.reasons == ("", "", "far")
    assert found.endless[:2] == ("", "its interval ends where far")


ONE = ["hybrid.surrogate", "many/s0.npy", "--side", "1000"]


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (["many/s0.npy", "--side", "1000"], "give a surrogate and then surfaces, or surfaces and"),
        (["many/s0.npy", "many/s1.npy", "--side", "1000"], "many/s0.npy: is no surrogate"),
        (["hybrid.surrogate", "--solver"], "give a surrogate and then surfaces, or surfaces and"),
        (["many/s0.npy", "--side", "1000", "--solver"], "give --delta or --pressure"),
        (["many/s0.npy", "--solver", "--delta", "1"], "--side"),
        (["a.toml", "b.toml", "--solver", "--surfaces", "2"], "E* = 1 and 2 MPa: give one with"),
        ([*ONE, "--solver", "--pressure", "0"], "--pressure '0': give pressures of 0 MPa or more"),
        ([], "Missing argument '[SURROGATE] INPUT...'"),
        ([*ONE, "--delta", "5,9", "--pressure", "9"], "give a larger --delta"),
    ],
)
def test_a_law_that_cannot_be_is_refused(work, capsys, arguments, word):
    for name, modulus in (("a", 1.0), ("b", 2.0)):
        text = f"samples = 2\n[surface]\nnodes = 9\n[contact]\nmodulus = {modulus}\n"
        Path(f"{name}.toml").write_text(text)
    run("law", *arguments, ends=2)
    assert word in capsys.readouterr().err.splitlines()[-1]


def test_no_interval_is_given_on_unknown_ground(work, capsys, monkeypatch):
    """Neither in print nor in the CSV; the number stays, dim, with its reason."""
    monkeypatch.setenv("COLUMNS", "160")
    ask = ["many/s0.npy", "--side", "1000", "--delta", "0.5,20"]
    for command, option in (("predict", "-o"), ("law", "--csv")):
        monkeypatch.delenv("FORCE_COLOR", raising=False)
        run(command, "hybrid.surrogate", *ask, option, "out.csv")
        plain = capsys.readouterr().out
        monkeypatch.setenv("FORCE_COLOR", "1")
        run(command, "hybrid.surrogate", *ask, option, "out.csv")
        coloured = capsys.readouterr().out
        rows = [row for row in rows_of("out.csv") if row.get("against") != "pressure_MPa"]
        unknown, known = rows[-2:]
        for name in ("area_percent", "force_uN"):
            assert unknown[f"{name}_low"] == unknown[f"{name}_high"] == ""
            assert float(known[f"{name}_low"]) < float(known[f"{name}_high"])
            value = f"{float(unknown[name]):.4g} (-)"
            assert value in plain
            (line,) = [each for each in coloured.splitlines() if value in each]
            assert "\x1b[2m" in line
            assert f"{float(known[name]):.4g} ({float(known[f'{name}_low']):.4g} to" in plain
        assert unknown["reason"].startswith("delta/h")
        assert known["reason"] == ""
        assert "delta/h" in plain


def test_a_file_name_is_no_markup(work, capsys):
    shutil.copy("many/s0.npy", "a[red]b.npy")
    run("predict", "hybrid.surrogate", "a[red]b.npy", "--side", "1000", "--delta", "20")
    assert "a[red]b.npy" in capsys.readouterr().out


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
    run("law", "many", *ask, "solved.h", "--solver", "--pressure", "0.001,0.002")
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


def test_the_surrogates_own_answers_keep_their_intervals(made):
    """What is withheld is what is shown; in Python, `reasons` tells where they do not hold."""
    surrogate = Surrogate.load(made / "hybrid.surrogate")
    answer = surrogate.predict(np.load(made / "many/s0.npy"), 1000.0, [0.5])
    assert answer.reasons[0]
    assert answer.low["area"].shape == (1,)
