"""What `tools/bench.py` measures, and how.

Each peer works in a child process of its own, whose memory is part of the result: modules here
load nothing heavier than numpy at their head.
"""
