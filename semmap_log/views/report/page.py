"""Fills the page: HTML, CSS and JavaScript are files beside this one, the data is JSON.

Nothing in the data can become part of the page: it is a block that no browser runs, in it `<`, `>`
and `&` are spelt out, and the scripts show text as text. The page's own policy forbids it to load
anything, and any script but its own.
"""

from __future__ import annotations

import base64
import hashlib
import html
import json
from importlib import resources
from typing import Any

from semmap_log.views.palette import Palette, Rgb

STYLES = ("page.css", "stage.css", "sections.css", "print.css")
SCRIPTS = (
    "basics.js", "calendar.js", "data.js", "clock.js", "plan.js", "labels.js", "beside.js",
    "ticks.js", "lanes.js", "weeks.js", "table.js", "words.js", "main.js",
)  # fmt: skip
"""In the order in which they are joined; the first line of each says what it is for."""


def filled(data: dict[str, Any], *, title: str, palette: Palette) -> str:
    """Return the page.

    Args:
        data: What it shows; only what JSON holds.
        title: For the browser's tab.
        palette: Colours of the states and of the robot.
    """
    style = _colours(palette) + "".join(map(_asset, STYLES))
    script = '(() => {\n"use strict";\n' + "\n".join(map(_asset, SCRIPTS)) + "})();\n"
    parts = {
        "POLICY": (
            "default-src 'none'; img-src data:; "
            f"style-src '{_fingerprint(style)}'; script-src '{_fingerprint(script)}'; "
            "base-uri 'none'; form-action 'none'"
        ),
        "TITLE": html.escape(title),
        "STYLE": style,
        "DATA": inert_json(data),
        "SCRIPT": script,
    }
    page = _asset("page.html")
    pieces = page.split("@@")  # text, name of a part, text, name of a part …, text
    return "".join(parts[piece] if i % 2 else piece for i, piece in enumerate(pieces))


def inert_json(value: Any) -> str:
    """Return JSON without a character that could end a script block, or begin a comment in one."""
    text = json.dumps(value, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    for character in "<>&\u2028\u2029":
        text = text.replace(character, f"\\u{ord(character):04x}")
    return text


def _asset(name: str) -> str:
    return resources.files(__package__).joinpath(f"page/{name}").read_text(encoding="utf-8")


def _fingerprint(text: str) -> str:
    digest = hashlib.sha256(text.encode()).digest()
    return f"sha256-{base64.b64encode(digest).decode()}"


def _colours(palette: Palette) -> str:
    """Return the palette as variables; MOVING and OFFLINE are drawn as UNKNOWN."""
    named = {
        "open": palette.open, "closed": palette.closed, "unknown": palette.unknown,
        "open-text": palette.open_text, "closed-text": palette.closed_text,
        "unknown-text": palette.unknown_text, "robot": palette.robot,
    }  # fmt: skip
    lines = "".join(f"  --{name}: {hex_of(colour)};\n" for name, colour in named.items())
    return f":root {{\n{lines}}}\n"


def hex_of(colour: Rgb) -> str:
    """Return the colour as CSS writes it."""
    return "#{:02x}{:02x}{:02x}".format(*colour)
