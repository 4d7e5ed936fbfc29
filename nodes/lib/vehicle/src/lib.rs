//! Single-track model, Magic Formula, vehicle parameters, integrators, handling numbers.
