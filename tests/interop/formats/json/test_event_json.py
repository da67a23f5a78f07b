"""One event as one JSON object, both ways."""

import json

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from semmap_log.core.batches.event_batch import RecordedEvent
from semmap_log.core.io.clock import MAX_TIME_NS
from semmap_log.core.model.doors import MAX_DOOR_ID, NAN, DoorId, DoorState
from semmap_log.core.model.events import (
    KINDS,
    MAX_EVENT,
    Changed,
    ClassDefined,
    DoorAdded,
    DoorAnnotated,
    DoorObserved,
    DoorPassed,
    DoorRemoved,
    DoorRequested,
    DoorUpdated,
    Event,
    FloorMap,
    HistoryTrimmed,
    LevelAdded,
    LogExported,
    MomentPinned,
    PatrolFinished,
    PatrolStarted,
    Retracted,
    RobotPose,
    SightingsThinned,
)
from semmap_log.core.model.meaning import ALL_CHANGED
from semmap_log.errors import FormatError, UnknownDoorError
from semmap_log.interop.formats.json.door_json import event_to_json
from semmap_log.interop.formats.json.event_json_reader import DoorLookup, parse_event_line
from semmap_log.interop.formats.parsing.foreign_file import FileOrder

NOON_NS = 1_772_366_400 * 10**9
NOON = "2026-03-01T12:00:00.000000000Z"


def no_door(text):
    raise UnknownDoorError(f"no door is called {text!r}.")


LOOKUP = DoorLookup(
    resolve=lambda text: DoorId(7) if text == "front" else no_door(text),
    next_id=lambda: DoorId(42),
    level_of=lambda door_id: 2 if door_id == 7 else 0,
    level=lambda text: 0 if text is None else {"Ground": 2}[text],
)


def parse(values):
    text = values if isinstance(values, (str, bytes)) else json.dumps(values)
    return parse_event_line(
        text, order=FileOrder("Europe/Vienna"), lookup=LOOKUP, path="in.jsonl", line=5
    )


def test_the_example_of_the_design():
    """A sighting: one accuracy for both, the state by name, the time as ISO-8601 UTC."""
    event = DoorObserved(
        door_id=DoorId(1), state=DoorState.OPEN, accuracy_open=0.9, accuracy_closed=0.9,
        happened_ns=NOON_NS,
    )  # fmt: skip
    shown = {"kind": "DoorObserved", "door_id": 1, "state": "OPEN", "opening": None,
             "accuracy": 0.9, "happened": NOON}  # fmt: skip

    assert shown == event_to_json(event)
    assert event == parse(shown).event
    assert event == parse('{"kind": "DoorObserved", "door_id": 1, "state": "open", '
                          '"accuracy": 0.9, "happened": "2026-03-01T13:00"}').event  # fmt: skip


def test_a_recorded_event_shows_its_number_and_when_the_log_learnt_it():
    """With the commit's note: only what it says."""
    recorded = RecordedEvent(12, NOON_NS + 1, DoorRemoved(door_id=DoorId(3), happened_ns=NOON_NS))

    shown = event_to_json(recorded, note={"actor": "eva", "reason": "walled up", "source": ""})

    assert {"event": 12, "kind": "DoorRemoved", "door_id": 3, "happened": NOON,
            "recorded": "2026-03-01T12:00:00.000000001Z",
            "actor": "eva", "reason": "walled up"} == shown  # fmt: skip
    line = parse(shown | {"command_id": "00" * 15 + "fF"})
    assert recorded.event == line.event
    assert (12, NOON_NS + 1) == (line.number, line.recorded_ns)
    assert ("eva", "walled up", "") == (line.note.actor, line.note.reason, line.note.source)
    assert bytes(15) + b"\xff" == line.command_id


def test_an_update_shows_only_what_it_changes():
    """And says which that is, in words."""
    event = DoorUpdated(
        door_id=DoorId(1), changed=Changed.STATE | Changed.PROB_OPEN, state=DoorState.OPEN,
        prob_open=NAN, width=99.0,
    )  # fmt: skip

    assert {"kind": "DoorUpdated", "door_id": 1, "state": "OPEN", "prob_open": None,
            "changed": ["STATE", "PROB_OPEN"]} == event_to_json(event)  # fmt: skip


