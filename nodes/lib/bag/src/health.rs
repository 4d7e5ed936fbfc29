//! The state of each stream's messages as they were recorded.

use gripsight_signals::{Measurement, Pace, Spikes, TopicHealth};

use crate::{Role, Streams};

/// One stream's messages, channel by channel.
#[derive(Default)]
struct Columns {
    times_s: Vec<f64>,
    delays_s: Vec<f64>,
    channels: Vec<(&'static str, Vec<f64>)>,
}

/// Looks at the measurements of a bag and their log times, stream by stream.
pub(crate) fn of(streams: &Streams, measurements: &[Measurement], log_times_ns: &[u64]) -> Vec<TopicHealth> {
    let mut columns: [Columns; 4] = Default::default();
    // Stamps since the epoch are too long for a float.
    let start_ns = measurements.first().map_or(0, Measurement::stamp_ns);
    for (measurement, &log_ns) in measurements.iter().zip(log_times_ns) {
        let (role, values) = values(measurement);
        let stream = &mut columns[role as usize];
        if stream.channels.is_empty() {
            stream.channels = values.iter().map(|&(name, _)| (name, Vec::new())).collect();
        }
        stream.channels.iter_mut().zip(values).for_each(|(channel, (_, value))| channel.1.push(value));
        stream.times_s.push(measurement.stamp_ns().saturating_sub(start_ns) as f64 * 1e-9);
        stream.delays_s.push(log_ns.cast_signed().saturating_sub(measurement.stamp_ns()) as f64 * 1e-9);
    }
    Role::ALL.into_iter().zip(columns).map(|(role, columns)| columns.health(role, streams)).collect()
}

impl Columns {
    fn health(self, role: Role, streams: &Streams) -> TopicHealth {
        let Self { times_s, delays_s, channels } = self;
        TopicHealth {
            stream: role.name(),
            topic: streams.topic(role).map(str::to_owned),
            type_name: role.type_name(),
            messages: times_s.len(),
            pace: Pace::of(times_s.windows(2).map(|w| w[1] - w[0])),
            delay_s: TopicHealth::median_s(delays_s.into_iter()),
            spikes: channels.iter().filter_map(|(name, values)| Spikes::of(name, &times_s, values)).collect(),
        }
    }
}

/// The channels in which a sample that stands out would matter.
fn values(measurement: &Measurement) -> (Role, Vec<(&'static str, f64)>) {
    match measurement {
        Measurement::Odometry(m) => (
            Role::Odom,
            vec![
                ("x_m", m.x_m),
                ("y_m", m.y_m),
                ("v_x_mps", m.v_x_mps),
                ("v_y_mps", m.v_y_mps),
                ("yaw_rate_radps", m.yaw_rate_radps),
            ],
        ),
        Measurement::Drive(m) => (Role::Drive, vec![("steering_angle_rad", m.steering_angle_rad)]),
        Measurement::Imu(m) => (
            Role::Imu,
            vec![
                ("a_x_mps2", m.a_x_mps2),
                ("a_y_mps2", m.a_y_mps2),
                ("gyro_yaw_rate_radps", m.yaw_rate_radps),
            ],
        ),
        Measurement::Wheels(m) => {
            let names = ["wheel_speed_fl", "wheel_speed_fr", "wheel_speed_rl", "wheel_speed_rr"];
            (Role::Wheels, names.into_iter().zip(m.speed).collect())
        }
        Measurement::Mapped(_) => (Role::Odom, Vec::new()),
    }
}
