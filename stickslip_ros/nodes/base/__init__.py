"""Base of all nodes."""