def test_what_an_update_changes_is_seen_from_its_keys():
    """A position without a level stays on the door's own."""
    line = {"kind": "DoorUpdated", "door": "front", "x": 1, "y": 2.5, "theta": 0}

    event = parse(line).event

    assert DoorUpdated(door_id=DoorId(7), changed=Changed.POSE, level=2,
                       x=1.0, y=2.5, theta=0.0) == event  # fmt: skip
    assert event == parse(line | {"changed": ["POSE"], "level": 2}).event
    assert 1 == parse(line | {"level": 1}).event.level


def test_a_new_door_needs_no_id():
    """It gets the next free one."""
    assert DoorAdded(door_id=DoorId(42)) == parse('{"kind": "DoorAdded"}').event


def test_a_salt_is_never_shown():
    """It keeps redacted texts from being guessed."""
    event = DoorAnnotated(door_id=DoorId(1), key="name", value="Küche", salt=b"secret")

    assert {"kind": "DoorAnnotated", "door_id": 1, "key": "name", "value": "Küche"} == (
        event_to_json(event)
    )


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "in.jsonl:5: expected one JSON object a line: .*, at character 1$"),
        ("[1]", "in.jsonl:5: expected a JSON object, got"),
        ("null", "expected a JSON object, got None"),
        (b"\xff", "expected UTF-8 text, got byte 0xff"),
        ("[" * 200_000, "nested without end"),
        ('{"kind": ' * 200_000, "nested without end"),
        ('{"kind": "DoorRemoved", "door_id": ' + "9" * 5000 + "}", "at most 400 digits, got 5000"),
        ('{"kind": "DoorRemoved", "door_id": 1, "door_id": 2}', "key 'door_id' is there twice"),
        ('{"kind": "RobotPose", "x": NaN}', "expected a finite number, got NaN; write null"),
        ('{"kind": "RobotPose", "x": -Infinity}', "expected a finite number, got -Infinity"),
        ('{"kind": "RobotPose", "x": 1e999}', "expected a number below 1.8e308, got '1e999'"),
        ('{"kind": "DoorOpened"}', "kind: expected DoorObserved; got 'DoorOpened'"),
        ("{}", "kind: expected one of DoorAdded, .* got None"),
    ],
)
def test_what_is_no_event_is_said(text, message):
    """Where, what was expected, what was got."""
    with pytest.raises(FormatError, match=message):
        parse(text)


SEEN = {"kind": "DoorObserved", "door_id": 1, "state": "OPEN"}
PLAN = event_to_json(FloorMap(resolution=0.05, origin_x=0.0, origin_y=0.0,
                              cells=np.zeros((2, 3), np.int8)))  # fmt: skip


