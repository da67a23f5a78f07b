"""A mapping file: YAML that says which topics are read, and how.

    topics:
      /lta_semantic_map_door_db: door_map      # a word, where the defaults are right
      /door_states: rmf_door_state
      /front/contact:                          # or keys and values
        read: sensor
        door: front
        states: {open: true, closed: false}
        accuracy: 0.97
    repeats: 60

README.md next to this file explains every key. A key that is not known is refused; all problems
of the file are reported at once, with their lines.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from difflib import get_close_matches
from pathlib import Path
from typing import Any, NamedTuple

from semmap_log.core.model.doors import DoorState
from semmap_log.interop.formats.parsing import strict_yaml
from semmap_log.interop.formats.parsing.problems import Problems, shown
from semmap_log.interop.formats.parsing.yaml_values import described, mapping_of, number_of, text_of
from semmap_log.interop.formats.ros.ros_types import long_name, short_name, whole_topic
from semmap_log.interop.topics import topic_rules


def read_mapping(path: Path) -> topic_rules.RosMapping:
    """Return what a mapping file says.

    Raises:
        FormatError: It cannot be read, or says what cannot be; each problem with its line.
    """
    root = strict_yaml.load_yaml(path)
    problems = Problems(path)
    mapping = _FileReader(problems).mapping(root)
    problems.raise_any()
    return mapping


class _FileReader:
    """Notes what is wrong, and returns defaults in its place."""

    def __init__(self, problems: Problems) -> None:
        self.problems = problems

    def mapping(self, root: strict_yaml.Node) -> topic_rules.RosMapping:
        top = mapping_of(root, "a mapping file", self.problems)
        if top is None:
            return topic_rules.RosMapping()
        keys = _Keys("a mapping file", top, self.problems)
        topics = self.topics(keys)
        poses = keys.inner("poses", "poses")
        frames = keys.inner("frames", "frames")
        default = topic_rules.RosMapping()
        mapping = topic_rules.RosMapping(
            topics=topics,
            well_known=keys.flag("well_known", default=False),
            level=keys.text("level", "") or None,
            repeats_s=keys.number("repeats", default.repeats_s, *_SECONDS),
            moved_m=poses.number("metres", default.moved_m, "metres, 0 or more"),
            turned_rad=math.radians(
                poses.number("degrees", math.degrees(default.turned_rad), "degrees, 0 or more")
            ),
            stamps_within_s=keys.number("stamps", default.stamps_within_s, *_SECONDS),
            map_frame=_frame(frames.text("map", default.map_frame, _NAME)),
            robot_frame=_frame(frames.text("robot", default.robot_frame, _NAME)),
        )
        if mapping.map_frame == mapping.robot_frame:
            keys.refuse("frames", "two frames, the robot's another than the map's")
        for each in (keys, poses, frames):
            each.check_known_keys()
        if not (topics or mapping.well_known or self.problems.found):
            self.problems.add(
                top.line, "topics: expected a topic at least, got none; or well_known: true"
            )
        return mapping

    def topics(self, keys: _Keys) -> dict[str, topic_rules.TopicRule]:
        node = keys.node("topics")
        found = None if node is None else mapping_of(node, "topics", self.problems)
        if found is None:
            return {}
        rules = {}
        for name, value in found.entries.items():
            topic = whole_topic(name.strip())
            rule = self.rule(topic, value)
            if topic.startswith("~") or topic == "/":
                self.problems.add(
                    found.key_lines[name],
                    f"topics: expected a topic's name such as /door_states, got {shown(name)}; "
                    "write the whole name",
                )
            if topic in rules:
                self.problems.add(
                    found.key_lines[name], f"topics: {topic} is there twice; keep one of them"
                )
            if rule is not None:
                rules[topic] = rule
        return rules

    def rule(self, topic: str, node: strict_yaml.Node) -> topic_rules.TopicRule | None:
        if not isinstance(node, strict_yaml.Mapping):
            word = text_of(node, topic, self.problems)
            node = strict_yaml.Mapping(node.line, {"read": node}, {"read": node.line})
            if word is None:
                return None
        keys = _Keys(topic, node, self.problems)
        word = keys.choice("read", tuple(topic_rules.READINGS), default="")
        if not word:
            return None
        reading = topic_rules.READINGS[word]
        values = {
            name: read(keys) for name, read in _OPTIONS.items() if name in reading.__slots__
        } | {name: read(keys) for name, read in _OWN.get(reading, {}).items()}
        ros_type = keys.text("type", "", _TYPE)
        keys.check_known_keys()
        self.check_type(keys, word, ros_type)
        check_sense(keys, values)
        return topic_rules.TopicRule(reading(**values), long_name(ros_type) if ros_type else "")

    def check_type(self, keys: _Keys, word: str, ros_type: str) -> None:
        possible = topic_rules.ONLY_TYPES.get(topic_rules.READINGS[word], ())
        if ros_type and possible and long_name(ros_type) not in possible:
            names = " or ".join(short_name(name) for name in possible)
            keys.refuse("type", f"{names} (what {word} reads)")


def check_sense(keys: _Keys, values: dict[str, Any]) -> None:
    """Refuse values that cannot be distinguished."""
    if values.get("open_above", math.inf) < values.get("closed_below", -math.inf):
        keys.refuse("open_above", "a number not below closed_below")
    if set(values.get("starts", ())) & set(values.get("finishes", ())):
        keys.refuse("finishes" if "finishes" in keys.found.entries else "starts",
                    "values that do not mark both")  # fmt: skip


class _Form(NamedTuple):
    """What a text has to be."""

    pattern: re.Pattern[str]
    expected: str


_NAME = _Form(re.compile(r"[^\0]+"), "a name")
_TYPE = _Form(re.compile(r"[A-Za-z]\w*(/msg)?/[A-Za-z]\w*", re.ASCII), "such as std_msgs/Bool")
_TOPIC = _Form(re.compile(r"/?\w+(/\w+)*", re.ASCII), "a topic's whole name, as /amcl_pose")
_PATH = _Form(re.compile(r"[A-Za-z]\w*(\.[A-Za-z]\w*)*", re.ASCII), "a field's name")
_SECONDS = ("seconds, 0 to 1e9", (0.0, 1e9))


class _Keys:
    """The keys of a mapping, each taken once; what is left over at the end is unknown."""

    def __init__(self, what: str, found: strict_yaml.Mapping, problems: Problems) -> None:
        self.what = what
        self.found = found
        self.problems = problems
        self.known: list[str] = []

    def node(self, key: str) -> strict_yaml.Node | None:
        self.known.append(key)
        return self.found.entries.get(key)

    def inner(self, key: str, what: str) -> _Keys:
        node = self.node(key)
        found = None if node is None else mapping_of(node, what, self.problems)
        return _Keys(what, found or strict_yaml.Mapping(self.found.line, {}, {}), self.problems)

    def text(self, key: str, default: str, form: _Form | None = None) -> str:
        node = self.node(key)
        found = None if node is None else text_of(node, f"{self.what}: {key}", self.problems)
        if found is not None and form is not None and not form.pattern.fullmatch(found):
            self.refuse(key, form.expected)
        return default if found is None else found

    def needed_name(self, key: str) -> str:
        if key not in self.found.entries:
            self.problems.add(self.found.line, f"{self.what}: expected the key {key}, got none")
        return self.text(key, "", _NAME)

    def flag(self, key: str, *, default: bool) -> bool:
        node = self.node(key)
        if node is None:
            return default
        if isinstance(node, strict_yaml.Scalar) and isinstance(node.value, bool):
            return node.value
        self.refuse(key, "true or false")
        return default

    def number(
        self, key: str, default: float, expected: str, within: tuple[float, float] = (0, math.inf)
    ) -> float:
        node = self.node(key)
        if node is None:
            return default
        value = number_of(node, f"{self.what}: {key}", self.problems)
        if value is not None and not within[0] <= value <= within[1]:
            self.refuse(key, expected)
        return default if value is None else value

    def choice(self, key: str, words: tuple[str, ...], *, default: str) -> str:
        word = self.text(key, default) if key in self.found.entries or default else ""
        if key not in self.found.entries and not default:
            self.node(key)
            got = f"only {', '.join(self.found.entries)}" if self.found.entries else "none"
            expected = f"{key}: one of {', '.join(words)}"
            self.problems.add(self.found.line, f"{self.what}: expected {expected}; got {got}")
        elif word not in words:
            self.refuse(key, f"one of {', '.join(words)}{_meant(word, words)}")
            return default
        return word

    def values(self, key: str) -> list[strict_yaml.Scalar] | None:
        """Return a list of single values; one alone is a list of it; None: there is no such key."""
        node = self.node(key)
        if node is None:
            return None
        items = node.items if isinstance(node, strict_yaml.Sequence) else [node]
        if any(not isinstance(item, strict_yaml.Scalar) or item.value is None for item in items):
            self.refuse(key, "a value, or a list of values")
        return [
            item
            for item in items
            if isinstance(item, strict_yaml.Scalar) and item.value is not None
        ]

    def refuse(self, key: str, expected: str) -> None:
        node = self.found.entries[key]
        self.problems.add(
            node.line, f"{self.what}: {key}: expected {expected}, got {described(node)}"
        )

    def check_known_keys(self) -> None:
        for key, line in self.found.key_lines.items():
            if key not in self.known:
                self.problems.add(
                    line,
                    f"{self.what}: expected only the keys {', '.join(self.known)}; "
                    f"got {shown(key)}{_meant(key, self.known)}",
                )


def _meant(word: str, words: tuple[str, ...] | list[str]) -> str:
    close = get_close_matches(word, words, n=1)
    return f" (did you mean {close[0]}?)" if close else ""


def _frame(name: str) -> str:
    return name.removeprefix("/")


def _accuracy(keys: _Keys) -> topic_rules.Accuracy:
    expected, within = "a number from 0.5 to 1", (0.5, 1.0)
    both = keys.number("accuracy", 1.0, expected, within)
    return topic_rules.Accuracy(
        keys.number("accuracy_open", both, expected, within),
        keys.number("accuracy_closed", both, expected, within),
    )


def _doors(keys: _Keys) -> dict[str, str]:
    inner = keys.inner("doors", f"{keys.what}: doors")
    return {name: inner.needed_name(name) for name in inner.found.entries}


def _states(keys: _Keys) -> dict[topic_rules.Value, DoorState]:
    inner = keys.inner("states", f"{keys.what}: states")
    states: dict[topic_rules.Value, DoorState] = {}
    for state in DoorState:
        for each in inner.values(state.name.lower()) or ():
            for value in (each.value, each.text):
                if value is not None and states.setdefault(value, state) != state:
                    inner.refuse(state.name.lower(), "values that mean no other state")
                    break
    inner.check_known_keys()
    return states


def _marks(
    key: str, default: tuple[topic_rules.Value, ...]
) -> Callable[[_Keys], tuple[topic_rules.Value, ...]]:
    def read(keys: _Keys) -> tuple[topic_rules.Value, ...]:
        found = keys.values(key)
        if found is None:
            return default
        return tuple(v for each in found for v in (each.value, each.text) if v is not None)

    return read


def _heights(keys: _Keys, default: tuple[float, float]) -> tuple[float, float]:
    expected = "two numbers, the lower first"
    node = keys.node("heights")
    if node is None:
        return default
    items = node.items if isinstance(node, strict_yaml.Sequence) else []
    found = [number_of(item, f"{keys.what}: heights", keys.problems) for item in items]
    if len(found) != 2 or None in found or not found[0] < found[1]:  # type: ignore[operator]
        keys.refuse("heights", expected)
        return default
    return found[0], found[1]  # type: ignore[return-value]


def _pose_topic(keys: _Keys) -> str:
    found = keys.text("pose_topic", "", _TOPIC)
    return whole_topic(found) if found else ""


_ANY = (-math.inf, math.inf)

_OPTIONS: dict[str, Callable[[_Keys], Any]] = {
    "level": lambda keys: keys.text("level", "") or None,
    "doors": _doors,
    "accuracy": _accuracy,
    "unknown": lambda keys: keys.choice("unknown_doors", ("add", "ignore", "error"), default="add"),
    "robot": lambda keys: keys.text("robot", ""),
    "removes": lambda keys: keys.choice("removes", ("own", "all", "none"), default="own"),
}
"""How the options are read that several readings share, by the field's name."""

