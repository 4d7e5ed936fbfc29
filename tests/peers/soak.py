"""The whole suite beside a live car for an hour: processor, memory and latency over time; a CycloneDDS peer, as cyclone_peer.py.

    soak.py OUT [--seconds 3600] [--car f1tenth] [--track club] [--mu 0.9] [--bin FOLDER]

sim_car drives the node `driver`, in real time, with its camera on; beside it runs what run_suite.sh starts with --camera and --gap. This process
listens only. Latency: from the arrival of an odometry sample to that of its residual, by this process's clock. Memory is what a process holds
resident, processor time its user and system time, both from /proc, every ten seconds. Growth: the slope of a line through the second half
of the run, by the hour, with its 90 % interval from the ten parts' own lines.

Writes OUT/nodes.csv, OUT/latency.csv and OUT/README.md. Exit code 1: a node ended or lost its car.
"""

import argparse
import csv
import os
import pathlib
import signal
import subprocess
import threading
import time

import numpy as np
from cyclone_peer import qos, struct
from cyclonedds.domain import DomainParticipant
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic

from fault_campaign import CYCLONE, ROOT, wait

NODES = ["sim_car", "driver", "telemetry", "s4_residual", "identifier", "camera_prior", "gap_diagnosis"]
EVERY_S = 10.0
READY_S = 20.0
# Student's t, nine degrees of freedom, 90 %.
T = 1.833
TICK_S = 1.0 / os.sysconf("SC_CLK_TCK")
PAGE_MB = os.sysconf("SC_PAGE_SIZE") / 1e6


def processes():
    """Nodes of this run by name: those in this process's session."""
    found = {}
    for folder in pathlib.Path("/proc").glob("[0-9]*"):
        try:
            stat = (folder / "stat").read_text()
            name, fields = stat[stat.index("(") + 1 : stat.rindex(")")], stat[stat.rindex(")") + 2 :].split()
            if name in NODES and int(fields[3]) == os.getsid(0):
                found[name] = {
                    "resident_mb": int((folder / "statm").read_text().split()[1]) * PAGE_MB,
                    "processor_s": (int(fields[11]) + int(fields[12])) * TICK_S,
                    "threads": int(fields[17]),
                }
        except (FileNotFoundError, ProcessLookupError):
            continue
    return found


def stop(started):
    """Ends processes, the last one first."""
    for process in reversed(started):
        process.send_signal(signal.SIGINT)
    for process in started:
        try:
            process.wait(10)
        except subprocess.TimeoutExpired:
            process.kill()


def growth(times, values):
    """By the hour, in the second half: the slope of a line, with the half width of its 90 % interval."""
    half = times >= 0.5 * times[-1]
    times, values = times[half] / 3600.0, values[half]
    if len(times) < 10:
        return float("nan"), float("nan")
    slope, at = np.polyfit(times, values, 1)
    # Neighbours are alike: ten parts, each with the mean of what the line leaves, at its own time.
    parts = [(part.mean(), left.mean()) for part, left in zip(np.array_split(times, 10), np.array_split(values - slope * times - at, 10))]
    middle, left = np.array(parts).T
    error = np.sqrt(np.sum(left**2) / 8) / np.sqrt(np.sum((middle - middle.mean()) ** 2))
    return slope, T * error


class Observer:
    """Hears odometry, residuals and sets."""

    def __init__(self, participant):
        def reader(topic, package, kind, quality):
            return DataReader(participant, Topic(participant, topic, struct(package, kind)), qos(quality))

        self.odometry = reader("rt/car_state/odom", "nav_msgs", "Odometry", "sensor")
        self.residuals = reader("rt/s4_residual/residual", "gripsight_msgs", "Residual", "reliable")
        self.sets = reader("rt/identifier/pacejka", "gripsight_msgs", "PacejkaParams", "latched")
        self.sent, self.latencies, self.taken, self.distance_m, self.running = {}, [], 0, 0.0, True
        # Residuals whose odometry this process has not seen yet: the two come by two sockets.
        self.ahead = {}
        self.lock = threading.Lock()
        threading.Thread(target=self.listen, daemon=True).start()

    def listen(self):
        last = None
        while self.running:
            for got in self.odometry.take(N=50):
                if got.sample_info.valid_data:
                    now, stamp = time.monotonic(), (got.header.stamp.sec, got.header.stamp.nanosec)
                    here = got.pose.pose.position
                    with self.lock:
                        if self.ahead.pop(stamp, None) is None:
                            self.sent[stamp] = now
                        else:
                            # No later than its odometry, as far as this process can tell.
                            self.latencies.append(0.0)
                        if last is not None:
                            self.distance_m += float(np.hypot(here.x - last[0], here.y - last[1]))
                    last = here.x, here.y
            for got in self.residuals.take(N=50):
                if got.sample_info.valid_data:
                    with self.lock:
                        stamp = (got.header.stamp.sec, got.header.stamp.nanosec)
                        written = self.sent.pop(stamp, None)
                        if written is not None:
                            self.latencies.append(time.monotonic() - written)
                        else:
                            self.ahead[stamp] = time.monotonic()
            self.taken += sum(got.sample_info.valid_data for got in self.sets.take(N=50))
            time.sleep(0.0005)

    def minute(self):
        """What has come since the last call: samples without a residual that are older than a second, and latencies, s."""
        with self.lock:
            old = [stamp for stamp, at in self.sent.items() if time.monotonic() - at > 1.0]
            for stamp in old:
                del self.sent[stamp]
            self.ahead = {stamp: at for stamp, at in self.ahead.items() if time.monotonic() - at < 1.0}
            latencies, self.latencies = self.latencies, []
        return len(old), latencies


