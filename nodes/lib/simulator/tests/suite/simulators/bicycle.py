"""A linear single-track car in 60 lines, sound or broken in the way that the first argument names."""

import os
import sys
import time

import numpy as np

from gripsight_simulator import Simulator, serve

HOW = sys.argv[1] if len(sys.argv) > 1 else "sound"


class Bicycle(Simulator):
    step_s = 0.01
    states = ["v_x_mps", "v_y_mps", "yaw_rate_radps"]
    inputs = [{"name": "steering", "kind": "steering_angle"}]
    outputs = ["v_x_mps", "v_y_mps", "yaw_rate_radps"]
    parameters = [
        {"name": "stiffness", "value": 40.0, "low": 10.0, "high": 90.0, "unit": "1/s2", "key": "tire.stiffness"},
        {"name": "delay_steps", "value": 2, "low": 0, "high": 20, "integer": True, "in_code": "delay in bicycle.py"},
    ]

    def place(self, parameters, motion, fresh):
        self.p = parameters
        self.motion = list(motion)
        if fresh:
            self.buffer = [0.0] * int(parameters["delay_steps"])
        return self.motion

    def step(self, command):
        if HOW == "prints":
            print("a" * 1000)
        self.buffer.insert(0, command[0])
        steering = self.buffer.pop()
        v, v_y, r = self.motion
        c = self.p["stiffness"]
        front = c * (steering - (v_y + 0.16 * r) / v)
        rear = -c * (v_y - 0.16 * r) / v
        self.motion = [v, v_y + self.step_s * (front + rear - v * r), r + self.step_s * 11.0 * (front - rear)]
        return self.motion


class Broken(Bicycle):
    def rollout(self, batch):
        if HOW == "dies":
            print("the lookup table is empty", file=sys.stderr)
            sys.stderr.flush()
            os._exit(7)
        if HOW == "hangs":
            time.sleep(60)
        if HOW == "raises":
            raise ValueError("no such tire")
        outputs = super().rollout(batch)
        if HOW == "shape":
            return outputs[:, :-1]
        if HOW == "nan":
            outputs[:] = np.nan
        return outputs


if HOW == "dies_at_once":
    sys.exit("cannot open car.yaml")
if HOW == "never_calls":
    time.sleep(60)
if HOW == "no_yaw_rate":
    Bicycle.outputs = ["v_x_mps", "v_y_mps"]
if HOW == "bounds":
    Bicycle.parameters = [{"name": "mass", "value": 9.0, "low": 1.0, "high": 2.0}]
if HOW == "unknown_channel":
    Bicycle.outputs = ["v_x_mps", "v_y_mps", "yaw_rate_radps", "yaw_rate"]
if HOW == "garbage":
    import socket

    with socket.socket(socket.AF_UNIX) as connection:
        connection.connect(os.environ["GRIPSIGHT_SOCKET"])
        connection.sendall(b"hello, I am a simulator" * 10)
        time.sleep(1)
if HOW == "version":
    import gripsight_simulator

    gripsight_simulator.VERSION = 2
serve(Broken())
