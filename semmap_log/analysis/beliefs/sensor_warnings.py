"""Sensors that are not as accurate as declared: said whenever somebody asks what to believe.

The numbers stay those of what is declared. What is learnt from the readings alone may be the door:
only who knows the true state can tell, and declares what `calibrate` finds.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterable
from dataclasses import replace

from semmap_log.analysis.probabilities.evidence.evidence import Evidence
from semmap_log.analysis.probabilities.sensors.sensor_doubts import SensorDoubt, sensor_doubts
from semmap_log.core.model.doors import DoorId
from semmap_log.core.texts import command_line
from semmap_log.core.users_line import frames_of_ours
from semmap_log.errors import SensorWarning
from semmap_log.log.door_log.door_log import DoorLog


def warn_of_sensors(
    log: DoorLog, evidence: Evidence, door_ids: Iterable[DoorId], until_ns: int
) -> list[SensorDoubt]:
    """Return the sensors whose readings contradict what is declared, having warned of each.

    Args:
        log: Where the evidence is from.
        evidence: What is known.
        door_ids: The doors that are asked about.
        until_ns: What comes after does not count.
    """
    found = sensor_doubts(evidence, door_ids, until_ns)
    labels = log.door_labels() if found else {}
    named = [replace(doubt, door=labels.get(doubt.door_id, "")) for doubt in found]
    for doubt in named:
        how = command_line("calibrate", log.path, "--truth", "FILE.csv")
        source = f" --source {doubt.sensor.source}" if doubt.sensor.source else ""
        warnings.warn(
            f"{doubt}; with times at which the true state is known, find what to declare: "
            f"{how}{source}",
            SensorWarning,
            stacklevel=frames_of_ours(),
        )
    return named
