"""Run command lines in this process, and report what each has imported, run, opened, connected.

`python audited.py LINES.json REPORT.json`: the lines are lists of a program and its arguments; the
report has a list [exit code, standard error, events] for each.
"""

import contextlib
import io
import json
import os
import sys
from importlib import import_module
from pathlib import Path

MAINS = {"gen": "gen.cli", "learn": "learn.cli", "serve": "asperity.serving.cli"}
EVENTS = (
    "import",
    "exec",
    "open",
    "socket",
    "subprocess",
    "os.system",
    "os.exec",
    "os.spawn",
)
HARMLESS = "socket.gethostname"


class Audit:
    """The events since they were taken last: "import evil", "open evil.py"."""

    def __init__(self):
        self.events = set()

    def __call__(self, event, arguments):
        """Note an event; code that runs is known by its file."""
        if event.startswith(EVENTS) and event != HARMLESS:
            subject = arguments[0] if arguments else ""
            subject = getattr(subject, "co_filename", subject)
            self.events.add(
                f"{event} {os.fsdecode(subject) if isinstance(subject, bytes) else subject}"
            )

    def taken(self):
        """Return the events, and forget them."""
        taken, self.events = sorted(self.events), set()
        return taken


def run(program, *arguments):
    """Run a command line; return its exit code and standard error."""
    err = io.StringIO()
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(err):
        code = import_module(MAINS[program]).main(arguments, name=program)
    return code, err.getvalue()


if __name__ == "__main__":
    lines, report = map(Path, sys.argv[1:])
    audit = Audit()
    sys.addaudithook(audit)
    results = []
    for line in json.loads(lines.read_text()):
        audit.taken()
        results.append([*run(*line), audit.taken()])
    report.write_text(json.dumps(results))
