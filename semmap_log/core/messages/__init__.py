"""Message texts (package semmap_msgs) and the codec, event <-> CDR bytes.

The only package that knows CDR. The `.msg` texts are the definition; layouts are derived from them.
"""

from semmap_log.core.messages.layout import (
    BAG_METADATA_NAME,
    LIBRARY,
    OBJECT_KINDS,
    PROFILE,
    TRANSIENT_LOCAL,
    VOLATILE,
    Layout,
    decode,
    encode,
    field_getter,
    field_getters,
    fixed_layout,
    layout,
    offered_qos,
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
    "BAG_METADATA_NAME", "CDR_HEADER", "LIBRARY", "OBJECT_KINDS", "OCCUPANCY_GRID", "PACKAGE",
    "PROFILE", "TRANSIENT_LOCAL", "VOLATILE", "Layout", "comments_of", "decode", "encode",
    "field_getter", "field_getters", "fixed_layout", "layout", "message_text", "offered_qos",
    "read_message", "ros_type", "schema_text", "type_hash", "type_name", "write_message",
]  # fmt: skip
