// SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
// SPDX-License-Identifier: Apache-2.0

#include "stewart_dynamics_controller/feed_forward.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>

namespace stewart_dynamics_controller
{

namespace
{

bool finite(const Six & numbers)
{
  return std::all_of(numbers.begin(), numbers.end(), [](double each) {return std::isfinite(each);});
}

/// Copy what stewart_step keeps of the windings; the warning and what belongs to it stay.
void keep_windings(const stewart_state & from, stewart_state & to)
{
  to.followed = from.followed;
  to.stamp = from.stamp;
  std::copy_n(from.rises, 6, to.rises);
  std::copy_n(from.copper_heat, 6, to.copper_heat);
}

constexpr char kUnknownBase[] = "the motion of the base is not known";

/// Why a command of a drive's position is rejected, by the kind of legs.
struct PositionRules
{
  const char * below, * above, * too_far;
};

constexpr PositionRules kLengths{
  "shorter than limits.length_min", "longer than limits.length_max",
  "farther from the last command than limits.velocity_max allows in setpoint.timeout"};
constexpr PositionRules kAngles{
  "below limits.angle_min", "above limits.angle_max",
  "farther from the last command than limits.speed_max allows in setpoint.timeout"};

const char * text_of(int code)
{
  switch (code) {
    case STEWART_NOT_FINITE: return "a reference is NaN or infinite";
    case STEWART_NOT_UNIT: return "the orientation is not a unit quaternion";
    case STEWART_SINGULAR: return "det(J) is zero";
    case STEWART_SUPPRESSED: return "suppressed by singularity.action or limits.action";
    case STEWART_UNREACHABLE: return "a leg does not reach the platform";
    case STEWART_NO_POSE: return "the legs' positions belong to no pose near the last one";
    default: return "a reference is out of range";
  }
}

/// Return a demand that no motion can follow: a governed one stops.
coordinates no_demand()
{
  coordinates none{};
  std::fill_n(none.value, 6, std::numeric_limits<double>::quiet_NaN());
  return none;
}

/// Return a stream that has no demand yet.
governed_stream no_stream()
{
  governed_stream stream{};
  stream.time = std::numeric_limits<double>::quiet_NaN();
  return stream;
}

}  // namespace

const char * name_of_limit(std::int64_t limit)
{
  if (limit == GOVERNED_SINGULARITY + 1) {
    return "singularity.stop_condition";
  }
  const std::int64_t bit = limit > 0 ? std::int64_t{1} << (limit - 1) : 0;
  if (bit == STEWART_CRANK_SPEED_MAX || bit == STEWART_CRANK_TORQUE_MAX) {  // drive.* has them, too
    return bit == STEWART_CRANK_SPEED_MAX ? "limits.speed_max" : "limits.torque_max";
  }
  switch (bit) {
#define SECTION_POSE "limits."
#define SECTION_TWIST "limits."
#define SECTION_LOAD "limits."
#define SECTION_MOTOR "drive."
#define LIMIT(bit, NAME, field, DEPENDS, quantity) case bit: return SECTION_ ## DEPENDS #field;
    STEWART_LIMITS(LIMIT, LIMIT, LIMIT)
#undef LIMIT
    case STEWART_LEG_CLEARANCE_MIN: return "limits.leg_clearance_min";
    case STEWART_TORQUE_SPEED: return "drive.torque_speed";
    default: return nullptr;
  }
}

std::array<double, 9> rotation_of_euler(double alpha, double beta, double gamma)
{
  const double ca = std::cos(alpha), sa = std::sin(alpha), cb = std::cos(beta);
  const double sb = std::sin(beta), cg = std::cos(gamma), sg = std::sin(gamma);
  return {cg * cb, cg * sb * sa - sg * ca, cg * sb * ca + sg * sa,
    sg * cb, sg * sb * sa + cg * ca, sg * sb * ca - cg * sa, -sb, cb * sa, cb * ca};
}

FeedForward::FeedForward(
  const stewart_platform & hexapod, const stewart_pose & guess, std::int64_t timeout,
  std::int64_t period, const std::optional<Governor> & governor,
  const std::optional<imu_mounting> & imu)
: imu_(imu), guess_(guess), timeout_(timeout), period_(period)
{
  change(hexapod, governor);
  start();
}

void FeedForward::change(
  const stewart_platform & hexapod, const std::optional<Governor> & governor)
{
  governor_ = governor;
  hexapod_ = unsuppressed_ = hexapod;
  unsuppressed_.suppress_near_singularity = unsuppressed_.suppress_at_limits = 0;
}

void FeedForward::start()
{
  std::copy_n(guess_.position, 3, held_.position);
  std::copy_n(guess_.rotation, 9, held_.rotation);
  started_ = catching_up_ = false;
  rejection_ = nullptr;
  rejected_leg_ = 0;
  state_ = stewart_state{};
  output_ = stewart_output{};
  stream_ = no_stream();
  readings_ = imu_stream{};
  base_.reset();
}

int FeedForward::update(
  const PlatformReference & reference, const Six & wrench, const Six & feedback,
  std::int64_t now, Command & command, const Six & reading, bool repeated)
{
  return answer(reference, wrench, feedback, now, command, reading, repeated);
}

int FeedForward::update(
  const LegReference & reference, const Six & wrench, const Six & feedback,
  std::int64_t now, Command & command, const Six & reading)
{
  return answer(reference, wrench, feedback, now, command, reading, false);
}

template<typename Reference>
int FeedForward::answer(
  const Reference & reference, const Six & wrench, const Six & feedback, std::int64_t now,
  Command & command, const Six & reading, bool repeated)
{
  if (rejection_ || is_gap(updated_at_, now)) {
    catch_up();
  }
  // Steps are judged by check_positions: cycles repeat references that come more rarely.
  std::fill_n(state_.lengths, 6, std::numeric_limits<double>::quiet_NaN());
  const stewart_state before = state_;
  const std::int64_t followed_at = followed_at_;
  stewart_motion motion;
  const bool measured = measure(reading, now);
  const int demanded = measured ? motion_of(reference, motion) : STEWART_NOT_FINITE;
  const char * const rule = measured ? text_of(demanded) : kUnknownBase;
  int code = demanded == STEWART_OK ? STEWART_OK : reject(demanded, rule);
  if (governor_) {
    code = govern(demanded, repeated, now, motion);
  }
  updated_at_ = now;
  if (code == STEWART_OK) {
    code = follow(motion, wrench, feedback, now, command);
  }
  if (code != STEWART_OK) {
    keep_windings(before, state_);
    hold(feedback, now, command);
  } else if (demanded != STEWART_OK) {  // a governed motion, which stops
    followed_at_ = followed_at;
    code = reject(demanded, rule);
  }
  if (!started_) {  // the motion begins at the first reference that is followed
    stream_ = no_stream();
  }
  return code;
}

/// Read the IMU; return whether the motion of the base is known.
bool FeedForward::measure(const Six & reading, std::int64_t now)
{
  stewart_base base;
  if (!imu_) {
    return true;
  }
  const bool known = base_of_imu(&*imu_, now, reading.data(), &readings_, &base) != 0;
  if (known) {
    base_ = base;
  }
  return known;
}

/// Write the governed motion in place of the one that is demanded; code: of the demand.
int FeedForward::govern(int demanded, bool repeated, std::int64_t now, stewart_motion & motion)
{
  const Governor & governor = *governor_;
  const bool first = std::isnan(stream_.time);
  if (first && demanded != STEWART_OK) {
    return demanded;
  }
  coordinates demand = no_demand();
  if (first) {
    stewart_motion at_rest{};
    std::copy_n(motion.position, 3, at_rest.position);
    std::copy_n(motion.rotation, 9, at_rest.rotation);
    coordinates_of(&governor.limits, 1, &at_rest, &stream_.governor.now);
    const std::int64_t limit =
      governed_limit(&governor.within, &governor.limits, &stream_.governor.now);
    if (limit != 0) {
      return reject(STEWART_SUPPRESSED, name_of_limit(limit));
    }
    governed_for_ = 0;
  } else if (repeated && demanded == STEWART_OK && !is_gap(demanded_at_, now)) {
    motion = governed_;
    return STEWART_OK;
  } else {
    // Commands stand while cycles do not come, and so does the motion: it goes on from there.
    governed_for_ += std::min(now - governed_at_, kGap * (period_ > 0 ? period_ : timeout_));
  }
  if (demanded == STEWART_OK && (first || !repeated)) {
    demanded_at_ = now;
    coordinates_of(&governor.limits, 1, &motion, &demand);
  }
  governed_at_ = now;
  const double time = 1e-9 * static_cast<double>(governed_for_);
  govern_many(&governor.within, &governor.limits, 1, &time, &demand, &stream_, &governed_);
  motion = governed_;
  return STEWART_OK;
}

int FeedForward::reject(int code, const char * rule, int leg)
{
  rejection_ = rule;
  rejected_leg_ = leg;
  return code;
}

int FeedForward::motion_of(const PlatformReference & reference, stewart_motion & motion) const
{
  std::copy_n(reference.position.begin(), 3, motion.position);
  std::copy_n(reference.linear_velocity.begin(), 3, motion.linear_velocity);
  std::copy_n(reference.angular_velocity.begin(), 3, motion.angular_velocity);
  std::copy_n(reference.linear_acceleration.begin(), 3, motion.linear_acceleration);
  std::copy_n(reference.angular_acceleration.begin(), 3, motion.angular_acceleration);
  return stewart_rotation(reference.orientation.data(), motion.rotation);
}

/// The pose by forward kinematics from the last one.
int FeedForward::motion_of(const LegReference & reference, stewart_motion & motion) const
{
  Six positions;  // of the drives: lengths or angles
  for (std::size_t n = 0; n < 6; ++n) {
    positions[n] = reference.positions[n] + hexapod_.legs[n].zero_length;
  }
  stewart_pose pose;
  std::copy_n(held_.position, 3, pose.position);
  std::copy_n(held_.rotation, 9, pose.rotation);
  const int code = stewart_forward_kinematics(&hexapod_, positions.data(), &pose);
  if (code != STEWART_OK) {
    return code;
  }
  std::copy_n(pose.position, 3, motion.position);
  std::copy_n(pose.rotation, 9, motion.rotation);
  return stewart_motion_of_legs(
    &hexapod_, reference.velocities.data(), reference.accelerations.data(), &motion);
}

int FeedForward::follow(
  const stewart_motion & motion, const Six & wrench, const Six & feedback, std::int64_t now,
  Command & command)
{
  if (!finite(feedback)) {
    return reject(STEWART_NOT_FINITE, text_of(STEWART_NOT_FINITE));
  }
  int code = stewart_step(&hexapod_, &motion, wrench.data(), base(), now, &state_, &output_);
  if (code != STEWART_OK) {
    return reject(code, text_of(code));
  }
  put_drives(&hexapod_, &output_, &drives_);
  code = check_positions();
  if (code != STEWART_OK) {
    return code;
  }
  code = put_loads(motion, drives_, feedback, command);
  if (code != STEWART_OK) {
    return reject(code, text_of(code));
  }
  bool reached = true;
  for (std::size_t n = 0; n < 6; ++n) {
    const double most = drives_.rate_max[n];
    double position = drives_.positions[n];
    if (started_ && catching_up_) {
      const double step = most * (1e-9 * static_cast<double>(period_));
      position = std::clamp(position, held_positions_[n] - step, held_positions_[n] + step);
      reached = reached && position == drives_.positions[n];
    }
    command.positions[n] = position - hexapod_.legs[n].zero_length;
    command.velocities[n] = std::clamp(drives_.rates[n], -most, most);
    held_positions_[n] = position;
  }
  catching_up_ = catching_up_ && !reached;
  held_ = stewart_motion{};
  std::copy_n(motion.position, 3, held_.position);
  std::copy_n(motion.rotation, 9, held_.rotation);
  held_wrench_ = wrench;
  followed_at_ = now;
  started_ = true;
  rejection_ = nullptr;
  rejected_leg_ = 0;
  return STEWART_OK;
}

/// Whatever limits.action says: no drive may get a position that its leg cannot have, or a step
/// that it cannot make. References may come as rarely as the timeout allows.
int FeedForward::check_positions()
{
  const PositionRules & rules = hexapod_.leg_kind == STEWART_TELESCOPIC ? kLengths : kAngles;
  for (int n = 0; n < 6; ++n) {
    const double farthest = drives_.rate_max[n] * (1e-9 * static_cast<double>(timeout_));
    if (drives_.below[n] != 0.0) {
      return reject(STEWART_SUPPRESSED, rules.below, n + 1);
    }
    if (drives_.above[n] != 0.0) {
      return reject(STEWART_SUPPRESSED, rules.above, n + 1);
    }
    const double step = drives_.positions[n] - held_positions_[static_cast<std::size_t>(n)];
    if (started_ && std::fabs(step) > farthest) {
      return reject(STEWART_SUPPRESSED, rules.too_far, n + 1);
    }
  }
  return STEWART_OK;
}

/// Write efforts and motors of a motion; a torque is that of the clipped effort, with the inertia,
/// the losses and the available torque of its drive. Written with STEWART_OK alone.
int FeedForward::put_loads(
  const stewart_motion & motion, const drive_values & drives, const Six & feedback,
  Command & command) const
{
  Six efforts;
  for (std::size_t n = 0; n < 6; ++n) {
    const double most = drives.effort_max[n];
    efforts[n] = std::clamp(drives.efforts[n] + feedback[n], -most, most);
  }
  stewart_motors motors{};
  const int code = hexapod_.with_motors ?
    stewart_motor_torques(&hexapod_, &motion, efforts.data(), &motors) : STEWART_OK;
  if (code != STEWART_OK) {
    return code;
  }
  command.efforts = efforts;
  for (std::size_t n = 0; n < 6; ++n) {
    const stewart_leg & leg = hexapod_.legs[n];
    const double fastest =
      hexapod_.with_motors ? std::min(leg.speed_max, drives.rate_max[n] * leg.motor_ratio) : 0.0;
    command.torques[n] = motors.commands[n];
    command.motor_velocities[n] = std::clamp(motors.speeds[n], -fastest, fastest);
  }
  return STEWART_OK;
}

/// Feedback is added where it is a number: a loop around the efforts goes on.
void FeedForward::hold(const Six & feedback, std::int64_t now, Command & command)
{
  stewart_state state = state_;
  stewart_output at_rest;
  drive_values drives;
  if (!started_ || stewart_step(
      &unsuppressed_, &held_, held_wrench_.data(), base(), now, &state, &at_rest) != STEWART_OK)
  {
    return;
  }
  keep_windings(state, state_);
  Six added;
  for (std::size_t n = 0; n < 6; ++n) {
    added[n] = std::isfinite(feedback[n]) ? feedback[n] : 0.0;
    command.positions[n] = held_positions_[n] - hexapod_.legs[n].zero_length;
    command.velocities[n] = 0.0;
  }
  put_drives(&unsuppressed_, &at_rest, &drives);
  put_loads(held_, drives, added, command);
}

}  // namespace stewart_dynamics_controller
