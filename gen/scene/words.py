"""Keys and values of a scene as messages write them."""

Location = tuple[int | str, ...]


def dotted(location: Location) -> str:
    """Write a location as a dotted key, for example "delta.pieces[0].share"."""
    parts = (f"[{part}]" if isinstance(part, int) else f".{part}" for part in location)
    return "".join(parts).removeprefix(".")


def shown(value: object) -> str:
    """Write a value for a message: short, and in TOML's notation."""
    if value is None:
        return "nothing"
    if isinstance(value, bool):
        return str(value).lower()
    try:
        text = repr(value)
    except ValueError:  # Python refuses to write out whole numbers of over 4,300 digits
        text = "a number of thousands of digits"
    return text if len(text) <= 80 else f"{text[:76]} ..."


def one_line(message: str) -> str:
    """Escape line breaks and control characters, which a message may quote from the input."""
    return "".join(
        character if character.isprintable() else character.encode("unicode_escape").decode()
        for character in message
    )
