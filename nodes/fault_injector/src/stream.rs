//! One topic on its way through the node.

use std::collections::VecDeque;
use std::sync::Arc;

use byteorder::LittleEndian;
use gripsight_msgs::standard::builtin_interfaces::Time;
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

use crate::fault::{Fault, Kind, Topic};
use crate::signal::Signal;

/// Most bytes that are changed in a corrupt message.
const MOST_BYTES: usize = 8;
/// A share of the corrupt messages that is cut off.
const CUT: f64 = 0.2;
/// The wrong frame.
const OTHER_FRAME: &str = "another_frame";

/// A topic's faults, and what they need to remember. It is a function of what went in: the same messages give the same.
pub(crate) struct Stream<M> {
    faults: Vec<Fault>,
    rng: ChaCha8Rng,
    black: Arc<[u8]>,
    count: u64,
    frozen: Option<M>,
    /// Messages that are held back, each until the messages' time says so.
    late: VecDeque<(f64, M)>,
    turned: Vec<M>,
}

impl<M: Signal> Stream<M> {
    /// The stream of `topic` under those of `faults` that concern it; `black` is a file with a picture of nothing.
    pub(crate) fn new(topic: Topic, faults: &[Fault], seed: u64, black: Arc<[u8]>) -> Self {
        let faults = faults.iter().filter(|fault| fault.topic == topic).cloned().collect();
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(topic as u64 + 1);
        Self { faults, rng, black, count: 0, frozen: None, late: VecDeque::new(), turned: Vec::new() }
    }

    /// What goes out when `message` comes in `time_s` after the first: messages' bodies in CDR.
    pub(crate) fn pass(&mut self, time_s: f64, message: M) -> Vec<Vec<u8>> {
        self.count += 1;
        let at_work: Vec<Fault> =
            self.faults.iter().filter(|fault| fault.is_at_work(time_s)).cloned().collect();
        let has = |kind: Kind| at_work.iter().any(|fault| fault.kind == kind);
        if !has(Kind::Freeze) {
            self.frozen = None;
        }
        let mut out = vec![message];
        for fault in &at_work {
            out = out.into_iter().flat_map(|message| self.harm(fault, time_s, message)).collect();
        }
        if !has(Kind::Reorder) {
            out.splice(0..0, self.turned.drain(..).rev());
        }
        while self.late.front().is_some_and(|(due_s, _)| *due_s <= time_s || !has(Kind::Delay)) {
            out.extend(self.late.pop_front().map(|(_, message)| message));
        }
        let corrupt = at_work.iter().find(|fault| fault.kind == Kind::Corrupt).map(|fault| fault.size);
        out.into_iter().filter_map(|message| self.body(&message, corrupt)).collect()
    }

    /// What one fault makes of one message.
    fn harm(&mut self, fault: &Fault, time_s: f64, mut message: M) -> Vec<M> {
        let is_hit = self.rng.random::<f64>() < fault.size;
        match fault.kind {
            Kind::Drop if is_hit => return Vec::new(),
            Kind::Duplicate if is_hit => return vec![message.clone(), message],
            Kind::Rate if !self.count.is_multiple_of(fault.size.max(1.0) as u64) => return Vec::new(),
            Kind::Delay => {
                self.late.push_back((time_s + fault.size, message));
                return Vec::new();
            }
            Kind::Reorder => {
                self.turned.push(message);
                let is_full = self.turned.len() >= fault.size.max(2.0) as usize;
                return if is_full { self.turned.drain(..).rev().collect() } else { Vec::new() };
            }
            Kind::Second => {
                let mut other = message.clone();
                other.change(|value, _| value * (1.0 + fault.size));
                return vec![message, other];
            }
            Kind::Freeze => {
                let stamp = message.header().stamp;
                message = self.frozen.get_or_insert(message).clone();
                message.header().stamp = stamp;
            }
            Kind::Nan => message.change(|_, _| f64::NAN),
            Kind::Units => message.change(|value, factor| value * factor),
            Kind::Time => message.header().stamp = moved(message.header().stamp, fault.size),
            Kind::Frame => OTHER_FRAME.clone_into(&mut message.header().frame_id),
            Kind::Dark => message.darken(&self.black),
            Kind::Drop | Kind::Duplicate | Kind::Rate | Kind::Corrupt => {}
        }
        vec![message]
    }

    /// The message's bytes, of which some are others in the share `corrupt` of the messages.
    fn body(&mut self, message: &M, corrupt: Option<f64>) -> Option<Vec<u8>> {
        // What has been decoded can be encoded.
        let mut body = cdr_encoding::to_vec::<M, LittleEndian>(message).ok()?;
        if corrupt.is_some_and(|share| self.rng.random::<f64>() < share) {
            for _ in 0..self.rng.random_range(1..=MOST_BYTES) {
                let at = self.rng.random_range(0..body.len());
                body[at] = self.rng.random();
            }
            if self.rng.random::<f64>() < CUT {
                body.truncate(self.rng.random_range(0..body.len()));
            }
        }
        Some(body)
    }
}

