"""Plays drives of the reference car into the suite with faults, and beside it the same drives without; a CycloneDDS peer, as cyclone_peer.py.

    fault_campaign.py OUT [--faults 1000] [--seed 1] [--bin FOLDER] [--rate 10] [--minutes M] [--again RUN ...]

Faults of topics are the fault_injector's (its README has the kinds); faults of processes are made here: a node killed and started again, a
node that stands still, the peer started again, a second identifier, a subscriber that stands still for good. Ten faults a run, all begun between 3 and
28 s of the drive, those of topics ended there, too. Writes OUT/runs.csv (a row a run, those without faults first), OUT/faults.csv (a row a fault) and OUT/README.md.

A set is harmful where it promises, anywhere within its slips, more than 10 % of the largest true force driven above the true curve, which is the
Magic Formula fitted to the plant's own F_y / F_z. A run has recovered when every node lives and reports, the last window has been identified, and
a usable set came from a window that ended after the last fault, a valid reading of the camera came after it, and every file written is whole. The camera
is fooled where it gives a valid reading of a picture that was black, and tells where it refuses one as dark. It hangs when a node does not end within 2 s
of SIGINT.
"""

import argparse
import csv
import math
import os
import pathlib
import random
import re
import signal
import subprocess
import sys
import threading
import time

import numpy as np
import yaml

ROOT = pathlib.Path(__file__).resolve().parents[2]
SPAN_S = (3.0, 28.0)
# A fault of a process lasts at most so long, and a node that was killed or stood still takes so long to be in the network again; both by the
# machine's clock, while the drive goes on at its pace.
STILL_S, BACK_S = 1.5, 1.0
# What the drive has left after them: whenever the windows began anew, one of 30 s that begins each 10 s is whole.
REST_S = 40.0
CAMERA_HZ = 2
# What a picture's age may be, and how far its stamp may lie ahead of the clock, at the pace of a car (camera_prior's defaults).
AGE_S, AHEAD_S = 0.5, 0.1
TOPIC_FAULTS, PROCESS_FAULTS = 8, 2
HARMFUL = 0.1
END_S = 2.0
LAST_RUN_S = 40.0
PROPOSED, USABLE = 1, (2, 4)
CAMERA = 2
DRIVES = [
    ("f1tenth", "club", 0.9, 0.9, 21),
    ("f1tenth", "esses", 0.7, 0.85, 22),
    ("formula_student", "harbor", 1.1, 0.85, 23),
    ("passenger_car", "valley", 0.9, 0.8, 24),
    ("race_car", "bean", 1.2, 0.85, 25),
    ("f1tenth", "clover", 1.0, 0.8, 26),
]
NODES = {
    "telemetry": [],
    "s4_residual": ["-r", "sequence:=telemetry/sequence", "-r", "candidate:=identifier/candidate"],
    "identifier": ["-r", "sequence:=telemetry/sequence", "-r", "model:=s4_residual/model", "-r", "friction:=camera_prior/friction"],
    # The reference car's pictures show nothing but road, and are renders; their stamps are the bag's.
    "camera_prior": ["-r", "pacejka:=identifier/pacejka", "-p", "use_sim_time:=true", "-p", "input:=compressed", "-p", "region:=full",
                     "-p", "network_error:=0.1"],
}
TO_INJECTOR = {"/car_state/odom": "/in/odom", "/drive": "/in/drive", "/imu/data": "/in/imu", "/wheel_speeds": "/in/wheels",
               "/camera/image/compressed": "/in/image/compressed"}
PROCESS_KINDS = ["killed telemetry", "killed s4_residual", "killed identifier", "killed camera_prior", "stood still telemetry",
                 "stood still s4_residual", "stood still identifier", "stood still camera_prior", "peer restarted", "second identifier", "subscriber stands still"]

# This machine only, as rmw_cyclonedds_cpp sets it up for LOCALHOST where the loopback has no multicast.
CYCLONE = (
    '<CycloneDDS><Domain><General><Interfaces><NetworkInterface address="127.0.0.1"/></Interfaces><AllowMulticast>false</AllowMulticast>'
    "</General><Discovery><ParticipantIndex>auto</ParticipantIndex><MaxAutoParticipantIndex>32</MaxAutoParticipantIndex>"
    '<Peers><Peer address="127.0.0.1"/></Peers></Discovery></Domain></CycloneDDS>'
)


