//! Sets the parameters of another node, over its service `set_parameters`.
//!
//! A node does not say by which mapping of services to DDS it listens; the vendor at the front of its reader's GUID does.

use std::time::Duration;

use gripsight_msgs::standard::rcl_interfaces as rcl;
use ros2_client::{Client, Name, ServiceMapping, ServiceTypeName};
use rustdds::DomainParticipant;

use crate::Error;
use crate::parameter_services::{SetRequest, SetResponse, mapping_of};
use crate::qos::Qos;
use crate::value::ParameterValue;

/// Time that an answer may take.
const ANSWER_TIME: Duration = Duration::from_secs(2);
/// From the discovery of the service to the first request: a writer needs as long to connect to a reader that was discovered.
const SETTLE_TIME: Duration = Duration::from_millis(200);

/// Why parameters are not set.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum SetError {
    /// No such node is there, or it has no parameter services.
    #[error("no node offers {service}")]
    Absent {
        /// The service's name.
        service: String,
    },
    /// It did not answer in time; asking again does no harm.
    #[error("no answer of {service} within {} s", ANSWER_TIME.as_secs())]
    Silent {
        /// The service's name.
        service: String,
    },
    /// It refused a value.
    #[error("{name} is refused: {reason}")]
    Refused {
        /// The parameter's name.
        name: String,
        /// What the node says.
        reason: String,
    },
    /// The request could not be sent.
    #[error("the request cannot be sent: {0}")]
    Send(String),
}

/// Sets the parameters of one other node.
pub struct ParameterClient {
    service: String,
    clients: Vec<(ServiceMapping, Client<SetRequest, SetResponse>)>,
    participant: DomainParticipant,
}

impl ParameterClient {
    /// Of the node with this absolute name.
    pub(crate) fn new(
        ros: &mut ros2_client::Node,
        node: &str,
        participant: DomainParticipant,
    ) -> Result<Self, Error> {
        let service = format!("{node}/set_parameters");
        let name = Name::parse(&service).map_err(|error| Error::create(&service, error))?;
        let type_name = ServiceTypeName::new("rcl_interfaces", "SetParameters");
        let clients = [ServiceMapping::Enhanced, ServiceMapping::Cyclone].into_iter().map(|mapping| {
            let qos = Qos::reliable(10).profile();
            ros.create_client(mapping, &name, &type_name, qos.clone(), qos)
                .map(|client| (mapping, client))
                .map_err(|error| Error::create(format!("client of {service}"), error))
        });
        Ok(Self { clients: clients.collect::<Result<_, _>>()?, service, participant })
    }

    /// Whether the node is there: it reads requests and writes replies.
    pub fn is_there(&self) -> bool {
        self.mapping().is_some()
    }

    /// By which mapping the node listens, where it is there.
    fn mapping(&self) -> Option<ServiceMapping> {
        let (requests, replies) = (format!("rq{}Request", self.service), format!("rr{}Reply", self.service));
        let writes = self.participant.discovered_writers();
        writes.iter().find(|writer| *writer.publication_topic_data.topic_name() == replies)?;
        let readers = self.participant.discovered_readers();
        let reader =
            readers.iter().find(|reader| *reader.subscription_topic_data.topic_name() == requests)?;
        Some(mapping_of(&reader.reader_proxy.remote_reader_guid.to_bytes()))
    }

    /// Sets parameters, each on its own: one that is refused leaves the others set.
    ///
    /// # Errors
    /// [`SetError`]; where several are refused, the first.
    pub async fn set(&self, values: &[(String, ParameterValue)]) -> Result<(), SetError> {
        let service = || self.service.clone();
        let mapping = self.mapping().ok_or_else(|| SetError::Absent { service: service() })?;
        let client = self.clients.iter().find(|(own, _)| *own == mapping).map(|(_, client)| client);
        let client = client.ok_or_else(|| SetError::Absent { service: service() })?;
        tokio::time::sleep(SETTLE_TIME).await;
        let message = |(name, value): &(String, ParameterValue)| rcl::Parameter {
            name: name.clone(),
            value: value.to_message(),
        };
        let request = SetRequest { parameters: values.iter().map(message).collect() };
        let id =
            client.async_send_request(request).await.map_err(|error| SetError::Send(error.to_string()))?;
        let answer = async {
            loop {
                match client.async_receive_response(id).await {
                    Ok(response) => return response,
                    // An answer to another node's request, in a form that this client does not read.
                    Err(error) => tracing::debug!("cannot read a reply of {}: {error}", self.service),
                }
                tokio::time::sleep(Duration::from_millis(1)).await;
            }
        };
        let response = tokio::time::timeout(ANSWER_TIME, answer)
            .await
            .map_err(|_| SetError::Silent { service: service() })?;
        let refused = response.results.iter().zip(values).find(|(result, _)| !result.successful);
        match refused {
            None => Ok(()),
            Some((result, (name, _))) => {
                Err(SetError::Refused { name: name.clone(), reason: result.reason.clone() })
            }
        }
    }
}
