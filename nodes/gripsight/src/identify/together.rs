//! Several bags of one car.

use anyhow::{Context, bail};
use gripsight_bag::{TopicMap, read_sequences};
use gripsight_identification::{Config, Outcome, ResidualKind, disagreements, identify};
use gripsight_signals::{Joined, StateSequence, WindowConfig};
use gripsight_vehicle::VehicleParameters;

use super::IdentifyArgs;
use crate::invocation::file_name;

/// What several bags cannot be given with.
pub(super) fn check(args: &IdentifyArgs) -> anyhow::Result<()> {
    let for_one = args.window.is_some() || args.sequence.is_some() || args.truth.is_some();
    if args.bags.len() > 1 && for_one {
        bail!("--window, --sequence and --truth are for one bag");
    }
    Ok(())
}

/// All bags as one sequence, and each by itself; `first` is what the first one holds.
pub(super) fn read(
    args: &IdentifyArgs,
    topics: &TopicMap,
    first: Vec<StateSequence>,
) -> anyhow::Result<(Vec<StateSequence>, Vec<StateSequence>)> {
    let whole = WindowConfig { length_s: f64::INFINITY, hop_s: f64::INFINITY };
    let mut alone = first;
    for bag in &args.bags[1..] {
        alone.extend(read_sequences(bag, topics, whole)?.0);
    }
    if alone.len() != args.bags.len() {
        bail!("{} bags hold {} sequences: give bags of odometry, a drive each", args.bags.len(), alone.len());
    }
    let joined = Joined::of(&alone).context("these bags cannot be identified together")?;
    Ok((vec![joined.sequence], alone))
}

/// Says where a bag alone gives something else than all together.
pub(super) fn compare(
    args: &IdentifyArgs,
    alone: &[StateSequence],
    vehicle: &VehicleParameters,
    together: &mut Outcome,
) -> anyhow::Result<()> {
    let config = Config { residual: ResidualKind::None, ..Config::default() };
    let mut outcomes = Vec::new();
    for (sequence, bag) in alone.iter().zip(&args.bags) {
        let outcome = identify(sequence, vehicle, None, None, &config, &mut |_| {})
            .with_context(|| format!("cannot identify the tires from {}", bag.display()))?;
        outcomes.push(outcome);
    }
    for found in disagreements(together, &outcomes) {
        let bag = args.bags.get(found.drive).map(|bag| file_name(bag)).unwrap_or_default();
        together.reasons.push(format!(
            "{bag} alone disagrees: {} force at {:.1} degrees of slip {:+.0} % of the largest, beyond both intervals",
            if found.front { "front" } else { "rear" },
            found.slip_rad.to_degrees(),
            100.0 * found.share
        ));
    }
    Ok(())
}
