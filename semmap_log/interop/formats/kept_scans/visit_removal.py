"""Takes visits and their scans, which tell where the robot was, out of a file beside a log."""

from __future__ import annotations

from bisect import bisect_right
from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from semmap_log.analysis.scans.kept_visit import VISITS_TOPIC
from semmap_log.analysis.scans.visit import Visit
from semmap_log.core.io.disk import output_errors, sync_folder, whole_file
from semmap_log.interop.formats.kept_scans.reading import (
    AnotherLogError,
    FileReader,
    ScanChannel,
    visit_in,
)
from semmap_log.interop.formats.kept_scans.writing import VisitFile
from semmap_log.interop.formats.parsing.foreign_file import open_regular

Goes = Callable[[Visit], bool]
Laser = tuple[str, str]
"""Robot and laser; empty: what is of no laser."""


@dataclass(frozen=True, slots=True)
class VisitsInFile:
    """Which visits of a file of kept scans go."""

    path: Path
    going: int
    """How many."""
    staying: Mapping[Laser, _Spans]
    """When the others were."""
    robots: frozenset[str]
    """The robots of those that go."""
    problem: str = ""
    """Why it could not be read to its end."""


def visits_in_file(path: Path, log_id: str, goes: Goes) -> VisitsInFile | None:
    """Return which visits of a file go; None: it is not known to be of that log.

    Args:
        path: The file.
        log_id: The log's identity.
        goes: Tells whether a visit goes.

    Raises:
        FormatError: It cannot be opened.
    """
    going, robots, problem = 0, set[str](), ""
    staying: defaultdict[Laser, list[tuple[int, int]]] = defaultdict(list)
    with open_regular(path) as file:
        reader = FileReader(file)
        try:
            for told in reader.visits(log_id):
                visit = told.visit
                if goes(visit):
                    going += 1
                    robots.add(visit.robot)
                else:
                    for of in ((visit.robot, visit.laser), ("", "")):
                        staying[of].append((visit.first_ns, visit.last_ns))
        except AnotherLogError:
            return None
        except ValueError as error:
            problem = str(error)
    if not reader.is_ours:
        return None
    spans = {of: _Spans(some) for of, some in staying.items()}
    return VisitsInFile(path, going, spans, frozenset(robots), problem)


def take_out_visits(found: VisitsInFile, log_id: str, goes: Goes) -> None:
    """Take visits out of a file, with the scans that are theirs alone; without others, remove it.

    Args:
        found: What `visits_in_file` returned.
        log_id: The log's identity.
        goes: Tells whether a visit goes.

    Raises:
        OutputError: It cannot be written, or removed; it is as it was.
        ValueError: It is damaged; it is as it was.
    """
    path = found.path
    with output_errors(path):
        if found.staying:
            _write_staying(found, log_id, goes)
            return
        path.unlink()
        sync_folder(path.parent)
        with suppress(OSError):  # something else is in it
            path.parent.rmdir()


def _write_staying(found: VisitsInFile, log_id: str, goes: Goes) -> None:
    """Write the file anew; each message that stays keeps its bytes."""
    with open_regular(found.path) as file, whole_file(found.path) as temporary:
        made = VisitFile(temporary, temporary.open("wb"), log_id)
        for channel, at_ns, data in FileReader(file).messages(log_id):
            if not _stays(found, goes, channel, at_ns, data):
                continue
            made.write(channel.topic, channel.ros_type, channel.of, at_ns, data)
            if channel.topic == VISITS_TOPIC:
                made.flush()  # a visit is a chunk
        made.close()


def _stays(found: VisitsInFile, goes: Goes, channel: ScanChannel, at_ns: int, data: bytes) -> bool:
    if channel.topic == VISITS_TOPIC:
        return not goes(visit_in(data).visit)
    return channel.of in found.staying and at_ns in found.staying[channel.of]


class _Spans:
    """Stretches of time, both ends included."""

    def __init__(self, spans: Iterable[tuple[int, int]]) -> None:
        self._firsts, self._lasts = list[int](), list[int]()
        for first, last in sorted(spans):
            if self._lasts and first <= self._lasts[-1]:
                self._lasts[-1] = max(self._lasts[-1], last)
            else:
                self._firsts.append(first)
                self._lasts.append(last)

    def __contains__(self, at_ns: int) -> bool:
        place = bisect_right(self._firsts, at_ns) - 1
        return place >= 0 and at_ns <= self._lasts[place]
