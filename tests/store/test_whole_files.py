"""Files that appear whole or not at all, whoever else is at work beside them."""

from __future__ import annotations

import os
import stat
import subprocess
import sys
import threading
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest

import semmap_log as sl
from semmap_log.core.io.disk import (
    TEMPORARY_SUFFIX,
    NotOursError,
    atomic_file,
    atomic_folder,
    check_outside_log,
    left_by_killed,
    output_errors,
    read_own,
    replace_file,
)
from semmap_log.core.messages import BAG_METADATA_NAME
from semmap_log.errors import CheckpointError, OutputError
from semmap_log.interop.formats.files.map_server_out import write_map
from semmap_log.store.byte_layout import MOST_NAME_BYTES
from semmap_log.store.folder import LogFolder
from tests.log.replay.projections import Numbers

THREADS, ROUNDS = 6, 15


@pytest.fixture
def drawn(monkeypatch: pytest.MonkeyPatch) -> Callable[..., None]:
    """What is drawn for names from now on; behind that, as always."""

    def draw(*tokens: str) -> None:
        usual, some = os.urandom, map(bytes.fromhex, tokens)
        monkeypatch.setattr(os, "urandom", lambda n: next(some, None) or usual(n))

    return draw


def _planted(path: Path, token: str) -> Path:
    return path.with_name(f".{path.name}.{os.getpid()}.{token}{TEMPORARY_SUFFIX}")


@contextmanager
def _collecting(raised: list[Exception]) -> Iterator[None]:
    try:
        yield
    except Exception as error:  # noqa: BLE001 - it is what is asked
        raised.append(error)


