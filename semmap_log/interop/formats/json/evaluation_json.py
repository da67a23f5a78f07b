"""What `evaluate --json` and `calibrate --json` print."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from semmap_log.analysis.beliefs.evaluation import Evaluation
from semmap_log.analysis.beliefs.protocol import Protocol
from semmap_log.analysis.beliefs.sensor_calibration import Calibration, DoorCalibration, SensorHits
from semmap_log.analysis.probabilities.scores import Scores
from semmap_log.core.model.doors import DoorId
from semmap_log.core.model.moments import SECOND_NS
from semmap_log.interop.formats.json.sensors_json import doubts_to_json


def evaluation_to_json(
    evaluation: Evaluation, *, names: Mapping[DoorId, str] | None = None
) -> dict[str, Any]:
    """Return an evaluation: the mean over the doors, each door, and what was left out.

    Args:
        evaluation: What came of it.
        names: What the doors are called.
    """
    named = names or {}
    return {
        **_protocol(evaluation.protocol),
        "against": "truth" if evaluation.is_truth else "next_reading",
        "mean": {name: scores_to_json(found) for name, found in evaluation.mean.items()},
        "reliability": {
            name: [
                {"p": p, "frequency": frequency, "count": count}
                for p, frequency, count in found.rows()
            ]
            for name, found in evaluation.reliability.items()
        },
        "doors": [
            {
                "door_id": door.door_id,
                "name": named.get(door.door_id),
                "training": door.training,
                "tests": door.tests,
                "scores": {name: scores_to_json(found) for name, found in door.scores.items()},
            }
            for door in evaluation.doors
        ],
        "left_out": [
            {"door_id": door_id, "name": named.get(door_id), "reason": reason}
            for door_id, reason in evaluation.left_out.items()
        ],
        "sensor_doubts": doubts_to_json(evaluation.sensor_doubts),
    }


def scores_to_json(scores: Scores) -> dict[str, float | None]:
    """Return the four figures; null where there was no forecast."""
    return {
        "brier": scores.brier,
        "log_loss": scores.log_loss,
        "ece": scores.ece,
        "bias": scores.bias,
    }


def calibration_to_json(
    calibration: Calibration, *, names: Mapping[DoorId, str] | None = None
) -> dict[str, Any]:
    """Return how often a sensor read right: all doors together, and each.

    Args:
        calibration: What was found.
        names: What the doors are called.
    """
    named = names or {}
    return {
        **_accuracies(calibration.together),
        "doors": [
            {"door_id": door_id, "name": named.get(door_id), **_accuracies(door)}
            for door_id, door in calibration.doors.items()
        ],
        "unseen": list(calibration.unseen),
    }


def _accuracies(found: DoorCalibration) -> dict[str, Any]:
    return {
        "accuracy_open": _hits(found.when_open),
        "accuracy_closed": _hits(found.when_closed),
    }


def _hits(hits: SensorHits) -> dict[str, Any]:
    low, high = hits.interval
    return {
        "accuracy": hits.accuracy,
        "declare": hits.declared,
        "low": low,
        "high": high,
        "visits": hits.visits,
        "sightings": hits.sightings,
    }


def _protocol(protocol: Protocol) -> dict[str, Any]:
    patrol = protocol.patrol
    return {
        "split": protocol.split,
        "prequential": protocol.prequential,
        "horizon_s": None if protocol.horizon_ns is None else protocol.horizon_ns / SECOND_NS,
        "patrol": patrol
        and {
            "interval_s": patrol.interval_ns / SECOND_NS,
            "accuracy": patrol.accuracy,
            "seed": patrol.seed,
        },
        "step_s": protocol.step_s,
    }
