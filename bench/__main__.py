"""`python -m bench`: reports on how exact and how fast the packages are."""

import sys

from bench.commands import app, main
from gen.runtime import farm

__all__ = ["app", "main"]

if __name__ == "__main__":
    with farm.process(default_sigint=False):
        code = main(sys.argv[1:])
    sys.exit(code)
