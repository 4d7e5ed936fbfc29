#!/usr/bin/env python3
"""Drives two plants that this project did not write, and records them as ROS 2 bags with their true tire forces.

Plants: `slipx` (1:10 double track with relaxation, load sensitivity, combined slip, servo; its own car and one of 1:8), the 29-state
multibody car of `commonroad-vehicle-models` (Ford Escort, BMW 320i, VW Vanagon) and its single-track drift model (Ford Escort, BMW 320i).
Packages: nodes/lib/reference_car/compare/requirements.txt.

    make_foreign_bags.py OUT [--only NAME ...] [--duration S]
    make_foreign_bags.py OUT --draw N --seed S [--plants PLANT ...] [--duration S]

For every drive NAME of the table at the end, or for N drives of the plants named in turn whose track, friction and pace are drawn (for
`gripsight withheld make --foreign OUT`): OUT/NAME/NAME.mcap (nav_msgs/Odometry, ackermann_msgs/AckermannDriveStamped,
sensor_msgs/Imu, 100 Hz), OUT/NAME/truth_axle_forces.csv (at the odometry's stamps), OUT/NAME/vehicle.yaml, and
OUT/NAME/about.json with the effects that the plant contains by its equations. Same packages, same bytes.

Drive command: for slipx `steering_angle` is the command (the servo's lag is the plant's), for the multibody car the angle
of the road wheels. `acceleration` is the longitudinal force asked of the tires over the mass.
Stated in vehicle.yaml: the plant's true mass, inertia, axle distances, and the split of drive and brake.
"""

import argparse
import json
import math
from pathlib import Path

import numpy as np
import slipx
import vehiclemodels.utils.tire_model as tire_model
import vehiclemodels.vehicle_dynamics_mb as multibody
from mcap_ros2.writer import Writer
import vehiclemodels.vehicle_dynamics_std as single_track_drift
from vehiclemodels.init_mb import init_mb
from vehiclemodels.init_std import init_std
from vehiclemodels.parameters_vehicle1 import parameters_vehicle1
from vehiclemodels.parameters_vehicle2 import parameters_vehicle2
from vehiclemodels.parameters_vehicle3 import parameters_vehicle3

G = 9.81
STEP_S = 1e-3
SAMPLE_STEPS = 10
START_NS = 1_700_000_000_000_000_000

# Closed tracks as radius over the polar angle: size in wheelbases, then (order, cosine, sine) of the wave.
TRACKS = {
    "kidney": (26.0, ((1, 0.18, 0.0), (2, -0.26, 0.0), (3, 0.0, 0.06))),
    "rounded_square": (28.0, ((4, 0.09, 0.0), (2, 0.16, 0.05))),
    "serpentine": (34.0, ((2, 0.20, 0.0), (5, 0.05, 0.02), (3, 0.0, 0.07))),
}


class Track:
    """A centre line sampled by arc length."""

    def __init__(self, name, wheelbase_m, reverse):
        size, waves = TRACKS[name]
        p = np.linspace(0.0, 2.0 * np.pi, 20001)[:-1] * (-1.0 if reverse else 1.0)
        radius = size * wheelbase_m * (1.0 + sum(c * np.cos(k * p) + s * np.sin(k * p) for k, c, s in waves))
        x, y = radius * np.cos(p), radius * np.sin(p)
        ring = lambda v: np.append(v, v[0])
        arc = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(ring(x)), np.diff(ring(y))))])
        self.length = arc[-1]
        self.step = self.length / 2000
        s = np.arange(2000) * self.step
        self.x, self.y = np.interp(s, arc, ring(x)), np.interp(s, arc, ring(y))
        dx, dy = np.gradient(np.tile(self.x, 3)), np.gradient(np.tile(self.y, 3))
        heading = np.unwrap(np.arctan2(dy, dx))
        self.heading = heading[2000:4000]
        self.curvature = (np.gradient(heading) / self.step)[2000:4000]

    def nearest(self, x, y, near):
        window = (near + np.arange(-15, 40)) % 2000
        distance = (self.x[window] - x) ** 2 + (self.y[window] - y) ** 2
        return int(window[int(np.argmin(distance))])

    def speeds(self, a_y, a_x, top):
        v = np.minimum(np.sqrt(a_y / np.maximum(np.abs(self.curvature), 1e-9)), top)
        for direction in (1, -1):
            for i in range(4000):
                here, there = (i % 2000, (i + 1) % 2000) if direction > 0 else ((-i) % 2000, (-i - 1) % 2000)
                left = 1.0 - min(1.0, v[here] ** 2 * abs(self.curvature[here]) / a_y)
                v[there] = min(v[there], math.sqrt(v[here] ** 2 + 2.0 * a_x * left * self.step))
        return v


