"""How the documentation is built: `sphinx-build -W -n docs build/docs`."""

from __future__ import annotations

import sys
from importlib.metadata import version as version_of
from pathlib import Path
from typing import Any, ClassVar

from docutils import nodes
from docutils.parsers.rst import Directive
from sphinx.application import Sphinx

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT))

project = "semmap-log"
author = "the semmap-log authors"
copyright = "Apache-2.0"  # noqa: A001  # the name that Sphinx gives it
release = version = version_of("semmap-log")

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
exclude_patterns = ["_build"]
language = "en"

myst_enable_extensions = ["colon_fence", "deflist"]
myst_heading_anchors = 3

nitpicky = True
"""A name of the reference that leads nowhere is a warning, and so an error in CI."""
nitpick_ignore_regex = [
    # Types of other projects: their documentation is not at hand where this one is built.
    (r"py:.*", r"(numpy|np|NDArray|pathlib|Path|collections|typing|types|enum|pa|pd)\b.*"),
    # Names of the rooms behind the public modules, which may move: see api.md.
    (r"py:.*", r"semmap_log\.(?!events\.|costmaps\.|beliefs\.|errors\.)[a-z_]+\..*"),
]

default_role = "literal"
"""Docstrings write code in single backticks."""
autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_typehints_format = "short"
autodoc_preserve_defaults = True
python_use_unqualified_type_names = True
python_maximum_signature_line_length = 88
napoleon_numpy_docstring = False

html_theme = "pydata_sphinx_theme"
html_title = "semmap-log"
html_static_path: list[str] = []
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
        from semmap_log.events import KINDS, FloorMap
        from semmap_log.messages import message_text

        events = [kind.__name__ for kind in KINDS if kind is not FloorMap]
        found: list[nodes.Node] = []
        for name in (*events, "Commit", "CommitNote", "Keyframe"):
            found.append(nodes.rubric(text=name))
            text = message_text(name)
            found.append(nodes.literal_block(text, text, language="text"))
        return found


def setup(app: Sphinx) -> dict[str, Any]:
    """Tell Sphinx what this file adds."""
    app.add_directive("message-texts", MessageTexts)
    return {"parallel_read_safe": True}
