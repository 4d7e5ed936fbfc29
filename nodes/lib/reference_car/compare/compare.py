#!/usr/bin/env python3
"""The reference car beside two plants of other authors, set to the same parameters, in the same manoeuvres.

    python3 -m venv VENV && VENV/bin/pip install -r nodes/lib/reference_car/compare/requirements.txt
    cargo build --release -p gripsight_reference_car --example run_scenario
    VENV/bin/python nodes/lib/reference_car/compare/compare.py [--run target/release/examples/run_scenario] [--out FOLDER]

Writes comparison.csv, comparison.md and comparison.svg, and speed.csv, into tests/results/reference_car.
Manoeuvres: a slow steering ramp at constant speed (understeer, friction limit) and a step of the steering angle (yaw response).
"""

import argparse
import csv
import io
import json
import math
import subprocess
import sys
import time
from pathlib import Path

import matplotlib

matplotlib.use("svg")
import matplotlib.pyplot as plt
import numpy as np

ROOT = Path(__file__).resolve().parents[4]
sys.path.insert(0, str(ROOT / "tests" / "plants"))
from make_foreign_bags import G, STEP_S, Multibody, Slipx, bmw  # noqa: E402


def effect(name, **parameters):
    return dict(name=name, parameters=parameters)


def own_transfer(car, mu):
    """The size of lateral_load_transfer at which the car shifts what its centre of gravity says."""
    return car["load_sensitivity"] * (2.0 * car["h_cg_m"] * mu / car["track_width_m"]) ** 2


def base(run, template, plant):
    scenario = json.loads(subprocess.run([run, "--template", template], capture_output=True, check=True).stdout)
    scenario["car"].update(plant.vehicle)
    scenario["driver"]["pace"] = 1.0
    for sensor in ("imu", "wheels"):
        scenario["sensors"][sensor]["rate_hz"] = 0.0
    return scenario


def tire(stiffness, longitudinal, sliding):
    return dict(cornering_stiffness_per_rad=stiffness, longitudinal_stiffness=longitudinal, grip=1.0,
                sliding_share=sliding)


def like_slipx(run, plant):
    """Geometry, masses, stiffness, peak friction, load sensitivity, relaxation and servo of slipx's reference car."""
    s = base(run, "f1tenth", plant)
    car, p = s["car"], plant.model.params
    stiffness = p.c_alpha_f / (p.mass * G / 2.0)
    car.update(track_width_m=p.track_front, max_steering_rad=p.steer_max, load_sensitivity=p.tyre_front.k_mu,
               tire_front=tire(stiffness, 28.0, 0.6), tire_rear=tire(stiffness, 28.0, 0.6))
    car["drive"].update(wheel_radius_m=p.wheel_radius, drive_front_share=0.0, brake_front_share=0.0)
    mu = p.tyre_front.mu_y0
    s["friction"] = dict(kind="uniform", mu=mu)
    s["effects"] = [
        effect("lateral_load_transfer", k=own_transfer(car, mu)), effect("longitudinal_load_transfer", h_m=p.h_cog),
        effect("tire_relaxation", sigma_m=p.tyre_front.relax_length), effect("combined_slip", k=1.0),
        effect("steering_lag", tau_s=2.0 * p.steer_damping / p.steer_bandwidth),
        effect("steering_rate_limit", rate_radps=p.steer_rate_max),
        effect("aero_drag", c_1pm=p.drag_coeff / p.mass), effect("rolling_resistance", c=p.roll_resist),
    ]
    return s


def like_bmw(run, plant):
    """Geometry, masses, springs, stiffness and peak friction of the multibody BMW; its tires have no load sensitivity."""
    s = base(run, "passenger_car", plant)
    car, p = s["car"], plant.p
    track = (p.T_f + p.T_r) / 2.0
    front = p.K_sf * p.T_f**2 / 2.0 - p.K_tsf
    rear = p.K_sr * p.T_r**2 / 2.0 - p.K_tsr
    arm = p.m_s * G * p.h_s
    car.update(track_width_m=track, max_steering_rad=p.steering.max, load_sensitivity=1e-3,
               tire_front=tire(-p.tire.p_ky1, p.tire.p_kx1, 0.7), tire_rear=tire(-p.tire.p_ky1, p.tire.p_kx1, 0.7))
    car["roll"].update(gradient_rad_per_g=arm / (front + rear - arm), front_share=front / (front + rear))
    car["drive"].update(wheel_radius_m=p.R_w, wheel_inertia_kgm2=p.I_y_w, drive_front_share=p.T_se,
                        brake_front_share=p.T_sb)
    mu = p.tire.p_dy1
    s["friction"] = dict(kind="uniform", mu=mu)
    s["effects"] = [
        effect("lateral_load_transfer", k=own_transfer(car, mu)), effect("longitudinal_load_transfer", h_m=p.h_cg),
        effect("combined_slip", k=1.0), effect("steering_lag", tau_s=0.05),
        effect("steering_rate_limit", rate_radps=p.steering.v_max),
    ]
    return s


