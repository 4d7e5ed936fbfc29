//! A node that misbehaves, for the tests of the guard: parameter `fault` says how, `seconds` for how long. `~/turn` tells of each turn of
//! its loop.

use std::future::Future;
use std::process::ExitCode;
use std::time::Duration;

use gripsight_msgs::standard::nav_msgs::Odometry;
use gripsight_runtime::{Descriptor, Error, Node, Qos, run};

/// What the node takes at each turn, where it takes memory.
const MORE_BYTES: usize = 20_000_000;

fn misbehave(node: &mut Node) -> Result<impl Future<Output = Result<(), Error>> + use<>, Error> {
    let fault = node.parameter(
        "fault",
        String::from("none"),
        Descriptor::new("What goes wrong").choices(&["none", "block", "compute", "memory"]),
    )?;
    let seconds = node.parameter("seconds", 60.0, Descriptor::new("For how long [s]").range(0.0..=600.0))?;
    let odometry = node.subscription::<Odometry>("odom", node.sensor_qos(50))?;
    node.needs([odometry.arrivals()]);
    let turns = node.publisher::<Odometry>("~/turn", Qos::reliable(10))?;
    tracing::info!("up as {}", node.name());
    Ok(async move {
        let _odometry = odometry;
        let mut held: Vec<Vec<u8>> = Vec::new();
        tokio::time::sleep(Duration::from_millis(500)).await;
        tracing::info!("now {}", fault.get());
        let long = Duration::from_secs_f64(seconds.get());
        match fault.get().as_str() {
            "block" => std::thread::sleep(long),
            "compute" => {
                tokio::task::spawn_blocking(move || std::thread::sleep(long)).await.ok();
            }
            _ => {}
        }
        loop {
            turns.publish(&Odometry::default()).await;
            if fault.get() == "memory" {
                held.push(vec![1; MORE_BYTES]);
            }
            tokio::time::sleep(Duration::from_millis(50)).await;
        }
    })
}

fn main() -> ExitCode {
    match run("stubborn_node", "Misbehaves for the tests.\n", misbehave) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{error}");
            ExitCode::FAILURE
        }
    }
}
