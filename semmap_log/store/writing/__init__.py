"""A log written: one writer, one commit at a time, each as durable as was promised.

`opening` takes the lock and makes the last segment whole; `writer` appends; `segment_chain` begins
and closes segments; `durability` shares syncs among threads.
"""
