"""The scans after sightings, kept next to a log: written, read back, in ROS's own messages."""
