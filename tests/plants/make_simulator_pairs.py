#!/usr/bin/env python3
"""Records cars that are simulators with something changed: what `gripsight diagnose BAG --simulator FILE` is scored on.

    make_simulator_pairs.py OUT SIMULATOR [NAME=VALUE | NAME=xSHARE ...] [--seed N] [--duration S] [--checkout PATH] [--smooth] [--car KIND]

SIMULATOR: f1tenth_gym, slipx, slipx_bicycle, commonroad_st, commonroad_std, commonroad_mb, simple_planning. NAME: one of its parameters
(=x0.8: that share of its value), or an effect around it: delay_s, gain, offset_rad (on the command), x_m (the lever arm of v_y), scale
(of the yaw rate) on what is recorded. OUT receives bag.mcap, heldout.mcap (another drive of the same car), simulator.yaml and
parameters.yaml: nothing in it says what was changed. That is printed as JSON, each change with its size over the detection limit. Track,
pace, steering on top, and noise are drawn from the seed. With --car the car is another kind of simulator than the one that is given, which
then has no term for what makes them unlike. The adapters are the diagnosis' own; the integration, the driver and the noise are not.

Detection limit: copies of the car with and without a change are put onto the recorded motion every half second; the difference of what they
show over the noise, less what other start states and the other change imitate, is five standard errors at the limit. Of a car of another
kind `excess` is what no parameter of the simulator, effect around it or start imitates: squared, over the noise, per residual.

The other drive judges what was found. Where the car itself, put down beside its motion by no more than the noise, ends half a second later
further off than GROWTH times that (near a spin), no simulator is right or wrong: it is driven anew, slower.

Packages: nodes/lib/reference_car/compare/requirements.txt, and numba for f1tenth_gym (a user's checkout, --checkout).
"""

import argparse
import json
import math
import sys
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "nodes/lib/simulator/adapters"), str(Path(__file__).resolve().parent)]
from make_foreign_bags import START_NS, Bag, Driver, Track  # noqa: E402

SAMPLE_S = 0.01
# Exit code: this car cannot be kept on this track, draw another.
NO_DRIVE = 3
AROUND = {"delay_s": 0.0, "gain": 0.0, "offset_rad": 0.0, "x_m": 0.0, "scale": 0.0}
WINDOW = 50
DETECTION = 5.0
GROWTH = 10.0


def build(kind, checkout):
    """The simulator, its file, wheelbase, friction that the driver counts on, and top speed."""
    if kind == "f1tenth_gym":
        import f1tenth_gym_adapter as a

        file = f"adapter: f1tenth_gym\noptions: {{checkout: '{checkout}', integrator: Euler}}\n"
        return a.F1tenthGym({k: a.DEFAULTS[k] for k in a.DEFAULTS}, a.load_dynamics(checkout), 0.01, "Euler"), file, 0.33, 0.9, 9.0
    if kind in ("slipx", "slipx_bicycle"):
        import slipx_adapter as a

        tier = "L2_DoubleTrack" if kind == "slipx" else "L1_Bicycle"
        return a.Slipx({}, tier, 0.002), f"adapter: slipx\noptions: {{tier: {tier}}}\n", 0.32, 0.9, 9.0
    if kind.startswith("commonroad_"):
        import commonroad_adapter as a

        model = kind.split("_")[1]
        step_s = {"mb": 0.001, "std": 0.005, "st": 0.01}[model]
        return a.CommonRoad(model, 2, {}, step_s), f"adapter: commonroad\noptions: {{model: {model}}}\n", 2.58, 0.8, 30.0
    if kind == "simple_planning":
        import autoware_simple_planning_adapter as a

        return a.SimplePlanning("delay_steer_acc_geared", 2.79, {}, 0.01), "adapter: autoware_simple_planning\n", 2.79, 0.4, 15.0
    raise SystemExit(f"{kind}: no such simulator")


class Around:
    """The command on its way to the simulator."""

    def __init__(self, effects):
        self.gain, self.offset = 1.0 + effects["gain"], effects["offset_rad"]
        self.queue = [0.0] * round(effects["delay_s"] / SAMPLE_S)

    def __call__(self, steering):
        self.queue.append(self.gain * steering + self.offset)
        return self.queue.pop(0)


