// SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
// SPDX-License-Identifier: Apache-2.0

/*
 * The feed-forward of the controller, without ROS: references in, commands of the legs out. No
 * function allocates memory or throws.
 *
 * A reference is followed or rejected as a whole. Rejected are one without forces (a return code
 * other than STEWART_OK), one with a leg outside limits.length_min and limits.length_max, and one
 * with a leg farther from the last command than limits.velocity_max allows in the timeout (of
 * cranks limits.angle_min, angle_max and speed_max). Then
 * the platform is held: positions are those of the last reference that was followed, velocities
 * zero, and efforts what keeps the platform at rest there, under the wrench of that reference;
 * motors stand, with the torques of those efforts. So position and effort always belong together,
 * and no effort is kept from a motion that has ended. The caller ends it after the timeout.
 * Windings go on: they heat up by the efforts that hold the platform.
 *
 * After a gap (cycles that did not come, references that did not, a hold) the reference has gone
 * on: positions go from the last command to it with at most limits.velocity_max in each cycle.
 *
 * With a governor (core/governor.c) the motion begins at rest at the first reference, and follows
 * the references as far as all limits let it, so that a stop within the limits always exists. That
 * stop takes the place of the hold where a reference is rejected, or none comes: velocities end
 * without a step.
 */

#ifndef STEWART_DYNAMICS_CONTROLLER__FEED_FORWARD_HPP_
#define STEWART_DYNAMICS_CONTROLLER__FEED_FORWARD_HPP_

#include <array>
#include <cstdint>
#include <optional>

#include "control.h"
#include "stewart_dynamics.h"

namespace stewart_dynamics_controller
{

using Six = std::array<double, 6>;

/// Where the platform shall be, and how it moves; base axes.
struct PlatformReference
{
  std::array<double, 3> position;     // of its origin, base frame [m]
  std::array<double, 4> orientation;  // unit quaternion x y z w
  std::array<double, 3> linear_velocity, angular_velocity;
  std::array<double, 3> linear_acceleration, angular_acceleration;
};

/// Where the legs shall be: positions are length - zero_length [m]; of cranks their angles [rad].
struct LegReference
{
  Six positions, velocities, accelerations;
};

/// Commands of a cycle, which follow the reference or hold the platform.
struct Command
{
  // Of telescopic legs, and of cranks:
  Six positions;   // length - zero_length [m]; angles [rad]
  Six velocities;  // clipped to velocity_max [m/s]; to limits.speed_max [rad/s]
  Six efforts;     // clipped to force_max [N]; to limits.torque_max [N m]
  // Of the motors, zero without drive.*; + extends:
  Six torques;           // give the efforts; clipped to torque_max and torque_speed [N m]
  Six motor_velocities;  // clipped to speed_max, and to velocity_max times the ratio [rad/s]
};

/// What a governor keeps: a hexapod whose limits have margins, and the margins themselves.
struct Governor
{
  stewart_platform within;
  governor_limits limits;
};

/// Return the parameter of a limit that governed_limit has returned; nullptr for 0.
const char * name_of_limit(std::int64_t limit);

/// Return the row-by-row rotation Rz(gamma) Ry(beta) Rx(alpha).
std::array<double, 9> rotation_of_euler(double alpha, double beta, double gamma);

class FeedForward
{
public:
  /// hexapod: checked parameters; guess: the pose near which the legs' first reference is;
  /// timeout, and period of the cycles: [ns]; period 0: positions are not bounded after a gap;
  /// governor: of this hexapod, for references of the platform; imu: measures the base.
  FeedForward(
    const stewart_platform & hexapod, const stewart_pose & guess, std::int64_t timeout,
    std::int64_t period = 0, const std::optional<Governor> & governor = std::nullopt,
    const std::optional<imu_mounting> & imu = std::nullopt);

  /// Forget earlier references: the singularity warning, the last pose, the heat of windings.
  void start();

  /// Use other parameters from now on; warning and temperatures of the windings are kept.
  void change(
    const stewart_platform & hexapod, const std::optional<Governor> & governor = std::nullopt);

