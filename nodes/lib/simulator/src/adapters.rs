//! The adapters that come with gripsight: they are laid beside the simulator when it is started, and need no installation.

use std::path::Path;

use serde::Deserialize;

use crate::SimulatorError;

/// A simulator that gripsight knows how to start.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Adapter {
    /// slipx, from the package index.
    Slipx,
    /// CommonRoad's vehicle models, from the package index.
    Commonroad,
    /// f1tenth_gym, from the user's checkout.
    F1tenthGym,
    /// Autoware's simple planning simulator, by its published equations.
    AutowareSimplePlanning,
    /// Open-Car-Dynamics, by the C++ library in the user's checkout.
    OpenCarDynamics,
}

const FILES: [(&str, &str); 8] = [
    ("gripsight_simulator.py", include_str!("../adapters/gripsight_simulator.py")),
    ("slipx_adapter.py", include_str!("../adapters/slipx_adapter.py")),
    ("commonroad_adapter.py", include_str!("../adapters/commonroad_adapter.py")),
    ("f1tenth_gym_adapter.py", include_str!("../adapters/f1tenth_gym_adapter.py")),
    ("autoware_simple_planning_adapter.py", include_str!("../adapters/autoware_simple_planning_adapter.py")),
    ("open_car_dynamics_adapter.py", include_str!("../adapters/open_car_dynamics_adapter.py")),
    ("open_car_dynamics.cpp", include_str!("../adapters/open_car_dynamics.cpp")),
    ("gripsight_simulator.hpp", include_str!("../adapters/gripsight_simulator.hpp")),
];

impl Adapter {
    /// Its script.
    pub(crate) fn script(self) -> &'static str {
        match self {
            Self::Slipx => "slipx_adapter.py",
            Self::Commonroad => "commonroad_adapter.py",
            Self::F1tenthGym => "f1tenth_gym_adapter.py",
            Self::AutowareSimplePlanning => "autoware_simple_planning_adapter.py",
            Self::OpenCarDynamics => "open_car_dynamics_adapter.py",
        }
    }
}

/// Lays the adapters and what they share into a folder, which becomes part of Python's path.
pub(crate) fn lay_out(folder: &Path) -> Result<(), SimulatorError> {
    for (name, text) in FILES {
        let path = folder.join(name);
        std::fs::write(&path, text).map_err(SimulatorError::io(&path))?;
    }
    Ok(())
}
