"""The verbs, in groups, in the order in which a new user meets them; each is loaded when it runs.

The modules and options of other verbs are not loaded for a command line.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from importlib import import_module
from keyword import iskeyword
from typing import Any

import typer

from semmap_log.cli.common import with_cache
from semmap_log.cli.verb import Verb

GROUPS: dict[str, dict[str, str]] = {
    "First steps": {
        "help": "Show what a verb does, or what verbs there are.",
        "demo": "The main job in one go, on a shipped recording.",
        "init": "Make a new log.",
        "import": "Import doors, states or events from a file.",
    },
    "Write what happens": {
        "add": "Add a door, or another object.",
        "define": "Define a class of other objects.",
        "update": "Set fields of a door.",
        "remove": "Take a door out of the map.",
        "observe": "Record that a sensor saw a door.",
        "annotate": "Say something about a door in words.",
        "patrol": "Mark the start or end of a round.",
        "record": "Record events from standard input, or from ROS.",
        "retract": "Take events back.",
        "rebase": "Move the doors into a new map.",
    },
    "Ask what was, when, and why": {
        "why": "Tell what was true of a door, and who said so.",
        "replay": "Show the doors at a moment.",
        "history": "Show who changed what, when, why.",
        "tail": "Show the last events, and those to come.",
        "show": "Show one event.",
        "diff": "Show what differs between two moments.",
        "timeline": "Show when a door was open, when closed.",
        "rooms": "Show the rooms, and which doors lead where.",
        "sql": "Answer a query in SQL.",
    },
    "Ask what is likely": {
        "probabilities": "Show how likely doors are open.",
        "best-time": "Show when a door is likeliest open.",
        "patrol-plan": "Plan in which order to visit rooms.",
        "go": "Plan a trip: wait, ask, or go round.",
        "evaluate": "Tell how good forecasts of the doors are.",
        "calibrate": "Find a sensor's accuracies from known truth.",
        "scan-report": "Tell how a laser saw the doors; draw it.",
    },
    "Pictures, and files for other programs": {
        "view": "Look at the history in rerun.",
        "report": "Write the history as one page for any browser.",
        "costmap": "Draw the doors into a costmap.",
        "export": "Write a file for other programs.",
    },
    "Live in ROS, and for planners": {
        "serve": "Serve the doors in ROS, and to planners.",
        "play": "Publish a log's history.",
        "ask": "Ask a server what planners ask.",
        "ros-package": "Copy the ROS package into a workspace.",
        "oprs-package": "Copy the module for kernels of OpenPRS.",
        "prolog-module": "Copy the module for SWI-Prolog.",
        "call": "Call an action of a running server.",
    },
    "Care of the log": {
        "info": "Show what a log holds.",
        "verify": "Check that a log is as it was written.",
        "recover": "Save what is whole of a damaged log.",
        "copy": "Copy a log while it is written.",
        "compact": "Make a log smaller.",
        "redact": "Take out who was where, for ever.",
        "retain": "Take out what is too old, for ever.",
        "pin": "Keep a moment answerable, by a name.",
        "index": "Make a log quick to ask about single doors.",
        "sign": "Sign a log, so that changes show.",
    },
    "Many robots": {
        "ship": "Send a log to a store.",
        "fetch": "Bring a log back from a store.",
        "join": "Join robots' logs of one building.",
        "fleet": "Ask many logs one question.",
    },
}
"""Group -> its verbs, as `help --all` shows them, and what each does in a line.

The verb `best-time` is `run` in `best_time.py`; one that has verbs of its own is `app` there.
"""

FIRST_WEEK = ("init", "import", "add", "observe", "record", "replay", "why", "history",
              "probabilities", "report", "view", "export")  # fmt: skip
"""Those that `-h` shows: what one does in the first week."""

OLD_NAMES = {"state": "replay", "log": "history"}
"""Names that help does not show -> the verbs that they are."""

SHOWN = {name: does for verbs in GROUPS.values() for name, does in verbs.items()}
"""Verb -> what it does."""

UNCACHED = {"verify"}
"""Believes no cache."""


class VerbsByName(Mapping[str, Any]):
    """Name -> the verb, as typer has it: made on first use."""

    def __init__(self) -> None:
        self._loaded: dict[str, Any] = {}

    def __getitem__(self, name: str) -> Any:
        if name not in self._loaded:
            if name not in SHOWN and name not in OLD_NAMES:
                raise KeyError(name)
            self._loaded[name] = _load(name)
        return self._loaded[name]

    def __iter__(self) -> Iterator[str]:
        return iter((*SHOWN, *OLD_NAMES))

    def __len__(self) -> int:
        return len(SHOWN) + len(OLD_NAMES)


def _load(name: str) -> Any:
    """Return a verb as typer makes it of the function that runs it."""
    known = OLD_NAMES.get(name, name)
    module = import_module(f"semmap_log.cli.{_module_of(known)}")
    alone = typer.Typer(rich_markup_mode=None)
    alone.callback()(_nothing)  # or typer would make a program of the one verb
    about: dict[str, Any] = {"short_help": SHOWN[known], "hidden": name in OLD_NAMES}
    if hasattr(module, "app"):
        alone.add_typer(module.app, name=name, **about)
    else:
        run = with_cache(module.run, caches=known not in UNCACHED)
        alone.command(name, cls=Verb, **about)(run)
    group: Any = typer.main.get_command(alone)
    return group.commands[name]


def _module_of(verb: str) -> str:
    name = verb.replace("-", "_")
    return f"{name}_" if iskeyword(name) else name


def _nothing() -> None:
    """What the program does before a verb."""
