//! The unit's variables: one table, in the order of their references.

use gripsight_model::{Along, Controls, Driven, DrivenCar};

/// What a variable is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Role {
    /// The time.
    Time,
    /// Set before the start.
    Parameter,
    /// Set before a step; holds over it.
    Input,
    /// Read after a step.
    Output,
}

/// A variable of the unit. Its reference is its place in the table.
#[derive(Debug, Clone, PartialEq)]
pub struct Variable {
    /// Name, in the structured convention.
    pub name: String,
    /// What it is.
    pub description: &'static str,
    /// Its unit; "1": none.
    pub unit: &'static str,
    /// What it is for.
    pub role: Role,
    /// Whether it is true or false, 1 or 0.
    pub is_switch: bool,
    /// Before anything is set.
    pub start: f64,
}

const INPUTS: [(&str, &str, &str); 8] = [
    ("steering_rad", "rad", "Steering as commanded, left positive"),
    ("steering_rate_radps", "rad/s", "How fast the steering changes during the step; 0: it is held"),
    (
        "force_x_mps2",
        "m/s2",
        "Commanded longitudinal force over the mass that the vehicle file states: the commanded acceleration",
    ),
    ("imposed.v_x_mps", "m/s", "Forward speed as the car reports it, where it is imposed"),
    ("imposed.v_x_rate_mps2", "m/s2", "How fast the imposed speed changes during the step"),
    ("imposed.a_x_mps2", "m/s2", "Longitudinal specific force, where the speed is imposed"),
    ("imposed.a_x_rate_mps3", "m/s3", "How fast that changes during the step"),
    ("lap_share", "1", "Distance along the lap over its length, where the car is on a course"),
];

type Seen = fn(&Driven) -> f64;
const OUTPUTS: [(&str, &str, &str, Seen); 14] = [
    ("car.x_m", "m", "Position of the centre of gravity, forward at the start", |d| d.x_m),
    ("car.y_m", "m", "Position of the centre of gravity, left at the start", |d| d.y_m),
    ("car.yaw_rad", "rad", "Heading since the start, left positive", |d| d.yaw_rad),
    ("car.v_x_mps", "m/s", "Forward speed of the centre of gravity", |d| d.v_x_mps),
    ("car.v_y_mps", "m/s", "Lateral velocity of the centre of gravity, left positive", |d| d.v_y_mps),
    ("car.yaw_rate_radps", "rad/s", "Yaw rate, left positive", |d| d.yaw_rate_radps),
    ("car.yaw_acceleration_radps2", "rad/s2", "Yaw acceleration", |d| d.yaw_acceleration_radps2),
    ("car.a_y_mps2", "m/s2", "Lateral specific force at the centre of gravity", |d| d.a_y_mps2),
    ("car.wheel_rad", "rad", "Angle of the road wheels", |d| d.wheel_rad),
    ("sensed.v_x_mps", "m/s", "Forward speed as the car's sensors report it", |d| d.sensed_v_x_mps),
    ("sensed.v_y_mps", "m/s", "Lateral velocity as the car's sensors report it", |d| d.sensed_v_y_mps),
    ("sensed.yaw_rate_radps", "rad/s", "Yaw rate as the car's sensors report it", |d| {
        d.sensed_yaw_rate_radps
    }),
    ("sensed.a_y_mps2", "m/s2", "Lateral specific force as the car's sensors report it", |d| {
        d.sensed_a_y_mps2
    }),
    ("sensed.a_x_mps2", "m/s2", "Longitudinal specific force as the car's sensors report it", |d| {
        d.sensed_a_x_mps2
    }),
];

/// First output.
const FIRST_OUTPUT: usize = 1 + INPUTS.len();
/// First parameter.
const FIRST_PARAMETER: usize = FIRST_OUTPUT + OUTPUTS.len();

/// How a unit is run, beside the car.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Setting {
    pub(crate) speed_is_imposed: bool,
    /// v_x, v_y, yaw rate.
    pub(crate) start: [f64; 3],
}

/// A parameter, and where it stands in the car or the setting.
struct Parameter<'a> {
    name: String,
    unit: &'static str,
    description: &'static str,
    place: Place<'a>,
}

