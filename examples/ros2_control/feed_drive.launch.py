"""The plant, and the controller manager of ros2_control that drives it, in lockstep by /clock."""

from pathlib import Path

from launch import LaunchDescription
from launch.substitutions import PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.substitutions import FindPackageShare

HERE = Path(__file__).parent
DRIVE = PathJoinSubstitution([FindPackageShare("stickslip_ros"), "config", "feed_drive.yaml"])


def generate_launch_description() -> LaunchDescription:
    """Start the nodes; the plant waits a minute for the first command."""
    plant = Node(
        package="stickslip_ros",
        executable="plant_node",
        namespace="feed_drive",
        parameters=[
            DRIVE,
            {
                "pace": "lockstep",
                "publish_clock": True,
                "command_rule": "newest",
                "effort": "actuator",
                "reply_timeout": 60.0,
            },
        ],
    )
    manager = Node(
        package="controller_manager",
        executable="ros2_control_node",
        parameters=[HERE / "controllers.yaml"],
    )
    publisher = Node(
        package="robot_state_publisher",
        executable="robot_state_publisher",
        parameters=[{"robot_description": (HERE / "feed_drive.urdf").read_text()}],
    )
    spawner = Node(
        package="controller_manager",
        executable="spawner",
        arguments=["joint_state_broadcaster", "velocity_controller"],
    )
    return LaunchDescription([plant, manager, publisher, spawner])