  /// Compute the command of a reference at a time [ns], which rises from call to call.
  /// feedback: efforts that are added, before the limit force_max.
  /// reading: of the IMU, angular velocity and specific force; not used without one.
  /// repeated: no reference has come since the last cycle; a governed motion waits for the next.
  /// Return a code of stewart_dynamics.h: STEWART_OK if the reference is followed. If not, the
  /// command holds the platform; before the first one that was followed there is no command.
  int update(
    const PlatformReference & reference, const Six & wrench, const Six & feedback,
    std::int64_t now, Command & command, const Six & reading = {}, bool repeated = false);
  int update(
    const LegReference & reference, const Six & wrench, const Six & feedback,
    std::int64_t now, Command & command, const Six & reading = {});

  /// Return whether the time from one event to the next is a gap [ns].
  bool is_gap(std::int64_t since, std::int64_t now) const
  {
    return period_ > 0 && now - since > kGap * period_;
  }

  /// Bound the steps of the positions until the reference is reached: it comes after a gap.
  void catch_up() {catching_up_ = period_ > 0;}

  /// Return whether a reference was followed since start: there is a command.
  bool started() const {return started_;}

  /// Return why the last reference was rejected: the rule, nullptr if it was followed; and the
  /// leg that breaks it, 1 to 6, 0 if the rule is not one of a leg.
  const char * rejection() const {return rejection_;}
  int rejected_leg() const {return rejected_leg_;}

  /// Return whether the timeout has passed since a time, or since the last reference followed.
  bool timed_out(std::int64_t since, std::int64_t now) const {return now - since > timeout_;}
  bool timed_out(std::int64_t now) const {return started_ && timed_out(followed_at_, now);}

  /// Return the result of the last cycle with valid input.
  const stewart_result & result() const {return output_.result;}
  /// Return the rises of the temperatures of the windings by what was commanded so far [K].
  const double * rises() const {return state_.rises;}
  bool warning() const {return state_.warning != STEWART_NO_WARNING;}
  /// Return the last motion of the governor.
  const stewart_motion & governed() const {return governed_;}
  /// Return the last known motion of the base; nullptr: it is fixed, or was never known.
  const stewart_base * base() const {return base_ ? &*base_ : nullptr;}

private:
  static constexpr std::int64_t kGap = 10;  // cycles

  int motion_of(const PlatformReference & reference, stewart_motion & motion) const;
  int motion_of(const LegReference & reference, stewart_motion & motion) const;
  template<typename Reference>
  int answer(
    const Reference & reference, const Six & wrench, const Six & feedback, std::int64_t now,
    Command & command, const Six & reading, bool repeated);
  bool measure(const Six & reading, std::int64_t now);
  int govern(int demanded, bool repeated, std::int64_t now, stewart_motion & motion);
  int follow(
    const stewart_motion & motion, const Six & wrench, const Six & feedback, std::int64_t now,
    Command & command);
  int check_positions();
  int put_loads(
    const stewart_motion & motion, const drive_values & drives, const Six & feedback,
    Command & command) const;
  void hold(const Six & feedback, std::int64_t now, Command & command);
  int reject(int code, const char * rule, int leg = 0);

  stewart_platform hexapod_, unsuppressed_;  // the same for a platform that is held
  std::optional<Governor> governor_;
  governed_stream stream_{};
  stewart_motion governed_{};
  std::int64_t governed_for_ = 0;  // time of the stream, without gaps [ns]
  std::int64_t governed_at_ = 0, demanded_at_ = 0;
  std::optional<imu_mounting> imu_;
  imu_stream readings_{};
  std::optional<stewart_base> base_;
  stewart_pose guess_;
  std::int64_t timeout_, period_, updated_at_ = 0, followed_at_ = 0;
  bool started_ = false, catching_up_ = false;
  stewart_motion held_{};  // the last reference that was followed, at rest
  Six held_positions_{}, held_wrench_{};  // positions of the drives in the last command
  const char * rejection_ = nullptr;
  int rejected_leg_ = 0;
  stewart_state state_{};
  stewart_output output_{};
  drive_values drives_{};  // of that output
};

}  // namespace stewart_dynamics_controller

#endif  // STEWART_DYNAMICS_CONTROLLER__FEED_FORWARD_HPP_
