"""`learn card`: print the model card of a surrogate."""

from learn.commands.options import File


def card(file: File) -> None:
    """Print a surrogate's model card: what it was made of, its scores, intervals and ranges."""
    from learn.surrogate import Surrogate
    from learn.surrogate.card import show

    show(Surrogate.load(file))
