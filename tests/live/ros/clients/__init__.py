"""Clients for other interpreters: started as scripts, not imported."""
