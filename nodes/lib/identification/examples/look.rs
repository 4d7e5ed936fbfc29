//! Identifies bag folders and prints what was found.
mod support;
use gripsight_identification::{Config, FrictionPrior, Method, ResidualKind, Stage, identify};
use std::time::Instant;

fn main() -> anyhow::Result<()> {
    let mut config = Config::default();
    let mut prior = None;
    let mut length = f64::INFINITY;
    for arg in std::env::args().skip(1) {
        if let Some(v) = arg.strip_prefix("--") {
            let (k, v) = v.split_once('=').unwrap_or((v, ""));
            match k {
                "paper" => config.method = Method::Paper,
                "residual" => config.residual = ResidualKind::from_name(v).unwrap(),
                "mu" => prior = Some(FrictionPrior { mu: v.parse()?, sigma: 0.1 }),
                "len" => length = v.parse()?,
                "epochs" => config.epochs = v.parse()?,
                "nodirect" => config.direct_start = false,
                "json" => {}
                _ => anyhow::bail!("{k}"),
            }
            continue;
        }
        if let Some(spec) = arg.strip_prefix("ref:") {
            let f: Vec<&str> = spec.split(':').collect();
            let run =
                support::reference_run(f[0], f[1], f[2].parse()?, f[3].parse()?, f[4].parse()?, f.len() > 5);
            let o = identify(&run.sequence, &run.vehicle, prior, None, &config, &mut |_| {})?;
            let (a, b) = (support::floor(&run.truth.front)?, support::floor(&run.truth.rear)?);
            let s = support::score(&o.phi_p, &run.truth);
            let g = o.signals.to_array().map(|v| (v * 1e4).round() / 1e4);
            println!(
                "{} acc {} {:?} ratio {:.3} {:.3} score {:.4} {:.4} signals {:?} relax {:?} slip {:.3} {:.3} reached {} {} noise {:?} roll {:.3}",
                run.name,
                o.accepted,
                o.source,
                s[0] / a.1,
                s[1] / b.1,
                s[0],
                s[1],
                g,
                o.nuisance,
                o.slip_range_rad.front.high,
                o.slip_range_rad.rear.high,
                o.peak_friction.front.reached,
                o.peak_friction.rear.reached,
                o.rmse.noise,
                o.rmse.rollout.after
            );
            println!(
                "   phi {:?} floor {:?} {:?}",
                o.phi_p.to_array().map(|v| (v * 1e2).round() / 1e2),
                a.0,
                b.0
            );
            continue;
        }
        let folder = std::path::Path::new(&arg);
        let truth = folder
            .join("truth_axle_forces.csv")
            .exists()
            .then(|| support::read_with_truth(folder, length))
            .transpose()?;
        let (vehicle, sequence) = support::read(folder, length)?;
        let begin = Instant::now();
        let mut split = [0.0; 3];
        let mut last = (0, begin);
        let o = identify(&sequence, &vehicle, prior, None, &config, &mut |s| {
            let now = Instant::now();
            split[last.0] += (now - last.1).as_secs_f64();
            last = (
                match s {
                    Stage::Preparing => 0,
                    Stage::Training { .. } => 1,
                    Stage::Fitting { .. } => 2,
                },
                now,
            );
        })?;
        split[last.0] += last.1.elapsed().as_secs_f64();
        println!(
            "=== {arg}: {:.2} s (prep {:.2} train {:.2} fit {:.2}) accepted {} source {:?} it {} conv {}",
            begin.elapsed().as_secs_f64(),
            split[0],
            split[1],
            split[2],
            o.accepted,
            o.source,
            o.iterations,
            o.converged
        );
        println!("  phi {:?}", o.phi_p.to_array().map(|v| (v * 1e3).round() / 1e3));
        println!("  ls  {:?}", o.least_squares.map(|p| p.to_array().map(|v| (v * 1e3).round() / 1e3)));
        println!("  K {:?}", o.cornering_stiffness_n_per_rad);
        println!("  D f {:?} r {:?}", o.peak_friction.front, o.peak_friction.rear);
        println!("  slip f {:?} r {:?}", o.slip_range_rad.front, o.slip_range_rad.rear);
        let s = &o.signal_intervals;
        for (n, e) in [
            ("delay", s.steering_delay_s),
            ("gain", s.steering_gain),
            ("offset", s.steering_offset_rad),
            ("lever", s.v_y_lever_arm_m),
            ("vybias", s.v_y_bias_mps),
            ("rbias", s.yaw_rate_bias_radps),
        ] {
            print!("  {n} {:.4} [{:.4} {:.4}]", e.value, e.low, e.high);
        }
        println!(
            "\n  relax {:?} rmse one {:?}\n  roll {:?} noise {:?}",
            o.nuisance, o.rmse.one_step, o.rmse.rollout, o.rmse.noise
        );
        for t in &o.history {
            println!(
                "  turn {} change {:.4} fit {:.4} val {:.4} extra {:.2} v {:.1} ep {} loss {:.3} {:?}",
                t.iteration,
                t.change,
                t.fit_rmse,
                t.validation_rmse,
                t.extrapolated_share,
                t.sweep_speed_mps,
                t.epochs,
                t.residual_loss,
                t.phi_p.to_array().map(|v| (v * 1e2).round() / 1e2)
            );
        }
        for r in &o.reasons {
            println!("  - {r}");
        }
        if let Some(run) = truth {
            let (f, r) = (support::floor(&run.truth.front)?, support::floor(&run.truth.rear)?);
            let s = support::score(&o.phi_p, &run.truth);
            println!(
                "  SCORE {:.4} {:.4} floor {:.4} {:.4} RATIO {:.3} {:.3} ",
                s[0],
                s[1],
                f.1,
                r.1,
                s[0] / f.1,
                s[1] / r.1
            );
            println!("  floor {:?} {:?}", f.0, r.0);
            if let Some(ls) = o.least_squares {
                let s = support::score(&ls, &run.truth);
                println!("  LS RATIO {:.3} {:.3}", s[0] / f.1, s[1] / r.1);
            }
        }
    }
    Ok(())
}
