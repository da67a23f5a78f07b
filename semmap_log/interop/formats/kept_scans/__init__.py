"""The scans from which sightings were made, kept next to a log as ROS messages."""
