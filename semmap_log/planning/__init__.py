"""In which order to patrol a building, and what to do at a shut door."""
