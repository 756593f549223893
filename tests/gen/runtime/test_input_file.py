"""What could block its reader for ever is refused; the walk of tests/mpi tries every command."""

import os
import socket
from pathlib import Path

import pytest

from gen.runtime.errors import InputError
from gen.runtime.input_file import require_file


@pytest.fixture
def kinds(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # names of sockets are short
    os.mkfifo("pipe")
    Path("link").symlink_to("pipe")
    with socket.socket(socket.AF_UNIX) as listening:
        listening.bind("socket")
        yield {"pipe": "a pipe", "link": "a pipe", "socket": "a socket", "/dev/zero": "a device"}


def test_pipes_sockets_and_devices_are_refused(kinds):
    for name, word in kinds.items():
        with pytest.raises(InputError, match=f"{name} is {word}"):
            require_file(Path(name))


def test_files_and_what_has_errors_of_its_own_pass(tmp_path):
    (tmp_path / "file").touch()
    for path in (tmp_path / "file", tmp_path, tmp_path / "none", Path("a\0b")):
        assert require_file(path) is path
