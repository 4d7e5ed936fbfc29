#!/usr/bin/env python3
"""Records cars that are simulators with something changed: what `gripsight diagnose BAG --simulator FILE` is scored on.

    make_simulator_pairs.py OUT SIMULATOR [NAME=VALUE ...] [--seed N] [--duration S] [--checkout PATH] [--smooth] [--car KIND]

SIMULATOR: f1tenth_gym, slipx, slipx_bicycle, commonroad_st, commonroad_std, commonroad_mb, simple_planning. NAME: one of its parameters, or an effect
around it: delay_s, gain, offset_rad (on the command), lever_arm_m, gyro_scale (on what is recorded). OUT receives car.mcap,
simulator.yaml, parameters.yaml and truth.json. The car is driven around a track by a driver that sees its true motion; what is recorded
has noise. With --car the car is another kind of simulator than the one that is given (NAME: one of the car's), which then has no term for what
makes them unlike. The adapters are the diagnosis' own, the integration, the driver and the noise are not.

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
AROUND = {"delay_s": 0.0, "gain": 0.0, "offset_rad": 0.0, "lever_arm_m": 0.0, "gyro_scale": 0.0}


def build(kind, checkout):
    """The simulator, its file, wheelbase, friction that the driver counts on, and top speed."""
    if kind == "f1tenth_gym":
        import f1tenth_gym_adapter as a

        file = f"adapter: f1tenth_gym\noptions: {{checkout: '{checkout}'}}\n"
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


def record(out, kind, changes, seed, duration_s, checkout, smooth=False, pace=0.75, car_kind=None):
    out.mkdir(parents=True, exist_ok=True)
    given, file, _, _, _ = build(kind, checkout)
    written = {p["name"]: p["value"] for p in given.parameters if not p.get("integer") and p["name"] != "wheel_base"}
    simulator, _, wheelbase_m, mu, top_mps = build(car_kind or kind, checkout)
    values = {p["name"]: p["value"] for p in simulator.parameters}
    lines = [f"{name}: {value!r}   # as it came" for name, value in written.items()]
    (out / "parameters.yaml").write_text("# Parameters of the simulator.\n" + "\n".join(lines) + "\n")
    (out / "simulator.yaml").write_text(file + "parameter_file: parameters.yaml\n")
    effects = {**AROUND, **{k: v for k, v in changes.items() if k in AROUND}}
    for name, value in changes.items():
        if name not in AROUND and name not in values:
            raise SystemExit(f"{kind} has no parameter {name}")
    car = {**values, **{k: v for k, v in changes.items() if k in values}}
    rng = np.random.default_rng(seed)
    track = Track(list(("kidney", "rounded_square", "serpentine"))[seed % 3], wheelbase_m, seed % 2 == 1)
    small = wheelbase_m < 1.0
    driver = Driver(track, wheelbase_m, mu, pace, 0.25, top_mps, 0.03 if small else 0.006, rng)
    noise = [0.02, 0.015, 0.006] if small else [0.03, 0.02, 0.003]
    v = float(driver.profile.min())
    x, y, heading = track.x[0], track.y[0], track.heading[0]
    start = {"v_x_mps": v, "v_y_mps": 0.0, "yaw_rate_radps": 0.0, "steering_rad": 0.0}
    seen = simulator.place(car, [start[s] for s in simulator.states], True)
    motion = dict(zip(simulator.outputs, seen))
    around, bag = Around(effects), Bag(out / "car.mcap")
    kinds = [i["kind"] for i in simulator.inputs]
    per_sample = round(SAMPLE_S / simulator.step_s)
    angle = now = last = 0.0
    for k in range(round(duration_s / SAMPLE_S) + 1):
        v_x, v_y, rate = motion["v_x_mps"], motion["v_y_mps"], motion["yaw_rate_radps"]
        steering, speed, acceleration = driver.command(k * SAMPLE_S, x, y, heading, v_x)
        steering = float(np.clip(steering, -0.4, 0.4))
        if smooth or "steering_rate" in kinds:
            # Road wheels: they turn no faster than a servo does.
            step = min(2.0 if small else 0.6, car.get("steering.v_max", 9.0)) * SAMPLE_S
            angle += float(np.clip(steering - angle, -step, step))
            steering = angle
        # Where the road wheels' rate is the input, their angle is what is recorded: it gets to what was asked for in the next sample.
        shown, last = (last, steering) if "steering_rate" in kinds else (steering, steering)
        speed = float(np.clip(speed, 1.5, top_mps))
        if not math.isfinite(v_x) or abs(math.atan2(v_y, v_x)) > 0.8:
            raise RuntimeError(f"{out.name}: the car spun at {k * SAMPLE_S:.2f} s")
        stamp = START_NS + k * 10_000_000
        seen_v = [v_x, v_y + effects["lever_arm_m"] * rate, (1.0 + effects["gyro_scale"]) * rate] + rng.normal(0.0, noise)
        bag.write("/odom", "nav_msgs/msg/Odometry", stamp, "map", dict(
            child_frame_id="base_link",
            pose=dict(covariance=[0.0] * 36, pose=dict(
                position=dict(x=x, y=y, z=0.0),
                orientation=dict(x=0.0, y=0.0, z=math.sin(heading / 2), w=math.cos(heading / 2)))),
            twist=dict(covariance=[0.0] * 36, twist=dict(
                linear=dict(x=seen_v[0], y=seen_v[1], z=0.0), angular=dict(x=0.0, y=0.0, z=seen_v[2])))))
        bag.write("/drive", "ackermann_msgs/msg/AckermannDriveStamped", stamp, "base_link", dict(drive=dict(
            steering_angle=shown, steering_angle_velocity=0.0, speed=speed, acceleration=acceleration, jerk=0.0)))
        before, now = now, around(steering)
        for i in range(per_sample):
            command = {"steering_angle": now, "steering_rate": (now - before) / SAMPLE_S, "speed": speed, "acceleration": acceleration}
            seen = simulator.step([command[kind] for kind in kinds])
            motion = dict(zip(simulator.outputs, seen))
            dt = simulator.step_s
            x += dt * (motion["v_x_mps"] * math.cos(heading) - motion["v_y_mps"] * math.sin(heading))
            y += dt * (motion["v_x_mps"] * math.sin(heading) + motion["v_y_mps"] * math.cos(heading))
            heading += dt * motion["yaw_rate_radps"]
    bag.close()
    (out / "truth.json").write_text(json.dumps(dict(simulator=kind, car=car_kind or kind, changes=changes, seed=seed), indent=1) + "\n")


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
    changes = {name: float(value) for name, value in (c.split("=", 1) for c in a.changes)}
    pace = 0.75
    for attempt in range(5):
        try:
            return record(a.out, a.simulator, changes, a.seed, a.duration, a.checkout, a.smooth, pace, a.car)
        except RuntimeError as error:
            print(error, file=sys.stderr)
            pace *= 0.85
    raise SystemExit("no pace keeps the car on the track")


if __name__ == "__main__":
    main()
