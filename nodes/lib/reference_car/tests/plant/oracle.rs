//! A plain single-track model with the four-parameter Magic Formula, written for these tests alone.

use gripsight_reference_car::{CarParameters, GRAVITY_MPS2, TruthSample};
use nalgebra::{Matrix4, Vector4};

/// Stiffness over load, peak, shape, curvature of one axle.
pub(crate) type Axle = [f64; 4];

/// Force over load at a slip angle.
pub(crate) fn force(p: &Axle, alpha: f64) -> f64 {
    let [k, d, c, e] = *p;
    let b = k / (c * d);
    d * (c * (b * alpha - e * (b * alpha - (b * alpha).atan())).atan()).sin()
}

/// Least-squares fit of an axle's curve to points (slip angle, force over load), by Levenberg's method.
pub(crate) fn fit(points: &[(f64, f64)], start: Axle) -> (Axle, f64) {
    let cost = |p: &Axle| points.iter().map(|&(a, f)| (force(p, a) - f).powi(2)).sum::<f64>();
    let mut p = start;
    let mut damping = 1e-3;
    for _ in 0..200 {
        let mut normal = Matrix4::zeros();
        let mut gradient = Vector4::zeros();
        for &(alpha, f) in points {
            let slope = Vector4::from_fn(|i, _| {
                let (mut up, mut down) = (p, p);
                let h = 1e-6 * p[i].abs().max(1e-2);
                up[i] += h;
                down[i] -= h;
                (force(&up, alpha) - force(&down, alpha)) / (2.0 * h)
            });
            normal += slope * slope.transpose();
            gradient += slope * (f - force(&p, alpha));
        }
        let damped = normal + Matrix4::from_diagonal(&normal.diagonal()) * damping;
        let Some(step) = damped.lu().solve(&gradient) else { break };
        let next = [0, 1, 2, 3].map(|i| p[i] + step[i]);
        if next[1] > 0.0 && next[2] > 0.0 && cost(&next) < cost(&p) {
            p = next;
            damping *= 0.3;
        } else {
            damping *= 4.0;
        }
    }
    (p, (cost(&p) / points.len() as f64).sqrt())
}

/// Slip angles of the two axles as the single track sees them.
pub(crate) fn slips(car: &CarParameters, t: &TruthSample) -> [f64; 2] {
    let m = &t.motion;
    [
        m.steering_rad - ((m.v_y_mps + car.l_f_m * m.yaw_rate_radps) / m.v_x_mps).atan(),
        -((m.v_y_mps - car.l_r_m * m.yaw_rate_radps) / m.v_x_mps).atan(),
    ]
}

/// Static axle loads.
pub(crate) fn loads_n(car: &CarParameters) -> [f64; 2] {
    let weight_n = car.mass_kg * GRAVITY_MPS2;
    [weight_n * car.l_r_m / car.wheelbase_m(), weight_n * car.l_f_m / car.wheelbase_m()]
}

/// Fits both axles to the true forces of a run: parameters and root-mean-square error of force over load.
pub(crate) fn fit_car(car: &CarParameters, truth: &[TruthSample]) -> [(Axle, f64); 2] {
    let loads = loads_n(car);
    [0, 1].map(|axle| {
        let points: Vec<(f64, f64)> = truth
            .iter()
            .map(|t| {
                let side_n = if axle == 0 { t.front_axle_n()[1] } else { t.rear_axle_n()[1] };
                (slips(car, t)[axle], side_n / loads[axle])
            })
            .collect();
        let k = if axle == 0 { car.tire_front } else { car.tire_rear }.cornering_stiffness_per_rad;
        fit(&points, [k, 0.9, 1.4, 0.0])
    })
}

/// Root-mean-square error of open-loop rollouts of one second over the signal's own: lateral speed, yaw rate.
///
/// v_x, the steering angle and the longitudinal forces are inputs.
pub(crate) fn rollout_error(car: &CarParameters, tires: &[Axle; 2], truth: &[TruthSample]) -> [f64; 2] {
    let loads = loads_n(car);
    let (mut error, mut signal) = ([0.0; 2], [0.0; 2]);
    for window in truth.chunks_exact(100) {
        let (mut v_y, mut r) = (window[0].motion.v_y_mps, window[0].motion.yaw_rate_radps);
        for pair in window.windows(2) {
            let dt_s = (pair[1].motion.time_s - pair[0].motion.time_s) / 10.0;
            // The steering command holds between two samples.
            let d = pair[0].motion.steering_rad;
            for i in 0..10 {
                let share = (f64::from(i) + 0.5) / 10.0;
                let mix = |a: f64, b: f64| a + share * (b - a);
                let v_x = mix(pair[0].motion.v_x_mps, pair[1].motion.v_x_mps);
                let push = mix(pair[0].front_axle_n()[0], pair[1].front_axle_n()[0]);
                let rates = |v_y: f64, r: f64| {
                    let front = loads[0] * force(&tires[0], d - ((v_y + car.l_f_m * r) / v_x).atan());
                    let rear = loads[1] * force(&tires[1], -((v_y - car.l_r_m * r) / v_x).atan());
                    let side = front * d.cos() + push * d.sin();
                    (
                        (rear + side) / car.mass_kg - v_x * r,
                        (side * car.l_f_m - rear * car.l_r_m) / car.yaw_inertia_kgm2,
                    )
                };
                let half = rates(v_y, r);
                let full = rates(v_y + half.0 * dt_s / 2.0, r + half.1 * dt_s / 2.0);
                v_y += full.0 * dt_s;
                r += full.1 * dt_s;
            }
            let m = &pair[1].motion;
            for (i, (model, true_value)) in [(v_y, m.v_y_mps), (r, m.yaw_rate_radps)].into_iter().enumerate()
            {
                error[i] += (model - true_value).powi(2);
                signal[i] += true_value.powi(2);
            }
        }
    }
    [0, 1].map(|i| (error[i] / signal[i]).sqrt())
}
