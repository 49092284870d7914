// SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
// SPDX-License-Identifier: Apache-2.0

#include "stewart_dynamics_controller/hexapod.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <stdexcept>
#include <string>
#include <vector>

#include "stewart_dynamics_controller/feed_forward.hpp"

namespace stewart_dynamics_controller
{

namespace
{

constexpr double kInfinite = std::numeric_limits<double>::infinity();

/// Return the value of a leg in an array of 1 or 6; if_not_set for an empty one.
double of_leg(
  const char * name, const std::vector<double> & values, std::size_t leg, double if_not_set = 0.0)
{
  if (values.empty()) {
    return if_not_set;
  }
  if (values.size() != 1 && values.size() != 6) {
    throw std::invalid_argument(
            std::string(name) + ": must have 1 or 6 entries, has " +
            std::to_string(values.size()));
  }
  const double value = values[values.size() == 1 ? 0 : leg];
  if (!std::isfinite(value)) {
    throw std::invalid_argument(std::string(name) + ": must be finite");
  }
  return value;
}

/// Copy the entries of row n of an array.
void copy_row(const std::vector<double> & values, std::size_t n, double * row)
{
  std::copy_n(values.begin() + 3 * static_cast<std::ptrdiff_t>(n), 3, row);
}

/// Write the direction of an axis as a unit vector, where a limit of angles needs it.
void put_axis(
  const char * name, const std::vector<double> & axes, std::size_t leg, double angle_max,
  double * axis)
{
  if (!std::isfinite(angle_max)) {
    std::fill_n(axis, 3, 0.0);
    return;
  }
  if (axes.size() != 18) {
    throw std::invalid_argument(
            std::string(name) + ": must be set, 18 entries: needed by the limit of its angle");
  }
  copy_row(axes, leg, axis);
  const double length = std::hypot(axis[0], axis[1], axis[2]);
  if (!(length > 0.0)) {
    throw std::invalid_argument(std::string(name) + ": a direction must not be 0, 0, 0");
  }
  for (std::size_t n = 0; n < 3; ++n) {
    axis[n] /= length;
  }
}

void check(bool holds, const char * rule)
{
  if (!holds) {
    throw std::invalid_argument(rule);
  }
}

/// Mean distance of the platform joints from their center.
double mean_radius(const std::vector<double> & joints)
{
  double center[3] = {0.0, 0.0, 0.0}, sum = 0.0;
  for (std::size_t n = 0; n < 18; ++n) {
    center[n % 3] += joints[n] / 6.0;
  }
  for (std::size_t n = 0; n < 18; n += 3) {
    sum += std::hypot(
      joints[n] - center[0], joints[n + 1] - center[1], joints[n + 2] - center[2]);
  }
  return sum / 6.0;
}

stewart_leg leg_of(const Params & p, std::size_t n)
{
  stewart_leg leg{};
  copy_row(p.geometry.base_joints, n, leg.base_joint);
  copy_row(p.geometry.platform_joints, n, leg.platform_joint);
  leg.zero_length = of_leg("geometry.zero_length", p.geometry.zero_length, n);
  const auto & cylinder = p.legs.cylinder;
  leg.cylinder_mass = of_leg("legs.cylinder.mass", cylinder.mass, n);
  leg.cylinder_center_of_mass = of_leg("legs.cylinder.center_of_mass", cylinder.center_of_mass, n);
  leg.cylinder_inertia = of_leg("legs.cylinder.inertia", cylinder.inertia, n);
  leg.cylinder_radius = of_leg("legs.cylinder.radius", cylinder.radius, n);
  leg.cylinder_length = of_leg("legs.cylinder.length", cylinder.length, n);
  const auto & piston = p.legs.piston;
  leg.piston_mass = of_leg("legs.piston.mass", piston.mass, n);
  leg.piston_center_of_mass = of_leg("legs.piston.center_of_mass", piston.center_of_mass, n);
  leg.piston_inertia = of_leg("legs.piston.inertia", piston.inertia, n);
  leg.piston_radius = of_leg("legs.piston.radius", piston.radius, n);
  const auto & actuator = p.actuator;
  leg.reflected_mass = of_leg("actuator.reflected_mass", actuator.reflected_mass, n);
  leg.viscous_friction = of_leg("actuator.viscous_friction", actuator.viscous_friction, n);
  leg.coulomb_friction = of_leg("actuator.coulomb_friction", actuator.coulomb_friction, n);
  leg.coulomb_velocity = of_leg("actuator.coulomb_velocity", actuator.coulomb_velocity, n, 1e-3);
  check(leg.coulomb_velocity > 0.0, "actuator.coulomb_velocity: must be more than 0");
  const auto & limits = p.limits;
  leg.length_min = of_leg("limits.length_min", limits.length_min, n);
  leg.length_max = of_leg("limits.length_max", limits.length_max, n, kInfinite);
  leg.velocity_max = of_leg("limits.velocity_max", limits.velocity_max, n, kInfinite);
  leg.force_max = of_leg("limits.force_max", limits.force_max, n, kInfinite);
  leg.joint_force_max =
    of_leg("limits.joint_force_max", limits.joint_force_max, n, kInfinite);
  check(leg.length_min < leg.length_max, "limits.length_min: must be less than limits.length_max");
  check(leg.velocity_max > 0.0, "limits.velocity_max: must be more than 0");
  check(leg.force_max > 0.0, "limits.force_max: must be more than 0");
  check(leg.joint_force_max > 0.0, "limits.joint_force_max: must be more than 0");
  leg.base_joint_angle_max =
    of_leg("limits.base_joint_angle_max", limits.base_joint_angle_max, n, kInfinite);
  leg.platform_joint_angle_max =
    of_leg("limits.platform_joint_angle_max", limits.platform_joint_angle_max, n, kInfinite);
  put_axis(
    "geometry.base_joint_axes", p.geometry.base_joint_axes, n, leg.base_joint_angle_max,
    leg.base_joint_axis);
  put_axis(
    "geometry.platform_joint_axes", p.geometry.platform_joint_axes, n,
    leg.platform_joint_angle_max, leg.platform_joint_axis);
  return leg;
}

}  // namespace

stewart_platform hexapod_of(const Params & p)
{
  stewart_platform hexapod{};
  std::copy_n(p.gravity.begin(), 3, hexapod.gravity);
  hexapod.mass = p.platform.mass;
  std::copy_n(p.platform.center_of_mass.begin(), 3, hexapod.center_of_mass);
  std::copy_n(p.platform.inertia.begin(), 6, hexapod.inertia);
  const double * i = hexapod.inertia;  // xx xy xz yy yz zz
  const double minor = i[0] * i[3] - i[1] * i[1];
  check(
    i[0] > 0.0 && minor > 0.0 && minor * i[5] - i[0] * i[4] * i[4] - i[2] * i[2] * i[3] +
    2.0 * i[1] * i[2] * i[4] > 0.0, "platform.inertia: must be positive definite");
  check(
    p.payload.mass == 0.0 || stewart_add_payload(
      &hexapod, p.payload.mass, p.payload.center_of_mass.data(), p.payload.inertia.data()) ==
    STEWART_OK, "payload: must be finite");
  for (std::size_t n = 0; n < 6; ++n) {
    hexapod.legs[n] = leg_of(p, n);
  }
  const double clearance = p.limits.leg_clearance_min;
  hexapod.leg_clearance_min = std::isnan(clearance) ? -kInfinite : clearance;
  check(
    std::isnan(clearance) || (!p.legs.cylinder.radius.empty() && !p.legs.cylinder.length.empty() &&
    !p.legs.piston.radius.empty()), "legs.cylinder.radius, legs.cylinder.length, "
    "legs.piston.radius: must be set: needed by limits.leg_clearance_min");
  const double length = p.singularity.characteristic_length;
  hexapod.characteristic_length =
    std::isnan(length) ? mean_radius(p.geometry.platform_joints) : length;
  check(
    hexapod.characteristic_length > 0.0, "singularity.characteristic_length: must be more than 0");
  hexapod.warn_condition = p.singularity.warn_condition;
  hexapod.stop_condition = p.singularity.stop_condition;
  hexapod.warn_time = p.singularity.warn_time;
  check(
    hexapod.stop_condition >= hexapod.warn_condition,
    "singularity.stop_condition: must be at least singularity.warn_condition");
  hexapod.sync_tolerance = 0.0;
  hexapod.suppress_near_singularity = p.singularity.action == "suppress_forces";
  hexapod.suppress_at_limits = p.limits.action == "suppress_forces";
  return hexapod;
}

stewart_pose initial_pose_of(const Params & p)
{
  check(
    p.initial_pose.size() == 6,
    "initial_pose: must be set, 6 entries: needed where reference is legs");
  stewart_pose pose;
  std::copy_n(p.initial_pose.begin(), 3, pose.position);
  const auto rotation =
    rotation_of_euler(p.initial_pose[3], p.initial_pose[4], p.initial_pose[5]);
  std::copy(rotation.begin(), rotation.end(), pose.rotation);
  return pose;
}

}  // namespace stewart_dynamics_controller
