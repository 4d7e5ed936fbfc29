//! Road pictures to a friction prior: decoding, quality gates, network, filter over distance.