def force(tires, slip):
    b, c, d, e = tires
    return d * np.sin(c * np.arctan(b * slip - e * (b * slip - np.arctan(b * slip))))


def fitted(slip, load_share):
    """The Magic Formula that fits best: Levenberg-Marquardt from a few starts, derivatives by differences."""
    best, best_cost = None, math.inf
    for start in ([8.0, 1.4, 0.9, 0.3], [15.0, 1.2, 1.2, -0.5], [5.0, 1.6, 0.7, 0.8]):
        x, damping = np.array(start), 1e-2
        left = force(x, slip) - load_share
        for _ in range(60):
            jacobian = np.stack([(force(x + step, slip) - force(x - step, slip)) / 2e-5 for step in np.eye(4) * 1e-5], axis=1)
            normal = jacobian.T @ jacobian
            move = np.linalg.solve(normal + damping * np.diag(np.diag(normal) + 1e-9), -jacobian.T @ left)
            new = force(x + move, slip) - load_share
            if new @ new < left @ left:
                x, left, damping = x + move, new, damping / 3
            else:
                damping *= 4
        if left @ left < best_cost:
            best, best_cost = x, left @ left
    return best


class Drive:
    """A bag with its truth."""

    def __init__(self, folder, simulate, duration_s, car, track, mu, pace, seed):
        self.name = f"{car} {track} mu {mu} pace {pace} seed {seed}"
        self.bag = folder / f"{car}_{track}_{seed}.mcap"
        self.vehicle = self.bag.with_suffix(".vehicle.yaml")
        if not self.bag.exists():
            numbers = ["--mu", mu, "--pace", pace, "--seed", seed, "--duration", duration_s]
            command = [simulate, "simulate", "--car", car, "--track", track, "--realistic", "--camera", CAMERA_HZ, "--out", self.bag, *numbers]
            subprocess.run([str(part) for part in command], check=True, stdout=subprocess.DEVNULL)
        with self.bag.with_suffix(".truth.csv").open() as file:
            rows = list(csv.DictReader(file))
        column = lambda name: np.array([float(row[name]) for row in rows])
        self.curves = {}
        for axle, wheels in (("front", ("fl", "fr")), ("rear", ("rl", "rr"))):
            slip = np.mean([column(f"slip_angle_{wheel}_rad") for wheel in wheels], axis=0)
            share = column(f"f_y_{axle}_n") / column(f"f_z_{axle}_n")
            curve, most = fitted(slip[::5], share[::5]), float(np.quantile(np.abs(slip), 0.999))
            self.curves[axle] = (curve, most, float(np.max(force(curve, np.linspace(0, most, 200)))))

    def promised_too_much(self, message):
        """Share of the largest true force driven by which a set promises more than the road gives, within its slips."""
        worst = -math.inf
        for axle, (curve, most, shown) in self.curves.items():
            within = getattr(message, f"{axle}_valid_slip_rad")
            slips = np.linspace(0, within if math.isfinite(within) else most, 201)[1:]
            formula = getattr(message, axle)
            tires = (formula.b, formula.c, formula.d, formula.e)
            worst = max(worst, float(np.max(force(tires, slips) - force(curve, slips))) / shown)
        return worst


class Heard:
    """What the suite says, from outside."""

    def __init__(self):
        from cyclone_peer import qos, struct
        from cyclonedds.domain import DomainParticipant
        from cyclonedds.sub import DataReader
        from cyclonedds.topic import Topic

        participant = DomainParticipant(int(os.environ["ROS_DOMAIN_ID"]))
        of = lambda topic, package, name, kind: DataReader(participant, Topic(participant, "rt" + topic, struct(package, name)), qos(kind))
        self.readers = {
            "set": of("/identifier/pacejka", "gripsight_msgs", "PacejkaParams", "latched"),
            "end": of("/identifier/candidate", "gripsight_msgs", "PacejkaParams", "latched"),
            "friction": of("/camera_prior/friction", "gripsight_msgs", "FrictionPrior", "reliable"),
            "window": of("/telemetry/excitation", "gripsight_msgs", "Excitation", "latched"),
            "diagnostics": of("/diagnostics", "diagnostic_msgs", "DiagnosticArray", "reliable"),
        }
        self.messages = []
        threading.Thread(target=self.listen, daemon=True).start()

    def listen(self):
        while True:
            for what, reader in self.readers.items():
                for message in reader.take(N=100):
                    if message.sample_info.valid_data:
                        self.messages.append((time.monotonic(), what, message))
            time.sleep(0.01)

    def since(self, start, what):
        return [(when, message) for when, kind, message in list(self.messages) if kind == what and when >= start]


