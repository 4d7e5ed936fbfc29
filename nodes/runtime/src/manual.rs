//! A node's README against the states that its diagnostics can report, for the tests of nodes.

use crate::diagnostics::{Level, Status};

/// The heading of the section.
const SECTION: &str = "## Diagnostics";
/// Stands for any text in a row's message.
const ANY: &str = "...";

/// Compares the table of the section "Diagnostics" of a node's README (level, message between backquotes with `...` for what varies, when) with
/// `states`, which shall be all that the node can report.
///
/// # Errors
/// A sentence that names the first state above OK without a row of its level, or the first row that no state fits.
pub fn manual_covers(manual: &str, states: &[Status]) -> Result<(), String> {
    let rows = rows(manual)?;
    let fits = |(level, message): &(Level, &str), state: &Status| {
        *level == state.level && matches(message, &state.message)
    };
    for state in states.iter().filter(|state| state.level > Level::Ok) {
        if !rows.iter().any(|row| fits(row, state)) {
            return Err(format!("{:?} `{}` has no row in the manual", state.level, state.message));
        }
    }
    match rows.iter().find(|row| !states.iter().any(|state| fits(row, state))) {
        Some((level, message)) => Err(format!("the manual's {level:?} `{message}` is no state of the node")),
        None => Ok(()),
    }
}

/// Level and message of each row.
fn rows(manual: &str) -> Result<Vec<(Level, &str)>, String> {
    let (_, section) = manual.split_once(SECTION).ok_or(format!("the manual has no section `{SECTION}`"))?;
    let section = section.split("\n## ").next().unwrap_or_default();
    Ok(section.lines().filter_map(row).collect())
}

fn row(line: &str) -> Option<(Level, &str)> {
    let mut cells = line.strip_prefix('|')?.split('|').map(str::trim);
    let level = match cells.next()? {
        "ERROR" => Level::Error,
        "WARN" => Level::Warn,
        _ => return None,
    };
    Some((level, cells.next()?.trim_matches('`')))
}

fn matches(pattern: &str, text: &str) -> bool {
    let mut parts = pattern.split(ANY);
    let Some(mut rest) = parts.next().and_then(|first| text.strip_prefix(first)) else { return false };
    let mut is_open = false;
    for part in parts {
        is_open = true;
        match rest.find(part) {
            Some(at) => rest = &rest[at + part.len()..],
            None => return false,
        }
        if !part.is_empty() {
            is_open = false;
        }
    }
    is_open || rest.is_empty()
}

#[cfg(test)]
mod tests {
    use super::*;

    const MANUAL: &str = "# a\n\n## Diagnostics\n| level | message | when |\n| --- | --- | --- |\n\
                          | ERROR | `no run: ...` | always |\n| WARN | `late by ... s` | often |\n\n## More\n| WARN | `x` | |\n";

    #[test]
    fn states_and_rows_are_compared_both_ways() {
        let states = |texts: &[(Level, &str)]| -> Vec<Status> {
            texts.iter().map(|(level, text)| Status::new(*level, *text)).collect()
        };
        let all = [(Level::Error, "no run: x"), (Level::Warn, "late by 3 s"), (Level::Ok, "fine")];
        assert_eq!(manual_covers(MANUAL, &states(&all)), Ok(()));
        let missing = manual_covers(MANUAL, &states(&[all[0], all[1], (Level::Warn, "no run: x")]));
        assert!(missing.unwrap_err().contains("has no row"));
        let stale = manual_covers(MANUAL, &states(&all[..1]));
        assert!(stale.unwrap_err().contains("late by ... s"));
        assert!(manual_covers("# a", &[]).is_err());
    }

    #[test]
    fn what_varies_is_anything() {
        assert!(matches("a ... b", "a 1 2 b") && matches("a: ...", "a: ") && matches("a", "a"));
        assert!(!matches("a", "ab") && !matches("a ... b", "a 1 b c") && !matches("a: ...", "b: c"));
    }
}
