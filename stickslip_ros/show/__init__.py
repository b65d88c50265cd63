"""Results as people see them: tables, figures, and the units and colours of both."""

BLUE, ORANGE, GREEN, SKY_BLUE, GREY = "#0072B2", "#D55E00", "#009E73", "#56B4E9", "#999999"
"""Colours of Okabe and Ito's palette, which is safe for colour-blind readers, and a grey."""

YELLOW, PURPLE, AMBER = "#F0E442", "#CC79A7", "#E69F00"
"""Three more of that palette."""

LIGHT_GREY = "#CCCCCC"
"""Colour of elements without information."""

INK = "#333333"
"""Colour of hatches, visible on every colour except black."""
