"""What of a log tells of persons, or may: for `info`, and for who decides what is redacted."""

from __future__ import annotations

from collections import Counter
from dataclasses import field

from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.lazy.late_dataclass import dataclass
from semmap_log.core.model.commits import Note
from semmap_log.core.model.events import DoorAnnotated, PatrolStarted, RobotPose


@dataclass(slots=True)
class PersonalData:
    """Counts of what names somebody, says where a robot was, or is free text."""

    notes: int = 0
    """Commits that tell who did it, with what, or why."""
    actors: Counter[str] = field(default_factory=Counter)
    """Who did it -> notes."""
    sources: Counter[str] = field(default_factory=Counter)
    """With what -> notes."""
    reasons: int = 0
    """Notes that tell why, in words."""
    annotations: Counter[str] = field(default_factory=Counter)
    """Key -> how often something was said of a door under it; names of doors, too."""
    poses: int = 0
    """Where the robot was, and when."""
    patrols: int = 0
    """Rounds that began: when somebody was about."""

    def __bool__(self) -> bool:
        """Return whether there is any."""
        return bool(self.notes or self.annotations or self.poses or self.patrols)

    def take(self, batch: EventBatch) -> None:
        """Count what events tell, those that were taken back, too: they still can be read."""
        for event in batch.objects.get(DoorAnnotated.kind, ()):
            assert isinstance(event, DoorAnnotated), "that is its kind"
            if event.value:
                self.annotations[event.key] += 1
        self.poses += len(batch.where(RobotPose))
        self.patrols += len(batch.where(PatrolStarted))

    def take_note(self, note: Note) -> None:
        """Count what the note of a commit tells."""
        self.notes += bool(note)
        self.actors.update([note.actor] * bool(note.actor))
        self.sources.update([note.source] * bool(note.source))
        self.reasons += bool(note.reason)
