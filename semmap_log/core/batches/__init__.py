"""Events side by side as numpy columns: made, checked, cut and read."""
