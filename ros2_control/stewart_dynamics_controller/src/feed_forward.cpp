// SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
// SPDX-License-Identifier: Apache-2.0

#include "stewart_dynamics_controller/feed_forward.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace stewart_dynamics_controller
{

namespace
{

bool finite(const Six & numbers)
{
  return std::all_of(numbers.begin(), numbers.end(), [](double each) {return std::isfinite(each);});
}

constexpr char kTooFar[] =
  "farther from the last command than limits.velocity_max allows in setpoint.timeout";

const char * text_of(int code)
{
  switch (code) {
    case STEWART_NOT_FINITE: return "a reference is NaN or infinite";
    case STEWART_NOT_UNIT: return "the orientation is not a unit quaternion";
    case STEWART_SINGULAR: return "det(J) is zero";
    case STEWART_SUPPRESSED: return "suppressed by singularity.action or limits.action";
    case STEWART_NO_POSE: return "the legs' positions belong to no pose near the last one";
    default: return "a reference is out of range";
  }
}

}  // namespace

std::array<double, 9> rotation_of_euler(double alpha, double beta, double gamma)
{
  const double ca = std::cos(alpha), sa = std::sin(alpha), cb = std::cos(beta);
  const double sb = std::sin(beta), cg = std::cos(gamma), sg = std::sin(gamma);
  return {cg * cb, cg * sb * sa - sg * ca, cg * sb * ca + sg * sa,
    sg * cb, sg * sb * sa + cg * ca, sg * sb * ca - cg * sa, -sb, cb * sa, cb * ca};
}

FeedForward::FeedForward(
  const stewart_platform & hexapod, const stewart_pose & guess, std::int64_t timeout,
  std::int64_t period)
: hexapod_(hexapod), guess_(guess), timeout_(timeout), period_(period)
{
  start();
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
}

int FeedForward::update(
  const PlatformReference & reference, const Six & wrench, const Six & feedback,
  std::int64_t now, Command & command)
{
  return answer(reference, wrench, feedback, now, command);
}

int FeedForward::update(
  const LegReference & reference, const Six & wrench, const Six & feedback,
  std::int64_t now, Command & command)
{
  return answer(reference, wrench, feedback, now, command);
}

template<typename Reference>
int FeedForward::answer(
  const Reference & reference, const Six & wrench, const Six & feedback, std::int64_t now,
  Command & command)
{
  if (rejection_ || is_gap(updated_at_, now)) {
    catch_up();
  }
  updated_at_ = now;
  stewart_motion motion;
  int code = motion_of(reference, motion);
  code = code == STEWART_OK ? follow(motion, wrench, feedback, now, command) :
    reject(code, text_of(code));
  if (code != STEWART_OK) {
    hold(feedback, command);
  }
  return code;
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
  Six lengths;
  for (std::size_t n = 0; n < 6; ++n) {
    lengths[n] = reference.positions[n] + hexapod_.legs[n].zero_length;
  }
  stewart_pose pose;
  std::copy_n(held_.position, 3, pose.position);
  std::copy_n(held_.rotation, 9, pose.rotation);
  const int code = stewart_forward_kinematics(&hexapod_, lengths.data(), &pose);
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
  // Cycles repeat references that come more rarely: steps are judged by check_lengths instead.
  state_.followed = 0;
  int code = stewart_step(&hexapod_, &motion, wrench.data(), nullptr, now, &state_, &output_);
  if (code != STEWART_OK) {
    return reject(code, text_of(code));
  }
  code = check_lengths();
  if (code != STEWART_OK) {
    return code;
  }
  bool reached = true;
  for (std::size_t n = 0; n < 6; ++n) {
    const stewart_leg & leg = hexapod_.legs[n];
    const double rate = output_.result.rates[n];
    double length = output_.result.lengths[n];
    if (started_ && catching_up_) {
      const double step = leg.velocity_max * (1e-9 * static_cast<double>(period_));
      length = std::clamp(length, held_lengths_[n] - step, held_lengths_[n] + step);
      reached = reached && length == output_.result.lengths[n];
    }
    command.positions[n] = length - leg.zero_length;
    command.velocities[n] = std::clamp(rate, -leg.velocity_max, leg.velocity_max);
    command.efforts[n] =
      std::clamp(output_.forces[n] + feedback[n], -leg.force_max, leg.force_max);
    held_lengths_[n] = length;
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
int FeedForward::check_lengths()
{
  for (int n = 0; n < 6; ++n) {
    const double length = output_.result.lengths[n];
    const double farthest = hexapod_.legs[n].velocity_max * (1e-9 * static_cast<double>(timeout_));
    if (output_.exceeded[n] & STEWART_LENGTH_MIN) {
      return reject(STEWART_SUPPRESSED, "shorter than limits.length_min", n + 1);
    }
    if (output_.exceeded[n] & STEWART_LENGTH_MAX) {
      return reject(STEWART_SUPPRESSED, "longer than limits.length_max", n + 1);
    }
    const double step = length - held_lengths_[static_cast<std::size_t>(n)];
    if (started_ && std::fabs(step) > farthest) {
      return reject(STEWART_SUPPRESSED, kTooFar, n + 1);
    }
  }
  return STEWART_OK;
}

/// Feedback is added where it is a number: a loop around the efforts goes on.
void FeedForward::hold(const Six & feedback, Command & command) const
{
  stewart_result at_rest;
  if (!started_ || stewart_inverse_dynamics(
      &hexapod_, &held_, held_wrench_.data(), nullptr, &at_rest) != STEWART_OK)
  {
    return;
  }
  for (std::size_t n = 0; n < 6; ++n) {
    const stewart_leg & leg = hexapod_.legs[n];
    const double added = std::isfinite(feedback[n]) ? feedback[n] : 0.0;
    command.positions[n] = held_lengths_[n] - leg.zero_length;
    command.velocities[n] = 0.0;
    command.efforts[n] = std::clamp(at_rest.forces[n] + added, -leg.force_max, leg.force_max);
  }
}

}  // namespace stewart_dynamics_controller
