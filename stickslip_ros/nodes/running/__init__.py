"""Start and stop the nodes of a loop, composed in one process or each in its own."""
