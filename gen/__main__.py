"""`python -m gen`: generate, inspect and try out contact problems."""

import sys

from gen.runtime import command_line


def main() -> int:
    """Get ready, join the other ranks if there are any, and run the command."""
    command_line.start(default_sigint=True)
    from gen import cli
    from gen.runtime import farm

    code = cli.main(sys.argv[1:])
    farm.leave()
    return code


if __name__ == "__main__":
    sys.exit(main())
