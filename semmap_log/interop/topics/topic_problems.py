"""What is wrong with messages: told once for each kind, counted, summed up at the end."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field


@dataclass(slots=True)
class TopicProblems:
    """A count for each topic and kind of trouble, with what was seen first."""

    tell: Callable[[str], None] = lambda _: None
    """Hears of each kind when it comes for the first time."""
    _counts: Counter[tuple[str, str]] = field(default_factory=Counter)
    _first: dict[tuple[str, str], str] = field(default_factory=dict)

    def add(self, topic: str, kind: str, example: object = "") -> None:
        """Note trouble.

        Args:
            topic: Where.
            kind: What, without values: so many kinds there are, so many lines.
            example: The values.
        """
        key = (topic, kind)
        self._counts[key] += 1
        if key not in self._first:
            self._first[key] = str(example)[:MOST_SHOWN]
            self.tell(self._line(key))

    def __len__(self) -> int:
        return self._counts.total()

    def lines(self) -> tuple[str, ...]:
        """Return each kind with how often it came."""
        return tuple(
            self._line(key) + (f" ({count:,} times)" if count > 1 else "")
            for key, count in sorted(self._counts.items())
        )

    def _line(self, key: tuple[str, str]) -> str:
        example = f": {self._first[key]}" if self._first[key] else ""
        return f"{key[0]}: {key[1]}{example}"


MOST_SHOWN = 200
