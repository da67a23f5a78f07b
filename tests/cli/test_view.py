"""`view`: options that go together, a log that is followed in real processes, and the browser."""

from __future__ import annotations

import os
import shlex
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from urllib.parse import parse_qs, urlsplit

import pytest

pytest.importorskip("rerun", reason="rerun-sdk is not installed: pip install 'semmap-log[viewer]'")

import semmap_log as sl
from semmap_log.cli import main
from semmap_log.errors import ViewerError
from semmap_log.views.palette import COLOUR_BLIND, DEFAULT
from tests.browser import a_page
from tests.live.ros.running import DEADLINE_S
from tests.verbs import Refuses
from tests.views.rerun.pictures import a_viewer, colours_of, has_colour
from tests.views.rerun.some_logs import room

LOCALHOST = "0100007F"
"""127.0.0.1, as /proc/net/tcp writes it."""
LISTENS = "0A"
MOST_S = 240.0

TOLERATED = (
    "ERR_NAME_NOT_RESOLVED",  # a font, news of rerun, usage data: the page is rerun's own
    "ERR_INTERNET_DISCONNECTED",
    "Failed to fetch",
    "using deprecated parameters",
    "query. Expected one or none",
    "No available adapters",  # of WebGPU; there is WebGL
    "Software rasterizer",
    "Unhandled egui viewport command",
)
"""What rerun's page says of itself where there is no internet and no graphics card."""


@pytest.fixture
def log(tmp_path: Path) -> Path:
    with sl.create(tmp_path / "room", tz="UTC") as log:
        log.append([room()])
        log.add_door(x=-1.0, y=0.0, theta=0.0, width=2.0, state="closed", name="front")
    return tmp_path / "room"


def run(arguments: list[str]) -> None:
    """Run a command that goes well."""
    with pytest.raises(SystemExit) as end:
        main(arguments)
    assert 0 == end.value.code


