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
#include <utility>
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

bool has_cranks(const Params & p) {return !p.legs.crank.length.empty();}

/// Return whether numbers are given: neither none nor all of them a default.
bool is_given(const std::vector<double> & values, double default_value = kNotSet)
{
  return std::any_of(
    values.begin(), values.end(), [&](double each) {return each != default_value;});
}

/// Throw where a parameter is given that has no meaning for the kind of legs.
void check_foreign(const Params & p)
{
  const auto & cylinder = p.legs.cylinder;
  const auto & piston = p.legs.piston;
  const auto & crank = p.legs.crank;
  const auto & rod = p.legs.rod;
  const auto & at = p.limits;
  const auto & g = p.geometry;
  const std::pair<const char *, bool> of_telescopic[] = {
    {"legs.cylinder.mass", is_given(cylinder.mass, 0.0)},
    {"legs.cylinder.center_of_mass", is_given(cylinder.center_of_mass, 0.0)},
    {"legs.cylinder.inertia", is_given(cylinder.inertia, 0.0)},
    {"legs.cylinder.radius", is_given(cylinder.radius)},
    {"legs.cylinder.length", is_given(cylinder.length)},
    {"legs.piston.mass", is_given(piston.mass, 0.0)},
    {"legs.piston.center_of_mass", is_given(piston.center_of_mass, 0.0)},
    {"legs.piston.inertia", is_given(piston.inertia, 0.0)},
    {"legs.piston.radius", is_given(piston.radius)},
    {"actuator.reflected_mass", is_given(p.actuator.reflected_mass, 0.0)},
    {"actuator.screw_lead", is_given(p.actuator.screw_lead)},
    {"geometry.zero_length", is_given(g.zero_length, 0.0)},
    {"geometry.base_joint_axes", is_given(g.base_joint_axes)},
    {"geometry.base_outline", is_given(g.base_outline)},
    {"geometry.platform_outline", is_given(g.platform_outline)},
    {"limits.length_min", is_given(at.length_min)}, {"limits.length_max", is_given(at.length_max)},
    {"limits.velocity_max", is_given(at.velocity_max)},
    {"limits.force_max", is_given(at.force_max)},
    {"limits.joint_force_max", is_given(at.joint_force_max)},
    {"limits.base_joint_angle_max", is_given(at.base_joint_angle_max)},
    {"limits.leg_clearance_min", !std::isnan(at.leg_clearance_min)},
    {"drive.screw_inertia", is_given(p.drive.screw_inertia, 0.0)},
    {"drive.screw_rotation", p.drive.screw_rotation != "guided"},
    {"drive.base_universal_axes", is_given(p.drive.base_universal_axes)},
    {"drive.platform_universal_axes", is_given(p.drive.platform_universal_axes)}};
  const std::pair<const char *, bool> of_cranks[] = {
    {"legs.crank.mass", is_given(crank.mass, 0.0)},
    {"legs.crank.center_of_mass", is_given(crank.center_of_mass, 0.0)},
    {"legs.crank.inertia", is_given(crank.inertia, 0.0)},
    {"legs.rod.length", is_given(rod.length)}, {"legs.rod.mass", is_given(rod.mass, 0.0)},
    {"legs.rod.center_of_mass", is_given(rod.center_of_mass)},
    {"legs.rod.inertia", is_given(rod.inertia)},
    {"actuator.reflected_inertia", is_given(p.actuator.reflected_inertia, 0.0)},
    {"geometry.crank_angles", is_given(g.crank_angles)},
    {"geometry.crank_axes", is_given(g.crank_axes)},
    {"geometry.crank_directions", is_given(g.crank_directions)},
    {"limits.angle_min", is_given(at.angle_min)}, {"limits.angle_max", is_given(at.angle_max)},
    {"limits.speed_max", is_given(at.speed_max)}, {"limits.torque_max", is_given(at.torque_max)},
    {"limits.rod_force_max", is_given(at.rod_force_max)},
    {"limits.lever_min", is_given(at.lever_min)}};
  if (has_cranks(p)) {
    for (const auto & [name, given] : of_telescopic) {
      check(!given, (std::string(name) + ": must not be given with legs.crank.length").c_str());
    }
    return;
  }
  for (const auto & [name, given] : of_cranks) {
    check(!given, (std::string(name) + ": needs legs.crank.length, which is not set").c_str());
  }
}

/// Write the axes of a motor and the direction of its crank at the angle zero.
void put_crank_axes(const Params & p, std::size_t n, stewart_leg & leg)
{
  const auto & g = p.geometry;
  std::vector<double> axes = g.crank_axes, directions = g.crank_directions;
  if (!g.crank_angles.empty()) {
    check(g.crank_angles.size() == 6, "geometry.crank_angles: must have 6 entries");
    check(
      axes.empty() && directions.empty(), "geometry.crank_axes, geometry.crank_directions: given "
      "as well as geometry.crank_angles: leave out one of them");
    axes.resize(18), directions.resize(18);
    level_cranks(g.crank_angles.data(), axes.data(), directions.data());
  }
  check(
    !axes.empty() && !directions.empty(), "geometry.crank_angles: not set: needed by "
    "legs.crank.length; or give geometry.crank_axes and geometry.crank_directions");
  put_row("geometry.crank_axes", axes, n, leg.crank_axis);
  put_row("geometry.crank_directions", directions, n, leg.crank_direction);
}

