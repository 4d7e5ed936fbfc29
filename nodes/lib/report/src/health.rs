//! What the data are like, in words.

use gripsight_signals::DataHealth;

use crate::text::{fixed, percent, significant};

/// Names and figures.
pub(crate) fn health(health: &DataHealth) -> Vec<(&'static str, String)> {
    let longest_s = health.gaps.iter().map(|g| g.to_s - g.from_s).fold(0.0, f64::max);
    let gaps = match health.gaps.len() {
        0 => "none".to_owned(),
        n => format!("{n}, longest {} s", significant(longest_s, 2)),
    };
    let spans = health.frozen.iter();
    let spans = spans.map(|f| format!("{} {}–{} s", f.channel, fixed(f.from_s, 1), fixed(f.to_s, 1)));
    let frozen = spans.collect::<Vec<_>>().join(", ");
    let rate = significant(health.rate_hz, 3);
    let jitter = significant(1000.0 * health.jitter_s, 2);
    vec![
        ("Samples", format!("{} at {rate} Hz, jitter {jitter} ms", health.samples)),
        ("Duration", format!("{} s, moving {}", fixed(health.duration_s, 1), percent(health.moving_share))),
        ("Pauses", gaps),
        ("Frozen", if frozen.is_empty() { "none".into() } else { frozen }),
        ("Recorded", if health.recorded.is_empty() { "nothing".into() } else { health.recorded.join(", ") }),
    ]
}
