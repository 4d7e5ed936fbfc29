"""The loop closed, live: the reference car on a road that it does not know, the suite, and the driver.

ros2 launch launch_scripts/closed_loop.launch.py mu:=0.8 track:=club
"""

import tempfile

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, EmitEvent, IncludeLaunchDescription, OpaqueFunction, TimerAction
from launch.events import Shutdown
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration, ThisLaunchFileDir
from launch_ros.actions import Node

ARGUMENTS = [
    ("car", "f1tenth", "a car of sim_car"),
    ("track", "club", "a closed track of sim_car"),
    ("mu", "0.9", "friction of the road"),
    ("prior_mu", "", "publish this friction prior"),
    ("camera", "false", "use the camera's pictures for the friction prior"),
]
# As ROS 2 writes a switch, and Python.
SWITCH = ["true", "false", "True", "False"]
# The names of params/stacks/gripsight.yaml.
TOPICS = [
    ("odom", "/car_state/odom"),
    ("imu", "/imu/data"),
    ("wheels", "/wheel_speeds"),
    ("drive", "/drive"),
    ("image/compressed", "/camera/image/compressed"),
]
# Until the car has written its files.
WRITTEN_S = 3.0


def nodes(context):
    """The car at once, the suite and the driver when its files are there."""
    value = {name: LaunchConfiguration(name).perform(context) for name, _, _ in ARGUMENTS}
    folder = tempfile.mkdtemp(prefix="gripsight_closed_loop_")
    car = Node(
        package="gripsight_sim_car",
        executable="sim_car",
        name="sim_car",
        parameters=[
            {
                "car": value["car"],
                "track": value["track"],
                "mu": float(value["mu"]),
                "write_folder": folder,
                "camera_rate_hz": 5.0 if value["camera"].lower() == "true" else 0.0,
            }
        ],
        remappings=TOPICS,
        output="both",
        on_exit=[EmitEvent(event=Shutdown(reason="the car ended"))],
    )
    suite = IncludeLaunchDescription(
        PythonLaunchDescriptionSource([ThisLaunchFileDir(), "/gripsight.launch.py"]),
        launch_arguments={
            "vehicle": f"{folder}/vehicle.yaml",
            "drive": f"{folder}/driver.yaml",
            "prior_mu": value["prior_mu"],
            "camera": value["camera"],
        }.items(),
    )
    return [car, TimerAction(period=WRITTEN_S, actions=[suite])]


def generate_launch_description():
    """What ros2 launch calls."""
    declared = [
        DeclareLaunchArgument(name, default_value=default, description=text, choices=SWITCH if default == "false" else None)
        for name, default, text in ARGUMENTS
    ]
    return LaunchDescription([*declared, OpaqueFunction(function=nodes)])
