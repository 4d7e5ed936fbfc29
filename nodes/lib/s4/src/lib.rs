//! S4D layer with analytic gradients, residual networks and their trainer.
