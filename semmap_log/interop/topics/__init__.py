"""What the messages of a robot's topics say about doors: the same for live topics and for bags.

A mapping (a file, or the well-known topics) says how each topic is read. A translator takes message
after message and makes events of them, knowing the doors as they are after each; what cannot be is
counted, reported once, and left out. Values only: no sockets, no files but the mapping's.
"""