def drive_ours(run, scenario, course, duration_s):
    scenario = dict(scenario, course=course, duration_s=duration_s)
    done = subprocess.run([run], input=json.dumps(scenario).encode(), capture_output=True, check=True)
    table = np.genfromtxt(io.BytesIO(done.stdout), delimiter=",", names=True)
    t = table["stamp_s"]
    side = (table["f_y_front_n"] * np.cos(table["steering_front_rad"]) + table["f_y_rear_n"]
            + table["f_x_front_n"] * np.sin(table["steering_front_rad"]))
    return dict(t=t, d=table["steering_front_rad"], v=table["v_x_mps"], r=table["yaw_rate_radps"],
                a=side / (table["f_z_front_n"] + table["f_z_rear_n"]) * G)


def drive_theirs(plant, steering, speed_mps, duration_s):
    plant.place(0.0, 0.0, 0.0, speed_mps)
    rows = []
    start = time.perf_counter()
    for step in range(round(duration_s / STEP_S)):
        now = step * STEP_S
        if step % 10 == 0:
            v = plant.pose()[3]
            plant.drive(steering(now), min(max(3.0 * (speed_mps - v), -5.0), 5.0))
        plant.step()
        if step % 10 == 9:
            truth, pose = plant.truth(), plant.pose()
            side = truth["f_y_front_n"] * math.cos(truth["steering_rad"]) + truth["f_y_rear_n"]
            load = truth["f_z_front_n"] + truth["f_z_rear_n"]
            if not truth["f_z_least_n"] > 0.0:
                break  # a wheel leaves the road: the multibody model's tires then pull
            rows.append((now + STEP_S, truth["steering_rad"], pose[3], pose[5], side / load * G))
    taken = time.perf_counter() - start
    return dict(zip("tdvra", np.array(rows).T)), duration_s / taken


def understeer(run, wheelbase_m, mu):
    """Steering beyond the wheelbase's, per g, over the first 40 % of the grip."""
    use = (run["t"] > 2.0) & (run["a"] > 0.05 * mu * G) & (run["a"] < 0.4 * mu * G)
    extra = run["d"][use] - wheelbase_m * run["r"][use] / run["v"][use]
    return float(np.polyfit(run["a"][use] / G, extra, 1)[0])


def step_figures(run):
    after = run["t"] > 1.0
    t, r = run["t"][after] - 1.0, run["r"][after]
    steady = float(np.mean(r[t > t[-1] - 0.5]))
    rise = lambda share: float(np.interp(share * steady, r[: int(np.argmax(r)) + 1], t[: int(np.argmax(r)) + 1]))
    return steady / float(run["d"][-1]), rise(0.5), rise(0.9), 100.0 * (float(r.max()) / steady - 1.0)


