"""TOML that is not a scene's is refused before it is parsed."""

import re

from gen.runtime.errors import InputError
from gen.scene.words import one_line

DEEPEST = 16
"""Largest depth of nested tables and arrays; a scene has four levels."""

TEXTS = re.compile(
    r'''"""(?:\\.|[^\\])*?(?:"""|\\?\Z)|\'\'\'.*?(?:\'\'\'|\Z)|"(?:\\.|[^"\\\n])*"?|'[^'\n]*'?|\#[^\n]*''',
    re.DOTALL,
)
"""Texts and comments of TOML, in which dots and brackets mean nothing. Unterminated texts match
too, so that the search never starts again inside one."""

DOTTED = re.compile(r"[^=,\[\]{}\n]*")
"""A stretch of TOML that may be one dotted key."""


def require_simple(text: str, source: str) -> None:
    """Refuse texts that keep a TOML parser busy for minutes: deep arrays, keys of many dots."""
    bare = TEXTS.sub("", text)
    depth = deepest = 0
    for bracket in re.findall(r"[\[\]{}]", bare):
        depth += 1 if bracket in "[{" else -1
        deepest = max(deepest, depth)
    if deepest > DEEPEST or any(key.count(".") > DEEPEST for key in DOTTED.findall(bare)):
        raise InputError(one_line(f"{source}: not TOML of a scene: over {DEEPEST} levels deep"))
