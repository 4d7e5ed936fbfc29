//! Topics that a topics file maps field by field: their messages as measurements.

use gripsight_bag::{LiveStreams, MappedTopic, Role, to_cdr};
use gripsight_msgs::Message;
use gripsight_msgs::standard::ackermann_msgs::AckermannDriveStamped;
use gripsight_msgs::standard::nav_msgs::Odometry;
use gripsight_msgs::standard::sensor_msgs::{Imu, JointState};
use gripsight_runtime::{Node, Qos};
use gripsight_signals::Measurement;
use tokio::sync::mpsc;

/// Messages that wait while a sequence is being published.
const WAITING: usize = 1024;

/// Whether a stream is followed under its own name.
pub(crate) fn follows(live: &LiveStreams, role: Role) -> bool {
    !live.without.contains(&role)
}

/// Subscribes to every mapped topic; the measurements come over one channel.
pub(crate) fn subscribe(
    node: &mut Node,
    live: &LiveStreams,
    qos: Qos,
) -> anyhow::Result<mpsc::Receiver<Measurement>> {
    let (send, receive) = mpsc::channel(WAITING);
    for topic in &live.mapped {
        let (send, topic) = (send.clone(), topic.clone());
        match topic.type_name.as_str() {
            Odometry::TYPE => follow::<Odometry>(node, topic, qos, send)?,
            AckermannDriveStamped::TYPE => follow::<AckermannDriveStamped>(node, topic, qos, send)?,
            Imu::TYPE => follow::<Imu>(node, topic, qos, send)?,
            _ => follow::<JointState>(node, topic, qos, send)?,
        }
    }
    Ok(receive)
}

fn follow<T: Message>(
    node: &mut Node,
    topic: MappedTopic,
    qos: Qos,
    send: mpsc::Sender<Measurement>,
) -> anyhow::Result<()> {
    let mut messages = node.subscription::<T>(&topic.topic, qos)?;
    tokio::spawn(async move {
        while let Some(message) = messages.next().await {
            // As in a bag: the field is read from the message's bytes. A message that was never stamped has no time live.
            let measurement = to_cdr(&message).and_then(|bytes| topic.measurement(&bytes, 0));
            match measurement {
                Ok(measurement) if measurement.stamp_ns() > 0 => {
                    if send.send(measurement).await.is_err() {
                        return;
                    }
                }
                Ok(_) => tracing::warn!("{}: a message without a stamp is left out", topic.topic),
                Err(error) => tracing::warn!("{}: {error}", topic.topic),
            }
        }
    });
    Ok(())
}
