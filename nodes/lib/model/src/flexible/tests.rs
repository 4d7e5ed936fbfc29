use super::*;
use crate::model::ExtendedModel;
use crate::model::tests::{recording, tires};
use crate::rollout::Window;
use gripsight_vehicle::VehicleParameters;

/// The signals of half a second with some terms at some values.
fn predicted(flexible: Option<Flexible>, own: &[f64]) -> Vec<Vec<f64>> {
    let recording = Recording { has_command: true, ..recording(4) };
    let vehicle = VehicleParameters::f1tenth();
    let mut model = ExtendedModel::new(&recording, &vehicle, &[], 0.0025);
    model.flexible = flexible;
    let mut p = tires().to_parameters().to_vec();
    p.push(0.0);
    p.extend(own);
    let out = model.predict(&p, [0.05, 0.4], &Window { segment: 0, from: 120, len: 50 });
    vec![out.v_y_mps, out.yaw_rate_radps, out.a_y_mps2, out.a_x_mps2, out.v_x_mps]
}

fn of_sites(sites: &[Site]) -> Flexible {
    Flexible::new(&recording(4), 0.1, 0.3, sites)
}

#[test]
fn groups_tell_whose_the_parameters_are() {
    let all = of_sites(&Site::ALL);
    assert_eq!(all.groups().iter().map(|g| g.site).collect::<Vec<_>>(), Site::ALL);
    assert_eq!(all.groups().iter().map(|g| g.parameters).sum::<usize>(), all.parameters());
    assert_eq!(all.groups()[1], Group { site: Site::FrontAxle, parameters: 15 });
}

#[test]
fn terms_at_nothing_leave_the_model_as_it_is() {
    let plain = predicted(None, &[]);
    for site in Site::ALL {
        let flexible = of_sites(&[site]);
        let own = vec![0.0; flexible.parameters()];
        assert_eq!(predicted(Some(flexible), &own), plain, "{}", site.name());
    }
}

#[test]
fn every_term_shows_and_to_first_order_doubles_with_its_parameter() {
    const SMALL: f64 = 1e-4;
    let plain = predicted(None, &[]);
    for site in Site::ALL {
        let flexible = of_sites(&[site]);
        for j in 0..flexible.parameters() {
            let change = |value: f64| {
                let mut own = vec![0.0; flexible.parameters()];
                own[j] = value;
                let with = predicted(Some(flexible.clone()), &own);
                let pairs = with.concat().into_iter().zip(plain.concat());
                pairs.map(|(with, plain)| with - plain).collect::<Vec<f64>>()
            };
            let (once, twice) = (change(SMALL), change(2.0 * SMALL));
            let largest = once.iter().fold(0.0, |m, v| v.abs().max(m));
            // Without a pose nothing depends on place or heading: sines of nothing.
            let of_a_place = matches!(site, Site::RoadAndWind | Site::FrontAxle | Site::RearAxle);
            assert!(largest > 1e-9 || of_a_place, "{} {j}: {largest}", site.name());
            for (a, b) in once.iter().zip(&twice) {
                assert!((2.0 * a - b).abs() < 1e-2 * largest + 1e-12, "{} {j}: {a} {b}", site.name());
            }
        }
    }
}

#[test]
fn the_signals_sites_change_their_signal_alone() {
    let plain = predicted(None, &[]);
    for (site, signals) in [(Site::Vy, vec![0]), (Site::YawRate, vec![1]), (Site::Imu, vec![2, 3])] {
        let flexible = of_sites(&[site]);
        let own = vec![0.1; flexible.parameters()];
        let with = predicted(Some(flexible), &own);
        for (i, (with, plain)) in with.iter().zip(&plain).enumerate() {
            assert_eq!(with != plain, signals.contains(&i), "{} {i}", site.name());
        }
    }
}
