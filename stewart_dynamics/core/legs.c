/* SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * What the library asks of a kind of legs beside stewart_dynamics.c.
 */

/* ---- motion in axes that do not turn -------------------------------------------------------- */

/* Return W' x r + W x (W x r): the acceleration of a point fixed to a turning body. */
static vector carried_along(vector spin, vector spin_rate, vector arm)
{return add(cross(spin_rate, arm), cross(spin, cross(spin, arm)));}

/* A platform and a base in motion: velocities less that of the base's origin, accelerations as
   they are felt, less gravity. */
typedef struct { vector position, velocity, omega, acceleration, alpha, felt, spin, spin_rate; }
  absolute_motion;

static absolute_motion absolute_of(const stewart_motion * motion, const stewart_base * base) {
  absolute_motion of;
  vector velocity = read3(motion->linear_velocity), omega = read3(motion->angular_velocity);
  of.position = read3(motion->position);
  of.spin = read3(base->angular_velocity), of.spin_rate = read3(base->angular_acceleration);
  of.felt = subtract(read3(base->linear_acceleration), read3(base->gravity));
  of.velocity = add(velocity, cross(of.spin, of.position));
  of.acceleration = add(
    add(read3(motion->linear_acceleration), carried_along(of.spin, of.spin_rate, of.position)),
    scale(2.0, cross(of.spin, velocity)));
  of.acceleration = add(of.acceleration, of.felt);
  of.omega = add(omega, of.spin);
  of.alpha = add(add(read3(motion->angular_acceleration), of.spin_rate), cross(of.spin, omega));
  return of;
}

/* ---- legs ----------------------------------------------------------------------------------- */

enum { MOST_COLUMNS = 12 };

/* What a leg adds to the mass of the platform: a point mass at the platform joint, a mass that
   moves with the line of force, one with the drive, and a coupling [kg], with a direction, of the
   drive and the platform joint. A row of J_q [1, 1/m], moments by the characteristic length, and
   the effort of the drive without a push. */
typedef struct { double point, line, drive, row[6], effort; vector coupling; } leg_mass;

/* A leg in the regressor: forces at its platform joint, and efforts of its drive, for a unit of
   each of its masses and moments; lever * push of the line with this row is an effort as well. */
typedef struct {
  double row[6], lever, rate, acceleration, effort[MOST_COLUMNS];
  vector arm, of_mass[MOST_COLUMNS];
} leg_columns;

/* Magnitude of the lever by its largest, negative on the other side of a dead centre. Its rate is
   of_drive q' + of_joint . x', with the rate of the drive and the velocity of the platform joint. */
typedef struct { double ratio, of_drive; vector of_joint; } lever_slope;

/* A leg as it is measured, how fast it changes [1/s], and its lever. */
typedef struct { double position, rate, pace; lever_slope lever; } measured_leg;

/* The square of the lever's ratio and its rate: smooth at a dead centre, and negative where a leg
   does not reach. */
typedef struct { double value, rate; } lever_square;

/* Of a kind of legs, for the library:
   position: that of the drive, nan where it does not reach. drive_row: the row of J_q, with moments
   times per_size. measured: in a motion. square: of the lever. anchor_rate: of the end of
   the line that is not at the platform. mass, columns: see the structures.
   momentum_rate: of the leg's momentum, and of its moment of momentum about the base's origin. */
#define STEWART_LIBRARY
#include "telescopic.h"
#include "crank.h"

static double position_of(
  const stewart_platform * platform, int i, const double position[3], const double r[9]) {
  switch (platform->leg_kind) {
    default: STEWART_LEG_KINDS(RETURN, position, (&platform->legs[i], position, r))
  }
}

static void put_drive_row(
  const stewart_platform * platform, int i, const double position[3], const double r[9],
  double per_size, double row[6]) {
  switch (platform->leg_kind) {
    default: STEWART_LEG_KINDS(CALL, drive_row, (&platform->legs[i], position, r, per_size, row))
  }
}

static measured_leg measured_of(
  const stewart_platform * platform, int i, const stewart_motion * motion) {
  switch (platform->leg_kind) {
    default: STEWART_LEG_KINDS(RETURN, measured, (&platform->legs[i], motion))
  }
}

static lever_square lever_square_of(
  const stewart_platform * platform, int i, const stewart_motion * motion) {
  switch (platform->leg_kind) {
    default: STEWART_LEG_KINDS(RETURN, square, (&platform->legs[i], motion))
  }
}

static vector anchor_rate_of(
  const stewart_platform * platform, int i, const stewart_motion * motion) {
  switch (platform->leg_kind) {
    default: STEWART_LEG_KINDS(RETURN, anchor_rate, (&platform->legs[i], motion))
  }
}

static void put_masses(
  const stewart_platform * platform, const stewart_motion * motion, const leg_motion legs[6],
  leg_mass masses[6]) {
  switch (platform->leg_kind) {
    default: STEWART_LEG_KINDS(CALL_EACH, mass, (platform, i, motion, &legs[i], &masses[i]))
  }
}

static load leg_momentum_rate(
  const stewart_platform * platform, int i, const stewart_motion * motion,
  const absolute_motion * of) {
  switch (platform->leg_kind) {
    default: STEWART_LEG_KINDS(RETURN, momentum_rate, (&platform->legs[i], motion, of))
  }
}

/* Write the columns of a leg; returns how many masses and moments it has. */
static int put_columns(
  const stewart_platform * platform, int i, const stewart_motion * motion,
  const absolute_motion * of, leg_columns * columns) {
  switch (platform->leg_kind) {
    default: STEWART_LEG_KINDS(RETURN, columns, (platform, i, motion, of, columns))
  }
}
