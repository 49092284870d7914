/* SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * Motors: torques, limits, heat; and friction. Equations: mechanics/drives/motors.py.
 */

void friction_many(
  const double * viscous, const double * coulomb, const double * coulomb_velocity, int64_t count,
  const double * rates, double * forces) {
  for (int64_t n = 0; n < count; n++) {
    for (int i = 0; i < 6; i++) {
      stewart_leg leg = {.viscous_friction = viscous[i], .coulomb_friction = coulomb[i],
                         .coulomb_velocity = coulomb_velocity[i]};
      forces[6 * n + i] = move_actuator(&leg, rates[6 * n + i], 0.0);
    }
  }
}

/* Return a temperature rise [K] after a time [s] of constant copper heat [W]. */
static double warmed(
  double rise, double heat, double time, double resistance, double time_constant)
{return rise + (rise - heat * resistance) * expm1(-time / time_constant);}

void warm_many(
  int64_t count, const double * times, const double * heat, const double * resistance,
  const double * time_constant, double * rises) {
  for (int64_t n = 1; n < count; n++) {
    for (int i = 0; i < 6; i++) {
      rises[6 * n + i] = warmed(
        rises[6 * n - 6 + i], heat[6 * n - 6 + i], times[n] - times[n - 1], resistance[i],
        time_constant[i]);
    }
  }
}

/* Return the torque of a torque-speed curve of n points at a speed; infinite without points. */
static double curve_torque(int64_t n, const double * curve, double speed) {
  if (n == 0) {return HUGE_VAL;}
  double torque = curve[1], at = fabs(speed);
  for (int64_t k = 1; k < n; k++) {
    const double * a = &curve[2 * k - 2], * b = &curve[2 * k];
    if (at > a[0]) {torque = a[1] + least((at - a[0]) / (b[0] - a[0]), 1.0) * (b[1] - a[1]);}
  }
  return at > curve[2 * n - 2] * (1.0 + LIMIT_TOLERANCE) ? 0.0 : torque;
}

/* Return a torque limited to +- available; nan stays nan. */
static double clipped(double torque, double available)
{return torque > available ? available : torque < -available ? -available : torque;}

/* Return c for a rate of the drive and the power that its load takes. */
static double factor_of(const leg_drive * drive, double power, double rate)
{return torque_factor(power, slip(rate / drive->slow), drive->driving, drive->driven);}

static double screw_torque(const leg_drive * drive, double through, double rate)
{return through / drive->ratio * factor_of(drive, through * rate, rate);}

void without_losses_many(
  const leg_drives * drives, int64_t count, const double * forces, const double * rates,
  const double * accelerations, double * loads) {
  for (int64_t k = 0; k < 6 * count; k++) {
    const leg_drive * drive = &drives->legs[k % 6];
    double inertial = drive->mass * accelerations[k], through = forces[k] - inertial;
    loads[k] = through / factor_of(drive, through * rates[k], rates[k]) + inertial;
  }
}

static void put_motors(
  const stewart_platform * platform, const leg_drives * drives, int64_t n, const double * curve,
  const stewart_motion * motion, const double demanded[6], const double forces[6],
  motor_row * row) {
  for (int i = 0; i < 6; i++) {
    const leg_drive * drive = &drives->legs[i];
    drive_motion of = move_drive(&platform->legs[i], motion);
    double ratio = drive->ratio, mass = drive->mass, speed = ratio * of.rate;
    double acceleration = ratio * of.acceleration, own = mass / ratio / ratio * acceleration;
    double through = demanded[i] - mass * of.acceleration;
    double torque = own + screw_torque(drive, through, of.rate), breakaway = torque;
    if (fabs(of.rate) < drive->slow) {
      double other = own + through / ratio * (1.0 + drive->driven);
      breakaway = own + through / ratio * (1.0 + drive->driving);
      breakaway = fabs(other) > fabs(breakaway) ? other : breakaway;
    }
    double available = least(drives->torque_max[i], curve_torque(n, curve, speed));
    double command = own + screw_torque(drive, forces[i] - mass * of.acceleration, of.rate);
    double current = torque / drive->torque_constant;
    double heat = drive->resistance * current * current;
    row->angles[i] = ratio * (of.position - drive->zero);
    row->speeds[i] = speed;
    row->commands[i] = clipped(command, available);
    row->breakaway_torques[i] = breakaway;
    row->torques[i] = torque;
    row->accelerations[i] = acceleration;
    row->currents[i] = current;
    row->power[i] = torque * speed + heat;
    row->copper_heat[i] = heat;
    row->available_torques[i] = available;
  }
}

void motors_many(
  const stewart_platform * platform, const leg_drives * drives, int64_t n, const double * curve,
  int64_t count, const stewart_motion * motions, const stewart_result * results,
  const double * forces, motor_row * rows) {
  for (int64_t k = 0; k < count; k++) {
    put_motors(
      platform, drives, n, curve, &motions[k], results[k].forces, &forces[6 * k], &rows[k]);
  }
}

/* Check the motors of a setpoint, and update the windings unless it is a jump. */
static void check_motors(
  const leg_drives * drives, double elapsed, int jumped, double windings[12],
  checked_motors * row) {
  const motor_row * of = &row->drives;
  int sound = 1, exceeding = 0, running = 0;
  for (int i = 0; i < 6; i++) {
    double torque = of->breakaway_torques[i], heat = of->copper_heat[i];
    double rise = warmed(windings[i], windings[6 + i], elapsed, drives->thermal_resistance[i],
                         drives->time_constant[i]);
    row->rises[i] = rise;
    if (!jumped) {
      windings[i] = rise;
      windings[6 + i] = isfinite(heat) ? heat : windings[6 + i];
    }
    sound = sound && isfinite(of->angles[i]) && isfinite(of->speeds[i]) && !isinf(torque);
    running = running || fabs(of->speeds[i]) > drives->fastest[i] || rise > drives->hottest[i];
    exceeding = exceeding ||
      fabs(torque) > of->available_torques[i] * (1.0 + LIMIT_TOLERANCE);
  }
  row->sound = sound;  /* others are not published, and exceed nothing */
  row->exceeding = sound && (exceeding || running), row->running = sound && running;
}
