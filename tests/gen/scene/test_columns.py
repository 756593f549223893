"""Columns of scenes: which ones a scene has, and how generators share the names of parameters."""

from typing import Annotated, Literal

import pytest

from gen.generators import GENERATORS
from gen.runtime.errors import InputError
from gen.scene import (
    ALL_COLUMNS,
    Scene,
    columns_for,
    markdown_of_columns,
    require_distinct_names,
    stored_columns,
)
from gen.scene.columns import columns_of_generators
from gen.surface import Drawn, GeneratedSurface

USER = """samples = 3
[surface]
generator = "python"
function = "waves:surface"
parameters = { swell = [1.0, 2.0] }
[store]
function = "waves:results"
outputs = { crest = "um" }
least = { crest = 0.0 }
"""


def names(*columns):
    return [column.name for column in columns]


def columns_of(text):
    return names(*columns_for(Scene.parse(text, "a.toml")))


class Ripples(GeneratedSurface):
    """A generator that shares the Hurst exponent with others, and says it in words of its own."""

    generator: Literal["ripples"]
    hurst: Annotated[float, Drawn("1", "roughness exponent of the ripples")] = 0.5


class Crests(GeneratedSurface):
    """A generator whose Hurst exponent has another unit."""

    generator: Literal["crests"]
    hurst: Annotated[float, Drawn("um", "height of the crests")] = 0.5


def test_generators_share_a_parameter_whose_words_differ():
    (column,) = [
        each
        for each in columns_of_generators([*GENERATORS, Ripples])
        if each.name == "hurst"
    ]
    assert column.long_name == "Hurst exponent of the surface"
    assert column.optional.endswith("and `ripples`")


def test_generators_with_two_units_for_a_parameter_are_named():
    with pytest.raises(
        ValueError, match=r"`crests` share the parameter hurst, one in '1', the"
    ):
        columns_of_generators([*GENERATORS, Crests])


def test_columns_of_a_scene_stand_in_the_order_of_all_columns():
    scene = Scene.parse("samples = 1\n[contact]\nhardness = [1.0, 2.0]", "a.toml")
    order = names(*ALL_COLUMNS)
    places = [order.index(name) for name in names(*columns_for(scene))]
    assert places == sorted(places)


@pytest.mark.parametrize(
    ("keys", "added"),
    [
        ("[load]\nquantity = 'force'\nrange = 5.0", {"load"}),
        ("[contact]\nhardness = 1.0", {"yielded_percent"}),
        ("[contact]\nhardness = [1.0, 2.0]", {"yielded_percent", "hardness"}),
        ("[store]\nperimeter = true", {"perimeter"}),
    ],
)
def test_a_key_adds_its_columns(keys, added):
    plain = columns_of("samples = 1")
    assert {*columns_of(f"samples = 1\n{keys}")} - {*plain} == added


def test_the_load_has_the_unit_of_the_scene():
    text = "samples = 1\n[load]\nquantity = 'force'\nrange = 5.0"
    columns = columns_for(Scene.parse(text, "a.toml"))
    (load,) = [column for column in columns if column.name == "load"]
    assert (load.unit, load.long_name) == ("uN", "force")


def test_parameters_of_a_users_generator_stand_behind_the_surface():
    columns = columns_of(USER)
    assert columns[columns.index("surface") + 1] == "swell"


def test_outputs_of_a_users_function_stand_before_the_times():
    columns = columns_of(USER)
    assert columns[columns.index("surface_seconds") - 1] == "crest"


def test_outputs_have_the_bounds_of_the_scene():
    columns = columns_for(Scene.parse(USER, "a.toml"))
    (crest,) = [column for column in columns if column.name == "crest"]
    assert crest.bounds == (0.0, float("inf"))


@pytest.mark.parametrize("checksums", [True, False])
def test_stored_columns_have_a_checksum_behind_the_reason(checksums):
    columns = names(*stored_columns(Scene.parse(USER, "a.toml"), checksums=checksums))
    assert (columns[columns.index("reason") + 1] == "checksum") == checksums


def test_the_table_of_columns_has_a_line_for_each():
    lines = markdown_of_columns()[2:]
    assert [line.split("`")[1] for line in lines] == [
        column.path for column in ALL_COLUMNS
    ]


@pytest.mark.parametrize(
    ("before", "after", "message"),
    [
        ("swell", "rng", "surface.parameters.rng: rng is the name of something else"),
        ("swell", "force", "surface.parameters.force: force is the name"),
        ("crest", "x", "store.outputs.x: x is the name of something else"),
        ("least = { crest", "least = { wave", "wave has bounds; the outputs are crest"),
    ],
)
def test_names_that_are_taken_are_refused(before, after, message):
    with pytest.raises(InputError, match=message):
        require_distinct_names(Scene.parse(USER.replace(before, after), "a.toml"))


def test_names_of_a_users_functions_are_taken_as_they_are():
    require_distinct_names(Scene.parse(USER, "a.toml"))
