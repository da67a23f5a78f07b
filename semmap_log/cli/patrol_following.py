"""`patrol-plan --follow`: the next stop after each event of a log that goes on."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

from semmap_log.cli.common import say
from semmap_log.cli.sanitized_streams import is_nobody_reading, json_text, write_line

if TYPE_CHECKING:
    from collections.abc import Callable

    from semmap_log.analysis.planning.followed_round import FollowedRound, RoundStep
    from semmap_log.analysis.planning.round_planner import BegunRound
    from semmap_log.log import DoorLog


def follow(opened: DoorLog, begun: BegunRound, *, as_json: bool) -> None:
    """Print a line for each step, until the round is over, the reader has gone, or Ctrl-C.

    Raises:
        LogError: The log is damaged, or was exchanged.
        BrokenPipeError: Nobody reads any more.
    """
    from semmap_log.analysis.planning.followed_round import FollowedRound, events_since
    from semmap_log.views.patrol_plan_table import over_line

    round_ = FollowedRound(begun, opened.reopened_log)
    show = _shown(begun, round_, as_json=as_json)
    try:
        batches = events_since(opened, begun.plan.start_ns, stop=is_nobody_reading)
        while not round_.is_over:
            batch = next(batches, None)
            if batch is None:
                raise BrokenPipeError
            for step in round_.take(batch):
                show(step)
    except KeyboardInterrupt:
        return  # the way to end it
    if not as_json:
        say(over_line(round_))


def _shown(
    begun: BegunRound, round_: FollowedRound, *, as_json: bool
) -> Callable[[RoundStep], None]:
    """Return what prints a step, and lets go of it at once."""
    from semmap_log.cli.sanitized_streams import is_for_people
    from semmap_log.interop.formats.json.plan_json import step_to_json
    from semmap_log.views.column_table import line_of
    from semmap_log.views.patrol_plan_table import STEP_ROW, step_line, step_row

    plan, for_people = begun.plan, is_for_people()
    if not (as_json or for_people):
        write_line("")
        write_line(line_of(STEP_ROW))
    sys.stdout.flush()

    def show(step: RoundStep) -> None:
        if as_json:
            write_line(json_text(step_to_json(step, round_, plan)))
        elif for_people:
            write_line(step_line(step, plan.tz))
        else:
            write_line(line_of(step_row(step, plan.tz)))
        sys.stdout.flush()

    return show
