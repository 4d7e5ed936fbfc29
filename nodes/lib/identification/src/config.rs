//! Settings of a run.

use gripsight_s4::{Architecture, NetworkConfig, TrainingConfig};
use gripsight_vehicle::{MagicFormula, PacejkaParameters};
use serde::{Deserialize, Serialize};

/// How tires are found.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Method {
    /// The paper's procedure: one-step residuals, sweep at the mean speed, steady-state forces, Nelder-Mead from the initial tires.
    Paper,
    /// Direct shooting fit, then the residual loop with inverse dynamics; whichever predicts held-out data better.
    #[default]
    Robust,
}

/// Which network learns the residual.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ResidualKind {
    /// S4D, the paper's.
    #[default]
    S4,
    /// Multilayer perceptron, no memory.
    Mlp,
    /// Elman recurrence.
    Rnn,
    /// No residual: the nominal model alone.
    None,
}

impl ResidualKind {
    /// The network's family; `None` without a network.
    #[must_use]
    pub fn architecture(self) -> Option<Architecture> {
        match self {
            Self::S4 => Some(Architecture::S4),
            Self::Mlp => Some(Architecture::Mlp),
            Self::Rnn => Some(Architecture::Rnn),
            Self::None => None,
        }
    }

    /// Its name on topics and on the command line.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::S4 => "s4",
            Self::Mlp => "mlp",
            Self::Rnn => "rnn",
            Self::None => "none",
        }
    }

    /// The inverse of [`Self::name`].
    #[must_use]
    pub fn from_name(name: &str) -> Option<Self> {
        [Self::S4, Self::Mlp, Self::Rnn, Self::None].into_iter().find(|kind| kind.name() == name)
    }
}

/// Settings of a run. [`Config::default`] is what the product runs with.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Config {
    /// Goes into every [`RunKey`](crate::RunKey); no result depends on it.
    pub run_id: String,
    /// How tires are found.
    pub method: Method,
    /// Which network learns the residual.
    pub residual: ResidualKind,
    /// Seed of everything random.
    pub seed: u64,
    /// Tires that a run starts from, unless a previous set or a friction prior replaces them. The paper's method makes them stiffer where they are less
    /// than half as stiff as the direct fit's.
    pub initial: PacejkaParameters,
    /// Turns of the outer loop at most.
    pub max_iterations: u32,
    /// Converged when a turn changes the tire curves by less than this share of their peak, anywhere within the slips driven. The paper's method
    /// does not go below 5 %, see [`Self::settled_below`].
    pub tolerance: f64,
    /// Width of the residual network.
    pub d_model: usize,
    /// States per channel, S4 only.
    pub d_state: usize,
    /// Hidden layers of the residual network.
    pub layers: usize,
    /// Epochs of training at most, each turn; `None`: as many as the method is best with, see [`Self::epochs_at_most`].
    pub epochs: Option<usize>,
    /// Whether the robust method starts from the direct fit (else from `initial`, as the paper does).
    pub direct_start: bool,
}

impl Default for Config {
    fn default() -> Self {
        // C and E of a usual car tire; D = 0.51 is the paper's mismatched start; the stiffness is that of a soft tire.
        let axle = MagicFormula::from_stiffness(6.0, 1.4, 0.51, 0.0);
        Self {
            run_id: String::new(),
            method: Method::Robust,
            residual: ResidualKind::S4,
            seed: 0,
            initial: PacejkaParameters { front: axle, rear: axle },
            max_iterations: 6,
            tolerance: 0.02,
            d_model: 16,
            d_state: 16,
            layers: 1,
            epochs: None,
            direct_start: true,
        }
    }
}

/// The paper's loop does not settle below this: from its second turn on the curves of freshly trained networks scatter by 2 to 6 % (development
/// seeds 21-24).
const PAPER_SCATTER: f64 = 0.05;

impl Config {
    /// Epochs of training at most, each turn. In the paper's loop a network that has learned all that the wrong tires leave over leaves nothing
    /// for the next turn: ten epochs end with the least error and let a better start save a turn (development seeds 21-24).
    #[must_use]
    pub fn epochs_at_most(&self) -> usize {
        self.epochs.unwrap_or(match self.method {
            Method::Paper => 10,
            Method::Robust => 60,
        })
    }

    /// Change of the curves below which a turn ends the run.
    #[must_use]
    pub fn settled_below(&self) -> f64 {
        match self.method {
            Method::Paper => self.tolerance.max(PAPER_SCATTER),
            Method::Robust => self.tolerance,
        }
    }

    /// The residual network's shape.
    pub(crate) fn network(&self) -> NetworkConfig {
        NetworkConfig {
            architecture: self.residual.architecture().unwrap_or(Architecture::S4),
            inputs: crate::INPUTS.len(),
            outputs: crate::OUTPUTS.len(),
            d_model: self.d_model,
            d_state: self.d_state,
            layers: self.layers,
            ..NetworkConfig::default()
        }
    }

    /// How it is trained.
    pub(crate) fn training(&self) -> TrainingConfig {
        TrainingConfig {
            epochs_max: self.epochs_at_most(),
            patience: self.epochs_at_most().div_ceil(4),
            ..TrainingConfig::default()
        }
    }
}
