//! The gap as bars: from the model as it came down to the noise.

use gripsight_diagnosis::Diagnosis;
use gripsight_estimation::Estimate;
use maud::{Markup, html};

use super::words::{channel_unit, figure, words};
use crate::Role;
use crate::bars::{Bar, bars, logarithmic};
use crate::text::significant;

/// A bar from nothing.
fn total(name: &str, role: Role, e: &Estimate) -> Bar {
    Bar {
        name: name.into(),
        role,
        from: 0.0,
        to: e.value,
        interval: (e.low < e.high && (e.high - e.low).is_finite()).then_some((e.low, e.high)),
        value: figure(e),
    }
}

/// A bar from one model's error to the next one's.
fn step(name: &str, role: Role, from: f64, e: &Estimate) -> Bar {
    let change = e.value - from;
    let sign = if change > 0.0 { "+" } else { "" };
    let value = format!("{sign}{} to {}", significant(change, 3), figure(e));
    Bar { from, value, ..total(name, role, e) }
}

/// How the gap is made up: every step with the error that it leaves.
pub(super) fn budget(d: &Diagnosis) -> Markup {
    let g = &d.gap;
    let mut rows = vec![
        total("Model as it came", Role::Nominal, &g.nominal),
        step("other tires", Role::Identified, g.nominal.value, &g.retuned),
    ];
    let mut from = g.retuned.value;
    for s in &g.steps {
        rows.push(step(&words(s.effect), Role::Identified, from, &s.error));
        from = s.error.value;
    }
    rows.push(Bar {
        interval: None,
        value: significant(from - g.noise_floor.value, 3),
        ..step("unexplained rest", Role::Nominal, from, &g.noise_floor)
    });
    rows.push(step("flexible terms (ceiling)", Role::Nominal, from, &g.unstructured_ceiling));
    if g.s4_residual.value.is_finite() {
        rows.push(step("S4 residual, beside tires", Role::Nominal, g.retuned.value, &g.s4_residual));
    }
    rows.push(total("Noise", Role::Measured, &g.noise_floor));
    html! {
        (bars(&rows))
        p {
            @if logarithmic(&rows) { "Bars by the logarithm, from the smallest end on. " }
            "Mean squared error of open-loop rollouts of " (significant(g.horizon_s, 2)) " s on " (g.scored_on)
            ", each channel over its noise (" (noise(d)) "). A bar goes from the error before a step to that after it; figures: the change, the "
            "error after it, its 90 % interval by block bootstrap (the thin line). Blue: tires and the effects named, one after the other. "
            "Grey, without a name: flexible terms without any physics on top of them (less than that no effect can be expected to leave)"
            @if g.s4_residual.value.is_finite() { ", and a residual network on top of the other tires alone" }
            "."
        }
    }
}

/// The noise of each channel.
fn noise(d: &Diagnosis) -> String {
    d.gap
        .channel_noise
        .iter()
        .map(|(name, sigma)| format!("{} {}{}", words(name), significant(*sigma, 2), channel_unit(name)))
        .collect::<Vec<_>>()
        .join(", ")
}
