"""What real doors say about estimators: their losses by day, and how surely one is ahead."""
