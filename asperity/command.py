"""The command `asperity`, which runs one of `asperity.programs`."""

import os
import signal
import sys

COMPLETING = "_ASPERITY_COMPLETE"
"""Environment variable that a shell sets to ask for completions of a command line."""


def main() -> int:
    """Run this process's command line, and return its exit code, the same one on all MPI ranks."""
    # This comes before slow imports, so that Ctrl-C ends them without a traceback.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    from asperity import programs
    from gen.runtime import farm

    if COMPLETING in os.environ:
        programs.complete()  # ends the process
    with farm.process():
        return programs.run(sys.argv[1:])
