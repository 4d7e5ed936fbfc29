//! The six services by which `ros2 param` reads and sets a node's parameters, and services of a node's own that only trigger.
//!
//! ros2-client's own services know one mapping of services to DDS only, and no descriptors. A request does not say by which mapping it
//! was made; the vendor at the front of its writer's GUID does (RTPS 2.5, 9.3.1.5).

use std::collections::BTreeSet;
use std::future::Future;
use std::sync::Arc;
use std::time::Duration;

use futures::StreamExt;
use gripsight_msgs::standard::rcl_interfaces as rcl;
use ros2_client::{Message, Name, RmwRequestId, Server, ServiceMapping, ServiceTypeName};
use rustdds::{DomainParticipant, GUID};
use serde::{Deserialize, Serialize};
use tokio::sync::mpsc;

use crate::Error;
use crate::names::Identity;
use crate::parameters::ParameterStore;
use crate::qos::Qos;
use crate::readers::Readers;
use crate::value::ParameterValue;

/// Time that a client's reader of replies has to be discovered, on a busy machine.
const DISCOVERY_TIME: Duration = Duration::from_secs(10);
/// Requests to one service whose clients' readers are waited for at once; those of clients that have gone hold nobody else up.
const WAITING_CLIENTS: usize = 32;
/// Bytes of a client's GUID that both mappings of services leave as they are; they tell participants apart.
const KNOWN_OF_CLIENT: usize = 8;
/// Vendor id of Eclipse CycloneDDS, as the OMG assigned it (<https://www.dds-foundation.org/dds-rtps-vendor-and-product-ids/>).
const CYCLONE_DDS: [u8; 2] = [0x01, 0x10];

macro_rules! service_messages {
    ($($name:ident { $($field:ident: $type:ty),* })*) => {$(
        #[derive(Clone, Debug, Serialize, Deserialize)]
        pub(crate) struct $name { $(pub(crate) $field: $type),* }
        impl Message for $name {}
    )*};
}

service_messages! {
    NamesRequest { names: Vec<String> }
    GetResponse { values: Vec<rcl::ParameterValue> }
    TypesResponse { types: Vec<u8> }
    SetRequest { parameters: Vec<rcl::Parameter> }
    SetResponse { results: Vec<rcl::SetParametersResult> }
    SetAtomicallyResponse { result: rcl::SetParametersResult }
    ListRequest { prefixes: Vec<String>, depth: u64 }
    ListResponse { result: rcl::ListParametersResult }
    DescribeResponse { descriptors: Vec<rcl::ParameterDescriptor> }
    TriggerRequest { structure_needs_at_least_one_member: u8 }
    TriggerResponse { success: bool, message: String }
}

/// Creates a service of type std_srvs/srv/Trigger under its absolute name, and gives the future that answers it: each call is handed on, and `done` is
/// the reply's text.
pub(crate) fn serve_trigger(
    node: &mut ros2_client::Node,
    name: &str,
    mapping: ServiceMapping,
    readers: &RepliesRead,
    done: &'static str,
    calls: mpsc::Sender<()>,
) -> Result<impl Future<Output = ()> + use<>, Error> {
    let server =
        server::<TriggerRequest, TriggerResponse>(node, name, ("std_srvs", "Trigger"), mapping, readers)?;
    Ok(answer(server, move |_: TriggerRequest| {
        let success = calls.try_send(()).is_ok();
        TriggerResponse { success, message: if success { done } else { "too many calls" }.to_owned() }
    }))
}

/// Answers requests about a node's parameters.
#[derive(Clone)]
pub(crate) struct ParameterServices {
    pub(crate) store: Arc<ParameterStore>,
    /// Changes, for `/parameter_events`.
    pub(crate) changes: mpsc::Sender<(String, ParameterValue)>,
}

