"""The questions of planners over a socket: a line each, and a line its answer."""