def _everywhere(work: Callable[[int], object]) -> list[Exception]:
    """Do it in several threads at once; return what was raised."""
    raised: list[Exception] = []
    start = threading.Barrier(THREADS)

    def run(number: int) -> None:
        start.wait()
        for _ in range(ROUNDS):
            with _collecting(raised):
                work(number)

    threads = [threading.Thread(target=run, args=(number,)) for number in range(THREADS)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    return raised


def test_two_calls_never_share_a_name(tmp_path: Path) -> None:
    """The one inside the other, in one process: each has its file."""
    path = tmp_path / "x"

    with atomic_file(path) as one, atomic_file(path) as other:
        one.write_bytes(b"one")
        other.write_bytes(b"other")
        assert one != other

    assert b"one" == path.read_bytes()
    assert [path] == list(tmp_path.iterdir())


def test_threads_that_write_one_file(tmp_path: Path) -> None:
    """The last one's bytes are there, nothing was raised, nothing is left."""
    path = tmp_path / "x"

    raised = _everywhere(lambda number: replace_file(path, bytes([number]) * 10_000))

    assert [] == raised
    assert 1 == len(set(path.read_bytes()))
    assert [path] == list(tmp_path.iterdir())


def test_threads_that_share_a_checkpoint(tmp_path: Path) -> None:
    """Each fold gets its answer, and what it saves is whole."""
    with sl.create(tmp_path / "log", tz="UTC") as log:
        log.add_door()
    path = tmp_path / "checkpoint"
    states: list[list[int]] = []

    raised = _everywhere(
        lambda _: states.append(sl.read(tmp_path / "log").fold(Numbers(), checkpoint=path))
    )

    assert [] == raised
    assert THREADS * ROUNDS == len(states)
    assert all(states[0] == state for state in states)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert states[0] == sl.read(tmp_path / "log").fold(Numbers(), checkpoint=path)
    assert {"checkpoint", "log"} == {file.name for file in tmp_path.iterdir()}


def test_threads_that_write_one_map(tmp_path: Path) -> None:
    """Two files that belong together; whoever lost the race hears of it, and both are there."""
    import numpy as np

    from semmap_log.analysis.costmap_2d.grid import GridGeometry

    geometry = GridGeometry(width=3, height=2, resolution=0.05, origin_x=0, origin_y=0)
    cells = np.zeros((2, 3), np.int8)

    raised = _everywhere(lambda _: write_map(tmp_path / "m.pgm", cells, geometry))

    assert all(isinstance(error, OutputError) for error in raised)
    write_map(tmp_path / "m.pgm", cells, geometry)
    assert {"m.pgm", "m.yaml"} <= {file.name for file in tmp_path.iterdir()}
    assert [] == list(tmp_path.glob(f".*{TEMPORARY_SUFFIX}"))


def test_a_planted_link_is_not_followed(tmp_path: Path, drawn: Callable[..., None]) -> None:
    """Even if its name was foreseen: another is drawn. The link is a stranger's, and stays."""
    (tmp_path / "precious").write_text("mine")
    path = tmp_path / "x"
    _planted(path, "beef").symlink_to("precious")
    _planted(path, "cafe").symlink_to("not-there")
    drawn("beef", "cafe", "f00d")

    with atomic_file(path) as temporary:
        assert _planted(path, "f00d") == temporary
        assert 0 == temporary.stat().st_size
        temporary.write_bytes(b"new")

    assert "mine" == (tmp_path / "precious").read_text()
    assert not (tmp_path / "not-there").exists()
    assert b"new" == path.read_bytes()


def test_a_temporary_file_that_was_exchanged_is_not_written_to(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Between making and writing it, where anybody may remove files."""
    (tmp_path / "precious").write_text("mine")

    def give_link(path: Path) -> Path:
        temporary = made(path)
        temporary.unlink()
        temporary.symlink_to("precious")
        return temporary

    from semmap_log.core.io import disk

    made = disk.new_sibling
    monkeypatch.setattr(disk, "new_sibling", give_link)

    with pytest.raises(OSError, match="symbolic links"):
        replace_file(tmp_path / "x", b"new")

    assert ["precious"] == [file.name for file in tmp_path.iterdir()]
    assert "mine" == (tmp_path / "precious").read_text()


def test_a_planted_folder_is_not_used(tmp_path: Path, drawn: Callable[..., None]) -> None:
    """Nor emptied."""
    path = tmp_path / "x"
    (tmp_path / "theirs").mkdir()
    (tmp_path / "theirs" / "precious").touch()
    _planted(path, "beef").symlink_to("theirs")
    drawn("beef", "cafe")

    with atomic_folder(path) as temporary:
        assert "cafe" in temporary.parent.name
        assert 0o700 == stat.S_IMODE(temporary.parent.stat().st_mode)
        temporary.mkdir()
        (temporary / "new").touch()

    assert ["precious"] == [file.name for file in (tmp_path / "theirs").iterdir()]
    assert ["new"] == [file.name for file in path.iterdir()]


def test_a_folder_in_place_of_which_there_is_a_link_to_nothing(tmp_path: Path) -> None:
    """Something is there: it is not replaced."""
    (tmp_path / "x").symlink_to("nowhere")

    with pytest.raises(OutputError, match="is there already"), atomic_folder(tmp_path / "x"):
        pass

    assert ["x"] == [file.name for file in tmp_path.iterdir()]


def test_files_deep_in_a_new_folder_are_synced(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Before it gets its name; inner ones first."""
    synced: list[str] = []
    sync = os.fsync

    def spy(fd: int) -> None:
        synced.append(Path(f"/proc/self/fd/{fd}").readlink().name)
        sync(fd)

    monkeypatch.setattr(os, "fsync", spy)

    with atomic_folder(tmp_path / "x") as temporary:
        (temporary / "scripts").mkdir(parents=True)
        (temporary / "scripts" / "deep").touch()
        (temporary / "flat").touch()

    assert ["deep", "scripts", "flat", "x", tmp_path.name] == synced


def test_a_link_is_replaced_and_its_target_stays(tmp_path: Path) -> None:
    """Whatever it points to, a device among it."""
    (tmp_path / "precious").write_text("mine")
    for name, target in (("a", "precious"), ("b", "/dev/null"), ("c", "nowhere")):
        (tmp_path / name).symlink_to(target)

        replace_file(tmp_path / name, b"new")

        assert not (tmp_path / name).is_symlink()
        assert b"new" == (tmp_path / name).read_bytes()
    assert "mine" == (tmp_path / "precious").read_text()
    assert stat.S_ISCHR(Path("/dev/null").stat().st_mode)


@pytest.mark.slow
def test_pipes_are_not_replaced(tmp_path: Path) -> None:
    """A file in its place would be nothing that its reader ever sees."""
    os.mkfifo(tmp_path / "pipe.csv")
    os.mkfifo(tmp_path / "pipe.pgm")
    with sl.create(tmp_path / "log", tz="UTC") as log:
        log.add_door(x=0, y=0, theta=0, width=1)

    for name in ("pipe.csv", "pipe.pgm"):
        ended = subprocess.run(
            [sys.executable, "-m", "semmap_log", "export", tmp_path / "log", tmp_path / name],
            capture_output=True, text=True, check=False, timeout=100,
        )  # fmt: skip

        assert 1 == ended.returncode
        assert f"{name}: expected the name of a file, got a named pipe" in ended.stderr
        assert (tmp_path / name).is_fifo()
    assert ["log", "pipe.csv", "pipe.pgm"] == sorted(file.name for file in tmp_path.iterdir())


def test_a_new_file_has_the_mode_of_any_other(tmp_path: Path) -> None:
    """As the umask says."""
    before = os.umask(0o027)
    try:
        replace_file(tmp_path / "x", b"")
        (tmp_path / "y").touch()
    finally:
        os.umask(before)

    modes = {stat.S_IMODE((tmp_path / name).stat().st_mode) for name in "xy"}
    assert {0o640} == modes


@pytest.mark.parametrize("name", ["a" * 255, "ä" * 127, "\udcff" * 250 + ".yaml"])
def test_the_longest_names(tmp_path: Path, name: str) -> None:
    """A name of 255 bytes is one, and needs a temporary one no longer."""
    replace_file(tmp_path / name, b"new")
    with atomic_file(tmp_path / name) as temporary:
        temporary.write_bytes(b"newer")

    assert b"newer" == (tmp_path / name).read_bytes()
    assert [name] == [file.name for file in tmp_path.iterdir()]


def test_leftovers_of_a_log_of_the_longest_name(tmp_path: Path) -> None:
    """They are known as such, with the longest of all process ids, and removed."""
    name = "n" * MOST_NAME_BYTES + "_000000.mcap"
    for lost in (name, f"{name}.1234567.torn", BAG_METADATA_NAME):
        with suppress(FileNotFoundError), atomic_file(tmp_path / lost) as temporary:
            kept = temporary.with_name(temporary.name.replace(str(os.getpid()), "4194304"))
            temporary.rename(kept)
    assert 3 == len(list(tmp_path.iterdir()))

    assert LogFolder(tmp_path).is_empty()
    LogFolder(tmp_path).remove_stale_files()

    assert [] == list(tmp_path.iterdir())


def test_leftovers_are_known_by_who_made_them(tmp_path: Path) -> None:
    """One of a process that is gone is a leftover, one of a thread that is writing is not."""
    path = tmp_path / "checkpoint"
    script = (
        "import os, sys; from pathlib import Path\n"
        "from semmap_log.core.io.disk import atomic_file\n"
        "with atomic_file(Path(sys.argv[1])): os._exit(0)"
    )
    subprocess.run([sys.executable, "-c", script, path], check=True)
    (gone,) = tmp_path.iterdir()

    with atomic_file(path):
        assert 2 == len(list(tmp_path.iterdir()))
        assert [gone] == list(left_by_killed(path))


def test_an_error_that_is_ours_already_stays(tmp_path: Path) -> None:
    """And the system's becomes ours, with the name that was asked for."""
    with pytest.raises(OutputError, match=r"^mine$"), output_errors(tmp_path):
        raise OutputError("mine")
    said = pytest.raises(OutputError, match=r"x: could not be written: No space left")
    with said, output_errors(Path("x")):
        raise OSError(28, "No space left on device")


def _put(what: str, path: Path) -> None:
    if what == "pipe":
        os.mkfifo(path)
    elif what == "folder":
        path.mkdir()
    else:
        path.symlink_to(what)


STRANGE = ["pipe", "folder", "/dev/zero", "/etc/hostname", "nowhere"]


@pytest.mark.parametrize("what", STRANGE)
def test_what_is_read_back_is_a_file(tmp_path: Path, what: str) -> None:
    """Anything else might never end, or be somebody's secret."""
    _put(what, tmp_path / "x")

    with pytest.raises(NotOursError, match="expected a regular file, got a "):
        read_own(tmp_path / "x")


IN_CHILD = """
import resource, sys
resource.setrlimit(resource.RLIMIT_AS, (2**30, 2**30))
resource.setrlimit(resource.RLIMIT_CPU, (100, 100))
import semmap_log as sl
from semmap_log.errors import CheckpointError
from tests.log.replay.projections import Numbers
try:
    sl.read(sys.argv[1]).fold(Numbers(), checkpoint=sys.argv[2])
except CheckpointError as error:
    print(error)
"""


@pytest.mark.slow
@pytest.mark.parametrize("what", ["pipe", "/dev/zero"])
def test_a_checkpoint_that_is_no_file(tmp_path: Path, what: str) -> None:
    """It is said, at once; nobody waits at a pipe or reads zeros for ever."""
    with sl.create(tmp_path / "log", tz="UTC") as log:
        log.add_door()
    _put(what, tmp_path / "x")

    ended = subprocess.run(
        [sys.executable, "-c", IN_CHILD, tmp_path / "log", tmp_path / "x"],
        capture_output=True, text=True, check=False, timeout=200,
    )  # fmt: skip

    assert (0, "") == (ended.returncode, ended.stderr)
    assert "x: cannot be read: expected a regular file, got a " in ended.stdout
    assert CheckpointError.__name__ not in ended.stderr


VERIFY_IN_CHILD = """
from pathlib import Path
import resource, sys
resource.setrlimit(resource.RLIMIT_AS, (2**30, 2**30))
resource.setrlimit(resource.RLIMIT_CPU, (100, 100))
import semmap_log as sl
from semmap_log.log.replay.maintenance import verify
print([finding.kind for finding in verify(Path(sys.argv[1])).findings])
with sl.append(sys.argv[1]) as log:
    log.add_door()
print([finding.kind for finding in verify(Path(sys.argv[1])).findings])
"""


@pytest.mark.slow
@pytest.mark.parametrize("what", ["pipe", "/dev/zero"])
def test_a_metadata_file_that_is_no_file(tmp_path: Path, what: str) -> None:
    """`verify` says so, and the next writer puts its own in its place."""
    with sl.create(tmp_path / "log", tz="UTC") as log:
        log.add_door()
    path = tmp_path / "log" / BAG_METADATA_NAME
    path.unlink()
    _put(what, path)

    ended = subprocess.run(
        [sys.executable, "-c", VERIFY_IN_CHILD, tmp_path / "log"],
        capture_output=True, text=True, check=False, timeout=200,
    )  # fmt: skip

    assert (0, "") == (ended.returncode, ended.stderr)
    assert ["['metadata']", "[]"] == ended.stdout.splitlines()
    assert path.is_file()
    assert not path.is_symlink()


@pytest.mark.parametrize("process", [1, 2**40])
def test_of_a_process_that_cannot_be_asked_nothing_is_left_over(
    process: int, tmp_path: Path
) -> None:
    """One that is there, or a number that none can have."""
    (tmp_path / f".checkpoint.{process}.tmp").touch()
    assert [] == list(left_by_killed(tmp_path / "checkpoint"))


def test_a_file_that_becomes_a_pipe_while_it_is_opened(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It was a file when it was looked at; reading the pipe would never end."""
    path, opened = tmp_path / "closed.json", os.open
    path.write_bytes(b"{}")

    def exchanged(name: Path, flags: int) -> int:
        path.unlink()
        os.mkfifo(path)
        return opened(name, flags)

    monkeypatch.setattr(os, "open", exchanged)
    with pytest.raises(OSError, match="expected a regular file, got a named pipe"):
        read_own(path)


@pytest.mark.parametrize("name", ["log", "log/picture.png", "log/../log/picture.png"])
def test_nothing_is_put_into_a_logs_own_folder(name: str, tmp_path: Path) -> None:
    """However it is written; beside it is free."""
    (tmp_path / "log").mkdir()
    check_outside_log(tmp_path / "log", tmp_path / "picture.png")
    with pytest.raises(OutputError, match="lies in the log's own folder"):
        check_outside_log(tmp_path / "log", tmp_path / name)
