"""How the servers of the thesis's four actions are called; the thesis itself does not say.

Each name is relative, so that it follows the node's namespace, and a private parameter of server
and client, so that both fit a robot on which they are called otherwise.
"""

from __future__ import annotations

from semmap_log.live.ros.ros_node import RosNode

DEFAULTS = {
    "AddDoor": "lta_semantic_map/add_door",
    "UpdateDoor": "lta_semantic_map/update_door",
    "RemoveDoor": "lta_semantic_map/remove_door",
    "SaveDoorDB": "lta_semantic_map/save_door_db",
}
"""Action -> its server's name."""

PARAMETERS = {
    "AddDoor": "add_door",
    "UpdateDoor": "update_door",
    "RemoveDoor": "remove_door",
    "SaveDoorDB": "save_door_db",
}
"""Action -> the parameter that says another: `_add_door:=doors/add`, `-p add_door:=doors/add`."""


def action_name(node: RosNode, action: str) -> str:
    """Return the name of an action's server, as the node's parameters have it."""
    return str(node.parameter(PARAMETERS[action], DEFAULTS[action]))
