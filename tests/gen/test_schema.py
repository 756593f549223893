import numpy as np
import pytest

from gen.scene import Scene, Store, flags
from gen.scene.columns import ALL_COLUMNS, columns_for, markdown_table
from gen.schema import PHYSICS, PHYSICS_CHANGES

STORED = (
    *(
        "mean_gap",
        "largest_pressure",
        "perimeter",
        "stiffness",
        "interface_stiffness",
        "contact_spots",
    ),
    *("largest_spot_percent", "contact_connects", "gap_connects", "continuum_area_percent"),
    *("heights", "pressure"),
)
PLACES = ("map", "tile")
DRAWN = ("hurst", "sigma0", "roll_off", "cut_off", "drawn_rms_height", "drawn_rms_slope")
DRAWN += ("stretch", "load")
YIELDING = ("hardness", "yielded_percent")


def test_every_column_is_a_type_of_numpy_and_explained():
    for column in ALL_COLUMNS:
        assert np.array(column.fill, dtype=column.dtype).shape == ()
        assert column.long_name
        assert column.unit or column.dtype[0] == "S"


def test_scene_flags_are_the_optional_columns():
    optional = tuple(column for column in ALL_COLUMNS if column.optional)
    assert tuple(column.name for column in optional) == PLACES + DRAWN + YIELDING + STORED
    conditions = [column.optional for column in optional if column.name in STORED]
    assert conditions == [f"`store.{name}`" for name in STORED]
    assert set(flags()) == set(STORED)


@pytest.mark.parametrize("flag", STORED)
def test_flag_adds_its_column(flag):
    least = columns_for(Scene(samples=1))
    more = columns_for(Scene(samples=1, store=Store(**{flag: True})))
    assert {column.name for column in more} - {column.name for column in least} == {flag}


def test_every_physics_number_says_what_it_changed():
    assert list(PHYSICS_CHANGES) == list(range(11, PHYSICS + 1))
    for change in PHYSICS_CHANGES.values():
        assert change.isprintable()
        assert 20 < len(change) < 200


def test_table_has_every_column_and_table_1s_ranges():
    lines = markdown_table().splitlines()
    assert len(lines) == len(ALL_COLUMNS) + 2
    assert all(line.count("|") == 5 for line in lines)
    assert "| `area_percent` | % | effective contact area | 0.01 to 16.56 |" in lines
    assert "| `runtime/rank` | 1 | MPI rank that computed the sample |  |" in lines
