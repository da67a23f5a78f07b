"""What a recording without doors says in their place: what to do."""

from __future__ import annotations

from semmap_log.views.excerpt.span import Excerpt
from semmap_log.views.how_to_begin import NOT_IN_THIS_PART, how_to_begin
from semmap_log.views.rerun.drawable import drawable
from semmap_log.views.rerun.rerun_sdk import rr
from semmap_log.views.rerun.rows import RowWriter
from semmap_log.views.rerun.scene import Scene

NOTHING = "nothing"


def write_nothing(writer: RowWriter, excerpt: Excerpt, scene: Scene) -> None:
    """Write why there are no doors, if there are none."""
    if scene.doors:
        return
    said = how_to_begin(excerpt.log) or NOT_IN_THIS_PART
    lines = [drawable(line) for line in said.splitlines()]
    writer.static((NOTHING,), rr.TextDocument("\n".join(lines), media_type="text/plain"))