enum Place<'a> {
    Switch(&'a mut bool),
    Number(&'a mut f64),
}

fn parameters<'a>(car: &'a mut DrivenCar, setting: &'a mut Setting) -> Vec<Parameter<'a>> {
    let switch = |name: &str, description, place: &'a mut bool| Parameter {
        name: name.to_owned(),
        unit: "1",
        description,
        place: Place::Switch(place),
    };
    let number = |name: String, unit, description, place: &'a mut f64| Parameter {
        name,
        unit,
        description,
        place: Place::Number(place),
    };
    let mut all = vec![
        switch(
            "speed_is_imposed",
            "Whether imposed.* give the motion along the car; else the force drives it",
            &mut setting.speed_is_imposed,
        ),
        switch(
            "force_is_known",
            "Whether the force is given beside an imposed speed; else imposed.a_x_mps2 stands in for it",
            &mut car.force_known,
        ),
        switch("on_course", "Whether lap_share says where on a course the car is", &mut car.on_course),
        number("substep_s".into(), "s", "Longest step of the integration", &mut car.substep_s),
    ];
    let [v_x, v_y, yaw_rate] = &mut setting.start;
    for (name, unit, place) in
        [("v_x_mps", "m/s", v_x), ("v_y_mps", "m/s", v_y), ("yaw_rate_radps", "rad/s", yaw_rate)]
    {
        all.push(number(
            format!("start.{name}"),
            unit,
            "Motion of the centre of gravity at the start",
            place,
        ));
    }
    for (axle, tire) in [("front", &mut car.tires.front), ("rear", &mut car.tires.rear)] {
        for (name, unit, place) in [
            ("b", "1/rad", &mut tire.b),
            ("c", "1", &mut tire.c),
            ("d", "1", &mut tire.d),
            ("e", "1", &mut tire.e),
        ] {
            all.push(number(
                format!("tires.{axle}.{name}"),
                unit,
                "Magic Formula, F_y/F_z of the axle",
                place,
            ));
        }
    }
    let vehicle = &mut car.vehicle;
    let shares = [vehicle.front_drive_share(), vehicle.front_brake_share()];
    for (name, unit, place) in [
        ("mass_kg", "kg", &mut vehicle.mass_kg),
        ("yaw_inertia_kgm2", "kg.m2", &mut vehicle.yaw_inertia_kgm2),
        ("l_f_m", "m", &mut vehicle.l_f_m),
        ("l_r_m", "m", &mut vehicle.l_r_m),
        ("drive_front_share", "1", vehicle.drive_front_share.get_or_insert(shares[0])),
        ("brake_front_share", "1", vehicle.brake_front_share.get_or_insert(shares[1])),
    ] {
        all.push(number(format!("vehicle.{name}"), unit, "As the vehicle file states it", place));
    }
    for (effect, own) in &mut car.effects {
        let spec = effect.spec();
        for (p, place) in spec.parameters.iter().zip(own) {
            // The library's units are words and fractions; the interface wants each defined by base units.
            all.push(number(format!("effects.{}.{}", spec.name, p.name), "1", spec.equation, place));
        }
    }
    all
}

/// The variables of a car's unit.
#[must_use]
pub fn variables(car: &DrivenCar) -> Vec<Variable> {
    let mut car = car.clone();
    let mut setting = Setting { speed_is_imposed: false, start: [0.0; 3] };
    let of = |name: &str, unit, description, role| Variable {
        name: name.to_owned(),
        description,
        unit,
        role,
        is_switch: false,
        start: 0.0,
    };
    let mut all = vec![of("time", "s", "Time", Role::Time)];
    all.extend(INPUTS.map(|(name, unit, description)| of(name, unit, description, Role::Input)));
    all.extend(OUTPUTS.map(|(name, unit, description, _)| of(name, unit, description, Role::Output)));
    all.extend(parameters(&mut car, &mut setting).into_iter().map(|p| {
        let (is_switch, start) = match p.place {
            Place::Switch(on) => (true, f64::from(*on)),
            Place::Number(value) => (false, *value),
        };
        Variable { is_switch, start, ..of(&p.name, p.unit, p.description, Role::Parameter) }
    }));
    all
}

/// Car and setting with the parameters' values, of a table as [`variables`] gives it.
pub(crate) fn set(car: &mut DrivenCar, setting: &mut Setting, values: &[f64]) {
    for (parameter, value) in parameters(car, setting).into_iter().zip(&values[FIRST_PARAMETER..]) {
        match parameter.place {
            Place::Switch(on) => *on = *value != 0.0,
            Place::Number(number) => *number = *value,
        }
    }
}

/// The inputs among the values.
pub(crate) fn controls(values: &[f64], speed_is_imposed: bool) -> Controls {
    let [
        steering_rad,
        steering_rate_radps,
        force_x_mps2,
        v_x_mps,
        v_x_rate_mps2,
        a_x_mps2,
        a_x_rate_mps3,
        lap_share,
    ] = std::array::from_fn(|i| values[1 + i]);
    let along = Along { v_x_mps, v_x_rate_mps2, a_x_mps2, a_x_rate_mps3 };
    Controls {
        steering_rad,
        steering_rate_radps,
        along: speed_is_imposed.then_some(along),
        force_x_mps2,
        lap_share,
    }
}

/// Puts what is seen among the values.
pub(crate) fn see(values: &mut [f64], seen: &Driven) {
    for (value, (_, _, _, of)) in values[FIRST_OUTPUT..].iter_mut().zip(OUTPUTS) {
        *value = of(seen);
    }
}
