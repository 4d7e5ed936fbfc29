"""A CycloneDDS peer of the suite: it knows ROS 2's names and the .msg files, and nothing of the suite's code.

    cyclone_peer.py subscribe TOPIC TYPE [--qos latched|reliable|sensor] [--count N] [--timeout S]
    cyclone_peer.py publish TOPIC TYPE [--qos ...]      messages as JSON lines on standard input; --times N sends each N times,
                                                        --stamp with the time of sending in its header
    cyclone_peer.py call SERVICE TYPE REQUEST           a service of a node under rmw_cyclonedds_cpp; REQUEST is JSON
    cyclone_peer.py serve SERVICE TYPE REPLY            the same service offered: prints each request and answers REPLY, until --count came
    cyclone_peer.py types TOPIC TYPE [--count N]        the types that endpoints of a topic are announced with, once N endpoints stand and
                                                        none has come for two seconds; exit code 1: others than TYPE
    cyclone_peer.py user_data TOPIC TYPE [--count N]    the user data that they are announced with
    cyclone_peer.py quality TOPIC TYPE [--count N]      their reliability and durability

Messages are printed as JSON lines, one object each, with the field names of the .msg files; the line `ready` says that the
endpoint stands. Exit code 1: not all messages came in time.
"""

import argparse
import dataclasses
import json
import os
import pathlib
import sys
import time
import types as pytypes

from cyclonedds.core import Policy, Qos
from cyclonedds.domain import DomainParticipant
from cyclonedds.idl import IdlStruct
from cyclonedds.idl import types as idl
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from cyclonedds.util import duration

MSGS = pathlib.Path(__file__).resolve().parents[2] / "msgs"
PRIMITIVES = {
    "bool": bool, "byte": idl.uint8, "uint8": idl.uint8, "int8": idl.int8, "uint16": idl.uint16, "int16": idl.int16,
    "uint32": idl.uint32, "int32": idl.int32, "uint64": idl.uint64, "int64": idl.int64, "float32": idl.float32,
    "float64": idl.float64, "string": str,
}
SERVICES = {
    "GetParameters": ("string[] names", "ParameterValue[] values"),
    "GetParameterTypes": ("string[] names", "uint8[] types"),
    "SetParameters": ("Parameter[] parameters", "SetParametersResult[] results"),
    "SetParametersAtomically": ("Parameter[] parameters", "SetParametersResult result"),
    "ListParameters": ("string[] prefixes\nuint64 depth", "ListParametersResult result"),
    "DescribeParameters": ("string[] names", "ParameterDescriptor[] descriptors"),
    "Trigger": ("uint8 structure_needs_at_least_one_member", "bool success\nstring message"),
}
_types = {}


def definition(package, name):
    path = MSGS / "msg" if package == "gripsight_msgs" else MSGS / "standard" / package
    return (path / f"{name}.msg").read_text()


def struct(package, name, kind="msg", text=None):
    """The IDL struct of a ROS type, under its DDS name."""
    key = (package, name)
    if key not in _types:
        annotations = {}
        for line in (text if text is not None else definition(package, name)).splitlines():
            code = line.split("#")[0].strip()
            if code and ("=" not in code or "<=" in code):
                field_type, field = code.split()[:2]
                annotations[field] = element(package, field_type)
        body = lambda namespace: namespace.update(__annotations__=annotations)
        dds_name = f"{package}::{kind}::dds_::{name}_"
        _types[key] = dataclasses.dataclass(pytypes.new_class(name, (IdlStruct,), {"typename": dds_name}, body))
    return _types[key]


def element(package, text):
    base, _, count = text.rstrip("]").partition("[")
    if base in PRIMITIVES:
        kind = PRIMITIVES[base]
    else:
        kind = struct(*base.split("/")) if "/" in base else struct(package, base)
    if not text.endswith("]"):
        return kind
    if count.isdigit():
        return idl.array[kind, int(count)]
    return idl.sequence[kind, int(count[2:])] if count else idl.sequence[kind]


def build(kind, value):
    """A message from JSON; fields that are left out take their zero."""
    if dataclasses.is_dataclass(kind):
        return kind(**{name: build(part, value.get(name) if value else None) for name, part in kind.__annotations__.items()})
    inner = getattr(kind, "__metadata__", [None])[0]
    if isinstance(inner, idl.sequence):
        return [build(inner.subtype, item) for item in value or []]
    if isinstance(inner, idl.array):
        return [build(inner.subtype, item) for item in value or [None] * inner.length]
    if value is not None:
        return value
    return {bool: False, str: ""}.get(kind, 0)


def qos(name):
    best_effort = name == "sensor"
    latched = name == "latched"
    return Qos(
        Policy.Reliability.BestEffort if best_effort else Policy.Reliability.Reliable(duration(seconds=1)),
        Policy.Durability.TransientLocal if latched else Policy.Durability.Volatile,
        Policy.History.KeepLast(1) if latched else Policy.History.KeepAll,
    )


def show(message):
    print(json.dumps(dataclasses.asdict(message), default=list), flush=True)


def wait_until(condition, timeout_s):
    end = time.monotonic() + timeout_s
    while time.monotonic() < end:
        if condition():
            return True
        time.sleep(0.01)
    return False


def subscribe(participant, args):
    reader = DataReader(participant, Topic(participant, "rt" + args.topic, struct(*args.type.split("/msg/"))), qos(args.qos))
    print("ready", flush=True)
    received = 0

    def take():
        nonlocal received
        for message in reader.take(N=100):
            # Also reported, without data: that the writer has gone.
            if message.sample_info.valid_data:
                show(message)
                received += 1
        return received >= args.count

    return wait_until(take, args.timeout)


