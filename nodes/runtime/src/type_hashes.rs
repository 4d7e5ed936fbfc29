//! What the node's endpoints announce of themselves in discovery: the hash of their type, by which ROS 2 tells equal names with unlike
//! definitions apart (`ros2 topic info -v` shows it). It travels as USER_DATA. Source: ROS REP 2016, and `rmw_dds_common` of Jazzy.

use gripsight_msgs::type_hash;

/// Hashes of the services that a node offers or calls, as `rosidl_generator_type_description` of ROS 2 Jazzy writes them: of a service's
/// events, too, which are defined nowhere here.
const SERVICES: [(&str, &str); 7] = [
    (
        "rcl_interfaces/srv/DescribeParameters",
        "845b484d71eb0673dae682f2e3ba3c4851a65a3dcfb97bddd82c5b57e91e4cff",
    ),
    (
        "rcl_interfaces/srv/GetParameterTypes",
        "da199c878688b3e530bdfe3ca8f74cb9fa0c303101e980a9e8f260e25e1c80ca",
    ),
    ("rcl_interfaces/srv/GetParameters", "bf9803d5c74cf989a5de3e0c2e99444599a627c7ff75f97b8c05b01003675cbc"),
    ("rcl_interfaces/srv/ListParameters", "3e6062bfbb27bfb8730d4cef2558221f51a11646d78e7bb30a1e83afac3aad9d"),
    ("rcl_interfaces/srv/SetParameters", "56eed9a67e169f9cb6c1f987bc88f868c14a8fc9f743a263bc734c154015d7e0"),
    (
        "rcl_interfaces/srv/SetParametersAtomically",
        "0e192ef259c07fc3c07a13191d27002222e65e00ccec653ca05e856f79285fcd",
    ),
    ("std_srvs/srv/Trigger", "eeff2cd6fa5ad9d27cdf4dec64818317839b62f212a91e6b5304b634b2062c5f"),
];

/// The hash of ros2-client's `ros_discovery_info`, whose type is no one's message here.
const GRAPH: (&str, &str) = (
    "rmw_dds_common/msg/ParticipantEntitiesInfo",
    "91a0593bacdcc50ea9bdcf849a938b128412cc1ea821245c663bcd26f83c295e",
);

/// The user data of an endpoint whose type has this name in DDS. Never empty: where there is none rmw_cyclonedds_cpp and rmw_fastrtps_cpp warn of
/// every endpoint.
pub(crate) fn user_data(dds_type: &str) -> Vec<u8> {
    match hash(dds_type) {
        Some(hash) => format!("typehash={hash};"),
        None => "typehash_is=unknown;".to_owned(),
    }
    .into_bytes()
}

fn hash(dds_type: &str) -> Option<String> {
    let name = ros_name(dds_type)?;
    let known = SERVICES.iter().chain([&GRAPH]).find(|(known, _)| *known == name);
    known.map(|(_, digest)| format!("RIHS01_{digest}")).or_else(|| type_hash(&name).ok())
}

/// `package/msg/Type` for `package::msg::dds_::Type_`; of a request or a reply the service.
fn ros_name(dds_type: &str) -> Option<String> {
    let (namespace, name) = dds_type.strip_suffix('_')?.split_once("::dds_::")?;
    let (package, kind) = namespace.split_once("::")?;
    let of_service = name.strip_suffix("_Request").or_else(|| name.strip_suffix("_Response"));
    let name = of_service.filter(|_| kind == "srv").unwrap_or(name);
    Some(format!("{package}/{kind}/{name}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn announced(dds_type: &str) -> String {
        String::from_utf8(user_data(dds_type)).unwrap()
    }

    #[test]
    fn messages_services_and_the_graph_are_announced_by_their_hash() {
        let clock = "typehash=RIHS01_692f7a66e93a3c83e71765d033b60349ba68023a8c689a79e48078bcb5c58564;";
        assert_eq!(announced("rosgraph_msgs::msg::dds_::Clock_"), clock);
        let trigger = "typehash=RIHS01_eeff2cd6fa5ad9d27cdf4dec64818317839b62f212a91e6b5304b634b2062c5f;";
        for part in ["Request", "Response"] {
            assert_eq!(announced(&format!("std_srvs::srv::dds_::Trigger_{part}_")), trigger);
        }
        assert!(announced("rmw_dds_common::msg::dds_::ParticipantEntitiesInfo_").contains("RIHS01_91a0593b"));
    }

    #[test]
    fn what_is_not_known_says_so_and_is_never_empty() {
        for unknown in ["other_msgs::msg::dds_::Thing_", "Thing", "", "a::dds_::B_"] {
            assert_eq!(announced(unknown), "typehash_is=unknown;");
        }
    }
}
