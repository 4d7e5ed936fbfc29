//! What the report draws: tire curves with their band and the density of the data, and time series.

use gripsight_model::{Rollout, Window};
use gripsight_vehicle::{MagicFormula, PacejkaParameters, SingleTrack};

use crate::direct::Slips;
use crate::envelope::half_width;
use crate::judge::best_starts;
use crate::rollout::{PARAMETERS, TireRollout, tires_of};
use crate::{Identification, PerAxle, TireCurve, Trace};

/// Points of a curve.
const POINTS: usize = 60;
/// They lie closer where the curve bends: at (k/59)^1.5 of its end.
const SPACING: f64 = 1.5;
/// A curve is drawn this much beyond the slips driven, at least to a slip of 0.2 rad.
const BEYOND: f64 = 1.5;
const AT_LEAST_RAD: f64 = 0.2;

/// The curves of both axles.
pub(crate) fn curves(run: &Identification, tires: &PacejkaParameters) -> PerAxle<TireCurve> {
    let (slips, initial, direct) = (&run.direct.slips, &run.initial, &run.direct.tires);
    let half = |axle, direct, offset| move |slips: &[f64]| half_width(run, axle, direct, offset, slips);
    PerAxle {
        front: curve(&tires.front, &initial.front, &slips.front, half(&tires.front, &direct.front, 0)),
        rear: curve(&tires.rear, &initial.rear, &slips.rear, half(&tires.rear, &direct.rear, 4)),
    }
}

fn curve(
    axle: &MagicFormula,
    initial: &MagicFormula,
    slips: &Slips,
    half_width: impl Fn(&[f64]) -> Vec<f64>,
) -> TireCurve {
    let end_rad = (BEYOND * slips.furthest_rad()).max(AT_LEAST_RAD);
    let last = (POINTS - 1) as f64;
    let slip_rad: Vec<f64> = (0..POINTS).map(|k| end_rad * (k as f64 / last).powf(SPACING)).collect();
    let mut density = vec![0; POINTS];
    for slip in &slips.samples_rad {
        let after = slip_rad.partition_point(|&from| from <= slip.abs());
        if let Some(count) = after.checked_sub(1).and_then(|bin| density.get_mut(bin)) {
            *count += 1;
        }
    }
    let half = half_width(&slip_rad);
    let identified: Vec<f64> = slip_rad.iter().map(|&a| axle.normalized_force(a)).collect();
    TireCurve {
        initial: slip_rad.iter().map(|&a| initial.normalized_force(a)).collect(),
        low: identified.iter().zip(&half).map(|(f, h)| f - h).collect(),
        high: identified.iter().zip(&half).map(|(f, h)| f + h).collect(),
        identified,
        density,
        slip_rad,
    }
}

/// Time series over all windows.
pub(crate) fn trace(run: &Identification, before: &[f64; PARAMETERS], after: &[f64; PARAMETERS]) -> Trace {
    let model = TireRollout::new(&run.vehicle, &run.data);
    let windows: Vec<Window> = run.data.windows.iter().map(|(w, _)| *w).collect();
    let noise = run.direct.scatter;
    let (starts_before, starts_after) =
        (best_starts(&model, before, &windows, &noise), best_starts(&model, after, &windows, &noise));
    let car = SingleTrack::new(&run.vehicle, &tires_of(after));
    let mut trace = Trace::default();
    let (mut old, mut new, mut states) = (Vec::new(), Vec::new(), Vec::new());
    for ((window, start_before), start_after) in windows.iter().zip(starts_before).zip(starts_after) {
        model.rollout(before, start_before, window, &mut old);
        model.rollout(after, start_after, window, &mut new);
        states.clear();
        model.trajectory(after, start_after, window, |at| states.push((at.state, at.input)));
        let s = &model.segments[window.segment];
        for (i, k) in (window.from..window.from + window.len).enumerate() {
            let next = (k + 1).min(s.len() - 1);
            let before = k.saturating_sub(1);
            let (front, rear) = car.slip_angles_rad(&states[i].0, &states[i].1);
            trace.time_s.push(s.time_s(k));
            trace.v_x_mps.push(s.v_x_mps[k]);
            trace.a_y_mps2.push(s.v_x_mps[k] * s.yaw_rate_radps[k]);
            trace
                .a_x_mps2
                .push((s.v_x_mps[next] - s.v_x_mps[before]) / ((next - before).max(1) as f64 * s.dt_s));
            trace.x_m.extend(s.x_m.get(k));
            trace.y_m.extend(s.y_m.get(k));
            trace.slip_rad.front.push(front);
            trace.slip_rad.rear.push(rear);
            trace.v_y_mps.push(s.v_y_mps[k]);
            trace.v_y_before_mps.push(old[2 * i]);
            trace.v_y_after_mps.push(new[2 * i]);
            trace.yaw_rate_radps.push(s.yaw_rate_radps[k]);
            trace.yaw_rate_before_radps.push(old[2 * i + 1]);
            trace.yaw_rate_after_radps.push(new[2 * i + 1]);
        }
    }
    trace
}
