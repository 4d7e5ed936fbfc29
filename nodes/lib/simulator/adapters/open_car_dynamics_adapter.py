"""Open-Car-Dynamics, by the Python binding of the user's checkout (`ocd_vehicle_models_py`, built as its own page says).

    adapter: open_car_dynamics
    parameter_file: vehicle.json        # the dictionary that the binding loads
    options: {dynamics: SINGLE_TRACK, tire: MF_SIMPLE, aero: DEFAULT}

Reference point: the centre of gravity. The state is set by `initial_state.*` and a reset, so the forward speed is simulated.
Written after the published interface of the binding; it has not been run by gripsight's own tests, which skip it where the binding is
not installed.
"""

import json
import sys
from pathlib import Path

from gripsight_simulator import Simulator, serve

STATES = {
    "v_x_mps": "initial_state.vehicle_dynamics.v_x_mps",
    "v_y_mps": "initial_state.vehicle_dynamics.v_y_mps",
    "yaw_rate_radps": "initial_state.vehicle_dynamics.psi_dot_radps",
}
SITES = {"steering_actuator": "steering", "drivetrain": "drive_train", "tire": "front_axle"}


class OpenCarDynamics(Simulator):
    name = "Open-Car-Dynamics"
    states = list(STATES)
    inputs = [{"name": "steering", "kind": "steering_angle"}, {"name": "acceleration", "kind": "acceleration"}]
    outputs = list(STATES)
    imposes_v_x = False

    def __init__(self, values, make):
        self.vehicle = make()
        self.values = {**self.vehicle.get_param_manager().get_parameters_as_dict(), **values}
        self.inner_s = float(self.values["integration_step_size_s"])
        self.count = max(1, round(0.004 / self.inner_s))
        self.step_s = self.count * self.inner_s
        mass = [k for k in self.values if k.endswith(("m_kg", "mass_kg"))]
        self.mass = float(self.values[mass[0]]) if mass else 1.0
        self.parameters = []
        for name, value in sorted(values.items()):
            if isinstance(value, (int, float)) and not isinstance(value, bool) and value != 0 and not name.startswith(("initial", "integration")):
                low, high = sorted((0.3 * value, 3.0 * value))
                site = next((s for key, s in SITES.items() if key in name), "loads_and_body")
                self.parameters.append(dict(name=name, value=value, low=low, high=high, unit="1", site=site, key=name))

    def place(self, parameters, motion, fresh):
        values = {**self.values, **parameters}
        values.update({STATES[s]: v for s, v in zip(self.states, motion)})
        if not fresh:
            position = self.vehicle.get_steering_actuator_feedback()
            values["initial_state.steering_actuator.position_rad"] = getattr(position, "steering_angle_rad", self.steering)
        wheel = float(values.get("drivetrain.wheel_radius_m", 0.3))
        for key in values:
            if key.startswith("initial_state.drivetrain.omega"):
                values[key] = motion[0] / wheel
        self.vehicle.get_param_manager().set_parameters_from_dict(values)
        self.vehicle.reset()
        return motion

    def step(self, command):
        self.steering = command[0]
        self.vehicle.set_steering_input(command[0])
        self.vehicle.set_drivetrain_input(self.mass * command[1])
        for _ in range(self.count):
            self.vehicle.step()
        seen = self.vehicle.get_vehicle_model_output().vehicle_dynamics_output
        return [seen.velocity_mps.x, seen.velocity_mps.y, seen.angular_velocity_radps.z]


def main():
    try:
        from ocd_vehicle_models_py import AerodynamicsType, DrivetrainType, SteeringActuatorType, TireType, VehicleDynamicsType, VehicleFactory
    except ImportError as error:
        sys.exit(f"the Python binding of Open-Car-Dynamics is not installed ({error}): build ocd_vehicle_models_py in your checkout first")
    options = dict(a.split("=", 1) for a in sys.argv[2:])
    values = json.loads(Path(sys.argv[1]).read_text()) if len(sys.argv) > 1 and sys.argv[1] else {}

    def make():
        return VehicleFactory.create_vehicle(
            drivetrain=DrivetrainType.FX, steering=SteeringActuatorType.PT1,
            vdm=VehicleDynamicsType[options.get("dynamics", "SINGLE_TRACK")], tire=TireType[options.get("tire", "MF_SIMPLE")],
            aero=AerodynamicsType[options.get("aero", "DEFAULT")])

    serve(OpenCarDynamics(values, make))


if __name__ == "__main__":
    main()