@pytest.mark.parametrize(
    ("values", "message"),
    [
        (SEEN | {"colour": "red"},
         "unknown key 'colour': DoorObserved has the keys happened, door_id, state, accuracy_open"),
        (SEEN | {"salt": "x"}, "unknown key 'salt'"),
        (SEEN | {"happend": 1}, r"unknown key 'happend' \(did you mean happened\?\)"),
        ({"kind": "DoorObserved", "door_id": 1, "stat": "OPEN"},
         r"unknown key 'stat' \(did you mean state\?\): DoorObserved has"),
        ({"kind": "DoorObserved", "dor": "front", "state": "OPEN"},
         r"unknown key 'dor' \(did you mean door\?\)"),
        ({"kind": "FloorMap", "resolutoin": 0.1}, r"did you mean resolution\?"),
        ({"kind": "DoorUpdated", "door_id": 1, "widht": 0.9}, r"did you mean width\?"),
        ({"kind": "DoorObserved", "door": 0, "state": "OPEN"},
         'door: expected a name, or level/name, as text, got 0; .* "door_id": 0'),
        ({"kind": "DoorObserved", "door": True, "state": "OPEN"},
         "door: expected a text, got True"),
        (SEEN | {"state": "AJAR"}, "state: expected one of UNKNOWN OPEN CLOSED MOVING OFFLINE"),
        (SEEN | {"state": 1}, "state: expected a text, got 1"),
        (SEEN | {"accuracy": 0.4}, "accuracy_open: expected a number from 0.5 to 1, got 0.4"),
        (SEEN | {"accuracy": "0.9"}, "accuracy: expected a number or null, got '0.9'"),
        (SEEN | {"accuracy": 0.9, "accuracy_open": 0.9}, "leave one form out"),
        (SEEN | {"opening": True}, "opening: expected a number or null, got True"),
        (SEEN | {"door_id": 1.5}, "door_id: expected a whole number, got 1.5"),
        (SEEN | {"door_id": -1}, "door_id: expected a whole number from 0 to"),
        (SEEN | {"door_id": 2**32}, "door_id: expected a whole number from 0 to"),
        (SEEN | {"door": "front"}, "expected it or door_id, got both"),
        ({"kind": "DoorRemoved", "door": "back"}, "in.jsonl:5: no door is called 'back'"),
        ({"kind": "DoorRemoved"}, "DoorRemoved: expected door_id, or door with a name"),
        ({"kind": "DoorAdded", "door": "front"}, "DoorAdded: expected door_id, or none"),
        ({"kind": "DoorObserved", "door_id": 1}, "DoorObserved: expected the key state, got none"),
        (SEEN | {"happened": "soon"}, "Expected a time such as 2026-03-01T14:02"),
        (SEEN | {"happened": [1]}, "happened: expected a time as ISO-8601 text or a number"),
        (SEEN | {"happened": "1960-01-01"}, "from 1970 to 2262"),
        (SEEN | {"command_id": "12"}, "command_id: expected 32 hexadecimal digits, got '12'"),
        (SEEN | {"actor": 7}, "actor: expected a text, got 7"),
        (SEEN | {"actor": "\ud800"}, "actor: expected text that UTF-8 can hold"),
        ({"kind": "DoorUpdated", "door_id": 1}, "expected at least one of x, y, theta"),
        ({"kind": "DoorUpdated", "door_id": 1, "x": 1}, "expected x, y and theta together"),
        ({"kind": "DoorUpdated", "door_id": 1, "level": 1}, "expected x, y and theta together"),
        ({"kind": "DoorUpdated", "door_id": 1, "width": 1, "changed": ["STATE"]},
         r"changed: expected \['WIDTH'\] as the other keys say, got \['STATE'\]"),
        ({"kind": "DoorPassed", "door_id": 1, "passed": 1}, "passed: expected true or false"),
        ({"kind": "RobotPose", "x": 10**350, "y": 0, "theta": 0}, "x: expected a number below"),
        (PLAN | {"width": 4}, "cells_zlib_base64: expected 8 cells of 4 x 2, got 6"),
        (PLAN | {"width": -1}, "expected at most 100,000,000 cells"),
        (PLAN | {"width": 10**6, "height": 10**6}, "expected at most 100,000,000 cells"),
        (PLAN | {"cells_zlib_base64": "AAAA"}, "expected zlib data"),
        (PLAN | {"cells_zlib_base64": "€"}, "cells_zlib_base64: "),
        ({"kind": "FloorMap", "level": 1}, "FloorMap: expected the key resolution, got none"),
    ],
)  # fmt: skip
def test_what_is_wrong_with_an_event_is_said(values, message):
    """One wrong key each."""
    with pytest.raises(FormatError, match=message):
        parse(values)


ids = st.integers(1, MAX_DOOR_ID).map(DoorId)
states = st.sampled_from(DoorState)
reals = st.floats(allow_nan=False, allow_infinity=False)
shares = st.floats(0, 1) | st.just(NAN)
lengths = st.floats(min_value=0, allow_infinity=False)
texts = st.text(st.characters(exclude_categories=["Cs"], exclude_characters="\0"))
levels = st.integers(0, 65_000)
changes = st.builds(
    dict, changed=st.integers(1, int(ALL_CHANGED)).map(Changed), level=levels, x=reals, y=reals,
    theta=reals, width=lengths, state=states, prob_open=shares, prob_closed=shares,
)  # fmt: skip


