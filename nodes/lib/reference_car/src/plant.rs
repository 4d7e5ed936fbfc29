//! The double track: body, four wheels, springs, tires.
//!
//! ```text
//! m (v_x' - v_y r) = sum F_x - drag - m g sin(slope)            m (v_y' + v_x r) = sum F_y + wind - m g sin(bank)
//! I_z r' = sum (x_i F_y,i - y_i F_x,i) + wind                   I_w w_i' = T_i - R (F_x,i + c F_z,i)
//! I_x phi'' = h sum F_y + m g h phi - sum_axles T dF_axle/f      dF_axle = share f (K phi + C phi')/T, at most half its load
//! th'' = w^2 (grad a_x/g - th) - 2 z w th'                      dF_pitch = m g h_p/(grad L) (th + 2 z/w th')
//! sigma/|v| s' + s = tan(alpha)                                 load-dependent sigma
//! ```
//!
//! f is the share of the roll moment that shifts load (see `load_transfer`). Frames: REP-103; the roll axis lies on the ground, positive roll lifts the left side; positive pitch angle `th` is
//! squat. Wheels: front left, front right, rear left, rear right. Not modelled: heave, unsprung masses, aligning
//! moments, toe and Ackermann geometry (both front wheels turn alike).
//!
//! One step is the explicit midpoint rule; wheel spin takes a linearly implicit half step and relaxation an exponential
//! one, so that both stay stable at any speed.

use crate::car::{CarParameters, GRAVITY_MPS2};
use crate::mechanisms::Mechanisms;
use crate::plant_state::{Actuation, Evaluation, PlantState, Surroundings, WheelForces};
use crate::tire::{Contact, Tire, TireParameters};

/// Time constant of the steering linkage under load.
const COMPLIANCE_TIME_S: f64 = 0.012;
const AIR_DENSITY_KGPM3: f64 = 1.2;

/// The car as a dynamic system: constants, and the right-hand side.
#[derive(Debug, Clone)]
pub(crate) struct Plant {
    car: CarParameters,
    mechanisms: Mechanisms,
    mass_kg: f64,
    yaw_inertia_kgm2: f64,
    l_f_m: f64,
    l_r_m: f64,
    tires: [Tire; 4],
    nominal_load_n: [f64; 4],
    load_shift_share: f64,
    roll_stiffness_nm_per_rad: f64,
    roll_damping_nms_per_rad: f64,
    roll_inertia_kgm2: f64,
    low_speed_mps: f64,
}

impl Plant {
    /// A car on a road whose usual friction is `road_friction`.
    pub(crate) fn new(car: &CarParameters, mechanisms: &Mechanisms, road_friction: f64) -> Self {
        let mass_kg = car.mass_kg * mechanisms.mass_ratio;
        let weight_n = mass_kg * GRAVITY_MPS2;
        let l_f_m = car.l_f_m - mechanisms.cog_shift_m;
        let l_r_m = car.l_r_m + mechanisms.cog_shift_m;
        let (front_n, rear_n) =
            (weight_n * l_r_m / (l_f_m + l_r_m) / 2.0, weight_n * l_f_m / (l_f_m + l_r_m) / 2.0);
        let nominal_load_n = [front_n, front_n, rear_n, rear_n];
        let gravity_nm = weight_n * car.h_cg_m;
        let roll_inertia_kgm2 = gravity_nm
            / car.roll.gradient_rad_per_g
            / (std::f64::consts::TAU * car.roll.frequency_hz).powi(2);
        let roll_damping_nms_per_rad =
            2.0 * car.roll.damping_ratio * std::f64::consts::TAU * car.roll.frequency_hz * roll_inertia_kgm2;
        let (load_shift_share, sensitivity) = load_transfer(car, mechanisms, road_friction);
        let tire = |parameters, load_n, side: f64| {
            let mut fitted = parameters;
            scale_tire(&mut fitted, 1.0 + side * mechanisms.tire_asymmetry);
            Tire::new(fitted, load_n, sensitivity, mechanisms.coupling)
        };
        Self {
            tires: [
                tire(car.tire_front, front_n, 1.0),
                tire(car.tire_front, front_n, -1.0),
                tire(car.tire_rear, rear_n, 1.0),
                tire(car.tire_rear, rear_n, -1.0),
            ],
            car: car.clone(),
            mechanisms: *mechanisms,
            mass_kg,
            yaw_inertia_kgm2: car.yaw_inertia_kgm2 * mechanisms.inertia_ratio,
            l_f_m,
            l_r_m,
            nominal_load_n,
            load_shift_share,
            roll_stiffness_nm_per_rad: gravity_nm * (1.0 + 1.0 / car.roll.gradient_rad_per_g),
            roll_damping_nms_per_rad,
            roll_inertia_kgm2,
            low_speed_mps: car.low_speed_mps(),
        }
    }

