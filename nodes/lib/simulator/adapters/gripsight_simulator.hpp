// Turns a C++ class with two methods into a simulator that gripsight can run: a shared library that gripsight_simulator.py loads.
//
//   struct MyCar {
//     static constexpr const char* description = R"({"name": "my car", "step_s": 0.01, "states": [...], ...})";
//     void place(const double* parameters, const double* motion, bool fresh, double* outputs);
//     void step(const double* command, double* outputs);
//   };
//   GRIPSIGHT_SIMULATOR(MyCar, 3 /* parameters */, 1 /* inputs */, 3 /* states */, 3 /* outputs */)
//
//   g++ -O2 -shared -fPIC -std=c++17 my_car.cpp -o my_car.so        command: [python3, -m, gripsight_simulator, my_car.so]
//
// What place and step do, and what the description holds, is told at the head of gripsight_simulator.py. No library is needed.
#pragma once

#include <cstdint>
#include <vector>

namespace gripsight {

// One pass through a stretch of driving. Every state is an output: state_outputs says which.
template <class Car>
void run(Car& car, int inputs, int states, int outputs, const int32_t* state_outputs, int along, const double* parameters,
         int64_t steps, const double* commands, int64_t placed, const int64_t* place_steps, const double* motions, const double* v_x,
         const double* kicks, int64_t wanted, const int64_t* output_steps, double* out) {
  std::vector<double> seen(outputs, 0.0), motion(states, 0.0);
  int64_t place = 0, row = 0;
  bool fresh = true;
  for (int64_t k = 0; k <= steps; ++k) {
    if (place < placed && place_steps[place] == k) {
      car.place(parameters, motions + place * states, fresh, seen.data());
      fresh = false;
      ++place;
    } else if (!fresh && k > 0 && (v_x != nullptr || kicks != nullptr)) {
      for (int s = 0; s < states; ++s) {
        motion[s] = seen[state_outputs[s]] + (kicks != nullptr ? kicks[(k - 1) * states + s] : 0.0);
      }
      if (v_x != nullptr) motion[along] = v_x[k];
      car.place(parameters, motion.data(), false, seen.data());
    }
    if (row < wanted && output_steps[row] == k) {
      for (int c = 0; c < outputs; ++c) out[row * outputs + c] = seen[c];
      ++row;
    }
    if (k < steps && !fresh) car.step(commands + k * inputs, seen.data());
  }
}

}  // namespace gripsight

#define GRIPSIGHT_SIMULATOR(Car, parameter_count, input_count, state_count, output_count)                                        \
  extern "C" const char* gripsight_description() { return Car::description; }                                                    \
  extern "C" void gripsight_pass(const int32_t* state_outputs, int32_t along, const double* parameters, int64_t steps,           \
                                 const double* commands, int64_t placed, const int64_t* place_steps, const double* motions,      \
                                 const double* v_x, const double* kicks, int64_t wanted, const int64_t* output_steps,            \
                                 double* out) {                                                                                  \
    Car car{};                                                                                                                   \
    gripsight::run(car, input_count, state_count, output_count, state_outputs, along, parameters, steps, commands, placed,       \
                   place_steps, motions, v_x, kicks, wanted, output_steps, out);                                                 \
  }
