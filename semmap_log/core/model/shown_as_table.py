"""Values that show themselves in a notebook; a room above draws them."""

from __future__ import annotations

from semmap_log.core.lazy.late_answers import answer_of


class ShownAsTable:
    """A value that a notebook shows as a table."""

    __slots__ = ()

    def _repr_html_(self) -> str:
        html: str = answer_of("html")(self)
        return html
