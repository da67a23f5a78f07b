"""When what a message tells happened: its own stamp, where that can be believed."""

from __future__ import annotations

from typing import Any

from semmap_log.io.clock import MAX_TIME_NS


def happened_ns(stamp: Any, received_ns: int, *, within_s: float) -> int | None:
    """Return when it happened, nanoseconds since 1970.

    A stamp counts that lies at most `within_s` before the message came, and not after it: robots
    stamp what they have just measured, and with a clock that is set. A stamp of zero is none; an
    older one may be that of a map that was loaded long ago, or of a clock that is wrong. Then it
    counts when the message came.

    Args:
        stamp: With `sec` and `nanosec`; None: the message has none.
        received_ns: When the message came: by the bag, or by the node's clock, which is `/clock`
            under `use_sim_time`.
        within_s: See above.

    Returns:
        The time; None where nothing is known of it, which makes it the log's own time: a node
        under `use_sim_time` before the first `/clock` says zero.
    """
    if not 0 < received_ns <= MAX_TIME_NS:
        return None
    if stamp is not None:
        told_ns = int(stamp.sec) * 10**9 + int(stamp.nanosec)
        if told_ns > 0 and received_ns - int(within_s * 1e9) <= told_ns <= received_ns:
            return told_ns
    return received_ns
