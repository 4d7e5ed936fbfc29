"""Turns a class with two methods into a simulator that gripsight can run. Needs Python 3.9 and NumPy, nothing else.

    from gripsight_simulator import Simulator, serve

    class MyCar(Simulator):
        step_s = 0.01
        states = ["v_x_mps", "v_y_mps", "yaw_rate_radps"]
        inputs = [{"name": "steering", "kind": "steering_angle"}]
        outputs = ["v_x_mps", "v_y_mps", "yaw_rate_radps"]
        parameters = [{"name": "mass", "value": 3.5, "low": 2.0, "high": 6.0, "unit": "kg"}]

        def place(self, parameters, motion, fresh): ...   # returns the outputs there
        def step(self, command): ...                      # returns the outputs after step_s

    serve(MyCar())

`place` puts the car into a motion (values in the order of `states`); parameters come as a dictionary. With fresh=True
everything hidden is forgotten, too (buffers, actuators, tire states); with fresh=False it stays as it is.
`step` holds the command (values in the order of `inputs`) for step_s. Both return values in the order of `outputs`.

gripsight starts this process and names a socket in GRIPSIGHT_SOCKET: prints do no harm. A message is eight bytes of
length (little-endian) and a NumPy .npz archive, whose array `header` is JSON: version, id, kind.
"""

import ast
import ctypes
import io
import json
import os
import re
import socket
import struct
import sys
import traceback

import numpy as np

VERSION = 1
KINDS = ("steering_angle", "steering_rate", "speed", "acceleration", "pedal")


class Simulator:
    """What gripsight asks of a simulator. Every state must be among the outputs."""

    name = ""
    step_s = 0.01
    # Motions that can be set between steps, of: v_x_mps, v_y_mps, yaw_rate_radps, steering_rad.
    states = []
    # Each {"name", "kind"}; kinds are in KINDS.
    inputs = []
    # Of: v_x_mps, v_y_mps, yaw_rate_radps, a_y_mps2.
    outputs = []
    # Each {"name", "value", "low", "high", "unit"}, and where it is written: "key" in the parameter file, or "in_code" (words).
    # "integer": True where it counts something.
    parameters = []
    # Whether a measured v_x may be imposed, step after step, without upsetting the rest.
    imposes_v_x = True
    # What the model has no term for, in words: ["tire relaxation"].
    lacks = []

    def place(self, parameters, motion, fresh):
        raise NotImplementedError

    def step(self, command):
        raise NotImplementedError

    def describe(self):
        return {
            "name": self.name or type(self).__name__,
            "step_s": self.step_s,
            "states": list(self.states),
            "inputs": list(self.inputs),
            "outputs": list(self.outputs),
            "parameters": list(self.parameters),
            "imposes_v_x": bool(self.imposes_v_x),
            "lacks": list(self.lacks),
        }

    def rollout(self, batch):
        """Runs every pass of a batch; see `Batch`. Overwrite it where a whole batch can be done faster."""
        outputs = np.empty((batch.passes, len(batch.output_steps), len(self.outputs)))
        for b in range(batch.passes):
            outputs[b] = self._pass(batch, b)
        return outputs

    def _pass(self, batch, b):
        parameters = dict(zip((p["name"] for p in self.parameters), batch.of("parameters", b).tolist()))
        commands = batch.of("commands", b).tolist()
        motions = batch.of("motions", b).tolist()
        v_x = batch.of("v_x", b)
        kicks = batch.of("kicks", b)
        v_x = None if v_x is None else v_x.tolist()
        kicks = None if kicks is None else kicks.tolist()
        # Where each state stands among the outputs, and v_x among the states.
        places = [self.outputs.index(s) for s in self.states]
        along = self.states.index("v_x_mps") if v_x is not None else None
        place_at = dict(zip(batch.place_steps.tolist(), range(len(motions))))
        wanted = dict(zip(batch.output_steps.tolist(), range(len(batch.output_steps))))
        rows = [[float("nan")] * len(self.outputs)] * len(batch.output_steps)
        seen, fresh = None, True
        for k in range(batch.steps + 1):
            at = place_at.get(k)
            if at is not None:
                seen = self.place(parameters, motions[at], fresh)
                fresh = False
            elif seen is not None and k > 0 and (v_x is not None or kicks is not None):
                motion = [seen[p] for p in places]
                if kicks is not None:
                    motion = [m + d for m, d in zip(motion, kicks[k - 1])]
                if along is not None:
                    motion[along] = v_x[k]
                seen = self.place(parameters, motion, False)
            row = wanted.get(k)
            if row is not None:
                rows[row] = seen
            if k < batch.steps and seen is not None:
                try:
                    seen = self.step(commands[k])
                except ArithmeticError:
                    # Python raises where others give inf and NaN: a car that these parameters do not keep on its wheels.
                    seen = [float("nan")] * len(self.outputs)
        return np.array(rows, dtype=np.float64)


def read_options(*known):
    """The options of the simulator's file, NAME=VALUE behind the parameter file's path; ends where one is not known."""
    options = dict(a.split("=", 1) for a in sys.argv[2:])
    for name in options:
        if name not in known:
            sys.exit(f"options: there is no '{name}' here; {', '.join(known)} are possible")
    return options


