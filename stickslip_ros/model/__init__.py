"""The drive, its friction laws and the forces on it, as equations."""