class Car:
    """A simulator with values, and effects around it, moved a sample at a time."""

    def __init__(self, kind, checkout, values, effects, v_x):
        self.simulator = build(kind, checkout)[0]
        self.effects, self.around = effects, Around(effects)
        self.kinds = [i["kind"] for i in self.simulator.inputs]
        self.values = {**{p["name"]: p["value"] for p in self.simulator.parameters}, **values}
        self.per_sample = round(SAMPLE_S / self.simulator.step_s)
        self.steering = 0.0
        start = {"v_x_mps": v_x}
        seen = self.simulator.place(self.values, [start.get(s, 0.0) for s in self.simulator.states], True)
        self.motion = dict(zip(self.simulator.outputs, seen))

    def put(self, motion):
        """Into another motion; what is hidden stays. The road wheels stay where they are."""
        states = [self.motion[s] if s == "steering_rad" else motion[s] for s in self.simulator.states]
        self.motion = dict(zip(self.simulator.outputs, self.simulator.place(self.values, states, False)))

    def step(self, steering, speed, acceleration, moved=lambda dt, m: None):
        wanted = self.around(steering)
        # A rate leads from where the road wheels are.
        rate = (wanted - self.motion.get("steering_rad", self.steering)) / SAMPLE_S
        self.steering = wanted
        command = {"steering_angle": wanted, "steering_rate": rate, "speed": speed, "acceleration": acceleration}
        for _ in range(self.per_sample):
            seen = self.simulator.step([command[kind] for kind in self.kinds])
            self.motion = dict(zip(self.simulator.outputs, seen))
            moved(self.simulator.step_s, self.motion)

    def seen(self):
        """v_y and yaw rate as the sensors show them."""
        rate = self.motion["yaw_rate_radps"]
        return [self.motion["v_y_mps"] + self.effects["x_m"] * rate, (1.0 + self.effects["scale"]) * rate]


class Drive:
    """A closed-loop drive of a car: recorded with noise, its commands and true motion kept."""

    def __init__(self, path, new_car, geometry, rng, duration_s, smooth, pace):
        wheelbase_m, mu, top_mps = geometry
        small = wheelbase_m < 1.0
        track = Track(str(rng.choice(("kidney", "rounded_square", "serpentine"))), wheelbase_m, bool(rng.integers(2)))
        dither_rad = (0.03 if small else 0.006) * rng.uniform(0.5, 2.0)
        driver = Driver(track, wheelbase_m, mu, pace, rng.uniform(0.15, 0.3), top_mps, dither_rad, rng)
        self.noise = np.array([0.02, 0.015, 0.006] if small else [0.03, 0.02, 0.003]) * math.exp(rng.uniform(math.log(0.5), math.log(2.0)))
        v = float(driver.profile.min())
        car = new_car(v)
        rates = "steering_rate" in car.kinds
        place = [track.x[0], track.y[0], track.heading[0]]

        def moved(dt, m):
            place[0] += dt * (m["v_x_mps"] * math.cos(place[2]) - m["v_y_mps"] * math.sin(place[2]))
            place[1] += dt * (m["v_x_mps"] * math.sin(place[2]) + m["v_y_mps"] * math.cos(place[2]))
            place[2] += dt * m["yaw_rate_radps"]

        self.commands, self.motions = [], []
        bag, angle, last = Bag(path), 0.0, 0.0
        for k in range(round(duration_s / SAMPLE_S) + 1):
            m = car.motion
            x, y, heading = place
            v_x, v_y = m["v_x_mps"], m["v_y_mps"]
            steering, speed, acceleration = driver.command(k * SAMPLE_S, x, y, heading, v_x)
            steering = float(np.clip(steering, -0.4, 0.4))
            if smooth or rates:
                # Road wheels: they turn no faster than a servo does, and slower than a simulator allows them to.
                step = (2.0 if small else 0.3) * SAMPLE_S
                angle += float(np.clip(steering - angle, -step, step))
                steering = angle
            # Where the road wheels' rate is the input, their angle is what is recorded: it gets to what was asked for in the next sample.
            shown, last = (last, steering) if rates else (steering, steering)
            speed = float(np.clip(speed, 1.5, top_mps))
            if not math.isfinite(v_x) or v_x < 1.0 or abs(math.atan2(v_y, v_x)) > 0.8:
                raise RuntimeError(f"the car spun at {k * SAMPLE_S:.2f} s")
            stamp = START_NS + k * 10_000_000
            seen = [v_x, *car.seen()] + rng.normal(0.0, self.noise)
            bag.write("/odom", "nav_msgs/msg/Odometry", stamp, "map", dict(
                child_frame_id="base_link",
                pose=dict(covariance=[0.0] * 36, pose=dict(
                    position=dict(x=x, y=y, z=0.0),
                    orientation=dict(x=0.0, y=0.0, z=math.sin(heading / 2), w=math.cos(heading / 2)))),
                twist=dict(covariance=[0.0] * 36, twist=dict(
                    linear=dict(x=seen[0], y=seen[1], z=0.0), angular=dict(x=0.0, y=0.0, z=seen[2])))))
            bag.write("/drive", "ackermann_msgs/msg/AckermannDriveStamped", stamp, "base_link", dict(drive=dict(
                steering_angle=shown, steering_angle_velocity=0.0, speed=speed, acceleration=acceleration, jerk=0.0)))
            self.motions.append(dict(m))
            self.commands.append((steering, speed, acceleration))
            car.step(steering, speed, acceleration, moved)
        bag.close()

    def shown(self, car, nudge=None):
        """What a copy of the car shows that is put onto the recorded motion at the start of every window."""
        rows = []
        for k, (command, motion) in enumerate(zip(self.commands, self.motions)):
            if k % WINDOW == 0:
                car.put({n: v + (nudge or {}).get(n, 0.0) for n, v in motion.items()})
            rows.append(car.seen())
            car.step(*command)
        count = len(rows) // WINDOW * WINDOW
        return np.array(rows[:count]).reshape(-1, WINDOW, 2) / self.noise[1:]

    def growth(self, copy):
        """How far a copy that starts off by the noise gets off the motion in a window, over the noise; the most of all windows."""
        bare = self.shown(copy())
        off = [self.shown(copy(), {n: s}) - bare for n, s in zip(("v_y_mps", "yaw_rate_radps"), self.noise[1:])]
        return float(np.abs(np.nan_to_num(off, nan=np.inf)).max())


