"""Objects that are no doors, as who uses a log meets them."""
