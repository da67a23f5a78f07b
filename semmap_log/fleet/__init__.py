"""Logs in a store: sent there, and brought back."""
