"""ROS messages: made, read, and how large they are."""
