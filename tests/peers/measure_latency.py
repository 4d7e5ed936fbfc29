"""Measures the way from a sample to its live residual, and from SIGINT to the end; a CycloneDDS peer, as cyclone_peer.py, or a Fast DDS peer.

    measure_latency.py BAG [--peer cyclonedds|fastdds] [--seconds 600] [--hz 200] [--ends 20] [--bin FOLDER]

BAG is one of `gripsight simulate`, with its truth and vehicle file beside it. Its motion is published at --hz in real time, over and over, odometry
and drive commands both, stamped every 1/HZ s; telemetry, s4_residual and identifier run as they do on a car. Latency: the peer's clock
at the writing of a sample and at the arrival of its residual, so the peer's own share counts. The CycloneDDS peer is this process; that of Fast DDS is
fastdds_peer.cpp, compiled here, which writes messages that are serialized here. Lost: odometry without a residual, from the
first residual on. The end: SIGINT to each of the three nodes at work, --ends times, until its process has gone.
"""

import argparse
import csv
import math
import os
import pathlib
import signal
import shutil
import struct as binary
import subprocess
import tempfile
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
READERS = 2
TOPICS = {"odom": ("nav_msgs", "Odometry"), "drive": ("ackermann_msgs", "AckermannDriveStamped")}
NO_FAST_DDS = "no Fast DDS here: launch_scripts/setup.sh --tests installs it (Debian, Ubuntu: apt-get install libfastrtps-dev libfastcdr-dev)"


def start(binaries, name, vehicle):
    files = ["--params-file", ROOT / "params/suite.yaml", "--params-file", vehicle]
    command = [binaries / name, "--ros-args", *files, *NODES[name]]
    return subprocess.Popen([str(part) for part in command], stderr=subprocess.DEVNULL)


def wires(bag, hz):
    """A bag's motion at a rate, serialized before the first message, as the peer shall cost little: odometry and drive command of each moment."""
    with bag.with_suffix(".truth.csv").open() as file:
        rows = list(csv.DictReader(file))
    column = lambda name: np.array([float(row[name]) for row in rows])
    times = column("stamp_s") - float(rows[0]["stamp_s"])
    names = ("x_m", "y_m", "heading_rad", "v_x_mps", "v_y_mps", "yaw_rate_radps", "steering_front_rad")
    moments = np.arange(0.0, times[-1], 1.0 / hz)
    columns = np.stack([np.interp(moments, times, column(name)) for name in names], axis=1)
    columns[:, 3:6] += np.random.default_rng(1).normal(0, (0.02, 0.01, 0.01), (len(columns), 3))
    return [tuple(map(bytearray, wire(row))) for row in columns.tolist()]


def wire(row):
    x, y, heading, v_x, v_y, yaw_rate, steering = row
    pose = {"pose": {"position": {"x": x, "y": y}, "orientation": {"z": math.sin(heading / 2), "w": math.cos(heading / 2)}}}
    twist = {"twist": {"linear": {"x": v_x, "y": v_y}, "angular": {"z": yaw_rate}}}
    header = {"frame_id": "map"}
    odometry = build(struct(*TOPICS["odom"]), {"header": header, "child_frame_id": "base_link", "pose": pose, "twist": twist})
    drive = build(struct(*TOPICS["drive"]), {"header": header, "drive": {"steering_angle": steering, "speed": v_x}})
    return odometry.serialize(), drive.serialize()


class CycloneCar:
    """Drives, and hears residuals, in this process."""

    def __init__(self, wires, hz):
        os.environ["CYCLONEDDS_URI"] = CYCLONE
        participant = DomainParticipant(int(os.environ.get("ROS_DOMAIN_ID", 0)))
        kinds = [struct(*kind) for kind in TOPICS.values()]
        self.writers = [DataWriter(participant, Topic(participant, f"rt/{topic}", kind), qos("sensor")) for topic, kind in zip(TOPICS, kinds)]
        residuals = Topic(participant, "rt/s4_residual/residual", struct("gripsight_msgs", "Residual"))
        self.reader = DataReader(participant, residuals, qos("reliable"))
        self.wires, self.hz = wires, hz
        self.samples = [build(kind, None) for kind in kinds]
        for kind in kinds:
            kind.serialize = lambda sample, **_: bytes(sample.bytes_now)

    def publish(self, index, stamp_ns):
        """Writes drive and odometry of a moment, in this order; gives when."""
        for sample, wire in zip(self.samples, self.wires[index % len(self.wires)]):
            binary.pack_into("<iI", wire, 4, *divmod(stamp_ns, 10**9))
            sample.bytes_now = wire
        self.writers[1].write(self.samples[1])
        written = time.monotonic()
        self.writers[0].write(self.samples[0])
        return written

    def drive(self, seconds):
        """Lateness of each step, and for each sample when it was written and when its residual came, or None; in s."""
        sent, heard, running = {}, {}, True

        def listen():
            while running:
                for got in self.reader.take(N=50):
                    if got.sample_info.valid_data:
                        heard.setdefault(got.header.stamp.sec * 10**9 + got.header.stamp.nanosec, time.monotonic())
                time.sleep(0.0005)

        wait(lambda: all(len(writer.get_matched_subscriptions()) >= READERS for writer in self.writers), 20)
        threading.Thread(target=listen, daemon=True).start()
        try:
            begun, begun_ns, end, late = time.monotonic(), time.time_ns(), None, []
            index = 0
            while end is None or time.monotonic() < end:
                due = begun + index / self.hz
                time.sleep(max(0.0, due - time.monotonic()))
                late.append(time.monotonic() - due)
                stamp = begun_ns + int(1e9 * index / self.hz)
                written = self.publish(index, stamp)
                index += 1
                if heard and end is None:
                    end = time.monotonic() + seconds
                    print(f"first residual after {time.monotonic() - begun:.1f} s", flush=True)
                if end is None and time.monotonic() - begun > PREPARED_S:
                    raise SystemExit(f"no residual within {PREPARED_S:.0f} s")
                if end is not None:
                    sent[stamp] = written
            time.sleep(TAIL_S)
        finally:
            running = False
        return late, [(written, heard.get(stamp)) for stamp, written in sent.items()]


