"""The scans behind sightings, kept beside a log: written, read back, in ROS's own messages."""