class Run:
    """One drive through injector and suite."""

    def __init__(self, args, heard, drive, faults_seed, logs):
        self.args, self.heard, self.drive, self.seed, self.logs = args, heard, drive, faults_seed, logs
        self.processes, self.began, self.notes = {}, None, []
        logs.mkdir(parents=True, exist_ok=True)

    def start(self, name, arguments, program=None):
        log = (self.logs / f"{name}.log").open("a")
        # In replay no sample is lost, but where a fault says so.
        common = ["-p", "reliable_inputs:=true"] if (program or name) != "bag_player" else []
        if name == "camera_prior":
            # Both are the machine's own delays: the drive goes on during them, at its pace.
            common += ["-p", f"most_age_s:={AGE_S * self.args.rate}", "-p", f"most_ahead_s:={AHEAD_S * self.args.rate}"]
        command = [self.args.bin / (program or name), "--ros-args", *common, *arguments]
        assert name not in self.processes or self.processes[name].poll() is not None, name
        self.processes[name] = subprocess.Popen([str(part) for part in command], stderr=log, stdout=log)

    def node(self, name, program=None, extra=()):
        files = ["--params-file", ROOT / "params/suite.yaml", "--params-file", self.drive.vehicle]
        kept = ["-p", f"output_folder:={self.logs / 'files'}"] if "identifier" in (name, program) else []
        self.start(name, [*files, *NODES[program or name], *kept, *extra], program)

    def injector(self, draw):
        lot = ["-p", f"draw:={draw}", "-p", f"seed:={self.seed}", "-p", f"from_s:={SPAN_S[0]}", "-p", f"to_s:={SPAN_S[1]}"]
        if self.args.kinds:
            lot += ["-p", "kinds:=[" + ",".join(f'"{kind}"' for kind in self.args.kinds.split(",")) + "]"]
        self.start("fault_injector", [*lot, "-p", 'topics:=["odom","drive","imu","wheels","image/compressed"]'])

    def log(self, name):
        path = self.logs / f"{name}.log"
        return path.read_text(errors="replace") if path.exists() else ""

    def process_fault(self, kind, rng):
        """Makes one; gives the end of what it does, s after now."""
        name = kind.split()[-1]
        if kind.startswith("killed"):
            self.processes[name].kill()
            self.processes[name].wait()
            time.sleep(rng.uniform(0.0, 0.5))
            self.node(name)
        elif kind.startswith("stood still"):
            self.processes[name].send_signal(signal.SIGSTOP)
            time.sleep(rng.uniform(0.1, STILL_S))
            self.processes[name].send_signal(signal.SIGCONT)
        elif kind == "peer restarted":
            self.processes["fault_injector"].kill()
            self.processes["fault_injector"].wait()
            # Its plan counts from its first message, so the faults that had not begun are dropped.
            self.injector(0)
        elif kind == "second identifier":
            # A name of its own: one that two draws share would leave the first running into the next runs.
            self.node(f"identifier_{len(self.processes)}", "identifier")
        else:
            listener = f"listener_{len(self.processes)}"
            self.node(listener, "s4_residual", ["-r", f"__node:={listener}"])
            time.sleep(0.3)
            self.processes[listener].send_signal(signal.SIGSTOP)

    def play(self):
        rng = random.Random(self.seed)
        planned = [] if self.seed is None else sorted((rng.uniform(*SPAN_S), rng.choice(PROCESS_KINDS)) for _ in range(PROCESS_FAULTS))
        start = time.monotonic()
        for name in NODES:
            self.node(name)
        if self.seed is None:
            self.seed = 0
            self.injector(0)
        else:
            self.injector(TOPIC_FAULTS)
        time.sleep(0.7)
        moved = [part for names in TO_INJECTOR.items() for part in ("-r", ":=".join(names))]
        topics = "[" + ",".join(f'"{name}"' for name in TO_INJECTOR) + "]"
        self.start("bag_player", ["-p", f"bag:={self.drive.bag}", "-p", f"rate:={self.args.rate}", "-p", f"topics:={topics}",
                                  "-p", f"wait_for:={topics}", "-p", "linger_s:=0.5", *moved])
        player = self.processes["bag_player"]
        wait(lambda: "subscribers are there" in self.log("bag_player"), 20)
        began = time.monotonic()
        made = []
        for at_s, kind in planned:
            time.sleep(max(0.0, began + at_s / self.args.rate - time.monotonic()))
            made.append((kind, (time.monotonic() - began) * self.args.rate))
            self.process_fault(kind, rng)
        if not wait(lambda: player.poll() is not None, 120):
            self.notes.append("the player did not end")
        played = time.monotonic()
        return self.judge(start, began, played, made)

    def judge(self, start, began, played, made):
        topic_faults = [line.split(": ", 1)[1].split() for line in plain(self.log("fault_injector")) if ": fault " in line]
        topic_faults = [words[words.index("of") + 2:] if "of" in words else words for words in topic_faults]
        ends = [float(f[2]) + float(f[3]) for f in topic_faults] + [at + STILL_S * self.args.rate for _, at in made]
        last_fault = began + max(ends, default=0.0) / self.args.rate
        newest = lambda: next((m.handshake.sequence_id for _, m in reversed(self.heard.since(start, "window"))), None)
        results = lambda: [(w, m) for w, m in self.heard.since(start, "end") if m.status != PROPOSED]
        done = lambda: any(m.handshake.sequence_id == newest() for _, m in results())
        identified = wait(done, LAST_RUN_S)
        # Everybody must still speak.
        time.sleep(1.2)
        speaks = {status.name.split(":")[0] for _, m in self.heard.since(time.monotonic() - 3.0, "diagnostics") for status in m.status}
        silent = [name for name in NODES if name not in speaks]
        dead = [name for name, process in self.processes.items() if name != "bag_player" and process.poll() is not None]
        took = self.end()
        ended = {m.handshake.sequence_id: when for when, m in self.heard.since(start, "window")}
        usable = [m for _, m in results() if m.status in USABLE and ended.get(m.handshake.sequence_id, 0.0) > last_fault]
        sets = [m for _, m in self.heard.since(start, "set") if m.status in USABLE]
        promised = [self.drive.promised_too_much(m) for m in sets]
        answers = [(when, m) for when, m in self.heard.since(start, "friction") if m.source == CAMERA]
        seen = [m.mu for when, m in answers if m.valid and when > last_fault]
        of_black = self.of_black(topic_faults, made, [m for _, m in answers])
        torn = [path.name for path in (self.logs / "files").glob("[!.]*.yaml") if not whole(path)]
        for text, found in ((f"not whole: {torn}", torn), ("the last window was not identified", not identified), (f"silent: {silent}", silent), ("the camera reads nothing", not seen), (f"ended: {dead}", dead)):
            if found:
                self.notes.append(text)
        for message, too_much in zip(sets, promised):
            if too_much > HARMFUL:
                shake = message.handshake
                self.notes.append(f"{too_much:.2f} too much: run {shake.run_id} sequence {shake.sequence_id} vehicle {shake.vehicle_hash} D {message.front.d:.3f} {message.rear.d:.3f}")
        if not usable:
            reasons = [m.reason for _, m in results()]
            self.notes.append("no usable set after the last fault: " + (reasons[-1] if reasons else "no result")[:160])
        row = {
            "drive": self.drive.name, "seed": self.seed, "faults": len(topic_faults) + len(made), "sets": len(sets),
            "usable_after": len(usable), "promised_too_much": f"{max(promised, default=math.nan):.4f}",
            "harmful": sum(p > HARMFUL for p in promised), "recovered": int(identified and not silent and not dead and not torn and bool(seen and usable)),
            "black": len(of_black), "fooled": of_black.count(""), "told": sum(reason in ("dark", "frozen") for reason in of_black),
            "mu": f"{seen[-1] if seen else math.nan:.3f}", "hang": int(took > END_S), "end_s": f"{took:.2f}", "played_s": f"{played - began:.1f}", "note": " | ".join(self.notes),
        }
        faults = [(f[0], f[1], f[2], f[3], f[4]) for f in topic_faults] + [(kind, "", f"{at:.2f}", "", "") for kind, at in made]
        return row, faults

    def of_black(self, faults, made, answers):
        """Why each picture that was black, by its stamp, was not used: empty where it was. Where a picture's stamp or place or bytes were harmed, too,
        whether it was black is not known, and none is counted."""
        pictures = [(fault[0], float(fault[2]), float(fault[2]) + float(fault[3])) for fault in faults if fault[1] == "image/compressed"]
        first = re.search(r"the first message is stamped (\d+) ns", self.log("fault_injector"))
        if first is None or any(kind == "time" for kind, _, _ in pictures):
            return []
        unclear = [(begin, end) for kind, begin, end in pictures if kind in ("delay", "reorder", "corrupt")]
        # A peer that was started again goes on without its faults.
        harmed_until = min((at - 1.0 for kind, at in made if kind == "peer restarted"), default=math.inf)
        dark = [(b, min(e, harmed_until)) for kind, b, e in pictures if kind == "dark" and not any(c < e and b < f for c, f in unclear)]
        of_pictures = [m for m in answers if m.reason != "no_picture"]
        after_s = [(m.header.stamp.sec + 1e-9 * m.header.stamp.nanosec - 1e-9 * int(first[1]), m.reason) for m in of_pictures]
        return [reason for at, reason in after_s if any(begin <= at < end for begin, end in dark)]

    def end(self):
        """Ends all by SIGINT; the time that the slowest took, infinite where one had to be killed."""
        for listener in [name for name in self.processes if name.startswith("listener")]:
            # It stands still, so only this ends it.
            self.processes.pop(listener).kill()
        start = time.monotonic()
        alive = [process for process in self.processes.values() if process.poll() is None]
        for process in alive:
            process.send_signal(signal.SIGINT)
        if wait(lambda: all(process.poll() is not None for process in alive), 6, 0.005):
            return time.monotonic() - start
        for process in alive:
            process.kill()
        return math.inf


