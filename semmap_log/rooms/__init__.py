"""The rooms of a floor plan: regions cut by walls and doors, and what joins them."""