class Driver:
    """Pure pursuit with a speed profile at a share of the grip, and a little broad-band steering on top."""

    def __init__(self, track, wheelbase_m, mu, pace, a_x_share, top_mps, dither_rad, rng):
        self.track, self.wheelbase_m = track, wheelbase_m
        self.profile = track.speeds(pace * mu * G, a_x_share * mu * G, top_mps)
        self.limit = 1.3 * a_x_share * mu * G
        self.dither_rad = dither_rad
        self.waves = [(0.5 * 1.5**i, rng.uniform(0.0, 2.0 * math.pi)) for i in range(5)]
        self.at = 0

    def command(self, t, x, y, heading, v):
        track = self.track
        self.at = track.nearest(x, y, self.at)
        ahead = max(1.5 * self.wheelbase_m, 0.35 * v)
        aim = (self.at + round(ahead / track.step)) % 2000
        dx, dy = track.x[aim] - x, track.y[aim] - y
        across = -math.sin(heading) * dx + math.cos(heading) * dy
        steering = math.atan(self.wheelbase_m * 2.0 * across / (dx * dx + dy * dy))
        steering += self.dither_rad * sum(math.sin(2.0 * math.pi * f * t + p) for f, p in self.waves) / 2.0
        following = (self.at + round(0.1 * v / track.step)) % 2000
        speed = float(self.profile[following])
        return steering, speed, float(np.clip(2.5 * (speed - v), -self.limit, self.limit))


class Slipx:
    """The 1:10 car at its most detailed tier, its friction scaled to `mu`."""

    steering_is = "command; the servo's lag is in the plant"
    contained = [
        "combined_slip", "lateral_load_transfer", "longitudinal_load_transfer", "rolling_resistance", "aero_drag",
        "steering_delay", "steering_lag", "steering_rate_limit", "tire_relaxation",
    ]
    # It brakes and drives with the rear axle alone.
    a_x_share = 0.2

    @staticmethod
    def figures():
        return slipx.load_reference_car().params

    def __init__(self, mu):
        p = self.figures()
        for tire in (p.tyre_front, p.tyre_rear):
            ratio = tire.mu_x0 / tire.mu_y0
            tire.mu_y0, tire.mu_x0 = mu, mu * ratio
        self.vehicle = dict(
            mass_kg=p.mass, yaw_inertia_kgm2=p.izz, l_f_m=p.lf, l_r_m=p.lr, h_cg_m=p.h_cog, track_width_m=p.track_front,
            drive_front_share=0.0, brake_front_share=0.0,
        )
        self.wheelbase_m, self.top_mps, self.wheel_radius_m = p.lf + p.lr, 12.0, p.wheel_radius
        self.model = slipx.VehicleModel.create(slipx.Tier.L2_DoubleTrack, p)
        self.state, self.seen = slipx.VehicleState(), slipx.StepDiagnostics()
        self.command = (0.0, 0.0)

    def place(self, x, y, heading, v):
        self.state.pos = slipx.Vec3(x, y, 0.0)
        self.state.yaw = heading
        self.state.vel_body = slipx.Vec3(v, 0.0, 0.0)
        self.state.omega_w = [v / self.wheel_radius_m] * 4

    def pose(self):
        s = self.state
        return s.pos.x, s.pos.y, s.yaw, s.vx, s.vy, s.yaw_rate

    def drive(self, steering, acceleration):
        self.command = (steering, acceleration)

    def step(self):
        steering, acceleration = self.command
        self.model.step(self.state, slipx.DriveInput(steer_cmd=steering, accel_cmd=acceleration), STEP_S, self.seen)

    def truth(self):
        d = self.seen
        return dict(
            f_y_front_n=d.fy_front, f_y_rear_n=d.fy_rear, f_z_front_n=d.fz_front, f_z_rear_n=d.fz_rear,
            f_z_least_n=min(d.fz),
            steering_rad=self.state.steer, a_x_mps2=d.ax, a_y_mps2=d.ay,
        )

    def steering(self):
        return self.command[0]


