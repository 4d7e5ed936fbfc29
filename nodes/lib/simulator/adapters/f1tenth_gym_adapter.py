"""f1tenth_gym from the user's checkout: its single-track dynamics with its steering buffer and its own controller.

    adapter: f1tenth_gym
    parameter_file: f1tenth.yaml        # the gym's parameter dictionary (mu, C_Sf, ...), as YAML, JSON or a Python dictionary
    options: {checkout: f1tenth_gym, timestep: "0.01", integrator: RK4}   # F110Env's: RK4 unless yours is told Euler

Reference point: the centre of gravity. `steer_buffer_size` is in code (base_classes.py, RaceCar.__init__).
"""

import importlib.util
import math
import os
import sys
import tempfile
import types
from pathlib import Path

import numpy as np

from gripsight_simulator import Simulator, keys_of, read_options, read_values, serve

BOUNDS = {
    "mu": (0.2, 2.0, "1", None), "C_Sf": (1.0, 15.0, "1/rad", "front_axle"), "C_Sr": (1.0, 15.0, "1/rad", "rear_axle"),
    "lf": (0.05, 0.4, "m", "loads_and_body"), "lr": (0.05, 0.4, "m", "loads_and_body"), "h": (0.0, 0.3, "m", "loads_and_body"),
    "m": (1.0, 12.0, "kg", "loads_and_body"), "I": (0.005, 0.5, "kg m2", "loads_and_body"),
    "sv_max": (0.2, 12.0, "rad/s", "steering"), "s_max": (0.1, 0.8, "rad", "steering"), "a_max": (1.0, 30.0, "m/s2", "drive_train"),
}
DEFAULTS = dict(mu=1.0489, C_Sf=4.718, C_Sr=5.4562, lf=0.15875, lr=0.17145, h=0.074, m=3.74, I=0.04712, s_min=-0.4189,
                s_max=0.4189, sv_min=-3.2, sv_max=3.2, v_switch=7.319, a_max=9.51, v_min=-5.0, v_max=20.0)
# What the gym keeps twice: a limit to the left and one to the right.
RIGHT = {"sv_max": "sv_min", "s_max": "s_min"}


def load_dynamics(checkout):
    """dynamic_models.py of a checkout, with numba where it is installed and without it where not."""
    found = list(Path(checkout).rglob("dynamic_models.py"))
    if not found:
        sys.exit(f"no dynamic_models.py under {Path(checkout).resolve()}: `checkout` must be a clone of f1tenth_gym")
    try:
        import numba  # noqa: F401
    except ImportError:
        stand_in = types.ModuleType("numba")
        stand_in.njit = lambda *a, **k: a[0] if a and callable(a[0]) else (lambda f: f)
        sys.modules["numba"] = stand_in
    # What numba compiles is kept, but not in the user's checkout.
    os.environ.setdefault("NUMBA_CACHE_DIR", os.path.join(tempfile.gettempdir(), "gripsight_numba"))
    spec = importlib.util.spec_from_file_location("gym_dynamics", found[0])
    module = sys.modules["gym_dynamics"] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


class F1tenthGym(Simulator):
    name = "f1tenth_gym"
    states = ["v_x_mps", "v_y_mps", "yaw_rate_radps"]
    inputs = [{"name": "steer", "kind": "steering_angle"}, {"name": "speed", "kind": "speed"}]
    outputs = ["v_x_mps", "v_y_mps", "yaw_rate_radps"]
    lacks = ["a tire that saturates", "tire relaxation", "combined slip", "lateral load transfer"]

    def __init__(self, read, dynamics, step_s, integrator, buffer_size=2):
        keys = keys_of(read, DEFAULTS)
        values = {name: read[key] for name, key in keys.items()}
        self.values, self.dynamics, self.step_s, self.rk4 = {**DEFAULTS, **values}, dynamics, step_s, integrator == "RK4"
        # A limit that is the same on both sides is one parameter; one to the right that differs stays as it is.
        self.same = {left: right for left, right in RIGHT.items()
                     if right not in values or values[right] == -self.values[left]}
        both = {left: [keys[left], "-" + keys[right]] for left, right in self.same.items() if left in keys and right in keys}
        self.parameters = [
            dict(name=name, value=self.values[name], low=low, high=high, unit=unit, key=both.get(name, keys.get(name)),
                 in_code=None if name in keys else "params of F110Env", site=site)
            for name, (low, high, unit, site) in BOUNDS.items()
        ]
        self.parameters.append(dict(name="steer_buffer_size", value=buffer_size, low=0, high=40, unit="1", integer=True,
                                    site="steering", in_code="RaceCar.__init__ in base_classes.py, a step of "
                                    f"{1e3 * step_s:g} ms each"))

    def place(self, parameters, motion, fresh):
        if fresh:
            p = {**self.values, **parameters}
            p.update({right: -p[left] for left, right in self.same.items()})
            names = ("mu", "C_Sf", "C_Sr", "lf", "lr", "h", "m", "I", "s_min", "s_max", "sv_min", "sv_max", "v_switch",
                     "a_max", "v_min", "v_max")
            self.p, self.arguments = p, tuple(float(p[n]) for n in names)
            self.buffer, self.size = [], int(parameters["steer_buffer_size"])
            self.x = np.zeros(7)
        v_x, v_y, yaw_rate = motion
        self.x[3], self.x[5], self.x[6] = math.hypot(v_x, v_y), yaw_rate, math.atan2(v_y, v_x)
        return motion

    def step(self, command):
        steer = 0.0
        if len(self.buffer) >= self.size:
            steer = self.buffer.pop() if self.buffer else command[0]
        if self.size:
            self.buffer.insert(0, command[0])
        p, x, dt = self.p, self.x, self.step_s
        accl, sv = self.dynamics.pid(command[1], steer, x[3], x[2], p["sv_max"], p["a_max"], p["v_max"], p["v_min"])
        u, rates = np.array([sv, accl]), self.dynamics.vehicle_dynamics_st
        k1 = rates(x, u, *self.arguments)
        if self.rk4:
            k2 = rates(x + dt * k1 / 2, u, *self.arguments)
            k3 = rates(x + dt * k2 / 2, u, *self.arguments)
            k4 = rates(x + dt * k3, u, *self.arguments)
            k1 = (k1 + 2 * k2 + 2 * k3 + k4) / 6
        self.x = x = x + dt * k1
        return [x[3] * math.cos(x[6]), x[3] * math.sin(x[6]), x[5]]


def main():
    options = read_options("checkout", "timestep", "integrator", "steer_buffer_size")
    values = read_values(sys.argv[1] if len(sys.argv) > 1 else "")
    dynamics = load_dynamics(options.get("checkout", "f1tenth_gym"))
    size = int(options.get("steer_buffer_size", 2))
    serve(F1tenthGym(values, dynamics, float(options.get("timestep", 0.01)), options.get("integrator", "RK4"), size))


if __name__ == "__main__":
    main()
