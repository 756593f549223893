"""TOML with comments is read as it was meant, whatever texts stand in it."""

import tomllib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gen.draft.proposal import rounded
from gen.draft.scene_text import WIDTH, Key, document, number, quoted, require_new, span, write
from gen.runtime.errors import InputError

TEXTS = st.text(st.characters(exclude_categories=["Cs"]), max_size=300)


@given(TEXTS, TEXTS, st.floats(allow_nan=False, allow_infinity=False))
def test_values_come_back_and_comments_stay_comments(text, comment, value):
    written = document(
        [
            Key(comment),
            Key(comment, "first", quoted(text)),
            Key(comment, "[table]"),
            Key(comment, "second", number(value)),
            Key("", "third", span(1.0, 2e300)),
        ]
    )
    table = {"second": value, "third": [1.0, 2e300]}
    assert tomllib.loads(written) == {"first": text, "table": table}


def test_long_comments_are_wrapped_and_commands_keep_their_indentation():
    written = document([Key("word " * 100 + "\n    python -m gen", "a", "1"), Key("", "b", "2")])
    lines = written.splitlines()
    assert max(map(len, lines)) <= WIDTH + 2
    assert lines[-3:] == ["#     python -m gen", "a = 1", "b = 2"]


def test_names_that_are_no_text_are_refused():
    with pytest.raises(InputError, match="rename"):
        quoted("scan-\udcff.x3p")


def test_rounding_keeps_significant_digits():
    assert [rounded(1234.5), rounded(0.0012345), rounded(1234.5, 3)] == [1200.0, 0.0012, 1230.0]


KEYS = [Key("a row", "samples", "1")]


def test_a_scene_is_written_as_it_is_read(tmp_path):
    assert write(tmp_path / "a.toml", KEYS).samples == 1
    assert (tmp_path / "a.toml").read_text() == "# a row\nsamples = 1\n"


@pytest.mark.parametrize("kind", ["file", "folder", "link to a file"])
def test_what_is_there_stays(tmp_path, kind):
    path = tmp_path / "a.toml"
    if kind == "file":
        path.write_text("mine")
    elif kind == "folder":
        path.mkdir()
    else:
        (tmp_path / "yours").write_text("mine")
        path.symlink_to("yours")
    with pytest.raises(InputError, match="is there already"):
        write(path, KEYS)
    assert kind == "folder" or path.read_text() == "mine"


@pytest.mark.parametrize("name", ["paper", "a.h5", "a.TOML", ".toml"])
def test_scenes_end_in_toml(tmp_path, name):
    with pytest.raises(InputError, match=r"ends in \.toml"):
        require_new(tmp_path / name)


def test_what_is_no_scene_is_not_written(tmp_path):
    with pytest.raises(InputError, match="samples"):
        write(tmp_path / "a.toml", [Key("", "samples", "-1")])
    assert not list(tmp_path.iterdir())
