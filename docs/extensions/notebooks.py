"""Executed notebooks as the manual shows them: their cells, and what these printed and drew."""

import base64
import json
import re
from os.path import relpath
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PICTURES = ROOT / "docs" / "_build" / "notebooks"
COLOUR = re.compile(r"\x1b\[[0-9;]*m")


def notebook(name: str, _: list[str], page: Path) -> str:
    """Return a notebook of `examples` as Markdown for a page in a folder."""
    book = json.loads((ROOT / "examples" / f"{name}.ipynb").read_text("utf-8"))
    parts = []
    for number, cell in enumerate(book["cells"]):
        source = "".join(cell["source"])
        if cell["cell_type"] == "markdown":
            parts.append(source)
            continue
        parts.append(f"```python\n{source}\n```")
        outputs = cell["outputs"]
        printed = "".join(
            "".join(output["text"])
            for output in outputs
            if output.get("name") == "stdout"
        )
        if printed:
            parts.append(f"```text\n{COLOUR.sub('', printed).rstrip()}\n```")
        for output in outputs:
            if drawn := output.get("data", {}).get("image/png"):
                PICTURES.mkdir(parents=True, exist_ok=True)
                picture = PICTURES / f"{name}-{number}.png"
                picture.write_bytes(base64.b64decode("".join(drawn)))
                parts.append(f"![What cell {number} draws]({relpath(picture, page)})")
    return "\n\n".join(parts)
