"""What the pictures have in common."""

BLUE, ORANGE, GREEN, SKY_BLUE, GREY = "#0072B2", "#D55E00", "#009E73", "#56B4E9", "#999999"
"""Of Okabe and Ito's palette, which the colour-blind can tell apart, and a grey."""

YELLOW, PURPLE = "#F0E442", "#CC79A7"
"""Two more of that palette."""

LIGHT_GREY = "#CCCCCC"
"""For what there is nothing to say of."""