def test_an_empty_log_says_what_to_do(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """In lines that can be pasted, whatever its folder is called; one with events says nothing."""
    sl.create(tmp_path / "my log", tz="UTC").close()

    run(["view", str(tmp_path / "my log"), "--save", str(tmp_path / "x.rrd")])

    said = capsys.readouterr().err
    assert "The log has no events yet." in said
    (line,) = [line for line in said.splitlines() if "semmap-log add" in line]
    run(shlex.split(line)[1:])
    capsys.readouterr()
    run(["view", str(tmp_path / "my log"), "--save", str(tmp_path / "x.rrd")])
    assert "no events yet" not in capsys.readouterr().err


def test_names_that_the_viewer_cannot_draw_are_told_once(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """How many, and what stands for them; not those of other doors than were asked for."""
    with sl.create(tmp_path / "log", tz="UTC") as log:
        for x, name in enumerate(["会議室 1", "Küche", "会議室 2"]):
            log.add_door(x=x, y=0.0, theta=0.0, width=0.9, name=name)

    run(["view", str(tmp_path / "log"), "--save", str(tmp_path / "x.rrd")])
    everything = capsys.readouterr().err
    run(["view", str(tmp_path / "log"), "--save", str(tmp_path / "x.rrd"), "--door", "Küche"])

    assert 1 == everything.count("font lacks letters in the names of 2 doors")
    assert '"door 1"' in everything
    assert "font" not in capsys.readouterr().err


def test_options_that_make_no_sense_together_are_refused(log: Path, refuses: Refuses) -> None:
    """Both are named, and nothing is written."""
    refuses(f"""
        view {log} --follow --save x.rrd
        view {log} --follow --screenshot x.png
        view {log} --follow --at @0
        view {log} --follow --until @0
        view {log} --web --save x.rrd
        view {log} --web --screenshot x.png
        view {log} --theme dark
        view {log} --open
        view {log} --view Costmap
        view {log} --size 10x10
        view {log} --screenshot x.png --size 10
        view {log} --screenshot x.png --size 0x9
        view {log} --screenshot x.png --size 9x8193
        view {log} --screenshot x.jpg
        view {log} --save x.png
        view {log} --palette grey
    """)

    assert [log] == list(log.parent.iterdir())


@pytest.mark.slow
@pytest.mark.viewer
def test_a_picture_of_one_view_in_other_colours(
    log: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Of the size asked for, less the window's edges; what was made on the way is gone."""
    picture = tmp_path / "plan.png"
    with a_viewer(None):
        with pytest.raises(SystemExit) as ended:
            main(["view", str(log), "--screenshot", str(picture), "--view", "Floor plan",
                  "--size", "640x480", "--palette", "colour-blind", "--no-beliefs"])  # fmt: skip
        said = capsys.readouterr().err
        if ended.value.code and "mesa-vulkan-drivers" in said:
            raise ViewerError(said)  # the first viewer had not looked for a driver yet

    assert ended.value.code == 0
    png = picture.read_bytes()
    assert has_colour(png, COLOUR_BLIND.closed)
    assert not has_colour(png, DEFAULT.closed)
    height, width, _ = colours_of(png).shape
    assert 200 < width < 640
    assert 200 < height < 480
    assert f"{picture}: written." in said
    assert {log, picture} == set(tmp_path.iterdir())


@pytest.mark.slow
@pytest.mark.viewer
@pytest.mark.parametrize("ending", [signal.SIGINT, signal.SIGTERM])
def test_a_log_is_followed_while_another_process_records(log: Path, ending: signal.Signals) -> None:
    """Over the end of a segment, too; a signal ends it, quickly, and no process of it is left."""
    with _serving(log, "--follow", "--no-beliefs") as (process, page):
        (source,) = parse_qs(urlsplit(page).query)["url"]
        with a_viewer(source, size=(800, 600)) as viewer:
            _wait_for(lambda: has_colour(viewer.picture("Floor plan"), DEFAULT.closed))
            for state in ("unknown", "open"):
                _run("observe", log, "front", state)
                _run("compact", log)
            _wait_for(lambda: has_colour(viewer.picture("Floor plan"), DEFAULT.open))
        children = _family(process.pid)
        process.send_signal(ending)
        code = process.wait(DEADLINE_S)
        said = process.stderr.read() if process.stderr else ""

    assert len(children) > 1
    assert [] == [pid for pid in children if _is_alive(pid)]
    assert (0 if ending == signal.SIGINT else 128 + signal.SIGTERM) == code
    assert ["Open this address in a browser of this machine; Ctrl-C ends it."] == said.splitlines()


@pytest.mark.slow
@pytest.mark.viewer
def test_a_viewer_that_is_killed_ends_the_following(log: Path) -> None:
    """That is said in one line, without what rerun's own library has to say of it."""
    with _serving(log, "--follow", "--no-beliefs") as (process, _):
        (viewer,) = _family(process.pid)[1:]  # the page was told of when it was served
        time.sleep(2)  # most often it has the history by then; the end is the same without
        os.kill(viewer, signal.SIGKILL)
        code = process.wait(DEADLINE_S)
        said = process.stderr.read() if process.stderr else ""

    assert 1 == code
    assert "semmap-log: The rerun viewer was ended by SIGKILL." == said.splitlines()[-1]
    assert 2 == len(said.splitlines())  # the other one is about the address


@pytest.mark.slow
@pytest.mark.viewer
def test_a_browser_shows_the_recording(log: Path) -> None:
    """The page loads without a complaint of ours, and shows the door closed."""
    with (
        a_page(size=(1000, 700), webgl=True) as browser,
        _serving(log, "--no-beliefs", "--theme", "dark") as (process, page),
    ):
        browser.open(page)
        _wait_for(lambda: has_colour(browser.screenshot(), DEFAULT.closed))
        listening = [line for pid in _family(process.pid) for line in _listening(pid)]
        complaints = [said for said in browser.complaints if not _is_tolerated(said)]
        background = colours_of(browser.screenshot())[4, 500]

    assert [] == complaints
    assert 2 == len(listening)
    assert {LOCALHOST} == {address.partition(":")[0] for address in listening}
    assert background.max() < 40


def _is_tolerated(said: str) -> bool:
    return any(words in said for words in TOLERATED)


@contextmanager
def _serving(log: Path, *options: str) -> Iterator[tuple[subprocess.Popen[str], str]]:
    """A `view --web` in a process of its own, and the address that it tells."""
    command = [sys.executable, "-m", "semmap_log", "view", str(log), "--web", *options]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        try:
            assert process.stdout is not None
            yield process, process.stdout.readline().strip()
        finally:
            process.terminate()


def _run(verb: str, log: Path, *arguments: str) -> None:
    command = [sys.executable, "-m", "semmap_log", verb, str(log), *arguments]
    subprocess.run(command, check=True, capture_output=True)


def _wait_for(done: object) -> None:
    """Pictures are drawn in software, which takes its time."""
    deadline = time.monotonic() + MOST_S
    while not done():  # type: ignore[operator]
        assert time.monotonic() < deadline, f"not so within {MOST_S:.0f} s"
        time.sleep(0.2)


def _family(pid: int) -> list[int]:
    """A process and all that it started, and they started."""
    found = [pid]
    for each in found:
        for task in Path(f"/proc/{each}/task").iterdir():
            with suppress(FileNotFoundError, ProcessLookupError):  # a thread that has just ended
                found += [int(child) for child in (task / "children").read_text().split()]
    return found


def _is_alive(pid: int) -> bool:
    return Path(f"/proc/{pid}").exists()


def _listening(pid: int) -> list[str]:
    """The addresses, as in /proc/net/tcp, on which a process takes connections."""
    sockets = set()
    for each in Path(f"/proc/{pid}/fd").iterdir():
        with suppress(FileNotFoundError):  # it has just been closed
            sockets.add(str(each.readlink()))
    rows = [line.split() for name in ("tcp", "tcp6")
            for line in Path(f"/proc/{pid}/net/{name}").read_text().splitlines()[1:]]  # fmt: skip
    return [row[1] for row in rows if row[3] == LISTENS and f"socket:[{row[9]}]" in sockets]
