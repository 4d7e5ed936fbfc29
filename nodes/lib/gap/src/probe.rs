//! scratch
use crate::*;
use crate::effects::EffectId;
use crate::engine::*;
use gripsight_vehicle::*;
pub fn probe(rec: &Recording, veh: &VehicleParameters, tires: Option<PacejkaParameters>) {
    let t0 = std::time::Instant::now();
    eprintln!("channels {:?} sigma {:?} laps {:.2} lap_m {:.1} dt {} least {:.2}", rec.channels, rec.sigma, rec.laps.laps, rec.laps.lap_m, rec.dt_s(), rec.least_speed_mps);
    for i in &rec.identities { eprintln!("  {i:?}"); }
    let trust = if tires.is_some() { TireTrust::reference() } else { TireTrust::free() };
    let nominal = tires.unwrap_or(PacejkaParameters::from_array([6.5,1.5,1.0,0.0,6.5,1.5,1.0,0.0]));
    let mut e = Engine::new(rec, veh, nominal, trust);
    let sp = windows::split(rec, true);
    eprintln!("windows {} held {} substep {}", sp.training.windows.len(), sp.held_out.windows.len(), e.substep_s);
    let null = e.fit(&[], &e.nominal_parameters(), None, &sp.training, 30);
    eprintln!("null: cost {:.1} n {} {:?} {:?} [{:.2?}]", null.cost, null.fit.as_ref().unwrap().linearization.residuals, null.parameters, null.fit.as_ref().unwrap().stop, t0.elapsed());
    // per channel rms
    let ms = crate::select::channel_excess(&e, &null, &sp.training);
    eprintln!("mse/noise2 per channel {ms:?}");
    crate::select::reweigh(&mut e, &null, &sp.training);
    eprintln!("working sigma {:?}", e.sigma);
    let null = e.fit(&[], &null.parameters, Some(null.starts), &sp.training, 30);
    eprintln!("null: cost {:.1} {:?} [{:.2?}]", null.cost, null.parameters, t0.elapsed());
    let cands: Vec<EffectId> = EffectId::ALL.to_vec();
    let s = screen::screen(&e, &null, &cands, &sp.training);
    eprintln!("screen [{:.2?}]", t0.elapsed());
    let mut order: Vec<usize> = (0..s.candidates.len()).collect();
    order.sort_by(|&a,&b| s.candidates[b].gain.total_cmp(&s.candidates[a].gain));
    for &i in order.iter().take(14) { let c=&s.candidates[i]; eprintln!("  {:28} gain {:10.1} step {:?} err {:?}", c.effect.name(), c.gain, c.step, c.error); }
    if let Ok(names) = std::env::var("TRY") {
        for list in names.split(',') {
            let effects: Vec<EffectId> = list.split('+').map(|n| EffectId::by_name(n).unwrap()).collect();
            for mult in [1.0] {
                let t1 = std::time::Instant::now();
                let mut v = null.parameters.clone(); let base = v.len();
                for ef in &effects { for p in ef.spec().parameters { v.push(p.null + mult * e.size(p)); } }
                let f = e.fit(&effects, &v, Some(null.starts.clone()), &sp.training, 30);
                eprintln!("  {list:28} x{mult} dcost {:10.1} p {:?} tires {:?} [{:.0?} it {} {:?}] {:?}", null.cost - f.cost, &f.parameters[base..], &f.parameters[..base], t1.elapsed(), f.fit.as_ref().unwrap().iterations, f.fit.as_ref().unwrap().stop, crate::select::channel_excess(&e,&f,&sp.training));
                if std::env::var("W").is_ok() { for (i,w) in sp.training.windows.iter().enumerate() { let r=&rec.runs[w.segment]; eprintln!("   w t {:.1} v {:.1} ax {:.1} ay {:.1} null {:.0} now {:.0}", r.time_s(w.from), r.v_x_mps[w.from], r.a_x_mps2[w.from], r.v_x_mps[w.from]*r.measured[1][w.from], null.window_costs[i], f.window_costs[i]); } }
            }
        }
    }
}
