//! The referee: times laps and counts exits by the truth.

use gripsight_driving::{Driver, Limits, SpeedProfile, Track, Trust};
use gripsight_reference_car::TruthSample;
use gripsight_vehicle::GRAVITY_MPS2;

/// Share of the grip from which the fastest drive on the true tires is in a corner.
const CORNER: f64 = 0.9;

/// What a lap gave.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Lap {
    pub(crate) time_s: f64,
    /// Distance to the line: mean and largest.
    pub(crate) error_m: f64,
    pub(crate) worst_m: f64,
    /// Mean of the acceleration used over the grip in corners.
    pub(crate) used: f64,
    /// Times off the track.
    pub(crate) exits: u32,
    /// Grip planned at its end.
    pub(crate) planned: f64,
    /// What the driver drove on at its end.
    pub(crate) trust: Option<Trust>,
    /// Lateral acceleration over the true grip that the set in use at its end promised.
    pub(crate) promised: Option<f64>,
}

/// Watches the truth.
pub(crate) struct Referee {
    track: Track,
    fastest: SpeedProfile,
    limits: Limits,
    half_width_m: f64,
    pub(crate) laps: Vec<Lap>,
    lap: Lap,
    looks: (f64, f64),
    began_s: f64,
    station_m: f64,
    outside: bool,
    slow: u32,
    corner_s: Option<f64>,
    promised: Option<f64>,
    /// From the first corner to the first set.
    pub(crate) first_set_s: Option<f64>,
}

impl Referee {
    pub(crate) fn new(track: Track, limits: &Limits, half_width_m: f64) -> Self {
        Self {
            fastest: SpeedProfile::new(&track, limits),
            track,
            limits: limits.clone(),
            half_width_m,
            laps: Vec::new(),
            lap: Lap::default(),
            looks: (0.0, 0.0),
            began_s: 0.0,
            station_m: 0.0,
            outside: false,
            slow: 0,
            corner_s: None,
            promised: None,
            first_set_s: None,
        }
    }

    /// Another floor from now on.
    pub(crate) fn floor(&mut self, limits: &Limits) {
        self.fastest = SpeedProfile::new(&self.track, limits);
        self.limits = limits.clone();
    }

    /// Time of the fastest lap on the true tires, as planned.
    pub(crate) fn fastest_lap_s(&self) -> f64 {
        self.fastest.lap_time_s()
    }

    /// Times off the track since the start.
    pub(crate) fn exits(&self) -> u32 {
        self.laps.iter().map(|lap| lap.exits).sum::<u32>() + self.lap.exits
    }

    /// Distance driven along the line since the start.
    pub(crate) fn along_m(&self) -> f64 {
        self.laps.len() as f64 * self.track.length_m() + self.station_m
    }

    /// The set in use promises this lateral acceleration over g.
    pub(crate) fn promised(&mut self, now: &TruthSample, grip: Option<f64>) {
        self.promised = grip.map(|grip| grip * GRAVITY_MPS2 / self.limits.lateral_mps2);
        if let Some(corner_s) = self.corner_s.filter(|_| grip.is_some()) {
            self.first_set_s.get_or_insert(now.motion.time_s - corner_s);
        }
    }

    /// The reason for which the run cannot go on.
    pub(crate) fn look(&mut self, now: &TruthSample, driver: &Driver) -> Option<&'static str> {
        let (m, offset_m) = (&now.motion, now.offset_m.abs());
        if now.station_m < 0.25 * self.track.length_m() && self.station_m > 0.75 * self.track.length_m() {
            let lap = Lap {
                time_s: m.time_s - self.began_s,
                error_m: self.lap.error_m / self.looks.0,
                used: self.lap.used / self.looks.1.max(1.0),
                planned: driver.grip(),
                trust: Some(driver.trust()),
                promised: self.promised,
                ..self.lap
            };
            self.laps.push(lap);
            (self.lap, self.looks, self.began_s) = (Lap::default(), (0.0, 0.0), m.time_s);
        }
        self.station_m = now.station_m;
        self.lap.error_m += offset_m;
        self.lap.worst_m = self.lap.worst_m.max(offset_m);
        self.looks.0 += 1.0;
        let fastest = self.fastest.at(now.station_m).0;
        let point = self.track.at(now.station_m);
        let grip_mps2 = self.limits.lateral_at_mps2(point.curvature_1pm);
        if fastest * fastest * point.curvature_1pm.abs() > CORNER * grip_mps2 {
            self.lap.used += m.specific_x_mps2.hypot(m.specific_y_mps2) / grip_mps2;
            self.looks.1 += 1.0;
            self.corner_s.get_or_insert(m.time_s);
        }
        let outside = offset_m > self.half_width_m;
        self.lap.exits += u32::from(outside && !self.outside);
        self.outside = outside;
        let speed = m.v_x_mps.hypot(m.v_y_mps);
        self.slow = if speed < 0.05 * (self.limits.lateral_mps2 * self.track.length_m()).sqrt() {
            self.slow + 1
        } else {
            0
        };
        if speed > 1.0 && m.v_y_mps.atan2(m.v_x_mps).abs() > 1.0 {
            Some("spin")
        } else if offset_m > 3.0 * self.half_width_m {
            Some("left the track")
        } else if self.slow > 300 {
            Some("standstill")
        } else {
            None
        }
    }
}
