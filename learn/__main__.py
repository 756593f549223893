"""`python -m learn`: compare and tune surrogates of a database."""

import os
import signal
import sys


def main() -> int:
    """Pin the threads, join the other ranks if there are any, and run the command."""
    # One thread a process: fits run side by side, and times are of one thread.
    for library in ("OMP", "OPENBLAS", "MKL", "BLIS", "VECLIB_MAXIMUM"):
        os.environ[f"{library}_NUM_THREADS"] = "1"
    # Until a job listens, Ctrl-C ends the process: a KeyboardInterrupt on one rank alone would
    # leave the others waiting for it.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    from gen import farm
    from learn import cli

    code = cli.main(sys.argv[1:])
    farm.leave()
    return code


if __name__ == "__main__":
    sys.exit(main())
