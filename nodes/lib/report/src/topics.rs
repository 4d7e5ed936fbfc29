//! Topics: how their messages are, what a diagnosis uses them for, and what it could not see without them.

use gripsight_model::{EffectId, Need};
use gripsight_signals::TopicHealth;
use maud::{Markup, html};
use serde::Serialize;

use crate::text::{percent, significant};

/// From these on it is worth a word: share of the messages lost, longest pause, jitter over the step, delay from stamp to log, and rate over the
/// odometry's below which the steering is known too seldom.
const LOST: f64 = 0.01;
const LONG_S: f64 = 0.5;
const JITTER: f64 = 0.3;
const DELAY_S: f64 = 0.1;
const SELDOM: f64 = 0.5;

/// A topic as gap.json has it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TopicUse<'a> {
    /// How its messages are.
    #[serde(flatten)]
    pub health: &'a TopicHealth,
    /// What a diagnosis takes from it.
    pub used_for: &'static str,
    /// Effects that no diagnosis can see without it, by name; of a stream that is needed, those that rest on its optional fields.
    pub invisible_without: Vec<&'static str>,
}

/// The topics with what they are used for.
#[must_use]
pub fn topic_uses(topics: &[TopicHealth]) -> Vec<TopicUse<'_>> {
    topics
        .iter()
        .map(|health| {
            let (used_for, need) = match health.stream {
                "odom" => (
                    "speed, v_y and yaw rate, which are explained, and the clock; pose: heading and laps",
                    Some(Need::Passes),
                ),
                "drive" => (
                    "steering, the model's input; acceleration where commanded",
                    Some(Need::LongitudinalCommand),
                ),
                "imu" => ("accelerations and gyroscope, which are explained", Some(Need::Accelerometer)),
                _ => ("nothing in a diagnosis; identification uses it", None),
            };
            let needing =
                EffectId::candidates().filter(|e| need.is_some_and(|need| e.spec().needs.contains(&need)));
            TopicUse { health, used_for, invisible_without: needing.map(|e| e.name()).collect() }
        })
        .collect()
}

/// What is the matter with the topics, a sentence each.
#[must_use]
pub fn topic_notes(topics: &[TopicHealth]) -> Vec<String> {
    let clock_hz = topics.iter().find(|t| t.stream == "odom").map_or(0.0, |t| t.pace.rate_hz);
    topics
        .iter()
        .filter_map(|t| Some((t, t.topic.as_ref()?)))
        .filter_map(|(t, topic)| note(t, clock_hz).map(|what| format!("{topic}: {what}")))
        .collect()
}

fn note(t: &TopicHealth, clock_hz: f64) -> Option<String> {
    let pace = &t.pace;
    let mut said = Vec::new();
    if t.messages == 0 {
        said.push("no message says anything".to_owned());
    }
    if t.stream == "drive" && pace.rate_hz < SELDOM * clock_hz {
        said.push(format!(
            "{} Hz beside odometry at {} Hz: each command is held until the next",
            significant(pace.rate_hz, 3),
            significant(clock_hz, 3)
        ));
    }
    if pace.lost_share > LOST || pace.longest_step_s > LONG_S {
        said.push(format!(
            "{} gaps, longest {} s, {} of the messages lost",
            pace.gaps,
            significant(pace.longest_step_s, 2),
            percent(pace.lost_share)
        ));
    }
    if pace.jitter_s * pace.rate_hz > JITTER {
        said.push(format!("jitter {} ms", significant(1e3 * pace.jitter_s, 2)));
    }
    match t.delay_s {
        Some(delay_s) if delay_s > DELAY_S => {
            said.push(format!("logged {} s after its stamps", significant(delay_s, 2)));
        }
        Some(delay_s) if delay_s < -DELAY_S => {
            said.push(format!(
                "stamped {} s after it was logged: the clocks differ",
                significant(-delay_s, 2)
            ));
        }
        _ => {}
    }
    for s in &t.spikes {
        said.push(format!(
            "{} single {} of {} out by up to {} (first at {} s)",
            s.count,
            if s.count == 1 { "sample" } else { "samples" },
            s.channel,
            significant(s.largest, 2),
            significant(s.first_s, 3)
        ));
    }
    (!said.is_empty()).then(|| said.join("; "))
}

/// The table of a page.
pub(crate) fn table(topics: &[TopicHealth]) -> Markup {
    let milliseconds = |s: f64| significant(1e3 * s, 2);
    html! {
        table.topics {
            thead {
                tr {
                    th { "Topic" } th { "Messages" } th { "Hz" } th { "Jitter / ms" } th { "Longest step / s" } th { "Lost" } th { "Delay / ms" }
                    th { "Spikes" } th { "Used for" } th { "Invisible without it" }
                }
            }
            tbody {
                @for TopicUse { health: t, used_for, invisible_without } in topic_uses(topics) {
                    tr {
                        td { (t.topic.as_deref().unwrap_or(t.stream)) br; small { (t.type_name) } }
                        @if t.messages > 0 {
                            td { (t.messages) }
                            td { (significant(t.pace.rate_hz, 3)) }
                            td { (milliseconds(t.pace.jitter_s)) }
                            td { (significant(t.pace.longest_step_s, 2)) }
                            td { (percent(t.pace.lost_share)) }
                            td { (t.delay_s.map_or_else(String::new, milliseconds)) }
                            td { (t.spikes.iter().map(|s| s.count).sum::<usize>()) }
                        } @else {
                            td colspan="7" { (if t.topic.is_some() { "says nothing" } else { "not recorded" }) }
                        }
                        td { (used_for) }
                        td { (invisible(t, &invisible_without)) }
                    }
                }
            }
        }
    }
}

fn invisible(t: &TopicHealth, effects: &[&str]) -> String {
    let effects: Vec<String> = effects.iter().map(|name| name.replace('_', " ")).collect();
    let effects = effects.join(", ");
    match t.stream {
        "odom" => format!("everything; without a pose over laps: {effects}"),
        "drive" => format!("everything; without an acceleration: {effects}"),
        _ if effects.is_empty() => "nothing".to_owned(),
        _ => effects,
    }
}
