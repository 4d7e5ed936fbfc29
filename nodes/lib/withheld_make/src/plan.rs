//! Which case tests what: proportions, names in turn, and an order that tells nothing.

use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;

use crate::draw;
use crate::label::{Family, Kind};

/// What a case is going to be.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Planned {
    pub(crate) family: Family,
    pub(crate) kind: Kind,
    pub(crate) effects: Vec<&'static str>,
    /// Which of the measured drives.
    pub(crate) source: usize,
}

/// Effects that can be put into a measured drive.
pub(crate) fn injectable() -> Vec<&'static str> {
    gripsight_bag::effect::EFFECTS.iter().map(|kind| kind.name).collect()
}

/// A quarter without effect, a sixth each with an effect outside the library, with the true effect left out and with two, the
/// rest with one.
pub(crate) fn reference(cases: usize, random: &mut ChaCha8Rng) -> Vec<Planned> {
    let (quarter, sixth) = (cases.div_ceil(4), cases.div_ceil(6));
    let counts = [
        (Kind::None, quarter),
        (Kind::OutOfLibrary, sixth),
        (Kind::Deleted, sixth),
        (Kind::Pair, sixth),
        (Kind::Single, cases),
    ];
    planned(Family::Reference, &counts, cases, (&draw::names(true), &draw::names(false)), 1, random)
}

/// The same for drives into which effects are put afterwards; what the library lacks cannot be put in.
pub(crate) fn measured(
    family: Family,
    cases: usize,
    sources: usize,
    random: &mut ChaCha8Rng,
) -> Vec<Planned> {
    let counts = [
        (Kind::None, cases.div_ceil(4)),
        (Kind::Deleted, cases.div_ceil(6)),
        (Kind::Pair, cases.div_ceil(6)),
        (Kind::Single, cases),
    ];
    planned(family, &counts, cases, (&injectable(), &[]), sources, random)
}

/// Comparisons: half of them of a car that nothing was done to, so that false alarms show; of the rest a fifth with two effects, else one.
pub(crate) fn compared(
    family: Family,
    cases: usize,
    names: &[&'static str],
    sources: usize,
    random: &mut ChaCha8Rng,
) -> Vec<Planned> {
    let counts = [(Kind::None, cases.div_ceil(2)), (Kind::Pair, cases / 10), (Kind::Single, cases)];
    planned(family, &counts, cases, (names, &[]), sources, random)
}

/// Pairs of simulator and car: half unchanged, a tenth with a structure that the simulator lacks, a tenth with two changes, the rest
/// with one; `simulators` in turn.
pub(crate) fn pairs(cases: usize, simulators: usize, random: &mut ChaCha8Rng) -> Vec<Planned> {
    let tenth = cases.div_ceil(10);
    let counts = [
        (Kind::None, cases.div_ceil(2)),
        (Kind::OutOfLibrary, tenth),
        (Kind::Pair, tenth),
        (Kind::Single, cases),
    ];
    let mut out = Vec::with_capacity(cases);
    for (kind, count) in counts {
        for turn in 0..count.min(cases - out.len()) {
            let source = turn % simulators.max(1);
            out.push(Planned { family: Family::Simulator, kind, effects: Vec::new(), source });
        }
    }
    out.shuffle(random);
    out
}

fn planned(
    family: Family,
    counts: &[(Kind, usize)],
    cases: usize,
    (inside, outside): (&[&'static str], &[&'static str]),
    sources: usize,
    random: &mut ChaCha8Rng,
) -> Vec<Planned> {
    let mut out = Vec::with_capacity(cases);
    for &(kind, count) in counts {
        let mut names = if kind == Kind::OutOfLibrary { outside.to_vec() } else { inside.to_vec() };
        names.shuffle(random);
        let mut turn = names.iter().cycle();
        for _ in 0..count.min(cases - out.len()) {
            let effects = match kind {
                Kind::None => Vec::new(),
                Kind::Pair => draw::pair(&names, random),
                _ => turn.next().copied().into_iter().collect(),
            };
            out.push(Planned { family, kind, effects, source: 0 });
        }
    }
    out.shuffle(random);
    for (place, case) in out.iter_mut().enumerate() {
        case.source = place % sources.max(1);
    }
    out
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;

    use super::*;

    #[test]
    fn a_full_batch_has_what_it_must_have() {
        let plan = reference(600, &mut ChaCha8Rng::seed_from_u64(1));
        let count = |kind| plan.iter().filter(|p| p.kind == kind).count();
        assert_eq!(Kind::ALL.map(count), [150, 150, 100, 100, 100]);
        let singles = |name| plan.iter().filter(|p| p.kind == Kind::Single && p.effects == [name]).count();
        assert!(draw::names(true).into_iter().all(|name| (4..=5).contains(&singles(name))));
        assert!(plan.iter().all(
            |p| p.effects.len() == usize::from(p.kind != Kind::None) + usize::from(p.kind == Kind::Pair)
        ));
    }

    #[test]
    fn half_of_the_comparisons_are_of_an_unchanged_car() {
        let plan = compared(Family::Recorded, 40, &injectable(), 4, &mut ChaCha8Rng::seed_from_u64(1));
        let count = |kind| plan.iter().filter(|p| p.kind == kind).count();
        assert_eq!(Kind::ALL.map(count), [20, 16, 4, 0, 0]);
        assert!((0..4).all(|s| plan.iter().filter(|p| p.source == s).count() == 10));
    }

    #[test]
    fn half_of_the_pairs_are_unchanged_and_every_simulator_has_its_share() {
        let plan = pairs(300, 6, &mut ChaCha8Rng::seed_from_u64(1));
        let count = |kind| plan.iter().filter(|p| p.kind == kind).count();
        assert_eq!(Kind::ALL.map(count), [150, 90, 30, 30, 0]);
        assert!((0..6).all(|s| plan.iter().filter(|p| p.source == s).count() == 50));
    }

    #[test]
    fn small_batches_are_whole() {
        for cases in 0..20 {
            assert_eq!(reference(cases, &mut ChaCha8Rng::seed_from_u64(1)).len(), cases);
            assert_eq!(pairs(cases, 6, &mut ChaCha8Rng::seed_from_u64(1)).len(), cases);
        }
    }
}
