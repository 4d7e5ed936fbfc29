//! Laps as the driver itself sees them, by odometry.

use gripsight_driving::{Place, Track};

/// A lap that was driven.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Lap {
    pub(crate) number: u32,
    pub(crate) time_s: f64,
    /// Distance to the line: mean and largest.
    pub(crate) mean_m: f64,
    pub(crate) worst_m: f64,
    /// Times off the track.
    pub(crate) exits: u32,
}

/// Times laps.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Laps {
    station_m: Option<f64>,
    /// When the lap began; none until the line was crossed or the car stood on it.
    began_s: Option<f64>,
    /// Half way round since: a car that stands on the line crosses it by its odometry's noise alone.
    half_way: bool,
    number: u32,
    sum_m: f64,
    looks: u32,
    worst_m: f64,
    exits: u32,
    outside: bool,
}

impl Laps {
    /// Takes the next place; gives the lap that ends with it.
    pub(crate) fn pass(&mut self, stamp_s: f64, place: Place, track: &Track) -> Option<Lap> {
        let length_m = track.length_m();
        let before_m = self.station_m.replace(place.station_m);
        let point = track.at(place.station_m);
        let width_m = if place.offset_m > 0.0 { point.left_m } else { point.right_m };
        let outside = place.offset_m.abs() > width_m;
        self.exits += u32::from(outside && !self.outside);
        self.outside = outside;
        self.sum_m += place.offset_m.abs();
        self.looks += 1;
        self.worst_m = self.worst_m.max(place.offset_m.abs());
        self.half_way |= (0.4..0.6).contains(&(place.station_m / length_m));
        let Some(before_m) = before_m else {
            // A car that starts on the line begins its lap there.
            self.began_s = (place.station_m < 0.02 * length_m).then_some(stamp_s);
            return None;
        };
        if !(before_m > 0.75 * length_m && place.station_m < 0.25 * length_m) {
            return None;
        }
        let lap = self.began_s.filter(|_| self.half_way).map(|began_s| Lap {
            number: self.number + 1,
            time_s: stamp_s - began_s,
            mean_m: self.sum_m / f64::from(self.looks.max(1)),
            worst_m: self.worst_m,
            exits: self.exits,
        });
        *self = Self {
            station_m: self.station_m,
            began_s: Some(stamp_s),
            number: self.number + u32::from(lap.is_some()),
            outside,
            ..Self::default()
        };
        lap
    }

    /// How far the car is outside of the track's edge at a place; none inside.
    pub(crate) fn outside_m(place: Place, track: &Track) -> Option<f64> {
        let point = track.at(place.station_m);
        let width_m = if place.offset_m > 0.0 { point.left_m } else { point.right_m };
        Some(place.offset_m.abs() - width_m).filter(|&m| m > 0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn laps_are_timed_from_the_line_and_exits_counted_once() {
        let circle = (0..60).map(|k| {
            let p = f64::from(k) * std::f64::consts::TAU / 60.0;
            [10.0 * p.cos(), 10.0 * p.sin(), 0.5, 0.5]
        });
        let track = Track::from_points(&circle.collect::<Vec<_>>()).unwrap();
        let mut laps = Laps::default();
        let mut driven = Vec::new();
        for k in 0..430 {
            let station_m = (30.0 + f64::from(k) * 0.5) % track.length_m();
            let offset_m = if (200..210).contains(&k) { 0.6 } else { 0.1 };
            driven.extend(laps.pass(f64::from(k) * 0.1, Place { station_m, offset_m }, &track));
        }
        // 215 m from station 30 m of a lap of 62.8 m: the line three times, so two whole laps.
        assert_eq!(driven.iter().map(|l| (l.number, l.exits)).collect::<Vec<_>>(), [(1, 0), (2, 1)]);
        assert!((driven[0].time_s - 12.57).abs() < 0.2 && driven[1].worst_m == 0.6, "{driven:?}");
        // A car that stands on the line for a while, and sets off.
        let mut laps = Laps::default();
        let noisy = (0..20).map(|k| if k % 2 == 0 { 0.01 } else { track.length_m() - 0.01 });
        let along = noisy.chain((0..140).map(|k| f64::from(k) * 0.5 % track.length_m()));
        let pass = |(k, station_m)| laps.pass(k as f64 * 0.1, Place { station_m, offset_m: 0.1 }, &track);
        let driven: Vec<Lap> = along.enumerate().filter_map(pass).collect();
        assert!(driven.len() == 1 && (driven[0].time_s - 12.6).abs() < 0.3, "{driven:?}");
        let out = Laps::outside_m(Place { station_m: 3.0, offset_m: -0.7 }, &track).unwrap();
        assert!((out - 0.2).abs() < 1e-9);
    }
}
