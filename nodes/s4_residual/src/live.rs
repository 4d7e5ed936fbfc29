//! The live residual: telemetry as it comes, against the newest model.

use std::collections::VecDeque;

use gripsight_bag::encode;
use gripsight_identification::{LiveResidual, ResidualModel, SignalCorrections};
use gripsight_identification_messages as messages;
use gripsight_msgs::Residual;
use gripsight_msgs::standard::std_msgs::Header;
use gripsight_runtime::Publisher;
use gripsight_signals::{AlignConfig, Aligner, Measurement, NS_PER_S, Pushed, TelemetrySample};
use gripsight_vehicle::VehicleParameters;

/// A new model is shown the last samples before it speaks (s): no sample goes without its residual because the model has changed.
const SHOWN_S: f64 = 0.5;

/// Follows the car with the newest model; says nothing until there is one.
pub(crate) struct Live {
    aligner: Aligner,
    residual: Option<LiveResidual>,
    recent: VecDeque<TelemetrySample>,
    output: Publisher<Residual>,
    /// Residuals published.
    pub(crate) published: usize,
}

impl Live {
    pub(crate) fn new(output: Publisher<Residual>) -> Self {
        let aligner = Aligner::new(AlignConfig::default());
        Self { aligner, residual: None, recent: VecDeque::new(), output, published: 0 }
    }

    /// Goes over to another model.
    pub(crate) fn follow(
        &mut self,
        vehicle: &VehicleParameters,
        model: &ResidualModel,
        corrections: SignalCorrections,
    ) {
        match LiveResidual::new(vehicle, model.clone(), corrections) {
            Ok(mut residual) => {
                // What was said of these samples stands; a model that cannot follow them says so at the next.
                self.recent.iter().for_each(|sample| _ = residual.push(sample));
                self.residual = Some(residual);
            }
            Err(error) => tracing::error!("{}: no live residual: {error}", model.key),
        }
    }

    /// Takes a message of the car and publishes what it completes. What is wrong with messages, `telemetry` reports.
    pub(crate) async fn take(&mut self, measurement: Measurement) {
        if self.aligner.push(measurement) == Ok(Pushed::ClockJumped) {
            self.residual.iter_mut().for_each(LiveResidual::reset);
            self.recent.clear();
        }
        while let Some(sample) = self.aligner.poll() {
            self.remember(&sample);
            let Some(residual) = &mut self.residual else { continue };
            match residual.push(&sample) {
                Ok(None) => {}
                Ok(Some(live)) => {
                    let stamp = encode::time(live.stamp_ns);
                    let header = Header { stamp, frame_id: String::new() };
                    let message =
                        Residual { header, ..messages::live_residual(&live, &residual.model().key) };
                    self.output.publish(&message).await;
                    self.published += 1;
                }
                Err(error) => {
                    tracing::error!("{}: no live residual any more: {error}", residual.model().key);
                    self.residual = None;
                }
            }
        }
    }

    fn remember(&mut self, sample: &TelemetrySample) {
        let oldest_ns = sample.odometry.stamp_ns - (SHOWN_S * NS_PER_S) as i64;
        while self.recent.front().is_some_and(|first| first.odometry.stamp_ns < oldest_ns) {
            self.recent.pop_front();
        }
        self.recent.push_back(*sample);
    }
}
