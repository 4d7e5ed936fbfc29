//! What the car reported: telemetry samples, alignment, windows, resampling, data health.