def smooth(a, width=21):
    return np.convolve(np.pad(a, width // 2, mode="edge"), np.ones(width) / width, mode="valid")


def compare(run, name, plant, scenario, speed_mps, ramp_radps, angle_rad):
    mu = scenario["friction"]["mu"]
    since = lambda t: max(0.0, t - 1.0)
    theirs, _ = drive_theirs(plant(), lambda t: ramp_radps * since(t), speed_mps, 21.0)
    ours = drive_ours(run, scenario, dict(kind="ramp_steer", speed_mps=speed_mps, rate_radps=ramp_radps), 21.0)
    step_theirs, factor = drive_theirs(plant(), lambda t: angle_rad if t > 1.001 else 0.0, speed_mps, 4.0)
    course = dict(kind="step_steer", speed_mps=speed_mps, angle_rad=angle_rad, rise_s=0.0)
    step_ours = drive_ours(run, scenario, course, 4.0)
    timed = dict(scenario, course=course, duration_s=40.0)
    done = subprocess.run([run, "--time"], input=json.dumps(timed).encode(), capture_output=True, check=True)
    wheelbase = plant().wheelbase_m
    rows = [("understeer gradient", "rad/g", understeer(theirs, wheelbase, mu), understeer(ours, wheelbase, mu)),
            ("largest lateral acceleration", "m/s2", smooth(theirs["a"]).max(), smooth(ours["a"]).max())]
    names = [("yaw rate per steering angle after a step", "1/s"), ("time to half of it", "s"), ("time to 90 %", "s"),
             ("overshoot", "%")]
    rows += [(n, u, a, b) for (n, u), a, b in zip(names, step_figures(step_theirs), step_figures(step_ours))]
    return dict(name=name, rows=rows, ramp=(theirs, ours), step=(step_theirs, step_ours), speed=speed_mps,
                factor=(factor, float(done.stdout)))


def draw(results, path):
    plt.rcParams.update({"svg.hashsalt": "gripsight", "font.size": 9, "axes.grid": True, "grid.alpha": 0.3})
    figure, axes = plt.subplots(2, 2, figsize=(10, 7))
    for row, result in zip(axes, results):
        for run, label, style in zip(result["ramp"], (result["name"], "reference car"), ("k-", "C0-")):
            row[0].plot(np.degrees(run["d"]), smooth(run["a"]), style, label=label)
        row[0].set(xlabel="road-wheel angle (degrees)", ylabel="lateral acceleration (m/s2)",
                   title=f"steering ramp at {result['speed']:g} m/s")
        row[0].set_xlim(left=0.0)
        row[0].legend(loc="lower right")
        for run, label, style in zip(result["step"], (result["name"], "reference car"), ("k-", "C0-")):
            row[1].plot(run["t"] - 1.0, run["r"], style, label=label)
        row[1].set(xlabel="time after the step (s)", ylabel="yaw rate (rad/s)",
                   title=f"steering step at {result['speed']:g} m/s", xlim=(-0.1, 1.5))
        row[1].legend(loc="lower right")
    figure.tight_layout()
    figure.savefig(path, metadata={"Date": None})


EXPLAINED = """
Set alike: mass, yaw inertia, axle distances, track width, height of the centre of gravity, cornering stiffness and peak
friction at the nominal load, load sensitivity, relaxation length and servo and drag and rolling resistance (slipx), roll
stiffness and its split (BMW), drive and brake split. Lateral acceleration: the axles' lateral forces over their load.

What differs, and why:

- Tire curve. The plants use Magic Formulas of their own shape (C 1.68, E 0.42 and C 1.35, E -0.01), ours is the elliptic
  brush: the steering ramps part between half of the grip and the peak, and behind it the curves fall differently.
- Understeer gradient. All three cars are within 0.001 rad/g of neutral (equal stiffness over load front and rear), so that
  only small things are left: load-dependent stiffness, camber, the resistances.
- Overshoot of the small car. Our relaxation length grows with the square root of the wheel's load and the body rolls
  before the load has shifted; slipx shifts the load at once and lags each tire's slip angle by one length.
- Rise of the BMW's yaw rate. Its body hangs on compliant lateral joints and unsprung axles, and its tires have camber
  thrust and a side force without slip; ours has none of these. Its last ten percent come later.
- Limit of the BMW (its peak friction scaled to 0.8, so that no wheel lifts before). Its friction grows with the camber (p_dy3 = -2.9) that body roll gives, and with it the lateral
  acceleration. A run ends where a wheel leaves the road: the multibody tires would then pull on it.
- The multibody model adds yaw rate times half the track to the speed of the wheels that it calls left, where geometry
  subtracts it; this exchanges the slips of an axle's wheels.
"""


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--run", default=str(ROOT / "target" / "release" / "examples" / "run_scenario"))
    parser.add_argument("--out", type=Path, default=ROOT / "tests" / "results" / "reference_car")
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    small, large = lambda: Slipx(1.1), lambda: Multibody(bmw, 0.8)
    results = [
        compare(arguments.run, "slipx 0.2.0", small, like_slipx(arguments.run, small()), 4.0, 0.02, 0.08),
        compare(arguments.run, "CommonRoad multibody BMW 320i", large, like_bmw(arguments.run, large()), 20.0, 0.01, 0.03),
    ]
    draw(results, arguments.out / "comparison.svg")
    with open(arguments.out / "comparison.csv", "w", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(["plant", "quantity", "unit", "plant_value", "reference_car", "difference_percent"])
        for result in results:
            for name, unit, theirs, ours in result["rows"]:
                share = "" if unit == "%" or abs(theirs) < 2e-3 else f"{100.0 * (ours / theirs - 1.0):.1f}"
                table.writerow([result["name"], name, unit, f"{theirs:.4f}", f"{ours:.4f}", share])
    with open(arguments.out / "speed.csv", "w", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(["plant", "manoeuvre", "simulated_seconds_per_second"])
        for result in results:
            manoeuvre = f"steering step at {result['speed']:g} m/s, 1 kHz, one core"
            table.writerow([result["name"], manoeuvre, f"{result['factor'][0]:.3g}"])
            table.writerow(["reference car", manoeuvre, f"{result['factor'][1]:.3g}"])
    with open(arguments.out / "comparison.csv", newline="") as file:
        rows = list(csv.reader(file))
    with open(arguments.out / "speed.csv", newline="") as file:
        speeds = list(csv.reader(file))
    markdown = lambda table: "\n".join(
        ["| " + " | ".join(table[0]) + " |", "|" + " --- |" * len(table[0])]
        + ["| " + " | ".join(row) + " |" for row in table[1:]])
    text = ("# The reference car beside plants of other authors\n\nMade by `nodes/lib/reference_car/compare/compare.py`;"
            " picture: comparison.svg.\n\n" + markdown(rows) + "\n" + EXPLAINED
            + "\n## Speed, all in one run of the script\n\n" + markdown(speeds)
            + "\n\nslipx is C++ behind Python calls, the multibody model is Python with four evaluations a step.\n")
    (arguments.out / "comparison.md").write_text(text)
    print(text)


if __name__ == "__main__":
    main()