def read_values(path):
    """The numbers of a parameter file by their keys, joined by dots: JSON, a Python dictionary, or YAML made of plain maps."""
    text = open(path, encoding="utf-8").read() if path else ""
    out = {}

    def flat(node, way):
        if isinstance(node, dict):
            for key, value in node.items():
                flat(value, way + [str(key)])
        elif isinstance(node, (int, float)) and not isinstance(node, bool):
            out[".".join(way)] = float(node)

    for parse in (json.loads, ast.literal_eval):
        try:
            flat(parse(text), [])
            return out
        except (ValueError, SyntaxError):
            pass
    way = []
    for line in text.splitlines():
        found = re.match(r"^(\s*)([^\s#:][^:#]*?)\s*:\s*([^#]*?)\s*(#.*)?$", line)
        if not found:
            continue
        indent, key, value = len(found[1]), found[2].strip("'\""), found[3].strip()
        way = [w for w in way if w[0] < indent]
        if not value:
            way.append((indent, key))
            continue
        try:
            out[".".join([w[1] for w in way] + [key])] = float(value)
        except ValueError:
            pass
    return out


def keys_of(values, names):
    """By name: the key under which a parameter file holds it, whatever it is nested in."""
    out = {}
    for name in names:
        found = [key for key in values if key == name or key.endswith("." + name)]
        if found:
            out[name] = min(found, key=len)
    return out


class Batch:
    """Passes through one stretch of driving. Arrays with one row are the same for every pass.

    parameters (B, P); commands (B, K, U), held over each step; place_steps (J) and motions (B, J, S): where the car is put
    into a motion; v_x (B, K + 1): imposed, or absent; kicks (B, K, S): added to the states after each step, or absent;
    output_steps (M): where outputs are wanted.
    """

    def __init__(self, arrays):
        self.arrays = arrays
        self.place_steps = arrays["place_steps"]
        self.output_steps = arrays["output_steps"]
        self.passes = arrays["parameters"].shape[0]
        self.steps = arrays["commands"].shape[1]

    def of(self, name, b):
        array = self.arrays.get(name)
        if array is None:
            return None
        return array[b if array.shape[0] > 1 else 0]


def _receive(connection, count):
    parts = bytearray()
    while len(parts) < count:
        part = connection.recv(min(count - len(parts), 1 << 20))
        if not part:
            return None
        parts += part
    return bytes(parts)


def _read(connection):
    length = _receive(connection, 8)
    if length is None:
        return None
    body = _receive(connection, struct.unpack("<Q", length)[0])
    if body is None:
        return None
    with np.load(io.BytesIO(body), allow_pickle=False) as archive:
        arrays = {name: archive[name] for name in archive.files}
    return json.loads(arrays.pop("header").tobytes().decode()), arrays


def _write(connection, header, **arrays):
    body = io.BytesIO()
    np.savez(body, header=np.frombuffer(json.dumps(header).encode(), np.uint8), **arrays)
    connection.sendall(struct.pack("<Q", body.tell()) + body.getvalue())


class Library(Simulator):
    """A simulator in C++: a shared library made with gripsight_simulator.hpp."""

    def __init__(self, path):
        self.library = ctypes.CDLL(os.path.abspath(path))
        self.library.gripsight_description.restype = ctypes.c_char_p
        for name, value in json.loads(self.library.gripsight_description().decode()).items():
            setattr(self, name, value)

    def _pass(self, batch, b):
        def pointer(array, kind=np.float64):
            array = None if array is None else np.ascontiguousarray(array, dtype=kind)
            kept.append(array)
            return None if array is None else ctypes.c_void_p(array.ctypes.data)

        kept = []
        rows = np.empty((len(batch.output_steps), len(self.outputs)))
        v_x = batch.of("v_x", b)
        along = self.states.index("v_x_mps") if v_x is not None else -1
        self.library.gripsight_pass(
            pointer([self.outputs.index(s) for s in self.states], np.int32), ctypes.c_int32(along),
            pointer(batch.of("parameters", b)), ctypes.c_int64(batch.steps), pointer(batch.of("commands", b)),
            ctypes.c_int64(len(batch.place_steps)), pointer(batch.place_steps, np.int64), pointer(batch.of("motions", b)),
            pointer(v_x), pointer(batch.of("kicks", b)), ctypes.c_int64(len(batch.output_steps)),
            pointer(batch.output_steps, np.int64), ctypes.c_void_p(rows.ctypes.data))
        return rows


def serve(simulator):
    """Answers gripsight until it hangs up."""
    path = os.environ.get("GRIPSIGHT_SOCKET")
    if path is None:
        print(json.dumps(simulator.describe(), indent=2))
        print("(no GRIPSIGHT_SOCKET: started by hand; gripsight diagnose BAG --simulator FILE starts it)", file=sys.stderr)
        return
    with socket.socket(socket.AF_UNIX) as connection:
        connection.connect(path)
        while True:
            message = _read(connection)
            if message is None:
                return
            header, arrays = message
            answer = {"version": VERSION, "id": header.get("id")}
            try:
                if header.get("version") != VERSION:
                    raise RuntimeError(f"speaks version {VERSION}, was asked in version {header.get('version')}")
                if header["kind"] == "describe":
                    _write(connection, {**answer, "kind": "description", "description": simulator.describe()})
                else:
                    outputs = np.ascontiguousarray(simulator.rollout(Batch(arrays)), dtype=np.float64)
                    _write(connection, {**answer, "kind": "outputs"}, outputs=outputs)
            except Exception:  # The user's code may raise anything; gripsight is told, with the place.
                _write(connection, {**answer, "kind": "error", "message": traceback.format_exc(limit=-3)})


if __name__ == "__main__":
    serve(Library(sys.argv[1]))