class Buggy(Slipx):
    """The same equations for a 1:8 car that nothing was developed on: heavier, its weight behind, softer tires that relax over a longer way."""

    @staticmethod
    def figures():
        p = slipx.load_reference_car().params
        p.mass, p.izz, p.h_cog = 5.4, 0.118, 0.085
        p.lf, p.lr, p.track_front, p.track_rear = 0.215, 0.165, 0.30, 0.30
        p.wheel_radius, p.torque_stall, p.steer_bandwidth = 0.058, 3.6, 32.0
        p.c_alpha_f, p.c_alpha_r = 430.0, 610.0
        for tire in (p.tyre_front, p.tyre_rear):
            tire.relax_length, tire.shape_c, tire.k_mu = 0.12, 1.45, 0.1
        return p


class Multibody:
    """A multibody passenger car, its tires' peak friction scaled to `mu`, stiffness unchanged."""

    steering_is = "angle of the road wheels"
    # Springs, roll centres and camber make the rear axle steer and thrust with roll; there is no relaxation and no servo.
    # The wheels must be spun up, too: 4 I_y_w / R_w^2 is 4.7 % (Ford) and 5.3 % (BMW) of the mass.
    contained = ["combined_slip", "lateral_load_transfer", "longitudinal_load_transfer", "mass_error", "roll_steer"]
    a_x_share = 0.4

    def __init__(self, parameters, mu):
        p = parameters()
        lateral = p.tire.p_dy1
        p.tire.p_dx1 *= mu / lateral
        p.tire.p_dy1 = mu
        self.p = p
        self.vehicle = dict(
            mass_kg=p.m, yaw_inertia_kgm2=p.I_z, l_f_m=p.a, l_r_m=p.b, h_cg_m=p.h_cg, track_width_m=0.5 * (p.T_f + p.T_r),
            drive_front_share=float(p.T_se), brake_front_share=float(p.T_sb),
        )
        self.wheelbase_m, self.top_mps = p.a + p.b, 33.0
        self.wanted, self.acceleration, self.wheels = 0.0, 0.0, []
        self.tires = tire_model.formula_lateral_comb

    def place(self, x, y, heading, v):
        self.x = np.array(init_mb([x, y, 0.0, v, heading, 0.0, 0.0], self.p))

    def pose(self):
        return self.x[0], self.x[1], self.x[4], self.x[3], self.x[10], self.x[5]

    def drive(self, steering, acceleration):
        self.wanted, self.acceleration = steering, acceleration

    def rates(self, x):
        rate = (self.wanted - x[2]) / 0.05
        return np.array(multibody.vehicle_dynamics_mb(list(x), [rate, self.acceleration], self.p))

    def step(self):
        k1 = self.rates(self.x)
        k2 = self.rates(self.x + STEP_S / 2 * k1)
        k3 = self.rates(self.x + STEP_S / 2 * k2)
        k4 = self.rates(self.x + STEP_S * k3)
        self.x = self.x + STEP_S / 6 * (k1 + 2 * k2 + 2 * k3 + k4)

    def watched_rates(self):
        """Rates of the state, and lateral and vertical force of each tire that the plant has."""
        seen = []

        def watched(kappa, alpha, gamma, mu_y, f_z, f0_y, p):
            f_y = self.tires(kappa, alpha, gamma, mu_y, f_z, f0_y, p)
            seen.append((f_y, f_z))
            return f_y

        tire_model.formula_lateral_comb = watched
        f = self.rates(self.x)
        tire_model.formula_lateral_comb = self.tires
        return f, seen

    def truth(self):
        f, ((fl, zfl), (fr, zfr), (rl, zrl), (rr, zrr)) = self.watched_rates()
        return dict(
            f_y_front_n=fl + fr, f_y_rear_n=rl + rr, f_z_front_n=zfl + zfr, f_z_rear_n=zrl + zrr,
            f_z_least_n=min(zfl, zfr, zrl, zrr),
            steering_rad=self.x[2], a_x_mps2=f[3] - self.x[10] * self.x[5], a_y_mps2=f[10] + self.x[3] * self.x[5],
        )

    def steering(self):
        return self.x[2]


