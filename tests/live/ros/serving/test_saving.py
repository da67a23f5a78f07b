"""Saving: the thesis's YAML inside a root, whole or not at all, and nowhere else."""

from __future__ import annotations

import math
import os
from pathlib import Path

import pytest

import semmap_log as sl
from semmap_log.core.io.disk import TEMPORARY_SUFFIX, TOKEN_BYTES
from semmap_log.core.model.events import LogExported
from semmap_log.live.ros.ros_node import Outcome
from semmap_log.live.ros.serving import saving
from semmap_log.live.ros.serving.door_server import DoorServer
from semmap_log.live.ros.serving.saving import DoorSaver
from tests.live.ros.serving.door_servers import door_server, events_in
from tests.live.ros.serving.goals import DOOR, goal_of


def test_saving_writes_the_thesis_yaml_and_a_note_of_it(server: DoorServer, root: Path) -> None:
    """The file is what `import` and the thesis's server read; the log says that it was saved."""
    server.run(goal_of("AddDoor", "a", **DOOR))

    outcome = server.run(goal_of("SaveDoorDB", "s", file_name="doors.yaml"))

    assert Outcome(succeeded=True, result={"stored_successful": True}) == outcome
    assert "status: CLOSED" in (root / "doors.yaml").read_text()
    event = server.log.event(1).event
    assert isinstance(event, LogExported)
    assert ("thesis YAML", "doors.yaml") == (event.format, event.file_name)


def test_absolute_paths_inside_the_root_are_fine(server: DoorServer, root: Path) -> None:
    """By the root's name, or by where that leads; in folders below, too."""
    (root / "below").mkdir()
    link = root.parent / "link"
    link.symlink_to(root)
    linked = _saver_outcome(server, link, f"{link}/linked.yaml")

    plain = server.run(goal_of("SaveDoorDB", "s", file_name=f"{root}/below/doors.yml"))

    assert plain.succeeded
    assert linked.succeeded
    assert {"below", "linked.yaml"} == {each.name for each in root.iterdir()}
    assert ["doors.yml"] == [each.name for each in (root / "below").iterdir()]


def _saver_outcome(server: DoorServer, root: Path, file_name: str) -> Outcome:
    saver = DoorSaver(root, server.log.path)
    other = DoorServer(lambda: server.log, saver)
    return other.run(goal_of("SaveDoorDB", f"by {root}", file_name=file_name))


@pytest.fixture
def trap(root: Path, tmp_path: Path) -> Path:
    """A root with all that must not be followed or replaced; returns what lies outside."""
    outside = tmp_path / "outside"
    outside.mkdir()
    (outside / "precious.yaml").write_text("mine")
    (root / "out").symlink_to(outside)
    (root / "link.yaml").symlink_to(outside / "precious.yaml")
    (root / "dangling.yaml").symlink_to(outside / "new.yaml")
    (root / "loop.yaml").symlink_to("loop.yaml")
    (root / "folder.yaml").mkdir()
    os.mkfifo(root / "pipe.yaml")
    return outside


OUTSIDE = [
    "../outside/precious.yaml", "below/../../outside/precious.yaml", "out/precious.yaml",
    "out/new.yaml", "link.yaml", "dangling.yaml", "loop.yaml", "folder.yaml", "pipe.yaml",
    "/etc/doors.yaml", "{outside}/precious.yaml", "{root}/../outside/precious.yaml",
    "{root}x/doors.yaml", "", ".", "..", "/", "doors", "doors.txt", "nul\0.yaml",
    "missing/doors.yaml", "x" * 300 + ".yaml",
    "pipe.yaml/doors.yaml", "{root}", "\udcff.yaml",
]  # fmt: skip


@pytest.mark.parametrize("name", OUTSIDE)
def test_nothing_is_written_outside_the_root(
    server: DoorServer, root: Path, trap: Path, name: str
) -> None:
    """Nor over a link, folder or pipe inside it; the text names the root."""
    before = sorted(root.iterdir())
    file_name = name.format(outside=trap, root=root)

    outcome = server.run(goal_of("SaveDoorDB", "s", file_name=file_name))

    assert (False, {"stored_successful": False}) == (outcome.succeeded, outcome.result)
    assert str(root) in outcome.text
    assert ["precious.yaml"] == [each.name for each in trap.iterdir()]
    assert "mine" == (trap / "precious.yaml").read_text()
    assert before == sorted(root.iterdir())
    assert 0 == events_in(server)


