"""Parameters of the nodes, and the files that set them."""
