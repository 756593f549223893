"""Targets of every kind that users make, and the scenes whose contacts have them."""

KINDS = {
    "negative": "-1.0 - area",
    "signed": "area - 4.0",
    "zero_in_part": "max(area - 5.0, 0.0)",
    "negative_in_part": "min(area - 5.0, 0.0)",
    "constant_in_part": "max(area, 4.0)",
    "rare": "max(area - 15.0, 0.0)",
    "tiny": "-1e-15 * area",
    "huge": "1e15 * area",
    "distant": "1e6 + area",
    "spoilt": "area",
}
"""Targets of every kind, by their names, as functions of the area [%]."""

KIND_SCENES = {
    "free": "",
    "yielding": "[contact]\nhardness_ratio = [0.003, 0.1]\n",
    "mirror": (
        "[contact]\nboundary = 'mirror'\n[delta]\npieces = [{ share = 1.0, range = [0.5, 9.0] }]\n"
    ),
}
