"""Events of every kind, as hypothesis draws them."""

from __future__ import annotations

import math

import numpy as np
from hypothesis import strategies as st

from semmap_log.core.model.doors import MAX_DOOR_ID, MAX_LEVEL, DoorId, DoorState
from semmap_log.core.model.events import (
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
)
from semmap_log.core.model.meaning import ALL_CHANGED

numbers = st.floats(allow_nan=False, allow_infinity=False)
lengths = st.floats(0, 1e6)
shares = st.floats(0, 1) | st.just(math.nan)
accuracies = st.floats(0.5, 1)
times = st.integers(0, 2**63 - 1)
doors = st.integers(0, MAX_DOOR_ID).map(DoorId)
levels = st.integers(0, MAX_LEVEL)
states = st.sampled_from(DoorState)
texts = st.text(st.characters(exclude_characters="\0", exclude_categories=["Cs"]), max_size=30)


@st.composite
def added(draw: st.DrawFn) -> DoorAdded:
    placed = draw(st.booleans())
    place = {"x": draw(numbers), "y": draw(numbers), "theta": draw(numbers), "width": draw(lengths)}
    return DoorAdded(
        happened_ns=draw(times),
        door_id=draw(doors),
        level=draw(levels),
        state=draw(states),
        prob_open=draw(shares),
        prob_closed=draw(shares),
        **(place if placed else {}),
    )


@st.composite
def updated(draw: st.DrawFn) -> DoorUpdated:
    return DoorUpdated(
        happened_ns=draw(times),
        door_id=draw(doors),
        changed=Changed(draw(st.integers(1, int(ALL_CHANGED)))),
        level=draw(levels),
        x=draw(numbers),
        y=draw(numbers),
        theta=draw(numbers),
        width=draw(lengths),
        state=draw(states),
        prob_open=draw(shares),
        prob_closed=draw(shares),
    )


@st.composite
def floor_maps(draw: st.DrawFn) -> FloorMap:
    height, width = draw(st.integers(0, 5)), draw(st.integers(0, 5))
    cells = draw(st.lists(st.integers(-1, 100), min_size=height * width, max_size=height * width))
    return FloorMap(
        happened_ns=draw(times),
        level=draw(levels),
        resolution=draw(st.floats(2**-10, 8, width=32)),
        origin_x=draw(numbers),
        origin_y=draw(numbers),
        cells=np.array(cells, np.int8).reshape(height, width),
    )


patrols = st.integers(0, 2**32 - 1)

fixed_size = st.one_of(
    added(),
    updated(),
    st.builds(DoorRemoved, happened_ns=times, door_id=doors),
    st.builds(
        DoorObserved,
        happened_ns=times,
        door_id=doors,
        state=states,
        accuracy_open=accuracies,
        accuracy_closed=accuracies,
        opening=shares,
    ),
    st.builds(DoorRequested, happened_ns=times, door_id=doors, state=states),
    st.builds(DoorPassed, happened_ns=times, door_id=doors, passed=st.booleans(), waited_s=lengths),
    st.builds(PatrolStarted, happened_ns=times, patrol=patrols),
    st.builds(PatrolFinished, happened_ns=times, patrol=patrols),
    st.builds(
        RobotPose,
        happened_ns=times,
        level=levels,
        x=numbers,
        y=numbers,
        theta=numbers,
        sd_xy=lengths,
        sd_theta=lengths,
    ),
    st.integers(0, 2**63 - 1).flatmap(
        lambda last: st.builds(
            Retracted, happened_ns=times, first_event=st.integers(0, last), last_event=st.just(last)
        )
    ),
)

with_objects = st.one_of(
    st.builds(
        DoorAnnotated,
        happened_ns=times,
        door_id=doors,
        key=texts.filter(bool),
        value=texts,
        salt=st.binary(min_size=16, max_size=16),
    ),
    st.builds(LevelAdded, happened_ns=times, level=levels, name=texts, elevation=numbers),
    st.builds(LogExported, happened_ns=times, format=texts, file_name=texts, at_ns=times),
    st.builds(
        HistoryTrimmed,
        happened_ns=times,
        next_event=times,
        events_gone=times,
        notes_gone=times,
        horizon=times,
        reasons=texts,
        rule=texts,
        tombstones=texts,
    ),
    st.builds(
        MomentPinned, happened_ns=times, at_ns=times, next_event=times, name=texts, keyframe=texts
    ),
    st.builds(
        ClassDefined,
        happened_ns=times,
        class_name=st.sampled_from(["dock", "spill"]),
        geometry=st.sampled_from(["segment", "polygon", "point"]),
        states=st.just("free,taken"),
        blocks=st.sampled_from(["", "taken"]),
    ),
    floor_maps(),
)

events: st.SearchStrategy[Event] = fixed_size | with_objects


def same(one: object, other: object) -> bool:
    """Tell whether two events are equal, NaN being equal to NaN."""
    return repr(one) == repr(other)
