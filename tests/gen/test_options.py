"""Groups of options: the files of a law, the second body, and options that leave."""

from pathlib import Path

import numpy as np
import pytest

from gen import cli
from gen.maps.settings import Reading
from gen.options import BAND_SIDES, LAW_FORMATS, Against, LawOutputs
from gen.runtime.errors import InputError

FIELDS = ("table", "json", "header", "calculix", "abaqus", "for_4c")


@pytest.fixture
def named(here):
    """Files of a law that --output names in the current folder."""
    return LawOutputs().resolved(Path("steel.v2"), [])


def test_a_law_has_a_file_for_each_format(named):
    by_stem = [field for field, law_format in LAW_FORMATS.items() if law_format.by_stem]
    assert tuple(by_stem) == FIELDS
    assert [getattr(named, field) for field in FIELDS[:-1]] == [
        Path("steel.v2.csv"),
        Path("steel.v2.json"),
        Path("steel.v2.h"),
        Path("steel.v2-calculix.inp"),
        Path("steel.v2-abaqus.inp"),
    ]


def test_the_file_for_4c_has_a_name_that_python_can_import(named):
    assert named.for_4c == Path("steel_v2_4c.py")


def test_a_name_of_its_own_goes_before_that_of_all_files(here):
    files = LawOutputs(header=Path("joint.h")).resolved(Path("steel"), [])
    assert (files.header, files.table) == (Path("joint.h"), Path("steel.csv"))


def test_tables_for_further_programs_are_written_by_their_own_options_alone(named):
    assert (named.moose, named.ansys, named.comsol) == (None, None, None)


def test_without_a_name_only_the_files_that_are_named_are_written(here):
    files = LawOutputs(header=Path("joint.h"))
    assert files.resolved(None, []) == files


@pytest.mark.parametrize("name", ["law.txt", "a.b.py", "json.py"])
def test_a_file_that_4c_cannot_import_is_refused(here, name):
    with pytest.raises(InputError, match=f"^--4c {name}: 4C imports it by its name"):
        LawOutputs(for_4c=Path(name)).resolved(None, [])


@pytest.mark.parametrize("name", ["..", "."])
def test_a_folder_is_no_name_of_files(here, name):
    with pytest.raises(InputError, match="give what the names of the files begin with"):
        LawOutputs().resolved(Path(name), [])


@pytest.mark.parametrize("side", BAND_SIDES)
@pytest.mark.parametrize("field", ["calculix", "abaqus"])
def test_the_files_of_the_sides_of_a_band_replace_no_input(here, field, side):
    beside = Path(f"law-{side}.inp")
    beside.write_text("1 2\n")
    files = LawOutputs(**{field: Path("law.inp")})
    with pytest.raises(InputError, match=f"--{field} law-{side}.inp: is an input"):
        files.resolved(None, [beside])


@pytest.mark.parametrize(
    ("options", "tables", "straight"),
    [
        ({}, (), False),
        ({"table": Path("law.csv")}, (), False),
        ({"header": Path("law.h")}, ("delta", "pressure"), False),
        ({"for_4c": Path("law_4c.py")}, ("pressure",), False),
        ({"calculix": Path("law.inp")}, ("pressure",), True),
        (
            {"abaqus": Path("law.inp"), "header": Path("law.h")},
            ("delta", "pressure"),
            True,
        ),
        ({"abaqus": Path("law.inp"), "check": False}, (), False),
    ],
)
def test_contacts_are_solved_between_the_loads_for_programs_that_join_points(
    options, tables, straight
):
    files = LawOutputs(**options)
    assert files.refined_tables == tables
    assert files.straight_lines is straight


@pytest.mark.parametrize(
    ("options", "name"),
    [
        ({"against_options": ""}, "--against-options"),
        ({"turned": "x"}, "--turned"),
        ({"shift": "1,2"}, "--shift"),
    ],
)
def test_an_option_of_the_second_body_needs_one(options, name):
    with pytest.raises(InputError, match=f"^{name}: needs --against"):
        Against(**options).second_body(Reading())


def test_options_of_the_second_body_say_that_they_leave(here, capsys):
    for name in ("a.npy", "b.npy"):
        np.save(name, np.random.default_rng(0).normal(size=(9, 9)))
    line = ["describe", "a.npy", "--side", "9", "--against", "b.npy"]
    assert cli.main(line) == 0
    assert "leaves with" not in capsys.readouterr().err
    assert cli.main([*line, "--against-options", "--side 9"]) == 0
    assert (
        "warning: --against-options leaves with version 2.0: prepare the second map in another"
        " program, which saves it with its lengths"
    ) in capsys.readouterr().err.splitlines()
