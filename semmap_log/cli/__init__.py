"""The command line, one file a verb: arguments -> one library call -> exit code.

May import every room. Start with `show.py`, a short verb; `verb_table.py` lists the verbs, and
`common.py` has the options that they share.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

INTERRUPTED = 130

FAILED = 1
USAGE = 2
"""Exit code of what would fail again: a wrong option; of `serve` and `record`, no log, too."""

RESPAWNED = "SEMMAP_RESPAWNED"
"""Set by launch files, which start a node again whatever its exit code: where that would change
nothing, it waits to be stopped instead. Not for systemd: its units know exit code 2."""

WAITS_S = 3600.0
"""At a time."""


class _CtrlC(KeyboardInterrupt):
    """Ctrl-C, distinguished from Python's own.

    Where Python's own passes through an `exec` of a text, as rosbags and dataclasses have them, it
    is remembered, and ends the process by the signal whatever code it exits with.
    """


def main(arguments: Sequence[str] | None = None) -> None:
    """Run a verb and leave with its exit code: 0 good, 1 our error, 2 usage."""
    from semmap_log.cli.ros import split_ros_args
    from semmap_log.cli.sanitized_streams import READER_GONE, forget_output, sanitized_streams

    _repair_streams()
    warnings.showwarning = _show_warning
    ours, ros_args = split_ros_args(sys.argv[1:] if arguments is None else arguments)
    with sanitized_streams():
        try:
            code = _code_of(ours, ros_args, is_whole_program=arguments is None)
            sys.stdout.flush()
        except OSError as error:  # the error cannot be printed either
            forget_output()
            code = READER_GONE if isinstance(error, BrokenPipeError) else FAILED
        if code == USAGE and os.environ.get(RESPAWNED):
            _wait_to_be_stopped()
        sys.exit(code or 0)


def _code_of(ours: list[str], ros_args: list[str], *, is_whole_program: bool) -> int | None:
    """Run a verb and return its exit code; say why it failed.

    Raises:
        OSError: No error can be printed: the reader of our output has gone.
    """
    from semmap_log.cli.app import app
    from semmap_log.cli.sanitized_streams import forget_output
    from semmap_log.cli.verb import CLICK_ERROR, asks_for_json, fail
    from semmap_log.errors import SemmapError

    try:
        with _ended_by_signals(is_whole_program=is_whole_program):
            code: int | None = app(
                args=ours, obj=ros_args, prog_name="semmap-log", standalone_mode=False
            )
            sys.stdout.flush()
            return code
    except (SemmapError, CLICK_ERROR) as error:
        return fail(error, as_json=asks_for_json(ours))
    except KeyboardInterrupt:
        return INTERRUPTED
    except BrokenPipeError:
        raise
    except OSError as error:  # such as a full disk under our output
        forget_output()
        return fail(error, as_json=asks_for_json(ours), is_output_lost=True)


def _wait_to_be_stopped() -> None:
    """Stay, and do nothing, until a signal ends this process."""
    from semmap_log.cli.verb import tell

    tell(
        "this needs a repair, and a launcher would restart it endlessly, so it waits. "
        "Stop the launch, repair it, and launch again."
    )
    while True:
        time.sleep(WAITS_S)


@contextmanager
def _ended_by_signals(*, is_whole_program: bool) -> Iterator[None]:
    """Let signals end us as an exception does: no half file and no viewer stays.

    Restores the previous handlers on exit. A whole program gets the system's defaults instead: by
    then all is done, and Ctrl-C would only print a traceback of Python's own shutdown.
    """

    def end(number: int, _: object) -> None:
        if number == signal.SIGINT:
            raise _CtrlC
        sys.exit(128 + number)

    usual = (signal.SIG_DFL, signal.default_int_handler)
    before = {}
    if threading.current_thread() is threading.main_thread():  # no other may set them
        for each in (signal.SIGINT, signal.SIGTERM, getattr(signal, "SIGHUP", signal.SIGTERM)):
            if signal.getsignal(each) in usual:  # `nohup` ignores one: so do we
                before[each] = signal.signal(each, end)
    try:
        yield
    finally:
        for each, handler in before.items():
            signal.signal(each, signal.SIG_DFL if is_whole_program else handler)


def _show_warning(message: Warning | str, *_: object, **__: object) -> None:
    """Print a warning for a person; a library's user would get it with file and line."""
    from semmap_log.cli.verb import tell

    tell(f"warning: {message}")


def _repair_streams() -> None:
    """Make sure that there are streams, and that they take every character, or byte."""
    for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
        stream = getattr(sys, name)
        if stream is None:
            setattr(sys, name, open(os.devnull, mode, encoding="utf-8"))  # noqa: SIM115, PTH123
        elif hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="backslashreplace")
