"""What a laser sees of the doors: scans in, visits to doors out; numpy only, no ROS, no log."""
