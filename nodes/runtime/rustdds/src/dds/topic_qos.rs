//! Quality of service that local topics get in place of the one that they are created with.

use std::sync::OnceLock;

use super::qos::QosPolicies;

static OF_TOPIC: OnceLock<fn(topic: &str) -> Option<QosPolicies>> = OnceLock::new();

/// Sets which topics of this process, by their name in DDS, get another
/// quality of service than they are created with; to be called before the
/// first is created. Later calls have no effect.
pub fn set_topic_qos(of_topic: fn(topic: &str) -> Option<QosPolicies>) {
  OF_TOPIC.get_or_init(|| of_topic);
}

pub(crate) fn topic_qos(topic: &str) -> Option<QosPolicies> {
  OF_TOPIC.get().and_then(|of_topic| of_topic(topic))
}
