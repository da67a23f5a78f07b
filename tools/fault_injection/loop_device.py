"""A file system in a file, mounted: what real disks do to a log is tried on it."""

from __future__ import annotations

import os
import shutil
import subprocess
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from fault_injection.fault import CannotTryError


class LoopDevice:
    """A file system on a loop device."""

    def __init__(self, image: Path, folder: Path, make: Sequence[str], mib: int) -> None:
        """Prepare.

        Args:
            image: The file that contains it.
            folder: Where it is mounted.
            make: The command that makes a file system of the image.
            mib: Its size.
        """
        self.image = image
        self.folder = folder
        self._make = make
        self._mib = mib
        folder.mkdir()

    def make_anew(self) -> None:
        """Mount a new, empty file system.

        Raises:
            OSError: A command failed; what it said.
        """
        self.unmount()
        with self.image.open("wb") as image:
            image.truncate(self._mib * 2**20)
        _run(*self._make, str(self.image))
        self.mount()

    def mount(self) -> None:
        """Mount it."""
        _run("mount", "-o", "loop", str(self.image), str(self.folder))

    def unmount(self) -> None:
        """Unmount it, if it is mounted; a process that was killed may hold files for a moment."""
        for _ in range(100):
            if not self.folder.is_mount():
                return
            if subprocess.run(["umount", self.folder], capture_output=True, check=False).returncode:
                time.sleep(0.05)
        _run("umount", str(self.folder))


@contextmanager
def mounted(folder: Path, make: Sequence[str], mib: int) -> Iterator[LoopDevice]:
    """Hand out a new file system, mounted.

    Raises:
        CannotTryError: Only root can mount, or a program or a loop device is not there.
    """
    if os.geteuid() != 0:
        raise CannotTryError("only root can mount a file system")
    for needed in (make[0], "mount", "umount"):
        if shutil.which(needed) is None:
            raise CannotTryError(f"{needed} is not installed")
    disk = LoopDevice(folder / "image", folder / "mounted", make, mib)
    try:
        try:
            disk.make_anew()
        except OSError as error:
            raise CannotTryError(f"no file system on a loop device here: {error}") from error
        yield disk
    finally:
        disk.unmount()


def _run(*command: str) -> None:
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise OSError(f"{' '.join(command)}: {done.stderr.strip()}")
