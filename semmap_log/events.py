"""Every kind of event, and what its fields mean: the second front door."""

from semmap_log.core.model.events import *  # noqa: F403
from semmap_log.core.model.events import __all__ as __all__  # noqa: PLC0414
