//! `gripsight bag`: looks into bags, rewrites damaged ones, and injects known effects.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use anyhow::Context as _;
use clap::{Args, Subcommand};
use gripsight_bag::effect::{EFFECTS, Effect};
use gripsight_bag::{BagInfo, ReadReport, Role, TopicMap, Usable};
use gripsight_signals::{Checks, DataHealth, Finding};

use crate::Outcome;
use crate::notes::read_notes;

/// Look into a bag, rewrite a damaged one, or inject a known effect.
#[derive(Debug, Args)]
pub(crate) struct BagArgs {
    #[command(subcommand)]
    command: BagCommand,
}

#[derive(Debug, Subcommand)]
enum BagCommand {
    /// Show topics, rates, gaps, and what the suite would use of a bag; propose a topics file for it.
    #[command(after_help = TOPICS_HELP)]
    Info {
        /// An .mcap or .db3 file or a rosbag2 folder.
        bag: PathBuf,
        /// A file that says which topic and field carries which signal; without it topics are found by type.
        #[arg(long, value_name = "FILE", conflicts_with = "write_topics")]
        topics: Option<PathBuf>,
        /// Propose where each signal is to be taken from, and write that topics file; what is guessed says so in it.
        #[arg(long, value_name = "FILE")]
        write_topics: Option<PathBuf>,
        /// Print JSON.
        #[arg(long)]
        json: bool,
    },
    /// Rewrite a cut-off or damaged bag up to its last whole message.
    Recover {
        /// An .mcap or .db3 file or a rosbag2 folder.
        bag: PathBuf,
        /// The bag to write; <stem>.recovered.mcap beside BAG by default.
        #[arg(long, value_name = "BAG")]
        out: Option<PathBuf>,
    },
    /// Write a recorded bag as it would be with a known sensor or actuator effect; everything else in it stays.
    #[command(after_help = effects_help())]
    Inject {
        /// An .mcap or .db3 file or a rosbag2 folder.
        bag: PathBuf,
        /// An effect: NAME=VALUE, or NAME=PARAMETER:VALUE,PARAMETER:VALUE. May be repeated; applied in this order.
        #[arg(long = "effect", value_name = "NAME=VALUE", required = true)]
        effects: Vec<Effect>,
        /// A file that maps names to topics.
        #[arg(long, value_name = "FILE")]
        topics: Option<PathBuf>,
        /// The bag to write.
        #[arg(long, value_name = "BAG")]
        out: PathBuf,
    },
}

const TOPICS_HELP: &str = "\
Examples:
  gripsight bag info drive.db3
  gripsight bag info drive.db3 --write-topics topics.yaml
  gripsight identify drive.db3 --topics topics.yaml --vehicle car.yaml --out result

A topics file names a stream's topic, or any field of any message for a signal:
  odom: /car_state/odom
  v_x: {topic: /sensors/core, field: state.speed, gain: 4614.0}
  steering: {topic: /commands/servo/position, field: data, gain: -1.2135, offset: 0.5304}
  a_y: {topic: /sensors/imu, field: linear_acceleration.y, unit: g, sign: -1}
  measured_steering: {topic: /steering, field: angle, unit: deg, stamp: log}
  wheel_speed_fl: {topic: /joint_states, field: 'velocity[wheel_fl]'}
value = sign * unit * (number - offset) / gain: gain and offset are those by which the stack makes the number.
stamp: header (where there is one), log, or a field that is a time. An empty topic ('') leaves a signal out.";

fn effects_help() -> String {
    let list: Vec<String> =
        EFFECTS.iter().map(|kind| format!("  {:<18} {}", kind.name, kind.parameters.join(", "))).collect();
    format!("Effects and their parameters:\n{}", list.join("\n"))
}

pub(crate) fn run(args: &BagArgs) -> anyhow::Result<Outcome> {
    match &args.command {
        BagCommand::Info { bag, topics, write_topics, json } => {
            let map = match write_topics {
                Some(file) => write_proposal(bag, file)?,
                None => topic_map(topics.as_deref())?,
            };
            let info = gripsight_bag::info(bag, &map)?;
            if *json {
                println!("{}", serde_json::to_string_pretty(&info)?);
            } else {
                print!("{}", table(bag, &info));
            }
        }
        BagCommand::Recover { bag, out } => {
            let out = out.clone().unwrap_or_else(|| bag.with_extension("recovered.mcap"));
            let recovered = gripsight_bag::recover(bag, &out)?;
            for damage in &recovered.damage {
                tracing::warn!("{damage}");
            }
            println!("{}: {} messages", out.display(), recovered.messages);
        }
        BagCommand::Inject { bag, effects, topics, out } => {
            let changed = gripsight_bag::inject(bag, &topic_map(topics.as_deref())?, effects, out)?;
            println!("{}: {changed} messages changed", out.display());
        }
    }
    Ok(Outcome::Done)
}

