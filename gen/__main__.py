"""`python -m gen`: generate, inspect and try out contact problems."""

import sys

from gen.runtime import farm


def main() -> int:
    """Run the command line, with the other ranks if there are any."""
    with farm.process():
        from gen import cli

        return cli.main(sys.argv[1:])


if __name__ == "__main__":
    sys.exit(main())
