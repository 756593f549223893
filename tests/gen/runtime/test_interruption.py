"""Signals while Python runs, and while it waits for compiled code that hears none."""

import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from gen.runtime.interruption import Interruption

TIMEOUT = 60

HEARING = """
import os, signal, time
from gen.runtime.interruption import Interruption

signal.signal(signal.SIGINT, signal.default_int_handler)
with Interruption(listening=True) as interruption:
    os.kill(os.getpid(), signal.SIGINT)
    time.sleep(0.01)
    assert interruption.signal == signal.SIGINT
    try:
        os.kill(os.getpid(), signal.SIGINT)
        time.sleep(5)
    except KeyboardInterrupt:
        print("as ever")
assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
"""

DEAF = """
import hashlib
from gen.runtime.interruption import Interruption

with Interruption(listening=True):
    print("begun", flush=True)
    hashlib.pbkdf2_hmac("sha256", b"", b"", 2**31 - 1)  # compiled, without Python's lock: hours
"""


def _open_files() -> int:
    return sum(1 for _ in Path("/dev/fd").iterdir())


def test_the_first_signal_is_noted_and_the_second_is_as_ever() -> None:
    command = [sys.executable, "-c", HEARING]
    done = subprocess.run(command, check=False, capture_output=True, text=True, timeout=TIMEOUT)
    assert (done.returncode, done.stdout) == (0, "as ever\n"), done.stderr


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
