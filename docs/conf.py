"""How the documentation is built: `sphinx-build -W -n docs build/docs`."""

from __future__ import annotations

import re
import sys
from dataclasses import is_dataclass
from importlib import import_module
from importlib.metadata import version as version_of
from pathlib import Path
from typing import Any, ClassVar, get_type_hints

from docutils import nodes
from docutils.parsers.rst import Directive
from docutils.statemachine import StringList
from sphinx import addnodes
from sphinx.application import Sphinx
from sphinx.environment import BuildEnvironment

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT))

project = "semmap-log"
author = "the semmap-log authors"
copyright = "the semmap-log authors, Apache-2.0"  # noqa: A001  # the name that Sphinx gives it
release = version = version_of("semmap-log")

extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
exclude_patterns = ["_build"]
nb_execution_mode = "force"
"""Notebooks lie in the repository without their outputs: these are made here, each time."""
nb_execution_raise_on_error = True
nb_execution_timeout = 600
language = "en"

myst_enable_extensions = ["colon_fence", "deflist"]
myst_heading_anchors = 3

nitpicky = True
"""A name of the reference that leads nowhere is a warning, and so an error in CI."""
nitpick_ignore_regex = [
    # Types of other projects: their documentation is not at hand where this one is built.
    (r"py:.*", r"(numpy|np|NDArray|ArrayLike|pathlib|Path|collections|typing|types|enum)\b.*"),
    (r"py:.*", r"(pyarrow|pa|pandas|polars|DataFrame|PolarsFrame|datetime|Time|S|True|False)\b.*"),
    (r"py:.*", r"(cryptography|weakref)\b.*|tuple\[int"),
    # Names of the rooms behind the public modules.
    (r"py:.*", r"semmap_log\.\w+\..*"),
    (
        r"py:class",
        r"(About|Clock|DoorId|Duration|Durability|Entropy|FollowsWriter|LogSummary|Measured|Progress|RigidTransform|Window|first_event|current_map.Events)",
    ),
    # The same, where a program loads them only when it needs them.
    (r"py:class", r"(CommitFinder|Diff|EarlyEvents|EventChoice|FollowedCommit)"),
    (r"py:class", r"(HistoryEntry|LikelyHours|RoundWish|WritingOptions)"),
    (r"py:class", r"(LiveState|LogPart|NoteFinder|Scope|SensorDoubt|State|Timeline|WeekMask)"),
]

default_role = "literal"
"""Docstrings write code in single backticks."""
autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_typehints_format = "short"
autodoc_type_aliases = {"Time": "Time"}
python_use_unqualified_type_names = True
python_maximum_signature_line_length = 88
napoleon_numpy_docstring = False

html_theme = "pydata_sphinx_theme"
html_title = "semmap-log"
html_static_path = ["_static"]
html_css_files = ["wide.css"]
html_sidebars: dict[str, list[str]] = {"quickstart": [], "two_times": []}
html_show_sourcelink = False
html_theme_options = {
    "navbar_end": ["theme-switcher"],
    "secondary_sidebar_items": ["page-toc"],
    "show_prev_next": True,
    "footer_start": ["copyright"],
    "footer_end": [],
}


class MessageTexts(Directive):
    """`{message-texts}`: the `.msg` texts, from the files that define them."""

    has_content: ClassVar[bool] = False

    def run(self) -> list[nodes.Node]:
        """Return a block for each text, with its name."""
        from semmap_log.core.messages import message_text
        from semmap_log.events import KINDS, FloorMap

        events = [kind.__name__ for kind in KINDS if kind is not FloorMap]
        found: list[nodes.Node] = []
        for name in (*events, "Commit", "CommitNote", "Keyframe", "Tombstone"):
            found.append(nodes.rubric(text=name))
            text = message_text(name)
            found.append(nodes.literal_block(text, text, language="text"))
        return found


