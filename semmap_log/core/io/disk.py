"""Bytes to disk, so that they stay: whole writes, syncs, and files that appear whole or not at all.

A power cut leaves an unsynced file empty, and undoes a rename that was not followed by a sync of
its folder; so everything here syncs both.

Also copies files that come with this package to where they are used; existing ones stay, since
plans and launch files are there to be changed.

Reading uses what each system offers: Windows has neither folders that can be opened nor a way not
to follow links, macOS no `preadv`, and what is missing is left out. Writing needs all of it:
`check_can_write`.
"""

from __future__ import annotations

import errno
import mmap
import os
import re
import shutil
import stat
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from fnmatch import fnmatch
from pathlib import Path, PurePath
from typing import BinaryIO

from semmap_log.errors import LogAccessError, OutputError


def copy_folder(
    shipped: Path,
    target: Path,
    *,
    kind: str,
    made: Sequence[str],
    finish: Callable[[Path], object] = lambda _: None,
) -> bool:
    """Copy a folder, whole or not at all.

    Args:
        shipped: What is copied.
        target: Where to; it is made.
        kind: What it is called where another is there: a `package`.
        made: Names with wildcards: what installers and compilers put into it is no part of it.
        finish: What is done to the copy before it is there.

    Returns:
        Whether it was written now: the same is left as it is.

    Raises:
        OutputError: Something else bears its name there, or it cannot be written.
    """
    if target.exists():
        if differing := _differing(shipped, target, made):
            raise _is_another(target, kind, f" ({differing} differs)")
        return False
    with output_errors(target), atomic_folder(target) as temporary:
        shutil.copytree(shipped, temporary, ignore=shutil.ignore_patterns(*made))
        finish(temporary)
    return True


def copy_file(shipped: bytes, target: Path, *, kind: str) -> bool:
    """Copy a file, whole or not at all; its folder is made if it is not there.

    Args:
        shipped: What is in it.
        target: Where to.
        kind: What it is called where another is there: a `module`.

    Returns:
        Whether it was written now: the same is left as it is.

    Raises:
        OutputError: Another bears its name there, or it cannot be written.
    """
    with output_errors(target):
        target.parent.mkdir(parents=True, exist_ok=True)
        if target.exists():
            if target.read_bytes() != shipped:
                raise _is_another(target, kind)
            return False
        replace_file(target, shipped)
    return True


def _is_another(target: Path, kind: str, differing: str = "") -> OutputError:
    return OutputError(
        f"{target}: exists already, and differs from this {kind}{differing}. "
        "Remove it first, if nobody needs it."
    )


def _differing(shipped: Path, target: Path, made: Sequence[str]) -> str:
    """Return a file that another folder lacks, or has with other content; "": no such file."""
    for path in sorted(shipped.rglob("*")):
        name = path.relative_to(shipped)
        other = target / name
        if path.is_dir() or any(fnmatch(part, each) for part in name.parts for each in made):
            continue
        if not (other.is_file() and other.read_bytes() == path.read_bytes()):
            return str(name)
    return ""


TEMPORARY_SUFFIX = ".tmp"
TOKEN_BYTES = 8
MOST_STEM_BYTES = 220
"""A name has at most 255 bytes; process, token and suffix need the rest."""


def write_all(fd: int, data: bytes | memoryview) -> None:
    """Write all of `data`; the kernel may take it in parts.

    Raises:
        OSError: As the kernel says; a part may have been written.
    """
    written = os.write(fd, data)
    if written == len(data):
        return
    view = memoryview(data)[written:]
    while view:
        view = view[os.write(fd, view) :]


def sync_file(path: Path) -> None:
    """Make what was written to a file, by whomever, survive a power cut."""
    fd = os.open(path, os.O_RDWR | PLAIN if os.name == "nt" else os.O_RDONLY | PLAIN)
    try:
        os.fsync(fd)
    finally:
        os.close(fd)


def sync_folder(folder: Path) -> None:
    """Make the folder's entries (new names, renames) survive a power cut."""
    if not CAN_OPEN_FOLDERS:
        return  # Windows: nothing that one could do
    fd = os.open(folder, os.O_RDONLY | FOLDER)
    try:
        os.fsync(fd)
    finally:
        os.close(fd)


def utf8_text(path: str) -> str:
    r"""Return a path for where only UTF-8 goes; other bytes of it are spelt out: `\xff`."""
    return os.fsencode(path).decode("utf-8", "backslashreplace")


def utf8_name(path: PurePath) -> str:
    """Return the same of a path's name."""
    return utf8_text(path.name)


def log_name(log: PurePath) -> str:
    """Return what a log's folder is called: also of `.`; of a URL its last part."""
    return utf8_name(log.resolve() if isinstance(log, Path) else log)


