"""A laser's messages and TF in, scans with their places on the map out; visits to events."""
