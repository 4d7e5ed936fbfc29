"""Measures the way from a sample to its live residual, and from SIGINT to the end; a CycloneDDS peer, as cyclone_peer.py.

    measure_latency.py BAG [--seconds 600] [--hz 200] [--ends 20] [--bin FOLDER]

BAG is one of `gripsight simulate`, with its truth and vehicle file beside it. Its motion is published at --hz in real time, over and over, odometry
and drive commands both, stamped every 1/HZ s; telemetry, s4_residual and identifier run as they do on a car. Latency: this process's clock
at the writing of a sample and at the arrival of its residual, so the peer's own share counts. Lost: odometry without a residual, from the
first residual on. The end: SIGINT to each of the three nodes at work, --ends times, until its process has gone.
"""

import argparse
import csv
import math
import os
import pathlib
import signal
import struct as binary
import subprocess
import threading
import time

import numpy as np
from cyclone_peer import build, qos, struct
from cyclonedds.domain import DomainParticipant
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic

from fault_campaign import CYCLONE, NODES, ROOT, wait

PREPARED_S = 60.0
TAIL_S = 1.0


def start(binaries, name, vehicle):
    files = ["--params-file", ROOT / "params/suite.yaml", "--params-file", vehicle]
    command = [binaries / name, "--ros-args", *files, *NODES[name]]
    return subprocess.Popen([str(part) for part in command], stderr=subprocess.DEVNULL)


class Car:
    """A bag's motion at a rate, serialized before the first message: this process shall cost little."""

    def __init__(self, bag, participant, hz):
        with bag.with_suffix(".truth.csv").open() as file:
            rows = list(csv.DictReader(file))
        column = lambda name: np.array([float(row[name]) for row in rows])
        times = column("stamp_s") - float(rows[0]["stamp_s"])
        names = ("x_m", "y_m", "heading_rad", "v_x_mps", "v_y_mps", "yaw_rate_radps", "steering_front_rad")
        self.hz = hz
        moments = np.arange(0.0, times[-1], 1.0 / hz)
        columns = np.stack([np.interp(moments, times, column(name)) for name in names], axis=1)
        kinds = struct("nav_msgs", "Odometry"), struct("ackermann_msgs", "AckermannDriveStamped")
        self.writers = [DataWriter(participant, Topic(participant, topic, kind), qos("sensor"))
                        for topic, kind in zip(("rt/odom", "rt/drive"), kinds)]
        columns[:, 3:6] += np.random.default_rng(1).normal(0, (0.02, 0.01, 0.01), (len(columns), 3))
        self.wires = [tuple(map(bytearray, self.wire(kinds, row))) for row in columns.tolist()]
        self.samples = [build(kind, None) for kind in kinds]
        for kind in kinds:
            kind.serialize = lambda sample, **_: bytes(sample.bytes_now)

    @staticmethod
    def wire(kinds, row):
        x, y, heading, v_x, v_y, yaw_rate, steering = row
        pose = {"pose": {"position": {"x": x, "y": y}, "orientation": {"z": math.sin(heading / 2), "w": math.cos(heading / 2)}}}
        twist = {"twist": {"linear": {"x": v_x, "y": v_y}, "angular": {"z": yaw_rate}}}
        header = {"frame_id": "map"}
        odometry = build(kinds[0], {"header": header, "child_frame_id": "base_link", "pose": pose, "twist": twist})
        drive = build(kinds[1], {"header": header, "drive": {"steering_angle": steering, "speed": v_x}})
        return odometry.serialize(), drive.serialize()

    def publish(self, index, stamp_ns):
        """Writes drive and odometry of a moment, in this order; gives when."""
        for sample, wire in zip(self.samples, self.wires[index % len(self.wires)]):
            binary.pack_into("<iI", wire, 4, *divmod(stamp_ns, 10**9))
            sample.bytes_now = wire
        self.writers[1].write(self.samples[1])
        written = time.monotonic()
        self.writers[0].write(self.samples[0])
        return written


