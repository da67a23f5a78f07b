"""Which doors a trip can lead through: those on a way that comes to no room twice."""

from __future__ import annotations

from collections import defaultdict

from semmap_log.analysis.rooms import OUTSIDE, RoomGraph, RoomId
from semmap_log.core.model.doors import DoorId

Pair = frozenset[RoomId]


def doors_between(graph: RoomGraph, start: RoomId, goal: RoomId) -> list[DoorId]:
    """Return the doors on the ways between two rooms, ascending; none: they are one room.

    Nobody goes into a room and back into the one from which they came: of all doors these are few.
    The outside is on no way but one that begins or ends there.
    """
    if start == goal:
        return []
    doors = _doors_of_pairs(graph, {start, goal})
    wanted = frozenset((start, goal))
    pairs = set(doors) | {wanted}
    block = next(block for block in _blocks(pairs, start) if wanted in block)
    return sorted(door for pair in block for door in doors.get(pair, ()))


def _doors_of_pairs(graph: RoomGraph, ends: set[RoomId]) -> dict[Pair, list[DoorId]]:
    """Return the doors between each two rooms; a lift joins rooms without one."""
    doors: defaultdict[Pair, list[DoorId]] = defaultdict(list)
    for door_id, doorway in graph.doorways.items():
        if doorway.joins_two and graph.lift_of(door_id) is None:
            doors[frozenset((doorway.left, doorway.right))].append(door_id)  # type: ignore[arg-type]
    for lift in graph.lifts:
        stops = [graph.doorways[door] for door in lift.doors if door in graph.doorways]
        rooms = {side for each in stops for side in (each.left, each.right) if side is not None}
        for one in rooms:
            for other in rooms - {one}:
                doors[frozenset((one, other))] += []
    return {pair: ids for pair, ids in doors.items() if OUTSIDE not in pair or OUTSIDE in ends}


def _blocks(pairs: set[Pair], start: RoomId) -> list[set[Pair]]:
    """Return the parts of a graph that no single room's loss divides, as sets of their edges.

    J. Hopcroft, R. Tarjan, Commun. ACM 16, 1973; without recursion.
    """
    beside: defaultdict[RoomId, list[RoomId]] = defaultdict(list)
    for one, other in sorted(tuple(sorted(pair)) for pair in pairs):
        beside[one].append(other)
        beside[other].append(one)
    depth, low = {start: 0}, {start: 0}
    path, edges, blocks = [(start, iter(beside[start]))], list[Pair](), list[set[Pair]]()
    while path:
        here, onward = path[-1]
        there = next(onward, None)
        before = path[-2][0] if len(path) > 1 else None
        if there is None:
            path.pop()
            if before is not None:
                low[before] = min(low[before], low[here])
                if low[here] >= depth[before]:
                    cut = edges.index(frozenset((before, here)))
                    blocks.append(set(edges[cut:]))
                    del edges[cut:]
        elif there not in depth:
            depth[there] = low[there] = len(path)
            edges.append(frozenset((here, there)))
            path.append((there, iter(beside[there])))
        elif there != before and depth[there] < depth[here]:
            low[here] = min(low[here], depth[there])
            edges.append(frozenset((here, there)))
    return blocks
