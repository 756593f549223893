"""A scene's file is never replaced."""

import pytest

from gen.draft.files import require_new, write
from gen.draft.writing import Key
from gen.runtime.errors import InputError

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
