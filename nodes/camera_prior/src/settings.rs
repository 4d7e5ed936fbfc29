//! The node's parameters.

use std::path::{Path, PathBuf};

use anyhow::Context as _;
use gripsight_friction::{
    Basis, Calibration, Embedder, FilterSettings, FrictionError, Look, ModelLimits, Network, OnnxEmbedder,
    OnnxRuntime, Prior, QualityLimits, Settings, TransportLimits, find_embedding, find_library, find_model,
};
use gripsight_runtime::{Descriptor, Node};

use crate::pace::Pace;

/// What the parameters say, files read.
pub(crate) struct Configuration {
    pub(crate) settings: Settings,
    pub(crate) basis: Basis,
    /// The models, or why there are none; none are wanted without an input.
    pub(crate) models: Result<Option<Models>, FrictionError>,
    /// Picture topics to subscribe to: `both`, `raw`, `compressed` or `none`.
    pub(crate) input: String,
    pub(crate) publish_region: bool,
    pub(crate) pace: Pace,
    /// What the track has taught before.
    pub(crate) calibration: Option<Calibration>,
    pub(crate) learning: Learning,
}

/// What reads pictures.
pub(crate) struct Models {
    pub(crate) network: Box<dyn Network>,
    pub(crate) embedder: Box<dyn Embedder>,
}

/// How the node learns from the tires.
pub(crate) struct Learning {
    pub(crate) wanted: bool,
    /// Driving that a set of tires rests on, nanoseconds.
    pub(crate) lesson_ns: i64,
    /// The track's name; empty without one.
    pub(crate) track: String,
    /// Where the track's calibration is kept; none without a track.
    pub(crate) file: Option<PathBuf>,
}

/// Declares the parameters and loads what they name.
pub(crate) fn declare(node: &mut Node) -> anyhow::Result<Configuration> {
    let default = Settings::default();
    let library = path(
        node,
        "onnxruntime_library",
        "ONNX Runtime library; empty: that of ORT_DYLIB_PATH, else searched beside the program and above it",
    )?
    .or_else(|| std::env::var_os("ORT_DYLIB_PATH").filter(|path| !path.is_empty()).map(PathBuf::from));
    let model =
        path(node, "model", "Network, an ONNX file; empty: searched beside the program and above it")?;
    let basis = match path(node, "basis", "Friction basis, a YAML file; empty: the released one")? {
        Some(file) => Basis::read_file(&file)?,
        None => Basis::builtin()?,
    };
    let region = Descriptor::new(
        "Part of the picture that shows road: auto, full, or left,top,right,bottom as shares of width and height",
    );
    let region: Look = node.parameter("region", String::from("auto"), region.read_only())?.get().parse()?;
    let (calibration, learning) = learning(node)?;
    let mut number = |name: &str, value: f64, text: &str, low: f64, high: f64| {
        let descriptor = Descriptor::new(text).range(low..=high).read_only();
        node.parameter(name, value, descriptor).map(|parameter| parameter.get())
    };
    let (transport, quality, doubt, filter) =
        (default.transport, default.quality, default.model, default.filter);
    let settings = Settings {
        region,
        transport: TransportLimits {
            most_age_s: number(
                "most_age_s",
                transport.most_age_s,
                "Age above which a picture is stale [s]",
                0.01,
                1e9,
            )?,
            most_ahead_s: number(
                "most_ahead_s",
                transport.most_ahead_s,
                "How far a stamp may be ahead of the clock [s]",
                0.0,
                1e9,
            )?,
            frozen_after_m: number(
                "frozen_after_m",
                transport.frozen_after_m,
                "Distance driven without a new picture that means a frozen camera [m]",
                0.01,
                1e3,
            )?,
        },
        quality: QualityLimits {
            least_mean: number(
                "least_mean",
                quality.least_mean,
                "Mean luma below which a picture is dark, of 255",
                0.0,
                255.0,
            )?,
            most_dark: number(
                "most_dark",
                quality.most_dark,
                "Share of black pixels above which a picture is dark",
                0.0,
                1.0,
            )?,
            most_saturated: number(
                "most_saturated",
                quality.most_saturated,
                "Share of white pixels above which a picture is over-exposed",
                0.0,
                1.0,
            )?,
            most_noise: number(
                "most_noise",
                quality.most_noise,
                "Noise above which nothing can be read, levels of luma",
                0.0,
                255.0,
            )?,
            least_structure: number(
                "least_structure",
                quality.least_structure,
                "Structure below which a picture is blurred, levels of luma",
                0.0,
                255.0,
            )?,
            ..quality
        },
        model: ModelLimits {
            most_least_probability: number(
                "most_least_probability",
                doubt.most_least_probability,
                "Largest p of the least likely state that is believed",
                0.0,
                1.0,
            )?,
            most_energy: number(
                "most_energy",
                doubt.most_energy,
                "Largest energy of the logits that is believed",
                -1e3,
                1e3,
            )?,
            most_unfamiliarity: number(
                "most_unfamiliarity",
                doubt.most_unfamiliarity,
                "Largest distance from the network's training pictures that is believed",
                0.0,
                1e6,
            )?,
        },
        filter: FilterSettings {
            length_m: number(
                "filter_length_m",
                filter.length_m,
                "Distance over which a picture's weight falls to 1/e [m]",
                0.01,
                1e4,
            )?,
            ..filter
        },
        network_error: number(
            "network_error",
            default.network_error,
            "The least sigma of the network alone: its error on photographs of real roads",
            0.0,
            3.0,
        )?,
        configured: Prior {
            mu: number(
                "configured_mu",
                default.configured.mu,
                "Friction to publish while there is no network",
                0.01,
                3.0,
            )?,
            sigma: number(
                "configured_sigma",
                default.configured.sigma,
                "Its standard deviation",
                0.001,
                3.0,
            )?,
        },
    };
    let least_interval_s = number(
        "least_interval_s",
        0.075,
        "Least time between two pictures that are read: one that comes sooner shows the same road; 0 reads each [s]",
        0.0,
        // Once a second none that was read means that none arrives.
        0.5,
    )?;
    let publish_region =
        Descriptor::new("Publish what the network sees on ~/region/compressed, once a second").read_only();
    let publish_region = node.parameter("publish_region", false, publish_region)?.get();
    let input =
        Descriptor::new("Which picture topics to subscribe to; none publishes the configured friction");
    let input = input.choices(&["both", "raw", "compressed", "none"]).read_only();
    let input = node.parameter("input", String::from("both"), input)?.get();
    let program = std::env::current_exe()?;
    let beside = program.parent().unwrap_or(Path::new("."));
    let models = match input.as_str() {
        "none" => Ok(None),
        _ => models(library.as_deref(), model.as_deref(), beside).map(Some),
    };
    Ok(Configuration {
        settings,
        basis,
        models,
        input,
        publish_region,
        pace: Pace::new(least_interval_s),
        calibration,
        learning,
    })
}

