"""slipx (PyPI): its detailed tier, from a parameter file in its own names.

    adapter: slipx
    parameter_file: car.yaml            # in the names of slipx.VehicleParams: `mass: 3.5`, `tyre_front:` with `mu_y0: 1.1` in it; the rest is the reference car's
    options: {tier: L2_DoubleTrack}     # or L1_Bicycle

Reference point: the centre of gravity. Inputs: the steering command (the servo is slipx's own) and an acceleration.
"""

import sys

import slipx

from gripsight_simulator import Simulator, read_options, read_values, serve

BOUNDS = {
    "mass": (0.5, 5.0, "kg", "loads_and_body"), "izz": (0.2, 5.0, "kg m2", "loads_and_body"), "lf": (0.5, 2.0, "m", "loads_and_body"),
    "lr": (0.5, 2.0, "m", "loads_and_body"), "h_cog": (0.2, 3.0, "m", "loads_and_body"),
    "tyre_front.mu_y0": (0.3, 2.0, "1", "front_axle"), "tyre_rear.mu_y0": (0.3, 2.0, "1", "rear_axle"),
    "c_alpha_f": (0.3, 3.0, "N/rad", "front_axle"), "c_alpha_r": (0.3, 3.0, "N/rad", "rear_axle"),
    "tyre_front.relax_length": (0.1, 4.0, "m", "front_axle"), "tyre_rear.relax_length": (0.1, 4.0, "m", "rear_axle"),
    "steer_bandwidth": (0.1, 3.0, "rad/s", "steering"), "steer_rate_max": (0.05, 3.0, "rad/s", "steering"),
    "steer_max": (0.5, 2.0, "rad", "steering"),
}


def of(parameters, name):
    for part in name.split("."):
        parameters = getattr(parameters, part)
    return parameters


def put(parameters, name, value):
    *way, last = name.split(".")
    for part in way:
        parameters = getattr(parameters, part)
    setattr(parameters, last, value)


class Slipx(Simulator):
    name = "slipx"
    states = ["v_x_mps", "v_y_mps", "yaw_rate_radps"]
    inputs = [{"name": "steer_cmd", "kind": "steering_angle"}, {"name": "accel_cmd", "kind": "acceleration"}]
    outputs = ["v_x_mps", "v_y_mps", "yaw_rate_radps"]

    def __init__(self, values, tier, step_s):
        self.values, self.tier, self.step_s = values, getattr(slipx.Tier, tier), step_s
        reference = slipx.load_reference_car().params
        self.parameters = []
        for name, (low, high, unit, site) in BOUNDS.items():
            value = float(values.get(name, of(reference, name)))
            self.parameters.append(dict(name=name, value=value, low=low * value, high=high * value, unit=unit, site=site,
                                        key=name if name in values else None,
                                        in_code=None if name in values else "slipx's reference car"))
        self.seen = slipx.StepDiagnostics()

    def place(self, parameters, motion, fresh):
        if fresh:
            p = slipx.load_reference_car().params
            for name, value in {**self.values, **parameters}.items():
                put(p, name, value)
            self.model, self.state = slipx.VehicleModel.create(self.tier, p), slipx.VehicleState()
            self.state.omega_w = [motion[0] / p.wheel_radius] * 4
        s = self.state
        s.vel_body = slipx.Vec3(motion[0], motion[1], 0.0)
        rates = s.rates
        s.rates = slipx.Vec3(rates.x, rates.y, motion[2])
        return [s.vx, s.vy, s.yaw_rate]

    def step(self, command):
        s = self.state
        self.model.step(s, slipx.DriveInput(steer_cmd=command[0], accel_cmd=command[1]), self.step_s, self.seen)
        return [s.vx, s.vy, s.yaw_rate]


def main():
    options = read_options("tier", "step_s")
    values = read_values(sys.argv[1] if len(sys.argv) > 1 else "")
    unknown = [name for name in values if name not in BOUNDS]
    reference = slipx.load_reference_car().params
    for name in unknown:
        try:
            of(reference, name)
        except AttributeError:
            sys.exit(f"{sys.argv[1]}: slipx has no parameter {name}")
    serve(Slipx(values, options.get("tier", "L2_DoubleTrack"), float(options.get("step_s", 0.002))))


if __name__ == "__main__":
    main()
