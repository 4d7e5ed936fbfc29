"""Measures the node camera_prior against a CycloneDDS publisher: CPU a frame, latency from stamp to prior, frames dropped.

    measure_camera_prior.py BINARY PICTURE (raw|jpeg) [--frames 300] [--rate 30] [--speed 10] [--then PICTURE] [--set NAME:=VALUE ...]

PICTURE is a usable road picture, a binary PPM (P6) for raw, else a JPEG. Every frame
differs in its last bytes, with JPEG behind the end marker, as a live camera's frames do. CPU: user and system time of
the node's process between the first and the last frame, from /proc, over the frames sent; it includes receiving them. A
prior carries its picture's stamp, so frames that yield no prior are counted as lost or dropped; the node's diagnostics say
which. --speed sends odometry of a car that drives so fast, m/s, 50 times a second. Latency: this process's clock at the
stamp and at the arrival of the prior, so the publisher's own writing time counts. --then: from the middle on the camera sees this road; how long mu takes for
half and for 90 % of the way between what it was before and what it is in the end, from the first stamp of that road to the arrival of the prior.
"""

import argparse
import os
import pathlib
import statistics
import struct as binary
import subprocess
import threading
import time

from cyclone_peer import build, qos, struct
from cyclonedds.domain import DomainParticipant
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic

# Bytes that change from frame to frame: more than the node leaves out where it looks for a frozen camera, fewer than hide a JPEG's end.
CHANGED = {"raw": 64, "jpeg": 32}
ROOT = pathlib.Path(__file__).resolve().parents[2]


def pixels(path):
    """Width, height and pixels of a P6 file without comments."""
    magic, width, height, rest = path.read_bytes().split(maxsplit=3)
    levels, data = rest[:3], rest[4:]
    assert (magic, levels, len(data)) == (b"P6", b"255", 3 * int(width) * int(height)), path
    return int(width), int(height), data


def message(form, path):
    """A kind of message, its topic and its serialised form; the stamp is at byte 4."""
    header = {"frame_id": "camera"}
    if form == "raw":
        kind, (width, height, data) = struct("sensor_msgs", "Image"), pixels(path)
        sample = {"header": header, "height": height, "width": width, "encoding": "rgb8", "step": 3 * width}
        topic = "rt/image"
    else:
        kind, data = struct("sensor_msgs", "CompressedImage"), path.read_bytes() + bytes(CHANGED[form])
        sample, topic = {"header": header, "format": "jpeg"}, "rt/image/compressed"
    head = build(kind, sample).serialize()
    # The empty sequence's length is the last word: the bytes follow it.
    return kind, topic, bytearray(head[:-4] + binary.pack("<I", len(data)) + data)


