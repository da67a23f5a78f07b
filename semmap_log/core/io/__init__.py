"""Files, clocks and threads: what everybody uses and what knows no door."""
