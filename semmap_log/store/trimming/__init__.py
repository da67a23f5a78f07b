"""Takes records out of closed segments on purpose, without breaking the hash chain.

A trimmed segment is a new file that takes the old one's name. What is left keeps its bytes, its
number and its time; a Tombstone stands where something is gone, with the digests that the hashes
of commits need.
"""