def whole(path):
    """Whether a file that the identifier wrote can be read."""
    try:
        return bool(yaml.safe_load(path.read_text()))
    except yaml.YAMLError:
        return False


def plain(text):
    return [line for line in text.splitlines() if " fault " in f" {line}"]


def wait(condition, timeout_s, look_s=0.05):
    end = time.monotonic() + timeout_s
    while time.monotonic() < end:
        if condition():
            return True
        time.sleep(look_s)
    return False


def table(out, command):
    """OUT/README.md from the rows."""
    with (out / "runs.csv").open() as file:
        runs = list(csv.DictReader(file))
    with (out / "faults.csv").open() as file:
        faults = list(csv.DictReader(file))
    plain_runs = [run for run in runs if not run["seed"]]
    harmed = [run for run in runs if run["seed"]]
    bad_without = {run["drive"] for run in plain_runs if int(run["harmful"])}
    harmful = [run for run in harmed if int(run["harmful"]) and run["drive"] not in bad_without]
    sets, promised = sum(int(run["sets"]) for run in harmed), [float(run["promised_too_much"]) for run in harmed]
    ends = sorted(float(run["end_s"]) for run in runs)
    count = lambda field, rows: sum(int(run[field]) for run in rows)
    alone = {run["drive"]: float(run["mu"]) for run in plain_runs}
    off = sorted(abs(float(run["mu"]) - alone[run["drive"]]) for run in harmed if run["mu"] != "nan") or [math.nan]
    lines = [
        "# Faults", "", "```sh", command, "```", "",
        "Ten faults a run; the drives' length, their pace and what counts stand in `tests/peers/fault_campaign.py`.", "",
        "| | without faults | with faults |", "| --- | --- | --- |",
        f"| runs | {len(plain_runs)} | {len(harmed)} |",
        f"| faults | 0 | {len(faults)} |",
        f"| recovered | {count('recovered', plain_runs)} | {count('recovered', harmed)} |",
        f"| black pictures read by the camera | {count('black', plain_runs)} | {count('black', harmed)} |",
        f"| of these refused as dark or frozen | {count('told', plain_runs)} | {count('told', harmed)} |",
        f"| of these taken for a road | {count('fooled', plain_runs)} | {count('fooled', harmed)} |",
        f"| the camera's last reading off the one without faults, p50, most | | {off[len(off) // 2]:.3f}, {off[-1]:.3f} |",
        f"| hangs | {count('hang', plain_runs)} | {count('hang', harmed)} |",
        f"| sets at the MPC's topic | {count('sets', plain_runs)} | {sets} |",
        f"| runs with a set that promises over 10 % too much, where the drive without faults has none | | {len(harmful)} |",
        f"| largest promise above the truth | {100 * max((float(r['promised_too_much']) for r in plain_runs), default=math.nan):.1f} % | "
        f"{100 * max((p for p in promised if not math.isnan(p)), default=math.nan):.1f} % |",
        "", f"SIGINT to the end of all nodes, s: p50 {ends[len(ends) // 2]:.2f}, p99 {ends[int(0.99 * (len(ends) - 1))]:.2f}, most {ends[-1]:.2f}.", "",
        "| fault | made | in runs that did not recover | in runs with a harmful set |", "| --- | --- | --- | --- |",
    ]
    of = lambda rows: {run["seed"] for run in rows}
    lost, wrong = of([run for run in harmed if run["recovered"] == "0"]), of(harmful)
    for kind in sorted({fault["kind"] for fault in faults}):
        own = [fault for fault in faults if fault["kind"] == kind]
        lines.append(f"| {kind} | {len(own)} | {sum(f['seed'] in lost for f in own)} | {sum(f['seed'] in wrong for f in own)} |")
    bad = [run for run in harmed if run["recovered"] == "0" or run in harmful or run["hang"] == "1"]
    if bad:
        lines += ["", "Runs that missed something:", ""]
        lines += [f"- {run['seed']}, {run['drive']}: most promised too much {run['promised_too_much']}; {run['note'] or 'harmful'}" for run in bad]
    (out / "README.md").write_text("\n".join(lines) + "\n")


