/* SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * The inverse dynamics of many samples, LANES at a time: stewart_dynamics.c with numbers that are
 * vectors, one lane for each sample. A lane has the bits of the sample alone: the same operations
 * in the same order, none of them fused. The build compiles this file for several kinds of
 * processors, with a SUFFIX and the number of LANES of each; library.c selects one.
 */

#include "lanes.h"

#include <math.h>

#define STEWART_LANES

typedef double real __attribute__((vector_size(8 * LANES)));
typedef int64_t choice __attribute__((vector_size(8 * LANES)));

static real number(double a) {
  real r = {0.0};
  for (int k = 0; k < LANES; k++) {r[k] = a;}
  return r;
}

static real choose(choice first, real a, real b)
{return (real)((first & (choice)a) | (~first & (choice)b));}

static int any(choice each) {
  int64_t found = 0;
  for (int k = 0; k < LANES; k++) {found |= each[k];}
  return found != 0;
}

static real root(real a) {
  real r = a;
  for (int k = 0; k < LANES; k++) {r[k] = sqrt(a[k]);}
  return r;
}

static choice sign_bit(void) {return (choice)number(-0.0);}
static real absolute(real a) {return (real)((choice)a & ~sign_bit());}

static real signed_as(real a, real sign)
{return (real)(((choice)a & ~sign_bit()) | ((choice)sign & sign_bit()));}

static real angle(real y, real x) {
  real r = y;
  for (int k = 0; k < LANES; k++) {r[k] = atan2(y[k], x[k]);}
  return r;
}

static void exchange(choice wanted, real * a, real * b, int step) {
  for (int n = 0; n < 6 * step; n += step) {
    real old = a[n];
    a[n] = choose(wanted, b[n], old), b[n] = choose(wanted, old, b[n]);
  }
}

/* The structures of stewart_dynamics.h, with the samples side by side. */
typedef struct {
  real position[3], rotation[9];
  real linear_velocity[3], angular_velocity[3], linear_acceleration[3], angular_acceleration[3];
} motions;

typedef struct {
  real gravity[3], linear_acceleration[3], angular_velocity[3], angular_acceleration[3];
} bases;

typedef struct {
  real lengths[6], rates[6], forces[6];
  real determinant, determinant_rate, condition_number, unit_load_forces[6], joint_forces[6];
  real angles[6], speeds[6], torques[6], levers[6];
} results;

#define stewart_motion motions
#define stewart_base bases
#define stewart_result results
#include "stewart_dynamics.c"
#undef stewart_motion
#undef stewart_base
#undef stewart_result

#if LANES == 2

double condition_of_pair(double a[6][6], double inverse[6][6]) {
  real both[6][6], trace;
  for (int i = 0; i < 6; i++) {
    for (int j = 0; j < 6; j++) {both[i][j][0] = a[i][j], both[i][j][1] = inverse[i][j];}
  }
  tridiagonal t = squared(both, &trace);
  real x = number(1.0 + 1e-14);
  for (int n = 0; n < LAGUERRE_STEPS; n++) {
    real nearer = laguerre_step(x, &t);
    if (!any(nearer < x)) {break;}
    x = nearer;
  }
  return sqrt(trace[0]) * sqrt(trace[1]) * (sqrt(x[0]) * sqrt(x[1]));
}

#endif

#define JOINED(a, b) a ## b
#define NAMED(a, b) JOINED(a, b)

/* Write rows, from the first one on, to lanes; lanes behind the last row have its numbers. */
static void spread(real * to, int width, lane_rows rows, int64_t first, int64_t count) {
  for (int k = 0; k < LANES; k++) {
    const double * row =
      rows.first + rows.stride * (first + k < count ? first + k : count - 1);
    for (int n = 0; n < width; n++) {to[n][k] = row[n];}
  }
}

/* Set the motion of the bases that are still to zero. */
static void hold_still(choice moving, moving_base * base) {
  real * numbers = (real *)base;
  for (size_t n = 0; n < sizeof *base / sizeof *numbers; n++) {
    numbers[n] = choose(moving, numbers[n], number(0.0));
  }
}

void NAMED(solve_lanes_, SUFFIX)(
  const stewart_platform * platform, int64_t count, lane_rows of_motions, lane_rows of_wrenches,
  lane_rows of_bases, int conditioned, double * result_rows, int64_t result_stride,
  int64_t width) {
  enum {MOTION = sizeof(motions) / sizeof(real), BASE = sizeof(bases) / sizeof(real)};
  results result;
  for (size_t n = 0; n < sizeof result / sizeof(real); n++) {((real *)&result)[n] = number(0.0);}
  for (int64_t first = 0; first < count; first += LANES) {
    motions motion;
    bases base;
    real wrench[6];
    spread((real *)&motion, MOTION, of_motions, first, count);
    spread(wrench, 6, of_wrenches, first, count);
    spread((real *)&base, BASE, of_bases, first, count);
    load external = {read3(wrench), read3(wrench + 3)};
    choice moving = base.gravity[0] == base.gravity[0];  /* else nan: the base is still */
    moving_base of_base;
    if (any(moving)) {
      of_base = base_of(platform, &base);
      load carried = carry(platform, &motion, &of_base);
      real change[6], loaded[6];
      put3(change, carried.force), put3(change + 3, carried.moment);
      for (int n = 0; n < 6; n++) {loaded[n] = choose(moving, wrench[n] - change[n], wrench[n]);}
      external.force = read3(loaded), external.moment = read3(loaded + 3);
      hold_still(moving, &of_base);
    }
    solve(platform, &motion, external, any(moving) ? &of_base : NULL, conditioned, &result);
    const real * numbers = (const real *)&result;
    for (int k = 0; k < LANES && first + k < count; k++) {
      double * row = result_rows + result_stride * (first + k);
      for (int64_t n = 0; n < width; n++) {row[n] = numbers[n][k];}
    }
  }
}
