//! What reading a bag met, in sentences.

use gripsight_bag::ReadReport;
use gripsight_report::topic_notes;

/// Where the bag ends early, how its topics are, and what was left out of it.
pub(crate) fn read_notes(report: &ReadReport) -> Vec<String> {
    let taken = &report.taken;
    let counted = [
        (
            report.without_content,
            "messages say nothing: joints that are not the four wheels, or not measured",
        ),
        (taken.without_drive, "odometry messages left out: no drive command in force"),
        (taken.duplicates, "messages left out: a stamp seen before"),
        (taken.out_of_order, "messages left out: stamps out of order"),
        (taken.not_finite, "messages left out: NaN or infinite"),
        (taken.clock_jumps, "times the clock was set back: what lies before is a recording of its own"),
    ];
    let counted = counted.into_iter().filter(|(n, _)| *n > 0).map(|(n, what)| format!("{n} {what}"));
    let recorded =
        report.recorded_sequences.iter().map(|topic| format!("state sequences recorded on {topic}"));
    let first = taken.first_problem.iter().map(|problem| format!("first of those left out: {problem}"));
    let unreadable = report.unreadable.iter().map(ToString::to_string);
    let cut = report.truncated.clone().into_iter();
    cut.chain(unreadable)
        .chain(recorded)
        .chain(topic_notes(&report.topics))
        .chain(counted)
        .chain(first)
        .collect()
}
