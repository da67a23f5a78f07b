"""What a file of JSON lines means for a log as it stands."""

import gzip
import json

import pytest

from semmap_log.core.model.commits import Note
from semmap_log.core.model.doors import NAN, Door, DoorId, DoorMap, DoorState, Level
from semmap_log.core.model.events import Changed, DoorObserved, DoorUpdated, Retracted
from semmap_log.core.model.moments import format_wall
from semmap_log.errors import FormatError
from semmap_log.interop.importing import importing_lines
from semmap_log.interop.importing.import_plan import Present
from semmap_log.interop.importing.importing_lines import plan_event_lines
from semmap_log.interop.importing.line_commits import NumberMap
from tests.interop.importing.nothing_stored import FILE_ID, NothingStored, lines_of

FRONT = Door(DoorId(3), 2, 0.0, 0.0, 0.0, 1.0, DoorState.OPEN, NAN, NAN,
             annotations={"name": "front"})  # fmt: skip
PRESENT = Present(
    DoorMap({DoorId(3): FRONT}, {2: Level(2, "top")}),
    frozenset({DoorId(3), DoorId(7)}),
    next_event=10,
)
NOON_NS = 1_772_366_400 * 10**9
SEEN = {"kind": "DoorObserved", "state": "OPEN"}


def plan(tmp_path, *lines, pack=False):
    text = "\n".join(line if isinstance(line, str) else json.dumps(line) for line in lines) + "\n"
    path = tmp_path / "in.jsonl"
    path.write_bytes(gzip.compress(text.encode()) if pack else text.encode())
    return plan_event_lines(path, PRESENT, lines_of("UTC"), NothingStored(), now_ns=NOON_NS)


def events_of(found):
    """Return all events of a plan, whatever their commits, numbered as the log will do it."""
    numbers, events = NumberMap(), []
    for commit in found.commits():
        for event, source in commit.events(numbers, found.options.at_ns):
            if source is not None:
                numbers.add(source, PRESENT.next_event + len(events))
            events.append(event)
    return events


@pytest.mark.parametrize("pack", [False, True])
def test_lines_are_events_in_their_order(tmp_path, pack):
    """Doors by id, by name, by level and name; blank lines mean nothing."""
    found = plan(tmp_path, SEEN | {"door_id": 3}, "", SEEN | {"door": "front"},
                 SEEN | {"door": "top/front"}, pack=pack)  # fmt: skip

    assert 3 == found.count
    assert all(isinstance(event, DoorObserved) for event in events_of(found))
    assert {3} == {event.door_id for event in events_of(found)}


def test_in_the_hour_that_comes_twice_the_order_of_the_lines_decides(tmp_path):
    """02:10 after 02:50 is the second 02:10, and a word says how many were taken for what."""
    times = ["2025-10-26T02:50", "2025-10-26T02:10", "2025-10-26T03:05", None]
    text = "".join(json.dumps(SEEN | {"door": " front ", "happened": at}) + "\n" for at in times)
    path = tmp_path / "in.jsonl"
    path.write_text(text)

    found = plan_event_lines(
        path, PRESENT, lines_of("Europe/Vienna"), NothingStored(), now_ns=NOON_NS
    )

    said = [event.happened_ns for event in events_of(found)]
    assert [
        "2025-10-26T02:50:00+02:00", "2025-10-26T02:10:00+01:00", "2025-10-26T03:05:00+01:00",
    ] == [format_wall(ns, "Europe/Vienna") for ns in said[:3]]  # fmt: skip
    assert said[3] is None
    assert "twice in Europe/Vienna: 2" in found.warnings[0]


def test_a_line_may_name_a_door_that_an_earlier_one_added(tmp_path):
    """The next free id is after all that were ever given; a door's level is remembered."""
    added, named, seen, moved = events_of(
        plan(
            tmp_path,
            {"kind": "DoorAdded", "level": 2},
            {"kind": "DoorAnnotated", "door_id": 8, "key": "name", "value": "back"},
            SEEN | {"door": "back"},
            {"kind": "DoorUpdated", "door": "back", "x": 1, "y": 2, "theta": 3, "width": 1},
        )
    )

    assert [8, 8, 8, 8] == [event.door_id for event in (added, named, seen, moved)]
    assert isinstance(moved, DoorUpdated)
    assert (Changed.POSE | Changed.WIDTH, 2) == (moved.changed, moved.level)


def test_every_wrong_line_is_told(tmp_path):
    """All at once, each with its number."""
    with pytest.raises(FormatError) as caught:
        plan(
            tmp_path,
            SEEN | {"door_id": 99},
            "nonsense",
            {"kind": "DoorAdded", "door_id": 3},
            {"kind": "DoorAdded", "door_id": 7},
            SEEN | {"door": "cellar"},
        )

    found = str(caught.value).splitlines()
    expected = ["door 99 is not in the map",
                "expected one JSON object", "door 3 is in the map already",
                "door 7 was removed", "no door has the name 'cellar'"]  # fmt: skip
    assert 5 == len(found)
    for number, (line, part) in enumerate(zip(found, expected, strict=True), start=1):
        assert f"in.jsonl:{number}: " in line
        assert 1 == line.count("in.jsonl")
        assert part in line


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("a\0b", "reason: expected text without NUL"),
        ("x" * 5 * 2**20, "Note: expected at most 41943"),
    ],
)
def test_a_note_that_no_log_takes_is_told_with_its_line(tmp_path, text, expected):
    """Before anything is stored, and in a message that can be read."""
    with pytest.raises(FormatError) as caught:
        plan(tmp_path, SEEN | {"door_id": 3}, SEEN | {"door_id": 3, "reason": text})

    assert f"in.jsonl:2: {expected}" in str(caught.value)
    assert len(str(caught.value)) < 3000


