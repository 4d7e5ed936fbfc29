//! MCAP bags and ROS 2 messages to telemetry: the one conversion, used live and offline.
