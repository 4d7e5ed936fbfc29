//! A DDS domain for one test.

use std::fs::File;

/// A domain that no other test uses while this lives, on this machine only.
pub struct Domain {
    id: u16,
    _lock: File,
}

impl Domain {
    /// Takes a free domain. Domains above 100 have ports among those that the system gives out.
    ///
    /// # Panics
    /// When all are taken.
    #[expect(clippy::new_without_default, reason = "it takes something and can fail")]
    pub fn new() -> Self {
        for id in 1..=100 {
            let path = std::env::temp_dir().join(format!("gripsight_test_domain_{id}.lock"));
            if let Ok(lock) = File::create(path)
                && lock.try_lock().is_ok()
            {
                return Self { id, _lock: lock };
            }
        }
        panic!("no free DDS domain");
    }

    /// The environment that keeps a process in this domain, whatever its DDS.
    pub fn environment(&self) -> [(&'static str, String); 3] {
        // As rmw_cyclonedds_cpp sets it up for LOCALHOST where the loopback has no multicast.
        let cyclone = "<CycloneDDS><Domain><General><Interfaces><NetworkInterface address=\"127.0.0.1\"/></Interfaces>\
                       <AllowMulticast>false</AllowMulticast></General><Discovery><ParticipantIndex>auto</ParticipantIndex>\
                       <MaxAutoParticipantIndex>32</MaxAutoParticipantIndex><Peers><Peer address=\"127.0.0.1\"/></Peers>\
                       </Discovery></Domain></CycloneDDS>";
        [
            ("ROS_DOMAIN_ID", self.id.to_string()),
            ("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST".into()),
            ("CYCLONEDDS_URI", cyclone.into()),
        ]
    }
}
