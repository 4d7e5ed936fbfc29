//! A folder of CommonRoad's vehicle models. They know one tire for both axles: it is the mean of both.

use gripsight_model::OutsideTerm;

use super::Figures;

/// What it has a term for, beside the car's figures.
pub(super) const TERMS: [OutsideTerm; 1] = [OutsideTerm::SteeringRateLimit];

/// A rate that does not limit.
const RATE_RADPS: f64 = 10.0;

pub(super) fn files(f: &Figures) -> Vec<(String, String)> {
    let [front, rear] = [&f.tires.front, &f.tires.rear];
    let wheelbase_m = f.l_f_m + f.l_r_m;
    // Each axle by the load it carries.
    let mean = |front: f64, rear: f64| (front * f.l_r_m + rear * f.l_f_m) / wheelbase_m;
    let rate_radps = f.rate_radps.unwrap_or(RATE_RADPS);
    let turn_radps = rate_radps;
    let vehicle = format!(
        "# Found by gripsight. Complete for the kinematic and the single-track model (st); the drift and multibody models (std, mb) need \
         springs,\n# wheels and longitudinal tire figures of one of the package's cars beside it. One tire serves both axles there: B C D is \
         {:.3} at the\n# front and {:.3} at the rear.\nl: {}\nw: {}\n\
         steering:\n  min: {}\n  max: {}\n  v_min: {}\n  v_max: {}\n  kappa_dot_max: {turn_radps}\n  kappa_dot_dot_max: 20\n\
         # Not found: roomy, so that nothing here limits.\n\
         longitudinal:\n  v_min: -10.0\n  v_max: 100.0\n  v_switch: 100.0\n  a_max: 15.0\n  j_max: 10000.0\n  j_dot_max: 10000.0\n\
         m: {}\nI_z: {}\na: {}\nb: {}\nh_s: {}\nh_cg: {}\nR_w: {}\nT_sb: {}\nT_se: {}\n",
        front.normalized_stiffness(),
        rear.normalized_stiffness(),
        1.6 * wheelbase_m,
        0.7 * wheelbase_m,
        -f.max_steering_rad,
        f.max_steering_rad,
        -rate_radps,
        rate_radps,
        f.mass_kg,
        f.yaw_inertia_kgm2,
        f.l_f_m,
        f.l_r_m,
        f.h_cg_m,
        f.h_cg_m,
        f.wheel_radius_m,
        f.brake_front_share,
        f.drive_front_share,
    );
    let tire = format!(
        "# Found by gripsight: the lateral figures.\ntire:\n  p_dy1: {}\n  p_dy3: 0.0\n  p_cy1: {}\n  p_ey1: {}\n  p_ky1: {}\n  p_hy1: 0.0\n  \
         p_hy3: 0.0\n  p_vy1: 0.0\n  p_vy3: 0.0\n",
        mean(front.d, rear.d),
        mean(front.c, rear.c),
        mean(front.e, rear.e),
        // Negative for a car: the force is against the slip.
        -mean(front.normalized_stiffness(), rear.normalized_stiffness()),
    );
    vec![("parameters_vehicle1.yaml".to_owned(), vehicle), ("parameters_tire.yaml".to_owned(), tire)]
}
