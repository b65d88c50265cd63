"""The drive, its friction laws and what acts on it, as equations."""
