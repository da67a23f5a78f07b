"""Another process that does something and stays until it is no longer needed."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

NOBODY = 65534

only_root = pytest.mark.skipif(os.getuid() != 0, reason="only root can become somebody else")


@contextmanager
def other_process(
    work: Callable[[], object], folder: Path, *, uid: int = 0, leaves: bool = False
) -> Iterator[None]:
    """Run something in another process, which lives until the block ends.

    Args:
        work: What it does first; what that opened stays open.
        folder: Where; nobody but root need be able to come there by the path.
        uid: As whom; 0: as this process.
        leaves: Whether its child takes over what is open, and it ends itself.
    """
    ready, says = os.pipe()
    until, end = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(end)
        os._exit(_works(work, folder, uid, says, until, leaves=leaves))
    os.close(says)
    os.close(until)
    try:
        assert os.read(ready, 1) == b"y", "the other process failed"
        if leaves:
            os.waitpid(child, 0)  # until then it can be seen
        yield
    finally:
        os.close(end)
        if not leaves:
            os.waitpid(child, 0)
        os.close(ready)


def _works(
    work: Callable[[], object], folder: Path, uid: int, says: int, until: int, *, leaves: bool
) -> int:
    try:
        os.chdir(folder)
        if uid:
            os.setgroups([])
            os.setgid(uid)
            os.setuid(uid)
        kept = work()
        if leaves and os.fork():
            return 0
        os.write(says, b"y")
        os.read(until, 1)
        del kept
    except BaseException:  # noqa: BLE001 - a forked child must not go on with the tests
        return 1
    return 0