class Drift(Multibody):
    """The single-track model with wheels that slip lengthwise, of the same figures: no roll, and no lateral transfer of load."""

    contained = ["combined_slip", "longitudinal_load_transfer", "mass_error"]

    def __init__(self, parameters, mu):
        super().__init__(parameters, mu)
        self.vehicle["h_cg_m"] = self.p.h_s

    def place(self, x, y, heading, v):
        self.x = np.array(init_std([x, y, 0.0, v, heading, 0.0, 0.0], self.p))

    def pose(self):
        v, slip = self.x[3], self.x[6]
        return self.x[0], self.x[1], self.x[4], v * math.cos(slip), v * math.sin(slip), self.x[5]

    def rates(self, x):
        rate = (self.wanted - x[2]) / 0.05
        return np.array(single_track_drift.vehicle_dynamics_std(list(x), [rate, self.acceleration], self.p))

    def truth(self):
        f, ((front, z_front), (rear, z_rear)) = self.watched_rates()
        v, slip = self.x[3], self.x[6]
        turning = f[6] + self.x[5]
        return dict(
            f_y_front_n=front, f_y_rear_n=rear, f_z_front_n=z_front, f_z_rear_n=z_rear, f_z_least_n=min(z_front, z_rear),
            steering_rad=self.x[2], a_x_mps2=f[3] * math.cos(slip) - v * turning * math.sin(slip),
            a_y_mps2=f[3] * math.sin(slip) + v * turning * math.cos(slip),
        )


HEADER = "std_msgs/Header header\n"
RULE = "=" * 80 + "\n"
DEFINITIONS = {
    "std_msgs/Header": "builtin_interfaces/Time stamp\nstring frame_id\n",
    "builtin_interfaces/Time": "int32 sec\nuint32 nanosec\n",
    "geometry_msgs/Point": "float64 x\nfloat64 y\nfloat64 z\n",
    "geometry_msgs/Vector3": "float64 x\nfloat64 y\nfloat64 z\n",
    "geometry_msgs/Quaternion": "float64 x\nfloat64 y\nfloat64 z\nfloat64 w\n",
    "geometry_msgs/Pose": "geometry_msgs/Point position\ngeometry_msgs/Quaternion orientation\n",
    "geometry_msgs/Twist": "geometry_msgs/Vector3 linear\ngeometry_msgs/Vector3 angular\n",
    "geometry_msgs/PoseWithCovariance": "geometry_msgs/Pose pose\nfloat64[36] covariance\n",
    "geometry_msgs/TwistWithCovariance": "geometry_msgs/Twist twist\nfloat64[36] covariance\n",
    "ackermann_msgs/AckermannDrive":
        "float32 steering_angle\nfloat32 steering_angle_velocity\nfloat32 speed\nfloat32 acceleration\nfloat32 jerk\n",
}
MESSAGES = {
    "nav_msgs/msg/Odometry": (
        HEADER + "string child_frame_id\ngeometry_msgs/PoseWithCovariance pose\ngeometry_msgs/TwistWithCovariance twist\n",
        ["std_msgs/Header", "builtin_interfaces/Time", "geometry_msgs/PoseWithCovariance", "geometry_msgs/Pose",
         "geometry_msgs/Point", "geometry_msgs/Quaternion", "geometry_msgs/TwistWithCovariance",
         "geometry_msgs/Twist", "geometry_msgs/Vector3"],
    ),
    "ackermann_msgs/msg/AckermannDriveStamped": (
        HEADER + "ackermann_msgs/AckermannDrive drive\n",
        ["std_msgs/Header", "builtin_interfaces/Time", "ackermann_msgs/AckermannDrive"],
    ),
    "sensor_msgs/msg/Imu": (
        HEADER + "geometry_msgs/Quaternion orientation\nfloat64[9] orientation_covariance\n"
        "geometry_msgs/Vector3 angular_velocity\nfloat64[9] angular_velocity_covariance\n"
        "geometry_msgs/Vector3 linear_acceleration\nfloat64[9] linear_acceleration_covariance\n",
        ["std_msgs/Header", "builtin_interfaces/Time", "geometry_msgs/Quaternion", "geometry_msgs/Vector3"],
    ),
}


