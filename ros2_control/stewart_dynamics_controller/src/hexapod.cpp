// SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
// SPDX-License-Identifier: Apache-2.0

#include "stewart_dynamics_controller/hexapod.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <iterator>
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
constexpr double kPi = 3.14159265358979323846;
constexpr double kNotSet = std::numeric_limits<double>::quiet_NaN();

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

void check(bool holds, const char * rule)
{
  if (!holds) {
    throw std::invalid_argument(rule);
  }
}

/// Return the joints of a body, which are given as points or by their circle.
std::vector<double> joints_of(
  const std::string & body, const std::vector<double> & points, double radius,
  const std::vector<double> & angles, double height)
{
  const std::string name = "geometry." + body;
  const std::string other = std::isnan(radius) ? "_angles" : "_radius";
  if (std::isnan(radius) && angles.empty() && height == 0.0) {
    check(!points.empty(), (name + "_joints: must be set, as points or by their circle").c_str());
    return points;
  }
  check(
    points.empty(), (name + "_joints: given as well as " + name + "_radius, _angles or _height: "
    "leave out the points or the circle").c_str());
  check(
    !std::isnan(radius) && !angles.empty(), (name + (std::isnan(radius) ? "_radius" : "_angles") +
    ": not set: needed by " + name + other).c_str());
  check(angles.size() == 6, (name + "_angles: must have 6 entries").c_str());
  check(
    std::all_of(angles.begin(), angles.end(), [](double each) {return std::fabs(each) <= 2.0 * kPi;}),
    (name + "_angles: must be within -2 pi and 2 pi: in degrees?").c_str());
  check(radius > 0.0, (name + "_radius: must be more than 0").c_str());
  std::vector<double> joints(18);
  joints_on_circle(radius, angles.data(), height, joints.data());
  return joints;
}

/// Write row n of an array of the legs' points or directions; nan where it is empty.
void put_row(const char * name, const std::vector<double> & values, std::size_t n, double * row)
{
  if (values.empty()) {
    std::fill_n(row, 3, kNotSet);
    return;
  }
  if (values.size() != 18) {
    throw std::invalid_argument(
            std::string(name) + ": must have 18 entries, has " + std::to_string(values.size()));
  }
  std::copy_n(values.begin() + 3 * static_cast<std::ptrdiff_t>(n), 3, row);
}

/// Write points of a curve or a plate; return how many there are.
template<std::size_t kMost, std::size_t kSize>
int put_points(
  const char * name, const std::vector<double> & values, double (& points)[kMost][kSize])
{
  if (values.size() % kSize != 0 || values.size() > kMost * kSize) {
    throw std::invalid_argument(
            std::string(name) + ": must have " + std::to_string(kSize) + " numbers for each of at "
            "most " + std::to_string(kMost) + " points, has " + std::to_string(values.size()));
  }
  std::copy(values.begin(), values.end(), &points[0][0]);
  return static_cast<int>(values.size() / kSize);
}

