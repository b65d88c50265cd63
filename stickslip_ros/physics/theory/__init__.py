"""What is known of the motion without running it: stability, bifurcations, limit cycles."""
