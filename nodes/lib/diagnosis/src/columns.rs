//! The columns of the joint problem: which parameter stands where.

use std::ops::Range;

use gripsight_model::{BASE, EffectId, ExtendedModel, Flexible, Group, Site};

use crate::engine::Engine;
use crate::infer::FIRST;

/// The columns of the joint problem: tires and hold, then the effects, then the flexible terms.
#[derive(Debug, Clone)]
pub(crate) struct Columns {
    pub(crate) effects: Vec<EffectId>,
    pub(crate) flexible: Flexible,
    effect_columns: Vec<Range<usize>>,
    site_columns: Vec<(Site, Range<usize>)>,
}

impl Columns {
    pub(crate) fn new(effects: Vec<EffectId>, flexible: Flexible) -> Self {
        let mut at = BASE;
        let mut next = |n: usize| {
            at += n;
            at - n..at
        };
        let effect_columns = effects.iter().map(|e| next(e.spec().parameters.len())).collect();
        let site_columns = Site::ALL.into_iter().map(|r| (r, next(Group::of(r).parameters))).collect();
        Self { effects, flexible, effect_columns, site_columns }
    }

    pub(crate) fn len(&self) -> usize {
        self.site_columns.last().map_or(BASE, |(_, r)| r.end)
    }

    pub(crate) fn of_effect(&self, effect: EffectId) -> Option<Range<usize>> {
        let place = self.effects.iter().position(|e| *e == effect)?;
        Some(self.effect_columns[place].clone())
    }

    pub(crate) fn of_site(&self, site: Site) -> Range<usize> {
        let found = self.site_columns.iter().find(|(r, _)| *r == site);
        found.map_or(0..0, |(_, range)| range.clone())
    }

    /// The first flexible column; all after it are flexible.
    pub(crate) fn first_flexible(&self) -> usize {
        self.site_columns.first().map_or(BASE, |(_, r)| r.start)
    }

    /// Place of a flexible column among the terms: each is one of its own, after tires, hold and the effects.
    pub(crate) fn term_of_flexible(&self, column: usize) -> usize {
        FIRST + self.effects.len() + column - self.first_flexible()
    }

    /// Values with every effect absent and no flexible term.
    pub(crate) fn blank(&self, engine: &Engine<'_>) -> Vec<f64> {
        let mut values = engine.nominal_base();
        values.extend(self.effects.iter().flat_map(|e| engine.absent(*e)));
        values.resize(self.len(), 0.0);
        values
    }

    /// The model that has those of the terms that are asked for, with its own values and their columns.
    pub(crate) fn model<'a>(
        &self,
        engine: &Engine<'a>,
        values: &[f64],
        has_effect: impl Fn(EffectId) -> bool,
        sites: &[Site],
    ) -> (ExtendedModel<'a>, Vec<f64>, Vec<usize>) {
        let effects: Vec<EffectId> = self.effects.iter().copied().filter(|e| has_effect(*e)).collect();
        let mut columns: Vec<usize> = (0..BASE).collect();
        columns.extend(effects.iter().filter_map(|e| self.of_effect(*e)).flatten());
        let flexible = (!sites.is_empty()).then(|| self.flexible.with_sites(sites));
        columns.extend(sites.iter().flat_map(|r| self.of_site(*r)));
        let own = columns.iter().map(|&c| values[c]).collect();
        (engine.model(&effects, flexible.as_ref()), own, columns)
    }

    /// The columns in parts of at most `most`: tires first, no effect torn apart.
    pub(crate) fn chunks(&self, most: usize) -> Vec<Range<usize>> {
        let mut out: Vec<Range<usize>> = std::iter::once(0..BASE).collect();
        let mut from = BASE;
        let mut end = BASE;
        for range in &self.effect_columns {
            if range.end - from > most && end > from {
                out.push(from..end);
                from = end;
            }
            end = range.end;
        }
        if end > from {
            out.push(from..end);
        }
        for (_, range) in &self.site_columns {
            let mut at = range.start;
            while at < range.end {
                let to = (at + most).min(range.end);
                out.push(at..to);
                at = to;
            }
        }
        out
    }
}
