"""Texts of messages, and what is made when it is first asked for; knows no door."""