def test_retractions_of_another_log_are_left_out_and_said(tmp_path):
    """Their numbers are of that log's events; one written by hand means this one's."""
    hide = {"kind": "Retracted", "first_event": 1, "last_event": 2}

    found = plan(tmp_path, hide | {"event": 3}, hide)

    assert [Retracted(first_event=1, last_event=2)] == events_of(found)
    assert 1 == len(found.left_out)
    assert "line 1: Retracted" in found.left_out[0]


def test_lines_that_say_the_same_of_who_and_why_are_one_commit(tmp_path):
    """A line that says nothing of it has what the import says."""
    eva, bob = ({"door_id": 3, "actor": actor} for actor in ("eva", "bob"))

    found = plan(tmp_path, SEEN | eva, SEEN | eva, SEEN | bob, SEEN | {"door_id": 3}, SEEN | eva)

    commits = [(commit.note, len(list(commit.lines))) for commit in found.commits()]
    imported = lines_of("UTC").note
    assert [(Note("eva"), 2), (Note("bob"), 1), (imported, 1), (Note("eva"), 1)] == commits
    ids = [commit.command_id for commit in found.commits()]
    assert 4 == len(set(ids))
    assert FILE_ID == ids[-1]  # the file's own: all of it is stored then


def exported(number, **more):
    """Return a line as a log wrote it."""
    return {"event": number, "recorded": NOON_NS + number, "door_id": 3,
            "command_id": f"{number:032x}"} | SEEN | more  # fmt: skip


def test_lines_that_a_log_wrote_are_the_commits_that_they_were(tmp_path):
    """With the notes that they had, or none."""
    three = {"commit": [5, 7], "command_id": "ab" * 16, "content": "cd" * 16, "actor": "eva"}

    found = plan(tmp_path, exported(4), *(exported(n, **three) for n in (5, 6, 7)), exported(8))

    commits = [(c.note, c.command_id[-1], c.content[0], c.recorded_ns, len(list(c.lines)))
               for c in found.commits()]  # fmt: skip
    assert [(Note(), 4, 0, NOON_NS + 4, 1), (Note("eva"), 0xAB, 0xCD, NOON_NS + 5, 3),
            (Note(), 8, 0, NOON_NS + 8, 1)] == commits  # fmt: skip
    assert (5, 3) == (found.count, found.commit_count)


def test_what_an_older_version_exported_is_commits_by_its_recorded_times(tmp_path):
    """In a commit each event is recorded a nanosecond after the one before."""
    lines = [SEEN | {"door_id": 3, "event": n, "recorded": NOON_NS + n} for n in (1, 2, 4, 5, 6, 9)]

    assert [2, 3, 1] == [len(list(c.lines)) for c in plan(tmp_path, *lines).commits()]


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        ([exported(4, retracted=True)], r":1: retracted: event 4 was taken back, but the line of"),
        ([exported(n, retracted=True) for n in (4, 5)], ":1: retracted: events 4..5 were taken"),
        ([SEEN | {"door_id": 3, "retracted": True}], ":1: retracted: expected the key event"),
        ([exported(4), exported(5, command_id=f"{4:032x}", actor="eva")], ":2: command_id: the"),
        ([exported(4, commit=[4, 5], command_id=None)], ":1: commit: expected a command_id"),
        ([exported(4, commit=[5, 6])], r"around the line's own, 4; got \[5, 6\]"),
        ([exported(4, commit=[1, "x"])], "commit: expected the numbers of its first and last"),
        ([exported(4, content="x")], "content: expected 32 hexadecimal digits, got 'x'"),
        ([exported(4, retracted=1)], "retracted: expected true or false, got 1"),
    ],
)
def test_a_file_that_lost_lines_is_refused(tmp_path, lines, message):
    """What was taken back would count again; what was one commit would be two."""
    with pytest.raises(FormatError, match=message):
        plan(tmp_path, *lines)


def test_who_imports_is_told_where_it_is_not_stored(tmp_path):
    """The lines of a log have their own notes, or none."""
    path = tmp_path / "in.jsonl"
    options = lines_of("UTC", Note("eva"))
    warnings = []
    for line in (exported(4), SEEN | {"door_id": 3}):
        path.write_text(json.dumps(line))
        plan = plan_event_lines(path, PRESENT, options, NothingStored(), now_ns=NOON_NS)
        warnings.append([text for text in plan.warnings if "who and why" in text])

    assert [1, 0] == [len(found) for found in warnings]


def test_a_retraction_gets_the_numbers_that_its_events_have_here(tmp_path):
    """The log's next number is 10; what was cut out of the file has none."""
    hide = {"kind": "Retracted", "event": 9, "first_event": 3, "last_event": 8}
    lines = [exported(n, retracted=n > 2) for n in (1, 3, 4, 6)]

    *_, retracted = events_of(plan(tmp_path, *lines, hide))

    assert Retracted(first_event=11, last_event=13) == retracted


def test_a_large_file_is_read_anew_each_time_and_may_not_change(tmp_path, monkeypatch):
    """Its events are not kept, they are too many; what was counted must still be there."""
    monkeypatch.setattr(importing_lines, "MOST_KEPT", 1)
    found = plan(tmp_path, SEEN | {"door_id": 3}, SEEN | {"door_id": 3})
    path = tmp_path / "in.jsonl"
    text = path.read_text()

    assert 2 == len(events_of(found)) == len(events_of(found))
    path.write_text(text + json.dumps(SEEN | {"door_id": 3}))
    assert 3 == len(events_of(found))  # whoever writes them counts them
    path.write_text(text.replace("OPEN", "AJAR"))
    with pytest.raises(FormatError, match=r"in.jsonl:1: "):
        events_of(found)
