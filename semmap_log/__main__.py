"""`python -m semmap_log` is the same as `semmap-log`."""

from semmap_log.cli import main

main()