class FastCar:
    """Drives, and hears residuals, by fastdds_peer.cpp."""

    def __init__(self, wires, hz, folder):
        self.program, self.hz = folder / "fastdds_peer", hz
        source = pathlib.Path(__file__).parent / "fastdds_peer.cpp"
        system = ROOT / ".deps/system/usr"
        library = system / f"lib/{os.uname().machine}-linux-gnu"
        own = [f"-I{system}/include", f"-L{library}", f"-Wl,-rpath,{library}"] if system.exists() else []
        command = ["c++", "-std=c++14", "-O1", "-pthread", source, "-o", self.program, *own, "-lfastrtps", "-lfastcdr"]
        compiled = shutil.which("c++") and subprocess.run([str(part) for part in command], capture_output=True, text=True)
        if not compiled or compiled.returncode != 0:
            raise SystemExit(f"{NO_FAST_DDS}\n{compiled.stderr[:500] if compiled else 'no compiler c++'}")
        self.topics = []
        # The last topic is the one that is timed.
        for k, (topic, (package, name)) in reversed(list(enumerate(TOPICS.items()))):
            file = folder / topic
            file.write_bytes(b"".join(binary.pack("<I", len(moment[k])) + moment[k] for moment in wires))
            self.topics += [f"/{topic}", f"{package}/msg/{name}", file]

    def drive(self, seconds):
        command = [self.program, "play", self.hz, seconds, READERS, "/s4_residual/residual", "gripsight_msgs/msg/Residual", *self.topics]
        peer = subprocess.Popen([str(part) for part in command], stdout=subprocess.PIPE, text=True)
        late, samples = [], []
        for line in peer.stdout:
            words = line.split()
            if words[0] == "first":
                print(f"first residual after {float(words[1]):.1f} s", flush=True)
            elif words[0] != "ready":
                late.append(float(words[0]))
                if len(words) == 3:
                    samples.append((float(words[1]), None if words[2] == "-" else float(words[2])))
        if peer.wait() != 0:
            raise SystemExit("the Fast DDS peer found no readers in 20 s, or no residual came within a minute")
        return late, samples


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
    parser.add_argument("--peer", choices=["cyclonedds", "fastdds"], default="cyclonedds")
    parser.add_argument("--seconds", type=float, default=600.0)
    parser.add_argument("--hz", type=float, default=200.0)
    parser.add_argument("--ends", type=int, default=20)
    parser.add_argument("--bin", type=pathlib.Path, default=ROOT / "target/release")
    args = parser.parse_args()
    vehicle = args.bag.with_suffix(".vehicle.yaml")
    with tempfile.TemporaryDirectory() as folder:
        prepared = wires(args.bag, args.hz)
        car = FastCar(prepared, args.hz, pathlib.Path(folder)) if args.peer == "fastdds" else CycloneCar(prepared, args.hz)
        measure(car, args, vehicle)


def measure(car, args, vehicle):
    processes = [start(args.bin, name, vehicle) for name in NODES]
    try:
        late, samples = car.drive(args.seconds)
    finally:
        took = []
        for process in processes:
            asked = time.monotonic()
            process.send_signal(signal.SIGINT)
            process.wait(10)
            took.append(time.monotonic() - asked)
    latency_ms = [1e3 * (arrived - written) for written, arrived in samples if arrived is not None]
    took += ends(args.bin, vehicle, args.ends)
    load = os.getloadavg()
    print(f"{args.peer}: samples {len(samples)} at {args.hz:.0f} Hz, residuals {len(latency_ms)}, lost {len(samples) - len(latency_ms)}")
    lost_s = [f"{index / args.hz:.2f}" for index, (_, arrived) in enumerate(samples) if arrived is None]
    if lost_s:
        print(f"lost at, s: {', '.join(lost_s[:20])}{' ...' if len(lost_s) > 20 else ''}")
    print(f"sample to residual, ms: p50 {share(latency_ms, 0.5):.2f}, p99 {share(latency_ms, 0.99):.2f}, p99.9 {share(latency_ms, 0.999):.2f}, most {max(latency_ms):.2f}")
    print(f"the peer's own lateness, ms: p50 {1e3 * share(late, 0.5):.2f}, p99 {1e3 * share(late, 0.99):.2f}, most {1e3 * max(late):.2f}")
    print(f"SIGINT to the end, s, {len(took)} ends: p50 {share(took, 0.5):.3f}, p99 {share(took, 0.99):.3f}, most {max(took):.3f}")
    print(f"load of the machine: {load[0]:.1f} {load[1]:.1f} {load[2]:.1f} on {os.cpu_count()} processors")


if __name__ == "__main__":
    main()
