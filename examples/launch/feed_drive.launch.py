"""The closed loop of a drive: plant, washout controller and analyzer, each a process.

For a system that starts by launch. `stickslip run` starts the same nodes and reports the result.
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.substitutions import FindPackageShare

PACKAGE = "stickslip_ros"


def node(name, others, **settings):
    """Return one of the nodes, which starts as soon as it is connected with the others."""
    parameters = {"wait_for": others, **settings}
    return Node(
        package=PACKAGE,
        executable=f"{name}_node",
        namespace=LaunchConfiguration("namespace"),
        parameters=[LaunchConfiguration("scenario"), parameters],
        respawn=name == "analyzer",
    )


def generate_launch_description():
    """Start the nodes; an analyzer that dies is restarted, and records to the next bag."""
    drive = PathJoinSubstitution([FindPackageShare(PACKAGE), "config", "feed_drive.yaml"])
    return LaunchDescription(
        [
            DeclareLaunchArgument("scenario", default_value=drive, description="parameter file"),
            DeclareLaunchArgument("namespace", default_value="feed_drive"),
            DeclareLaunchArgument("bag", default_value="", description="empty: no recording"),
            DeclareLaunchArgument(
                "pace", default_value="realtime", choices=["lockstep", "realtime"]
            ),
            node("analyzer", ["plant"], bag=LaunchConfiguration("bag"), bag_exists="next"),
            node("washout_controller", ["plant"]),
            node("plant", ["washout_controller", "analyzer"], pace=LaunchConfiguration("pace")),
        ]
    )
