"""`python -m gen`: generate, inspect and try out contact problems."""

import os
import sys


def main() -> int:
    """Pin the threads, join the other ranks if there are any, and run the command."""
    # One thread a rank: more would fight for cores, and sums could depend on their number.
    for library in ("OMP", "OPENBLAS", "MKL", "BLIS", "VECLIB_MAXIMUM"):
        os.environ[f"{library}_NUM_THREADS"] = "1"
    from gen import cli, farm

    code = cli.main(sys.argv[1:])
    farm.leave()
    return code


if __name__ == "__main__":
    sys.exit(main())
