//! The part of the command line that ROS 2 owns: what stands between `--ros-args` and `--`.
//!
//! Implemented: `-r/--remap [node:]from:=to` (with `__node`, `__name` and `__ns`),
//! `-p/--param [node:]name:=value`, `--params-file FILE`, `--log-level [logger:=]level`,
//! `--enable-` and `--disable-` `rosout-logs` and `stdout-logs`. Read and passed over, because
//! they mean nothing here: `-e/--enclave`, `--log-config-file`, `--enable-` and
//! `--disable-external-lib-logs`, `--log-file-name`.
//! Source: <https://docs.ros.org/en/jazzy/How-To-Guides/Node-arguments.html>

use crate::Error;

/// A `from:=to` rule.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Remap {
    /// The node that it is for; all when `None`.
    pub(crate) node: Option<String>,
    pub(crate) from: String,
    pub(crate) to: String,
}

/// A `name:=value` parameter.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct ParameterOverride {
    /// The node that it is for; all when `None`.
    pub(crate) node: Option<String>,
    pub(crate) name: String,
    /// The value as YAML text.
    pub(crate) value: String,
}

/// A ROS 2 command line, taken apart.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Args {
    pub(crate) remaps: Vec<Remap>,
    pub(crate) parameters: Vec<ParameterOverride>,
    pub(crate) parameter_files: Vec<String>,
    /// Level of the process, or of one logger by its name.
    pub(crate) log_levels: Vec<(Option<String>, tracing::Level)>,
    pub(crate) to_rosout: bool,
    pub(crate) to_terminal: bool,
}

impl Args {
    /// Takes a command line apart; `arguments` begins with the program's name.
    ///
    /// # Errors
    /// [`Error::Arguments`] for anything that is not a ROS argument: nodes have parameters, no others.
    pub(crate) fn parse(arguments: impl IntoIterator<Item = String>) -> Result<Self, Error> {
        let mut args = Self {
            remaps: Vec::new(),
            parameters: Vec::new(),
            parameter_files: Vec::new(),
            log_levels: Vec::new(),
            to_rosout: true,
            to_terminal: true,
        };
        let mut words = arguments.into_iter().skip(1);
        let mut in_ros_args = false;
        while let Some(word) = words.next() {
            match (in_ros_args, word.as_str()) {
                (_, "--ros-args") => in_ros_args = true,
                (true, "--") => in_ros_args = false,
                (true, flag) => args.ros_argument(flag, &mut words)?,
                (false, _) => {
                    let hint = "settings go through parameters: --ros-args -p name:=value; see --help";
                    return Err(Error::Arguments(format!("unexpected `{word}`; {hint}")));
                }
            }
        }
        Ok(args)
    }

    fn ros_argument(&mut self, flag: &str, words: &mut impl Iterator<Item = String>) -> Result<(), Error> {
        let mut value =
            || words.next().ok_or_else(|| Error::Arguments(format!("`{flag}` is not followed by a value")));
        match flag {
            "-r" | "--remap" => {
                let (node, from, to) = assignment(flag, &value()?)?;
                self.remaps.push(Remap { node, from, to });
            }
            "-p" | "--param" => {
                let (node, name, value) = assignment(flag, &value()?)?;
                self.parameters.push(ParameterOverride { node, name, value });
            }
            "--params-file" => self.parameter_files.push(value()?),
            "--log-level" => self.log_levels.push(log_level(&value()?)?),
            "--enable-rosout-logs" => self.to_rosout = true,
            "--disable-rosout-logs" => self.to_rosout = false,
            "--enable-stdout-logs" => self.to_terminal = true,
            "--disable-stdout-logs" => self.to_terminal = false,
            "-e" | "--enclave" | "--log-config-file" | "--log-file-name" => drop(value()?),
            "--enable-external-lib-logs" | "--disable-external-lib-logs" => {}
            _ => return Err(Error::Arguments(format!("unknown ROS argument `{flag}`"))),
        }
        Ok(())
    }
}

/// Splits `[node:]left:=right`.
fn assignment(flag: &str, text: &str) -> Result<(Option<String>, String, String), Error> {
    let malformed = || Error::Arguments(format!("`{flag} {text}`: expected `[node:]name:=value`"));
    let (left, right) = text.split_once(":=").ok_or_else(malformed)?;
    let (node, name) = match left.split_once(':') {
        Some((node, name)) => (Some(node.to_owned()), name),
        None => (None, left),
    };
    if name.is_empty() || right.is_empty() || node.as_deref() == Some("") {
        return Err(malformed());
    }
    Ok((node, name.to_owned(), right.to_owned()))
}

fn log_level(text: &str) -> Result<(Option<String>, tracing::Level), Error> {
    let (logger, level) = match text.split_once(":=") {
        Some((logger, level)) => (Some(logger.to_owned()), level),
        None => (None, text),
    };
    let level = match level.to_ascii_lowercase().as_str() {
        "debug" => tracing::Level::DEBUG,
        "info" | "unset" => tracing::Level::INFO,
        "warn" => tracing::Level::WARN,
        "error" | "fatal" => tracing::Level::ERROR,
        _ => {
            let expected = "expected debug, info, warn, error or fatal";
            return Err(Error::Arguments(format!("`--log-level {text}`: {expected}")));
        }
    };
    Ok((logger, level))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(line: &str) -> Result<Args, Error> {
        Args::parse(line.split_whitespace().map(str::to_owned))
    }

    #[test]
    fn a_launch_file_s_command_line() {
        let args = parse(
            "node --ros-args -r __node:=left -r __ns:=/car -r odom:=/car_state/odom -p rate:=2.5 \
             -p other:rate:=3 --params-file a.yaml --log-level debug --log-level rustdds:=warn -- --ros-args \
             --disable-rosout-logs",
        )
        .unwrap();
        let remap = |from: &str, to: &str| Remap { node: None, from: from.into(), to: to.into() };
        assert_eq!(
            args.remaps,
            [remap("__node", "left"), remap("__ns", "/car"), remap("odom", "/car_state/odom")]
        );
        assert_eq!(args.parameters[1].node.as_deref(), Some("other"));
        assert_eq!((args.parameters[0].name.as_str(), args.parameters[0].value.as_str()), ("rate", "2.5"));
        assert_eq!(args.parameter_files, ["a.yaml"]);
        assert_eq!(args.log_levels[0], (None, tracing::Level::DEBUG));
        assert_eq!(args.log_levels[1], (Some("rustdds".into()), tracing::Level::WARN));
        assert!(!args.to_rosout && args.to_terminal);
    }

    #[test]
    fn what_is_wrong_is_named() {
        for (line, part) in [
            ("node bag.mcap", "bag.mcap"),
            ("node --ros-args -p", "-p"),
            ("node --ros-args -p rate=2", "rate=2"),
            ("node --ros-args -r :=b", ":=b"),
            ("node --ros-args --log-level loud", "loud"),
            ("node --ros-args --frobnicate", "--frobnicate"),
        ] {
            let message = parse(line).unwrap_err().to_string();
            assert!(message.contains(part), "{line}: {message}");
        }
    }
}
