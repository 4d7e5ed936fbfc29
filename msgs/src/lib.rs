//! ROS 2 messages of the gripsight suite, and the standard ones it exchanges.