impl ParameterServices {
    /// Creates the six services and gives the future that answers them.
    ///
    /// # Errors
    /// [`Error::Create`] when DDS refuses an endpoint.
    pub(crate) fn serve(
        self,
        node: &mut ros2_client::Node,
        identity: &Identity,
        mapping: ServiceMapping,
        readers: &RepliesRead,
    ) -> Result<impl Future<Output = ()> + use<>, Error> {
        let mut factory = Factory { node, identity, mapping, readers };
        let get = factory.server::<NamesRequest, GetResponse>("get_parameters", "GetParameters")?;
        let types =
            factory.server::<NamesRequest, TypesResponse>("get_parameter_types", "GetParameterTypes")?;
        let set = factory.server::<SetRequest, SetResponse>("set_parameters", "SetParameters")?;
        let set_atomically = factory.server::<SetRequest, SetAtomicallyResponse>(
            "set_parameters_atomically",
            "SetParametersAtomically",
        )?;
        let list = factory.server::<ListRequest, ListResponse>("list_parameters", "ListParameters")?;
        let describe =
            factory.server::<NamesRequest, DescribeResponse>("describe_parameters", "DescribeParameters")?;
        Ok(async move {
            tokio::join!(
                answer(get, |request: NamesRequest| GetResponse {
                    values: self.each(&request.names, |store, name| {
                        store.get(name).map(|value| value.to_message())
                    }),
                }),
                answer(types, |request: NamesRequest| TypesResponse {
                    types: self
                        .each(&request.names, |store, name| store.get(name).map(|value| value.type_id())),
                }),
                answer(set, |request: SetRequest| SetResponse { results: self.set_each(request) }),
                answer(set_atomically, |request: SetRequest| SetAtomicallyResponse {
                    result: self.set(request.parameters)
                }),
                answer(list, |request: ListRequest| ListResponse {
                    result: select(self.store.names(), &request)
                }),
                answer(describe, |request: NamesRequest| DescribeResponse {
                    descriptors: self.each(&request.names, ParameterStore::descriptor),
                }),
            );
        })
    }

    /// One answer per name; for a name that is not declared the default, which says "not set".
    fn each<T: Default>(
        &self,
        names: &[String],
        answer: impl Fn(&ParameterStore, &str) -> Option<T>,
    ) -> Vec<T> {
        names.iter().map(|name| answer(&self.store, name).unwrap_or_default()).collect()
    }

    fn set_each(&self, request: SetRequest) -> Vec<rcl::SetParametersResult> {
        request.parameters.into_iter().map(|parameter| self.set(vec![parameter])).collect()
    }

    fn set(&self, parameters: Vec<rcl::Parameter>) -> rcl::SetParametersResult {
        match self.store.set(parameters) {
            Ok(changed) => {
                // A full queue loses the event; the parameter is set all the same.
                changed.into_iter().for_each(|change| drop(self.changes.try_send(change)));
                rcl::SetParametersResult { successful: true, reason: String::new() }
            }
            Err(reason) => {
                tracing::warn!("refused to set a parameter: {reason}");
                rcl::SetParametersResult { successful: false, reason }
            }
        }
    }
}

/// Of `names` those at most `depth` levels below one of the prefixes; 0: any level; no prefix: all.
fn select(mut names: Vec<String>, request: &ListRequest) -> rcl::ListParametersResult {
    let is_shallow = |rest: &str| request.depth == 0 || rest.split('.').count() as u64 <= request.depth;
    let is_below = |name: &str, prefix: &str| {
        let rest = name.strip_prefix(prefix).and_then(|rest| rest.strip_prefix('.'));
        name == prefix || rest.is_some_and(is_shallow)
    };
    names.retain(|name| match request.prefixes.as_slice() {
        [] => is_shallow(name),
        prefixes => prefixes.iter().any(|prefix| is_below(name, prefix)),
    });
    let prefixes: BTreeSet<&str> =
        names.iter().filter_map(|name| name.rsplit_once('.')).map(|(prefix, _)| prefix).collect();
    let prefixes = prefixes.into_iter().map(str::to_owned).collect();
    rcl::ListParametersResult { names, prefixes }
}

struct Factory<'a> {
    node: &'a mut ros2_client::Node,
    identity: &'a Identity,
    mapping: ServiceMapping,
    readers: &'a RepliesRead,
}

impl Factory<'_> {
    fn server<Q, A>(&mut self, name: &str, type_name: &str) -> Result<Service<Q, A>, Error>
    where
        Q: Message + Clone + 'static,
        A: Message + 'static,
    {
        let name = self.identity.resolve(&format!("~/{name}"))?;
        server(self.node, &name, ("rcl_interfaces", type_name), self.mapping, self.readers)
    }
}

/// A service under its absolute name, of a package's type.
fn server<Q, A>(
    node: &mut ros2_client::Node,
    name: &str,
    type_name: (&str, &str),
    mapping: ServiceMapping,
    readers: &RepliesRead,
) -> Result<Service<Q, A>, Error>
where
    Q: Message + Clone + 'static,
    A: Message + 'static,
{
    let ros_name = Name::parse(name).map_err(|error| Error::create(name, error))?;
    let type_name = ServiceTypeName::new(type_name.0, type_name.1);
    let qos = Qos::reliable(10).profile();
    let server = node
        .create_server(mapping, &ros_name, &type_name, qos.clone(), qos)
        .map_err(|error| Error::create(format!("service {name}"), error))?;
    let replies = Replies { read: readers.clone(), topic: format!("rr{name}Reply") };
    Ok(Service { server, replies, mapping })
}

