//! Where tire parameters may lie, and what is taken for likely where the data do not tell.

use gripsight_vehicle::{MagicFormula, PacejkaParameters};

use crate::{PerAxle, Range};
use gripsight_estimation::shooting::{Parameter, Prior};

/// Normalised stiffness B C D, 1/rad. Road tires have 8-20, slicks under downforce up to 60, a 1:10 car on a dusty floor 2.
pub const STIFFNESS_BOUNDS: (f64, f64) = (0.5, 100.0);
/// Stiffness factor B, 1/rad.
pub const B_BOUNDS: (f64, f64) = (0.1, 100.0);
/// Shape factor C. Below 1 the curve has no peak and D means nothing.
pub const C_BOUNDS: (f64, f64) = (1.0, 2.2);
/// Peak factor D. Ice has 0.05; slicks under downforce, over the static load, reach [`MOST_FORCE`].
pub const D_BOUNDS: (f64, f64) = (0.05, 3.5);
/// The most force over the static load that tires show: slicks under downforce.
pub const MOST_FORCE: f64 = 3.0;
/// Curvature factor E. Above 1 the force changes its sign at large slip.
pub const E_BOUNDS: (f64, f64) = (-6.0, 0.99);

/// C where the data do not tell: the middle of published passenger-car and racing sets for lateral force.
pub(crate) const C_PRIOR: Prior = Prior { mean: 1.4, sigma: 0.25 };
/// E where the data do not tell.
pub(crate) const E_PRIOR: Prior = Prior { mean: 0.0, sigma: 1.0 };
/// D where neither data nor a friction prior tell: nearly anything.
pub(crate) const D_PRIOR: Prior = Prior { mean: 0.9, sigma: 0.6 };

/// Magic Formula parameters and their bounds, in the order B, C, D, E.
pub const BOUNDS: [(f64, f64); 4] = [B_BOUNDS, C_BOUNDS, D_BOUNDS, E_BOUNDS];

/// The four parameters (k, C, D, E) of an axle as the shooting fit sees them.
pub(crate) fn parameters(start: &MagicFormula) -> [Parameter; 4] {
    let parameter = |start, bounds: (f64, f64), prior| Parameter {
        start,
        low: bounds.0,
        high: bounds.1,
        free: true,
        prior,
    };
    [
        parameter(start.normalized_stiffness(), STIFFNESS_BOUNDS, None),
        parameter(start.c, C_BOUNDS, Some(C_PRIOR)),
        parameter(start.d, D_BOUNDS, Some(D_PRIOR)),
        parameter(start.e, E_BOUNDS, Some(E_PRIOR)),
    ]
}

/// Names of the parameters on a bound, such as `rear.c`.
pub(crate) fn on_bound(tires: &PacejkaParameters) -> Vec<String> {
    let names = ["b", "c", "d", "e"];
    let values = tires.to_array();
    (0..8)
        .filter(|&j| {
            let (low, high) = BOUNDS[j % 4];
            let margin = 1e-4 * (high - low);
            values[j] <= low + margin || values[j] >= high - margin
        })
        .map(|j| format!("{}.{}", if j < 4 { "front" } else { "rear" }, names[j % 4]))
        .collect()
}

/// Largest difference of two tires' curves within the slips driven, as a share of the largest force there: what an iteration changed.
pub(crate) fn curve_change(a: &PacejkaParameters, b: &PacejkaParameters, slips: &PerAxle<Range>) -> f64 {
    let axle = |a: &MagicFormula, b: &MagicFormula, slip: &Range| {
        let furthest = slip.low.abs().max(slip.high.abs());
        let points = (1..=40).map(|k| furthest * f64::from(k) / 40.0);
        let (mut difference, mut largest) = (0.0_f64, f64::MIN_POSITIVE);
        for slip in points {
            let (fa, fb) = (a.normalized_force(slip), b.normalized_force(slip));
            difference = difference.max((fa - fb).abs());
            largest = largest.max(fb.abs());
        }
        difference / largest
    };
    axle(&a.front, &b.front, &slips.front).max(axle(&a.rear, &b.rear, &slips.rear))
}
