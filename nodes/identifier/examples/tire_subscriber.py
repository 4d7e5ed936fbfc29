"""An MPC's side of the identifier in Python: which tires to drive on, and with how much grip.

    python3 tire_subscriber.py --ros-args -p vehicle_hash:=...      needs rclpy and gripsight_msgs; without a hash any car's sets

`Tires` decides and needs no ROS: copy it into a controller. The rest of the file is the node around it.
"""

import math
from types import SimpleNamespace

GRAVITY_MPS2 = 9.80665
# The tires to start with: soft ones, so that the car turns no later than it is told to.
START = SimpleNamespace(b=8.4, c=1.4, d=0.51, e=0.0)
# Share of the start's grip to drive with: what nobody measured is no promise.
CAREFUL = 0.5
# Share of the promised grip to go on with after a set is withdrawn and no figure is known.
WITHDRAWN = 0.7


class Tires:
    """The set to drive on: `front` and `rear` (Magic Formulas over the static load), and `grip_mps2`, the lateral acceleration to plan with."""

    def __init__(self, vehicle_hash="", provisional=False):
        self.vehicle_hash = vehicle_hash  # sets of a car with other parameters are not taken; empty: any car's
        self.provisional = provisional  # whether sets are driven on whose peak rests on a friction prior
        self.front = self.rear = START
        self.set = None
        self.left = 1.0

    @property
    def grip_mps2(self):
        """Lateral acceleration to plan with."""
        if self.set is None:
            return GRAVITY_MPS2 * CAREFUL * min(self.front.d, self.rear.d)
        s = self.set
        # A set is valid up to a force that was shown; NaN: not stated.
        front = _least(s.front.d, s.front_valid_force_n / s.front_load_n)
        rear = _least(s.rear.d, s.rear_valid_force_n / s.rear_load_n)
        return GRAVITY_MPS2 * self.left * min(front, rear)

    def take(self, message):
        """Takes a message of ~/pacejka; whether there is something new to plan with."""
        if self.vehicle_hash not in ("", message.handshake.vehicle_hash):
            return False
        if message.status == message.WITHDRAWN:
            # The shape of the curves is the best there is; the grip is what the warning before it said.
            if self.set is None or self.left < 1.0:
                return False
            self.left = WITHDRAWN
            return True
        good = [message.ACCEPTED, message.ACCEPTED_WITHIN] + [message.PROVISIONAL] * self.provisional
        if message.status not in good:
            return False
        self.set, self.front, self.rear, self.left = message, message.front, message.rear, 1.0
        return True

    def feel(self, message):
        """Takes a message of ~/grip; whether there is something new to plan with."""
        if self.set is None or message.handshake.sequence_id != self.set.handshake.sequence_id or not message.fallen:
            return False
        share = min(max(message.share, 0.05), 1.0) if math.isfinite(message.share) else WITHDRAWN
        if share >= self.left:
            return False
        # Nothing but the next set restores it: a car that drives slower shows no grip.
        self.left = share
        return True


def _least(peak, valid):
    return min(peak, valid) if math.isfinite(valid) else peak


def main():
    """The node: says what it would plan with."""
    import rclpy
    from gripsight_msgs.msg import Grip, PacejkaParams
    from rclpy.executors import ExternalShutdownException
    from rclpy.node import Node
    from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

    rclpy.init()
    node = Node("tire_subscriber")
    vehicle_hash = node.declare_parameter("vehicle_hash", "").value
    tires = Tires(vehicle_hash, node.declare_parameter("take_provisional", False).value)
    # Who comes late gets the last message, too.
    latched = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL)

    def plan(new):
        # Here a controller takes tires.front and tires.rear, and plans its speeds anew.
        if new:
            node.get_logger().info(f"plan with {tires.grip_mps2:.2f} m/s2")

    node.create_subscription(PacejkaParams, "/identifier/pacejka", lambda m: plan(tires.take(m)), latched)
    node.create_subscription(Grip, "/identifier/grip", lambda m: plan(tires.feel(m)), latched)
    plan(True)
    try:
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass  # Ctrl-C, or the launcher's end.


if __name__ == "__main__":
    main()
