//! All that a node of the suite needs from ROS 2: names, parameters, topics, clock, logs,
//! diagnostics, a clean start and a clean end. It stands on ros2-client and RustDDS, supplies what
//! they lack, and is the only crate that knows their quirks.
//!
//! ```no_run
//! use std::future::Future;
//! use gripsight_msgs::standard::nav_msgs::Odometry;
//! use gripsight_runtime::{Descriptor, Error, Node, Qos, run};
//!
//! fn relay(node: &mut Node) -> Result<impl Future<Output = Result<(), Error>> + use<>, Error> {
//!     let every = node.parameter("every", 1_i64, Descriptor::new("Pass on each n-th").range(1.0..=1e3))?;
//!     let mut odometry = node.subscription::<Odometry>("odom", node.sensor_qos(50))?;
//!     let thinned = node.publisher::<Odometry>("~/odom", Qos::reliable(10))?;
//!     Ok(async move {
//!         let mut count = 0;
//!         while let Some(message) = odometry.next().await {
//!             count += 1;
//!             if count % every.get() == 0 {
//!                 thinned.publish(&message).await;
//!             }
//!         }
//!         Ok(())
//!     })
//! }
//!
//! fn main() -> Result<(), Error> {
//!     run("relay", "Passes on each n-th odometry message.", relay)
//! }
//! ```
//!
//! Not implemented: lifecycle nodes, composition, actions, services of a node's own other than triggers, and clients other than of
//! `set_parameters`.

mod args;
mod clock;
mod diagnostics;
mod environment;
mod error;
mod ground;
mod guard;
mod inputs;
mod logging;
mod manual;
mod names;
mod node;
mod parameter_client;
mod parameter_file;
mod parameter_services;
mod parameters;
mod publisher;
mod qos;
mod readers;
mod restart;
mod run;
mod subscription;
mod type_hashes;
mod value;
mod vehicle;
mod yaml;

pub use clock::Clock;
pub use diagnostics::{Diagnostics, Level, Status};
pub use error::Error;
pub use inputs::Arrivals;
pub use manual::manual_covers;
pub use node::{Node, Trigger};
pub use parameter_client::{ParameterClient, SetError};
pub use parameters::{Descriptor, Parameter};
pub use publisher::{Publisher, RawPublisher};
pub use qos::Qos;
pub use run::run;
pub use subscription::Subscription;
pub use value::{ParameterType, ParameterValue};
pub use vehicle::vehicle_parameters;
