//! The command and its data as files record them.

use std::path::Path;

/// The command line, fit for a shell, with the output folder left open: where results lie does not belong to them.
pub(crate) fn invocation(arguments: impl IntoIterator<Item = String>) -> String {
    let mut words = vec!["gripsight".to_owned()];
    let mut folder_follows = false;
    for argument in arguments.into_iter().skip(1) {
        words.push(if folder_follows {
            "DIR".to_owned()
        } else if argument.starts_with("--out=") {
            "--out=DIR".to_owned()
        } else {
            quoted(&argument)
        });
        folder_follows = argument == "--out";
    }
    words.join(" ")
}

/// The data's name without the folder it lies in.
pub(crate) fn file_name(path: &Path) -> String {
    path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned()
}

fn quoted(word: &str) -> String {
    let plain = |c: char| c.is_alphanumeric() || "-_./=:,+%@".contains(c);
    if !word.is_empty() && word.chars().all(plain) {
        word.to_owned()
    } else {
        format!("'{}'", word.replace('\'', "'\\''"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_output_folder_is_left_open_and_odd_words_are_quoted() {
        let words = ["/bin/gripsight", "identify", "my bag.mcap", "--out", "/a/b", "--seed", "3", "it's"];
        let line = invocation(words.map(str::to_owned));
        assert_eq!(line, r"gripsight identify 'my bag.mcap' --out DIR --seed 3 'it'\''s'");
        assert_eq!(invocation(["x", "--out=/a"].map(str::to_owned)), "gripsight --out=DIR");
    }
}
