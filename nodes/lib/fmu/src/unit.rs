//! One instance of the unit.

use std::path::Path;

use gripsight_model::{CarFile, Drive, DrivenCar};

use crate::variables::{Setting, controls, see, set};
use crate::{FmuError, Role, Variable, variables};

/// A car behind the interface: values by reference, and a drive once it has started.
#[derive(Debug, Clone)]
pub struct Unit {
    car: DrivenCar,
    table: Vec<Variable>,
    values: Vec<f64>,
    speed_is_imposed: bool,
    drive: Option<Drive>,
}

impl Unit {
    /// The unit of a car.
    ///
    /// # Errors
    /// As for [`CarFile::driven`].
    pub fn new(car: &CarFile) -> Result<Self, FmuError> {
        let car = car.driven()?;
        let table = variables(&car);
        let values = table.iter().map(|v| v.start).collect();
        Ok(Self { car, table, values, speed_is_imposed: false, drive: None })
    }

    /// The unit of the car in the unpacked unit's resources.
    ///
    /// # Errors
    /// [`FmuError::Io`] and [`FmuError::Car`] where it cannot be read; else as for [`Self::new`].
    pub fn of_resources(folder: &Path) -> Result<Self, FmuError> {
        let path = folder.join(crate::archive::CAR);
        let text = std::fs::read_to_string(&path).map_err(FmuError::io(&path))?;
        Self::new(&serde_json::from_str(&text)?)
    }

    /// A value.
    #[must_use]
    pub fn get(&self, reference: u32) -> Option<f64> {
        self.values.get(reference as usize).copied()
    }

    /// Sets an input, or before the start a parameter; whether it could be set.
    pub fn set(&mut self, reference: u32, value: f64) -> bool {
        let Some(variable) = self.table.get(reference as usize) else { return false };
        let settable = match variable.role {
            Role::Input => true,
            Role::Parameter => self.drive.is_none(),
            Role::Time | Role::Output => false,
        };
        if settable && value.is_finite() {
            self.values[reference as usize] = value;
        }
        settable && value.is_finite()
    }

    /// Whether a reference is of a switch; `None`: of nothing.
    #[must_use]
    pub fn is_switch(&self, reference: u32) -> Option<bool> {
        self.table.get(reference as usize).map(|v| v.is_switch)
    }

    /// Values by reference, of switches or of numbers; whether all are there.
    pub(crate) fn get_all<T>(
        &self,
        references: &[u32],
        into: &mut [T],
        switches: bool,
        of: fn(f64) -> T,
    ) -> bool {
        references.len() == into.len()
            && references.iter().zip(into).all(|(&reference, into)| {
                let value = self.get(reference).filter(|_| self.is_switch(reference) == Some(switches));
                value.map(|value| *into = of(value)).is_some()
            })
    }

    /// Sets values by reference, of switches or of numbers; whether all could be set.
    pub(crate) fn set_all<T: Copy>(
        &mut self,
        references: &[u32],
        from: &[T],
        switches: bool,
        of: fn(T) -> f64,
    ) -> bool {
        references.len() == from.len()
            && references.iter().zip(from).all(|(&reference, &from)| {
                self.is_switch(reference) == Some(switches) && self.set(reference, of(from))
            })
    }

    /// The time.
    #[must_use]
    pub fn time_s(&self) -> f64 {
        self.values[0]
    }

    /// Sets the time of the start; whether it is one.
    pub fn begin_at(&mut self, time_s: f64) -> bool {
        if time_s.is_finite() {
            self.values[0] = time_s;
        }
        time_s.is_finite()
    }

    /// Starts the drive with what is set; whether its parameters are those of a car.
    pub fn start(&mut self) -> bool {
        let mut setting = Setting { speed_is_imposed: false, start: [0.0; 3] };
        let mut car = self.car.clone();
        set(&mut car, &mut setting, &self.values);
        self.speed_is_imposed = setting.speed_is_imposed;
        let Ok(vehicle) = car.vehicle.clone().checked() else { return false };
        if !(car.tires.is_finite() && car.substep_s > 0.0) {
            return false;
        }
        car.vehicle = vehicle;
        let drive = Drive::begin(&car, setting.start, &controls(&self.values, setting.speed_is_imposed));
        see(&mut self.values, &drive.now());
        self.drive = Some(drive);
        true
    }

    /// A step; whether the car is still somewhere.
    pub fn step(&mut self, step_s: f64) -> bool {
        let controls = controls(&self.values, self.speed_is_imposed);
        let Some(drive) = self.drive.as_mut().filter(|_| step_s.is_finite() && step_s > 0.0) else {
            return false;
        };
        let seen = drive.step(&controls, step_s);
        self.values[0] += step_s;
        see(&mut self.values, &seen);
        [seen.x_m, seen.y_m, seen.v_x_mps, seen.v_y_mps, seen.yaw_rate_radps].iter().all(|v| v.is_finite())
    }

    /// As it came.
    pub fn reset(&mut self) {
        self.values = self.table.iter().map(|v| v.start).collect();
        self.drive = None;
    }
}
