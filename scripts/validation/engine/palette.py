"""The colours of all figures of the studies.

The first eight are the palette of Okabe and Ito (2008), which readers with any colour vision can
tell apart, with grey in place of its second blue.
"""

BLACK = "#000000"
BLUE = "#0072B2"
SKY = "#56B4E9"
GREEN = "#009E73"
ORANGE = "#D55E00"
PURPLE = "#CC79A7"
YELLOW = "#E69F00"
GREY = "#7F7F7F"
DARK_GREY = "#5A5A5A"
BROWN = "#8C564B"

RED = "#B2182B"
SALMON = "#EF8A62"
PALE_BLUE = "#67A9CF"
VIOLET = "#7B3294"
NEARLY_BLACK = "#1A1A1A"
PALE_GREEN = "#B7E0B1"
"""Of the figure of the laws: the thesis's laws are red, the default is nearly black."""

CURVES = (BLUE, ORANGE, GREEN, PURPLE, SKY, YELLOW, DARK_GREY, BROWN)
"""Colours of the curves of one panel, in order."""
