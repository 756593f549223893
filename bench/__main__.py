"""`python -m bench`: reports on how exact and how fast the packages are."""

import signal
import sys


def main() -> int:
    """Run the command line of this process, and return its exit code."""
    # During the long imports below, Ctrl-C then ends the process without a traceback.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    from gen.runtime import farm

    with farm.process():
        from bench import commands

        return commands.main(sys.argv[1:])


if __name__ == "__main__":
    sys.exit(main())
