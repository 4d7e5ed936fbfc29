"""Records topics into an MCAP bag until the identifier's run has ended; a CycloneDDS peer, as cyclone_peer.py.

    record.py BAG [--timeout S]     exit code 1: no end of a run in time (the bag holds what there was)
"""

import argparse
import os
import sys
import time

from cyclone_peer import definition, qos, struct, wait_until
from cyclonedds.domain import DomainParticipant
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from mcap_ros2.writer import Writer

TOPICS = {
    "/camera_prior/friction": "FrictionPrior",
    "/identifier/candidate": "PacejkaParams",
    "/identifier/progress": "IdentificationProgress",
    "/s4_residual/model": "ResidualModel",
}
PROPOSED = 1


def schema(package, name):
    """The definition with those that it needs, as bags hold it."""
    texts, seen = [definition(package, name)], set()
    waiting = [(package, kind) for kind in fields(package, name)]
    while waiting:
        owner, kind = waiting.pop(0)
        inner = tuple(kind.split("/")) if "/" in kind else (owner, kind)
        if inner not in seen:
            seen.add(inner)
            texts.append(f"MSG: {'/'.join(inner)}\n{definition(*inner)}")
            waiting += [(inner[0], kind) for kind in fields(*inner)]
    return ("\n" + "=" * 80 + "\n").join(texts)


def fields(package, name):
    """Types of a message's fields that are messages themselves."""
    lines = (line.split("#")[0].split() for line in definition(package, name).splitlines())
    kinds = [line[0].split("[")[0] for line in lines if len(line) == 2 and "=" not in line[1]]
    return [kind for kind in kinds if "/" in kind or kind[0].isupper()]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("bag")
    parser.add_argument("--timeout", type=float, default=120.0)
    args = parser.parse_args()
    participant = DomainParticipant(int(os.environ.get("ROS_DOMAIN_ID", 0)))
    with open(args.bag, "wb") as file, Writer(file) as writer:
        readers = []
        for topic, name in TOPICS.items():
            kind = struct("gripsight_msgs", name)
            reader = DataReader(participant, Topic(participant, "rt" + topic, kind), qos("reliable"))
            readers.append((topic, reader, writer.register_msgdef(f"gripsight_msgs/msg/{name}", schema("gripsight_msgs", name))))
        print("ready", flush=True)

        def take():
            ended = False
            for topic, reader, kind in readers:
                for message in reader.take(N=100):
                    writer.write_message(topic, kind, message, time.time_ns())
                    ended |= topic == "/identifier/candidate" and message.status != PROPOSED
            return ended

        sys.exit(0 if wait_until(take, args.timeout) else 1)


if __name__ == "__main__":
    main()
