"""`semmap-log serve` as a node, started again when it ends.

ros2 launch lta_semantic_map server.launch.py log:=LOG options:="--yaml doors.yaml --costmap"
"""

import shlex

from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue


def generate_launch_description() -> LaunchDescription:
    """Declare the arguments, and start the node with them."""
    return LaunchDescription(
        [
            DeclareLaunchArgument("log", description="the folder of the log"),
            DeclareLaunchArgument(
                "options",
                default_value="",
                description="of semmap-log serve, such as --read-only",
            ),
            DeclareLaunchArgument("name", default_value="lta_semantic_map_server"),
            DeclareLaunchArgument("namespace", default_value=""),
            DeclareLaunchArgument("use_sim_time", default_value="false"),
            OpaqueFunction(function=_node),
        ]
    )


def _node(context: LaunchContext) -> list[Node]:
    options = LaunchConfiguration("options").perform(context)
    sim_time = ParameterValue(LaunchConfiguration("use_sim_time"), value_type=bool)
    return [
        Node(
            package="lta_semantic_map",
            executable="lta_semantic_map_server",
            name=LaunchConfiguration("name"),
            namespace=LaunchConfiguration("namespace"),
            arguments=[LaunchConfiguration("log"), *shlex.split(options)],
            parameters=[{"use_sim_time": sim_time}],
            output="screen",
            respawn=True,
            respawn_delay=2.0,
            # Restarted whatever the exit code; after a lasting error it reports once and waits.
            additional_env={"SEMMAP_RESPAWNED": "1"},
        )
    ]
