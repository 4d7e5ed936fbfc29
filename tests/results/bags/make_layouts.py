"""Thirty layouts of one drive, as stacks record it; and what gripsight makes of each.

    .venv/bin/python tests/results/bags/make_layouts.py target/release/gripsight OUT [--table tests/results/bags/layouts.csv]

The drive is bags/demo_f1tenth.mcap. Bags are written by rosbags (PyPI), whose code gripsight shares nothing with. Of each bag the table
says whether `gripsight bag info` can use it as it is, with the topics file that it proposes, or refuses it, and with what line.
"""

import argparse
import csv
import json
import math
import shutil
import sqlite3
import subprocess
from pathlib import Path

import numpy as np
from mcap_ros2.reader import read_ros2_messages
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

ROOT = Path(__file__).resolve().parents[3]
STORE = get_typestore(Stores.ROS2_JAZZY)
TEXTS = {
    "ackermann_msgs/msg/AckermannDrive": "float32 steering_angle\nfloat32 steering_angle_velocity\nfloat32 speed\nfloat32 acceleration\nfloat32 jerk\n",
    "ackermann_msgs/msg/AckermannDriveStamped": "std_msgs/Header header\nackermann_msgs/AckermannDrive drive\n",
    "vesc_msgs/msg/VescState": "float64 temp_fet\nfloat64 temp_motor\nfloat64 current_motor\nfloat64 current_input\nfloat64 avg_id\nfloat64 avg_iq\n"
    "float64 duty_cycle\nfloat64 speed\nfloat64 voltage_input\nint32 displacement\nint32 distance_traveled\nint32 fault_code\n",
    "vesc_msgs/msg/VescStateStamped": "std_msgs/Header header\nvesc_msgs/VescState state\n",
    "autoware_vehicle_msgs/msg/VelocityReport": "std_msgs/Header header\nfloat32 longitudinal_velocity\nfloat32 lateral_velocity\nfloat32 heading_rate\n",
    "autoware_vehicle_msgs/msg/SteeringReport": "builtin_interfaces/Time stamp\nfloat32 steering_tire_angle\n",
    "autoware_control_msgs/msg/Lateral": "builtin_interfaces/Time stamp\nbuiltin_interfaces/Time control_time\nfloat32 steering_tire_angle\n"
    "float32 steering_tire_rotation_rate\nbool is_defined_steering_tire_rotation_rate\n",
    "autoware_control_msgs/msg/Longitudinal": "builtin_interfaces/Time stamp\nbuiltin_interfaces/Time control_time\nfloat32 velocity\n"
    "float32 acceleration\nfloat32 jerk\nbool is_defined_acceleration\nbool is_defined_jerk\n",
    "autoware_control_msgs/msg/Control": "builtin_interfaces/Time stamp\nbuiltin_interfaces/Time control_time\n"
    "autoware_control_msgs/Lateral lateral\nautoware_control_msgs/Longitudinal longitudinal\n",
    "raptor_dbw_msgs/msg/WheelSpeedReport": "std_msgs/Header header\nfloat32 front_left\nfloat32 front_right\nfloat32 rear_left\nfloat32 rear_right\n",
    "raptor_dbw_msgs/msg/SteeringReport": "std_msgs/Header header\nfloat32 steering_wheel_angle\nfloat32 steering_wheel_angle_cmd\nbool enabled\n",
    "car_msgs/msg/State": "std_msgs/Header header\nfloat64 x\nfloat64 y\nfloat64 yaw\nfloat32 vx\nfloat32 vy\nfloat32 yaw_rate\nfloat32 steering_deg\nuint8[] picture\n",
}
TEXTS["autoware_auto_vehicle_msgs/msg/VelocityReport"] = TEXTS["autoware_vehicle_msgs/msg/VelocityReport"]
TEXTS["autoware_auto_vehicle_msgs/msg/SteeringReport"] = TEXTS["autoware_vehicle_msgs/msg/SteeringReport"]
for name, text in TEXTS.items():
    STORE.register(get_types_from_msg(text, name))
T = STORE.types
TIME = T["builtin_interfaces/msg/Time"]


