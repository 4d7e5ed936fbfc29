"""Open-Car-Dynamics, by the C++ library in the user's checkout. Neither ROS nor its Python binding is needed, but a compiler and Eigen are.

    adapter: open_car_dynamics
    parameter_file: vehicle.json        # python3/ocd_vehicle_models_py/config/OCD_Vehicle_FX__PT1__SINGLE_TRACK__MF_SIMPLE__DEFAULT.json, or one of yours
    options: {checkout: Open-Car-Dynamics, tire: MF_Simple, eigen: /usr/include}

The checkout with its submodules (git clone --recurse-submodules); `eigen` holds eigen3/Eigen; `tire` is MF_Simple, MF52 or Linear. The first
start compiles open_car_dynamics.cpp against the checkout, some minutes, and keeps the result in the user's cache folder. Single track alone: the
double track's springs and wheels cannot be set between steps. Reference point: the centre of gravity. Forces along the car are the mass times
the acceleration asked for, at the driven wheels.
"""

import ctypes
import fcntl
import hashlib
import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
from gripsight_simulator import Library, read_options, serve

CAR = "vehicle_dynamics_single_track."
STEP_S = 0.004
HERE = Path(__file__).resolve().parent
COMMON = "submodules/tam__common/"
INCLUDED = [
    COMMON + "submodules/parameter_management/param_management_cpp", COMMON + "submodules/time_series_logging/tsl_logger_cpp",
    COMMON + "tum_helpers_cpp", COMMON + "tum_types_cpp",
]
SOURCES = ["aerodynamics_models", "drivetrain_fx", "drivetrain_rwd_lsd", "helpers", "steering_actuator_pt1", "tire_models"]
TIRES = ["MF_Simple", "MF52", "Linear"]
# Names of what is fitted, by their ends in the parameter file; both wheels of an axle have the same tire.
FITTED = {
    "mass_vehicle_kg": ("kg", "loads_and_body"), "moment_of_inertia_kgpm2.z": ("kg m2", "loads_and_body"),
    "cog.distance_from_front_axle_m": ("m", "loads_and_body"), "wheelbase_m": ("m", "loads_and_body"),
    "T_PT1": ("s", "steering"), "angle_rate_max_radps": ("rad/s", "steering"), "angle_max_rad": ("rad", "steering"),
}
LATERAL = {"B": "1/rad", "C": "1", "D": "1", "E": "1"}