class ParquetColumns(Directive):
    """`{parquet-columns}`: the columns of a table of events, from the table that defines them."""

    has_content: ClassVar[bool] = False

    def run(self) -> list[nodes.Node]:
        """Return a table."""
        from semmap_log.core.arrow.table import HISTORY_COLUMNS

        lines = ["| column | type | means |", "| --- | --- | --- |"]
        for one in HISTORY_COLUMNS:
            means = one.says.replace("|", "\\|")
            lines.append(f"| `{one.name}` | `{one.type}` | {means} |")
        block = nodes.container()
        self.state.nested_parse(StringList(lines, "the columns"), self.content_offset, block)
        return block.children


PUBLIC = (
    "semmap_log",
    "semmap_log.events",
    "semmap_log.analysis.beliefs",
    "semmap_log.analysis.costmaps",
    "semmap_log.analysis.rooms",
    "semmap_log.analysis.planning",
    "semmap_log.errors",
    "semmap_log.log",
)
"""The modules that api.md documents, and the last, which kernel.md does."""


def homes() -> dict[str, str]:
    """Return, for each public name, where the reference has it."""
    found: dict[str, str] = {}
    for module in reversed([import_module(name) for name in PUBLIC]):
        names = getattr(module, "__all__", vars(module))
        found |= {name: f"{module.__name__}.{name}" for name in names}
    return found


def lead_to_public_name(
    _app: Sphinx, env: BuildEnvironment, node: addnodes.pending_xref, text: nodes.Element
) -> nodes.Element | None:
    """Let `semmap_log.core.model.doors.Door` in a signature lead to `semmap_log.Door`."""
    home = homes().get(node.get("reftarget", "").rpartition(".")[2])
    if node.get("refdomain") != "py" or home is None:
        return None
    python, builder = env.domains["py"], _app.builder
    return python.resolve_xref(env, node["refdoc"], builder, "obj", home, node, text)


INCLUDED = {"semmap_log/live/robot_files/README.md": "/guides/robot.md",
            "CONTRIBUTING.md": "/contributing.md", "CHANGELOG.md": "/changelog.md",
            "recordings/README.md": "/recordings.md"}  # fmt: skip
"""Files that are pages here, and lie elsewhere in the project."""


def adapt_links(_app: Sphinx, _path: Path, _page: str, content: list[str]) -> None:
    """Let links in an included file, which are relative to that file, lead to pages.

    What is no page, such as a test, becomes its name.
    """

    def lead(match: re.Match[str]) -> str:
        text, target = match[1], match[2]
        if "://" in target or target.startswith("#"):
            return match[0]
        page = INCLUDED.get(target, "/" + target.removeprefix("docs/"))
        is_page = target in INCLUDED or target.startswith("docs/")
        if is_page:
            return f"[{text}]({page})"
        return f"`{target}`" if text == target else f"{text} (`{target}`)"

    content[0] = re.sub(r"(?<!!)\[([^]]+)\]\(([^)]+)\)", lead, content[0])


def show_plain_types() -> None:
    """Let signatures of events tell types alone: `float`, not the rule of what it may be."""
    from semmap_log import events

    for kind in [each for each in vars(events).values() if is_dataclass(each)]:
        hints = get_type_hints(kind)
        for annotated in (kind.__annotations__, kind.__init__.__annotations__):
            annotated |= {name: hints[name] for name in annotated if name in hints}


def adapt_docstring(
    _app: Sphinx, what: str, _name: str, _obj: object, _options: object, lines: list[str]
) -> None:
    """Say in reStructuredText what plain docstrings mean.

    The first indented lines of a module's are code, or a drawing. What stands before a colon in
    an attribute's is no type, as napoleon would have it.
    """
    if what in {"attribute", "data", "property"}:
        lines[:0] = ["..", ""]  # an empty comment
    elif what == "module":
        first = next((i for i, line in enumerate(lines) if line.startswith("    ")), None)
        if first is not None:
            language = "python" if "import" in lines[first] else "text"
            lines[first:first] = [f".. code-block:: {language}", ""]


def setup(app: Sphinx) -> dict[str, Any]:
    """Tell Sphinx what this file adds."""
    show_plain_types()
    app.add_directive("message-texts", MessageTexts)
    app.connect("autodoc-process-docstring", adapt_docstring, priority=400)
    app.add_directive("parquet-columns", ParquetColumns)
    app.connect("include-read", adapt_links)
    app.connect("missing-reference", lead_to_public_name)
    return {"parallel_read_safe": True}
