//! What can go wrong with message definitions.

/// Why a message definition could not be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The type is neither the suite's nor one of the standard ones known here.
    #[error("no definition of the message type {0}")]
    UnknownType(String),
    /// A line of a definition does not follow the syntax of `.msg` files.
    #[error("{type_name}, line {line}: expected `type name` or `type NAME=value`, got `{text}`")]
    Syntax {
        /// Full name of the message type.
        type_name: String,
        /// Number of the line, from 1.
        line: usize,
        /// The line.
        text: String,
    },
}
