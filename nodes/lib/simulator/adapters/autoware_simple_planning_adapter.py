"""Autoware's simple planning simulator by its published equations: the models delay_steer_acc_geared and ideal_steer_acc.

    adapter: autoware_simple_planning
    parameter_file: simulator_model.param.yaml
    options: {model: delay_steer_acc_geared, wheel_base: "2.79"}

A kinematic car: it has no side slip, so the recorded v_y is compared with that of a car that rolls (none at the rear axle), and what
tires do cannot be matched. Reference point: the rear axle.
"""

import math
import sys
from collections import deque

from gripsight_simulator import Simulator, keys_of, read_options, read_values, serve

BOUNDS = {
    "steer_time_delay": (0.24, 0.0, 0.6, "s"), "steer_time_constant": (0.27, 0.0, 1.0, "s"), "steer_dead_band": (0.0, 0.0, 0.05, "rad"),
    "steer_bias": (0.0, -0.1, 0.1, "rad"), "steer_lim": (1.0, 0.1, 1.5, "rad"), "steer_rate_lim": (5.0, 0.05, 10.0, "rad/s"),
    "acc_time_delay": (0.1, 0.0, 0.8, "s"), "acc_time_constant": (0.1, 0.0, 1.0, "s"), "debug_acc_scaling_factor": (1.0, 0.3, 2.0, "1"),
    "debug_steer_scaling_factor": (1.0, 0.3, 2.0, "1"), "vel_rate_lim": (7.0, 0.5, 20.0, "m/s2"),
}


class SimplePlanning(Simulator):
    states = ["v_x_mps"]
    inputs = [{"name": "steer", "kind": "steering_angle"}, {"name": "acc", "kind": "acceleration"}]
    outputs = ["v_x_mps", "v_y_mps", "yaw_rate_radps"]
    lacks = ["side slip", "tire relaxation", "lateral load transfer"]

    def __init__(self, model, wheel_base, values, step_s):
        self.name, self.model, self.step_s = f"simple planning simulator, {model}", model, step_s
        self.parameters = [dict(name="wheel_base", value=wheel_base, low=0.5 * wheel_base, high=2.0 * wheel_base, unit="m",
                                in_code="vehicle_info.param.yaml", site="loads_and_body")]
        keys = keys_of(values, BOUNDS)
        if model == "delay_steer_acc_geared":
            for name, (default, low, high, unit) in BOUNDS.items():
                value = values[keys[name]] if name in keys else default
                site = "drive_train" if name.startswith(("acc", "vel", "debug_acc")) else "steering"
                self.parameters.append(dict(name=name, value=value, low=min(low, value), high=max(high, value), unit=unit, site=site,
                                            key=keys.get(name),
                                            in_code=None if name in keys else f"default of {model}"))

    def place(self, parameters, motion, fresh):
        if fresh:
            self.p, self.steer, self.acc = parameters, 0.0, 0.0
            self.steers, self.accs = deque([0.0] * 200, 200), deque([0.0] * 200, 200)
        self.v = motion[0]
        return self.seen()

    def seen(self):
        bias = self.p.get("steer_bias", 0.0)
        return [self.v, 0.0, self.v * math.tan(self.steer + bias) / self.p["wheel_base"]]

    def late(self, queue, delay_s):
        # Between two whole steps: a mixture, so that a delay can be fitted.
        steps = delay_s / self.step_s
        whole = min(int(steps), 198)
        share = min(steps - whole, 1.0)
        return (1.0 - share) * queue[whole] + share * queue[whole + 1]

    def step(self, command):
        p, dt = self.p, self.step_s
        if self.model == "ideal_steer_acc":
            self.steer, self.acc = command[0], command[1]
            self.v += dt * self.acc
            return self.seen()
        self.steers.appendleft(command[0])
        self.accs.appendleft(command[1])
        limit = p["steer_lim"]
        asked = max(-limit, min(limit, self.late(self.steers, p["steer_time_delay"]) * p["debug_steer_scaling_factor"]))
        error = asked - self.steer
        band = p["steer_dead_band"]
        error = 0.0 if abs(error) <= band else error - math.copysign(band, error)
        rate = error / max(p["steer_time_constant"], 0.03)
        self.steer += dt * max(-p["steer_rate_lim"], min(p["steer_rate_lim"], rate))
        most = p["vel_rate_lim"]
        acc = max(-most, min(most, self.late(self.accs, p["acc_time_delay"]) * p["debug_acc_scaling_factor"]))
        self.acc += dt * (acc - self.acc) / max(p["acc_time_constant"], 0.03)
        self.v += dt * self.acc
        return self.seen()


def main():
    options = read_options("model", "wheel_base", "step_s")
    values = read_values(sys.argv[1] if len(sys.argv) > 1 else "")
    model = options.get("model", "delay_steer_acc_geared")
    if model not in ("delay_steer_acc_geared", "ideal_steer_acc"):
        sys.exit(f"model={model}: delay_steer_acc_geared and ideal_steer_acc are possible")
    serve(SimplePlanning(model, float(options.get("wheel_base", 2.79)), values, float(options.get("step_s", 0.01))))


if __name__ == "__main__":
    main()
