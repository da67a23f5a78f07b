"""The command line, one file a verb: arguments -> one library call -> exit code."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence

INTERRUPTED = 130


def main(arguments: Sequence[str] | None = None) -> None:
    """Run a verb and leave with its exit code: 0 good, 1 our error, 2 usage."""
    from semmap_log.cli.app import app
    from semmap_log.errors import SemmapError

    try:
        app(args=arguments, prog_name="semmap-log")
    except SemmapError as error:
        print(f"semmap-log: {error}", file=sys.stderr)  # noqa: T201
        sys.exit(1)
    except KeyboardInterrupt:
        sys.exit(INTERRUPTED)
    except BrokenPipeError:  # the reader of our output has gone, as `head` does
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(1)
