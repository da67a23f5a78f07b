"""What a map without probabilities believes: the last word, as sure as who said it."""

from __future__ import annotations

import numpy as np
import pytest

from semmap_log.analysis.probabilities.evidence.evidence import Evidence
from semmap_log.analysis.probabilities.forecast import Forecast
from semmap_log.analysis.probabilities.methods.last import Last
from semmap_log.core.model.local_clock import LocalClock
from tests.analysis.probabilities.telling import DAY_NS, DOOR, added, ns_of, put, seen, told_of

UTC = LocalClock("UTC")


def said(told: Evidence, *known_s: float, ahead_ns: int = 0) -> Forecast:
    known_ns = np.array([ns_of(second) for second in known_s])
    return Last().learn(told.up_to(2**62), UTC).predict(DOOR, known_ns + ahead_ns, known_ns)


WORDS = (added(), put("closed", 10), put("open", 20), put("closed", 30), put("unknown", 40))


@pytest.mark.parametrize(
    ("known_s", "expected"),
    [(9, 0.5), (10, 0.001), (19, 0.001), (20, 0.999), (29, 0.999), (31, 0.001), (41, 0.001)],
)
def test_it_is_the_last_word_by_then(known_s: float, expected: float) -> None:
    """Unknown before the first one; an outage is no word; a forecast is of its own time."""
    told = told_of(*WORDS)
    now, back = said(told, known_s), said(told, known_s + 100, ahead_ns=-100 * 10**9)

    assert [expected] == now.p_open.tolist() == back.p_open.tolist()
    assert [known_s >= 10] == now.is_known.tolist()


def test_it_never_fades() -> None:
    """A year later it says the same, and as surely: that is what is wrong with it."""
    told = told_of(added(), put("open", 10))

    found = said(told, 20, ahead_ns=365 * DAY_NS)

    assert (0.999, 0.999, 0.999) == (found.low[0], found.p_open[0], found.high[0])


@pytest.mark.parametrize(
    ("state", "accuracy", "expected"),
    [("open", 0.9, 0.9), ("closed", 0.9, 0.1), ("open", (0.6, 0.9), 6 / 7),
     ("closed", (0.6, 0.9), 4 / 13), ("open", 0.5, 0.5)],
)  # fmt: skip
def test_a_reading_is_as_sure_as_its_sensor(
    state: str, accuracy: float | tuple[float, float], expected: float
) -> None:
    """P(open) by that reading alone, with what the sensor misses and what it invents."""
    told = told_of(added(), seen(state, 10, accuracy))

    found = said(told, 20)

    assert expected == pytest.approx(found.p_open[0])