def publish(participant, args):
    kind = struct(*args.type.split("/msg/"))
    writer = DataWriter(participant, Topic(participant, "rt" + args.topic, kind), qos(args.qos))
    print("ready", flush=True)
    if not wait_until(writer.get_matched_subscriptions, args.timeout):
        return False
    if args.qos == "sensor":
        # This side knows of the match; until the other side does too, it drops what is sent at best effort.
        time.sleep(0.5)
    for line in sys.stdin:
        message = build(kind, json.loads(line))
        for _ in range(args.times):
            if args.stamp:
                message.header.stamp.sec, message.header.stamp.nanosec = divmod(time.time_ns(), 10**9)
            writer.write(message)
            time.sleep(args.period)
    came = args.qos == "sensor" or writer.wait_for_acks(duration(seconds=args.timeout))
    # Acknowledged is not yet read: RustDDS 0.15 drops what its reader has not taken when the writer goes.
    time.sleep(0.5)
    return came


def endpoints(participant, args):
    """Readers and writers of a topic as they are announced, once enough stand and none has come for two seconds."""
    from cyclonedds.builtin import BuiltinDataReader, BuiltinTopicDcpsPublication, BuiltinTopicDcpsSubscription

    readers = [BuiltinDataReader(participant, kind) for kind in (BuiltinTopicDcpsPublication, BuiltinTopicDcpsSubscription)]
    print("ready", flush=True)
    found, last = {}, time.monotonic()

    def settled():
        nonlocal last
        for endpoint in (sample for reader in readers for sample in reader.take(N=100)):
            if endpoint.sample_info.valid_data and endpoint.topic_name == "rt" + args.topic and endpoint.key not in found:
                found[endpoint.key], last = endpoint, time.monotonic()
        return len(found) >= args.count and time.monotonic() - last > 2.0

    return wait_until(settled, args.timeout), found.values()


def types(participant, args):
    is_settled, found = endpoints(participant, args)
    names = sorted({end.type_name.replace("::dds_::", "::").replace("::", "/").rstrip("_") for end in found})
    print(json.dumps(names), flush=True)
    return is_settled and names == [args.type]


def user_data(participant, args):
    is_settled, found = endpoints(participant, args)
    data = [end.qos[Policy.Userdata] if Policy.Userdata in end.qos else None for end in found]
    print(json.dumps(sorted({entry.data.decode() if entry else "" for entry in data})), flush=True)
    return is_settled


def quality(participant, args):
    is_settled, found = endpoints(participant, args)
    names = [(type(end.qos[Policy.Reliability]).__name__, type(end.qos[Policy.Durability]).__name__) for end in found]
    print(json.dumps(sorted(set(names))), flush=True)
    return is_settled


def service(participant, args):
    """The topics of requests and replies."""
    package, name = args.type.split("/srv/")
    request_text, reply_text = SERVICES[name]
    head = "uint64 guid\nint64 seq\n"  # rmw_cyclonedds_cpp puts these in front of every request and reply
    request_type = struct(package, f"{name}_Request", "srv", head + request_text)
    reply_type = struct(package, f"{name}_Response", "srv", head + reply_text)
    requests = Topic(participant, f"rq{args.topic}Request", request_type)
    return requests, Topic(participant, f"rr{args.topic}Reply", reply_type), request_type, reply_type


def serve(participant, args):
    requests, replies, _, reply_type = service(participant, args)
    reader = DataReader(participant, requests, qos("reliable"))
    writer = DataWriter(participant, replies, qos("reliable"))
    print("ready", flush=True)
    answered = 0

    def answer():
        nonlocal answered
        for request in reader.take(N=10):
            if request.sample_info.valid_data:
                show(request)
                writer.write(build(reply_type, {"guid": request.guid, "seq": request.seq, **json.loads(args.request)}))
                answered += 1
        return answered >= args.count

    came = wait_until(answer, args.timeout)
    time.sleep(0.5)  # The last reply is still under way.
    return came


def call(participant, args):
    requests, replies_topic, request_type, reply_type = service(participant, args)
    writer = DataWriter(participant, requests, qos("reliable"))
    if not wait_until(writer.get_matched_subscriptions, args.timeout):
        return False
    # The worst order that discovery allows: the server has the request before it knows of the reader of its reply.
    writer.write(build(request_type, {"guid": 4711, "seq": 1, **json.loads(args.request)}))
    time.sleep(0.2)
    reader = DataReader(participant, replies_topic, qos("reliable"))
    replies = []

    def take():
        replies.extend(r for r in reader.take(N=10) if r.sample_info.valid_data and r.guid == 4711)
        return replies

    if not wait_until(take, args.timeout):
        return False
    show(replies[0])
    return True


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("command", choices=["subscribe", "publish", "call", "serve", "types", "user_data", "quality"])
    parser.add_argument("topic")
    parser.add_argument("type")
    parser.add_argument("request", nargs="?")
    parser.add_argument("--qos", choices=["latched", "reliable", "sensor"], default="reliable")
    parser.add_argument("--count", type=int, default=1)
    parser.add_argument("--period", type=float, default=0.0, help="seconds between published messages")
    parser.add_argument("--times", type=int, default=1)
    parser.add_argument("--stamp", action="store_true")
    parser.add_argument("--timeout", type=float, default=50.0)
    args = parser.parse_args()
    commands = (subscribe, publish, call, serve, types, user_data, quality)
    work = next(command for command in commands if command.__name__ == args.command)
    sys.exit(0 if work(DomainParticipant(int(os.environ.get("ROS_DOMAIN_ID", 0))), args) else 1)


if __name__ == "__main__":
    main()
