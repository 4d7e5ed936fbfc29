//! `diagnose --predictions`: the bag once more, with what the models predicted beside its topics.

use std::path::Path;

use gripsight_bag::{Bag, BagError, BagWriter, decode, encode, from_cdr};
use gripsight_diagnosis::Prediction;
use gripsight_msgs::standard::nav_msgs::Odometry;
use gripsight_signals::{OdometrySample, StateSequence};

/// The models' topics, in the order of [`Prediction`]'s columns after the measured one.
const TOPICS: [&str; 2] = ["/gripsight/nominal/odom", "/gripsight/extended/odom"];
/// The frame of predictions without a pose: velocities in the car's own frame say something, a place does not.
const CAR_FRAME: &str = "base_link";

/// What came of it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Written {
    /// Velocities, and poses that follow from them.
    WithPoses,
    /// Velocities alone: the bag holds no pose.
    WithoutPoses,
}

/// Copies a bag, with what the models predicted in between, in the order of time. Predictions that the bag holds from before are left out,
/// and so is what follows the place where it is cut off.
///
/// The pose of a prediction is the recorded one where its rollout begins, carried on by the predicted motion: it drifts from the recorded
/// pose as the model does from the car. Where no pose is recorded there is none, and the frame is the car's.
pub(crate) fn write(
    bag: &Path,
    odometry_topic: Option<&str>,
    out: &Path,
    sequence: &StateSequence,
    predictions: &[Prediction],
) -> anyhow::Result<Written> {
    let bag = Bag::open(bag)?;
    let frame = Frame::of(&bag, odometry_topic, sequence)?;
    let samples: Vec<[OdometrySample; 2]> = motion(sequence, frame.origin_m, predictions);
    let mut writer = BagWriter::create(out)?;
    let mut left = samples.iter().peekable();
    let write = |writer: &mut BagWriter, samples: &[OdometrySample; 2]| {
        let mut of_each = TOPICS.into_iter().zip(samples);
        of_each.try_for_each(|(topic, sample)| writer.write(topic, sample.stamp_ns, &frame.message(sample)))
    };
    for message in bag.messages() {
        let message = match message {
            Err(BagError::Truncated { .. }) => break,
            other => other?,
        };
        while let Some(next) = left.next_if(|s| s[0].stamp_ns <= message.log_time.cast_signed()) {
            write(&mut writer, next)?;
        }
        if !TOPICS.contains(&message.channel.topic.as_str()) {
            writer.copy(&message)?;
        }
    }
    left.try_for_each(|next| write(&mut writer, next))?;
    writer.finish()?;
    Ok(if has_pose(sequence) { Written::WithPoses } else { Written::WithoutPoses })
}

fn has_pose(sequence: &StateSequence) -> bool {
    !sequence.x_m.is_empty()
}

/// The frames of the recorded odometry, and where in them the sequence begins.
struct Frame {
    fixed: String,
    car: String,
    origin_m: [f64; 2],
}

impl Frame {
    fn of(bag: &Bag, topic: Option<&str>, sequence: &StateSequence) -> anyhow::Result<Self> {
        let mut frame = Self { fixed: CAR_FRAME.to_owned(), car: CAR_FRAME.to_owned(), origin_m: [0.0; 2] };
        if !has_pose(sequence) {
            return Ok(frame);
        }
        // Recorded sequences are relative to their first sample, in a frame that they do not name.
        "map".clone_into(&mut frame.fixed);
        for message in bag.messages() {
            let message = match message {
                Err(BagError::Truncated { .. }) => break,
                other => other?,
            };
            if Some(message.channel.topic.as_str()) != topic {
                continue;
            }
            let odometry: Odometry = from_cdr(&message.data)?;
            let sample = decode::odometry(&odometry);
            if sample.stamp_ns == sequence.start_stamp_ns {
                frame.origin_m = [sample.x_m, sample.y_m];
                frame.fixed = odometry.header.frame_id;
                frame.car = odometry.child_frame_id;
                break;
            }
        }
        Ok(frame)
    }

    fn message(&self, sample: &OdometrySample) -> Odometry {
        let mut message = encode::odometry(sample);
        message.header.frame_id.clone_from(&self.fixed);
        message.child_frame_id.clone_from(&self.car);
        message
    }
}

