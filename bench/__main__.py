"""`python -m bench`: reports on how exact and how fast the packages are."""

import sys

from bench.commands import app, main
from gen.runtime import command_line
from gen.runtime import farm as processes

__all__ = ["app", "main"]

if __name__ == "__main__":
    command_line.start(default_sigint=False)
    code = main(sys.argv[1:])
    processes.leave()
    sys.exit(code)
