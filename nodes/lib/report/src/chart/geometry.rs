//! Curves cut to the frame.

/// From where to where a picture reaches.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Frame {
    pub(super) x: (f64, f64),
    pub(super) y: (f64, f64),
}

impl Frame {
    pub(super) fn holds(&self, (x, y): (f64, f64)) -> bool {
        (self.x.0..=self.x.1).contains(&x) && (self.y.0..=self.y.1).contains(&y)
    }

    pub(super) fn clamp_x(&self, x: f64) -> f64 {
        x.clamp(self.x.0, self.x.1)
    }

    pub(super) fn clamp_y(&self, y: f64) -> f64 {
        y.clamp(self.y.0, self.y.1)
    }

    /// The part of a segment inside the frame (Liang and Barsky).
    pub(super) fn cut(&self, from: (f64, f64), to: (f64, f64)) -> Option<[(f64, f64); 2]> {
        let (dx, dy) = (to.0 - from.0, to.1 - from.1);
        let (mut enter, mut leave) = (0.0_f64, 1.0_f64);
        let sides = [
            (-dx, from.0 - self.x.0),
            (dx, self.x.1 - from.0),
            (-dy, from.1 - self.y.0),
            (dy, self.y.1 - from.1),
        ];
        for (direction, distance) in sides {
            if direction == 0.0 {
                if distance < 0.0 {
                    return None;
                }
            } else if direction < 0.0 {
                enter = enter.max(distance / direction);
            } else {
                leave = leave.min(distance / direction);
            }
        }
        let at = |t: f64| (from.0 + t * dx, from.1 + t * dy);
        (enter < leave).then(|| [at(enter), at(leave)])
    }

    /// The parts of a curve inside the frame: interrupted by NaN and by leaving it.
    pub(super) fn pieces(&self, points: &[(f64, f64)]) -> Vec<Vec<(f64, f64)>> {
        let mut pieces: Vec<Vec<(f64, f64)>> = Vec::new();
        let mut open = false;
        for pair in points.windows(2) {
            let finite = |p: (f64, f64)| p.0.is_finite() && p.1.is_finite();
            let inside = if finite(pair[0]) && finite(pair[1]) { self.cut(pair[0], pair[1]) } else { None };
            match (inside, pieces.last_mut()) {
                (Some([_, to]), Some(last)) if open => last.push(to),
                (Some([from, to]), _) => pieces.push(vec![from, to]),
                (None, _) => {}
            }
            open = inside.is_some_and(|[_, to]| to == pair[1]);
        }
        pieces
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FRAME: Frame = Frame { x: (0.0, 10.0), y: (0.0, 1.0) };

    #[test]
    fn segments_end_at_the_frame() {
        assert_eq!(FRAME.cut((-5.0, 0.5), (5.0, 0.5)), Some([(0.0, 0.5), (5.0, 0.5)]));
        assert_eq!(FRAME.cut((2.0, -1.0), (2.0, 3.0)), Some([(2.0, 0.0), (2.0, 1.0)]));
        assert_eq!(FRAME.cut((2.0, 2.0), (4.0, 3.0)), None);
        assert_eq!(FRAME.cut((-1.0, 0.5), (-1.0, 0.7)), None);
    }

    #[test]
    fn a_curve_falls_into_its_visible_pieces() {
        let points =
            [(0.0, 0.5), (1.0, 0.5), (2.0, f64::NAN), (3.0, 0.5), (4.0, 1.5), (5.0, 0.5), (6.0, 0.5)];
        let pieces = FRAME.pieces(&points);
        assert_eq!(pieces.len(), 3);
        assert_eq!(pieces[0], [(0.0, 0.5), (1.0, 0.5)]);
        assert_eq!(pieces[1], [(3.0, 0.5), (3.5, 1.0)]);
        assert_eq!(pieces[2], [(4.5, 1.0), (5.0, 0.5), (6.0, 0.5)]);
    }
}
