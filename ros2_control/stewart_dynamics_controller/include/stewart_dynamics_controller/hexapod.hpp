// SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
// SPDX-License-Identifier: Apache-2.0

#ifndef STEWART_DYNAMICS_CONTROLLER__HEXAPOD_HPP_
#define STEWART_DYNAMICS_CONTROLLER__HEXAPOD_HPP_

#include "stewart_dynamics.h"
#include "stewart_dynamics_controller/feed_forward.hpp"
#include "stewart_dynamics_controller/stewart_dynamics_controller_parameters.hpp"

namespace stewart_dynamics_controller
{

/// Return the hexapod of the parameters.
/// Throws std::invalid_argument with parameter, value and rule, as the node rejects them.
stewart_platform hexapod_of(const Params & parameters);

/// Return the pose in the parameter initial_pose; throws std::invalid_argument if it is not set.
stewart_pose initial_pose_of(const Params & parameters);

/// Return per mille of drive.rated_torque by N m; zero where it is not commanded. Throws
/// std::invalid_argument: command_interfaces need drive.* that are not set.
Six torque_scales_of(const Params & parameters);

}  // namespace stewart_dynamics_controller

#endif  // STEWART_DYNAMICS_CONTROLLER__HEXAPOD_HPP_
