//! A node that publishes known results, for the tests of the runtime: a latched parameter set on
//! `~/pacejka`, every 0.2 s a state sequence on `~/sequence` and a picture on `~/picture`, and odometry
//! from `odom` on `~/echo`.

use std::future::Future;
use std::time::Duration;

use gripsight_msgs::standard::nav_msgs::Odometry;
use gripsight_msgs::standard::sensor_msgs::CompressedImage;
use gripsight_msgs::{PacejkaParams, StateSequence};
use gripsight_runtime::{Descriptor, Error, Level, Node, Qos, Status, run};
use gripsight_tests::samples;

fn publish_results(node: &mut Node) -> Result<impl Future<Output = Result<(), Error>> + use<>, Error> {
    let seed = node.parameter("seed", 7_i64, Descriptor::new("Number that all values follow from"))?;
    let samples =
        node.parameter("samples", 10_i64, Descriptor::new("Samples per sequence").range(1.0..=1e5))?;
    let name =
        node.parameter("vehicle.name", String::from("car"), Descriptor::new("Name of the car").read_only())?;
    let mut odometry = node.subscription::<Odometry>("odom", node.sensor_qos(50))?;
    let pacejka = node.publisher::<PacejkaParams>("~/pacejka", Qos::latched())?;
    let sequence = node.publisher::<StateSequence>("~/sequence", Qos::reliable(10))?;
    let picture = node.publisher::<CompressedImage>("~/picture", Qos::reliable(10))?;
    let echo = node.publisher::<Odometry>("~/echo", Qos::reliable(1000))?;
    let diagnostics = node.diagnostics();
    tracing::info!("{} publishes as {}", name.get(), node.name());

    Ok(async move {
        pacejka.publish(&samples::pacejka(seed.get().unsigned_abs())).await;
        let mut ticks = tokio::time::interval(Duration::from_millis(200));
        let (mut echoed, mut sent) = (0_u64, 0_usize);
        loop {
            tokio::select! {
                message = odometry.next() => match message {
                    None => return Ok(()),
                    Some(message) => {
                        echo.publish(&message).await;
                        echoed += 1;
                        diagnostics.report("echo", Status::new(Level::Ok, "echoing").value("echoed", echoed));
                    }
                },
                _ = ticks.tick() => {
                    let count = usize::try_from(samples.get()).unwrap_or(1);
                    sequence.publish(&samples::sequence(count)).await;
                    picture.publish(&samples::picture(100_000 + sent % 4)).await;
                    sent += 1;
                }
            }
        }
    })
}

fn main() -> Result<(), Error> {
    run("result_source", "Publishes parameter sets and pictures for the tests.\n", publish_results)
}
