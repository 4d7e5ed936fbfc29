// Open-Car-Dynamics, out of the user's checkout: open_car_dynamics_adapter.py compiles this file against it and names the parameters.
// Single track, force on the driven axle, first-order steering; GRIPSIGHT_TIRE is the tire model.
#include "gripsight_simulator.hpp"

#include <array>
#include <string>
#include <utility>

#include "ocd_aerodynamics_models_cpp/default.hpp"
#include "ocd_drivetrain_fx_cpp/drivetrain_fx_model.hpp"
#include "ocd_steering_actuator_pt1_cpp/steering_actuator_pt1_model.hpp"
#include "ocd_tire_models_cpp/linear.hpp"
#include "ocd_tire_models_cpp/mf_52.hpp"
#include "ocd_tire_models_cpp/mf_simple.hpp"
#include "ocd_vehicle_dynamics_single_track_cpp/vehicle_dynamics_model.hpp"
#include "ocd_vehicle_model_cpp/vehicle_model.hpp"

using Vehicle = tam::ocd::VehicleModel<
  tam::ocd::drivetrain::DrivetrainFxModel, tam::ocd::steering_actuator::PT1SteeringActuatorModel,
  tam::ocd::vehicle_dynamics::VehicleDynamicsSingleTrackModel<
    tam::ocd::tire_models::GRIPSIGHT_TIRE, tam::ocd::aerodynamics::DefaultAerodynamicsModel>>;

// What every car begins with, the names of what a pass changes, and the inner steps in one of gripsight's.
struct Settings {
  std::vector<std::pair<std::string, tam::pmg::param_value_variant_t>> values;
  std::vector<std::string> changed;
  int inner = 1;
};
static Settings settings;

struct OpenCar {
  static constexpr const char* description = "{}";
  static constexpr double instant_s = 1e-9;

  Vehicle vehicle;
  tam::pmg::MgmtInterface::SharedPtr parameters = vehicle.get_param_manager();
  double mass_kg = 0.0, inner_s = 0.0;
  std::array<double, 2> radius_m{};

  OpenCar() {
    for (const auto& [name, value] : settings.values) parameters->set_value(name, value);
  }

  double value(const std::string& name) const { return parameters->get_value(name).as_double(); }

  // States are set by their initial values and a reset, which forgets the wheels' speed until a step has been made: that one takes no time.
  void place(const double* changed, const double* motion, bool fresh, double* outputs) {
    static const std::string car = "vehicle_dynamics_single_track.", start = "initial_state.";
    if (fresh) {
      for (std::size_t i = 0; i < settings.changed.size(); ++i) parameters->set_value(settings.changed[i], changed[i]);
      mass_kg = value(car + "mass_vehicle_kg");
      inner_s = value("integration_step_size_s");
      radius_m = {value(car + "tire.rolling_radius_m.front"), value(car + "tire.rolling_radius_m.rear")};
    }
    const double angle_rad = fresh ? 0.0 : vehicle.get_steering_actuator_feedback().steering_angle_rad;
    const char* names[] = {"v_x_mps", "v_y_mps", "psi_dot_radps"};
    for (int s = 0; s < 3; ++s) parameters->set_value(start + "vehicle_dynamics." + names[s], motion[s]);
    parameters->set_value(start + "steering_actuator.position_rad", angle_rad);
    const char* wheels[] = {"omega_FL_radps", "omega_FR_radps", "omega_rear_axle_radps"};
    for (int w = 0; w < 3; ++w) parameters->set_value(start + "drivetrain." + wheels[w], motion[0] / radius_m[w / 2]);
    vehicle.reset();
    parameters->set_value("integration_step_size_s", instant_s);
    vehicle.step();
    parameters->set_value("integration_step_size_s", inner_s);
    for (int s = 0; s < 3; ++s) outputs[s] = motion[s];
  }

  void step(const double* command, double* outputs) {
    vehicle.set_steering_input({command[0]});
    vehicle.set_drivetrain_input(mass_kg * command[1]);
    for (int i = 0; i < settings.inner; ++i) vehicle.step();
    const auto seen = vehicle.get_vehicle_model_output().vehicle_dynamics_output;
    outputs[0] = seen.velocity_mps.x, outputs[1] = seen.velocity_mps.y, outputs[2] = seen.angular_velocity_radps.z;
  }
};

// A parameter that stays: a number, or a series where `series` says so. Whether the vehicle has it.
extern "C" int open_car_keep(const char* name, const double* numbers, int64_t count, int series) {
  static Vehicle known;
  if (!known.get_param_manager()->has_parameter(name)) return 0;
  if (series != 0) {
    settings.values.emplace_back(name, std::vector<double>(numbers, numbers + count));
  } else {
    settings.values.emplace_back(name, numbers[0]);
  }
  return 1;
}

extern "C" void open_car_change(const char* name) { settings.changed.emplace_back(name); }

extern "C" void open_car_inner_steps(int count) { settings.inner = count; }

GRIPSIGHT_SIMULATOR(OpenCar, settings.changed.size(), 2, 3, 3)
