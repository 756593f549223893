"""How curves look: colours for colour-blind readers (Okabe and Ito's, and three more), markers."""

STYLES = (
    {"color": "#0072B2", "marker": "o"},
    {"color": "#D55E00", "marker": "s"},
    {"color": "#009E73", "marker": "^"},
    {"color": "#CC79A7", "marker": "D"},
    {"color": "#E69F00", "marker": "v"},
    {"color": "#56B4E9", "marker": "P"},
    {"color": "#000000", "marker": "x"},
    {"color": "#888888", "marker": "*"},
    {"color": "#6B3D0A", "marker": "<"},
    {"color": "#4B2E83", "marker": ">"},
)
"""One for each curve: the marker tells it apart on paper too."""

COLOURS = tuple(style["color"] for style in STYLES)