class Bag:
    """The topics of the recorded cars, as MCAP."""

    def __init__(self, path):
        self.file = open(path, "wb")
        self.writer = Writer(self.file)
        self.schemas = {
            name: self.writer.register_msgdef(
                name, text + "".join(f"{RULE}MSG: {part}\n{DEFINITIONS[part]}" for part in parts)
            )
            for name, (text, parts) in MESSAGES.items()
        }

    def write(self, topic, kind, nanoseconds, frame, message):
        stamp = dict(sec=nanoseconds // 10**9, nanosec=nanoseconds % 10**9)
        message["header"] = dict(stamp=stamp, frame_id=frame)
        self.writer.write_message(topic, self.schemas[kind], message, nanoseconds, nanoseconds)

    def close(self):
        self.writer.finish()
        self.file.close()


def record(out, name, plant, track_name, reverse, mu, pace, seed, duration_s, dither_rad):
    """One closed-loop drive: bag, true forces, vehicle file."""
    folder = out / name
    folder.mkdir(parents=True, exist_ok=True)
    rng = np.random.default_rng(seed)
    track = Track(track_name, plant.wheelbase_m, reverse)
    driver = Driver(track, plant.wheelbase_m, mu, pace, plant.a_x_share, plant.top_mps, dither_rad, rng)
    plant.place(track.x[0], track.y[0], track.heading[0], float(driver.profile.min()))
    small = plant.wheelbase_m < 1.0
    noise = dict(position=0.003, heading=0.002, v_x=0.02, v_y=0.015, rate=0.006, accel=0.1)
    if not small:
        noise = dict(position=0.02, heading=0.001, v_x=0.03, v_y=0.02, rate=0.003, accel=0.08)
    bag = Bag(folder / f"{name}.mcap")
    rows, worst = [], 0.0
    for step in range(round(duration_s / STEP_S) + 1):
        if step % SAMPLE_STEPS == 0:
            x, y, heading, v_x, v_y, rate = plant.pose()
            t = step * STEP_S
            steering, speed, acceleration = driver.command(t, x, y, heading, v_x)
            plant.drive(steering, acceleration)
            if step == 0 and small:
                plant.step()
            truth = plant.truth()
            worst = max(worst, math.hypot(x - track.x[driver.at], y - track.y[driver.at]) / plant.wheelbase_m)
            if not math.isfinite(v_x) or abs(math.atan2(v_y, v_x)) > 0.8 or worst > 8.0:
                raise RuntimeError(f"{name}: the car left the track or spun at {t:.2f} s")
            stamp = START_NS + step * round(STEP_S * 1e9)
            rows.append([stamp / 1e9, *truth.values(), v_x, v_y, rate])
            n = {k: rng.normal(0.0, s, 3) for k, s in noise.items()}
            psi = heading + n["heading"][0]
            bag.write("/car_state/odom", "nav_msgs/msg/Odometry", stamp, "map", dict(
                child_frame_id="base_link",
                pose=dict(covariance=[0.0] * 36, pose=dict(
                    position=dict(x=x + n["position"][0], y=y + n["position"][1], z=0.0),
                    orientation=dict(x=0.0, y=0.0, z=math.sin(psi / 2), w=math.cos(psi / 2)))),
                twist=dict(covariance=[0.0] * 36, twist=dict(
                    linear=dict(x=v_x + n["v_x"][0], y=v_y + n["v_y"][0], z=0.0),
                    angular=dict(x=0.0, y=0.0, z=rate + n["rate"][0])))))
            bag.write("/drive", "ackermann_msgs/msg/AckermannDriveStamped", stamp, "base_link", dict(drive=dict(
                steering_angle=float(plant.steering()), steering_angle_velocity=0.0, speed=speed,
                acceleration=acceleration, jerk=0.0)))
            bag.write("/imu/data", "sensor_msgs/msg/Imu", stamp, "base_link", dict(
                orientation=dict(x=0.0, y=0.0, z=0.0, w=1.0), orientation_covariance=[-1.0] + [0.0] * 8,
                angular_velocity=dict(x=0.0, y=0.0, z=rate + n["rate"][1]), angular_velocity_covariance=[0.0] * 9,
                linear_acceleration=dict(x=truth["a_x_mps2"] + n["accel"][0], y=truth["a_y_mps2"] + n["accel"][1], z=G),
                linear_acceleration_covariance=[0.0] * 9))
        plant.step()
    bag.close()
    names = ["stamp_s", *truth.keys(), "v_x_mps", "v_y_mps", "yaw_rate_radps"]
    lines = [",".join(names)] + [f"{r[0]:.6f}," + ",".join(f"{v:.6f}" for v in r[1:]) for r in rows]
    (folder / "truth_axle_forces.csv").write_text("\n".join(lines) + "\n")
    vehicle = "".join(f"      {key}: {value:.6g}\n" for key, value in plant.vehicle.items())
    (folder / "vehicle.yaml").write_text(f"/**:\n  ros__parameters:\n    vehicle:\n      name: {name}\n{vehicle}")
    data = np.array([r[1:] for r in rows])
    use = np.abs(data[:, :2] / data[:, 2:4]).max(axis=0)
    about = dict(track=track_name, reverse=reverse, mu=mu, pace=pace, seed=seed, duration_s=duration_s,
                 steering_angle=plant.steering_is, contained=plant.contained, noise_standard_deviations=noise,
                 largest_f_y_over_f_z=dict(front=round(float(use[0]), 3), rear=round(float(use[1]), 3)))
    (folder / "about.json").write_text(json.dumps(about, indent=2) + "\n")
    print(f"{name}: F_y/F_z up to {use[0]:.2f} front, {use[1]:.2f} rear; off the line by {worst:.1f} wheelbases")


ford, bmw, vanagon = parameters_vehicle1, parameters_vehicle2, parameters_vehicle3
# What is drawn from: the plant, its friction and pace from and to, steering dither (rad).
PLANTS = {
    "slipx": (Slipx, (0.7, 1.1), (0.72, 0.84), 0.02),
    "bmw": (lambda mu: Multibody(bmw, mu), (0.55, 0.95), (0.70, 0.80), 0.004),
    "ford": (lambda mu: Multibody(ford, mu), (0.55, 0.95), (0.70, 0.80), 0.004),
    "buggy": (Buggy, (0.7, 1.1), (0.72, 0.84), 0.02),
    "vanagon": (lambda mu: Multibody(vanagon, mu), (0.55, 0.95), (0.70, 0.80), 0.004),
    "drift_bmw": (lambda mu: Drift(bmw, mu), (0.55, 0.95), (0.70, 0.80), 0.004),
    "drift_ford": (lambda mu: Drift(ford, mu), (0.55, 0.95), (0.70, 0.80), 0.004),
}
# name, plant, track, reverse, mu, pace, seed, steering dither (rad). Those named test_ are looked at for published figures only.
DRIVES = [
    ("slipx_mu08", lambda: Slipx(0.8), "kidney", False, 0.8, 0.85, 11, 0.02),
    ("slipx_mu11", lambda: Slipx(1.1), "serpentine", True, 1.1, 0.78, 12, 0.02),
    ("bmw_mu06", lambda: Multibody(bmw, 0.6), "rounded_square", False, 0.6, 0.78, 13, 0.004),
    ("bmw_mu09", lambda: Multibody(bmw, 0.9), "serpentine", True, 0.9, 0.76, 14, 0.004),
    ("ford_mu06", lambda: Multibody(ford, 0.6), "kidney", True, 0.6, 0.80, 15, 0.004),
    ("ford_mu09", lambda: Multibody(ford, 0.9), "rounded_square", False, 0.9, 0.80, 16, 0.004),
    ("test_slipx_mu07", lambda: Slipx(0.7), "rounded_square", True, 0.7, 0.82, 31, 0.02),
    ("test_slipx_mu10", lambda: Slipx(1.0), "kidney", True, 1.0, 0.62, 32, 0.02),
    ("test_bmw_mu07", lambda: Multibody(bmw, 0.7), "kidney", True, 0.7, 0.76, 33, 0.004),
    ("test_bmw_mu10", lambda: Multibody(bmw, 1.0), "rounded_square", True, 1.0, 0.66, 34, 0.004),
    ("test_ford_mu07", lambda: Multibody(ford, 0.7), "serpentine", False, 0.7, 0.76, 35, 0.004),
    ("test_ford_mu08", lambda: Multibody(ford, 0.8), "kidney", False, 0.8, 0.76, 36, 0.004),
]


def drawn(number, seed, plants):
    """Rows as in DRIVES, of the plants in turn."""
    rng = np.random.default_rng(seed)
    rows = []
    for place in range(number):
        kind = plants[place % len(plants)]
        plant, frictions, paces, dither = PLANTS[kind]
        mu = float(rng.uniform(*frictions))
        track = str(rng.choice(list(TRACKS)))
        pace = float(rng.uniform(*paces))
        build = lambda plant=plant, mu=mu: plant(mu)
        rows.append((f"{kind}_{place:02d}", build, track, bool(rng.integers(2)), mu, pace, int(rng.integers(2**31)), dither))
    return rows


def drive_slower(out, row, duration):
    """Records a drive; one that leaves the track is driven again at a lower pace."""
    name, build, track, reverse, mu, pace, seed, dither = row
    for _ in range(4):
        try:
            return record(out, name, build(), track, reverse, mu, pace, seed, duration, dither)
        except RuntimeError as error:
            print(error)
            pace *= 0.93
    raise SystemExit(f"{name}: no pace keeps it on the track")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("--only", nargs="+", choices=[d[0] for d in DRIVES])
    parser.add_argument("--draw", type=int, metavar="N", help="draw N drives instead of the table's")
    parser.add_argument("--seed", type=int, default=1, help="seed of the draw")
    parser.add_argument("--plants", nargs="+", choices=PLANTS, default=["slipx", "bmw", "slipx", "ford"], help="what the draw takes in turn")
    parser.add_argument("--duration", type=float, default=40.0)
    arguments = parser.parse_args()
    if arguments.draw is not None:
        for row in drawn(arguments.draw, arguments.seed, arguments.plants):
            drive_slower(arguments.out, row, arguments.duration)
        return
    for name, plant, track, reverse, mu, pace, seed, dither in DRIVES:
        if arguments.only is None or name in arguments.only:
            record(arguments.out, name, plant(), track, reverse, mu, pace, seed, arguments.duration, dither)


if __name__ == "__main__":
    main()