fn topic_map(file: Option<&Path>) -> anyhow::Result<TopicMap> {
    Ok(file.map(TopicMap::read).transpose()?.unwrap_or_default())
}

/// Writes the topics file proposed for a bag; gives it for what follows.
fn write_proposal(bag: &Path, file: &Path) -> anyhow::Result<TopicMap> {
    anyhow::ensure!(
        !file.exists(),
        "{}: it is there already, and topics files are not overwritten",
        file.display()
    );
    let proposal = gripsight_bag::propose(bag)?;
    std::fs::write(file, &proposal.text).with_context(|| format!("cannot write {}", file.display()))?;
    match &proposal.problem {
        None => tracing::info!("{}: written; check the lines marked (?)", file.display()),
        Some(problem) => tracing::warn!("{}: written, and it does not do yet: {problem}", file.display()),
    }
    Ok(proposal.topics)
}

/// What `info` prints for people.
fn table(bag: &Path, info: &BagInfo) -> String {
    let mut text = format!(
        "{}: {:.2} MB, {:.1} s, {} messages\n",
        bag.display(),
        info.size_bytes as f64 * 1e-6,
        info.duration_s,
        info.messages
    );
    text.extend(info.damage.iter().map(|damage| format!("damaged: {damage}\n")));
    let width =
        |f: fn(&gripsight_bag::TopicInfo) -> usize| info.topics.iter().map(f).max().unwrap_or(0).max(5);
    let (names, types) = (width(|t| t.name.len()), width(|t| t.type_name.len()));
    let _ = writeln!(
        text,
        "\n{:names$}  {:types$}  {:>8}  {:>8}  {:>5}  {:>14}",
        "topic", "type", "messages", "rate Hz", "gaps", "longest step s"
    );
    for t in &info.topics {
        let _ = writeln!(
            text,
            "{:names$}  {:types$}  {:>8}  {:>8.2}  {:>5}  {:>14.3}",
            t.name, t.type_name, t.messages, t.pace.rate_hz, t.pace.gaps, t.pace.longest_step_s
        );
    }
    match &info.telemetry {
        Usable::Nothing(why) => {
            let _ = writeln!(text, "\nnot usable for identification: {why}");
        }
        Usable::Sequences { report, health, checks } => {
            text.push_str(&usable(report));
            text.extend(health.iter().map(health_lines));
            text.extend(checks.iter().map(check_lines));
        }
    }
    text
}

fn usable(report: &ReadReport) -> String {
    if let Some(topic) = &report.recorded_sequences {
        return format!("\nused: the state sequences recorded on {topic}\n");
    }
    let mut text = "\nused as\n".to_owned();
    let mapped = report.streams.mapped();
    for role in Role::ALL {
        match report.streams.topic(role) {
            Some(topic) => {
                let _ = writeln!(text, "  {:7} {topic}", role.name());
            }
            None if mapped.is_empty() => {
                let _ = writeln!(text, "  {:7} not recorded", role.name());
            }
            None => {}
        }
    }
    for (topic, (signal, field)) in mapped.iter().flat_map(|m| m.signals.iter().map(move |s| (&m.topic, s))) {
        let _ = writeln!(text, "  {:20} {topic}: {field}", signal.name());
    }
    text.extend(read_notes(report).iter().map(|note| format!("  {note}\n")));
    text
}

/// What the signals say of each other.
fn check_lines(checks: &Checks) -> String {
    let mut text = String::new();
    let agreeing = checks.checks.iter().filter(|c| c.finding == Finding::Agrees).count();
    let _ = writeln!(text, "  {agreeing} of {} comparisons of signals agree", checks.checks.len());
    for check in checks.disagreeing() {
        let _ = writeln!(text, "  {check}");
    }
    for u in &checks.unchecked {
        let _ = writeln!(text, "  nothing checks {} of {}; it needs {}", u.property, u.signal, u.needs);
    }
    text
}

fn health_lines(health: &DataHealth) -> String {
    let mut text = format!(
        "\n{} samples over {:.1} s at {:.2} Hz, jitter {:.1} ms, moving {:.0} % of the time\n  channels: {}\n",
        health.samples,
        health.duration_s,
        health.rate_hz,
        1e3 * health.jitter_s,
        100.0 * health.moving_share,
        if health.recorded.is_empty() { "none".to_owned() } else { health.recorded.join(", ") }
    );
    for gap in &health.gaps {
        let _ = writeln!(text, "  gap from {:.2} s to {:.2} s", gap.from_s, gap.to_s);
    }
    for span in &health.frozen {
        let _ =
            writeln!(text, "  {} stands still from {:.2} s to {:.2} s", span.channel, span.from_s, span.to_s);
    }
    text
}
