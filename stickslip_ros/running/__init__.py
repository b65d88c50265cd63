"""Starting the nodes of a loop, composed or in processes."""
