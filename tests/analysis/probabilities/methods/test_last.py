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


def test_it_is_the_last_word_by_then() -> None:
    """Unknown before the first one, and then what was said last, at that moment too."""
    told = told_of(added(), put("closed", 10), put("open", 20), put("closed", 30))

    found = said(told, 9, 10, 19, 20, 29, 31)

    assert [0.5, 0.001, 0.001, 0.999, 0.999, 0.001] == found.p_open.tolist()
    assert [False, True, True, True, True, True] == found.is_known.tolist()


def test_it_never_fades() -> None:
    """A year later it says the same, and as surely: that is what is wrong with it."""
    told = told_of(added(), put("open", 10))

    found = said(told, 20, ahead_ns=365 * DAY_NS)

    assert (0.999, 0.999, 0.999) == (found.low[0], found.p_open[0], found.high[0])


def test_an_outage_does_not_end_it() -> None:
    """A state that was set to UNKNOWN is nothing new: the last one stays."""
    told = told_of(added(), put("open", 10), put("unknown", 20))

    found = said(told, 30)

    assert 0.999 == found.p_open[0]


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


def test_what_is_later_than_the_forecast_does_not_count() -> None:
    """A forecast of a time before what is known is of that time."""
    told = told_of(added(), put("closed", 10), put("open", 20))

    found = said(told, 25, ahead_ns=-10 * 10**9)

    assert 0.001 == found.p_open[0]
