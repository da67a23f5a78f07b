"""Strict reading of texts: YAML, JSON, CSV cells, with the place of each problem."""