    /// Peak friction of an axle at rest, on a road of friction `road_friction`.
    pub(crate) fn axle_peak(&self, front: bool, road_friction: f64) -> f64 {
        let first = if front { 0 } else { 2 };
        let peak = |i: usize| self.tires[i].peak_friction(self.nominal_load_n[i], road_friction);
        self.balance(first) * (peak(first) + peak(first + 1)) / 2.0
    }

    /// Cornering stiffness of an axle at rest, N/rad.
    pub(crate) fn axle_stiffness_n_per_rad(&self, front: bool) -> f64 {
        let first = if front { 0 } else { 2 };
        (first..first + 2).map(|i| self.tires[i].cornering_stiffness_n_per_rad(self.nominal_load_n[i])).sum()
    }

    /// Forces and accelerations of a state.
    pub(crate) fn evaluate(
        &self,
        s: &PlantState,
        actuation: &Actuation,
        around: &Surroundings,
    ) -> Evaluation {
        let mut out = Evaluation::default();
        let (front_nm, rear_nm, loads_n) = self.loads(s, around);
        let roll_steer = self.mechanisms.roll_steer_rad_per_g * s.roll_rad / self.car.roll.gradient_rad_per_g;
        let front_rad = actuation.steering_rad - s.compliance_rad;
        let (mut f_x, mut f_y, mut m_z) = (0.0, 0.0, 0.0);
        for (i, wheel) in out.wheels.iter_mut().enumerate() {
            wheel.load_n = loads_n[i];
            wheel.steering_rad = if i < 2 { front_rad } else { roll_steer };
            let (x_m, y_m) = self.position(i);
            self.slide(s, i, x_m, y_m, wheel);
            wheel.force = self.tires[i].force(Contact {
                kappa: wheel.kappa,
                tan_alpha: if self.mechanisms.relaxation_m > 0.0 {
                    s.tan_alpha[i]
                } else {
                    wheel.tan_alpha_now
                } - self.mechanisms.camber_per_roll * s.roll_rad,
                load_n: wheel.load_n,
                road_friction: around.friction[i] * self.balance(i),
            });
            let (sin, cos) = wheel.steering_rad.sin_cos();
            let (along, across) = (wheel.force.f_x_n, wheel.force.f_y_n);
            let (body_x, body_y) = (along * cos - across * sin, along * sin + across * cos);
            f_x += body_x;
            f_y += body_y;
            m_z += x_m * body_y - y_m * body_x;
        }
        self.torques(s, actuation, &mut out.wheels);
        self.body(s, around, [f_x, f_y, m_z], [front_nm, rear_nm], &mut out);
        let axle_load = loads_n[0] + loads_n[1];
        if axle_load > 0.0 {
            let side = out.wheels[0].force.f_y_n + out.wheels[1].force.f_y_n;
            out.compliance_target_rad = self.mechanisms.compliance_rad_per_g * side / axle_load;
        }
        out
    }

    fn position(&self, wheel: usize) -> (f64, f64) {
        let half = self.car.track_width_m / 2.0;
        (if wheel < 2 { self.l_f_m } else { -self.l_r_m }, if wheel.is_multiple_of(2) { half } else { -half })
    }

