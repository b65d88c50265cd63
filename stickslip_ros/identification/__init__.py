"""Models from recordings: regression, trajectories that are fitted, intervals, choice of the law."""
