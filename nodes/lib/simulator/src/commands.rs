//! What was commanded, at its own stamps, and what became of it on the way to the wheels.

use gripsight_signals::StateSequence;

/// A command in force from its stamp to the next.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Command {
    /// Its stamp, since the first sample of the recording.
    pub time_s: f64,
    /// Road-wheel angle asked for.
    pub steering_rad: f64,
    /// Speed asked for.
    pub speed_mps: f64,
    /// Acceleration asked for.
    pub acceleration_mps2: f64,
}

/// What happens to the steering command before the simulator sees it. All zero: nothing.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct CommandEffects {
    /// Dead time.
    pub delay_s: f64,
    /// Time constant of a first-order lag.
    pub lag_s: f64,
    /// Angle over command, less one.
    pub gain: f64,
    /// Angle at a command of zero.
    pub offset_rad: f64,
    /// Half width of the play.
    pub backlash_rad: f64,
    /// One over the largest rate of the angle, s/rad; zero: no limit.
    pub slowness_s_per_rad: f64,
}

/// The commands of a recording, in the order of their stamps.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Commands(Vec<Command>);

impl Commands {
    /// Takes commands; those that are not after the one before are left out.
    #[must_use]
    pub fn new(commands: impl IntoIterator<Item = Command>) -> Self {
        let mut kept: Vec<Command> = Vec::new();
        for c in commands {
            if kept.last().is_none_or(|last| c.time_s > last.time_s) {
                kept.push(c);
            }
        }
        Self(kept)
    }

    /// The commands of a sequence at their own stamps; where it holds none, the steering on the odometry's.
    #[must_use]
    pub fn of(sequence: &StateSequence) -> Self {
        let at = |channel: &[f32], k: usize| channel.get(k).map_or(0.0, |v| f64::from(*v));
        let own = !sequence.command_time_s.is_empty();
        let (times, steering) = if own {
            (&sequence.command_time_s, &sequence.command_steering_rad)
        } else {
            (&sequence.time_s, &sequence.steering_rad)
        };
        Self::new(times.iter().enumerate().map(|(k, t)| Command {
            time_s: f64::from(*t),
            steering_rad: at(steering, k),
            speed_mps: if own { at(&sequence.command_speed_mps, k) } else { 0.0 },
            acceleration_mps2: if own { at(&sequence.command_acceleration_mps2, k) } else { 0.0 },
        }))
    }

    /// Whether there is none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Whether a field is anything but zero somewhere.
    #[must_use]
    pub fn carries(&self, of: impl Fn(&Command) -> f64) -> bool {
        self.0.iter().any(|c| of(c) != 0.0)
    }

    /// The mean of a held field over each of `steps` steps from `start_s` on: what a simulator that holds its input must be given to
    /// receive the same area, however the stamps fall between its steps.
    #[must_use]
    pub fn held(&self, of: impl Fn(&Command) -> f64, start_s: f64, step_s: f64, steps: usize) -> Vec<f64> {
        let Some(first) = self.0.first() else { return vec![0.0; steps] };
        let mut at = self.0.partition_point(|c| c.time_s <= start_s).saturating_sub(1);
        let mut out = Vec::with_capacity(steps);
        for k in 0..steps {
            let (from, to) = (start_s + k as f64 * step_s, start_s + (k + 1) as f64 * step_s);
            let mut area = 0.0;
            let mut t = from;
            while t < to {
                let current = if self.0[at].time_s <= t { of(&self.0[at]) } else { of(first) };
                let next_s = match self.0.get(at + 1) {
                    Some(next) if self.0[at].time_s <= t => next.time_s,
                    Some(_) => self.0[at].time_s,
                    None => f64::INFINITY,
                };
                let until = next_s.min(to);
                area += current * (until - t);
                if next_s <= to && self.0[at].time_s <= t && at + 1 < self.0.len() {
                    at += 1;
                }
                t = until;
            }
            out.push(area / step_s);
        }
        out
    }

