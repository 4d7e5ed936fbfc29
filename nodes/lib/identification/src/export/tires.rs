//! The two tire files, as text.

use std::fmt::Write as _;

use chrono::{DateTime, SecondsFormat};
use gripsight_vehicle::{MagicFormula, PacejkaParameters, VehicleParameters};

use crate::{PerAxle, Status, ValidWithin};

/// Where a set of tires comes from: the comments at the head of each file.
#[derive(Debug, Clone, PartialEq)]
pub struct Provenance {
    /// The car's name.
    pub car: String,
    /// The data's name.
    pub bag: String,
    /// Stamp of the data's first sample, nanoseconds since 1970.
    pub data_stamp_ns: i64,
    /// Version of the tool.
    pub tool_version: String,
    /// The parameters of the car that the tires belong to, see [`crate::vehicle_hash`].
    pub vehicle_hash: String,
    /// Seed of every random number.
    pub seed: u64,
    /// The command that made it.
    pub command: String,
    /// What the set may be used for: it says which files are written, too.
    pub status: Status,
    /// Slips and forces up to which it is valid.
    pub valid_within: ValidWithin,
    /// Why the set was rejected, or what to know of an accepted one.
    pub notes: Vec<String>,
}

/// A stamp in nanoseconds since 1970 as RFC 3339 in UTC, milliseconds.
#[must_use]
pub fn stamp_text(stamp_ns: i64) -> String {
    DateTime::from_timestamp_nanos(stamp_ns).to_rfc3339_opts(SecondsFormat::Millis, true)
}

/// Starts the comment that says how old the data is: [`super::TireFiles`] dates the sets it keeps by it.
pub(super) const STAMP_COMMENT: &str = "# data: ";

/// Starts the comment that says what the set may be used for.
const STATUS_COMMENT: &str = "# status: ";
/// Starts the comment that says up to where the set is valid.
const VALID_COMMENT: &str = "# valid within: ";

/// The limits that the comments of a tire file state; `None` where they state none.
#[must_use]
pub fn read_valid_within(text: &str) -> Option<ValidWithin> {
    let line = text.lines().find_map(|line| line.strip_prefix(VALID_COMMENT))?;
    let words = line.split([' ', ',']).filter_map(|word| word.parse().ok());
    let [slip_front, slip_rear, force_front, force_rear] = words.collect::<Vec<f64>>().try_into().ok()?;
    Some(ValidWithin {
        slip_rad: PerAxle { front: slip_front, rear: slip_rear },
        force_n: PerAxle { front: force_front, rear: force_rear },
    })
}

impl Provenance {
    /// The data's stamp as RFC 3339 in UTC, milliseconds.
    #[must_use]
    pub fn stamp(&self) -> String {
        stamp_text(self.data_stamp_ns)
    }

    fn comments(&self) -> String {
        let mut text = String::new();
        let mut line = |start: &str, rest: &str| {
            // A line break in a path or a reason must not end the comment.
            let rest = rest.replace(['\n', '\r'], " ");
            let _ = writeln!(text, "{start}{rest}");
        };
        line("# ", &format!("tires of {}, identified by gripsight {}", self.car, self.tool_version));
        line(STAMP_COMMENT, &format!("{}, {}", self.stamp(), self.bag));
        line("# ", &format!("vehicle hash {}, seed {}", self.vehicle_hash, self.seed));
        line("# ", &format!("command: {}", self.command));
        line(STATUS_COMMENT, self.status.name());
        let ValidWithin { slip_rad, force_n } = &self.valid_within;
        if [slip_rad.front, slip_rad.rear, force_n.front, force_n.rear].iter().all(|v| v.is_finite()) {
            line(
                VALID_COMMENT,
                &format!(
                    "slip_rad front {:.4} rear {:.4}, force_n front {:.2} rear {:.2}",
                    slip_rad.front, slip_rad.rear, force_n.front, force_n.rear
                ),
            );
        }
        self.notes.iter().for_each(|note| line("# note: ", note));
        text
    }
}

/// The MPC's file: exactly the keys `friction_coeff, Bf..Ef, Br..Er, floor`. `floor` names the surface.
///
/// Its reader multiplies D with `friction_coeff`, and D is the friction coefficient already: `friction_coeff` is 1.
#[must_use]
pub fn mpc_yaml(tires: &PacejkaParameters, floor: &str, provenance: &Provenance) -> String {
    let mut text = provenance.comments();
    text.push_str(
        "# F_y = friction_coeff * D * F_z * sin(C * atan(B*a - E*(B*a - atan(B*a)))), slip angle a in rad\n",
    );
    text.push_str("friction_coeff: 1.0\n");
    for (axle, tire) in [('f', &tires.front), ('r', &tires.rear)] {
        for (letter, value) in [('B', tire.b), ('C', tire.c), ('D', tire.d), ('E', tire.e)] {
            let _ = writeln!(text, "{letter}{axle}: {}", number(value));
        }
    }
    let _ = writeln!(text, "floor: {}", quoted(floor));
    text
}

/// The file of steering-lookup controllers: tires and car.
#[must_use]
pub fn controller_txt(
    tires: &PacejkaParameters,
    vehicle: &VehicleParameters,
    provenance: &Provenance,
) -> String {
    let mut text = provenance.comments();
    let row = |t: &MagicFormula| [t.b, t.c, t.d, t.e].map(number).join(", ");
    let _ = writeln!(text, "C_Pf: [{}]", row(&tires.front));
    let _ = writeln!(text, "C_Pr: [{}]", row(&tires.rear));
    let numbers = [
        ("I_z", vehicle.yaw_inertia_kgm2),
        ("h_cg", vehicle.h_cg_m),
        ("l_f", vehicle.l_f_m),
        ("l_r", vehicle.l_r_m),
        ("l_wb", vehicle.wheelbase_m()),
        ("m", vehicle.mass_kg),
    ];
    for (key, value) in numbers {
        let _ = writeln!(text, "{key}: {}", number(value));
    }
    let _ = writeln!(text, "model_name: {}\ntire_model: pacejka", quoted(&provenance.car));
    text
}

/// A float that YAML 1.1 readers (PyYAML) take for a float: with a point, without an exponent.
fn number(value: f64) -> String {
    if value.is_nan() {
        return ".nan".into();
    }
    if value.is_infinite() {
        return if value > 0.0 { ".inf" } else { "-.inf" }.into();
    }
    let text = value.to_string();
    if text.contains('.') { text } else { format!("{text}.0") }
}

/// A double-quoted YAML string (JSON's escapes are YAML's).
fn quoted(text: &str) -> String {
    serde_json::Value::from(text).to_string()
}
