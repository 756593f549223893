"""`python -m learn`: compare and tune surrogates of a database."""

import sys

from gen.runtime import command_line


def main() -> int:
    """Get ready, join the other ranks if there are any, and run the command."""
    command_line.start(default_sigint=True)
    from gen.runtime import farm
    from learn import cli

    code = cli.main(sys.argv[1:])
    farm.leave()
    return code


if __name__ == "__main__":
    sys.exit(main())
