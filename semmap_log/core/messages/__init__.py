"""Message texts (package semmap_msgs) and the codec, event <-> CDR bytes.

The only package that knows CDR. The `.msg` texts are the definition; layouts are derived from them.
"""

from semmap_log.core.messages.layout import (
    OBJECT_KINDS,
    Layout,
    decode,
    encode,
    field_getter,
    field_getters,
    fixed_layout,
    layout,
    ros_type,
)
from semmap_log.core.messages.type_hash import (
    CDR_HEADER,
    OCCUPANCY_GRID,
    PACKAGE,
    comments_of,
    message_text,
    read_message,
    schema_text,
    type_hash,
    type_name,
    write_message,
)

__all__ = [
    "CDR_HEADER",
    "OBJECT_KINDS", "OCCUPANCY_GRID", "PACKAGE", "Layout", "comments_of", "decode", "encode",
    "field_getter", "field_getters", "fixed_layout", "layout", "message_text", "read_message",
    "ros_type", "schema_text", "type_hash", "type_name", "write_message",
]  # fmt: skip
