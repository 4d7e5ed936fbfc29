//! How far the car has come, and with what grip it was driven.

use crate::Place;

/// Share of a half lap that a plan must have been in force for to count as driven.
const COUNTS: f64 = 0.8;

/// Part of a half lap: a whole number of them, divided again, may be a little less.
const ROUNDING: f64 = 1e-6;

/// Distance driven along the line, in half laps: each has corners of all kinds.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Progress {
    half_m: f64,
    /// Distance from the line's start; none before the first place.
    along_m: Option<f64>,
    halves: usize,
    /// Where the half lap began.
    began_m: f64,
    /// Lowest grip planned with over the part of it that counts.
    lowest: f64,
}

impl Progress {
    pub(crate) fn new(length_m: f64, grip: f64) -> Self {
        Self { half_m: 0.5 * length_m, along_m: None, halves: 0, began_m: 0.0, lowest: grip }
    }

    /// Half laps driven.
    pub(crate) fn halves(&self) -> usize {
        self.halves
    }

    /// Another grip is planned with.
    pub(crate) fn planned(&mut self, grip: f64) {
        let early = self.along_m.is_none_or(|m| m - self.began_m < (1.0 - COUNTS) * self.half_m);
        self.lowest = if early { grip } else { self.lowest.min(grip) };
    }

    /// The next place. At the end of a half lap: the grip that it was driven with. `grip` is planned with now.
    pub(crate) fn pass(&mut self, place: Place, grip: f64) -> Option<f64> {
        let length_m = 2.0 * self.half_m;
        let Some(before_m) = self.along_m else {
            // A start just before the line begins no lap of its own.
            let behind = place.station_m > 0.9 * length_m;
            let along_m = place.station_m - if behind { length_m } else { 0.0 };
            (self.along_m, self.began_m) = (Some(along_m), along_m);
            return None;
        };
        let step_m = place.station_m - before_m;
        let along_m = before_m + step_m - length_m * (step_m / length_m).round();
        self.along_m = Some(along_m);
        // The first half lap counts from where the car stood.
        let end_m = ((self.began_m / self.half_m + ROUNDING).floor() + 1.0) * self.half_m;
        if along_m < end_m {
            return None;
        }
        let whole = end_m - self.began_m > COUNTS * self.half_m;
        (self.began_m, self.halves) = (end_m, self.halves + 1);
        let driven = std::mem::replace(&mut self.lowest, grip);
        whole.then_some(driven)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Drives 10 m steps of a lap of 100 m; the grips of the half laps.
    fn drive(progress: &mut Progress, from_m: f64, to_m: f64, grip: f64) -> Vec<f64> {
        let steps = ((to_m - from_m) / 1.0).round() as i32;
        let at = |k: i32| Place { station_m: (from_m + f64::from(k)).rem_euclid(100.0), offset_m: 0.0 };
        (0..=steps).filter_map(|k| progress.pass(at(k), grip)).collect()
    }

    #[test]
    fn half_laps_count_from_the_line_and_only_whole_ones_were_driven() {
        let mut progress = Progress::new(100.0, 0.5);
        assert_eq!(drive(&mut progress, -3.0, 130.0, 0.5), [0.5, 0.5]);
        assert_eq!(progress.halves(), 3, "the line itself is a half lap's end");
        let mut late = Progress::new(100.0, 0.5);
        assert_eq!(drive(&mut late, 40.0, 130.0, 0.5), [0.5]);
    }

    #[test]
    fn no_half_lap_counts_twice_however_long_it_is() {
        for tenths in 600..900_i32 {
            let length_m = f64::from(tenths) * 0.1;
            let mut progress = Progress::new(length_m, 0.5);
            for k in 0..=1200_i32 {
                let station_m = (f64::from(k) * 0.01).fract() * length_m;
                progress.pass(Place { station_m, offset_m: 0.0 }, 0.5);
            }
            assert!((23..=24).contains(&progress.halves()), "{} of {length_m} m", progress.halves());
        }
    }

    #[test]
    fn a_plan_made_late_in_a_half_lap_was_not_driven() {
        let mut progress = Progress::new(100.0, 0.5);
        drive(&mut progress, 0.0, 5.0, 0.5);
        progress.planned(0.6);
        assert_eq!(drive(&mut progress, 6.0, 55.0, 0.6), [0.6]);
        drive(&mut progress, 56.0, 80.0, 0.6);
        progress.planned(0.7);
        assert_eq!(drive(&mut progress, 81.0, 104.0, 0.7), [0.6]);
        progress.planned(0.4);
        assert_eq!(drive(&mut progress, 105.0, 151.0, 0.4), [0.4]);
    }
}
