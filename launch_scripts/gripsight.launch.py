"""Starts the gripsight suite beside a racing stack, or on a bag.

ros2 launch launch_scripts/gripsight.launch.py vehicle:=car.yaml stack:=forzaeth
ros2 launch launch_scripts/gripsight.launch.py vehicle:=car.yaml bag:=run.mcap rate:=10.0
"""

from os.path import expanduser
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
    ("namespace", "", "the car's name, where several share a domain: nodes and the stack's topics are below it"),
    ("bag", "", "play this bag into the suite, then stop"),
    ("rate", "1.0", "speed of the replay"),
    ("linger_s", "20.0", "time for the last run after the bag's end, s"),
    ("prior_mu", "", "publish this friction prior"),
    ("camera", "false", "use the camera's pictures for the friction prior"),
    ("gap", "false", "diagnose the gap too"),
    ("drive", "", "drive the car, too: a parameter file of the node driver, its track among them"),
]

# As ROS 2 writes a switch, and Python.
SWITCH = ["true", "false", "True", "False"]


def is_true(text: str) -> bool:
    """What a switch says."""
    return text.lower() == "true"


def topics_of(stack: str, namespace: str) -> dict:
    """The car's topic for each of the suite's names; in a namespace they are relative to it."""
    path = Path(stack)
    if not path.is_file():
        path = project_folder() / "params" / "stacks" / f"{stack}.yaml"
    if not path.is_file():
        raise RuntimeError(f"no stack '{stack}': neither a file nor one of params/stacks")
    entries = yaml.safe_load(path.read_text()) or {}
    names = {name: entry.get("topic") if isinstance(entry, dict) else entry for name, entry in entries.items()}
    found = {name: topic.lstrip("/") if namespace else topic for name, topic in names.items() if topic}
    return {"file": str(path.resolve()), **found}


def check(value: dict) -> None:
    """Tells what is missing before anything has started: half a suite is worse than none."""
    for name in ("vehicle", "params"):
        if not Path(value[name]).is_file():
            raise RuntimeError(f"{name}:={value[name]}: no such file")
    if value["drive"] and not Path(value["drive"]).is_file():
        raise RuntimeError(f"drive:={value['drive']}: no such file")
    if value["bag"] and not Path(value["bag"]).exists():
        raise RuntimeError(f"bag:={value['bag']}: no such bag")


def ended(event, context):
    """Ends the suite with a node; by an error, which is ros2 launch's exit code 1, where it failed and was not asked to end."""
    if event.returncode and not context.is_shutdown:
        raise RuntimeError(f"{event.process_name} ended with exit code {event.returncode}, and the suite with it")
    return EmitEvent(event=Shutdown(reason=f"{event.process_name} ended"))


def nodes(context):
    """The nodes, as the launch arguments say. The end of one ends the suite: it runs whole or not at all."""
    # A shell leaves the ~ of `vehicle:=~/car.yaml` as it is.
    value = {name: expanduser(LaunchConfiguration(name).perform(context)) for name, _, _ in ARGUMENTS}
    check(value)
    space = value["namespace"].strip("/")
    topics = topics_of(value["stack"], space)
    # What a node names by the stack's own, absolute name is moved into the namespace.
    moved = sorted({(f"/{topic}", topic) for name, topic in topics.items() if name != "file"}) if space else []
    replay = {"reliable_inputs": True, "use_sim_time": True} if value["bag"] else {}

    def remaps(*names):
        return [(name, topics[name]) for name in names if name in topics]

    def node(name, remappings=(), prefix="", defaults=(), **parameters):
        return Node(
            prefix=prefix,
            package=f"gripsight_{name}",
            executable=name,
            name=name,
            # In launch's own lines; it would name the prefix.
            exec_name=name,
            namespace=f"/{space}" if space else None,
            parameters=[*defaults, value["params"], value["vehicle"], {**replay, **parameters}],
            remappings=list(remappings),
            # On the terminal, and in a file of the launch's log folder.
            output="both",
            on_exit=ended,
        )

    started = [
        node("telemetry", [*remaps("odom", "drive", "imu", "wheels"), *moved], topics_file=topics["file"]),
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
    if is_true(value["camera"]):
        settings = [str(project_folder() / "params" / "camera_prior.yaml")]
        started.append(node("camera_prior", [*remaps("odom", "image", "image/compressed"), ("pacejka", "identifier/pacejka")], defaults=settings))
    elif value["prior_mu"]:
        started.append(node("camera_prior", input="none", configured_mu=float(value["prior_mu"])))
    if is_true(value["gap"]):
        # The diagnosis never stands in the way of the other nodes.
        topics_in = [("sequence", "telemetry/sequence"), ("posterior", "identifier/posterior")]
        started.append(node("gap_diagnosis", topics_in, prefix="nice -n 10"))
    if value["drive"]:
        topics_in = [*remaps("odom", "drive"), ("pacejka", "identifier/pacejka"), ("grip", "identifier/grip"), ("progress", "identifier/progress"), ("extended_model", "gap_diagnosis/extended_model")]
        started.append(node("driver", topics_in, defaults=[value["drive"]]))
    if value["bag"]:
        player = Node(
            package="gripsight_bag_player",
            executable="bag_player",
            namespace=f"/{space}" if space else None,
            remappings=moved,
            parameters=[{"bag": value["bag"], "rate": float(value["rate"])}],
            output="both",
        )
        end = [TimerAction(period=float(value["linger_s"]), actions=[EmitEvent(event=Shutdown(reason="bag played"))])]
        started += [
            player,
            RegisterEventHandler(
                OnProcessExit(target_action=player, on_exit=lambda event, context: ended(event, context) if event.returncode else end)
            ),
        ]
    return started


def generate_launch_description():
    """What ros2 launch calls."""
    declared = [
        DeclareLaunchArgument(name, default_value=default, description=text, choices=SWITCH if default == "false" else None)
        for name, default, text in ARGUMENTS
    ]
    return LaunchDescription([*declared, OpaqueFunction(function=nodes)])
