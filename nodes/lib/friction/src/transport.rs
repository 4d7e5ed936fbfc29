//! Did a fresh picture arrive, and is the camera still looking?

use crate::estimate::Reason;
use crate::picture::{FrameData, RawPicture};

/// A stamp that goes back further than this means that the clock was set back (a bag started again); less is one late
/// message. Nanoseconds.
const CLOCK_JUMP_NS: i64 = 1_000_000_000;

/// Limits of the transport gate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TransportLimits {
    /// Age above which a picture is stale, seconds.
    pub most_age_s: f64,
    /// How far ahead of the clock a stamp may lie, seconds.
    pub most_ahead_s: f64,
    /// Distance that the car may travel while the picture stays the same to the byte, metres.
    pub frozen_after_m: f64,
}

impl Default for TransportLimits {
    fn default() -> Self {
        Self { most_age_s: 0.5, most_ahead_s: 0.1, frozen_after_m: 0.5 }
    }
}

/// Remembers what the last picture was.
#[derive(Debug, Clone, Default)]
pub struct TransportGate {
    newest_ns: Option<i64>,
    /// The last picture's fingerprint, and the distance at which it was first seen.
    last: Option<(u64, Option<f64>)>,
}

impl TransportGate {
    /// Whether a picture with this stamp comes after the clock was set back.
    #[must_use]
    pub fn clock_went_back(&self, stamp_ns: i64) -> bool {
        self.newest_ns.is_some_and(|newest| newest.saturating_sub(stamp_ns) > CLOCK_JUMP_NS)
    }

    /// Judges a picture by its stamp and its bytes. `distance_m`: distance travelled so far, where known.
    pub fn check(
        &mut self,
        limits: &TransportLimits,
        stamp_ns: i64,
        now_ns: i64,
        data: &FrameData<'_>,
        distance_m: Option<f64>,
    ) -> Option<Reason> {
        if self.newest_ns.is_some_and(|newest| stamp_ns < newest) {
            return Some(Reason::OutOfOrder);
        }
        self.newest_ns = Some(stamp_ns);
        let age_s = (now_ns.saturating_sub(stamp_ns)) as f64 * 1e-9;
        if age_s > limits.most_age_s || age_s < -limits.most_ahead_s {
            return Some(Reason::Stale);
        }
        let print = fingerprint(data);
        match self.last {
            Some((last, since_m)) if last == print => {
                let moved_m = distance_m.zip(since_m).map_or(0.0, |(now, then)| now - then);
                // The distance may have become known only after the picture did.
                self.last = Some((print, since_m.or(distance_m)));
                (moved_m > limits.frozen_after_m).then_some(Reason::Frozen)
            }
            _ => {
                self.last = Some((print, distance_m));
                None
            }
        }
    }
}

/// FNV-1a over up to 16384 eight-byte words spread over the picture: two frames of a living sensor never agree on them.
fn fingerprint(data: &FrameData<'_>) -> u64 {
    let bytes = match data {
        FrameData::Raw(RawPicture { data, .. }) => data,
        FrameData::Compressed(bytes) => bytes,
    };
    let (words, rest) = bytes.as_chunks::<8>();
    let stride = words.len().div_ceil(16384).max(1);
    let mut hash = 0xcbf2_9ce4_8422_2325u64 ^ bytes.len() as u64;
    let mut mix = |word: u64| hash = (hash ^ word).wrapping_mul(0x0100_0000_01b3).rotate_left(23);
    words.iter().step_by(stride).for_each(|w| mix(u64::from_le_bytes(*w)));
    rest.iter().for_each(|b| mix(u64::from(*b)));
    hash
}

#[cfg(test)]
mod tests {
    use super::*;

    const S: i64 = 1_000_000_000;

    #[test]
    fn old_and_reordered_pictures_are_refused() {
        let (limits, mut gate) = (TransportLimits::default(), TransportGate::default());
        let a = FrameData::Compressed(b"a");
        let b = FrameData::Compressed(b"b");
        assert_eq!(gate.check(&limits, 10 * S, 10 * S, &a, None), None);
        assert_eq!(gate.check(&limits, 95 * S / 10, 10 * S, &b, None), Some(Reason::OutOfOrder));
        assert!(!gate.clock_went_back(95 * S / 10) && gate.clock_went_back(8 * S));
        assert_eq!(gate.check(&limits, 11 * S, 12 * S, &b, None), Some(Reason::Stale));
        assert_eq!(gate.check(&limits, 20 * S, 12 * S, &b, None), Some(Reason::Stale));
    }

    #[test]
    fn the_same_picture_is_frozen_only_while_driving() {
        let (limits, mut gate) = (TransportLimits::default(), TransportGate::default());
        let (still, moved) = (FrameData::Compressed(b"still here"), FrameData::Compressed(b"still herf"));
        let mut at = |k: i64, data, m| gate.check(&limits, k * S, k * S, data, m);
        assert_eq!(at(1, &still, None), None);
        assert_eq!(at(2, &still, Some(3.0)), None);
        assert_eq!(at(3, &still, Some(3.4)), None);
        assert_eq!(at(4, &still, Some(3.6)), Some(Reason::Frozen));
        assert_eq!(at(5, &moved, Some(4.6)), None);
        assert_eq!(at(6, &moved, Some(4.7)), None);
    }
}