def check_outside_log(folder: PurePath, out: Path) -> None:
    """Keep what is made from a log out of the log's folder, where everything is the log's.

    Args:
        folder: The log's; in a store nothing of this machine lies.
        out: The file or folder to be written.

    Raises:
        OutputError: It would lie there.
    """
    if isinstance(folder, Path) and folder.resolve() in (out.resolve(), *out.resolve().parents):
        raise OutputError(f"{out}: lies in the log's own folder; choose another place.")


@contextmanager
def output_errors(path: Path) -> Iterator[None]:
    """Say in our words what the system would not write.

    Raises:
        OutputError: The block raised an OSError; one of ours stays as it is.
    """
    try:
        yield
    except OutputError:
        raise
    except OSError as error:
        raise OutputError(f"{path}: could not be written: {error.strerror or error}. The earlier "
                          "content is unchanged.") from error  # fmt: skip


@contextmanager
def atomic_file(path: Path) -> Iterator[Path]:
    """Yield a new, empty file next to `path`; on success it takes the name, synced, at once.

    Its name is nobody else's, and no link that somebody put there is followed. Where `path` is a
    link, the link is replaced, and what it points to stays. On any error the file is removed and
    `path` stays as it was.

    Raises:
        OutputError: At `path` is a device, pipe or socket: those are never replaced.
    """
    check_not_special(path)
    temporary = new_sibling(path)
    try:
        yield temporary
        sync_file(temporary)
        _give_name(temporary, path)
    except BaseException:
        with suppress(OSError):
            temporary.unlink()
        raise


@contextmanager
def atomic_folder(path: Path) -> Iterator[Path]:
    """Yield a path for a new folder of the same name; on success it takes its place, synced.

    It is in a temporary folder next to `path`. On any error that is removed, with all in it.

    Raises:
        OutputError: There is something at `path` already: a folder is never replaced.
    """
    import shutil

    if os.path.lexists(path):
        raise OutputError(f"{path}: is there already; remove it, or choose another name.")
    around = _made_sibling(path, _make_folder)
    temporary = around / path.name
    try:
        yield temporary
        _sync_tree(temporary)
        _give_name(temporary, path)
    finally:
        shutil.rmtree(around, ignore_errors=True)


def replace_file(path: Path, data: bytes) -> None:
    """Put a file of these bytes in place of `path`, whole or not at all, synced."""
    with atomic_file(path) as temporary, _new_file(temporary) as file:
        file.write(data)


def left_by_killed(path: Path) -> Iterator[Path]:
    """Yield the temporary files next to `path` whose processes have ended."""
    leftover = re.compile(
        re.escape(_stem(path)) + r"\.(\d+)(?:\.[0-9a-f]+)?" + re.escape(TEMPORARY_SUFFIX)
    )
    for other in path.absolute().parent.iterdir():
        found = leftover.fullmatch(other.name)
        if found and not _is_running(int(found[1])):
            yield other


class NotOursError(OSError):
    """Where a file of ours is expected there is a link, folder, pipe or device."""

    def __init__(self, mode: int) -> None:
        super().__init__(errno.EINVAL, f"expected a regular file, got {kind_of(mode)}")


def kind_of(mode: int) -> str:
    """Return what is no regular file, in words."""
    kinds = ((stat.S_ISLNK, "a link"), (stat.S_ISDIR, "a folder"), (stat.S_ISFIFO, "a named pipe"))
    return next((name for is_one, name in kinds if is_one(mode)), "a device or socket")


MOST_OWN_BYTES = 2**28


def read_own(path: Path, most: int = MOST_OWN_BYTES) -> bytes:
    """Return the content of a file of ours in a place where strangers may have put another.

    Raises:
        FileNotFoundError: There is no such file.
        NotOursError: It is no regular file; reading it might never end.
        OSError: It cannot be read, or is longer than `most` bytes.
    """
    if not stat.S_ISREG(mode := path.lstat().st_mode):
        raise NotOursError(mode)
    fd = os.open(path, os.O_RDONLY | NO_LINK | PLAIN)
    with os.fdopen(fd, "rb") as file:
        status = os.fstat(fd)
        if not stat.S_ISREG(status.st_mode):
            raise NotOursError(status.st_mode)
        if status.st_size > most:
            problem = f"expected at most {most:,} bytes, got {status.st_size:,}"
            raise OSError(errno.EFBIG, problem)
        return file.read(status.st_size)  # the buffer is as large as the argument


def check_not_special(path: Path) -> None:
    """Keep devices, pipes and sockets from being replaced by a file.

    Raises:
        OutputError: There is one at `path`.
    """
    try:
        mode = path.lstat().st_mode
    except OSError:
        return  # there is none; or whoever writes hears of it
    if not (stat.S_ISREG(mode) or stat.S_ISLNK(mode) or stat.S_ISDIR(mode)):
        raise OutputError(
            f"{path}: expected the name of a file, got {kind_of(mode)}; it is left as it is. "
            "Choose another name."
        )


