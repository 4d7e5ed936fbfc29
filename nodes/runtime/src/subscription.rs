//! Subscriptions: a task reads and decodes, the node takes messages when it is ready.

use futures::StreamExt;
use gripsight_msgs::Message;
use tokio::sync::{mpsc, watch};

use crate::diagnostics::Diagnostics;
use crate::inputs::Arrivals;

/// A subscription to messages of type `M`.
pub struct Subscription<M> {
    pub(crate) topic: String,
    pub(crate) messages: mpsc::Receiver<M>,
    pub(crate) arrivals: Arrivals,
}

impl<M> Subscription<M> {
    /// The topic's absolute name.
    pub fn topic(&self) -> &str {
        &self.topic
    }

    /// What arrives, for [`Node::needs`](crate::Node::needs).
    pub fn arrivals(&self) -> Arrivals {
        self.arrivals.clone()
    }

    /// The next message, in the order of arrival; `None` once the node shuts down. A message that
    /// cannot be decoded is counted in the diagnostics and passed over. Safe in `tokio::select!`.
    pub async fn next(&mut self) -> Option<M> {
        self.messages.recv().await
    }
}

/// Reads from DDS until the node shuts down or nobody listens any more.
pub(crate) async fn forward<M: Message>(
    reader: ros2_client::Subscription<M>,
    topic: String,
    arrivals: Arrivals,
    messages: mpsc::Sender<M>,
    diagnostics: Diagnostics,
    mut stop: watch::Receiver<bool>,
) {
    let work = async {
        let mut stream = std::pin::pin!(reader.async_stream());
        while let Some(received) = stream.next().await {
            match received {
                Ok((message, _)) => {
                    arrivals.add();
                    if messages.send(message).await.is_err() {
                        break;
                    }
                }
                Err(error) => diagnostics.undecodable(&topic, error.to_string()),
            }
        }
    };
    tokio::select! {
        () = work => {}
        () = messages.closed() => {}
        _ = stop.wait_for(|stop| *stop) => {}
    }
}
