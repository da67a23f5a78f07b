"""ROS 1 and ROS 2, running: the server of doors, the recorder, the player."""