/// A stamp `by_s` later.
fn moved(stamp: Time, by_s: f64) -> Time {
    let ns = i64::from(stamp.sec) * 1_000_000_000 + i64::from(stamp.nanosec) + (by_s * 1e9) as i64;
    let sec = i32::try_from(ns.div_euclid(1_000_000_000)).unwrap_or(i32::MAX);
    Time { sec, nanosec: ns.rem_euclid(1_000_000_000) as u32 }
}

#[cfg(test)]
mod tests {
    use gripsight_msgs::standard::nav_msgs::Odometry;
    use gripsight_msgs::standard::sensor_msgs::CompressedImage;

    use super::*;

    /// A hundred messages, ten a second, under one fault from 2 s to 5 s: stamps and speeds that go out.
    fn odometry(fault: &str) -> Vec<(f64, f64)> {
        let black: Arc<[u8]> = Arc::from(&[][..]);
        let mut stream = Stream::new(Topic::Odom, &[Fault::parse(fault).unwrap()], 3, black);
        let mut out = Vec::new();
        for index in 0..100 {
            let mut message = Odometry::default();
            message.header.stamp = moved(Time::default(), f64::from(index) * 0.1);
            message.twist.twist.linear.x = f64::from(index);
            for body in stream.pass(f64::from(index) * 0.1, message) {
                let Ok((message, _)) = cdr_encoding::from_bytes::<Odometry, LittleEndian>(&body) else {
                    continue;
                };
                let stamp = message.header.stamp;
                let stamp_s = f64::from(stamp.sec) + f64::from(stamp.nanosec) * 1e-9;
                out.push((stamp_s, message.twist.twist.linear.x));
            }
        }
        out
    }

    fn is_ordered(out: &[(f64, f64)]) -> bool {
        out.is_sorted_by(|a, b| a.0 < b.0)
    }

    #[test]
    fn nothing_is_touched_before_and_after() {
        for kind in Kind::ALL.iter().filter(|kind| kind.concerns(Topic::Odom)) {
            let size = kind.sizes()[1];
            let out = odometry(&format!("{} odom 2 3 {size}", kind.name()));
            let whole = |part: &[(f64, f64)]| {
                part.iter().all(|(stamp_s, value)| (stamp_s * 10.0 - value).abs() < 1e-6)
            };
            assert!(whole(&out[..20]), "{kind:?}");
            assert!(whole(&out[out.len() - 49..]), "{kind:?}: {:?}", &out[out.len() - 50..]);
        }
    }

    #[test]
    fn each_kind_does_what_it_says() {
        assert_eq!(odometry("drop odom 2 3 1").len(), 70);
        assert_eq!(odometry("rate odom 2 3 5").len(), 76);
        assert_eq!(odometry("duplicate odom 2 3 1").len(), 130);
        assert_eq!(odometry("second odom 2 3 0.5").len(), 130);
        let late = odometry("delay odom 2 3 0.5");
        // Half a second is still held back when the fault ends; newer messages overtake it.
        assert!(late.len() == 100 && is_ordered(&late[..46]) && !is_ordered(&late), "held back, none lost");
        let turned = odometry("reorder odom 2 3 4");
        assert!(turned.len() == 100 && !is_ordered(&turned));
        let frozen = odometry("freeze odom 2 3 1");
        assert!(is_ordered(&frozen) && frozen[20..50].iter().all(|(_, value)| *value == 20.0));
        assert!(odometry("nan odom 2 3 1")[20..50].iter().all(|(_, value)| value.is_nan()));
        assert!((odometry("units odom 2 3 1")[30].1 - 108.0).abs() < 1e-9);
        assert!((odometry("time odom 2 3 -1.5")[30].0 - 1.5).abs() < 1e-6);
        assert_ne!(odometry("corrupt odom 2 3 1"), odometry("frame odom 2 3 1"));
        assert_eq!(odometry("corrupt odom 2 3 1"), odometry("corrupt odom 2 3 1"));
    }

    #[test]
    fn a_dark_camera_gives_the_black_picture() {
        let fault = Fault::parse("dark image/compressed 0 9 1").unwrap();
        let mut stream = Stream::new(Topic::Picture, &[fault], 1, Arc::from(&b"black"[..]));
        let bodies = stream.pass(1.0, CompressedImage { data: vec![1; 99], ..CompressedImage::default() });
        let (message, _) = cdr_encoding::from_bytes::<CompressedImage, LittleEndian>(&bodies[0]).unwrap();
        assert_eq!(message.data, b"black");
    }
}