def updated(door_id, values):
    """Return the update with nothing in the fields that it does not change."""
    kept = {"POSE": ("level", "x", "y", "theta")}
    names = {"changed"}
    for bit in Changed:
        if bit in values["changed"]:
            names |= set(kept.get(bit.name, (bit.name.lower(),)))
    return DoorUpdated(door_id=door_id, **{k: v for k, v in values.items() if k in names})


EVENTS = {
    DoorAdded: st.builds(DoorAdded, door_id=ids, level=levels, x=reals, y=reals, theta=reals,
                         width=lengths, state=states, prob_open=shares, prob_closed=shares)
    | st.builds(DoorAdded, door_id=ids, state=states),
    DoorUpdated: st.builds(updated, ids, changes),
    DoorRemoved: st.builds(DoorRemoved, door_id=ids),
    DoorObserved: st.builds(DoorObserved, door_id=ids, state=states, opening=shares,
                            accuracy_open=st.floats(0.5, 1), accuracy_closed=st.floats(0.5, 1)),
    DoorRequested: st.builds(DoorRequested, door_id=ids, state=states),
    DoorPassed: st.builds(DoorPassed, door_id=ids, passed=st.booleans(), waited_s=lengths),
    PatrolStarted: st.builds(PatrolStarted, patrol=st.integers(0, 2**32 - 1)),
    PatrolFinished: st.builds(PatrolFinished, patrol=st.integers(0, 2**32 - 1)),
    RobotPose: st.builds(RobotPose, level=levels, x=reals, y=reals, theta=reals, sd_xy=lengths),
    Retracted: st.builds(lambda one, two: Retracted(first_event=min(one, two),
                                                    last_event=max(one, two)),
                         st.integers(0, MAX_EVENT), st.integers(0, MAX_EVENT)),
    DoorAnnotated: st.builds(DoorAnnotated, door_id=ids, key=texts.filter(bool), value=texts),
    LevelAdded: st.builds(LevelAdded, level=levels, name=texts, elevation=reals | st.just(NAN)),
    FloorMap: st.builds(FloorMap, level=levels, resolution=st.floats(1e-3, 1e3), origin_x=reals,
                        origin_y=reals, origin_theta=reals,
                        cells=st.tuples(st.integers(0, 4), st.integers(0, 4)).map(
                            lambda shape: np.full(shape, -1, np.int8))),
    LogExported: st.builds(LogExported, format=texts, file_name=texts,
                           at_ns=st.integers(0, MAX_TIME_NS)),
    HistoryTrimmed: st.builds(HistoryTrimmed, next_event=ids, events_gone=ids, notes_gone=ids,
                              horizon=ids, reasons=texts, rule=texts, tombstones=texts),
    SightingsThinned: st.builds(SightingsThinned, door_id=ids, state=states,
                                count=st.integers(1, 2**32 - 1),
                                first_ns=st.integers(0, MAX_TIME_NS),
                                last_ns=st.integers(0, MAX_TIME_NS), first_event=ids),
    MomentPinned: st.builds(MomentPinned, at_ns=st.integers(0, MAX_TIME_NS), next_event=ids,
                            name=texts, keyframe=texts),
    ClassDefined: st.builds(ClassDefined, class_name=st.sampled_from(["dock", "Spülbecken"]),
                            geometry=st.sampled_from(["segment", "polygon", "point"]),
                            states=st.just("free,taken"),
                            blocks=st.sampled_from(["", "taken", "free,taken"])),
}  # fmt: skip


def test_every_kind_is_tried_below():
    """A new kind of event fails here until it is."""
    assert set(KINDS) == set(EVENTS)


@settings(suppress_health_check=[HealthCheck.too_slow])
@given(st.one_of(*EVENTS.values()), st.none() | st.integers(0, MAX_TIME_NS))
def test_every_event_survives_a_round_trip(event: Event, happened_ns):
    """Through JSON text, exactly; absent numbers stay absent."""
    object.__setattr__(event, "happened_ns", happened_ns)

    text = json.dumps(event_to_json(event), allow_nan=False)

    back = parse(text).event
    # NaN is not equal to itself, but its text is.
    assert repr(event) == repr(back)
    assert happened_ns == back.happened_ns