def ends(binaries, vehicle, count):
    """From SIGINT to the end of each node, s."""
    took = []
    for _ in range(count):
        processes = [start(binaries, name, vehicle) for name in NODES]
        time.sleep(1.0)
        for process in processes:
            begun = time.monotonic()
            process.send_signal(signal.SIGINT)
            process.wait(10)
            took.append(time.monotonic() - begun)
    return took


def share(values, part):
    return sorted(values)[min(len(values) - 1, int(part * len(values)))]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("bag", type=pathlib.Path)
    parser.add_argument("--seconds", type=float, default=600.0)
    parser.add_argument("--hz", type=float, default=200.0)
    parser.add_argument("--ends", type=int, default=20)
    parser.add_argument("--bin", type=pathlib.Path, default=ROOT / "target/release")
    args = parser.parse_args()
    vehicle = args.bag.with_suffix(".vehicle.yaml")
    os.environ["CYCLONEDDS_URI"] = CYCLONE
    participant = DomainParticipant(int(os.environ.get("ROS_DOMAIN_ID", 0)))
    car = Car(args.bag, participant, args.hz)
    reader = DataReader(participant, Topic(participant, "rt/s4_residual/residual", struct("gripsight_msgs", "Residual")), qos("reliable"))
    processes = [start(args.bin, name, vehicle) for name in NODES]
    sent, heard, running = {}, {}, True

    def listen():
        while running:
            for got in reader.take(N=50):
                if got.sample_info.valid_data:
                    heard.setdefault(got.header.stamp.sec * 10**9 + got.header.stamp.nanosec, time.monotonic())
            time.sleep(0.0005)

    try:
        wait(lambda: all(len(writer.get_matched_subscriptions()) >= 2 for writer in car.writers), 20)
        threading.Thread(target=listen, daemon=True).start()
        begun, begun_ns, end, late = time.monotonic(), time.time_ns(), None, []
        index = 0
        while end is None or time.monotonic() < end:
            due = begun + index / args.hz
            time.sleep(max(0.0, due - time.monotonic()))
            late.append(time.monotonic() - due)
            stamp = begun_ns + int(1e9 * index / args.hz)
            written = car.publish(index, stamp)
            index += 1
            if heard and end is None:
                end = time.monotonic() + args.seconds
                print(f"first residual after {time.monotonic() - begun:.1f} s", flush=True)
            if end is None and time.monotonic() - begun > PREPARED_S:
                raise SystemExit(f"no residual within {PREPARED_S:.0f} s")
            if end is not None:
                sent[stamp] = written
        time.sleep(TAIL_S)
    finally:
        running = False
        took = []
        for process in processes:
            asked = time.monotonic()
            process.send_signal(signal.SIGINT)
            process.wait(10)
            took.append(time.monotonic() - asked)
    latency_ms = [1e3 * (heard[stamp] - written) for stamp, written in sent.items() if stamp in heard]
    took += ends(args.bin, vehicle, args.ends)
    load = os.getloadavg()
    print(f"samples {len(sent)} at {args.hz:.0f} Hz, residuals {len(latency_ms)}, lost {len(sent) - len(latency_ms)}")
    print(f"sample to residual, ms: p50 {share(latency_ms, 0.5):.2f}, p99 {share(latency_ms, 0.99):.2f}, p99.9 {share(latency_ms, 0.999):.2f}, most {max(latency_ms):.2f}")
    print(f"the peer's own lateness, ms: p50 {1e3 * share(late, 0.5):.2f}, p99 {1e3 * share(late, 0.99):.2f}, most {1e3 * max(late):.2f}")
    print(f"SIGINT to the end, s, {len(took)} ends: p50 {share(took, 0.5):.3f}, p99 {share(took, 0.99):.3f}, most {max(took):.3f}")
    print(f"load of the machine: {load[0]:.1f} {load[1]:.1f} {load[2]:.1f} on {os.cpu_count()} processors")


if __name__ == "__main__":
    main()
