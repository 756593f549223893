"""`python -m asperity`: the same as the command `asperity`."""

import sys

from asperity.command import main

if __name__ == "__main__":
    sys.exit(main())
