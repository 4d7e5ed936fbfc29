//! What identification tells of motor, brakes and what holds the car back; what it does not tell stays as stated.
//!
//! ```text
//! dv_x/dt = k u(t - tau) - r - c v_x^2      u: commanded acceleration, after a lag T
//! ```

/// Gains that a drive train can have: others are no gain but a fault.
const GAINS: std::ops::Range<f64> = 0.3..3.0;
/// Longest delay and lag that is looked ahead for.
const LATEST_S: f64 = 0.5;

/// Limits that were reached in a range of speeds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ReachedAt {
    /// Lowest and highest speed.
    pub v_x_mps: [f64; 2],
    /// Largest acceleration forward that the car gave where more was asked for.
    pub forward_mps2: Option<f64>,
    /// Largest backward, positive.
    pub backward_mps2: Option<f64>,
}

/// Figures of the drive train; `None` where the drive does not tell them.
#[derive(Debug, Clone, PartialEq)]
pub struct Longitudinal {
    /// Acceleration over commanded acceleration.
    pub gain: Option<f64>,
    /// From a command to its effect.
    pub delay_s: Option<f64>,
    /// Time constant of what follows.
    pub lag_s: Option<f64>,
    /// Rolling resistance over the mass.
    pub rolling_resistance_mps2: Option<f64>,
    /// Drag over the mass.
    pub drag_1pm: Option<f64>,
    /// Limits by speed, where they were reached.
    pub reached: Vec<ReachedAt>,
}

impl Longitudinal {
    /// Nothing is told.
    pub const UNKNOWN: Self = Self {
        gain: None,
        delay_s: None,
        lag_s: None,
        rolling_resistance_mps2: None,
        drag_1pm: None,
        reached: Vec::new(),
    };

    /// What is told anew, and of the rest what was known before: a drive at one speed does not tell drag, and the last one's stands.
    #[must_use]
    pub(crate) fn beside(self, before: &Self) -> Self {
        // Rolling resistance and drag are found together.
        let apart = self.rolling_resistance_mps2.is_some() && self.drag_1pm.is_some();
        let resisting = if apart { &self } else { before };
        Self {
            gain: self.gain.or(before.gain),
            delay_s: self.delay_s.or(before.delay_s),
            lag_s: self.lag_s.or(before.lag_s),
            rolling_resistance_mps2: resisting.rolling_resistance_mps2,
            drag_1pm: resisting.drag_1pm,
            reached: self.reached,
        }
    }

    /// Acceleration over commanded acceleration; 1 where it is not known.
    pub(crate) fn gain(&self) -> f64 {
        self.gain.filter(|gain| GAINS.contains(gain)).unwrap_or(1.0)
    }

    /// How long before its effect a command goes out.
    pub(crate) fn ahead_s(&self) -> f64 {
        let told = |s: Option<f64>| s.filter(|s| s.is_finite()).unwrap_or(0.0).max(0.0);
        (told(self.delay_s) + told(self.lag_s)).min(LATEST_S)
    }

    /// What holds the car back at a speed.
    pub(crate) fn resistance_mps2(&self, v_x_mps: f64) -> f64 {
        let told = |figure: Option<f64>| figure.filter(|f| f.is_finite()).unwrap_or(0.0).max(0.0);
        told(self.rolling_resistance_mps2) + told(self.drag_1pm) * v_x_mps * v_x_mps
    }

    /// Limits reached at a speed, forward and backward; infinite where none was.
    pub(crate) fn reached_mps2(&self, v_x_mps: f64) -> [f64; 2] {
        let at = self.reached.iter().find(|at| (at.v_x_mps[0]..=at.v_x_mps[1]).contains(&v_x_mps));
        let limit = |a: Option<f64>| a.filter(|a| *a > 0.1).unwrap_or(f64::INFINITY);
        at.map_or([f64::INFINITY; 2], |at| [limit(at.forward_mps2), limit(at.backward_mps2)])
    }
}
