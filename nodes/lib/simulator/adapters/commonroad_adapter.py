"""CommonRoad's vehicle models (PyPI: commonroad-vehicle-models).

    adapter: commonroad
    parameter_file: vehicle.yaml                 # as in the package: `m: 1093.3`, `tire:` with `p_dy1: 1.0489` in it; the rest is the vehicle's
    options: {model: st, vehicle: "2"}           # st (single track), std (single track with drift), mb (multibody)

Reference point: the centre of gravity. Inputs: the rate of the road wheels' angle, made of the recorded angle, and an acceleration.
"""

import copy
import math
import sys

from vehiclemodels.vehicle_parameters import setup_vehicle_parameters

from gripsight_simulator import Simulator, read_options, read_values, serve

COMMON = {
    "m": (0.6, 1.6, "kg", "loads_and_body"), "I_z": (0.4, 2.5, "kg m2", "loads_and_body"), "a": (0.7, 1.4, "m", "loads_and_body"),
    "b": (0.7, 1.4, "m", "loads_and_body"), "h_s": (0.3, 2.0, "m", "loads_and_body"), "tire.p_dy1": (0.4, 1.6, "1", "front_axle"),
    "tire.p_ky1": (0.4, 2.0, "1", "front_axle"), "steering.v_max": (0.2, 4.0, "rad/s", "steering"),
}
MORE = {
    "st": {},
    "std": {"tire.p_cy1": (0.6, 1.5, "1", "front_axle"), "R_w": (0.8, 1.2, "m", "drive_train")},
    "mb": {"tire.p_cy1": (0.6, 1.5, "1", "front_axle"), "h_cg": (0.5, 1.6, "m", "loads_and_body"),
           "T_f": (0.7, 1.4, "m", "loads_and_body"), "T_r": (0.7, 1.4, "m", "loads_and_body"),
           "K_tsf": (0.2, 4.0, "N m/rad", "loads_and_body"), "D_r": (0.2, 3.0, "rad/m", "rear_axle")},
}


def of(p, name):
    for part in name.split("."):
        p = getattr(p, part)
    return float(p)


class CommonRoad(Simulator):
    states = ["v_x_mps", "v_y_mps", "yaw_rate_radps", "steering_rad"]
    inputs = [{"name": "steering_rate", "kind": "steering_rate"}, {"name": "acceleration", "kind": "acceleration"}]
    outputs = ["v_x_mps", "v_y_mps", "yaw_rate_radps", "steering_rad"]

    def __init__(self, model, vehicle, values, step_s):
        self.name, self.model, self.step_s = f"commonroad {model}", model, step_s
        p = setup_vehicle_parameters(vehicle_id=vehicle)
        self.parameters = []
        for name, (low, high, unit, site) in {**COMMON, **MORE[model]}.items():
            value = values.get(name, of(p, name))
            low, high = sorted((low * value, high * value))
            if low < high:
                self.parameters.append(dict(name=name, value=value, low=low, high=high, unit=unit, site=site,
                                            key=name if name in values else None,
                                            in_code=None if name in values else f"vehicle {vehicle} of the package"))
        if model == "st":
            from vehiclemodels.vehicle_dynamics_st import vehicle_dynamics_st as rates
            self.lacks = ["a tire that saturates", "tire relaxation", "combined slip", "lateral load transfer"]
        elif model == "std":
            from vehiclemodels.init_std import init_std
            from vehiclemodels.vehicle_dynamics_std import vehicle_dynamics_std as rates
            self.lacks, self.init = ["tire relaxation", "lateral load transfer"], init_std
        else:
            from vehiclemodels.init_mb import init_mb
            from vehiclemodels.vehicle_dynamics_mb import vehicle_dynamics_mb as rates
            self.lacks, self.init = ["tire relaxation"], init_mb
        self.rates = rates
        # Reading the package's files takes as long as a rollout.
        self.given = plain(setup_vehicle_parameters(vehicle_id=vehicle), values)

    def place(self, parameters, motion, fresh):
        v_x, v_y, yaw_rate, steering = motion
        core = [0.0, 0.0, steering, math.hypot(v_x, v_y), 0.0, yaw_rate, math.atan2(v_y, v_x)]
        if fresh:
            self.p = plain(self.given, parameters)
            self.x = core if self.model == "st" else list(self.init(core, self.p))
        x = self.x
        if self.model == "mb":
            x[2], x[3], x[5], x[10] = steering, v_x, yaw_rate, v_y
        else:
            x[2], x[3], x[5], x[6] = steering, core[3], yaw_rate, core[6]
        return motion

    def step(self, command):
        x, dt, p = self.x, self.step_s, self.p
        k1 = self.rates(list(x), command, p)
        if self.model != "mb":
            k2 = self.rates([a + dt / 2 * b for a, b in zip(x, k1)], command, p)
            k3 = self.rates([a + dt / 2 * b for a, b in zip(x, k2)], command, p)
            k4 = self.rates([a + dt * b for a, b in zip(x, k3)], command, p)
            k1 = [(a + 2 * b + 2 * c + d) / 6 for a, b, c, d in zip(k1, k2, k3, k4)]
        self.x = x = [a + dt * b for a, b in zip(x, k1)]
        if self.model == "mb":
            return [x[3], x[10], x[5], x[2]]
        return [x[3] * math.cos(x[6]), x[3] * math.sin(x[6]), x[5], x[2]]


def plain(given, values):
    """A vehicle's parameters with some of them changed."""
    p = copy.deepcopy(given)
    for name, value in values.items():
        *way, last = name.split(".")
        node = p
        for part in way:
            node = getattr(node, part)
        if hasattr(node, last):
            setattr(node, last, value)
    # Limits are symmetric.
    p.steering.v_min = -p.steering.v_max
    return p


def main():
    options = read_options("model", "vehicle", "step_s")
    values = read_values(sys.argv[1] if len(sys.argv) > 1 else "")
    model = options.get("model", "st")
    if model not in MORE:
        sys.exit(f"model={model}: one of {', '.join(MORE)} is possible")
    # A multibody car's suspension needs a millisecond; the others are as smooth as their inputs.
    step_s = float(options.get("step_s", 0.001 if model == "mb" else 0.005 if model == "std" else 0.01))
    serve(CommonRoad(model, int(options.get("vehicle", 2)), values, step_s))


if __name__ == "__main__":
    main()
