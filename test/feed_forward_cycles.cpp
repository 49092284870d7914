// SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
// SPDX-License-Identifier: Apache-2.0

// Cycles of the feed-forward with the controller's parameters, for test_ros2_control.py: reads
// parameters, and of each cycle its time, whether its reference repeats the last one, the
// reference of the platform, the wrench and the reading of the IMU; writes each answer.

#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <iostream>

#include "stewart_dynamics_controller/hexapod.hpp"

using stewart_dynamics_controller::Command;
using stewart_dynamics_controller::FeedForward;
using stewart_dynamics_controller::Params;
using stewart_dynamics_controller::PlatformReference;
using stewart_dynamics_controller::read;
using stewart_dynamics_controller::Six;

struct Answer
{
  double code;
  stewart_motion governed;
  stewart_base base;
  Command command;
};

int main()
{
  Params parameters;
  read(std::cin, parameters);
  std::size_t count;
  std::int64_t period;
  std::cin >> count >> period;
  try {
    const stewart_platform hexapod = stewart_dynamics_controller::hexapod_of(parameters);
    FeedForward feed_forward(
      hexapod, stewart_pose{}, static_cast<std::int64_t>(parameters.setpoint.timeout * 1e9),
      period, stewart_dynamics_controller::governor_of(parameters, hexapod),
      stewart_dynamics_controller::imu_of(parameters));
    Command command{};
    for (std::size_t n = 0; n < count; ++n) {
      std::int64_t stamp;
      bool repeated;
      PlatformReference at;
      Six wrench, reading;
      std::cin >> stamp >> repeated;
      read(std::cin, at.position);
      read(std::cin, at.orientation);
      read(std::cin, at.linear_velocity);
      read(std::cin, at.angular_velocity);
      read(std::cin, at.linear_acceleration);
      read(std::cin, at.angular_acceleration);
      read(std::cin, wrench);
      read(std::cin, reading);
      const int code = feed_forward.update(at, wrench, Six{}, stamp, command, reading, repeated);
      const stewart_base * base = feed_forward.base();
      const Answer answer{
        static_cast<double>(code), feed_forward.governed(), base ? *base : stewart_base{}, command};
      std::fwrite(&answer, sizeof(answer), 1, stdout);
    }
  } catch (const std::exception & error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
  return 0;
}
