"""Parameters of the nodes and the files they come in."""
