"""Starts the gripsight suite beside a racing stack, or on a bag.

ros2 launch launch_scripts/gripsight.launch.py vehicle:=car.yaml stack:=forzaeth
ros2 launch launch_scripts/gripsight.launch.py vehicle:=car.yaml bag:=run.mcap rate:=10.0
"""

from pathlib import Path

import yaml
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, EmitEvent, OpaqueFunction, RegisterEventHandler, TimerAction
from launch.event_handlers import OnProcessExit
from launch.events import Shutdown
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node


def project_folder() -> Path:
    """The folder that holds params/, beside this file's own, in the source tree and in an install tree alike."""
    return Path(__file__).resolve().parent.parent


ARGUMENTS = [
    ("vehicle", None, "the car: a ROS 2 parameter file with a `vehicle` block"),
    ("stack", "gripsight", "topic names: a file of params/stacks, or a path to one like it"),
    ("params", str(project_folder() / "params" / "suite.yaml"), "parameters of the nodes"),
    ("bag", "", "play this bag into the suite, then stop"),
    ("rate", "1.0", "speed of the replay"),
    ("linger_s", "20.0", "time for the last run after the bag's end, s"),
    ("prior_mu", "", "publish this friction prior"),
    ("camera", "false", "use the camera's pictures for the friction prior"),
    ("gap", "false", "diagnose the gap too"),
]


def topics_of(stack: str) -> dict:
    """The car's topic for each of the suite's names."""
    path = Path(stack)
    if not path.is_file():
        path = project_folder() / "params" / "stacks" / f"{stack}.yaml"
    if not path.is_file():
        raise RuntimeError(f"no stack '{stack}': neither a file nor one of params/stacks")
    entries = yaml.safe_load(path.read_text()) or {}
    names = {name: entry.get("topic") if isinstance(entry, dict) else entry for name, entry in entries.items()}
    return {"file": str(path.resolve()), **{name: topic for name, topic in names.items() if topic}}


def nodes(context):
    """The nodes, as the launch arguments say."""
    value = {name: LaunchConfiguration(name).perform(context) for name, _, _ in ARGUMENTS}
    topics = topics_of(value["stack"])
    replay = {"reliable_inputs": True, "use_sim_time": True} if value["bag"] else {}

    def remaps(*names):
        return [(name, topics[name]) for name in names if name in topics]

    def node(name, remappings=(), prefix="", defaults=(), **parameters):
        return Node(
            prefix=prefix,
            package=f"gripsight_{name}",
            executable=name,
            name=name,
            parameters=[*defaults, value["params"], value["vehicle"], {**replay, **parameters}],
            remappings=list(remappings),
            output="screen",
        )

    started = [
        node("telemetry", remaps("odom", "drive", "imu", "wheels"), topics_file=topics["file"]),
        node(
            "s4_residual",
            [*remaps("odom", "drive"), ("sequence", "telemetry/sequence"), ("candidate", "identifier/candidate")],
        ),
        node(
            "identifier",
            [
                *remaps("odom", "drive"),
                ("sequence", "telemetry/sequence"),
                ("model", "s4_residual/model"),
                ("friction", "camera_prior/friction"),
            ],
        ),
    ]
    if value["camera"] == "true":
        settings = [str(project_folder() / "params" / "camera_prior.yaml")]
        started.append(node("camera_prior", remaps("odom", "image", "image/compressed"), defaults=settings))
    elif value["prior_mu"]:
        started.append(node("camera_prior", input="none", configured_mu=float(value["prior_mu"])))
    if value["gap"] == "true":
        # The diagnosis never stands in the way of the other nodes.
        topics_in = [("sequence", "telemetry/sequence"), ("pacejka", "identifier/pacejka")]
        started.append(node("gap_diagnosis", topics_in, prefix="nice -n 10"))
    if value["bag"]:
        player = Node(
            package="gripsight_bag_player",
            executable="bag_player",
            parameters=[{"bag": value["bag"], "rate": float(value["rate"])}],
            output="screen",
        )
        end = [TimerAction(period=float(value["linger_s"]), actions=[EmitEvent(event=Shutdown(reason="bag played"))])]
        started += [player, RegisterEventHandler(OnProcessExit(target_action=player, on_exit=end))]
    return started


def generate_launch_description():
    """What ros2 launch calls."""
    declared = [
        DeclareLaunchArgument(name, default_value=default, description=text)
        if default is not None
        else DeclareLaunchArgument(name, description=text)
        for name, default, text in ARGUMENTS
    ]
    return LaunchDescription([*declared, OpaqueFunction(function=nodes)])
