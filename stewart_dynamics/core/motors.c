/* SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * Friction, motors and heat of many samples. Equations: mechanics/drives/motors.py.
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

void without_losses_many(
  const stewart_platform * platform, int64_t count, const double * forces, const double * rates,
  const double * accelerations, double * loads) {
  for (int64_t k = 0; k < 6 * count; k++) {
    const stewart_leg * leg = &platform->legs[k % 6];
    double inertial = leg->reflected_mass * accelerations[k], through = forces[k] - inertial;
    loads[k] = through / factor_of(leg, through * rates[k], rates[k]) + inertial;
  }
}

void motors_many(
  const stewart_platform * platform, int64_t count, const stewart_motion * motions,
  const double * demanded, const double * published, stewart_motors * rows) {
  for (int64_t k = 0; k < count; k++) {
    put_motors(platform, &motions[k], &demanded[6 * k], &published[6 * k], &rows[k]);
  }
}
