//! Topics in, topics out.

use std::path::Path;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use gripsight_bag::{LiveStreams, Role, TopicMap, decode, encode, sequence_to_messages};
use gripsight_msgs::standard::ackermann_msgs::AckermannDriveStamped;
use gripsight_msgs::standard::nav_msgs::Odometry;
use gripsight_msgs::standard::sensor_msgs::{Imu, JointState};
use gripsight_msgs::standard::std_msgs::Header;
use gripsight_msgs::{Excitation as ExcitationMessage, Handshake, Range, StateSequence as SequenceMessage};
use gripsight_runtime::{Descriptor, Node, Publisher, Qos};
use gripsight_signals::{Excitation, Measurement, StateSequence, WindowConfig};

use crate::buffer::{Buffer, Counts};
use crate::diagnostics::{Facts, status};
use crate::mapped;

/// Chunks that a late joiner still gets: those of the last few sequences.
const SEQUENCE_DEPTH: usize = 64;
/// Pause between chunks: RustDDS sends without pacing, and a reader's socket buffer holds only a few.
const CHUNK_PAUSE: Duration = Duration::from_millis(10);

/// Declares parameters and topics; gives the node's work.
pub(crate) fn setup(node: &mut Node) -> anyhow::Result<impl Future<Output = anyhow::Result<()>> + use<>> {
    let length_s = node.parameter(
        "window_s",
        30.0,
        Descriptor::new("Length of a state sequence [s]").range(1.0..=3600.0).read_only(),
    )?;
    let hop_s = node.parameter(
        "hop_s",
        10.0,
        Descriptor::new("From the start of a sequence to the start of the next [s]")
            .range(0.1..=3600.0)
            .read_only(),
    )?;
    let first_s = node.parameter(
        "first_s",
        0.0,
        Descriptor::new("Length from which the first window is given out while it grows, again a quarter longer each time [s]; 0: once it is full")
            .range(0.0..=3600.0)
            .read_only(),
    )?;
    let window = WindowConfig { length_s: length_s.get(), hop_s: hop_s.get().min(length_s.get()) };
    let file = node.parameter(
        "topics_file",
        String::new(),
        Descriptor::new("A topics file (params/stacks): which field of which topic carries which signal; empty: odom, drive, imu, wheels")
            .read_only(),
    )?;
    let live = match file.get().as_str() {
        "" => LiveStreams::default(),
        path => TopicMap::read(Path::new(path))?.live()?,
    };
    live.cannot.iter().for_each(|what| tracing::warn!("{what}"));
    let buffer = Buffer::new(window, live.layout.clone())?.growing_from(first_s.get())?;

    let sensor = node.sensor_qos(50);
    let mut odometry = node.subscription::<Odometry>("odom", sensor)?;
    let mut drive = node.subscription::<AckermannDriveStamped>("drive", sensor)?;
    let mut imu = node.subscription::<Imu>("imu", sensor)?;
    let mut wheels = node.subscription::<JointState>("wheels", sensor)?;
    let mut mapped = mapped::subscribe(node, &live, sensor)?;
    let [odom_used, drive_used, imu_used, wheels_used] = Role::ALL.map(|role| mapped::follows(&live, role));
    if odom_used {
        node.needs([odometry.arrivals()]);
    }
    if drive_used {
        node.needs([drive.arrivals()]);
    }
    let outputs = Outputs {
        sequence: node.publisher("~/sequence", Qos::latched().with_depth(SEQUENCE_DEPTH))?,
        excitation: node.publisher("~/excitation", Qos::latched())?,
        run_id: run_id(),
    };
    let diagnostics = node.diagnostics();

    Ok(async move {
        let mut state =
            State { buffer, last_excitation: None, frame_id: "map".to_owned(), seen: Counts::default() };
        let mut ticks = tokio::time::interval(Duration::from_secs(1));
        loop {
            let measurement = tokio::select! {
                Some(message) = odometry.next(), if odom_used => {
                    let sample = decode::odometry(&message);
                    state.frame_id = message.header.frame_id;
                    Some(Measurement::Odometry(sample))
                }
                Some(message) = drive.next(), if drive_used => Some(Measurement::Drive(decode::drive(&message))),
                Some(message) = imu.next(), if imu_used => decode::imu(&message).map(Measurement::Imu),
                Some(message) = wheels.next(), if wheels_used => match decode::wheels(&message) {
                    Ok(sample) => sample.map(Measurement::Wheels),
                    Err(error) => {
                        state.buffer.last_problem = Some(error.to_string());
                        None
                    }
                },
                Some(measurement) = mapped.recv() => Some(measurement),
                _ = ticks.tick() => {
                    diagnostics.report("telemetry", status(&state.facts()));
                    state.seen = state.buffer.counts();
                    continue;
                }
                else => return Ok(()),
            };
            for sequence in measurement.map(|m| state.buffer.push(m)).unwrap_or_default() {
                state.last_excitation = outputs.publish(&sequence, &state).await;
            }
        }
    })
}

