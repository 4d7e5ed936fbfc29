//! The node's parameters.

use std::time::Duration;

use anyhow::{Context, bail};
use gripsight_driving::{
    CarState, Driver, Drivetrain, Longitudinal, Predictive, Settings as Style, TireSet, Track,
};
use gripsight_msgs::standard::nav_msgs::Odometry;
use gripsight_runtime::{Descriptor, Node, Parameter, vehicle_parameters};
use gripsight_vehicle::VehicleParameters;

/// What the parameters say.
pub(crate) struct Settings {
    pub(crate) vehicle: VehicleParameters,
    /// Sets whose peak rests on a friction prior are driven on, too.
    pub(crate) take_provisional: Parameter<bool>,
    /// Age of the odometry from which the car is braked.
    pub(crate) odometry_timeout: Duration,
    /// Point that the odometry describes, ahead of the centre of gravity.
    odometry_ahead_m: f64,
}

impl Settings {
    /// Declares the parameters; gives them, and the driver that they describe.
    pub(crate) fn declare(node: &mut Node) -> anyhow::Result<(Self, Driver)> {
        let vehicle = vehicle_parameters(node)?;
        let path = node.parameter(
            "track",
            String::new(),
            Descriptor::new(
                "The line to drive: a CSV file, rows of x, y, width to the right, width to the left [m]; required",
            )
            .read_only(),
        )?;
        let take_provisional = node.parameter(
            "take_provisional",
            false,
            Descriptor::new("Whether sets whose peak rests on a friction prior are driven on, too"),
        )?;
        let controller = node.parameter(
            "controller",
            "pursuit".to_owned(),
            Descriptor::new("Who steers: pursuit, or mpc for predictive control")
                .choices(&["pursuit", "mpc"])
                .read_only(),
        )?;
        let mut number = |name: &str, default: f64, low: f64, high: f64, meaning: &str| {
            node.parameter(name, default, Descriptor::new(meaning).range(low..=high).read_only())
                .map(|p| p.get())
        };
        let drivetrain = Drivetrain {
            drive_mps2: number("drive_mps2", 5.0, 0.1, 50.0, "Largest acceleration of the motor [m/s2]")?,
            brake_mps2: number("brake_mps2", 6.0, 0.1, 50.0, "Largest deceleration of the brakes [m/s2]")?,
            power_w_per_kg: number(
                "power_w_per_kg",
                1e6,
                1.0,
                1e6,
                "Power of the motor over the car's mass [W/kg]",
            )?,
            top_speed_mps: number("top_speed_mps", 7.0, 0.5, 100.0, "Highest speed to drive [m/s]")?,
            told: Longitudinal::UNKNOWN,
        };
        let known = Style::default();
        let style = Style {
            share: number("share", known.share, 0.1, 1.0, "Share of a known grip to plan with [-]")?,
            step: number(
                "step",
                known.step,
                1.0,
                1.5,
                "Grip planned over what was driven without a slide, where the peak is not known [-]",
            )?,
            prior_step: number(
                "prior_step",
                known.prior_step,
                1.0,
                1.5,
                "The same where a prior says that there is more [-]",
            )?,
            beyond: number(
                "beyond",
                known.beyond,
                1.0,
                3.0,
                "Grip planned over what a set promises at most, where the peak is not known [-]",
            )?,
            controller: controller.get().parse().map_err(anyhow::Error::msg)?,
            predictive: Predictive {
                most_rate_radps: number(
                    "steering_rate_radps",
                    known.predictive.most_rate_radps,
                    0.05,
                    20.0,
                    "Largest rate of the steering, for mpc [rad/s]",
                )?,
                ..known.predictive
            },
            ..known
        };
        let friction = number(
            "start_friction",
            0.51,
            0.05,
            3.0,
            "Friction of the tires to start with, until a set comes [-]",
        )?;
        let timeout_s = number(
            "odometry_timeout_s",
            0.2,
            0.02,
            10.0,
            "Age of the odometry from which the car is braked [s]",
        )?;
        let odometry_ahead_m = number(
            "odometry_ahead_m",
            0.0,
            -10.0,
            10.0,
            "Point that the odometry describes, ahead of the centre of gravity [m]",
        )?;

        let path = path.get();
        if path.is_empty() {
            bail!("parameter track: the file of the line to drive is missing");
        }
        let text = std::fs::read_to_string(&path).with_context(|| format!("parameter track: file {path}"))?;
        let track = Track::from_csv(&text).with_context(|| format!("parameter track: file {path}"))?;
        let driver = Driver::new(vehicle.clone(), drivetrain, track, TireSet::start_at(friction), style)?;
        let odometry_timeout = Duration::from_secs_f64(timeout_s);
        Ok((Self { vehicle, take_provisional, odometry_timeout, odometry_ahead_m }, driver))
    }

    /// The centre of gravity's state; `start_ns` is the stamp that counts as zero.
    pub(crate) fn state(&self, message: &Odometry, start_ns: i64) -> CarState {
        let s = gripsight_bag::decode::odometry(message);
        let (sin, cos) = s.yaw_rad.sin_cos();
        CarState {
            stamp_s: (s.stamp_ns - start_ns) as f64 * 1e-9,
            x_m: s.x_m - self.odometry_ahead_m * cos,
            y_m: s.y_m - self.odometry_ahead_m * sin,
            heading_rad: s.yaw_rad,
            v_x_mps: s.v_x_mps,
            v_y_mps: s.v_y_mps - self.odometry_ahead_m * s.yaw_rate_radps,
            yaw_rate_radps: s.yaw_rate_radps,
        }
    }
}
