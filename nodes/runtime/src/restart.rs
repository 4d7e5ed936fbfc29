//! A process that starts itself anew: same program, same arguments, nothing of what it held.
//!
//! In place of an exit code that a launcher would have to know: it works beneath `ros2 run`, `ros2 launch`, a shell and systemd alike.

use std::os::unix::process::CommandExt as _;
use std::process::Command;
use std::time::Duration;

/// Tells the new start how many came before it, each soon after the last.
const VARIABLE: &str = "GRIPSIGHT_STARTED_ANEW";
/// A start that lived longer than this was no failure.
const SOON: Duration = Duration::from_secs(60);
/// Longest pause before a start.
const LONGEST_PAUSE_S: u64 = 30;

/// Replaces this process, which has run for `lived`, by a new start of the same program; what it gives is why that failed.
pub(crate) fn start_anew(lived: Duration) -> std::io::Error {
    let starts = if lived < SOON { starts_before() + 1 } else { 1 };
    let mut arguments = std::env::args_os();
    let called = arguments.next().unwrap_or_default();
    // Where the file has been replaced, this is still the program that runs.
    Command::new("/proc/self/exe").arg0(called).args(arguments).env(VARIABLE, starts.to_string()).exec()
}

/// How long this start waits, so that what made the last ones fail is not met at full speed.
pub(crate) fn pause() -> Duration {
    pause_after(starts_before())
}

fn starts_before() -> u32 {
    std::env::var(VARIABLE).ok().and_then(|text| text.parse().ok()).unwrap_or(0)
}

/// None before the second start in a row, then 1, 2, 4 s and so on.
fn pause_after(starts: u32) -> Duration {
    match starts.checked_sub(2) {
        None => Duration::ZERO,
        Some(doublings) => Duration::from_secs((1 << doublings.min(10)).min(LONGEST_PAUSE_S)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_start_is_at_once_and_the_pauses_are_bounded() {
        let pauses: Vec<u64> = [0, 1, 2, 3, 5, 7, u32::MAX].map(|n| pause_after(n).as_secs()).to_vec();
        assert_eq!(pauses, [0, 0, 1, 2, 8, 30, 30]);
    }
}
