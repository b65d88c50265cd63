"""The ROS 2 nodes: thin shells around the physics, and their bringup."""
