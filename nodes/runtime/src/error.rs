//! What can go wrong when a node starts.

/// Why a node, or one of its endpoints or parameters, could not be created.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The command line does not follow ROS 2's rules.
    #[error("command line: {0}")]
    Arguments(String),
    /// An environment variable has a value that is not allowed.
    #[error("environment variable {name}={value}: expected {expected}")]
    Environment {
        /// Name of the variable.
        name: &'static str,
        /// Its value.
        value: String,
        /// What would be right.
        expected: &'static str,
    },
    /// The environment demands security (SROS 2), which this suite does not have.
    #[error(
        "ROS_SECURITY_ENABLE=true with ROS_SECURITY_STRATEGY=Enforce: this node cannot authenticate or encrypt (its DDS, RustDDS, is \
         built without DDS Security), and does not run open where security is enforced. Set ROS_SECURITY_STRATEGY=Permissive to let it \
         run open, or keep strangers out by a ROS_DOMAIN_ID of its own and ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST"
    )]
    Security,
    /// A parameter file could not be read.
    #[error("parameter file {path}: {reason}")]
    ParameterFile {
        /// Path as given on the command line.
        path: String,
        /// What is wrong with it.
        reason: String,
    },
    /// A parameter's value was refused.
    #[error("parameter {name}: {reason}")]
    Parameter {
        /// Name of the parameter.
        name: String,
        /// Why.
        reason: String,
    },
    /// A node, topic or service name is not a ROS name.
    #[error("name `{name}`: {reason}")]
    Name {
        /// The name.
        name: String,
        /// What is wrong with it.
        reason: String,
    },
    /// DDS refused to create an endpoint.
    #[error("cannot create {what}: {reason}")]
    Create {
        /// What was to be created.
        what: String,
        /// DDS's answer.
        reason: String,
    },
    /// The process could not be set up (threads, signal handlers).
    #[error("cannot start the process: {0}")]
    Process(#[from] std::io::Error),
}

impl Error {
    pub(crate) fn create(what: impl Into<String>, reason: impl std::fmt::Display) -> Self {
        Self::Create { what: what.into(), reason: reason.to_string() }
    }

    pub(crate) fn parameter(name: &str, reason: impl Into<String>) -> Self {
        Self::Parameter { name: name.to_owned(), reason: reason.into() }
    }
}