def new_sibling(path: Path) -> Path:
    """Make an empty file next to `path`, under a unique name, and return that name.

    Raises:
        OSError: The folder does not accept one.
    """
    return _made_sibling(path, _make_file)


def sibling_name(path: Path, suffix: str = TEMPORARY_SUFFIX) -> Path:
    """Return a unique name next to `path`.

    The process id in it shows whether its process still runs; the token keeps threads apart.
    """
    token = os.urandom(TOKEN_BYTES).hex()
    return path.with_name(f"{_stem(path)}.{os.getpid()}.{token}{suffix}")


def _made_sibling(path: Path, make: Callable[[Path], None]) -> Path:
    while True:
        temporary = sibling_name(path)
        with suppress(FileExistsError):  # somebody foresaw it; the next one is another
            make(temporary)
            return temporary


def _make_file(path: Path) -> None:
    flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | NO_LINK | PLAIN
    os.close(os.open(path, flags, 0o666))


def _make_folder(path: Path) -> None:
    path.mkdir(0o700)


def _stem(path: Path) -> str:
    """Return how temporary names next to `path` begin: of a long name, its end shows more."""
    name = path.name
    while len(os.fsencode(name)) > MOST_STEM_BYTES:
        name = name[1:]
    return f".{name}"


def _new_file(path: Path) -> BinaryIO:
    """Open the file that `atomic_file` made."""
    return os.fdopen(os.open(path, os.O_WRONLY | NO_LINK | PLAIN), "wb")


def _sync_tree(folder: Path) -> None:
    """Sync a folder with all that is in it, what lies deepest first."""
    for inner, _, files in os.walk(folder, topdown=False):
        for name in files:
            sync_file(Path(inner, name))
        sync_folder(Path(inner))


def _give_name(temporary: Path, path: Path) -> None:
    os.replace(temporary, path)
    sync_folder(path.parent)


def _is_running(process: int) -> bool:
    if os.name == "nt":
        return True  # there the call that asks would end it
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except (PermissionError, OverflowError):
        pass
    return True


NO_LINK = getattr(os, "O_NOFOLLOW", 0)
"""A link in the file's place is an error."""
PLAIN = getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_CLOEXEC", 0) | getattr(os, "O_BINARY", 0)
"""A pipe in the file's place is not waited for, no child inherits it, no line end is changed."""
FOLDER = getattr(os, "O_DIRECTORY", 0)
CAN_OPEN_FOLDERS = bool(FOLDER)


def open_plainly(path: Path) -> int:
    """Return a descriptor of a file that is read; it may be a pipe or a device.

    Raises:
        OSError: As the system says.
    """
    return os.open(path, os.O_RDONLY | PLAIN)


_NEEDED = ("O_DIRECTORY", "O_NOFOLLOW", "O_CLOEXEC", "fdatasync", "link")
"""Of `os`, by whoever writes."""


def check_can_write(path: Path) -> None:
    """Check that this system has what keeps a log whole while it is written.

    Raises:
        LogAccessError: It has not; the message names what is missing.
    """
    from importlib.util import find_spec

    missing = ["fcntl (locks on files)"] if find_spec("fcntl") is None else []
    missing += [f"os.{name}" for name in _NEEDED if not hasattr(os, name)]
    if not os.supports_dir_fd:
        missing.append("dir_fd (folders that are held open)")
    if missing:
        raise LogAccessError(
            f"{path}: a log cannot be written on this system, which lacks {', '.join(missing)}. "
            "Reading works. To write, use Linux; on Windows: WSL."
        )


def read_into(fd: int, target: memoryview, at: int) -> int:
    """Read bytes of an open file from an offset on; return how many: 0 after its end.

    Raises:
        OSError: As the kernel reports it.
    """
    if hasattr(os, "preadv"):  # not on macOS
        return os.preadv(fd, [target], at)
    if hasattr(os, "pread"):
        data = os.pread(fd, len(target), at)
    else:  # Windows; nobody else has this descriptor
        os.lseek(fd, at, os.SEEK_SET)
        data = os.read(fd, len(target))
    target[: len(data)] = data
    return len(data)


def read_page_into(fd: int, target: memoryview, at: int) -> int:
    """Read some bytes where reading more has failed, to the end of a page at most.

    Around a bad sector one read fails for all that the kernel fetches together.

    Raises:
        OSError: As the kernel says: that page cannot be read.
    """
    room = mmap.PAGESIZE - at % mmap.PAGESIZE
    if hasattr(os, "posix_fadvise"):  # not on macOS
        os.posix_fadvise(fd, at, len(target), os.POSIX_FADV_DONTNEED)
        os.posix_fadvise(fd, 0, 0, os.POSIX_FADV_RANDOM)
    return read_into(fd, target[:room], at)
