"""Theory without a simulation: stability, bifurcations, limit cycles."""
