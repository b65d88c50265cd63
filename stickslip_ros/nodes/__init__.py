"""The ROS 2 nodes: thin shells around the physics. Importing this package does not load ROS."""
