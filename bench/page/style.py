"""How pictures look: colours that colour-blind readers can tell apart, and marks beside them."""

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000", "#7F7F7F")
"""Okabe and Ito's palette without its yellow, which is lost on white, and a grey."""

MARKERS = ("o", "s", "^", "D", "v", "P", "X", "<")
"""One for each colour: a second way to tell curves apart, on paper too."""
