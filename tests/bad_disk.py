"""A file system on a disk with places that cannot be read: for who is root and has loop devices.

The file system lies in a file. Blocks that are to be bad are moved to its end, by the pointers that
ext2 has; then that end is cut off, and the kernel answers with EIO.
"""

from __future__ import annotations

import os
import re
import shutil
import struct
import subprocess
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

BLOCK = 4096
BLOCKS = 8192
_BAD = BLOCKS - 1
"""The block to which all bad ones are moved."""
_DIRECT = 12
"""So many blocks of a file an inode points to; to the next ones a block of pointers."""


@contextmanager
def bad_disk(content: Path, image: Path, bad: dict[str, Iterable[int]]) -> Iterator[Path]:
    """Hand out a folder that holds the same as another, on a disk with bad places.

    Args:
        content: The folder.
        image: Where to put the file that the disk is.
        bad: File name -> which of its blocks cannot be read.
    """
    _check_possible()
    with image.open("wb") as file:
        file.truncate(BLOCKS * BLOCK)
    list_of_bad = image.with_suffix(".bad")
    list_of_bad.write_text(f"{_BAD}\n")
    _run("mkfs.ext2", "-q", "-F", "-b", str(BLOCK), "-l", str(list_of_bad), "-d", str(content),
         str(image))  # fmt: skip
    for name, blocks in bad.items():
        for block in blocks:
            _move(image, name, block)
    with _mounted(image) as folder:
        yield folder


def _check_possible() -> None:
    if os.geteuid() != 0:
        pytest.skip("only root may mount a disk that has bad sectors")
    for tool in ("mkfs.ext2", "debugfs", "losetup", "mount"):
        if shutil.which(tool, path=_PATH) is None:
            pytest.skip(f"{tool} is not installed, which makes a disk with bad sectors")
    if not Path("/dev/loop-control").exists():
        pytest.skip("there are no loop devices here for a disk with bad sectors")


_PATH = f"{os.environ.get('PATH', '')}:/usr/sbin:/sbin"


def _move(image: Path, name: str, block: int) -> None:
    """Point one block of a file to the bad one."""
    if block < _DIRECT:
        _run("debugfs", "-w", "-R", f"sif /{name} block[{block}] {_BAD}", str(image))
        return
    said = _run("debugfs", "-R", f"stat /{name}", str(image))
    pointers = re.search(r"\(IND\):(\d+)", said)
    assert pointers, f"{name} is too short to have a block {block}"
    with image.open("r+b") as file:
        file.seek(int(pointers[1]) * BLOCK + 4 * (block - _DIRECT))
        file.write(struct.pack("<I", _BAD))


@contextmanager
def _mounted(image: Path) -> Iterator[Path]:
    try:
        device = _run("losetup", "-f", "--show", str(image)).strip()
    except subprocess.CalledProcessError as error:
        pytest.skip(f"no loop device for a disk with bad sectors: {error.stderr.strip()}")
    folder = image.with_suffix(".mounted")
    folder.mkdir(exist_ok=True)
    try:
        os.truncate(image, _BAD * BLOCK)
        try:
            _run("mount", "-t", "ext2", device, str(folder))
        except subprocess.CalledProcessError as error:
            pytest.skip(f"a disk with bad sectors cannot be mounted: {error.stderr.strip()}")
        try:
            yield folder
        finally:
            _run("umount", "-l", str(folder))  # a reader may hold a file yet
    finally:
        _run("losetup", "-d", device)


def _run(*command: str) -> str:
    environment = {**os.environ, "PATH": _PATH}
    done = subprocess.run(command, check=True, capture_output=True, text=True, env=environment)
    return done.stdout