struct Service<Q, A>
where
    Q: Message,
    A: Message,
{
    server: Server<Q, A>,
    replies: Replies,
    mapping: ServiceMapping,
}

/// Whether a client asks by this mapping; the other's server answers the others.
fn asks_by(mapping: ServiceMapping, client: &RmwRequestId) -> bool {
    mapping == mapping_of(client.writer_gid.as_bytes())
}

/// How the middleware of an endpoint with this GUID maps services to DDS.
pub(crate) fn mapping_of(guid: &[u8]) -> ServiceMapping {
    if guid.starts_with(&CYCLONE_DDS) { ServiceMapping::Cyclone } else { ServiceMapping::Enhanced }
}

/// Who reads the replies of a node's services.
#[derive(Clone)]
pub(crate) struct RepliesRead {
    pub(crate) participant: DomainParticipant,
    pub(crate) readers: Readers,
    /// Writers of replies that each service has: one a mapping.
    pub(crate) writers: usize,
}

/// The topic on which a service replies, by its DDS name.
struct Replies {
    read: RepliesRead,
    topic: String,
}

impl Replies {
    /// Waits until the writers of replies are connected to the reader of `client`. A request may arrive before its
    /// client's reader is discovered; a reply sent then is lost, and the client waits forever.
    async fn are_read_by(&self, client: &RmwRequestId) {
        let end = tokio::time::Instant::now() + DISCOVERY_TIME;
        let connected = |reader| self.read.readers.writers_of(reader) >= self.read.writers;
        while !self.reader_of(client).is_some_and(connected) && tokio::time::Instant::now() < end {
            tokio::time::sleep(Duration::from_millis(5)).await;
        }
    }

    /// The reader by which the participant of `client` reads the replies, once it is discovered.
    fn reader_of(&self, client: &RmwRequestId) -> Option<GUID> {
        let (client, _) = client.writer_gid.as_bytes().split_at(KNOWN_OF_CLIENT);
        self.read.participant.discovered_readers().iter().find_map(|reader| {
            let guid = reader.reader_proxy.remote_reader_guid;
            let of_service = *reader.subscription_topic_data.topic_name() == self.topic;
            (of_service && guid.to_bytes().starts_with(client)).then_some(guid)
        })
    }
}

async fn answer<Q, A>(service: Service<Q, A>, respond: impl Fn(Q) -> A)
where
    Q: Message + 'static,
    A: Message + 'static,
{
    let Service { server, replies, mapping } = service;
    let requests = server.receive_request_stream();
    let answered = requests.for_each_concurrent(WAITING_CLIENTS, |request| {
        // What is asked is done in the order of the requests; a reply may overtake another client's.
        let reply = match request {
            Ok((id, _)) if !asks_by(mapping, &id) => None,
            Ok((id, request)) => Some((id, respond(request))),
            // As a rule one that was made by the other mapping.
            Err(error) => {
                tracing::debug!("cannot read a request: {error}");
                None
            }
        };
        let (server, replies) = (&server, &replies);
        async move {
            let Some((id, response)) = reply else { return };
            replies.are_read_by(&id).await;
            if let Err(error) = server.async_send_response(id, response).await {
                tracing::warn!("cannot answer a request: {error}");
            }
        }
    });
    answered.await;
}

#[cfg(test)]
mod tests {
    use super::*;

    fn listed(prefixes: &[&str], depth: u64) -> rcl::ListParametersResult {
        let names = ["rate", "vehicle.axle.front", "vehicle.mass", "vehicles"].map(str::to_owned).to_vec();
        let prefixes = prefixes.iter().map(|prefix| (*prefix).to_owned()).collect();
        select(names, &ListRequest { prefixes, depth })
    }

    #[test]
    fn names_are_listed_by_prefix_and_depth() {
        assert_eq!(listed(&[], 0).names.len(), 4);
        assert_eq!(listed(&[], 0).prefixes, ["vehicle", "vehicle.axle"]);
        assert_eq!(listed(&[], 1).names, ["rate", "vehicles"]);
        assert_eq!(listed(&["vehicle"], 0).names, ["vehicle.axle.front", "vehicle.mass"]);
        assert_eq!(listed(&["vehicle"], 1).names, ["vehicle.mass"]);
        assert_eq!(listed(&["rate", "none"], 1).names, ["rate"]);
    }
}
