"""Reads a bag with an independent reader and prints what it found as JSON: read_bag.py rosbags|mcap_ros2 BAG."""

import json
import sys
from collections import Counter
from pathlib import Path


def with_rosbags(path):
    from rosbags.rosbag2 import Reader
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS2_JAZZY)
    with Reader(path) as reader:
        extra = {}
        for connection in reader.connections:
            if connection.msgtype not in store.types:
                extra.update(get_types_from_msg(connection.msgdef.data, connection.msgtype))
        store.register({name: fields for name, fields in extra.items() if name not in store.types})
        for connection, _, data in reader.messages():
            yield connection.topic, store.deserialize_cdr(data, connection.msgtype)
        yield "duration_ns", reader.duration


def with_mcap_ros2(path):
    from mcap_ros2.reader import read_ros2_messages

    for message in read_ros2_messages(str(path)):
        yield message.channel.topic, message.ros_msg


def numbers(values):
    return [float(v) for v in values]


def main():
    reader = {"rosbags": with_rosbags, "mcap_ros2": with_mcap_ros2}[sys.argv[1]]
    found = {"counts": Counter()}
    for topic, m in reader(Path(sys.argv[2])):
        if topic == "duration_ns":
            found[topic] = m
            continue
        found["counts"][topic] += 1
        if topic == "/odom":
            stamp = m.header.stamp
            found["odom"] = {
                "stamp_ns": stamp.sec * 10**9 + stamp.nanosec,
                "frames": [m.header.frame_id, m.child_frame_id],
                "x": m.pose.pose.position.x,
                "v_y": m.twist.twist.linear.y,
                "yaw_rate": m.twist.twist.angular.z,
            }
        elif topic == "/drive":
            found["drive"] = {"steering_angle": m.drive.steering_angle}
        elif topic == "/wheels":
            found["wheels"] = {"name": list(m.name), "velocity": numbers(m.velocity)}
        elif topic == "/telemetry/sequence":
            found["sequence"] = {
                "v_x_mps": numbers(m.v_x_mps),
                "seed": int(m.handshake.seed),
                "run_id": m.handshake.run_id,
                "a_x": len(m.a_x_mps2),
            }
    json.dump(found, sys.stdout)


main()