struct State {
    buffer: Buffer,
    last_excitation: Option<Excitation>,
    frame_id: String,
    /// The counts when the state was last reported.
    seen: Counts,
}

impl State {
    fn facts(&self) -> Facts<'_> {
        let counts = self.buffer.counts();
        Facts {
            counts,
            new: std::array::from_fn(|i| counts.taken[i] - self.seen.taken[i]),
            newly_rejected: counts.rejected - self.seen.rejected,
            filling: self.buffer.filling(),
            last_problem: self.buffer.last_problem.as_deref(),
            insufficient: self.last_excitation.as_ref().and_then(|e| e.insufficient.as_deref()),
        }
    }
}

struct Outputs {
    sequence: Publisher<SequenceMessage>,
    excitation: Publisher<ExcitationMessage>,
    run_id: String,
}

impl Outputs {
    /// Publishes a sequence and what it is worth.
    async fn publish(&self, sequence: &StateSequence, state: &State) -> Option<Excitation> {
        let handshake = Handshake {
            run_id: self.run_id.clone(),
            sequence_id: sequence.sequence_id,
            ..Handshake::default()
        };
        for message in sequence_to_messages(sequence, &handshake, &state.frame_id) {
            self.sequence.publish(&message).await;
            tokio::time::sleep(CHUNK_PAUSE).await;
        }
        let excitation = match Excitation::of(sequence) {
            Ok(excitation) => excitation,
            Err(error) => {
                tracing::warn!("sequence {}: {error}", sequence.sequence_id);
                return None;
            }
        };
        tracing::info!(
            "sequence {}: {} samples, {:.1} s, mean speed {:.1} m/s{}",
            sequence.sequence_id,
            excitation.samples,
            excitation.duration_s,
            excitation.v_x_mean_mps,
            excitation.insufficient.as_ref().map(|r| format!("; {r}")).unwrap_or_default(),
        );
        let header =
            Header { stamp: encode::time(sequence.start_stamp_ns), frame_id: state.frame_id.clone() };
        let rejected = state.buffer.counts().rejected;
        self.excitation.publish(&excitation_message(&excitation, header, handshake, rejected)).await;
        Some(excitation)
    }
}

fn excitation_message(
    e: &Excitation,
    header: Header,
    handshake: Handshake,
    rejected: usize,
) -> ExcitationMessage {
    let range = |[low, high]: [f64; 2]| Range { low, high };
    ExcitationMessage {
        header,
        handshake,
        sufficient: e.insufficient.is_none(),
        reason: e.insufficient.clone().unwrap_or_default(),
        duration_s: e.duration_s,
        samples: e.samples as u32,
        gaps: e.gaps as u32,
        rejected_samples: rejected as u32,
        v_x_mean_mps: e.v_x_mean_mps,
        v_x_mps: range(e.v_x_range_mps),
        lateral_acceleration_mps2: range(e.lateral_acceleration_range_mps2),
        steering_rad: range(e.steering_range_rad),
        steering_rate_rms_radps: e.steering_rate_rms_radps,
        v_y_rms_mps: e.v_y_rms_mps,
    }
}

/// Tells this start of the node from every other: the sequences of a bag played twice have the same numbers.
fn run_id() -> String {
    let since_epoch = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    format!("telemetry-{:x}", since_epoch.as_nanos())
}
