"""Studies of many runs: sweeps, basins of attraction, bifurcation diagrams and design."""
