"""Writes a log: one writer, one commit at a time, each as durable as was promised.

`writer_opening` takes the lock and makes the last segment whole; `writer` appends; `segment_chain`
begins and closes segments; `durability` shares syncs among threads.
"""
