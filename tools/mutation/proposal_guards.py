"""What decides that a gap in a wall is proposed as a door, and that two clicks are one."""

from __future__ import annotations

from mutation.mutant import Mutant, guard

_PROPOSED = (
    guard("doors of the log are not proposed", "proposals_of",
          "~_are_known(gaps, doors, level)", "np.ones(len(gaps), bool)", "test_proposals"),
    guard("doors of this level only", "proposals._are_known",
          "doors.levels == level", "doors.levels > -1", "test_proposals"),
    guard("a gap is where beams went", "proposals_of",
          "free >= FREE", "free >= -1", "test_proposals"),
    guard("the floor plan's walls", "proposals_of",
          "walls is None", "True", "test_proposals"),
    guard("a door's width", "_gaps_along",
          "(width >= LEAST_M) & (width <= MOST_M)", "width >= 0", "test_proposals"),
    guard("the middle of a wall", "_once",
          "_across(middles[alike] - middles[i], lines[i, 2])", "0.0", "test_propose_doors"),
    guard("scans of other places", "KeptScans._is_new",
          "moved >= MOVED_M", "True", "test_proposals"),
    guard("no map of half the world", "SweptCells.of",
          "rows * columns > MOST_CELLS", "False", "test_proposals"),
    guard("nothing is added without yes", "cli.proposing.propose",
          "asked.yes and found.proposals", "found.proposals", "test_propose_doors"),
    guard("a number that there is not", "cli.proposing.propose",
          "number > len(found.proposals)", "False", "test_propose_doors"),
)  # fmt: skip

_CLICKED = (
    guard("a door's width, clicked", "ClickedDoors.events",
          "LEAST_M <= width <= MOST_M", "True", "test_clicked_doors"),
    guard("a door that is there, clicked", "ClickedDoors.events",
          "there is not None", "False", "test_clicked_doors"),
    guard("clicks in the map's frame", "ClickedDoors._click",
          "frame != self._context.mapping.map_frame", "False", "test_clicked_doors"),
    guard("clicks on this level", "ClickedDoors._click",
          "low <= point.z <= high", "True", "test_clicked_doors"),
    guard("a second click in time", "ClickedDoors._is_late",
          "0 <= waited_s <= self._rule.within_s", "True", "test_clicked_doors"),
    guard("clicks only where asked for", "RosMapping.with_clicks",
          "isinstance(rule.reading, ReadClicks)", "False", "test_clicked_doors"),
)  # fmt: skip

PROPOSALS: tuple[Mutant, ...] = (*_PROPOSED, *_CLICKED)
