// SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
// SPDX-License-Identifier: Apache-2.0

// Test of the feed-forward without ROS and without a test library: ends with 1 at the first
// check that fails.

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <limits>
#include <string>
#include <utility>

#include "stewart_dynamics_controller/feed_forward.hpp"

using stewart_dynamics_controller::Command;
using stewart_dynamics_controller::FeedForward;
using stewart_dynamics_controller::Governor;
using stewart_dynamics_controller::LegReference;
using stewart_dynamics_controller::PlatformReference;
using stewart_dynamics_controller::rotation_of_euler;
using stewart_dynamics_controller::Six;

#define CHECK(condition) \
  do { \
    if (!(condition)) { \
      std::printf("%s:%d: failed: %s\n", __FILE__, __LINE__, #condition); \
      std::exit(1); \
    } \
  } while (false)

namespace
{

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinite = std::numeric_limits<double>::infinity();
constexpr double kDegree = 0.017453292519943295;
constexpr std::int64_t kCycle = 1000000, kTimeout = 100 * kCycle;  // [ns]

/// The hexapod of config/platform.yaml, rounded.
stewart_platform hexapod()
{
  const double base[] = {12, 108, 132, 228, 252, 348}, top[] = {48, 72, 168, 192, 288, 312};
  stewart_platform p{};
  p.gravity[2] = -9.80665;
  p.mass = 150.0;
  p.center_of_mass[2] = 0.12;
  p.inertia[0] = 13.0;
  p.inertia[3] = 14.0;
  p.inertia[5] = 22.0;
  for (int n = 0; n < 6; ++n) {
    stewart_leg & leg = p.legs[n];
    leg.base_joint[0] = 0.9 * std::cos(base[n] * kDegree);
    leg.base_joint[1] = 0.9 * std::sin(base[n] * kDegree);
    leg.platform_joint[0] = 0.6 * std::cos(top[n] * kDegree);
    leg.platform_joint[1] = 0.6 * std::sin(top[n] * kDegree);
    leg.zero_length = 0.95;
    leg.cylinder_mass = 12.0;
    leg.cylinder_center_of_mass = 0.35;
    leg.cylinder_inertia = 0.65;
    leg.piston_mass = 6.0;
    leg.piston_center_of_mass = 0.4;
    leg.piston_inertia = 0.32;
    leg.reflected_mass = 80.0;
    leg.viscous_friction = 200.0;
    leg.coulomb_friction = 60.0;
    leg.coulomb_velocity = 1e-3;
    leg.length_max = leg.velocity_max = kInfinite;
    leg.torque_max = leg.speed_max = leg.temperature_rise_max = kInfinite;
    leg.force_max = 5000.0;
    leg.joint_force_max = kInfinite;
    leg.base_joint_angle_max = leg.platform_joint_angle_max = kInfinite;
#define MINIMUM(bit, NAME, field, DEPENDS, quantity) leg.field = -kInfinite;
#define MAXIMUM(bit, NAME, field, DEPENDS, quantity) leg.field = kInfinite;
    STEWART_CRANK_LIMITS(MINIMUM, MAXIMUM, MAXIMUM)
#undef MINIMUM
#undef MAXIMUM
  }
  p.leg_clearance_min = -kInfinite;
  p.characteristic_length = 0.6;
  p.warn_condition = 20.0;
  p.stop_condition = 100.0;
  p.warn_time = 0.5;
  return p;
}

PlatformReference home()
{
  PlatformReference reference{};
  reference.position = {0.0, 0.0, 1.1};
  reference.orientation = {0.0, 0.0, 0.0, 1.0};
  return reference;
}

stewart_pose guess()
{
  return {{0.0, 0.0, 1.1}, {1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0}};
}

/// A motion in all six directions at a time [s], with rotations of constant axis: exact
/// derivatives.
PlatformReference swing(double time)
{
  const double w = 5.0, axis[] = {0.48, -0.6, 0.64};
  const double s = std::sin(w * time), c = std::cos(w * time);
  PlatformReference at = home();
  at.orientation[3] = std::cos(0.1 * s);
  for (std::size_t n = 0; n < 3; ++n) {
    const double size = 0.05 + 0.01 * static_cast<double>(n);
    at.position[n] += size * s;
    at.linear_velocity[n] = size * w * c;
    at.linear_acceleration[n] = -size * w * w * s;
    at.orientation[n] = axis[n] * std::sin(0.1 * s);
    at.angular_velocity[n] = axis[n] * 0.2 * w * c;
    at.angular_acceleration[n] = -axis[n] * 0.2 * w * w * s;
  }
  return at;
}

stewart_motion motion_of(const PlatformReference & reference)
{
  stewart_motion motion;
  CHECK(stewart_rotation(reference.orientation.data(), motion.rotation) == STEWART_OK);
  std::copy_n(reference.position.begin(), 3, motion.position);
  std::copy_n(reference.linear_velocity.begin(), 3, motion.linear_velocity);
  std::copy_n(reference.angular_velocity.begin(), 3, motion.angular_velocity);
  std::copy_n(reference.linear_acceleration.begin(), 3, motion.linear_acceleration);
  std::copy_n(reference.angular_acceleration.begin(), 3, motion.angular_acceleration);
  return motion;
}

bool close(const Six & a, const Six & b, double tolerance)
{
  for (std::size_t n = 0; n < 6; ++n) {
    if (!(std::fabs(a[n] - b[n]) <= tolerance)) {
      std::printf("leg %zu: %.17g is not %.17g\n", n + 1, a[n], b[n]);
      return false;
    }
  }
  return true;
}

/// References of the platform give what stewart_step gives, with effort added and clipped.
void test_platform()
{
  const stewart_platform p = hexapod();
  FeedForward feed_forward(p, guess(), kTimeout);
  const Six wrench = {10.0, -20.0, 30.0, 1.0, 2.0, -3.0}, feedback = {1.0, 2.0, 3.0, 4.0, 5.0, 1e6};
  stewart_state state{};
  feed_forward.start();
  for (int n = 0; n < 1000; ++n) {
    const PlatformReference reference = swing(1e-3 * n);
    Command command;
    CHECK(feed_forward.update(reference, wrench, feedback, n * kCycle, command) == STEWART_OK);
    const stewart_motion motion = motion_of(reference);
    stewart_output expected;
    CHECK(
      stewart_step(&p, &motion, wrench.data(), nullptr, n * kCycle, &state, &expected) ==
      STEWART_OK);
    for (std::size_t leg = 0; leg < 6; ++leg) {
      CHECK(command.positions[leg] == expected.result.lengths[leg] - 0.95);
      CHECK(command.velocities[leg] == expected.result.rates[leg]);
      CHECK(
        command.efforts[leg] == std::min(expected.forces[leg] + feedback[leg], 5000.0));
    }
  }
}

/// The same with drives whose windings heat up.
stewart_platform driven()
{
  stewart_platform p = hexapod();
  for (stewart_leg & leg : p.legs) {
    leg.screw_lead = 0.01;
    leg.gear_ratio = 2.0;
    leg.efficiency = 0.8;
    leg.back_driving_efficiency = 0.7;
    leg.motor_inertia = 1e-4;
    leg.torque_constant = 0.5;
    leg.resistance = 0.4;
    leg.thermal_resistance = 2.0;
    leg.thermal_time_constant = 10.0;
    leg.torque_max = 0.8;
    leg.speed_max = 300.0;
  }
  p.with_motors = 1;
  stewart_complete(&p);
  return p;
}

/// Motors: those of stewart_step; feedback is a force through the drive; held, they stand.
void test_motors()
{
  const stewart_platform p = driven();
  FeedForward feed_forward(p, guess(), kTimeout), with_feedback(p, guess(), kTimeout);
  const Six wrench = {10.0, -20.0, 30.0, 1.0, 2.0, -3.0};
  const Six feedback = {1.0, 2.0, 3.0, 4.0, 5.0, 6.0};
  stewart_state state{};
  stewart_output expected;
  Command command, other;
  int clipped = 0, too_fast = 0;
  for (int n = 0; n < 1000; ++n) {
    const PlatformReference reference = swing(1e-3 * n);
    CHECK(feed_forward.update(reference, wrench, {}, n * kCycle, command) == STEWART_OK);
    CHECK(with_feedback.update(reference, wrench, feedback, n * kCycle, other) == STEWART_OK);
    const stewart_motion motion = motion_of(reference);
    CHECK(
      stewart_step(&p, &motion, wrench.data(), nullptr, n * kCycle, &state, &expected) ==
      STEWART_OK);
    stewart_motors motors;
    CHECK(stewart_motor_torques(&p, &motion, other.efforts.data(), &motors) == STEWART_OK);
    for (std::size_t leg = 0; leg < 6; ++leg) {
      const double speed = expected.motors.speeds[leg], torque = expected.motors.commands[leg];
      CHECK(command.torques[leg] == torque);
      CHECK(other.torques[leg] == motors.commands[leg]);
      CHECK(command.motor_velocities[leg] == std::clamp(speed, -300.0, 300.0));
      CHECK(feed_forward.rises()[leg] == state.rises[leg]);
      clipped += std::fabs(torque) == 0.8;
      too_fast += std::fabs(speed) > 300.0;
    }
  }
  CHECK(clipped > 100 && clipped < 5900);
  CHECK(too_fast > 100);
  CHECK(state.rises[0] > 0.0);

  // Held: the torques at rest of the same pose, and windings that heat up by them.
  PlatformReference resting = swing(0.999), bad = resting;
  resting.linear_velocity = resting.angular_velocity = {};
  resting.linear_acceleration = resting.angular_acceleration = {};
  bad.position[0] = kNaN;
  for (int n = 1000; n < 1100; ++n) {
    CHECK(feed_forward.update(bad, wrench, feedback, n * kCycle, command) == STEWART_NOT_FINITE);
    CHECK(with_feedback.update(resting, wrench, feedback, n * kCycle, other) == STEWART_OK);
    CHECK(close(command.torques, other.torques, 0.0));
    CHECK(close(command.motor_velocities, {}, 0.0));
    for (std::size_t leg = 0; leg < 6; ++leg) {
      CHECK(feed_forward.rises()[leg] == with_feedback.rises()[leg]);
    }
  }
  feed_forward.start();
  CHECK(feed_forward.rises()[0] == 0.0);
}

/// References of the legs, from the motion of the platform, give the efforts of that motion.
void test_legs()
{
  FeedForward of_platform(hexapod(), guess(), kTimeout), of_legs(hexapod(), guess(), kTimeout);
  const double h = 1e-4;
  Six largest{};
  of_platform.start();
  of_legs.start();
  for (int n = 0; n < 1000; ++n) {
    const double time = 2e-3 * n;
    Command at, before, after, computed;
    FeedForward scratch(hexapod(), guess(), kTimeout);
    CHECK(scratch.update(swing(time - h), {}, {}, 0, before) == STEWART_OK);
    CHECK(scratch.update(swing(time + h), {}, {}, 1, after) == STEWART_OK);
    CHECK(of_platform.update(swing(time), {}, {}, n * kCycle, at) == STEWART_OK);
    LegReference legs{at.positions, at.velocities, {}};
    for (std::size_t leg = 0; leg < 6; ++leg) {  // accelerations: by central differences
      legs.accelerations[leg] = (after.velocities[leg] - before.velocities[leg]) / (2.0 * h);
      largest[leg] = std::max(largest[leg], std::fabs(at.efforts[leg]));
    }
    CHECK(of_legs.update(legs, {}, {}, n * kCycle, computed) == STEWART_OK);
    CHECK(close(computed.positions, at.positions, 1e-12));
    CHECK(close(computed.velocities, at.velocities, 1e-11));
    CHECK(close(computed.efforts, at.efforts, 1e-3));
  }
  CHECK(*std::min_element(largest.begin(), largest.end()) > 100.0);
}

/// What is not valid has a code; the next valid reference is answered.
void test_bad_input()
{
  FeedForward feed_forward(hexapod(), guess(), kTimeout);
  const Six none{};
  Command good, command;
  CHECK(!feed_forward.timed_out(1000 * kTimeout));  // nothing is commanded before the start
  feed_forward.start();
  CHECK(feed_forward.update(home(), none, none, 0, good) == STEWART_OK);
  PlatformReference bad = home();
  bad.position[1] = kNaN;
  CHECK(feed_forward.update(bad, none, none, 1, command) == STEWART_NOT_FINITE);
  bad = home();
  bad.linear_acceleration[2] = kInfinite;
  CHECK(feed_forward.update(bad, none, none, 2, command) == STEWART_NOT_FINITE);
  bad = home();
  bad.orientation[3] = 1.002;
  CHECK(feed_forward.update(bad, none, none, 3, command) == STEWART_NOT_UNIT);
  bad.orientation[3] = kNaN;
  CHECK(feed_forward.update(bad, none, none, 4, command) == STEWART_NOT_FINITE);
  bad = home();
  bad.position[0] = 1e200;
  CHECK(feed_forward.update(bad, none, none, 5, command) == STEWART_OUT_OF_RANGE);
  CHECK(
    feed_forward.update(home(), {kNaN, 0.0, 0.0, 0.0, 0.0, 0.0}, none, 6, command) ==
    STEWART_NOT_FINITE);
  CHECK(
    feed_forward.update(home(), none, {0.0, kNaN, 0.0, 0.0, 0.0, 0.0}, 7, command) ==
    STEWART_NOT_FINITE);
  bad = home();
  bad.position[2] = 0.0;  // legs and platform in one plane
  CHECK(feed_forward.update(bad, none, none, 8, command) == STEWART_SINGULAR);
  CHECK(!feed_forward.timed_out(kTimeout));
  CHECK(feed_forward.timed_out(kTimeout + 1));
  CHECK(feed_forward.update(home(), none, none, kTimeout, command) == STEWART_OK);
  CHECK(close(command.efforts, good.efforts, 0.0));
  CHECK(!feed_forward.timed_out(2 * kTimeout));
}

/// Legs' references without a pose, and NaN, keep the pose from which the next one is found.
void test_bad_legs()
{
  FeedForward of_platform(hexapod(), guess(), kTimeout), feed_forward(hexapod(), guess(), kTimeout);
  const Six none{};
  Command at, command;
  of_platform.start();
  feed_forward.start();
  CHECK(of_platform.update(home(), none, none, 0, at) == STEWART_OK);
  LegReference bad{};
  bad.positions.fill(kNaN);  // not yet given
  CHECK(feed_forward.update(bad, none, none, 1, command) == STEWART_NOT_FINITE);
  bad.positions = at.positions;
  bad.positions[0] += 5.0;
  CHECK(feed_forward.update(bad, none, none, 2, command) != STEWART_OK);
  bad.positions = at.positions;
  bad.velocities[3] = kNaN;
  CHECK(feed_forward.update(bad, none, none, 3, command) == STEWART_NOT_FINITE);
  bad.velocities[3] = 0.0;
  bad.accelerations[3] = kInfinite;
  CHECK(feed_forward.update(bad, none, none, 4, command) == STEWART_NOT_FINITE);
  bad.accelerations[3] = 0.0;
  CHECK(feed_forward.update(bad, none, none, 5, command) == STEWART_OK);
  CHECK(close(command.efforts, at.efforts, 1e-8));
}

/// Other parameters while it runs.
void test_parameters()
{
  stewart_platform p = hexapod();
  FeedForward feed_forward(p, guess(), kTimeout);
  Command light, heavy, command;
  feed_forward.start();
  CHECK(feed_forward.update(home(), {}, {}, 0, light) == STEWART_OK);
  CHECK(!feed_forward.warning());
  p.mass += 100.0;
  feed_forward.change(p);
  CHECK(feed_forward.update(home(), {}, {}, 1, heavy) == STEWART_OK);
  CHECK(heavy.efforts[0] > light.efforts[0] + 100.0);
  p.warn_condition = p.stop_condition = 1.0;
  p.suppress_near_singularity = 1;
  feed_forward.change(p);
  CHECK(feed_forward.update(home(), {}, {}, 2, command) == STEWART_SUPPRESSED);
  CHECK(feed_forward.warning());
  CHECK(close(command.positions, heavy.positions, 0.0));
}

/// A way in which a reference cannot be followed, with the code that it has.
struct Rejection
{
  const char * rule;
  int code, leg;
  void (* spoil)(stewart_platform & p, PlatformReference & reference, Six & wrench);
};

const Rejection kRejections[] = {
  {"a reference is NaN or infinite", STEWART_NOT_FINITE, 0,
    [](auto &, auto & r, auto &) {r.linear_velocity[1] = kNaN;}},
  {"a reference is NaN or infinite", STEWART_NOT_FINITE, 0,
    [](auto &, auto &, auto & wrench) {wrench[4] = kInfinite;}},
  {"the orientation is not a unit quaternion", STEWART_NOT_UNIT, 0,
    [](auto &, auto & r, auto &) {r.orientation[3] = 2.0;}},
  {"a reference is out of range", STEWART_OUT_OF_RANGE, 0,
    [](auto &, auto & r, auto &) {r.position[0] = 1e200;}},
  {"det(J) is zero", STEWART_SINGULAR, 0,
    [](auto &, auto & r, auto &) {r = home(); r.position[2] = 0.0;}},
  {"suppressed by singularity.action or limits.action", STEWART_SUPPRESSED, 0,
    [](auto & p, auto &, auto &) {
      p.warn_condition = p.stop_condition = 1.0;
      p.suppress_near_singularity = 1;
    }},
  {"suppressed by singularity.action or limits.action", STEWART_SUPPRESSED, 0,
    [](auto & p, auto &, auto &) {
      p.legs[1].velocity_max = 1e-3;
      p.suppress_at_limits = 1;
    }},
  {"shorter than limits.length_min", STEWART_SUPPRESSED, 3,
    [](auto & p, auto & r, auto &) {p.legs[2].length_min = 1.1; r.position[2] -= 0.3;}},
  {"longer than limits.length_max", STEWART_SUPPRESSED, 4,
    [](auto & p, auto & r, auto &) {p.legs[3].length_max = 1.4; r.position[2] += 0.3;}},
  {"farther from the last command than limits.velocity_max allows in setpoint.timeout",
    STEWART_SUPPRESSED, 6,
    [](auto & p, auto & r, auto &) {p.legs[5].velocity_max = 2.0; r.position[2] += 0.3;}},
};

/// What cannot be followed holds the platform where it is, with the force that it needs there:
/// no position without its effort, no effort of a motion that has ended.
void test_hold()
{
  const Six wrench = {10.0, -20.0, 30.0, 1.0, 2.0, -3.0};
  const Six feedback = {1.0, 2.0, 3.0, 4.0, 5.0, 6.0};
  const PlatformReference moving = swing(0.02);
  PlatformReference resting = moving;
  resting.linear_velocity = resting.angular_velocity = {};
  resting.linear_acceleration = resting.angular_acceleration = {};
  FeedForward at_rest(hexapod(), guess(), kTimeout);
  Command followed, expected, command;
  CHECK(at_rest.update(resting, wrench, feedback, 0, expected) == STEWART_OK);
  for (const Rejection & rejection : kRejections) {
    stewart_platform p = hexapod();
    FeedForward feed_forward(p, guess(), kTimeout);
    PlatformReference bad = moving;
    Six load = wrench;
    rejection.spoil(p, bad, load);

    // Not before a first reference that can be followed; a step is one from a command.
    command.efforts.fill(7.0);
    feed_forward.change(p);
    const int code = feed_forward.update(bad, load, feedback, 0, command);
    CHECK(code == rejection.code || (code == STEWART_OK && rejection.leg == 6));
    CHECK(code == STEWART_OK || (!feed_forward.started() && command.efforts[0] == 7.0));

    feed_forward.start();
    feed_forward.change(hexapod());
    CHECK(feed_forward.update(moving, wrench, feedback, 0, followed) == STEWART_OK);
    CHECK(feed_forward.rejection() == nullptr && feed_forward.rejected_leg() == 0);
    feed_forward.change(p);
    for (int n = 1; n <= 100; ++n) {
      command = followed;
      CHECK(feed_forward.update(bad, load, feedback, n * kCycle, command) == rejection.code);
      CHECK(std::string(feed_forward.rejection()) == rejection.rule);
      CHECK(feed_forward.rejected_leg() == rejection.leg);
      CHECK(close(command.positions, followed.positions, 0.0));
      CHECK(close(command.velocities, {}, 0.0));
      CHECK(close(command.efforts, expected.efforts, 0.0));
      CHECK(std::fabs(command.efforts[0] - followed.efforts[0]) > 100.0);
    }
    CHECK(!feed_forward.timed_out(kTimeout));
    CHECK(feed_forward.timed_out(kTimeout + 1));
    feed_forward.change(hexapod());
    CHECK(feed_forward.update(moving, wrench, feedback, kTimeout, command) == STEWART_OK);
    CHECK(close(command.efforts, followed.efforts, 0.0));
    CHECK(feed_forward.rejection() == nullptr);
  }
}

/// The effort that holds the platform: feedback that is a number goes on; at most force_max.
void test_effort_of_hold()
{
  stewart_platform p = hexapod();
  FeedForward feed_forward(p, guess(), kTimeout);
  Command rest, command;
  CHECK(feed_forward.update(home(), {}, {}, 0, rest) == STEWART_OK);
  const Six feedback = {1.0, kNaN, -1e6, 4.0, 1e6, kInfinite};
  CHECK(feed_forward.update(home(), {}, feedback, 1, command) == STEWART_NOT_FINITE);
  CHECK(command.efforts[0] == rest.efforts[0] + 1.0);
  CHECK(command.efforts[1] == rest.efforts[1]);
  CHECK(command.efforts[2] == -5000.0);
  CHECK(command.efforts[3] == rest.efforts[3] + 4.0);
  CHECK(command.efforts[4] == 5000.0);
  CHECK(command.efforts[5] == rest.efforts[5]);
  p.mass += 100.0;  // a payload while the platform is held
  feed_forward.change(p);
  CHECK(feed_forward.update(home(), {}, feedback, 2, command) == STEWART_NOT_FINITE);
  CHECK(command.efforts[1] > rest.efforts[1] + 100.0);
}

/// Nothing that legs can do is rejected: parked at a limit, references more rarely than cycles, a
/// gap shorter than the timeout.
void test_no_false_hold()
{
  stewart_platform p = hexapod();
  FeedForward free(p, guess(), kTimeout);
  Command at, command;
  CHECK(free.update(home(), {}, {}, 0, at) == STEWART_OK);
  for (std::size_t n = 0; n < 6; ++n) {  // as the example: position 0 is at length_min
    p.legs[n].zero_length = p.legs[n].length_min = at.positions[n] + 0.95;
    p.legs[n].length_max = 1.6;
    p.legs[n].velocity_max = 0.5;
  }
  p.suppress_at_limits = 1;
  FeedForward of_legs(p, guess(), kTimeout);
  CHECK(of_legs.update(LegReference{}, {}, {}, 0, command) == STEWART_OK);

  FeedForward feed_forward(p, guess(), kTimeout);
  PlatformReference moving = home();
  moving.linear_velocity[2] = 0.4;
  for (int n = 0; n < 500; ++n) {  // at 100 Hz, with cycles of 1 ms
    moving.position[2] = 1.1 + 0.4e-3 * (n - n % 10);
    CHECK(feed_forward.update(moving, {}, {}, n * kCycle, command) == STEWART_OK);
  }
  moving.position[2] += 0.4 * 0.09;
  CHECK(feed_forward.update(moving, {}, {}, 590 * kCycle, command) == STEWART_OK);
  p.suppress_at_limits = 0;
  feed_forward.change(p);
  moving.linear_velocity[2] = 50.0;
  CHECK(feed_forward.update(moving, {}, {}, 591 * kCycle, command) == STEWART_OK);
  CHECK(close(command.velocities, {0.5, 0.5, 0.5, 0.5, 0.5, 0.5}, 0.0));
}

/// After a gap positions go to the reference with at most velocity_max in each cycle; without one
/// a step is followed at once.
void test_after_a_gap()
{
  stewart_platform p = hexapod();
  for (stewart_leg & leg : p.legs) {
    leg.velocity_max = 0.5;
  }
  PlatformReference higher = home(), bad = home();
  higher.position[2] += 0.03;
  bad.position[0] = kNaN;
  const auto far_apart = [](const Six & a, const Six & b) {
      double most = 0.0;
      for (std::size_t n = 0; n < 6; ++n) {
        most = std::max(most, std::fabs(a[n] - b[n]));
      }
      return most;
    };
  for (const int gap : {0, 1, 2, 3}) {  // none, of cycles, of references, a hold
    FeedForward feed_forward(p, guess(), kTimeout, kCycle);
    Command first, last, command, target;
    std::int64_t now = 0;
    CHECK(feed_forward.update(higher, {}, {}, now, target) == STEWART_OK);
    feed_forward.start();
    CHECK(feed_forward.update(home(), {}, {}, now += kCycle, first) == STEWART_OK);
    last = first;
    if (gap == 1) {
      now += 50 * kCycle;
    } else if (gap == 2) {
      feed_forward.catch_up();
    } else if (gap == 3) {
      CHECK(feed_forward.update(bad, {}, {}, now += kCycle, command) == STEWART_NOT_FINITE);
    }
    int cycles = 0;
    do {
      CHECK(feed_forward.update(higher, {}, {}, now += kCycle, command) == STEWART_OK);
      CHECK(gap == 0 || far_apart(command.positions, last.positions) <= 0.5e-3 * (1.0 + 1e-9));
      CHECK(close(command.efforts, target.efforts, 0.0));
      last = command;
      ++cycles;
    } while (far_apart(command.positions, target.positions) > 0.0 && cycles < 1000);
    const double way = far_apart(first.positions, target.positions);
    CHECK(cycles == (gap == 0 ? 1 : static_cast<int>(std::ceil(way / 0.5e-3))));
    // Reached: steps are followed at once again.
    CHECK(feed_forward.update(home(), {}, {}, now += kCycle, command) == STEWART_OK);
    CHECK(close(command.positions, first.positions, 0.0));
  }
}

/// Legs: the same hold; the next pose is found from the one that is held.
void test_hold_of_legs()
{
  stewart_platform p = hexapod();
  for (stewart_leg & leg : p.legs) {
    leg.length_max = 1.5;
    leg.velocity_max = 1.0;
  }
  FeedForward feed_forward(p, guess(), kTimeout), of_platform(p, guess(), kTimeout);
  Command at, command;
  CHECK(of_platform.update(home(), {}, {}, 0, at) == STEWART_OK);
  LegReference legs{at.positions, {}, {}};
  CHECK(feed_forward.update(legs, {}, {}, 0, command) == STEWART_OK);
  for (const double stroke : {0.05, 0.16, 0.883, -0.4, 1e3, kNaN}) {
    for (std::size_t n = 0; n < 6; ++n) {
      legs.positions[n] = at.positions[n] + stroke;
      legs.velocities[n] = 0.3;
    }
    const bool followed = feed_forward.update(legs, {}, {}, 1, command) == STEWART_OK;
    CHECK(followed == (stroke == 0.05));
    CHECK(close(command.velocities, followed ? legs.velocities : Six{}, 1e-12));
    for (std::size_t n = 0; n < 6; ++n) {
      CHECK(std::fabs(command.positions[n] - at.positions[n] - 0.05) < 1e-12);
      CHECK(command.efforts[n] > 100.0);
    }
  }
  legs = {at.positions, {}, {}};
  CHECK(feed_forward.update(legs, {}, {}, 2, command) == STEWART_OK);
  CHECK(close(command.efforts, at.efforts, 1e-8));
}

Governor governor_of(const stewart_platform & p)
{
  home_legs legs;
  home_poses home;
  Governor governor;
  const double head[3] = {0.0, 0.0, 0.0};
  put_home_legs(&p, &legs);
  find_home(&legs, 0, &home);
  CHECK(home.known != 0.0);
  put_governor(&p, &home.poses[0], head, &governor.within, &governor.limits);
  return governor;
}

/// References that jump, and that are no numbers: legs keep their limits, rates have no step.
void test_governor()
{
  stewart_platform p = hexapod();
  for (stewart_leg & leg : p.legs) {
    leg.length_min = 0.95;
    leg.length_max = 1.65;
    leg.velocity_max = 0.5;
  }
  stewart_complete(&p);
  FeedForward feed_forward(p, {}, 10000 * kCycle, kCycle, governor_of(p));
  PlatformReference far = home();
  far.position[2] = 2.0;
  Command command{}, before{};
  CHECK(feed_forward.update(far, {}, {}, 0, command) == STEWART_SUPPRESSED);
  CHECK(std::string(feed_forward.rejection()) == "limits.length_max");
  CHECK(!feed_forward.started());
  double fastest = 0.0;
  for (std::int64_t n = 1; n < 6000; ++n) {
    PlatformReference at = home();
    at.position[0] = n % 2000 < 1000 ? 0.0 : 0.2;
    at.position[2] += n > 3000 ? 0.8 : 0.0;
    const bool valid = n < 4000 || n > 4500;
    at.orientation[0] = valid ? 0.0 : kNaN;
    const int code = feed_forward.update(at, {}, {}, n * kCycle, command);
    CHECK(code == (valid ? STEWART_OK : STEWART_NOT_FINITE));
    for (std::size_t leg = 0; leg < 6; ++leg) {
      const double length = command.positions[leg] + p.legs[leg].zero_length;
      CHECK(0.95 < length && length < 1.65 && std::fabs(command.velocities[leg]) < 0.5);
      CHECK(std::fabs(command.efforts[leg]) < 5000.0);
      CHECK(n == 1 || std::fabs(command.velocities[leg] - before.velocities[leg]) < 0.02);
      CHECK(n == 1 || std::fabs(command.positions[leg] - before.positions[leg]) < 0.5e-3);
      fastest = std::max(fastest, std::fabs(command.velocities[leg]));
    }
    before = command;
  }
  CHECK(fastest > 0.1);
}

/// A base that is tilted, by its IMU: the forces of gravity in its axes; without readings a hold.
void test_imu()
{
  const stewart_platform p = hexapod();
  imu_mounting imu{{0.1, 0.2, 0.3}, {1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0}, 100.0, kCycle};
  FeedForward feed_forward(p, {}, kTimeout, 0, std::nullopt, imu);
  const Six silent = {kNaN, kNaN, kNaN, kNaN, kNaN, kNaN};
  const Six tilted = {0.0, 0.0, 0.0, 1.0, 0.0, 9.7};
  Command command{};
  CHECK(feed_forward.update(home(), {}, {}, 0, command, silent) == STEWART_NOT_FINITE);
  CHECK(!feed_forward.started());
  CHECK(feed_forward.update(home(), {}, {}, 1, command, tilted) == STEWART_OK);
  const stewart_motion motion = motion_of(home());
  const stewart_base base = {{-1.0, 0.0, -9.7}, {}, {}, {}};
  stewart_result result;
  CHECK(stewart_inverse_dynamics(&p, &motion, nullptr, &base, &result) == STEWART_OK);
  for (std::size_t n = 0; n < 6; ++n) {
    CHECK(command.efforts[n] == result.forces[n]);
  }
  const Six followed = command.efforts;
  CHECK(feed_forward.update(home(), {}, {}, 3 * kCycle, command, silent) == STEWART_NOT_FINITE);
  CHECK(feed_forward.rejection() && close(command.efforts, followed, 1e-9));
}

/// The same platform on cranks, like config/crank_platform.yaml: level motor axes, zero at home.
stewart_platform rig()
{
  const double base[] = {60, 0, -60, -120, 180, 120}, top[] = {40, 20, -80, -100, 160, 140};
  const double heading[] = {150, -90, 30, 150, -90, 30};
  stewart_platform p = hexapod();
  for (int n = 0; n < 6; ++n) {
    stewart_leg & leg = p.legs[n];
    const double before[] = {leg.viscous_friction, leg.coulomb_velocity};
    leg = stewart_leg{};
    leg.base_joint[0] = 0.4064 * std::cos(base[n] * kDegree);
    leg.base_joint[1] = 0.4064 * std::sin(base[n] * kDegree);
    leg.platform_joint[0] = 0.40005 * std::cos(top[n] * kDegree);
    leg.platform_joint[1] = 0.40005 * std::sin(top[n] * kDegree);
    leg.crank_direction[0] = leg.crank_axis[1] = std::cos(heading[n] * kDegree);
    leg.crank_direction[1] = leg.crank_axis[0] = std::sin(heading[n] * kDegree);
    leg.crank_axis[1] *= -1.0;
    leg.crank_length = 0.18415;
    leg.rod_length = 0.7239;
    leg.crank_mass = 2.4;
    leg.crank_center_of_mass[0] = 0.06;
    leg.rod_mass = 1.3;
    leg.rod_center_of_mass = leg.rod_inertia = kNaN;
    leg.reflected_mass = 0.3;
    leg.viscous_friction = 0.01 * before[0];
    leg.coulomb_velocity = before[1];
    leg.gear_ratio = leg.efficiency = 1.0;
    leg.back_driving_efficiency = leg.servo_angle_at_min = leg.servo_angle_at_max = kNaN;
    leg.torque_constant = leg.resistance = leg.thermal_resistance = kNaN;
    leg.thermal_time_constant = kNaN;
    std::fill_n(leg.base_joint_axis, 3, kNaN);
    std::fill_n(leg.platform_joint_axis, 3, kNaN);
    std::fill_n(leg.base_universal_axis, 3, kNaN);
    std::fill_n(leg.platform_universal_axis, 3, kNaN);
    leg.branch = 1.0;
#define MINIMUM(bit, NAME, field, DEPENDS, quantity) leg.field = -kInfinite;
#define MAXIMUM(bit, NAME, field, DEPENDS, quantity) leg.field = kInfinite;
    STEWART_LIMITS(MINIMUM, MAXIMUM, MAXIMUM)
#undef MINIMUM
#undef MAXIMUM
    leg.length_min = 0.0;
    leg.lever_min = 0.1;
    leg.angle_min = -0.9;
    leg.angle_max = 0.85;
    leg.crank_speed_max = 2.0;
    leg.crank_torque_max = 80.0;
  }
  stewart_complete(&p);
  int where;
  CHECK(stewart_check(&p, &where) == STEWART_VALID);
  return p;
}

/// Cranks: angles, speeds and torques at the shafts, clipped; angles as references; each rule.
void test_cranks()
{
  const stewart_platform p = rig();
  const stewart_pose at_home{{0.0, 0.0, 0.6481337615847757}, {1, 0, 0, 0, 1, 0, 0, 0, 1}};
  FeedForward feed_forward(p, at_home, kTimeout), of_legs(p, at_home, kTimeout);
  const Six feedback{50.0, -50.0, 0.0, 1.0, 0.0, 0.0};
  bool clipped = false;
  for (int n = 0; n < 200; ++n) {
    PlatformReference reference = swing(n * 1e-3);
    reference.position[2] += 0.6481337615847757 - 1.1;
    Command command{}, of_angles{};
    CHECK(feed_forward.update(reference, {}, feedback, n * kCycle, command) == STEWART_OK);
    const stewart_motion motion = motion_of(reference);
    stewart_result result;
    CHECK(stewart_inverse_dynamics(&p, &motion, nullptr, nullptr, &result) == STEWART_OK);
    LegReference angles;
    for (std::size_t leg = 0; leg < 6; ++leg) {
      CHECK(command.positions[leg] == result.angles[leg]);
      CHECK(command.velocities[leg] == std::clamp(result.speeds[leg], -2.0, 2.0));
      const double torque = result.torques[leg] + feedback[leg];
      CHECK(command.efforts[leg] == std::clamp(torque, -80.0, 80.0));
      clipped = clipped || command.efforts[leg] != torque;
      angles.positions[leg] = result.angles[leg];
      angles.velocities[leg] = result.speeds[leg];
      angles.accelerations[leg] = 0.0;
    }
    CHECK(of_legs.update(angles, {}, {}, n * kCycle, of_angles) == STEWART_OK);
    CHECK(close(of_angles.positions, command.positions, 1e-10));
    CHECK(close(of_angles.velocities, command.velocities, 1e-9));
  }
  CHECK(clipped);
  const std::pair<double, std::string> rejected[] = {
    {0.05, "farther from the last command than limits.speed_max allows in setpoint.timeout"},
    {0.17, "above limits.angle_max"}, {-0.12, "below limits.angle_min"},
    {1.5, "a leg does not reach the platform"}};
  for (const auto & [z, rule] : rejected) {
    PlatformReference reference = home();
    Command command{}, held{};
    reference.position[2] = 0.6481337615847757;
    feed_forward.start();
    CHECK(feed_forward.update(reference, {}, {}, 1000 * kCycle, command) == STEWART_OK);
    reference.position[2] += z;
    const int code = feed_forward.update(reference, {}, {}, 1001 * kCycle, held);
    CHECK(code == (z > 1.0 ? STEWART_UNREACHABLE : STEWART_SUPPRESSED));
    CHECK(feed_forward.rejection() == rule);
    CHECK(held.positions == command.positions && close(held.efforts, command.efforts, 1e-9));
    CHECK(held.velocities == Six{});
  }
}

/// Rz(gamma) Ry(beta) Rx(alpha): the columns of a turn about each axis.
void test_rotation()
{
  const double quarter = 90.0 * kDegree;
  const auto of_x = rotation_of_euler(quarter, 0.0, 0.0);
  const auto of_z = rotation_of_euler(0.0, 0.0, quarter);
  const auto both = rotation_of_euler(quarter, 0.0, quarter);
  CHECK(std::fabs(of_x[7] - 1.0) < 1e-15 && std::fabs(of_x[5] + 1.0) < 1e-15);
  CHECK(std::fabs(of_z[3] - 1.0) < 1e-15 && std::fabs(of_z[1] + 1.0) < 1e-15);
  CHECK(std::fabs(both[3] - 1.0) < 1e-15 && std::fabs(both[7] - 1.0) < 1e-15);
}

}  // namespace

int main()
{
  test_platform();
  test_motors();
  test_legs();
  test_bad_input();
  test_bad_legs();
  test_parameters();
  test_hold();
  test_effort_of_hold();
  test_no_false_hold();
  test_after_a_gap();
  test_hold_of_legs();
  test_governor();
  test_imu();
  test_cranks();
  test_rotation();
  std::printf("all checks passed\n");
  return 0;
}