def less_starts(columns, starts):
    """Each window of each column without what another start of it imitates."""
    for w in range(len(starts[0])):
        basis = np.array([s[w] for s in starts]).T
        for c in columns:
            c[w] -= basis @ np.linalg.lstsq(basis, c[w], rcond=1e-9)[0]
    # The first second fills what is hidden.
    return np.array([c[2:].ravel() for c in columns])


def missing_structure(drive, given, parameters):
    """What the simulator's parameters, effects around it and other starts cannot imitate of a car of another kind: squared, over the noise,
    per residual. given(values, effects): a copy of the simulator."""
    flat = lambda a: a.reshape(len(a), -1)
    count = len(drive.motions) // WINDOW * WINDOW
    rows = np.array([[m["v_y_mps"], m["yaw_rate_radps"]] for m in drive.motions[:count]]).reshape(-1, WINDOW, 2) / drive.noise[1:]
    bare = drive.shown(given({}, {}))
    columns = [flat(rows - bare)]
    for p in parameters:
        step = 0.02 * abs(p["value"]) if p["value"] else 0.02 * (p["high"] - p["low"])
        columns.append(flat(drive.shown(given({p["name"]: p["value"] + (step if p["value"] + step <= p["high"] else -step)}, {})) - bare))
    for effect, step in (("delay_s", 0.01), ("gain", 0.02), ("offset_rad", 0.004), ("x_m", 0.02), ("scale", 0.01)):
        columns.append(flat(drive.shown(given({}, {effect: step})) - bare))
    starts = [flat(drive.shown(given({}, {}), {n: 0.02}) - bare) for n in ("v_y_mps", "yaw_rate_radps")]
    wanted, *others = less_starts(columns, starts)
    others = np.array([c / max(np.linalg.norm(c), 1e-12) for c in others]).T
    left = wanted - others @ np.linalg.lstsq(others, wanted, rcond=1e-6)[0]
    return float(np.mean(left**2))