    fn balance(&self, wheel: usize) -> f64 {
        let b = self.mechanisms.grip_balance;
        if wheel < 2 { 1.0 + b } else { 1.0 - b }
    }

    /// Roll moments carried by the two axles, and the four loads.
    fn loads(&self, s: &PlantState, around: &Surroundings) -> (f64, f64, [f64; 4]) {
        let m = &self.mechanisms;
        let length = self.l_f_m + self.l_r_m;
        let (bank_sin, bank_cos) = around.bank_rad.sin_cos();
        let into_road =
            GRAVITY_MPS2 * bank_cos * around.slope_rad.cos() - s.v_x_mps * s.yaw_rate_radps * bank_sin;
        let weight_n = self.mass_kg * into_road.max(0.0);
        let pitch = self.car.pitch;
        let damping_s = 2.0 * pitch.damping_ratio / (std::f64::consts::TAU * pitch.frequency_hz);
        let squat_n = self.mass_kg * GRAVITY_MPS2 * m.pitch_arm_m / (pitch.gradient_rad_per_g * length)
            * (s.pitch_rad + damping_s * s.pitch_rate_radps);
        let dynamic_n = self.mass_kg * GRAVITY_MPS2 * s.v_x_mps * s.v_x_mps;
        let front_n = (weight_n * self.l_r_m / length - squat_n + m.downforce_front * dynamic_n).max(0.0);
        let rear_n = (weight_n * self.l_f_m / length + squat_n + m.downforce_rear * dynamic_n).max(0.0);
        let spring_nm =
            self.roll_stiffness_nm_per_rad * s.roll_rad + self.roll_damping_nms_per_rad * s.roll_rate_radps;
        let half = self.car.track_width_m / 2.0;
        let share = self.car.roll.front_share;
        // An axle carries no more roll moment than lifts its inner wheel.
        let most = half / self.load_shift_share.max(1e-9);
        let front_nm = (share * spring_nm).clamp(-front_n * most, front_n * most);
        let rear_nm = ((1.0 - share) * spring_nm).clamp(-rear_n * most, rear_n * most);
        let per_nm = self.load_shift_share / (2.0 * half);
        let (front_shift, rear_shift) = (front_nm * per_nm, rear_nm * per_nm);
        let loads = [
            (front_n / 2.0 - front_shift).max(0.0),
            (front_n / 2.0 + front_shift).max(0.0),
            (rear_n / 2.0 - rear_shift).max(0.0),
            (rear_n / 2.0 + rear_shift).max(0.0),
        ];
        (front_nm, rear_nm, loads)
    }

    fn slide(&self, s: &PlantState, i: usize, x_m: f64, y_m: f64, wheel: &mut WheelForces) {
        let v_x = s.v_x_mps - s.yaw_rate_radps * y_m;
        let v_y = s.v_y_mps + s.yaw_rate_radps * x_m;
        let (sin, cos) = wheel.steering_rad.sin_cos();
        let along = v_x * cos + v_y * sin;
        let across = v_y * cos - v_x * sin;
        let base = along.abs().max(self.low_speed_mps);
        wheel.v_cx_mps = along;
        wheel.tan_alpha_now = -across / base;
        wheel.kappa = (s.wheel_radps[i] * self.car.drive.wheel_radius_m - along) / base;
    }

