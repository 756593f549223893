"""Scenes: the TOML files that describe a database, read and checked in this one room."""

from gen.scene.columns import ALL_COLUMNS as ALL_COLUMNS
from gen.scene.columns import averaged_columns as averaged_columns
from gen.scene.columns import columns_for as columns_for
from gen.scene.columns import markdown_of_columns as markdown_of_columns
from gen.scene.columns import parameter_columns as parameter_columns
from gen.scene.columns import require_distinct_names as require_distinct_names
from gen.scene.columns import require_expected_columns as require_expected_columns
from gen.scene.columns import row_bytes as row_bytes
from gen.scene.columns import stored_columns as stored_columns
from gen.scene.expect import ExpectedMean as ExpectedMean
from gen.scene.scene import Scene as Scene
from gen.scene.scene import differences as differences
from gen.scene.scene import load as load
from gen.scene.scene import preset_names as preset_names
from gen.scene.tables import Piece as Piece
from gen.scene.tables import Store as Store
