// A linear single-track car in C++, as an example: g++ -O2 -shared -fPIC -std=c++17 example_car.cpp -o example_car.so
#include "gripsight_simulator.hpp"

struct ExampleCar {
  static constexpr const char* description = R"({
    "name": "example car", "step_s": 0.01, "imposes_v_x": true,
    "states": ["v_x_mps", "v_y_mps", "yaw_rate_radps"],
    "inputs": [{"name": "steering", "kind": "steering_angle"}],
    "outputs": ["v_x_mps", "v_y_mps", "yaw_rate_radps"],
    "lacks": ["a tire that saturates", "tire relaxation"],
    "parameters": [
      {"name": "stiffness", "value": 40.0, "low": 10.0, "high": 90.0, "unit": "1/s2"},
      {"name": "delay_steps", "value": 2, "low": 0, "high": 20, "integer": true}
    ]})";

  std::vector<double> buffer;
  double stiffness = 0.0, v_x = 0.0, v_y = 0.0, yaw_rate = 0.0;

  void place(const double* parameters, const double* motion, bool fresh, double* outputs) {
    if (fresh) {
      stiffness = parameters[0];
      buffer.assign(static_cast<std::size_t>(parameters[1]), 0.0);
    }
    v_x = motion[0], v_y = motion[1], yaw_rate = motion[2];
    tell(outputs);
  }

  void step(const double* command, double* outputs) {
    constexpr double step_s = 0.01, arm_m = 0.16, per_inertia = 11.0;
    buffer.insert(buffer.begin(), command[0]);
    const double steering = buffer.back();
    buffer.pop_back();
    const double front = stiffness * (steering - (v_y + arm_m * yaw_rate) / v_x);
    const double rear = -stiffness * (v_y - arm_m * yaw_rate) / v_x;
    v_y += step_s * (front + rear - v_x * yaw_rate);
    yaw_rate += step_s * per_inertia * (front - rear);
    tell(outputs);
  }

  void tell(double* outputs) const { outputs[0] = v_x, outputs[1] = v_y, outputs[2] = yaw_rate; }
};

GRIPSIGHT_SIMULATOR(ExampleCar, 2, 1, 3, 3)
