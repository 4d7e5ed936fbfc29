"""The examples without ROS: message types are made from the .msg files, so that a field that no message has fails.

    .venv/bin/python -m pytest -q nodes/identifier/examples
"""

import copy
import pathlib
import shutil
import subprocess
import types

import pytest
from tire_subscriber import GRAVITY_MPS2, Tires

HERE = pathlib.Path(__file__).resolve().parent
MSGS = HERE.parents[2] / "msgs"
NAN = float("nan")
CPP = {"bool": "bool", "string": "std::string", "float64": "double", "uint8": "unsigned char", "uint32": "unsigned", "uint64": "unsigned long"}
# Each step: topic, what differs from the message before on the topic, and the grip to plan with after it.
SET = {
    "handshake.vehicle_hash": "car", "handshake.sequence_id": 7, "status": 2, "front.d": 0.8, "rear.d": 0.9,
    "front_load_n": 10.0, "rear_load_n": 20.0, "front_valid_force_n": NAN, "rear_valid_force_n": NAN,
}
GRIP = {"handshake.sequence_id": 7, "fallen": True}
STEPS = [
    ("nothing is known: half of the start's", "grip", {**GRIP, "share": 0.5}, 0.255),
    ("a candidate", "pacejka", {**SET, "status": 1}, 0.255),
    ("rejected", "pacejka", {"status": 3}, 0.255),
    ("provisional, and not asked for", "pacejka", {"status": 5}, 0.255),
    ("of another car", "pacejka", {"status": 2, "handshake.vehicle_hash": "other"}, 0.255),
    ("withdrawn before there was one", "pacejka", {"status": 6, "handshake.vehicle_hash": "car"}, 0.255),
    ("accepted: the weaker axle's peak", "pacejka", {"status": 2}, 0.8),
    ("accepted within what was shown", "pacejka", {"status": 4, "rear_valid_force_n": 12.0}, 0.6),
    ("rejected: what there is stays", "pacejka", {"status": 3}, 0.6),
    ("as promised", "grip", {"fallen": False, "share": 0.9}, 0.6),
    ("of another set", "grip", {"fallen": True, "share": 0.5, "handshake.sequence_id": 6}, 0.6),
    ("fallen", "grip", {"handshake.sequence_id": 7}, 0.3),
    ("less fallen is no news", "grip", {"share": 0.8}, 0.3),
    ("withdrawn after the warning", "pacejka", {"status": 6}, 0.3),
    ("the next set", "pacejka", {"status": 2, "handshake.sequence_id": 8, "rear_valid_force_n": NAN}, 0.8),
    ("withdrawn without one", "pacejka", {"status": 6}, 0.56),
    ("and fallen without a figure", "grip", {"fallen": True, "share": NAN, "handshake.sequence_id": 8}, 0.56),
]


def lines(kind):
    for line in (MSGS / "msg" / f"{kind}.msg").read_text().splitlines():
        code = line.split("#")[0].strip()
        if code:
            yield code.split(maxsplit=1)


def message(kind):
    """A message in Python with the fields and constants of its file; others raise."""
    made = types.SimpleNamespace()
    for type_name, name in lines(kind):
        if "=" in name:
            constant, value = name.split("=")
            setattr(made, constant, int(value))
        elif "/" in type_name or type_name.endswith("]"):
            setattr(made, name, None)
        else:
            setattr(made, name, 0 if type_name in CPP else message(type_name))
    return made


def changed(made, fields):
    for path, value in fields.items():
        *outer, last = path.split(".")
        inner = made
        for name in outer:
            inner = getattr(inner, name)
        assert hasattr(inner, last), path
        setattr(inner, last, value)
    return copy.deepcopy(made)


