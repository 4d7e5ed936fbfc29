//! What a node needs from ROS 2 and ros2-client lacks.
