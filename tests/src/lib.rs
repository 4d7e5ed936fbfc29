//! Topic-level integration tests with real DDS peers, and published results.