    /// Torques of motor, brakes, differential and rolling resistance.
    fn torques(&self, s: &PlantState, actuation: &Actuation, wheels: &mut [WheelForces; 4]) {
        let drive = &self.car.drive;
        let radius = drive.wheel_radius_m;
        // The torque that spins the wheels up comes on top of the force that was asked for.
        let spin_up = 1.0 + 4.0 * drive.wheel_inertia_kgm2 / (radius * radius * self.car.mass_kg);
        let total_nm = actuation.force_n * radius * spin_up;
        let driving = actuation.force_n > 0.0;
        let front = if driving { drive.drive_front_share } else { drive.brake_front_share };
        for (i, wheel) in wheels.iter_mut().enumerate() {
            let share_nm = total_nm * if i < 2 { front } else { 1.0 - front } / 2.0;
            if driving {
                wheel.torque_nm = share_nm;
            } else {
                wheel.brake_nm = -share_nm;
            }
            wheel.rolling_nm = self.mechanisms.rolling_resistance * wheel.load_n * radius;
        }
        if self.mechanisms.differential != 0.0 {
            for (first, share) in [(0, drive.drive_front_share), (2, 1.0 - drive.drive_front_share)] {
                let ramp = if driving { 1.0 } else { 0.5 };
                let moment_nm = self.mechanisms.differential
                    * self.mass_kg
                    * GRAVITY_MPS2
                    * (self.l_f_m + self.l_r_m)
                    * share
                    * ramp;
                let faster_mps = (s.wheel_radps[first + 1] - s.wheel_radps[first]) * radius;
                // In a corner without wheel spin this is r L/v; a spinning inner wheel changes its sign.
                let locking = faster_mps / s.v_x_mps.abs().max(self.low_speed_mps)
                    * (self.l_f_m + self.l_r_m)
                    / self.car.track_width_m;
                let shift_nm = moment_nm * radius / self.car.track_width_m * locking.tanh();
                wheels[first].torque_nm += shift_nm;
                wheels[first + 1].torque_nm -= shift_nm;
            }
        }
    }

    fn body(
        &self,
        s: &PlantState,
        around: &Surroundings,
        tires: [f64; 3],
        roll_nm: [f64; 2],
        out: &mut Evaluation,
    ) {
        let m = self.mass_kg;
        let (sin, cos) = s.heading_rad.sin_cos();
        let air_x = s.v_x_mps - (around.wind_x_mps * cos + around.wind_y_mps * sin);
        let air_y = s.v_y_mps - (around.wind_y_mps * cos - around.wind_x_mps * sin);
        let drag_n = self.mechanisms.drag_1pm * self.car.mass_kg * air_x * air_x.abs();
        let windy = around.wind_x_mps != 0.0 || around.wind_y_mps != 0.0;
        let side_n = if windy {
            -0.5 * AIR_DENSITY_KGPM3 * self.car.side_area_m2 * air_x.hypot(air_y) * air_y
        } else {
            0.0
        };
        let f_x = tires[0] - drag_n;
        let f_y = tires[1] + side_n;
        out.specific_x_mps2 = f_x / m;
        out.specific_y_mps2 = f_y / m;
        out.v_x_dot_mps2 = f_x / m - GRAVITY_MPS2 * around.slope_rad.sin() + s.v_y_mps * s.yaw_rate_radps;
        out.v_y_dot_mps2 = f_y / m - GRAVITY_MPS2 * around.bank_rad.sin() - s.v_x_mps * s.yaw_rate_radps;
        out.yaw_acceleration_radps2 =
            (tires[2] + side_n * self.car.side_pressure_x_m) / self.yaw_inertia_kgm2;
        let h = self.car.h_cg_m;
        out.roll_acceleration_radps2 =
            (h * tires[1] + m * GRAVITY_MPS2 * h * s.roll_rad - roll_nm[0] - roll_nm[1])
                / self.roll_inertia_kgm2;
        let pitch = self.car.pitch;
        let w = std::f64::consts::TAU * pitch.frequency_hz;
        let steady = pitch.gradient_rad_per_g * tires[0] / (m * GRAVITY_MPS2);
        out.pitch_acceleration_radps2 =
            w * w * (steady - s.pitch_rad) - 2.0 * pitch.damping_ratio * w * s.pitch_rate_radps;
    }

    /// One step from `s`, whose evaluation is `now`; the actuation is the one in the middle of the step.
    pub(crate) fn step(
        &self,
        s: &PlantState,
        now: &Evaluation,
        middle: &Actuation,
        around: &Surroundings,
        dt_s: f64,
    ) -> PlantState {
        let half = self.advance(s, s, now, dt_s / 2.0, true);
        let there = self.evaluate(&half, middle, around);
        self.advance(s, &half, &there, dt_s, false)
    }

