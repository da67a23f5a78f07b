"""What a log says about how likely its doors are open: now, later, and in a typical week."""
