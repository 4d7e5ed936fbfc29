//! Identification as a whole: on the reference car, which knows the truth, and on recorded cars, which do not.

mod following;
mod live;
mod recorded;
mod simulated;
mod support;
