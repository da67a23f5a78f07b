"""What a log lets one work out: probabilities, costmaps, rooms, plans, tables in SQL."""