    /// A field at every step from `start_s` on, straight from command to command: an angle that was measured, not asked for.
    #[must_use]
    pub fn straight(
        &self,
        of: impl Fn(&Command) -> f64,
        start_s: f64,
        step_s: f64,
        steps: usize,
    ) -> Vec<f64> {
        let c = &self.0;
        let at = |t_s: f64| match c.partition_point(|c| c.time_s <= t_s) {
            0 => c.first().map_or(0.0, &of),
            k if k == c.len() => of(&c[k - 1]),
            k => {
                let (a, b) = (&c[k - 1], &c[k]);
                of(a) + (of(b) - of(a)) * (t_s - a.time_s) / (b.time_s - a.time_s)
            }
        };
        (0..steps).map(|k| at(start_s + k as f64 * step_s)).collect()
    }

    /// The steering angle after the effects: held over each step, or (`is_measured`) straight from stamp to stamp, at each step.
    #[must_use]
    pub fn steering(
        &self,
        effects: &CommandEffects,
        is_measured: bool,
        start_s: f64,
        step_s: f64,
        steps: usize,
    ) -> Vec<f64> {
        let e = effects;
        let from_s = start_s - e.delay_s;
        let mut angle = if is_measured {
            self.straight(|c| c.steering_rad, from_s, step_s, steps)
        } else {
            self.held(|c| c.steering_rad, from_s, step_s, steps)
        };
        angle.iter_mut().for_each(|a| *a = (1.0 + e.gain) * *a + e.offset_rad);
        let Some(&first) = angle.first() else { return angle };
        if e.slowness_s_per_rad > 0.0 {
            let most = step_s / e.slowness_s_per_rad;
            let mut now = first;
            angle.iter_mut().for_each(|a| {
                now += (*a - now).clamp(-most, most);
                *a = now;
            });
        }
        if e.lag_s > 0.0 {
            let left = (-step_s / e.lag_s).exp();
            // The mean of the response over the step: continuous down to no lag at all.
            let mean = e.lag_s / step_s * (1.0 - left);
            let mut now = first;
            angle.iter_mut().for_each(|a| {
                let asked = *a;
                *a = asked + (now - asked) * mean;
                now = asked + (now - asked) * left;
            });
        }
        if e.backlash_rad > 0.0 {
            let mut now = first;
            angle.iter_mut().for_each(|a| {
                now = now.clamp(*a - e.backlash_rad, *a + e.backlash_rad);
                *a = now;
            });
        }
        angle
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ramp(step_s: f64) -> Commands {
        Commands::new((0..200).map(|k| {
            let time_s = k as f64 * step_s;
            Command { time_s, steering_rad: (5.0 * time_s).sin(), ..Command::default() }
        }))
    }

    #[test]
    fn commands_are_held_whatever_their_stamps() {
        let commands = Commands::new([
            Command { time_s: 0.0, steering_rad: 1.0, ..Command::default() },
            Command { time_s: 0.015, steering_rad: 3.0, ..Command::default() },
        ]);
        let held = commands.held(|c| c.steering_rad, -0.01, 0.01, 4);
        for (got, expected) in held.iter().zip([1.0, 1.0, 2.0, 3.0]) {
            approx::assert_abs_diff_eq!(*got, expected, epsilon = 1e-9);
        }
        assert!(Commands::default().held(|c| c.speed_mps, 0.0, 0.01, 3) == [0.0; 3]);
    }

    #[test]
    fn every_effect_is_nothing_at_zero_and_grows_smoothly_from_there() {
        let commands = ramp(0.01);
        let with = |e: CommandEffects| commands.steering(&e, false, 0.0, 0.01, 150);
        let plain = with(CommandEffects::default());
        let none = CommandEffects::default();
        let of = |size: f64| {
            [
                CommandEffects { delay_s: size, ..none },
                CommandEffects { lag_s: size, ..none },
                CommandEffects { gain: size, ..none },
                CommandEffects { offset_rad: size, ..none },
                CommandEffects { backlash_rad: size, ..none },
                CommandEffects { slowness_s_per_rad: size, ..none },
            ]
        };
        let apart = |e| with(e).iter().zip(&plain).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        for (small, large) in of(1e-4).into_iter().zip(of(0.3)) {
            assert!(apart(small) < 2e-3 && apart(large) > 0.02, "{small:?} {}", apart(large));
        }
        // A delay of whole steps is a shift, a lag of T trails a ramp by T.
        let late = with(CommandEffects { delay_s: 0.05, ..none });
        approx::assert_abs_diff_eq!(late[100], plain[95], epsilon = 1e-9);
    }
}
