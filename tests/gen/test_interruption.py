"""Signals while Python runs, and while it waits for compiled code that hears none."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from gen.interruption import Interruption

TIMEOUT = 60

DEAF = """
import hashlib
from gen.interruption import Interruption

with Interruption(listening=True):
    print("begun", flush=True)
    hashlib.pbkdf2_hmac("sha256", b"", b"", 2**31 - 1)  # compiled, without Python's lock: hours
"""


def _signal_ourselves() -> None:
    os.kill(os.getpid(), signal.SIGINT)
    time.sleep(1)


def _open_files() -> int:
    return sum(1 for _ in Path("/dev/fd").iterdir())


@pytest.fixture
def ctrl_c() -> Iterator[None]:
    """Ctrl-C as Python has it, whatever earlier tests have left."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.usefixtures("ctrl_c")
def test_the_first_signal_is_noted_and_the_second_is_as_ever() -> None:
    with Interruption(listening=True) as interruption:
        assert not interruption.requested()
        os.kill(os.getpid(), signal.SIGINT)
        time.sleep(0.01)
        assert interruption.signal == signal.SIGINT
        with pytest.raises(KeyboardInterrupt):
            _signal_ourselves()
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_the_wakeup_is_given_back_and_nothing_is_left_open() -> None:
    before = _open_files()
    for _ in range(20):
        with Interruption(listening=True), Interruption(listening=False):
            pass
    deadline = time.monotonic() + TIMEOUT
    while _open_files() > before and time.monotonic() < deadline:
        time.sleep(0.01)
    assert _open_files() <= before
    assert signal.set_wakeup_fd(-1) == -1


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_compiled_code_is_ended_by_the_second_signal(number: int) -> None:
    with subprocess.Popen(
        [sys.executable, "-c", DEAF], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        assert process.stdout.readline() == "begun\n"
        time.sleep(0.5)
        process.send_signal(number)
        assert (
            process.stderr.readline() == "stopping after the step under way; again, to stop now\n"
        )
        time.sleep(0.5)
        assert process.poll() is None
        process.send_signal(number)
        assert process.wait(TIMEOUT) == 128 + number