/// What the track has taught before, and how it goes on. A track's own file comes before the one that `calibration` names.
fn learning(node: &mut Node) -> anyhow::Result<(Option<Calibration>, Learning)> {
    let given =
        path(node, "calibration", "What a track has taught, a file of `gripsight friction calibrate`")?;
    let track =
        Descriptor::new("The track's name: what is learned is kept under it; empty: for this run only");
    let track = node.parameter("track", String::new(), track.read_only())?.get();
    let folder = path(
        node,
        "track_folder",
        "Where tracks are kept; empty: gripsight/tracks in XDG_DATA_HOME or ~/.local/share",
    )?;
    let wanted = Descriptor::new("Learn what the floors are worth from the tires").read_only();
    let wanted = node.parameter("learn", true, wanted)?.get();
    let lesson =
        Descriptor::new("Driving that a set of tires rests on, telemetry's window_s [s]").range(1.0..=600.0);
    let lesson_s = node.parameter("lesson_s", 30.0, lesson.read_only())?.get();
    let file = match track.as_str() {
        "" => None,
        name if name.contains(['/', '\\']) || name.starts_with('.') => {
            anyhow::bail!("parameter track: expected a plain name, got {name:?}")
        }
        name => Some(
            folder
                .or_else(usual_folder)
                .context("parameter track_folder: there is no home folder")?
                .join(format!("{name}.json")),
        ),
    };
    let known = file.as_ref().filter(|file| file.is_file()).or(given.as_ref());
    let calibration = known.map(|file| Calibration::read_file(file)).transpose()?;
    Ok((calibration, Learning { wanted, lesson_ns: (lesson_s * 1e9) as i64, track, file }))
}

fn usual_folder() -> Option<PathBuf> {
    let set = |name: &str| std::env::var_os(name).filter(|value| !value.is_empty()).map(PathBuf::from);
    let data = set("XDG_DATA_HOME").or_else(|| set("HOME").map(|home| home.join(".local/share")))?;
    Some(data.join("gripsight/tracks"))
}

fn models(library: Option<&Path>, model: Option<&Path>, beside: &Path) -> Result<Models, FrictionError> {
    let library = find_library(library, beside)?;
    let model = find_model(model, beside)?;
    Ok(Models {
        network: Box::new(OnnxRuntime::load(&library, &model)?),
        embedder: Box::new(OnnxEmbedder::load(&library, &find_embedding(&model, beside)?)?),
    })
}

/// A parameter that names a file; an empty text names none.
fn path(node: &mut Node, name: &str, text: &str) -> anyhow::Result<Option<PathBuf>> {
    let value = node.parameter(name, String::new(), Descriptor::new(text).read_only())?.get();
    Ok((!value.is_empty()).then(|| value.into()))
}
