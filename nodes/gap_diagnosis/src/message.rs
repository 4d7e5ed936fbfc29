//! A diagnosis as a message: the summary of gap.json.

use gripsight_bag::encode;
use gripsight_diagnosis::{Change, Diagnosis, Place, RankedEffect};
use gripsight_estimation::Estimate;
use gripsight_msgs::standard::std_msgs::Header;
use gripsight_msgs::{
    ExtendedModel, GapChange, GapEffect, GapParameter, GapRegion, GapReport, Handshake, Interval,
    MagicFormula,
};
use gripsight_signals::{DataHealth, StateSequence};

/// Bins of the message at most; the files have all.
const MOST_REGIONS: usize = 12;

/// `since`: the drive compared with the first one, where that is asked for.
pub(crate) fn report(
    diagnosis: &Diagnosis,
    since: Option<&Diagnosis>,
    sequence: &StateSequence,
    vehicle_hash: &str,
    report_directory: String,
) -> GapReport {
    let (gap, tires) = (&diagnosis.gap, &diagnosis.tires);
    let last_ns = sequence.start_stamp_ns + (sequence.duration_s() * 1e9).round() as i64;
    GapReport {
        header: Header { stamp: encode::time(last_ns), frame_id: String::new() },
        handshake: Handshake {
            sequence_id: sequence.sequence_id,
            vehicle_hash: vehicle_hash.to_owned(),
            ..Handshake::default()
        },
        verdict: diagnosis.verdict.name().to_owned(),
        effects: diagnosis.effects.iter().map(effect).collect(),
        changes: since.map_or_else(Vec::new, |d| d.changes.iter().map(change).collect()),
        invisible: diagnosis.invisible.iter().map(|i| i.name.to_owned()).collect(),
        regions: regions(diagnosis),
        gap_nominal: interval(&gap.nominal),
        gap_retuned: interval(&gap.retuned),
        gap_after: interval(&gap.after),
        gap_ceiling: interval(&gap.unstructured_ceiling),
        gap_noise_floor: interval(&gap.noise_floor),
        gap_closed_fraction: interval(&diagnosis.gap_closed_fraction),
        horizon_s: gap.horizon_s,
        front_without_effect: formula(&tires.without_effect.front),
        rear_without_effect: formula(&tires.without_effect.rear),
        front_with_effect: formula(&tires.with_effect.front),
        rear_with_effect: formula(&tires.with_effect.rear),
        data_health: health(&diagnosis.data_health),
        drive_next: diagnosis.drive_next.clone(),
        report_directory,
    }
}

/// What a controller takes of it: the effects that the verdict names.
pub(crate) fn extended_model(diagnosis: &Diagnosis, report: &GapReport) -> ExtendedModel {
    let tires = &diagnosis.extended_model.tires;
    ExtendedModel {
        header: report.header.clone(),
        handshake: report.handshake.clone(),
        verdict: report.verdict.clone(),
        effects: diagnosis.effects.iter().filter(|e| e.accepted).map(effect).collect(),
        front: formula(&tires.front),
        rear: formula(&tires.rear),
    }
}

fn effect(effect: &RankedEffect) -> GapEffect {
    GapEffect {
        name: effect.name.to_owned(),
        accepted: effect.accepted,
        parameters: effect
            .parameters
            .iter()
            .map(|(name, p)| GapParameter {
                name: (*name).to_owned(),
                estimate: Interval { value: p.value, low: p.low, high: p.high },
                unit: p.unit.to_owned(),
            })
            .collect(),
        gap_closed_fraction: interval(&effect.gap_closed_fraction),
        confidence: effect.confidence,
        confused_with: effect.confused_with.iter().map(|&name| name.to_owned()).collect(),
    }
}

fn change(change: &Change) -> GapChange {
    let difference = &change.difference;
    GapChange {
        site: change.site.to_owned(),
        name: change.name.to_owned(),
        parameter: change.parameter.unwrap_or_default().to_owned(),
        at_slip_rad: change.at_slip_rad.unwrap_or(f64::NAN),
        difference: Interval { value: difference.value, low: difference.low, high: difference.high },
        unit: difference.unit.to_owned(),
        probability: change.probability,
    }
}

/// The bins with the largest share of the gap, over all axes.
fn regions(diagnosis: &Diagnosis) -> Vec<GapRegion> {
    let places = &diagnosis.places;
    let axes: [(&str, &[Place]); 9] = [
        ("channel", &places.channel),
        ("axle", &places.axle),
        ("speed", &places.speed),
        ("lateral_acceleration", &places.lateral_acceleration),
        ("slip", &places.slip),
        ("steering_rate", &places.steering_rate),
        ("longitudinal_acceleration", &places.longitudinal_acceleration),
        ("frequency", &places.frequency),
        ("track_position", &places.track_position),
    ];
    let mut all: Vec<(&str, &Place)> =
        axes.iter().flat_map(|(axis, p)| p.iter().map(move |p| (*axis, p))).collect();
    all.sort_by(|a, b| b.1.share.total_cmp(&a.1.share));
    all.truncate(MOST_REGIONS);
    all.into_iter()
        .map(|(axis, p)| GapRegion {
            axis: axis.to_owned(),
            low: p.low,
            high: p.high,
            unit: p.unit.to_owned(),
            channel: p.channel.to_owned(),
            chi2_per_dof: p.chi2_per_dof,
            share: p.share,
        })
        .collect()
}

fn health(health: &DataHealth) -> Vec<String> {
    let gaps = health.gaps.iter().map(|g| format!("no samples from {:.2} s to {:.2} s", g.from_s, g.to_s));
    let frozen = health
        .frozen
        .iter()
        .map(|f| format!("{} stood still from {:.2} s to {:.2} s", f.channel, f.from_s, f.to_s));
    gaps.chain(frozen).collect()
}

fn interval(e: &Estimate) -> Interval {
    Interval { value: e.value, low: e.low, high: e.high }
}

fn formula(f: &gripsight_vehicle::MagicFormula) -> MagicFormula {
    MagicFormula { b: f.b, c: f.c, d: f.d, e: f.e }
}
