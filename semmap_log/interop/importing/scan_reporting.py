"""How far a laser's sightings of doors can be trusted: of kept scans, or of bags looked through."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path, PurePath

from semmap_log.analysis.scans.door_figures import ScanReport, scan_report
from semmap_log.analysis.scans.visit import KeptVisit, Visit, scans_folder
from semmap_log.core.io.progress import Progress
from semmap_log.core.model.doors import DoorId
from semmap_log.errors import FormatError
from semmap_log.interop.formats.kept_scans.reading import has_kept_scans, kept_visits
from semmap_log.interop.formats.kept_scans.writing import keeping_scans
from semmap_log.interop.importing.importing import ImportOptions, plan_scan_import
from semmap_log.interop.topics.lasers.door_places import is_glass
from semmap_log.interop.topics.lasers.scan_keeper import ScanKeeper
from semmap_log.log import DoorLog


@dataclass(slots=True)
class SeenVisits:
    """The visits that a report is about; their scans are read from disk when needed."""

    log: DoorLog
    place: PurePath
    """The scans lie next to it."""
    doors: Collection[DoorId] | None = None
    """None: of all doors."""
    since_ns: int | None = None
    until_ns: int | None = None
    summary: list[str] = field(default_factory=list)
    oddities: list[str] = field(default_factory=list)

    def visits(self, with_scans: Callable[[Visit], bool] | None = None) -> Iterator[KeptVisit]:
        """Yield the visits, as they ended, with the scans of those that are wanted."""
        return self._kept(with_scans or _no_scans, None)

    def report(self) -> ScanReport:
        """Return the figures and warnings of their doors."""
        doors = self.log.replay().doors
        problems: list[str] = []
        visits = [kept.visit for kept in self._kept(_no_scans, problems.append)]
        chosen = doors.keys() if self.doors is None else doors.keys() & set(self.doors)
        return scan_report(
            visits,
            labels=self.log.door_names(),
            placed=[door_id for door_id in chosen if doors[door_id].is_placed],
            glass={door_id for door_id in chosen if is_glass(doors[door_id])},
            summary=self.summary,
            oddities=[*self.oddities, *problems],
        )

    def _kept(
        self, with_scans: Callable[[Visit], bool], tell: Callable[[str], None] | None
    ) -> Iterator[KeptVisit]:
        return kept_visits(
            self.place, self.log.info.log_id, since_ns=self.since_ns, until_ns=self.until_ns,
            doors=self.doors, with_scans=with_scans, tell=tell,
        )  # fmt: skip


@contextmanager
def seen_visits(
    log: DoorLog,
    bags: Sequence[Path],
    options: ImportOptions,
    *,
    doors: Collection[DoorId] | None = None,
    since_ns: int | None = None,
    until_ns: int | None = None,
    progress: Progress | None = None,
) -> Iterator[SeenVisits]:
    """Look through bags, or take the scans that are kept; nothing is written to the log.

    Args:
        log: Whose doors are looked at.
        bags: With scans; none: those kept next to the log.
        options: How bags are read.
        doors: Only these.
        since_ns: Only visits that ended from then on.
        until_ns: Only those that ended before.
        progress: Called with (messages read, messages in all).

    Raises:
        FormatError: A bag cannot be read, or has no scans; or no scans are kept.
        CommandError: No door was there at the time of the scans.
        OutputError: There is no room for the scans of the visits.
    """
    if not bags:
        if not has_kept_scans(log.path):
            raise FormatError(
                scans_folder(log.path),
                "no scans are kept next to this log; name a bag with scans, or keep those of "
                "visits: `record --scan --keep-scans`, `import --scan --keep-scans`",
            )
        yield SeenVisits(log, log.path, doors, since_ns, until_ns)
        return
    with tempfile.TemporaryDirectory(prefix="semmap-log-") as folder:
        seen = SeenVisits(log, Path(folder) / "log", doors, since_ns, until_ns)
        for bag in bags:
            _look_through(seen, bag, options, progress)
        yield seen


def _look_through(
    seen: SeenVisits, bag: Path, options: ImportOptions, progress: Progress | None
) -> None:
    with keeping_scans(seen.place, seen.log.info.log_id) as writer:
        keeper = ScanKeeper(writer)
        found = plan_scan_import(seen.log, bag, options, progress, keeper=keeper)
    if found is None:
        raise FormatError(bag, "its mapping reads no laser: name its topic with --scan")
    seen.summary += found.scans.summary
    seen.oddities += found.scans.warnings


def _no_scans(_: Visit) -> bool:
    return False