def severities(drive, copy, changes):
    """By change: its size over the detection limit. copy(left_out): a car without some of the changes."""
    bare = drive.shown(copy(None))
    flat = lambda a: a.reshape(len(a), -1)
    starts = [flat(drive.shown(copy(None), {n: 0.02}) - bare) for n in ("v_y_mps", "yaw_rate_radps")]
    columns = less_starts([flat(bare - drive.shown(copy(name))) for name in changes], starts)
    out = {}
    for j, name in enumerate(changes):
        # Of two changes that only their product shows of, nothing is left: no pseudoinverse, which would share it between them.
        others = np.delete(columns, j, axis=0).T
        left = columns[j] - (others @ np.linalg.lstsq(others, columns[j], rcond=1e-6)[0] if others.size else 0.0)
        own = float(left @ left)
        out[name] = (math.sqrt(own) / DETECTION, own / len(left))
    return out


def record(out, kind, asked, seed, duration_s, checkout, smooth=False, pace=0.75, car_kind=None):
    out.mkdir(parents=True, exist_ok=True)
    given, file, _, _, _ = build(kind, checkout)
    written = {p["name"]: p["value"] for p in given.parameters if not p.get("integer") and p["name"] != "wheel_base"}
    simulator, _, wheelbase_m, mu, top_mps = build(car_kind or kind, checkout)
    known = {p["name"]: p for p in simulator.parameters}
    lines = [f"{name}: {value!r}   # as it came" for name, value in written.items()]
    (out / "parameters.yaml").write_text("# Parameters of the simulator.\n" + "\n".join(lines) + "\n")
    (out / "simulator.yaml").write_text(file + "parameter_file: parameters.yaml\n")
    changes = {}
    for name, text in asked.items():
        if name in AROUND:
            changes[name] = float(text)
        elif name in known:
            value = known[name]["value"] * float(text[1:]) if text.startswith("x") else float(text)
            changes[name] = round(value) if known[name].get("integer") else min(max(value, known[name]["low"]), known[name]["high"])
        else:
            raise SystemExit(f"{kind} has no parameter {name}")

    def copy(left_out=None, v_x=5.0):
        kept = {n: v for n, v in changes.items() if n != left_out}
        return Car(car_kind or kind, checkout, {n: v for n, v in kept.items() if n in known},
                   {**AROUND, **{n: v for n, v in kept.items() if n in AROUND}}, v_x)

    rng = np.random.default_rng(seed)
    geometry = (wheelbase_m, mu, top_mps)
    drive = Drive(out / "bag.mcap", lambda v: copy(None, v), geometry, rng, duration_s, smooth, pace * rng.uniform(0.8, 1.1))
    other = Drive(out / "heldout.mcap", lambda v: copy(None, v), geometry, rng, duration_s, smooth, pace * rng.uniform(0.8, 1.1))
    if other.growth(copy) > GROWTH:
        raise RuntimeError("the other drive cannot be told half a second ahead")
    severity = severities(drive, copy, changes) if changes else {}
    excess = None
    if car_kind and car_kind != kind:
        plain = lambda values, effects: Car(kind, checkout, values, {**AROUND, **effects}, 5.0)
        excess = missing_structure(drive, plain, [p for p in given.parameters if not p.get("integer")])
    return dict(simulator=kind, car=car_kind or kind, seed=seed, noise=drive.noise.tolist(), excess=excess,
                changes={n: dict(value=v, before=known[n]["value"] if n in known else 0.0, severity=severity[n][0],
                              chi2_per_residual=severity[n][1]) for n, v in changes.items()})


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("simulator")
    parser.add_argument("changes", nargs="*", metavar="NAME=VALUE")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--duration", type=float, default=40.0)
    parser.add_argument("--checkout", default="f1tenth_gym")
    parser.add_argument("--smooth", action="store_true", help="steer no faster than the servo of a car")
    parser.add_argument("--car", metavar="KIND", help="the car is this kind of simulator, and the one given another")
    a = parser.parse_args()
    changes = dict(c.split("=", 1) for c in a.changes)
    pace = 0.75
    for attempt in range(5):
        try:
            print(json.dumps(record(a.out, a.simulator, changes, a.seed, a.duration, a.checkout, a.smooth, pace, a.car)))
            return
        except (RuntimeError, ArithmeticError) as error:
            # A wheel that stands still is a division by zero in a multibody car.
            print(error, file=sys.stderr)
            pace *= 0.85
    print("no pace keeps the car on the track", file=sys.stderr)
    raise SystemExit(NO_DRIVE)


if __name__ == "__main__":
    main()