def table(rows, latencies, seconds, observer):
    lines = ["| node | processor, share of one | memory after a minute, MB | at the end, MB | most, MB | growth in the second half, MB an hour | threads |",
             "| --- | --- | --- | --- | --- | --- | --- |"]
    for name in NODES:
        own = [row for row in rows if row["node"] == name]
        times, memory = np.array([row["t_s"] for row in own]), np.array([row["resident_mb"] for row in own])
        share = (own[-1]["processor_s"] - own[0]["processor_s"]) / (times[-1] - times[0])
        slope, width = growth(times, memory)
        first = memory[np.searchsorted(times, min(60.0, times[-1]))]
        lines.append(f"| {name} | {100 * share:.1f} % | {first:.1f} | {memory[-1]:.1f} | {memory.max():.1f} | {slope:+.2f} ± {width:.2f} | {own[-1]['threads']} |")
    minutes = [row for row in latencies if row["residuals"]]
    p99 = np.array([row["p99_ms"] for row in minutes])
    slope, width = growth(np.array([60.0 * row["minute"] for row in minutes]), p99)
    lines += ["", f"{seconds:.0f} s, {observer.distance_m / 1000:.2f} km driven, {observer.taken} messages on `/identifier/pacejka`.", "",
              "Sample to residual, p99 of a minute: "
              f"{np.median(p99):.2f} ms in the median minute, {p99.max():.2f} ms in the worst; growth in the second half {slope:+.2f} ± {width:.2f} ms an hour. "
              f"Samples without a residual after the first: {sum(row['without'] for row in minutes[1:])} of {sum(row['residuals'] + row['without'] for row in minutes[1:])}.",
              "", f"Load of the machine at the end: {' '.join(f'{load:.1f}' for load in os.getloadavg())} on {os.cpu_count()} processors."]
    return "\n".join(lines) + "\n"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=pathlib.Path)
    parser.add_argument("--seconds", type=float, default=3600.0)
    parser.add_argument("--car", default="f1tenth")
    parser.add_argument("--track", default="club")
    parser.add_argument("--mu", type=float, default=0.9)
    parser.add_argument("--bin", type=pathlib.Path, default=ROOT / "target/release")
    args = parser.parse_args()
    args.out.mkdir(parents=True, exist_ok=True)
    os.environ["CYCLONEDDS_URI"] = CYCLONE
    files = args.out / "car"
    files.mkdir(exist_ok=True)
    parameters = {"car": args.car, "track": args.track, "mu": args.mu, "write_folder": files, "camera_rate_hz": 5.0}
    remaps = {"odom": "/car_state/odom", "imu": "/imu/data", "wheels": "/wheel_speeds", "drive": "/drive",
              "image/compressed": "/camera/image/compressed"}
    command = [args.bin / "sim_car", "--ros-args", *(word for key, value in parameters.items() for word in ("-p", f"{key}:={value}")),
               *(word for key, value in remaps.items() for word in ("-r", f"{key}:={value}"))]
    started = []
    observer, rows, latencies, alive = None, [], [], True
    try:
        with (args.out / "log.txt").open("w") as log:
            started.append(subprocess.Popen([str(part) for part in command], stdout=log, stderr=log))
            if not wait(lambda: all((files / name).is_file() for name in ("vehicle.yaml", "driver.yaml")), READY_S):
                raise SystemExit(f"sim_car wrote no files within {READY_S:.0f} s: see {args.out / 'log.txt'}")
            suite = [ROOT / "launch_scripts/run_suite.sh", "--vehicle", files / "vehicle.yaml", "--drive", files / "driver.yaml",
                     "--camera", "--gap", "--bin", args.bin]
            started.append(subprocess.Popen([str(part) for part in suite], stdout=log, stderr=log))
        observer = Observer(DomainParticipant(int(os.environ.get("ROS_DOMAIN_ID", 0))))
        wait(lambda: set(processes()) == set(NODES), READY_S)
        begun, index = time.monotonic(), 0
        while alive and time.monotonic() - begun < args.seconds:
            at = time.monotonic() - begun
            seen = processes()
            rows += [{"t_s": round(at, 2), "node": name, **{key: round(value, 3) for key, value in seen[name].items()}} for name in NODES if name in seen]
            alive = set(seen) == set(NODES) and all(process.poll() is None for process in started)
            if index % 6 == 5:
                without, took = observer.minute()
                p50, p99, most = np.percentile(took, [50, 99, 100]) * 1e3 if took else (np.nan,) * 3
                latencies.append({"minute": (index + 1) // 6, "residuals": len(took), "without": without, "p50_ms": round(p50, 3), "p99_ms": round(p99, 3), "most_ms": round(most, 3)})
                print(f"{at / 60:5.1f} min: p99 {p99:.2f} ms, {sum(row['resident_mb'] for row in rows[-len(NODES):]):.0f} MB in all, {observer.distance_m / 1000:.2f} km", flush=True)
            index += 1
            time.sleep(max(0.0, begun + index * EVERY_S - time.monotonic()))
    finally:
        stop(started)
    observer.running = False
    for name, content in (("nodes.csv", rows), ("latency.csv", latencies)):
        with (args.out / name).open("w", newline="") as file:
            writer = csv.DictWriter(file, content[0].keys() if content else ["empty"], lineterminator="\n")
            writer.writeheader()
            writer.writerows(content)
    text = table(rows, latencies, rows[-1]["t_s"], observer)
    (args.out / "README.md").write_text(text)
    print(text)
    if not alive:
        raise SystemExit(f"a node ended: {sorted(set(NODES) - set(processes()))}; see {args.out / 'log.txt'}")


if __name__ == "__main__":
    main()