_OWN: dict[type, dict[str, Callable[[_Keys], Any]]] = {
    topic_rules.ReadScan: {
        "robot": lambda keys: keys.text("robot", "") if "robot" in keys.found.entries else None,
        "pose_topic": _pose_topic,
        "heights": lambda keys: _heights(keys, topic_rules.ReadScan().heights),
    },
    topic_rules.ReadClicks: {
        "within_s": lambda keys: keys.number(
            "within", topic_rules.ReadClicks().within_s, *_SECONDS
        ),
        "heights": lambda keys: _heights(keys, topic_rules.ReadClicks().heights),
    },
    topic_rules.ReadSensor: {
        "door": lambda keys: keys.needed_name("door"),
        "path": lambda keys: keys.text("field", "data", _PATH),
        "states": _states,
        "open_above": lambda keys: keys.number("open_above", math.nan, "a number", _ANY),
        "closed_below": lambda keys: keys.number("closed_below", math.nan, "a number", _ANY),
    },
    topic_rules.ReadPatrol: {
        "path": lambda keys: keys.text("field", "data", _PATH),
        "starts": _marks("starts", topic_rules.ReadPatrol().starts),
        "finishes": _marks("finishes", topic_rules.ReadPatrol().finishes),
        "name": lambda keys: keys.text("name", ""),
    },
}