def cpu_s(pid):
    fields = pathlib.Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def percentile(values, share):
    return sorted(values)[min(len(values) - 1, int(share * len(values)))]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("binary")
    parser.add_argument("picture", type=pathlib.Path)
    parser.add_argument("form", choices=["raw", "jpeg"])
    parser.add_argument("--frames", type=int, default=300)
    parser.add_argument("--rate", type=float, default=30.0)
    parser.add_argument("--speed", type=float, help="send odometry of a car that drives so fast, m/s")
    parser.add_argument("--then", type=pathlib.Path, metavar="PICTURE", help="another road, seen from the middle on")
    parser.add_argument("--set", action="append", default=[], metavar="NAME:=VALUE", help="a parameter of the node")
    args = parser.parse_args()
    model = ROOT / "nodes/camera_prior/model/road_mobilenet_v3_small.onnx"
    library = ROOT / ".deps/onnxruntime/libonnxruntime.so"
    settings = {"input": "raw" if args.form == "raw" else "compressed", "model": model, "onnxruntime_library": library}
    parameters = [part for name, value in settings.items() for part in ("-p", f"{name}:={value}")]
    parameters += [part for setting in args.set for part in ("-p", setting)]
    node = subprocess.Popen([args.binary, "--ros-args", *parameters], stderr=subprocess.DEVNULL)
    participant = DomainParticipant(int(os.environ.get("ROS_DOMAIN_ID", 0)))
    kind, topic, frame = message(args.form, args.picture)
    frames = [frame, frame if args.then is None else message(args.form, args.then)[2]]
    kind.serialize = lambda self, **_: bytes(frame)
    writer = DataWriter(participant, Topic(participant, topic, kind), qos("sensor"))
    prior = struct("gripsight_msgs", "FrictionPrior")
    reader = DataReader(participant, Topic(participant, "rt/camera_prior/friction", prior), qos("reliable"))
    odometry = struct("nav_msgs", "Odometry")
    driven = DataWriter(participant, Topic(participant, "rt/odom", odometry), qos("sensor"))
    sample, sent, heard, running = build(kind, None), {}, {}, True

    def drive():
        while running:
            now = time.time()
            header = {"stamp": {"sec": int(now), "nanosec": int(now % 1 * 1e9)}, "frame_id": "odom"}
            driven.write(build(odometry, {"header": header, "twist": {"twist": {"linear": {"x": args.speed}}}}))
            time.sleep(0.02)

    def listen():
        while running:
            for got in reader.take(N=50):
                heard.setdefault((got.header.stamp.sec, got.header.stamp.nanosec), (time.time(), got))
            time.sleep(0.0005)

    try:
        while not (writer.get_matched_subscriptions() and reader.get_matched_publications()):
            time.sleep(0.05)
        listener = threading.Thread(target=listen)
        listener.start()
        if args.speed is not None:
            threading.Thread(target=drive).start()
        time.sleep(1.5)
        before, idle = cpu_s(node.pid), time.monotonic()
        time.sleep(2.0)
        idle = (cpu_s(node.pid) - before) / (time.monotonic() - idle)
        warm, start = 15, time.monotonic()
        for index in range(warm + args.frames):
            time.sleep(max(0.0, start + index / args.rate - time.monotonic()))
            if index == warm:
                cpu, busy = cpu_s(node.pid), time.monotonic()
            frame = frames[index >= warm + args.frames // 2]
            now = time.time()
            stamp = (int(now), int(now % 1 * 1e9))
            binary.pack_into("<iI", frame, 4, *stamp)
            frame[-CHANGED[args.form] :] = index.to_bytes(8, "little") * (CHANGED[args.form] // 8)
            if index >= warm:
                sent[stamp] = now
            writer.write(sample)
        time.sleep(1.0 / args.rate)
        cpu, busy = cpu_s(node.pid) - cpu, time.monotonic() - busy
        time.sleep(1.0)
    finally:
        running = False
        node.terminate()
    node.wait()
    answered = [(heard[stamp][0] - now, heard[stamp][1]) for stamp, now in sent.items() if stamp in heard]
    reasons = sorted({got.reason for _, got in answered if not got.valid})
    latency_ms = [1e3 * seconds for seconds, _ in answered]
    print(f"{args.form} {args.picture.name}, {len(frame)} bytes a message, {len(sent)} frames in {busy:.2f} s")
    print(f"priors {len(answered)}, of them valid {sum(got.valid for _, got in answered)} {reasons}, without a prior {len(sent) - len(answered)}")
    print(f"CPU of the node: {1e3 * cpu / len(sent):.2f} ms a frame sent; without pictures {1e3 * idle:.1f} ms a second")
    if latency_ms:
        p50, p99 = percentile(latency_ms, 0.5), percentile(latency_ms, 0.99)
        print(f"latency stamp to prior: p50 {p50:.2f} ms, p99 {p99:.2f} ms, most {max(latency_ms):.2f} ms, mean {statistics.mean(latency_ms):.2f} ms")
    if args.then is not None:
        told = sorted((arrived, got.mu) for arrived, got in heard.values() if got.valid)
        changed = list(sent.values())[args.frames // 2]
        print(followed(told, changed))


def followed(told, changed):
    """How mu follows a road that changes."""
    before = next((mu for arrived, mu in reversed(told) if arrived < changed), None)
    end = told[-1][1] if told else None
    if None in (before, end) or before == end:
        return f"mu stays at {end}: no valid prior on one of the roads, or both are read alike"
    text = f"mu {before:.2f} to {end:.2f}"
    for share in (0.5, 0.9):
        there = next(arrived for arrived, mu in told if arrived > changed and (mu - before) / (end - before) >= share)
        text += f", {100 * share:.0f} % after {there - changed:.2f} s"
    return text


if __name__ == "__main__":
    main()
