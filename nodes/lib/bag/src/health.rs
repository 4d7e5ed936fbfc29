//! The state of each stream's messages as they were recorded.

use gripsight_signals::{Measurement, Pace, Signal, Spikes, TopicHealth};

use crate::{Role, Streams};

/// One stream's messages, channel by channel.
#[derive(Default)]
struct Columns {
    times_s: Vec<f64>,
    delays_s: Vec<f64>,
    channels: Vec<(&'static str, Vec<f64>)>,
}

/// Looks at the measurements of a bag and their log times, stream by stream: those with a type of their own, then those that are read
/// field by field.
pub(crate) fn of(streams: &Streams, measurements: &[Measurement], log_times_ns: &[u64]) -> Vec<TopicHealth> {
    let mut columns: Vec<Columns> = Vec::new();
    columns.resize_with(Role::ALL.len() + streams.mapped().len(), Columns::default);
    // Stamps since the epoch are too long for a float.
    let start_ns = measurements.first().map_or(0, Measurement::stamp_ns);
    for (measurement, &log_ns) in measurements.iter().zip(log_times_ns) {
        let values = values(measurement);
        let Some(stream) = columns.get_mut(measurement.stream_index()) else { continue };
        if stream.channels.is_empty() {
            stream.channels = values.iter().map(|&(name, _)| (name, Vec::new())).collect();
        }
        stream.channels.iter_mut().zip(values).for_each(|(channel, (_, value))| channel.1.push(value));
        stream.times_s.push(measurement.stamp_ns().saturating_sub(start_ns) as f64 * 1e-9);
        stream.delays_s.push(log_ns.cast_signed().saturating_sub(measurement.stamp_ns()) as f64 * 1e-9);
    }
    let typed = Role::ALL
        .into_iter()
        .map(|role| (role.name(), streams.topic(role).map(str::to_owned), role.type_name().into()));
    let mapped = streams.mapped().iter().map(|m| {
        let name = m.signals.first().map_or("", |(signal, _)| signal.name());
        (name, Some(m.topic.clone()), m.type_name.clone().into())
    });
    // A stream whose signals are read field by field is not missing.
    let read = |stream: &str| {
        streams.mapped().iter().flat_map(|m| &m.signals).any(|(signal, _)| stream_of(*signal) == stream)
    };
    typed
        .chain(mapped)
        .zip(columns)
        .filter(|((stream, topic, _), _)| topic.is_some() || !read(stream))
        .map(|((stream, topic, type_name), columns)| columns.health(stream, topic, type_name))
        .collect()
}

/// The stream that a signal belongs to where it has a type of its own.
fn stream_of(signal: Signal) -> &'static str {
    match signal {
        Signal::ForwardSpeed
        | Signal::LateralSpeed
        | Signal::YawRate
        | Signal::X
        | Signal::Y
        | Signal::Heading => "odom",
        Signal::Steering | Signal::SpeedCommand | Signal::AccelerationCommand | Signal::MeasuredSteering => {
            "drive"
        }
        Signal::ForwardAcceleration | Signal::LateralAcceleration | Signal::Gyro => "imu",
        _ => "wheels",
    }
}

impl Columns {
    fn health(
        self,
        stream: &'static str,
        topic: Option<String>,
        type_name: std::borrow::Cow<'static, str>,
    ) -> TopicHealth {
        let Self { times_s, delays_s, channels } = self;
        TopicHealth {
            stream,
            topic,
            type_name,
            messages: times_s.len(),
            pace: Pace::of(times_s.windows(2).map(|w| w[1] - w[0])),
            delay_s: TopicHealth::median_s(delays_s.into_iter()),
            spikes: channels.iter().filter_map(|(name, values)| Spikes::of(name, &times_s, values)).collect(),
        }
    }
}

/// The channels in which a sample that stands out would matter.
fn values(measurement: &Measurement) -> Vec<(&'static str, f64)> {
    match measurement {
        Measurement::Odometry(m) => vec![
            ("x_m", m.x_m),
            ("y_m", m.y_m),
            ("v_x_mps", m.v_x_mps),
            ("v_y_mps", m.v_y_mps),
            ("yaw_rate_radps", m.yaw_rate_radps),
        ],
        Measurement::Drive(m) => vec![("steering_angle_rad", m.steering_angle_rad)],
        Measurement::Imu(m) => vec![
            ("a_x_mps2", m.a_x_mps2),
            ("a_y_mps2", m.a_y_mps2),
            ("gyro_yaw_rate_radps", m.yaw_rate_radps),
        ],
        Measurement::Wheels(m) => {
            let names = ["wheel_speed_fl", "wheel_speed_fr", "wheel_speed_rl", "wheel_speed_rr"];
            names.into_iter().zip(m.speed).collect()
        }
        // A heading goes round, and a command steps.
        Measurement::Mapped(m) => m
            .values
            .present()
            .filter(|(signal, value)| *signal != Signal::Heading && value.is_finite())
            .map(|(signal, value)| (signal.name(), value))
            .collect(),
    }
}
