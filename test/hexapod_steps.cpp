// SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
// SPDX-License-Identifier: Apache-2.0

// The hexapod of the controller's parameters in some motions, for test_ros2_control.py: reads
// parameters and then numbers of stewart_motion and wrench as text, writes each stewart_output.

#include <array>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <iostream>
#include <string>

#include "stewart_dynamics_controller/hexapod.hpp"

using stewart_dynamics_controller::Params;
using stewart_dynamics_controller::read;

int main()
{
  Params parameters;
  read(std::cin, parameters);
  std::size_t count;
  std::cin >> count;
  try {
    const stewart_platform hexapod = stewart_dynamics_controller::hexapod_of(parameters);
    stewart_dynamics_controller::torque_scales_of(parameters);
    stewart_state state{};
    for (std::size_t n = 0; n < count; ++n) {
      std::int64_t stamp;
      std::array<double, sizeof(stewart_motion) / sizeof(double)> numbers;
      std::array<double, 6> wrench;
      std::cin >> stamp;
      read(std::cin, numbers);
      read(std::cin, wrench);
      stewart_motion motion;
      std::memcpy(&motion, numbers.data(), sizeof(motion));
      stewart_output output{};
      stewart_step(&hexapod, &motion, wrench.data(), nullptr, stamp, &state, &output);
      std::fwrite(&output, sizeof(output), 1, stdout);
    }
  } catch (const std::exception & error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
  return 0;
}
