"""What `demo` shows: the main job in one go, on what ships with the project."""
