//! What a fault can do to a message's contents.

use gripsight_msgs::Message;
use gripsight_msgs::standard::ackermann_msgs::AckermannDriveStamped;
use gripsight_msgs::standard::geometry_msgs::Vector3;
use gripsight_msgs::standard::nav_msgs::Odometry;
use gripsight_msgs::standard::sensor_msgs::{CompressedImage, Imu, JointState};
use gripsight_msgs::standard::std_msgs::Header;

/// km/h in a m/s.
const KMH: f64 = 3.6;
/// m/s2 in a g.
const G: f64 = 9.80665;

/// A message that passes through the node.
pub(crate) trait Signal: Message {
    fn header(&mut self) -> &mut Header;

    /// Every measured number becomes what `change` makes of it: (number, its factor to the units that stacks confuse it with).
    fn change(&mut self, change: impl Fn(f64, f64) -> f64);

    /// A picture shows nothing.
    fn darken(&mut self, _black: &[u8]) {}
}

fn turn(vector: &mut Vector3, factor: f64, change: &impl Fn(f64, f64) -> f64) {
    for value in [&mut vector.x, &mut vector.y, &mut vector.z] {
        *value = change(*value, factor);
    }
}

impl Signal for Odometry {
    fn header(&mut self) -> &mut Header {
        &mut self.header
    }

    fn change(&mut self, change: impl Fn(f64, f64) -> f64) {
        turn(&mut self.twist.twist.linear, KMH, &change);
        turn(&mut self.twist.twist.angular, 1_f64.to_degrees(), &change);
        let position = &mut self.pose.pose.position;
        for value in [&mut position.x, &mut position.y] {
            *value = change(*value, 1.0);
        }
    }
}

impl Signal for AckermannDriveStamped {
    fn header(&mut self) -> &mut Header {
        &mut self.header
    }

    fn change(&mut self, change: impl Fn(f64, f64) -> f64) {
        let drive = &mut self.drive;
        drive.steering_angle = change(drive.steering_angle.into(), 1_f64.to_degrees()) as f32;
        drive.speed = change(drive.speed.into(), KMH) as f32;
    }
}

impl Signal for Imu {
    fn header(&mut self) -> &mut Header {
        &mut self.header
    }

    fn change(&mut self, change: impl Fn(f64, f64) -> f64) {
        turn(&mut self.linear_acceleration, 1.0 / G, &change);
        turn(&mut self.angular_velocity, 1_f64.to_degrees(), &change);
    }
}

impl Signal for JointState {
    fn header(&mut self) -> &mut Header {
        &mut self.header
    }

    fn change(&mut self, change: impl Fn(f64, f64) -> f64) {
        let per_minute = 60.0 / std::f64::consts::TAU;
        self.velocity.iter_mut().for_each(|value| *value = change(*value, per_minute));
    }
}

impl Signal for CompressedImage {
    fn header(&mut self) -> &mut Header {
        &mut self.header
    }

    fn change(&mut self, _change: impl Fn(f64, f64) -> f64) {}

    fn darken(&mut self, black: &[u8]) {
        "jpeg".clone_into(&mut self.format);
        self.data = black.to_vec();
    }
}
