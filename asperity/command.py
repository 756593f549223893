"""The command `asperity`, which runs one of `asperity.programs`."""

import os
import signal
import sys

COMPLETING = (
    "_ASPERITY_COMPLETE"  # environment variable by which a shell asks for completions
)


def main() -> int:
    """Run this process's command line and return its exit code, the same one on all MPI ranks."""
    signal.signal(
        signal.SIGINT, signal.SIG_DFL
    )  # first: Ctrl-C ends imports without a traceback
    from asperity import programs
    from gen.runtime import farm

    if COMPLETING in os.environ:
        programs.complete()
    with farm.process():
        return programs.run(sys.argv[1:])