    /// Moves `from` by `dt_s` with the derivatives of `at`.
    fn advance(
        &self,
        from: &PlantState,
        at: &PlantState,
        e: &Evaluation,
        dt_s: f64,
        implicit: bool,
    ) -> PlantState {
        let (sin, cos) = at.heading_rad.sin_cos();
        let mut to = PlantState {
            x_m: from.x_m + dt_s * (at.v_x_mps * cos - at.v_y_mps * sin),
            y_m: from.y_m + dt_s * (at.v_x_mps * sin + at.v_y_mps * cos),
            heading_rad: from.heading_rad + dt_s * at.yaw_rate_radps,
            v_x_mps: from.v_x_mps + dt_s * e.v_x_dot_mps2,
            v_y_mps: from.v_y_mps + dt_s * e.v_y_dot_mps2,
            yaw_rate_radps: from.yaw_rate_radps + dt_s * e.yaw_acceleration_radps2,
            roll_rad: from.roll_rad + dt_s * at.roll_rate_radps,
            roll_rate_radps: from.roll_rate_radps + dt_s * e.roll_acceleration_radps2,
            pitch_rad: from.pitch_rad + dt_s * at.pitch_rate_radps,
            pitch_rate_radps: from.pitch_rate_radps + dt_s * e.pitch_acceleration_radps2,
            ..*from
        };
        if self.mechanisms.compliance_rad_per_g != 0.0 {
            let share = -(-dt_s / COMPLIANCE_TIME_S).exp_m1();
            to.compliance_rad += share * (e.compliance_target_rad - from.compliance_rad);
        }
        for (i, wheel) in e.wheels.iter().enumerate() {
            to.wheel_radps[i] = self.spun(from.wheel_radps[i], at.wheel_radps[i], wheel, dt_s, implicit);
            if self.mechanisms.relaxation_m > 0.0 {
                let load_share = (wheel.load_n / self.nominal_load_n[i]).max(0.05).sqrt();
                let speed = wheel.v_cx_mps.abs().max(self.low_speed_mps);
                let share = -(-dt_s * speed / (self.mechanisms.relaxation_m * load_share)).exp_m1();
                to.tan_alpha[i] += share * (wheel.tan_alpha_now - from.tan_alpha[i]);
            }
        }
        to
    }

    fn spun(&self, from_radps: f64, at_radps: f64, wheel: &WheelForces, dt_s: f64, implicit: bool) -> f64 {
        let radius = self.car.drive.wheel_radius_m;
        let inertia = self.car.drive.wheel_inertia_kgm2;
        let resisting_nm = wheel.brake_nm + wheel.rolling_nm;
        let per_radps = 10.0 * radius / self.low_speed_mps;
        let turning = (at_radps * per_radps).clamp(-1.0, 1.0);
        let torque_nm = wheel.torque_nm - resisting_nm * turning - radius * wheel.force.f_x_n;
        let base = wheel.v_cx_mps.abs().max(self.low_speed_mps);
        let friction = if turning.abs() < 1.0 { resisting_nm * per_radps } else { 0.0 };
        let stiffness = radius * radius * wheel.force.f_x_per_slip_n / base + friction;
        let softened = if implicit { 1.0 + dt_s * stiffness / inertia } else { 1.0 };
        from_radps + dt_s * torque_nm / (inertia * softened)
    }
}

fn scale_tire(tire: &mut TireParameters, factor: f64) {
    tire.cornering_stiffness_per_rad *= factor;
    tire.grip *= factor;
}

/// How strongly lateral load transfer acts: the share of the body's roll moment that shifts load, and the tires' load
/// sensitivity.
///
/// An axle whose loads differ by the share x of its load loses `e x^2` of its grip. At its own size the car shifts what
/// its centre of gravity says and its tires have their own sensitivity; for another loss k at the limit both are scaled by
/// the cube root of the ratio, so that the effect vanishes smoothly.
fn load_transfer(car: &CarParameters, mechanisms: &Mechanisms, road_friction: f64) -> (f64, f64) {
    let size = (mechanisms.load_transfer_loss / car.own_load_transfer_loss(road_friction)).cbrt();
    (size, car.load_sensitivity * size)
}
