"""Message texts (package semmap_msgs) and the codec, event <-> CDR bytes.

The only room that knows CDR. The `.msg` texts are the definition; layouts are derived from them.
"""

from semmap_log.messages.codec import (
    OBJECT_KINDS,
    decode,
    encode,
    field_getter,
    fixed_layout,
    ros_type,
)
from semmap_log.messages.in_place import read_in_place, texts_in
from semmap_log.messages.layout import (
    CDR_HEADER,
    PACKAGE,
    Layout,
    comments_of,
    layout,
    message_text,
)
from semmap_log.messages.typestore import (
    OCCUPANCY_GRID,
    deserialize,
    schema_text,
    serialize,
    type_hash,
    type_name,
)

__all__ = [
    "CDR_HEADER",
    "OBJECT_KINDS", "OCCUPANCY_GRID", "PACKAGE", "Layout", "comments_of", "decode", "deserialize",
    "encode", "field_getter", "fixed_layout", "layout", "message_text", "read_in_place", "ros_type",
    "schema_text", "serialize", "texts_in", "type_hash", "type_name",
]  # fmt: skip
