"""`python -m gen`: generate, inspect and try out contact problems."""

import os
import signal
import sys


def main() -> int:
    """Pin the threads, join the other ranks if there are any, and run the command."""
    # One thread a rank: more would fight for cores, and sums could depend on their number.
    for library in ("OMP", "OPENBLAS", "MKL", "BLIS", "VECLIB_MAXIMUM"):
        os.environ[f"{library}_NUM_THREADS"] = "1"
    # Until a run listens, Ctrl-C ends the process: a KeyboardInterrupt on one rank alone would
    # leave the others waiting for it.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    from gen import cli, farm

    code = cli.main(sys.argv[1:])
    farm.leave()
    return code


if __name__ == "__main__":
    sys.exit(main())
