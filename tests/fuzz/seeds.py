"""What fuzzing begins with: a bag of two seconds as sqlite3, its messages with their kind, and with their types' texts.

    seeds.py DRIVE.mcap CORPUS
"""

import pathlib
import sqlite3
import sys

from mcap.reader import make_reader

# As in fuzz_targets/message.rs.
KINDS = {"nav_msgs/msg/Odometry": 0, "ackermann_msgs/msg/AckermannDriveStamped": 1, "sensor_msgs/msg/Imu": 2}


def main():
    bag, corpus = pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[2])
    for target in ("bag_sqlite", "message", "message_by_its_type"):
        (corpus / target).mkdir(parents=True, exist_ok=True)
    file = corpus / "bag_sqlite" / "drive.db3"
    file.unlink(missing_ok=True)
    database = sqlite3.connect(file)
    database.execute("CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT, type TEXT, serialization_format TEXT, offered_qos_profiles TEXT)")
    database.execute("CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, data BLOB)")
    topics = {}
    with bag.open("rb") as stream:
        for schema, channel, message in make_reader(stream).iter_messages():
            if channel.topic not in topics:
                topics[channel.topic] = len(topics) + 1
                database.execute("INSERT INTO topics VALUES (?, ?, ?, 'cdr', '')", (topics[channel.topic], channel.topic, schema.name))
                name = schema.name.replace("/", "_")
                if schema.name in KINDS:
                    (corpus / "message" / name).write_bytes(bytes([KINDS[schema.name]]) + message.data)
                (corpus / "message_by_its_type" / name).write_bytes(schema.data + b"\0" + message.data)
            database.execute("INSERT INTO messages(topic_id, timestamp, data) VALUES (?, ?, ?)", (topics[channel.topic], message.log_time, message.data))
    database.commit()
    database.close()


if __name__ == "__main__":
    main()
