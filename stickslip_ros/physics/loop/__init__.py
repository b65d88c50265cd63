"""The sampled loop, its control law, and the simulation of both."""