def built(checkout, tire, eigen):
    """The shared library of a checkout and a tire model."""
    if not (checkout / "lib/ocd_vehicle_model_cpp").is_dir():
        sys.exit(f"no Open-Car-Dynamics in {checkout}: options: {{checkout: PATH}} names a clone with its submodules")
    for part in INCLUDED:
        if not (checkout / part).is_dir():
            sys.exit(f"{checkout} lacks {part}: `git submodule update --init --recursive` in it brings its submodules")
    if tire not in TIRES:
        sys.exit(f"tire={tire}: {', '.join(TIRES)} are possible")
    sources = [HERE / "open_car_dynamics.cpp"]
    for name in SOURCES:
        sources += sorted((checkout / f"lib/ocd_{name}_cpp/src").glob("*.cpp"))
    sources += sorted((checkout / INCLUDED[0] / "src").glob("*.cpp"))
    key = hashlib.sha256(f"{checkout}{tire}".encode())
    for path in [*sources, HERE / "gripsight_simulator.hpp"]:
        key.update(path.read_bytes())
    cache = Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache")) / "gripsight"
    cache.mkdir(parents=True, exist_ok=True)
    library = cache / f"open_car_dynamics_{key.hexdigest()[:16]}.so"
    # One of several processes compiles; the others wait for it.
    with open(cache / "open_car_dynamics.lock", "w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not library.exists():
            folders = [p / "include" for p in sorted((checkout / "lib").iterdir()) if p.is_dir()]
            folders += [checkout / p / "include" for p in INCLUDED] + [HERE, Path(eigen), Path(eigen) / "eigen3"]
            part = library.with_suffix(".part")
            command = ["g++", "-O2", "-shared", "-fPIC", "-std=c++20", "-w", f"-DGRIPSIGHT_TIRE={tire}"]
            command += [f"-I{p}" for p in folders] + [str(p) for p in sources] + ["-o", str(part)]
            said = subprocess.run(command, capture_output=True, text=True)
            if said.returncode:
                errors = [line for line in said.stderr.splitlines() if "error" in line]
                sys.exit("Open-Car-Dynamics does not compile:\n" + "\n".join(errors[:5]))
            part.rename(library)
    return library


class OpenCarDynamics(Library):
    def __init__(self, library, values):
        super().__init__(library)
        self.name = "Open-Car-Dynamics"
        self.states = self.outputs = ["v_x_mps", "v_y_mps", "yaw_rate_radps"]
        self.inputs = [{"name": "steering", "kind": "steering_angle"}, {"name": "acceleration", "kind": "acceleration"}]
        self.imposes_v_x = True
        self.lacks = ["tire relaxation", "lateral load transfer"]
        inner_s = float(values.get("integration_step_size_s", 0.0008))
        count = max(1, round(STEP_S / inner_s))
        self.step_s = count * inner_s
        self.library.open_car_inner_steps(ctypes.c_int(count))
        for name, value in values.items():
            numbers = np.atleast_1d(np.asarray(value, dtype=np.float64))
            known = self.library.open_car_keep(name.encode(), ctypes.c_void_p(numbers.ctypes.data), ctypes.c_int64(len(numbers)),
                                               ctypes.c_int(isinstance(value, list)))
            if not known:
                sys.exit(f"Open-Car-Dynamics' single track has no parameter {name}")
        # What each of gripsight's parameters changes.
        self.changes, self.parameters = [], []
        for end, (unit, site) in FITTED.items():
            name = next((n for n in values if n.endswith("." + end)), None)
            self._offer(values, end, [name] if name else [], unit, site)
        for axle in ("front", "rear"):
            for letter, unit in LATERAL.items():
                wheels = [f"{CAR}z.tire_model.{axle}_{side}.lateral.{letter}" for side in ("left", "right")]
                self._offer(values, f"tire.{axle}.lateral.{letter}", [w for w in wheels if w in values], unit, f"{axle}_axle")
        for names in self.changes:
            for name in names:
                self.library.open_car_change(name.encode())

    def _offer(self, values, name, changed, unit, site):
        if not changed or values[changed[0]] == 0:
            return
        value = float(values[changed[0]])
        low, high = sorted((0.3 * value, 3.0 * value))
        wheelbase_m = next((float(v) for n, v in values.items() if n.endswith(".wheelbase_m")), None)
        if name.startswith("cog.") and wheelbase_m:
            # Between the axles.
            low, high = min(value, 0.2 * wheelbase_m), max(value, 0.8 * wheelbase_m)
        # The tire of an axle stands in the file once a wheel: a patch of one value, where both have the same.
        is_one = all(values[n] == values[changed[0]] for n in changed)
        where = {"key": changed} if is_one else {"in_code": " and ".join(changed) + " of the parameter file"}
        self.parameters.append(dict(name=name, value=value, low=low, high=high, unit=unit, site=site, **where))
        self.changes.append(changed)

    def _pass(self, batch, b):
        values = batch.of("parameters", b)
        wide = [v for v, names in zip(values, self.changes) for _ in names]
        return super()._pass(Wide(batch, np.array(wide)), b)


class Wide:
    """A batch whose parameters are the library's: a tire's figure for each of its wheels."""

    def __init__(self, batch, parameters):
        self.batch, self.parameters = batch, parameters

    def __getattr__(self, name):
        return getattr(self.batch, name)

    def of(self, name, b):
        return self.parameters if name == "parameters" else self.batch.of(name, b)


def main():
    options = read_options("checkout", "tire", "eigen")
    checkout = Path(options.get("checkout", "Open-Car-Dynamics")).resolve()
    library = built(checkout, options.get("tire", "MF_Simple"), options.get("eigen", "/usr/include"))
    text = Path(sys.argv[1]).read_text() if len(sys.argv) > 1 and sys.argv[1] else "{}"
    serve(OpenCarDynamics(library, json.loads(text)))


if __name__ == "__main__":
    main()
