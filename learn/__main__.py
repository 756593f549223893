"""`python -m learn`: fit surrogates to databases, ask them, and compare their models."""

import signal
import sys


def main() -> int:
    """Run this process's command line, and return its exit code, the same one on all MPI ranks."""
    # This comes before slow imports, so that Ctrl-C ends them without a traceback.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    from gen.runtime import farm

    with farm.process():
        from learn import cli

        return cli.main(sys.argv[1:])


if __name__ == "__main__":
    sys.exit(main())
