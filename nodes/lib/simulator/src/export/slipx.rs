//! A car folder of slipx: car, dynamics, limits, sensors, provenance, and a tire for each axle.

use gripsight_model::OutsideTerm;
use gripsight_vehicle::{GRAVITY_MPS2, MagicFormula};

use super::{ExportError, Figures};

/// What it has a term for, beside the car's figures.
pub(super) const TERMS: [OutsideTerm; 5] = [
    OutsideTerm::Relaxation,
    OutsideTerm::SteeringLag,
    OutsideTerm::SteeringRateLimit,
    OutsideTerm::Drag,
    OutsideTerm::LateralLoadTransfer,
];

/// Largest car.
const MOST_KG: f64 = 15.0;
const SCHEMA: &str = "schema_version: \"0.2.0\"\n";
/// A servo that is there at once, and bounds of one.
const FAST_RADPS: f64 = 100.0;
const RATE_RADPS: f64 = 10.0;
/// A drive train that does not limit: acceleration and speed.
const ROOMY_MPS2: f64 = 15.0;
const ROOMY_MPS: f64 = 30.0;
/// Least relaxation length that it takes, over the wheel's radius.
const LEAST_RELAXATION: f64 = 0.02;
/// How much less friction a tire has per load, as [`gripsight_model::Axle::carried_n`] has it.
const LOAD_SENSITIVITY: f64 = 0.1;

pub(super) fn files(f: &Figures) -> Result<Vec<(String, String)>, ExportError> {
    if f.mass_kg > MOST_KG {
        return Err(ExportError::TooHeavy { mass_kg: f.mass_kg, most_kg: MOST_KG });
    }
    let wheelbase_m = f.l_f_m + f.l_r_m;
    let load = |share_m: f64| 0.5 * f.mass_kg * GRAVITY_MPS2 * share_m / wheelbase_m;
    let named = |name: &str, text: String| (name.to_owned(), text);
    Ok(vec![
        named("car.yaml", car(&f.name)),
        named("dynamics.yaml", dynamics(f, wheelbase_m)),
        named("limits.yaml", limits(f)),
        named("sensors.yaml", format!("{SCHEMA}sensors: []\n")),
        named("provenance.yaml", format!("{SCHEMA}{PROVENANCE}")),
        named("tyres/rubber_front.yaml", tire("front", &f.tires.front, load(f.l_r_m), f)),
        named("tyres/rubber_rear.yaml", tire("rear", &f.tires.rear, load(f.l_f_m), f)),
    ])
}

const PROVENANCE: &str = "\
label: provisional
source: a recorded drive
method: gripsight export; drive train, inertias about the other axes, tracks and longitudinal tire figures are not found, they keep out of the way
date: \"2000-01-01\"
";

fn car(name: &str) -> String {
    let name: String = name.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }).collect();
    format!(
        "{SCHEMA}name: {name}\ndescription: tires and effects found by gripsight\ndynamics: dynamics.yaml\nlimits: limits.yaml\n\
         sensors: sensors.yaml\nprovenance: provenance.yaml\n"
    )
}

fn dynamics(f: &Figures, wheelbase_m: f64) -> String {
    let (track_m, length_m, width_m) = (0.75 * wheelbase_m, 1.7 * wheelbase_m, 0.9 * wheelbase_m);
    let layout = match f.drive_front_share {
        share if share < 0.1 => "2WD_rear",
        share if share > 0.9 => "2WD_front",
        _ => "4WD",
    };
    let side_kgm2 = 0.5 * f.yaw_inertia_kgm2;
    format!(
        "{SCHEMA}mass: {}\ninertia: {{ixx: {side_kgm2}, iyy: {}, izz: {}}}\n\
         geometry:\n  lf: {}\n  lr: {}\n  track_front: {track_m}\n  track_rear: {track_m}\n  h_cog: {}\n  wheel_radius: {}\n  \
         length: {length_m}\n  width: {width_m}\n\
         tyres:\n  front: {{compound: rubber, surface: front}}\n  rear: {{compound: rubber, surface: rear}}\n\
         drivetrain: {{layout: {layout}, differential: open}}\nresistance: {{drag_coeff: {}, roll_resist: 0.0}}\n",
        f.mass_kg,
        f.yaw_inertia_kgm2,
        f.yaw_inertia_kgm2,
        f.l_f_m,
        f.l_r_m,
        f.h_cg_m,
        f.wheel_radius_m,
        f.drag_n_s2pm2.max(0.0)
    )
}

fn limits(f: &Figures) -> String {
    // q tau^2 d'' + tau d' + d = u
    let (bandwidth, damping) = match f.lag {
        Some([tau_s, q]) => ((1.0 / (tau_s * q.sqrt())).min(FAST_RADPS), 0.5 / q.sqrt()),
        None => (FAST_RADPS, 0.7),
    };
    let torque_nm = f.mass_kg * ROOMY_MPS2 * f.wheel_radius_m;
    format!(
        "{SCHEMA}steering: {{max_angle: {}, max_rate: {}, bandwidth: {bandwidth}, damping: {damping}}}\n\
         # Not found by gripsight: roomy, so that nothing here limits.\n\
         drivetrain: {{accel_max: {ROOMY_MPS2:?}, decel_max: {ROOMY_MPS2:?}, v_max: {ROOMY_MPS:?}}}\n\
         esc: {{torque_stall: {torque_nm}, omega_free: {}, torque_per_amp: {}, efficiency: 1.0}}\n\
         electrical: {{pack_nominal_v: 12.0, pack_v_full: 12.1, pack_v_empty: 11.9, pack_capacity_ah: 20.0, \
         pack_internal_resistance: 0.001, current_max: 200.0, regen_current_max: 200.0}}\n",
        f.max_steering_rad,
        f.rate_radps.unwrap_or(RATE_RADPS),
        2.0 * ROOMY_MPS / f.wheel_radius_m,
        torque_nm / 200.0
    )
}

fn tire(surface: &str, tire: &MagicFormula, load_n: f64, f: &Figures) -> String {
    let stiffness_npr = tire.normalized_stiffness() * load_n;
    let relaxation_m = f.relaxation_m.max(LEAST_RELAXATION * f.wheel_radius_m);
    format!(
        "{SCHEMA}compound: rubber\nsurface: {surface}\nnominal_load: {load_n}\n\
         linear: {{c_alpha: {stiffness_npr}, c_kappa: {stiffness_npr}}}\n\
         friction: {{mu_y0: {d}, mu_x0: {d}, k_mu: {LOAD_SENSITIVITY}}}\nmf_lite: {{C: {}, E: {}}}\n\
         relaxation: {{sigma: {relaxation_m}}}\nprovenance:\n  {}\n",
        tire.c,
        tire.e,
        format!("{SCHEMA}{PROVENANCE}").trim_end().replace('\n', "\n  "),
        d = tire.d,
    )
}