class Drive:
    """The drive, message by message, as dictionaries of plain numbers."""

    def __init__(self, bag, seconds=20.0):
        self.rows = {"odom": [], "drive": [], "imu": [], "wheels": []}
        first = None
        for m in read_ros2_messages(str(bag)):
            t, r = m.log_time_ns, m.ros_msg
            first = first or t
            if t - first > seconds * 1e9:
                break
            if m.channel.topic == "/car_state/odom":
                q, p, w = r.pose.pose.orientation, r.pose.pose.position, r.twist.twist
                self.rows["odom"].append((t, p.x, p.y, 2 * math.atan2(q.z, q.w), w.linear.x, w.linear.y, w.angular.z))
            elif m.channel.topic == "/drive":
                self.rows["drive"].append((t, r.drive.steering_angle, r.drive.speed, r.drive.acceleration))
            elif m.channel.topic == "/imu/data":
                a = r.linear_acceleration
                self.rows["imu"].append((t, a.x, a.y, a.z, r.angular_velocity.z))
            elif m.channel.topic == "/wheel_speeds":
                self.rows["wheels"].append((t, *r.velocity))

    def __getitem__(self, name):
        return self.rows[name]


def stamp(t):
    return TIME(sec=int(t // 10**9), nanosec=int(t % 10**9))


def header(t, frame="base_link"):
    return T["std_msgs/msg/Header"](stamp=stamp(t), frame_id=frame)


def vec(x=0.0, y=0.0, z=0.0):
    return T["geometry_msgs/msg/Vector3"](x=float(x), y=float(y), z=float(z))


def pose(x, y, yaw):
    position = T["geometry_msgs/msg/Point"](x=x, y=y, z=0.0)
    orientation = T["geometry_msgs/msg/Quaternion"](x=0.0, y=0.0, z=math.sin(yaw / 2), w=math.cos(yaw / 2))
    return T["geometry_msgs/msg/Pose"](position=position, orientation=orientation)


def odometry(row, v_y=True, moving=True):
    t, x, y, yaw, vx, vy, r = row
    twist = T["geometry_msgs/msg/Twist"](linear=vec(vx * moving, vy * v_y * moving), angular=vec(z=r * moving))
    return T["nav_msgs/msg/Odometry"](
        header=header(t, "map"),
        child_frame_id="base_link",
        pose=T["geometry_msgs/msg/PoseWithCovariance"](pose=pose(x, y, yaw), covariance=np.zeros(36)),
        twist=T["geometry_msgs/msg/TwistWithCovariance"](twist=twist, covariance=np.zeros(36)),
    )


def ackermann(row, stamped=True):
    t, angle, speed, acceleration = row
    drive = T["ackermann_msgs/msg/AckermannDrive"](
        steering_angle=angle, steering_angle_velocity=0.0, speed=speed, acceleration=acceleration, jerk=0.0
    )
    return T["ackermann_msgs/msg/AckermannDriveStamped"](header=header(t if stamped else 0), drive=drive)


def imu(row, force=1.0, turn=1.0):
    t, ax, ay, az, r = row
    return T["sensor_msgs/msg/Imu"](
        header=header(t),
        orientation=T["geometry_msgs/msg/Quaternion"](x=0.0, y=0.0, z=0.0, w=1.0),
        orientation_covariance=np.zeros(9),
        angular_velocity=vec(z=r * turn),
        angular_velocity_covariance=np.zeros(9),
        linear_acceleration=vec(ax * force, ay * force, az * force),
        linear_acceleration_covariance=np.zeros(9),
    )


def joints(row):
    t, *speeds = row
    names = ["wheel_fl", "wheel_fr", "wheel_rl", "wheel_rr"]
    return T["sensor_msgs/msg/JointState"](header=header(t), name=names, position=np.zeros(4), velocity=np.array(speeds), effort=np.zeros(0))


def number(kind, value):
    return T[f"std_msgs/msg/{kind}"](data=float(value))


def standard(d, odom="/car_state/odom", drive="/drive"):
    yield odom, "nav_msgs/msg/Odometry", [(r[0], odometry(r)) for r in d["odom"]]
    yield drive, "ackermann_msgs/msg/AckermannDriveStamped", [(r[0], ackermann(r)) for r in d["drive"]]


def with_imu(d, **options):
    yield from standard(d)
    yield "/imu/data", "sensor_msgs/msg/Imu", [(r[0], imu(r, **options)) for r in d["imu"]]


def with_wheels(d):
    yield from standard(d)
    yield "/joint_states", "sensor_msgs/msg/JointState", [(r[0], joints(r)) for r in d["wheels"]]


def vesc_core(d):
    """ERPM and servo position, as a VESC has them, with a particle filter's poses and an inertial unit in g and degrees."""
    def state(t, speed):
        zeros = dict.fromkeys(["temp_fet", "temp_motor", "current_motor", "current_input", "avg_id", "avg_iq", "duty_cycle", "voltage_input"], 0.0)
        inner = T["vesc_msgs/msg/VescState"](**zeros, speed=4614.0 * speed, displacement=0, distance_traveled=0, fault_code=0)
        return T["vesc_msgs/msg/VescStateStamped"](header=header(t), state=inner)

    yield "/sensors/core", "vesc_msgs/msg/VescStateStamped", [(r[0], state(r[0], r[4])) for r in d["odom"]]
    yield "/commands/servo/position", "std_msgs/msg/Float64", [(r[0], number("Float64", -1.2135 * r[1] + 0.5304)) for r in d["drive"]]
    yield "/sensors/imu/raw", "sensor_msgs/msg/Imu", [(r[0], imu(r, 1 / 9.80665, 180 / math.pi)) for r in d["imu"]]
    yield "/pf/viz/inferred_pose", "geometry_msgs/msg/PoseStamped", poses(d)


def poses(d, kind="PoseStamped", every=3):
    made = []
    for t, x, y, yaw, *_ in d["odom"][::every]:
        if kind == "PoseStamped":
            made.append((t, T["geometry_msgs/msg/PoseStamped"](header=header(t, "map"), pose=pose(x, y, yaw))))
        else:
            inner = T["geometry_msgs/msg/PoseWithCovariance"](pose=pose(x, y, yaw), covariance=np.zeros(36))
            made.append((t, T["geometry_msgs/msg/PoseWithCovarianceStamped"](header=header(t, "map"), pose=inner)))
    return made


def f1tenth(d):
    """Odometry of the motor and the servo, without v_y."""
    yield "/odom", "nav_msgs/msg/Odometry", [(r[0], odometry(r, v_y=False)) for r in d["odom"]]
    yield "/drive", "ackermann_msgs/msg/AckermannDriveStamped", [(r[0], ackermann(r)) for r in d["drive"]]
    yield "/sensors/imu/raw", "sensor_msgs/msg/Imu", [(r[0], imu(r, 1 / 9.80665, 180 / math.pi)) for r in d["imu"]]
    yield "/pf/pose", "geometry_msgs/msg/PoseStamped", poses(d)


def gym(d):
    yield "/ego_racecar/odom", "nav_msgs/msg/Odometry", [(r[0], odometry(r)) for r in d["odom"]]
    yield "/opp_racecar/odom", "nav_msgs/msg/Odometry", [(r[0], odometry(r, moving=False)) for r in d["odom"]]
    yield "/drive", "ackermann_msgs/msg/AckermannDriveStamped", [(r[0], ackermann(r)) for r in d["drive"]]


def forzaeth(d):
    yield from standard(d)
    yield "/vesc/odom", "nav_msgs/msg/Odometry", [(r[0], odometry(r, v_y=False)) for r in d["odom"]]
    yield "/vesc/sensors/imu/raw", "sensor_msgs/msg/Imu", [(r[0], imu(r)) for r in d["imu"]]


def autoware(d, package="autoware_vehicle_msgs", odom=True, command=True):
    velocity, steering = T[f"{package}/msg/VelocityReport"], T[f"{package}/msg/SteeringReport"]
    yield "/vehicle/status/velocity_status", f"{package}/msg/VelocityReport", [
        (t, velocity(header=header(t), longitudinal_velocity=vx, lateral_velocity=vy, heading_rate=w)) for t, _, _, _, vx, vy, w in d["odom"]
    ]
    yield "/vehicle/status/steering_status", f"{package}/msg/SteeringReport", [
        (r[0], steering(stamp=stamp(r[0]), steering_tire_angle=r[1])) for r in d["drive"]
    ]
    if odom:
        yield "/localization/kinematic_state", "nav_msgs/msg/Odometry", [(r[0], odometry(r)) for r in d["odom"]]
    if command:
        def control(t, angle, speed, acceleration):
            lateral = T["autoware_control_msgs/msg/Lateral"](
                stamp=stamp(t), control_time=stamp(t), steering_tire_angle=angle, steering_tire_rotation_rate=0.0,
                is_defined_steering_tire_rotation_rate=False,
            )
            longitudinal = T["autoware_control_msgs/msg/Longitudinal"](
                stamp=stamp(t), control_time=stamp(t), velocity=speed, acceleration=acceleration, jerk=0.0,
                is_defined_acceleration=True, is_defined_jerk=False,
            )
            return T["autoware_control_msgs/msg/Control"](stamp=stamp(t), control_time=stamp(t), lateral=lateral, longitudinal=longitudinal)

        yield "/control/command/control_cmd", "autoware_control_msgs/msg/Control", [(r[0], control(*r)) for r in d["drive"]]


def indy(d):
    yield "/localization/odometry", "nav_msgs/msg/Odometry", [(r[0], odometry(r)) for r in d["odom"]]
    wheel, steer = T["raptor_dbw_msgs/msg/WheelSpeedReport"], T["raptor_dbw_msgs/msg/SteeringReport"]
    yield "/raptor_dbw_interface/wheel_speed_report", "raptor_dbw_msgs/msg/WheelSpeedReport", [
        (t, wheel(header=header(t), front_left=a, front_right=b, rear_left=c, rear_right=e)) for t, a, b, c, e in d["wheels"]
    ]
    yield "/raptor_dbw_interface/steering_report", "raptor_dbw_msgs/msg/SteeringReport", [
        (r[0], steer(header=header(r[0]), steering_wheel_angle=15.0 * math.degrees(r[1]), steering_wheel_angle_cmd=0.0, enabled=True))
        for r in d["drive"]
    ]


def mocap(d):
    """Motion capture and a steering command; nothing else."""
    yield "/vrpn_mocap/car/pose", "geometry_msgs/msg/PoseStamped", poses(d, every=1)
    yield "/drive", "ackermann_msgs/msg/AckermannDriveStamped", [(r[0], ackermann(r)) for r in d["drive"]]


def twist(d):
    made = []
    for t, _, _, _, vx, vy, w in d["odom"]:
        inner = T["geometry_msgs/msg/Twist"](linear=vec(vx, vy), angular=vec(z=w))
        made.append((t, T["geometry_msgs/msg/TwistStamped"](header=header(t), twist=inner)))
    yield "/ekf/twist", "geometry_msgs/msg/TwistStamped", made
    yield "/amcl_pose", "geometry_msgs/msg/PoseWithCovarianceStamped", poses(d, "cov")
    yield "/steering_command", "std_msgs/msg/Float32", [(r[0], number("Float32", r[1])) for r in d["drive"]]


def plain_drive(d):
    yield "/odom", "nav_msgs/msg/Odometry", [(r[0], odometry(r)) for r in d["odom"]]
    yield "/ackermann_cmd", "ackermann_msgs/msg/AckermannDrive", [(r[0], ackermann(r).drive) for r in d["drive"]]


def unstamped(d):
    yield "/odom", "nav_msgs/msg/Odometry", [(r[0], odometry(r)) for r in d["odom"]]
    yield "/drive", "ackermann_msgs/msg/AckermannDriveStamped", [(r[0], ackermann(r, stamped=False)) for r in d["drive"]]


def custom(d):
    steer = sorted(d["drive"])
    state, place = T["car_msgs/msg/State"], 0
    made = []
    for t, x, y, yaw, vx, vy, w in d["odom"]:
        while place + 1 < len(steer) and steer[place + 1][0] <= t:
            place += 1
        made.append((t, state(header=header(t), x=x, y=y, yaw=yaw, vx=vx, vy=vy, yaw_rate=w,
                              steering_deg=math.degrees(steer[place][1]), picture=np.zeros(37, dtype=np.uint8))))
    yield "/car/state", "car_msgs/msg/State", made


def write(path, topics, plugin=StoragePlugin.SQLITE3, mode=None, version=9, part=None):
    writer = Writer(path, version=version, storage_plugin=plugin)
    if mode:
        writer.set_compression(mode, CompressionFormat.ZSTD)
    with writer:
        messages = []
        for name, kind, rows in topics:
            connection = writer.add_connection(name, kind, typestore=STORE)
            messages += [(t, connection, STORE.serialize_cdr(m, kind)) for t, m in rows]
        messages.sort(key=lambda m: m[0])
        if part is not None:
            messages = messages[len(messages) * part // 2 : len(messages) * (part + 1) // 2]
        for t, connection, data in messages:
            writer.write(connection, t, data)


def split(path, topics, plugin, ending):
    topics = list(topics)
    path.mkdir()
    for part in range(2):
        half = path / f"half{part}"
        write(half, topics, plugin, part=part)
        [made] = half.glob(f"*{ending}")
        made.rename(path / f"bag_{part}{ending}")
        text = (half / "metadata.yaml").read_text()
        shutil.rmtree(half)
    text = text.replace(f"- half1{ending}", f"- bag_0{ending}\n  - bag_1{ending}", 1).replace("half1", "bag_1")
    (path / "metadata.yaml").write_text(text)


def without_definitions(path):
    """As Humble writes it: no table of message definitions."""
    [file] = path.glob("*.db3")
    db = sqlite3.connect(file)
    db.execute("DROP TABLE IF EXISTS message_definitions")
    db.execute("DROP TABLE IF EXISTS schema")
    db.commit()
    db.close()


def texts_beside(folder, package):
    for name, text in TEXTS.items():
        if name.startswith(package):
            file = folder / (name + ".msg")
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_text(text)


def ros1(path, d):
    store = get_typestore(Stores.ROS1_NOETIC)
    with Writer1(path) as writer:
        connection = writer.add_connection("/count", "std_msgs/msg/Float64", typestore=store)
        for t, *_ in d["odom"][:50]:
            writer.write(connection, t, store.serialize_ros1(store.types["std_msgs/msg/Float64"](data=1.0), "std_msgs/msg/Float64"))


def layouts(out, d):
    sql, mcap = StoragePlugin.SQLITE3, StoragePlugin.MCAP
    message, whole = CompressionMode.MESSAGE, CompressionMode.FILE

    def plain(name, topics, **options):
        write(out / name, topics, **options)
        return out / name

    yield "MCAP file of the suite", ROOT / "bags/demo_f1tenth.mcap"
    yield "rosbag2 folder, MCAP", plain("mcap", standard(d), plugin=mcap)
    yield "rosbag2 folder, sqlite3", plain("db3", standard(d))
    yield "the .db3 file alone", next(plain("db3_alone", with_imu(d)).glob("*.db3"))
    yield "sqlite3, each message zstd", plain("db3_message", with_imu(d), mode=message)
    yield "sqlite3, the file zstd", plain("db3_file", with_imu(d), mode=whole)
    yield "MCAP, each message zstd", plain("mcap_message", with_imu(d), plugin=mcap, mode=message)
    yield "MCAP, the file zstd", plain("mcap_file", with_imu(d), plugin=mcap, mode=whole)
    for ending, plugin in ((".db3", sql), (".mcap", mcap)):
        path = out / f"split_{ending[1:]}"
        split(path, with_wheels(d), plugin, ending)
        yield f"split into two {ending} files", path
    path = plain("no_metadata", with_wheels(d))
    (path / "metadata.yaml").unlink()
    yield "sqlite3 folder without metadata.yaml", path
    path = plain("humble", with_imu(d), version=8)
    without_definitions(path)
    yield "sqlite3 of Humble, no definitions, standard types", path
    yield "F1TENTH: odometry without v_y, IMU in g and deg/s, poses", plain("f1tenth", f1tenth(d))
    yield "VESC state and servo alone, IMU in g and deg/s, poses", plain("vesc", vesc_core(d), plugin=mcap)
    path = plain("vesc_humble", vesc_core(d), version=8)
    without_definitions(path)
    texts_beside(path, "vesc_msgs")
    yield "the same of Humble, .msg text beside it", path
    path = plain("vesc_blind", vesc_core(d), version=8)
    without_definitions(path)
    yield "the same, no .msg text (the suite knows the types)", path
    path = plain("own_blind", custom(d), version=8)
    without_definitions(path)
    yield "sqlite3 of Humble, one's own type, no .msg text", path
    texts_beside(plain("own_text", custom(d), version=8), "car_msgs")
    without_definitions(out / "own_text")
    yield "the same, .msg text beside it", out / "own_text"
    yield "gym: two cars' odometry", plain("gym", gym(d))
    yield "ForzaETH: two odometries, IMU", plain("forzaeth", forzaeth(d))
    yield "Autoware: all of it", plain("autoware", autoware(d))
    yield "Autoware: vehicle reports and command alone", plain("autoware_reports", autoware(d, odom=False))
    yield "Autoware.Auto: reports, measured steering alone", plain("autoware_auto", autoware(d, "autoware_auto_vehicle_msgs", False, False))
    yield "Indy: steering wheel in degrees, wheel speeds, custom types", plain("indy", indy(d))
    yield "motion capture and a command", plain("mocap", mocap(d))
    yield "TwistStamped, AMCL pose, steering as Float32", plain("twist", twist(d))
    yield "AckermannDrive without a header", plain("plain_drive", plain_drive(d))
    yield "drive messages never stamped", plain("unstamped", unstamped(d))
    yield "one message of one's own, steering in degrees", plain("custom", custom(d), plugin=mcap)
    path = out / "ros1.bag"
    ros1(path, d)
    yield "ROS 1 bag", path


def judge(gripsight, bag, work):
    """Read as it is, with the proposal, or refused with which line."""
    def info(*options):
        run = subprocess.run([gripsight, "bag", "info", bag, "--json", *options], capture_output=True, text=True)
        if run.returncode:
            return None, run.stderr.strip().splitlines()[-1]
        telemetry = json.loads(run.stdout)["telemetry"]
        if "nothing" in telemetry:
            return None, telemetry["nothing"]
        return telemetry["sequences"]["health"][0], ""

    health, why = info()
    if health:
        return "as it is", health, ""
    topics = work / "topics.yaml"
    topics.unlink(missing_ok=True)
    health, late = info("--write-topics", topics)
    if health:
        topics.rename(work / f"{Path(bag).stem}.topics.yaml")
        return "with the proposal", health, ""
    return "refused", None, late or why


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("gripsight", type=Path)
    arguments.add_argument("out", type=Path)
    arguments.add_argument("--table", type=Path)
    given = arguments.parse_args()
    shutil.rmtree(given.out, ignore_errors=True)
    given.out.mkdir(parents=True)
    rows = []
    for name, bag in layouts(given.out, Drive(ROOT / "bags/demo_f1tenth.mcap")):
        verdict, health, why = judge(given.gripsight.resolve(), bag, given.out)
        found = "" if health is None else f"{health['samples']} samples, {health['rate_hz']:.0f} Hz; {' '.join(health['recorded'])}"
        why = why.replace(str(given.out), "OUT").replace(str(ROOT), "")
        rows.append((name, verdict, found, why))
        print(*rows[-1], sep=" | ", flush=True)
    read = sum(row[1] != "refused" for row in rows)
    print(f"{read} of {len(rows)} read")
    if given.table:
        with given.table.open("w", newline="") as file:
            csv.writer(file, lineterminator="\n").writerows([("layout", "verdict", "found", "refused with"), *rows])


main()