def test_a_link_in_place_of_the_temporary_file_is_not_followed(
    server: DoorServer, root: Path, trap: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Were its name foreseen by somebody who may write into the root, another would be drawn."""
    tokens, random = iter([b"\xbe\xef", b"\xca\xfe"]), os.urandom
    foreseen = lambda size: next(tokens) if size == TOKEN_BYTES else random(size)  # noqa: E731
    monkeypatch.setattr("os.urandom", foreseen)
    planted = root / f".doors.yaml.{os.getpid()}.beef{TEMPORARY_SUFFIX}"
    planted.symlink_to(trap / "precious.yaml")

    outcome = server.run(goal_of("SaveDoorDB", "s", file_name="doors.yaml"))

    assert outcome.succeeded
    assert "mine" == (trap / "precious.yaml").read_text()
    assert not (root / "doors.yaml").is_symlink()


def test_a_folder_that_is_exchanged_meanwhile_leads_nowhere(
    server: DoorServer, root: Path, trap: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Behind the look at it, for a link that leads outside."""
    (root / "below").mkdir()

    def exchange(*_: object) -> None:
        (root / "below").rename(root / "before")
        (root / "below").symlink_to(trap)

    monkeypatch.setattr(saving, "check_outside_log", exchange)

    outcome = server.run(goal_of("SaveDoorDB", "s", file_name="below/precious.yaml"))

    assert outcome.succeeded
    assert "mine" == (trap / "precious.yaml").read_text()
    assert ["precious.yaml"] == [each.name for each in (root / "before").iterdir()]


def test_without_a_root_there_is_a_folder_beside_the_log(path: Path) -> None:
    """It is made when the first file is saved; the log's own folder stays the log's."""
    server = door_server(path, None)
    server.run(goal_of("AddDoor", "a", **DOOR))
    folder = path.parent / "log_saved"
    told = DoorSaver(None, path).told()

    refused = server.run(goal_of("SaveDoorDB", "r", file_name="/tmp/doors.yaml"))
    was_made = folder.exists()
    saved = [
        server.run(goal_of("SaveDoorDB", name, file_name=name))
        for name in ("doors.yaml", f"{folder}/again.yaml")
    ]

    assert f"SaveDoorDB saves in {folder}." == told
    assert (False, {"stored_successful": False}) == (refused.succeeded, refused.result)
    assert f"files are saved in {folder} (another: --save-root" in refused.text
    assert not was_made
    assert [True, True] == [outcome.succeeded for outcome in saved]
    assert {"doors.yaml", "again.yaml"} == {each.name for each in folder.iterdir()}
    server.close()


def test_a_folder_that_may_not_be_written_is_told(
    path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """
    At the start, with what to do; of one that is still to be made, the folder around it counts.
    """
    asked: list[Path] = []
    monkeypatch.setattr(saving.os, "access", lambda folder, _: bool(asked.append(folder)))

    told = [DoorSaver(root, path).told() for root in (None, path.parent)]

    assert [path.parent, path.parent] == asked
    assert all("this process may not write there; --save-root DIR" in text for text in told)


def test_other_logs_are_no_place_to_save_in(server: DoorServer, root: Path) -> None:
    """A root may hold them: their metadata.yaml is not a stranger's to write."""
    sl.create(root / "lab", tz="UTC").close()
    before = {each.name: each.read_bytes() for each in (root / "lab").iterdir()}

    outcome = server.run(goal_of("SaveDoorDB", "s", file_name="lab/metadata.yaml"))

    assert not outcome.succeeded
    assert "lies in the folder of a log" in outcome.text
    assert before == {each.name: each.read_bytes() for each in (root / "lab").iterdir()}


def test_the_log_itself_is_no_place_to_save_in(path: Path) -> None:
    """Where the root holds the log, its folder is refused."""
    server = door_server(path, path.parent)

    outcome = server.run(goal_of("SaveDoorDB", "s", file_name="log/metadata.yaml"))

    assert not outcome.succeeded
    assert "the log's own folder" in outcome.text
    server.close()


def test_a_door_without_probabilities_is_saved_without_them(path: Path, root: Path) -> None:
    """The text names the door and what it lacks; with a default its line is there."""
    goal = goal_of("AddDoor", "a", **DOOR | {"prob_open": math.nan})
    with_default = door_server(path, root, default_prob=0.5)
    with_default.run(goal)
    saved = with_default.run(goal_of("SaveDoorDB", "s", file_name="doors.yaml"))
    with_default.close()
    with_line = (root / "doors.yaml").read_text()

    without = door_server(path, root)
    partial = without.run(goal_of("SaveDoorDB", "t", file_name="doors.yaml"))
    without.close()

    assert Outcome(succeeded=True, result={"stored_successful": True}) == saved
    assert (True, {"stored_successful": True}) == (partial.succeeded, partial.result)
    assert "left out: open_prob is not given: door 1." == partial.text
    assert with_line.replace("  open_prob: 0.5\n", "") == (root / "doors.yaml").read_text()
    assert "open_prob: 0.5" in with_line