stewart_leg leg_of(
  const Params & p, const std::vector<double> & base, const std::vector<double> & platform,
  std::size_t n)
{
  stewart_leg leg{};
  put_row("geometry.base_joints", base, n, leg.base_joint);
  put_row("geometry.platform_joints", platform, n, leg.platform_joint);
  leg.zero_length = of_leg("geometry.zero_length", p.geometry.zero_length, n);
  const auto & cylinder = p.legs.cylinder;
  leg.cylinder_mass = of_leg("legs.cylinder.mass", cylinder.mass, n);
  leg.cylinder_center_of_mass = of_leg("legs.cylinder.center_of_mass", cylinder.center_of_mass, n);
  leg.cylinder_inertia = of_leg("legs.cylinder.inertia", cylinder.inertia, n);
  leg.cylinder_radius = of_leg("legs.cylinder.radius", cylinder.radius, n, kNotSet);
  leg.cylinder_length = of_leg("legs.cylinder.length", cylinder.length, n, kNotSet);
  const auto & piston = p.legs.piston;
  leg.piston_mass = of_leg("legs.piston.mass", piston.mass, n);
  leg.piston_center_of_mass = of_leg("legs.piston.center_of_mass", piston.center_of_mass, n);
  leg.piston_inertia = of_leg("legs.piston.inertia", piston.inertia, n);
  leg.piston_radius = of_leg("legs.piston.radius", piston.radius, n, kNotSet);
  const auto & actuator = p.actuator;
  leg.reflected_mass = of_leg("actuator.reflected_mass", actuator.reflected_mass, n);
  leg.viscous_friction = of_leg("actuator.viscous_friction", actuator.viscous_friction, n);
  leg.coulomb_friction = of_leg("actuator.coulomb_friction", actuator.coulomb_friction, n);
  leg.coulomb_velocity = of_leg("actuator.coulomb_velocity", actuator.coulomb_velocity, n, 1e-3);
  leg.screw_lead = of_leg("actuator.screw_lead", actuator.screw_lead, n);
  const auto & drive = p.drive;
  leg.gear_ratio = of_leg("drive.gear_ratio", drive.gear_ratio, n, 1.0);
  leg.efficiency = of_leg("drive.efficiency", drive.efficiency, n, 1.0);
  leg.back_driving_efficiency =
    of_leg("drive.back_driving_efficiency", drive.back_driving_efficiency, n, kNotSet);
  leg.motor_inertia = of_leg("drive.motor_inertia", drive.motor_inertia, n);
  leg.screw_inertia = of_leg("drive.screw_inertia", drive.screw_inertia, n);
  leg.torque_constant = of_leg("drive.torque_constant", drive.torque_constant, n, kNotSet);
  leg.resistance = of_leg("drive.resistance", drive.resistance, n, kNotSet);
  leg.thermal_resistance =
    of_leg("drive.thermal_resistance", drive.thermal_resistance, n, kNotSet);
  leg.thermal_time_constant =
    of_leg("drive.thermal_time_constant", drive.thermal_time_constant, n, kNotSet);
  put_row("drive.base_universal_axes", drive.base_universal_axes, n, leg.base_universal_axis);
  put_row(
    "drive.platform_universal_axes", drive.platform_universal_axes, n,
    leg.platform_universal_axis);
  if (drive.screw_rotation == "universal") {
    leg.twist_ratio = drive.screw_hand == "right" ? -leg.gear_ratio : leg.gear_ratio;
  }
  put_row("geometry.base_joint_axes", p.geometry.base_joint_axes, n, leg.base_joint_axis);
  put_row(
    "geometry.platform_joint_axes", p.geometry.platform_joint_axes, n, leg.platform_joint_axis);
  // A limit is named by its line in STEWART_LIMITS: limits.length_max, drive.torque_max, ...
#define QUOTED(name) #name
#define NAME_OF(section, field) QUOTED(section) "." #field
#define SECTION_POSE limits
#define SECTION_TWIST limits
#define SECTION_LOAD limits
#define SECTION_MOTOR drive
#define MINIMUM(bit, NAME, field, DEPENDS, quantity) \
  leg.field = of_leg(NAME_OF(SECTION_ ## DEPENDS, field), p.SECTION_ ## DEPENDS.field, n);
#define MAXIMUM(bit, NAME, field, DEPENDS, quantity) \
  leg.field = of_leg( \
    NAME_OF(SECTION_ ## DEPENDS, field), p.SECTION_ ## DEPENDS.field, n, kInfinite);
  STEWART_LEG_LIMITS(MINIMUM, MAXIMUM, MAXIMUM)
#undef MINIMUM
#undef MAXIMUM
  // Those of other kinds of legs are not set.
#define MINIMUM(bit, NAME, field, DEPENDS, quantity) leg.field = -kInfinite;
#define MAXIMUM(bit, NAME, field, DEPENDS, quantity) leg.field = kInfinite;
  STEWART_CRANK_LIMITS(MINIMUM, MAXIMUM, MAXIMUM)
#undef MINIMUM
#undef MAXIMUM
  check(
    p.legs.crank.length.empty(),
    "legs.crank.length: stewart_dynamics_controller takes telescopic legs alone");
  return leg;
}

/// Return whether drive.* says anything of a leg.
bool has_drive(const stewart_leg & leg)
{
  const double set[] = {leg.back_driving_efficiency, leg.torque_constant, leg.resistance,
    leg.thermal_resistance, leg.thermal_time_constant, leg.torque_max, leg.speed_max,
    leg.temperature_rise_max};
  const auto is_set = [](double each) {return std::isfinite(each);};
  return std::any_of(std::begin(set), std::end(set), is_set) || leg.gear_ratio != 1.0 ||
         leg.efficiency != 1.0 || leg.motor_inertia != 0.0 || leg.screw_inertia != 0.0 ||
         leg.twist_ratio != 0.0;
}

/// Return the home poses of a hexapod, complete or not.
home_poses homes_of(const Params & p, stewart_platform hexapod)
{
  stewart_complete(&hexapod);
  home_legs legs;
  home_poses home;
  const auto & side = p.geometry.platform_side;
  put_home_legs(&hexapod, &legs);
  find_home(&legs, side == "positive" ? 1 : side == "negative" ? -1 : 0, &home);
  return home;
}

/// Check that there is a home pose; needed_by: what it is needed by, for the error without one.
void check_home(const home_poses & home, const std::string & needed_by)
{
  check(
    home.reachable != 0.0, ("home pose: no level pose has all legs between limits.length_min and "
    "limits.length_max: " + needed_by).c_str());
  check(
    home.known != 0.0, ("home pose: limits.length_min and limits.length_max, or "
    "geometry.zero_length, must give a length that the legs can have in a level pose: " +
    needed_by).c_str());
}

/// Give joints whose angles are limited, and screws that turn, the axes that they have without
/// given ones, which follow from the home pose.
void put_axes(const Params & p, stewart_platform & hexapod)
{
  const home_poses home = homes_of(p, hexapod);
  const auto put = [&](
    const std::vector<double> & given, double stewart_leg::* most,
    double (stewart_leg::* axis)[3], double (home_poses::* directions)[6][3], const char * name) {
      if (!given.empty() || !std::isfinite(hexapod.legs[0].*most)) {
        return;
      }
      check_home(home, std::string("needed without geometry.") + name);
      for (std::size_t n = 0; n < 6; ++n) {
        std::copy_n((home.*directions)[n], 3, hexapod.legs[n].*axis);
      }
    };
  put(
    p.geometry.base_joint_axes, &stewart_leg::base_joint_angle_max, &stewart_leg::base_joint_axis,
    &home_poses::base_directions, "base_joint_axes");
  put(
    p.geometry.platform_joint_axes, &stewart_leg::platform_joint_angle_max,
    &stewart_leg::platform_joint_axis, &home_poses::platform_directions, "platform_joint_axes");
  const std::int64_t along =
    p.drive.screw_rotation == "universal" ? put_universal_axes(&home, &hexapod) : 0;
  check(
    along == 0, (std::string("drive.") + (along <= 6 ? "base" : "platform") + "_universal_axes: "
    "along the leg at the home pose: must be across it: leg " +
    std::to_string((along + 5) % 6 + 1)).c_str());
}

/// Throw the rule that a complete hexapod breaks, with the number of its leg.
void check_rules(const stewart_platform & hexapod)
{
  int where = -1;
  const int rule = stewart_check(&hexapod, &where);
  if (rule != STEWART_VALID) {
    const std::string leg = where < 0 ? "" : ": leg or plate " + std::to_string(where + 1);
    throw std::invalid_argument(stewart_rule(rule) + leg);
  }
}

}  // namespace

stewart_platform hexapod_of(const Params & p)
{
  stewart_platform hexapod{};
  std::copy_n(p.gravity.begin(), 3, hexapod.gravity);
  hexapod.mass = p.platform.mass;
  std::copy_n(p.platform.center_of_mass.begin(), 3, hexapod.center_of_mass);
  std::copy_n(p.platform.inertia.begin(), 6, hexapod.inertia);
  const auto & g = p.geometry;
  const auto base = joints_of("base", g.base_joints, g.base_radius, g.base_angles, g.base_height);
  const auto platform = joints_of(
    "platform", g.platform_joints, g.platform_radius, g.platform_angles, g.platform_height);
  for (std::size_t n = 0; n < 6; ++n) {
    hexapod.legs[n] = leg_of(p, base, platform, n);
  }
  put_axes(p, hexapod);
  const double clearance = p.limits.leg_clearance_min;
  hexapod.leg_clearance_min = std::isnan(clearance) ? -kInfinite : clearance;
  hexapod.n_torque_speed =
    put_points("drive.torque_speed", p.drive.torque_speed, hexapod.torque_speed);
  hexapod.n_base_outline =
    put_points("geometry.base_outline", p.geometry.base_outline, hexapod.base_outline);
  hexapod.n_platform_outline = put_points(
    "geometry.platform_outline", p.geometry.platform_outline, hexapod.platform_outline);
  hexapod.characteristic_length = p.singularity.characteristic_length;
  hexapod.warn_condition = p.singularity.warn_condition;
  hexapod.stop_condition = p.singularity.stop_condition;
  hexapod.warn_time = p.singularity.warn_time;
  hexapod.timeout = p.setpoint.timeout;
  hexapod.with_motors = !p.actuator.screw_lead.empty() || !p.drive.torque_speed.empty() ||
    std::any_of(std::begin(hexapod.legs), std::end(hexapod.legs), has_drive);
  hexapod.suppress_near_singularity = p.singularity.action == "suppress_forces";
  hexapod.suppress_at_limits = p.limits.action == "suppress_forces";
  stewart_complete(&hexapod);
  check_rules(hexapod);
  check(
    p.payload.mass == 0.0 || stewart_add_payload(
      &hexapod, p.payload.mass, p.payload.center_of_mass.data(), p.payload.inertia.data()) ==
    STEWART_OK, "payload: must be finite, its inertia positive semidefinite");
  return hexapod;
}

std::optional<Governor> governor_of(const Params & p, const stewart_platform & hexapod)
{
  if (!p.governor) {
    return std::nullopt;
  }
  check(p.reference == "platform", "governor: needs reference: platform");
  const home_poses home = homes_of(p, hexapod);
  check_home(home, "needed by governor");
  const double head[3] = {0.0, 0.0, 0.0};
  const coordinates at_home{};
  Governor governor;
  put_governor(&hexapod, &home.poses[0], head, &governor.within, &governor.limits);
  const std::int64_t limit = governed_limit(&governor.within, &governor.limits, &at_home);
  check(
    limit == 0, (std::string("governor: at home ") + (limit ? name_of_limit(limit) : "") +
    " is exceeded, or nearer than the margin of the governor").c_str());
  return governor;
}

std::optional<imu_mounting> imu_of(const Params & p)
{
  if (p.base.source != "imu") {
    return std::nullopt;
  }
  check(!p.imu_sensor.empty(), "imu_sensor: must be set: needed by base.source: imu");
  const auto & at = p.base.imu.position;
  check(
    std::all_of(at.begin(), at.end(), [](double each) {return std::isfinite(each);}),
    "base.imu.position: must be finite");
  imu_mounting imu{};
  std::copy_n(at.begin(), 3, imu.position);
  check(
    stewart_rotation(p.base.imu.orientation.data(), imu.rotation) == STEWART_OK,
    "base.imu.orientation: must be a unit quaternion");
  imu.rate = 2.0 * kPi * p.base.imu.cutoff;
  imu.timeout = std::llround(p.base.timeout * 1e9);
  return imu;
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

Six torque_scales_of(const Params & p)
{
  Six scales{};
  for (const auto & interface : p.command_interfaces) {
    const bool per_mille = interface == "torque_per_mille";
    check(
      !p.actuator.screw_lead.empty() ||
      !(per_mille || interface == "torque" || interface == "motor_velocity"),
      "actuator.screw_lead: not set: needed by torque, torque_per_mille and motor_velocity in "
      "command_interfaces");
    check(
      !per_mille || !p.drive.rated_torque.empty(),
      "drive.rated_torque: not set: needed by torque_per_mille in command_interfaces");
    for (std::size_t n = 0; per_mille && n < 6; ++n) {
      const double rated = of_leg("drive.rated_torque", p.drive.rated_torque, n);
      check(rated > 0.0, "drive.rated_torque: must be more than 0");
      scales[n] = 1e3 / rated;
    }
  }
  return scales;
}

}  // namespace stewart_dynamics_controller
