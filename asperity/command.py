"""The command `asperity`, which runs one of `asperity.programs`."""

import os
import signal
import sys

COMPLETING = "_ASPERITY_COMPLETE"
"""Environment variable that a shell sets if it asks for the words that complete a command line."""


def main() -> int:
    """Run this process's command line, and return its exit code, which is equal on all MPI ranks.

    If a shell asks for completions, print them and end the process instead.
    """
    # This comes before slow imports, so that Ctrl-C ends them without a traceback.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    from asperity import programs
    from gen.runtime import farm

    if COMPLETING in os.environ:
        programs.complete()  # ends the process
    with farm.process():
        return programs.run(sys.argv[1:])
