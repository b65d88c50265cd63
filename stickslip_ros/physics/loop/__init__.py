"""The sampled loop, the control law in it, and its simulation."""
