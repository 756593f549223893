"""`python -m gen`: generate, inspect and try out contact problems."""

import signal
import sys


def main() -> int:
    """Run the command line, with the other ranks if there are any, and return its exit code."""
    # Before all imports, so that Ctrl-C ends them without a traceback.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    from gen.runtime import farm

    with farm.process():
        from gen import cli

        return cli.main(sys.argv[1:])


if __name__ == "__main__":
    sys.exit(main())
