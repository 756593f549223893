"""A surface alone or against a second one, as gen contact and gen describe take them."""

import csv
from pathlib import Path

import numpy as np
import pytest

from gen import cli


@pytest.fixture(autouse=True)
def work(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for seed, name in enumerate(("a", "b")):
        np.save(f"{name}.npy", np.random.default_rng(seed).normal(size=(17, 17)))


def solved(*arguments, command="contact"):
    load = ["--delta", "1"] if command == "contact" else []
    given = [command, *map(str, arguments), *load, "--csv", "out.csv"]
    assert cli.main(given) == 0
    with Path("out.csv").open(newline="") as file:
        (row,) = csv.DictReader(file)
    return row


def with_header(name, heights, width):
    """Write a map as Gwyddion does, with its own lengths and unit."""
    lines = [f"# Width: {width} nm", f"# Height: {width} nm", "# Value units: nm"]
    lines += ["\t".join(map(str, row)) for row in heights]
    Path(name).write_text("\n".join(lines) + "\n")


def test_the_contact_of_two_bodies_is_that_of_their_sum(capsys):
    pair = solved("a.npy", "--side", 16, "--against", "b.npy", "--young", 10, "--young", 20)
    assert (
        "pressed against body 2 (b.npy), turned over (its x runs backwards)"
        in capsys.readouterr().out
    )
    np.save("sum.npy", np.load("a.npy") + np.load("b.npy")[::-1])
    one = solved("sum.npy", "--side", 16, "--young", 10, "--young", 20)
    assert float(pair["force_uN"]) == pytest.approx(float(one["force_uN"]), rel=1e-9)
    assert float(pair["modulus_MPa"]) == pytest.approx(1 / (1 / 10 + 1 / 20))
    assert "body 2: read 17 x 17 nodes" in pair["prepared"]


def test_a_body_against_itself_and_a_flat_one():
    np.save("flat.npy", np.full((17, 17), 2.5))
    alone = solved("a.npy", "--side", 16)
    flat = solved("a.npy", "--side", 16, "--against", "flat.npy")
    for name in ("force_uN", "area_percent", "mean_gap_um", "residual"):
        assert flat[name] == alone[name]
    assert float(solved("a.npy", "--side", 16, "--against", "a.npy")["force_uN"]) > 0


def test_both_bodies_are_prepared_alike_unless_the_second_has_options_of_its_own():
    options = ["a.npy", "--side", 16, "--level", "plane", "--against", "b.npy"]
    alike = solved(*options, command="describe")["prepared"]
    assert "body 1: levelled by a plane" in alike
    assert "body 2: levelled by a plane" in alike
    own = solved(
        *options, "--against-options", "--side 8 --invert --downsample 2", command="describe"
    )
    assert "body 1: levelled by a plane" in own["prepared"]
    assert "body 2: levelled" not in own["prepared"]
    assert "body 2: turned upside down" in own["prepared"]
    assert "body 2: downsampled to 8 x 8" in own["prepared"]
    assert "um share" in own["prepared"]


def test_lengths_and_unit_of_the_second_file_stand():
    with_header("own.txt", np.random.default_rng(3).normal(size=(17, 17)), 17_000)
    row = solved("a.npy", "--side", 16, "--unit", "um", "--against", "own.txt", command="describe")
    assert float(row["side_x_um"]) == pytest.approx(16)
    assert "body 2: read 17 x 17 nodes under a header" in row["prepared"]
    assert "lengths in nm" in row["prepared"]


def test_neither_body_is_overwritten(capsys):
    before = Path("b.npy").read_bytes()
    arguments = ["contact", "a.npy", "--side", "16", "--delta", "1", "--against", "b.npy"]
    arguments += ["--hardness", "1", "--young", "10", "--flattened", "b.npy"]
    assert cli.main(arguments) == 2
    assert "b.npy" in capsys.readouterr().err
    assert Path("b.npy").read_bytes() == before


def test_holes_of_either_body_have_to_be_filled(capsys):
    holes = np.load("b.npy")
    holes[3, 4] = np.nan
    np.save("holes.npy", holes)
    arguments = ["describe", "a.npy", "--side", "16", "--against", "holes.npy"]
    assert cli.main(arguments) == 2
    assert "holes.npy: 1 of 289 heights are missing" in capsys.readouterr().err
    assert cli.main([*arguments, "--fill"]) == 0


@pytest.mark.parametrize(
    ("options", "word"),
    [
        ("--side", "requires an argument"),
        ("--side '", "quotation"),
        ("--help", "--help"),
        ("--nope", "--nope"),
        ("more", "more"),
        ("--side 16 --boundary mirror", "--boundary"),
        ("--side 16 --csv x.csv", "--csv"),
        ("--side 16 --form two", "--form"),
        ("", "after '--against-options' is empty"),
    ],
)
def test_bad_options_of_the_second_body_are_one_line(capsys, options, word):
    arguments = ["describe", "a.npy", "--side", "16", "--against", "b.npy"]
    assert cli.main([*arguments, "--against-options", options]) == 2
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err.count("\n") == 1
    assert word in said.err


@pytest.mark.filterwarnings("ignore:Cannot close a netcdf_file:RuntimeWarning")
@pytest.mark.parametrize("periodic", [True, False])
def test_a_file_that_calls_itself_periodic_is_told_how_it_is_taken(
    periodic, tmp_path, monkeypatch, capsys
):
    library = pytest.importorskip("SurfaceTopography", reason="needs the extra instruments")
    monkeypatch.chdir(tmp_path)
    wave = np.cos(2 * np.pi * np.arange(24) / 24)[:, None] * np.cos(np.pi * np.arange(20) / 5)
    made = library.Topography(0.1 * wave, (24.0, 20.0), unit="um", periodic=periodic)
    made.to_netcdf("map.nc")
    commands = (["contact", "map.nc", "--delta", "0.05"], ["describe", "map.nc"])
    law = ["law", "map.nc", "--delta", "0.05"]
    for options, told in (
        ([], periodic),
        (["--boundary", "mirror"], periodic),
        (["--boundary", "periodic"], False),
        (["--crop", "0:12,0:12"], False),
    ):
        for command in (*commands, law):
            assert cli.main([*command, *options]) == 0
            said = capsys.readouterr().err
            taken = "mirror" if options[1:] == ["mirror"] or command is law else "free"
            line = f"says that its map is periodic, and it is taken as a {taken} patch: --boundary"
            assert (
                f"{line} periodic of gen describe, contact and law follows the file" in said
            ) == told