/// Write one of several numbers of a crank: those of all legs, of each leg, or the one at `alone`.
void put_numbers(
  const char * name, const std::vector<double> & values, std::size_t n, std::size_t alone,
  double * numbers, std::size_t count)
{
  if (values.size() == count || values.size() == 6 * count) {
    const std::size_t first = values.size() == count ? 0 : count * n;
    std::copy_n(values.begin() + static_cast<std::ptrdiff_t>(first), count, numbers);
  } else {
    numbers[alone] = of_leg(name, values, n);
  }
}

void put_crank(const Params & p, std::size_t n, stewart_leg & leg)
{
  const auto & crank = p.legs.crank;
  const auto & rod = p.legs.rod;
  leg.crank_length = of_leg("legs.crank.length", crank.length, n);
  check(!rod.length.empty(), "legs.rod.length: not set: needed by legs.crank.length");
  leg.rod_length = of_leg("legs.rod.length", rod.length, n);
  put_crank_axes(p, n, leg);
  leg.crank_mass = of_leg("legs.crank.mass", crank.mass, n);
  put_numbers(
    "legs.crank.center_of_mass", crank.center_of_mass, n, 0, leg.crank_center_of_mass, 3);
  put_numbers("legs.crank.inertia", crank.inertia, n, 5, leg.crank_inertia, 6);
  leg.rod_mass = of_leg("legs.rod.mass", rod.mass, n);
  leg.rod_center_of_mass =
    of_leg("legs.rod.center_of_mass", rod.center_of_mass, n, kNotSet);
  leg.rod_inertia = of_leg("legs.rod.inertia", rod.inertia, n, kNotSet);
  leg.reflected_mass =
    of_leg("actuator.reflected_inertia", p.actuator.reflected_inertia, n);
  const auto & at = p.limits;
  leg.angle_min = of_leg("limits.angle_min", at.angle_min, n, -kInfinite);
  leg.angle_max = of_leg("limits.angle_max", at.angle_max, n, kInfinite);
  leg.crank_speed_max = of_leg("limits.speed_max", at.speed_max, n, kInfinite);
  leg.crank_torque_max = of_leg("limits.torque_max", at.torque_max, n, kInfinite);
  leg.rod_force_max = of_leg("limits.rod_force_max", at.rod_force_max, n, kInfinite);
  leg.lever_min = of_leg("limits.lever_min", at.lever_min, n, 0.1);
  leg.branch = 1.0;
}

/// Return the branch of a leg: 1 or -1, or 0 if home decides it.
double branch_of(const Params & p, std::size_t n)
{
  const auto & given = p.geometry.crank_branch;
  check(
    given.size() == 1 || given.size() == 6, "geometry.crank_branch: must have 1 or 6 entries");
  const std::string & branch = given[given.size() == 1 ? 0 : n];
  return branch == "positive" ? 1.0 : branch == "negative" ? -1.0 : 0.0;
}

stewart_leg leg_of(
  const Params & p, const std::vector<double> & base, const std::vector<double> & platform,
  std::size_t n)
{
  stewart_leg leg{};
  put_row("geometry.base_joints", base, n, leg.base_joint);
  put_row("geometry.platform_joints", platform, n, leg.platform_joint);
  leg.servo_angle_at_min = leg.servo_angle_at_max = kNotSet;
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
  leg.coulomb_velocity = of_leg("actuator.coulomb_velocity", actuator.coulomb_velocity, n, has_cranks(p) ? 0.01 : 1e-3);
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
  leg.lever_min = 0.0;
  if (has_cranks(p)) {
    put_crank(p, n, leg);
  }
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
void check_home(const Params & p, const home_poses & home, const std::string & needed_by)
{
  if (has_cranks(p)) {
    check(
      home.reachable != 0.0 && home.known != 0.0, ("home pose: no level pose has all rods at the "
      "cranks' middle angles: " + needed_by).c_str());
    return;
  }
  check(
    home.reachable != 0.0, ("home pose: no level pose has all legs between limits.length_min and "
    "limits.length_max: " + needed_by).c_str());
  check(
    home.known != 0.0, ("home pose: limits.length_min and limits.length_max, or "
    "geometry.zero_length, must give a length that the legs can have in a level pose: " +
    needed_by).c_str());
}

/// Give cranks the branches that are set, or those that home decides.
void put_branches(const Params & p, stewart_platform & hexapod)
{
  double wanted[6], angles[12];
  for (std::size_t n = 0; n < 6; ++n) {
    wanted[n] = branch_of(p, n);
    hexapod.legs[n].branch = wanted[n];
  }
  if (std::find(std::begin(wanted), std::end(wanted), 0.0) == std::end(wanted)) {
    return;
  }
  const home_poses home = homes_of(p, hexapod);
  check_home(p, home, "needed by geometry.crank_branch: auto");
  stewart_platform complete = hexapod;
  stewart_complete(&complete);
  const std::int64_t open = choose_branches(&complete, &home.poses[0], wanted, angles);
  for (std::size_t n = 0; n < 6; ++n) {
    check(
      wanted[n] != 0.0 || !std::isnan(angles[2 * n]), ("legs.rod.length: does not reach the "
      "platform joint at home, from which geometry.crank_branch: auto follows: leg " +
      std::to_string(n + 1)).c_str());
    hexapod.legs[n].branch = complete.legs[n].branch;
  }
  check(
    open == 0, (std::string("geometry.crank_branch: auto: ") + (open > 6 ?
    "both are possible" : "neither is likely") + ": give the branch, or limits of the angle: leg " +
    std::to_string((open + 5) % 6 + 1)).c_str());
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
      check_home(p, home, std::string("needed without geometry.") + name);
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
  check_foreign(p);
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
  if (has_cranks(p)) {
    put_branches(p, hexapod);
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
  check_home(p, home, "needed by governor");
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
      has_cranks(p) || !p.actuator.screw_lead.empty() ||
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