def test_python_decides():
    tires = Tires("car")
    last = {"pacejka": message("PacejkaParams"), "grip": message("Grip")}
    for what, topic, fields, grip in STEPS:
        before = tires.grip_mps2
        new = {"pacejka": tires.take, "grip": tires.feel}[topic](changed(last[topic], fields))
        assert tires.grip_mps2 == pytest.approx(GRAVITY_MPS2 * grip), what
        assert new or tires.grip_mps2 == before, what
    tires = Tires(provisional=True)
    assert tires.take(changed(message("PacejkaParams"), {**SET, "status": 5}))


def struct(kind, made):
    """The message's header in C++, as rosidl would name things."""
    body, includes = [], []
    for type_name, name in lines(kind):
        if "=" in name:
            body.append(f"static constexpr unsigned char {name};")
        elif type_name in CPP:
            body.append(f"{CPP[type_name]} {name}{{}};")
        elif "/" not in type_name and not type_name.endswith("]"):
            includes += struct(type_name, made)
            body.append(f"{type_name} {name};")
    if kind in made:
        return []
    made.add(kind)
    return [*includes, f"struct {kind} {{ {' '.join(body)} }};"]


def headers(folder):
    for path, text in {
        "gripsight_msgs/msg/all.hpp": "#pragma once\n#include <string>\nnamespace gripsight_msgs::msg {\n"
        + "\n".join(struct("PacejkaParams", made := set()) + struct("Grip", made)) + "\n}\n",
        "gripsight_msgs/msg/pacejka_params.hpp": "#include \"all.hpp\"\n",
        "gripsight_msgs/msg/grip.hpp": "#include \"all.hpp\"\n",
        # The part of rclcpp that the example uses.
        "rclcpp/rclcpp.hpp": """#pragma once
#include <functional>
#include <memory>
#include <string>
#define RCLCPP_INFO(logger, ...) (void)(logger)
namespace rclcpp {
struct QoS { explicit QoS(int) {} QoS& reliable() { return *this; } QoS& transient_local() { return *this; } };
template <class M> struct Subscription { using SharedPtr = std::shared_ptr<Subscription>; };
struct Node {
  explicit Node(const std::string&) {}
  template <class T> T declare_parameter(const std::string&, const T& value) { return value; }
  template <class M> typename Subscription<M>::SharedPtr create_subscription(const std::string&, const QoS&, std::function<void(const M&)>) { return {}; }
  int get_logger() { return 0; }
};
inline void init(int, char**) {}
inline void spin(std::shared_ptr<Node>) {}
inline void shutdown() {}
}
""",
    }.items():
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).write_text(text)


@pytest.mark.skipif(shutil.which("c++") is None, reason="no C++ compiler")
def test_cpp_decides_alike(tmp_path):
    headers(tmp_path)
    literal = {True: "true", False: "false"}
    text = ["#include \"tires.hpp\"", "int main() {", "Tires tires(\"car\"); Tires::Set pacejka; Tires::Grip grip;"]
    for number, (_, topic, fields, expected) in enumerate(STEPS, start=1):
        for path, value in fields.items():
            value = f'"{value}"' if isinstance(value, str) else "NAN" if value != value else literal.get(value, value) if isinstance(value, bool) else value
            text.append(f"{topic}.{path} = {value};")
        text.append(f"tires.{'take' if topic == 'pacejka' else 'feel'}({topic});")
        text.append(f"if (std::abs(tires.grip_mps2() - {GRAVITY_MPS2 * expected!r}) > 1e-9) return {number};")
    source, program = tmp_path / "decides.cpp", tmp_path / "decides"
    source.write_text("\n".join([*text, "return 0; }\n"]))
    flags = ["c++", "-std=c++17", "-Wall", "-Werror", "-I", tmp_path, "-I", HERE]
    subprocess.run([*flags, source, "-o", program], check=True)
    failed = subprocess.run([program], check=False).returncode
    assert failed == 0, STEPS[failed - 1][0]
    subprocess.run([*flags, "-fsyntax-only", HERE / "tire_subscriber.cpp"], check=True)
