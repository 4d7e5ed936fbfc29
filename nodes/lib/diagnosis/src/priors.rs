//! What is known beforehand: bounds and priors of all parameters.

use gripsight_estimation::shooting::{Parameter, Prior};
use gripsight_model::{EffectId, HOLD};

use crate::engine::Engine;

/// Bounds of (B C D, C, D, E).
pub(crate) const TIRE_BOUNDS: [[f64; 2]; 4] = [[1.5, 80.0], [1.0, 2.3], [0.1, 3.0], [-4.0, 0.98]];
/// Effects are expected within this many of their sizes.
const PRIOR_SIZES: f64 = 3.0;
/// Trust in the tires is one observation beside thousands of residuals, but the errors of a model within a window are all alike: so many
/// residuals count as one when they argue against that trust.
const RESIDUALS_PER_OBSERVATION: f64 = 30.0;

impl Engine<'_> {
    /// How much of an effect this car may well have without anything being the matter; `None` of those that are no background.
    pub(crate) fn usual(&self, effect: EffectId) -> Option<f64> {
        if self.holds(effect) {
            return None;
        }
        effect.usual(self.vehicle, self.size(&effect.spec().parameters[0]))
    }

    /// Bounds and priors of all parameters of a model; `values` is where a fit starts.
    pub(crate) fn parameters(
        &self,
        named: &[EffectId],
        effects: &[EffectId],
        values: &[f64],
        ridge: f64,
    ) -> Vec<Parameter> {
        let mean = self.nominal.to_parameters();
        // What is known of a tire argues against errors that are all alike; what only makes the fit well posed is as it is.
        let tighter = |known: bool| if known { RESIDUALS_PER_OBSERVATION.sqrt() } else { 1.0 };
        let mut out: Vec<Parameter> = self
            .trust
            .sigmas(&mean)
            .into_iter()
            .enumerate()
            .map(|(j, (sigma, known))| {
                let [low, high] = TIRE_BOUNDS[j % 4];
                let prior = Some(Prior { mean: mean[j], sigma: sigma / tighter(known) });
                Parameter { start: values[j], low, high, free: true, prior }
            })
            .collect();
        let dt_s = self.recording.dt_s();
        let [mean_s, sigma_s] = self.hold_s();
        // A command that is late is a command, and held until the next; a measured angle is neither.
        let commanded = effects.iter().any(|e| e.spec().of_a_command);
        out.push(Parameter {
            start: if commanded { 0.5 * dt_s } else { values[HOLD] },
            low: 0.0,
            high: 0.5 * dt_s,
            free: !commanded,
            prior: self.recording.steering_is_held().then_some(Prior { mean: mean_s, sigma: sigma_s }),
        });
        for effect in effects {
            let claimed = named.contains(effect);
            let usual = self.usual(*effect).filter(|_| !claimed);
            for (spec, absent) in effect.spec().parameters.iter().zip(self.absent(*effect)) {
                let size = self.size(spec);
                let place = out.len();
                if self.holds(*effect) && !claimed {
                    let start = values[place];
                    out.push(Parameter { start, low: start, high: start, free: false, prior: None });
                    continue;
                }
                if let Some(usual) = usual {
                    out.push(Parameter {
                        start: values[place],
                        low: spec.null + (spec.range[0] * size).max(-usual),
                        high: spec.null + usual,
                        free: true,
                        prior: Some(Prior { mean: absent, sigma: usual }),
                    });
                    continue;
                }
                out.push(Parameter {
                    start: values[place],
                    low: spec.null + spec.range[0] * size,
                    high: spec.null + spec.range[1] * size,
                    free: true,
                    prior: Some(Prior { mean: absent, sigma: PRIOR_SIZES * size }),
                });
            }
        }
        for &start in &values[out.len()..] {
            let prior = Some(Prior { mean: 0.0, sigma: ridge });
            out.push(Parameter { start, low: -1e3, high: 1e3, free: true, prior });
        }
        out
    }
}
