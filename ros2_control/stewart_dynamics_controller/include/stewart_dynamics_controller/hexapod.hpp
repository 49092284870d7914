// SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
// SPDX-License-Identifier: Apache-2.0

#ifndef STEWART_DYNAMICS_CONTROLLER__HEXAPOD_HPP_
#define STEWART_DYNAMICS_CONTROLLER__HEXAPOD_HPP_

#include <optional>

#include "control.h"
#include "stewart_dynamics.h"
#include "stewart_dynamics_controller/feed_forward.hpp"
#include "stewart_dynamics_controller/stewart_dynamics_controller_parameters.hpp"

namespace stewart_dynamics_controller
{

/// Return the hexapod of the parameters.
/// Throws std::invalid_argument with parameter, value and rule, as the node rejects them.
stewart_platform hexapod_of(const Params & parameters);

/// Return the governor of the hexapod; none without the parameter governor. Throws
/// std::invalid_argument: there is no home pose, or a limit is exceeded there.
std::optional<Governor> governor_of(const Params & parameters, const stewart_platform & hexapod);

/// Return how the IMU is mounted; none unless base.source is imu. Throws std::invalid_argument.
std::optional<imu_mounting> imu_of(const Params & parameters);

/// Return the pose in the parameter initial_pose; throws std::invalid_argument if it is not set.
stewart_pose initial_pose_of(const Params & parameters);

/// Return per mille of drive.rated_torque by N m; zero where it is not commanded. Throws
/// std::invalid_argument: command_interfaces need drive.* that are not set.
Six torque_scales_of(const Params & parameters);

}  // namespace stewart_dynamics_controller

#endif  // STEWART_DYNAMICS_CONTROLLER__HEXAPOD_HPP_