def append(path, fields, rows):
    new = not path.exists()
    with path.open("a", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        if new:
            writer.writerow(fields)
        writer.writerows(rows)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=pathlib.Path)
    parser.add_argument("--faults", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--bin", type=pathlib.Path, default=ROOT / "target/release")
    parser.add_argument("--simulate", type=pathlib.Path, help="the command `gripsight`; the one of --bin")
    parser.add_argument("--rate", type=float, default=10.0)
    parser.add_argument("--minutes", type=float, default=math.inf, help="begin no run after this time")
    parser.add_argument("--domain", type=int, default=int(os.environ.get("ROS_DOMAIN_ID", 90)))
    parser.add_argument("--kinds", help="draw these faults of topics alone, with commas between")
    parser.add_argument("--drives", type=int, default=len(DRIVES))
    parser.add_argument("--again", type=int, nargs="+", default=[], metavar="RUN", help="these runs alone, by their seed in runs.csv")
    args = parser.parse_args()
    os.environ["ROS_DOMAIN_ID"] = str(args.domain)
    os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
    os.environ["NO_COLOR"] = "1"
    os.environ["CYCLONEDDS_URI"] = CYCLONE
    began = time.monotonic()
    folder = args.out / "drives"
    folder.mkdir(parents=True, exist_ok=True)
    duration_s = math.ceil(SPAN_S[1] + (STILL_S + BACK_S) * args.rate + REST_S)
    drives = [Drive(folder, args.simulate or args.bin / "gripsight", duration_s, *drive) for drive in DRIVES[: args.drives]]
    heard = Heard()
    count, index = 0, 0
    plan = [(drive, None) for drive in drives]
    if args.again:
        runs = [(drives[seed % 1000 % len(drives)], seed) for seed in args.again]
        plan = [entry for entry in plan if any(entry[0] is drive for drive, _ in runs)] + runs
    while (plan or not args.again) and count < args.faults and time.monotonic() - began < 60 * args.minutes:
        drive, seed = plan.pop(0) if plan else (drives[index % len(drives)], 1000 * args.seed + index)
        index += seed is not None
        heard.messages.clear()
        row, faults = Run(args, heard, drive, seed, args.out / "logs" / f"{seed}").play()
        row["seed"] = "" if seed is None else seed
        count += len(faults)
        append(args.out / "runs.csv", row.keys(), [row.values()])
        append(args.out / "faults.csv", ["seed", "kind", "topic", "start_s", "duration_s", "size"], [(seed, *fault) for fault in faults])
        print(f"{time.monotonic() - began:6.0f} s, {count} faults: {row}", flush=True)
        table(args.out, f"launch_scripts/fault_campaign.sh OUT --faults {args.faults} --seed {args.seed}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
