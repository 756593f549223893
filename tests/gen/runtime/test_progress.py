"""Progress on a stream that cannot be written ends nothing."""

import errno
import io

import pytest

from gen.runtime.progress import RunProgress


class Full(io.StringIO):
    """A stream on a device that is full."""

    def write(self, text):
        raise OSError(errno.ENOSPC, "No space left on device")


@pytest.mark.parametrize("terminal", [False, True])
def test_progress_in_a_program_of_somebody_else_ends_no_run(monkeypatch, terminal):
    stream = Full()
    monkeypatch.setattr(stream, "isatty", lambda: terminal)
    monkeypatch.setattr("sys.stderr", stream)
    with RunProgress(2) as progress:
        progress.say("hello")
        progress.advance(2, 0)
