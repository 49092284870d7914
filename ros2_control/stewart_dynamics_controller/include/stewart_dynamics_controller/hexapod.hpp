// Copyright 2026 The stewart_dynamics developers
//
// Licensed under the Apache License, Version 2.0 (the "License");
// you may not use this file except in compliance with the License.
// You may obtain a copy of the License at
//
//     http://www.apache.org/licenses/LICENSE-2.0
//
// Unless required by applicable law or agreed to in writing, software
// distributed under the License is distributed on an "AS IS" BASIS,
// WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
// See the License for the specific language governing permissions and
// limitations under the License.

#ifndef STEWART_DYNAMICS_CONTROLLER__HEXAPOD_HPP_
#define STEWART_DYNAMICS_CONTROLLER__HEXAPOD_HPP_

#include "stewart_dynamics.h"
#include "stewart_dynamics_controller/stewart_dynamics_controller_parameters.hpp"

namespace stewart_dynamics_controller
{

/// Return the hexapod of the parameters.
/// Throws std::invalid_argument with parameter, value and rule, as the node rejects them.
stewart_platform hexapod_of(const Params & parameters);

/// Return the pose in the parameter initial_pose; throws std::invalid_argument if it is not set.
stewart_pose initial_pose_of(const Params & parameters);

}  // namespace stewart_dynamics_controller

#endif  // STEWART_DYNAMICS_CONTROLLER__HEXAPOD_HPP_
