//! What two drives of a car are linearised with to be compared: one order of columns, the effects asked for, and the earlier drive's model in it.

use gripsight_model::{Channel, EffectId, Need};

use crate::columns::Columns;
use crate::infer::FIRST;
use crate::inferred::Inferred;
use crate::sizes::Sizes;

/// The effects that are other tires, where nobody knows those from before.
pub(crate) fn of_other_tires() -> impl Iterator<Item = EffectId> {
    EffectId::candidates().filter(|e| e.spec().needs.contains(&Need::ReferenceTires))
}

/// What both drives are linearised with.
#[derive(Debug, Clone)]
pub(crate) struct Frame {
    pub(crate) columns: Columns,
    /// The effects that data are asked for.
    pub(crate) library: Vec<EffectId>,
    /// Noise of each channel that is compared, as found in the earlier drive.
    pub(crate) sigma: Vec<f64>,
    /// The earlier drive's model: where it was linearised last, what is left in it, and its sizes.
    pub(crate) values: Vec<f64>,
    pub(crate) chosen: Vec<usize>,
    pub(crate) sizes: Sizes,
}

impl Frame {
    /// The frame of an earlier drive with its `channels`, of which `kept` are compared. Its own tires are what effects of other tires are measured against: of
    /// these it has none, and `considered` says which of them are asked for.
    pub(crate) fn of(
        earlier: &Inferred,
        (channels, kept): (&[Channel], &[Channel]),
        considered: impl Fn(EffectId) -> bool,
    ) -> Self {
        let own = &earlier.columns;
        let more: Vec<EffectId> =
            of_other_tires().filter(|e| !own.effects.contains(e) && considered(*e)).collect();
        let columns = Columns::new([&own.effects[..], &more].concat(), own.flexible.clone());
        let open = own.effects.iter().copied().filter(|e| earlier.is_open(*e));
        let library = open.chain(more.iter().copied()).collect();
        let null: Vec<f64> = more.iter().flat_map(|e| e.spec().parameters.iter().map(|p| p.null)).collect();
        let at = own.first_flexible();
        let wider = |values: &[f64], more: &[f64]| [&values[..at], more, &values[at..]].concat();
        let mut chosen = earlier.chosen.clone();
        let place = FIRST + own.effects.len();
        chosen.splice(place..place, more.iter().map(|_| 0));
        let sizes = Sizes {
            values: wider(&earlier.sizes.values, &null),
            sigma: wider(&earlier.sizes.sigma, &vec![f64::NAN; null.len()]),
            added: earlier.sizes.added.clone(),
        };
        let sigma = channels.iter().zip(&earlier.sigma).filter(|(c, _)| kept.contains(c));
        let sigma = sigma.map(|(_, sigma)| *sigma).collect();
        Self { values: wider(&earlier.values, &null), columns, library, sigma, chosen, sizes }
    }
}
