"""Models from recordings: regression, fit of trajectories, intervals, choice of the law."""