/// What both models predict, as odometry.
fn motion(
    sequence: &StateSequence,
    origin_m: [f64; 2],
    predictions: &[Prediction],
) -> Vec<[OdometrySample; 2]> {
    let mut out: Vec<[OdometrySample; 2]> = Vec::with_capacity(predictions.len());
    let mut before_s = 0.0;
    for p in predictions {
        let samples = [1, 2].map(|model| {
            let sample = OdometrySample {
                stamp_ns: sequence.start_stamp_ns + (p.time_s * 1e9).round() as i64,
                v_x_mps: p.v_x_mps,
                v_y_mps: p.v_y_mps[model],
                yaw_rate_radps: p.yaw_rate_radps[model],
                ..OdometrySample::default()
            };
            match out.last().filter(|_| !p.begins) {
                _ if !has_pose(sequence) => sample,
                Some(last) => moved(&last[model - 1], sample, p.time_s - before_s),
                None => placed(sequence, origin_m, p.time_s, sample),
            }
        });
        out.push(samples);
        before_s = p.time_s;
    }
    out
}

/// A sample at the pose recorded at a time.
fn placed(
    sequence: &StateSequence,
    origin_m: [f64; 2],
    time_s: f64,
    sample: OdometrySample,
) -> OdometrySample {
    let after = sequence.time_s.partition_point(|&t| f64::from(t) < time_s).clamp(1, sequence.len() - 1);
    let [from_s, to_s] = [after - 1, after].map(|k| f64::from(sequence.time_s[k]));
    let weight = ((time_s - from_s) / (to_s - from_s)).clamp(0.0, 1.0);
    let at = |channel: &[f32]| {
        let [from, to] = [after - 1, after].map(|k| f64::from(channel[k]));
        from + (to - from) * weight
    };
    OdometrySample {
        x_m: origin_m[0] + at(&sequence.x_m),
        y_m: origin_m[1] + at(&sequence.y_m),
        yaw_rad: at(&sequence.yaw_rad),
        ..sample
    }
}

/// A sample at the pose that the one before leads to, by the mean of both motions.
fn moved(last: &OdometrySample, sample: OdometrySample, step_s: f64) -> OdometrySample {
    let mean = |of: fn(&OdometrySample) -> f64| 0.5 * (of(last) + of(&sample));
    let turn_rad = mean(|s| s.yaw_rate_radps) * step_s;
    let (sin, cos) = (last.yaw_rad + 0.5 * turn_rad).sin_cos();
    let (v_x_mps, v_y_mps) = (mean(|s| s.v_x_mps), mean(|s| s.v_y_mps));
    OdometrySample {
        x_m: last.x_m + (v_x_mps * cos - v_y_mps * sin) * step_s,
        y_m: last.y_m + (v_x_mps * sin + v_y_mps * cos) * step_s,
        yaw_rad: last.yaw_rad + turn_rad,
        ..sample
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A quarter circle of radius 10 m at 5 m/s; the first model follows it, the second drives straight on.
    #[test]
    fn poses_begin_at_the_recorded_one_and_follow_the_predicted_motion() {
        const RATE_RADPS: f64 = 0.5;
        let angle = |k: usize| RATE_RADPS * 0.01 * k as f64;
        let channel = |of: &dyn Fn(usize) -> f64| (0..=300).map(|k| of(k) as f32).collect::<Vec<_>>();
        let sequence = StateSequence {
            time_s: channel(&|k| 0.01 * k as f64),
            v_x_mps: channel(&|_| 5.0),
            x_m: channel(&|k| 10.0 * angle(k).sin()),
            y_m: channel(&|k| 10.0 * (1.0 - angle(k).cos())),
            yaw_rad: channel(&angle),
            ..StateSequence::default()
        };
        let predictions: Vec<Prediction> = (0..300)
            .map(|k| Prediction {
                time_s: 0.01 * k as f64 + 0.005,
                begins: k % 50 == 0,
                v_x_mps: 5.0,
                v_y_mps: [0.0; 3],
                yaw_rate_radps: [RATE_RADPS, RATE_RADPS, 0.0],
            })
            .collect();
        let samples = motion(&sequence, [3.0, -2.0], &predictions);
        for (p, [first, second]) in predictions.iter().zip(&samples) {
            let heading = RATE_RADPS * p.time_s;
            let (x_m, y_m) = (3.0 + 10.0 * heading.sin(), -2.0 + 10.0 * (1.0 - heading.cos()));
            assert!((first.x_m - x_m).hypot(first.y_m - y_m) < 1e-3, "{first:?}");
            let since_s = p.time_s % 0.5 - 0.005;
            assert!((second.yaw_rad - (heading - RATE_RADPS * since_s)).abs() < 1e-5, "{second:?}");
            let apart_m = (second.x_m - x_m).hypot(second.y_m - y_m);
            assert!((apart_m - 0.5 * 5.0 * RATE_RADPS * since_s.powi(2)).abs() < 0.02, "{apart_m}");
        }
        let without = motion(&StateSequence::default(), [0.0; 2], &predictions);
        assert!(without.iter().flatten().all(|s| (s.x_m, s.y_m, s.yaw_rad) == (0.0, 0.0, 0.0)));
    }
}
