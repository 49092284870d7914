/* SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * The functions of library.h and control.h, compiled with stewart_dynamics.c as one piece: they share its
 * functions for one leg, one platform, one matrix. Each file has a part of them.
 */

#include "lanes.h"

#define CONDITION_OF condition_of_pair  /* a tenth faster */

#include "stewart_dynamics.c"

#include "library.h"

#include <string.h>

#define NUMBERS(structure) ((int64_t)(sizeof(structure) / sizeof(double)))

/* A function into which all that it calls is inlined: twice as fast. */
#define FLAT __attribute__((flatten))

#define ONCE  /* a function that is not inlined on a GPU */

int64_t processor_kind(void) {
#if defined(__x86_64__) || defined(_M_X64)
  if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq")) {return 2;}
  if (__builtin_cpu_supports("avx2")) {return 1;}
#endif
  return 0;
}

static lanes_function * solve_lanes(void) {
#if defined(__x86_64__) || defined(_M_X64)
  int64_t kind = processor_kind();
  return kind == 2 ? solve_lanes_avx512 : kind == 1 ? solve_lanes_avx2 : solve_lanes_baseline;
#else
  return solve_lanes_baseline;
#endif
}

void solve_many(
  const stewart_platform * platform, int64_t count, const stewart_motion * motions,
  int64_t n_wrenches, const double * wrenches, int64_t n_bases, const stewart_base * bases,
  int64_t conditioned, int64_t width, double * results) {
  lane_rows of_motions = {(const double *)motions, NUMBERS(stewart_motion)};
  lane_rows of_wrenches = {wrenches, n_wrenches == 1 ? 0 : 6};
  lane_rows of_bases = {(const double *)bases, n_bases == 1 ? 0 : NUMBERS(stewart_base)};
  solve_lanes()(platform, count, of_motions, of_wrenches, of_bases, conditioned != 0, results,
                width, width);
}

/* Write the results of motions without load on a base at rest, without condition numbers. */
static void solve_unloaded(
  const stewart_platform * platform, int64_t count, const stewart_motion * motions,
  stewart_result * results) {
  static const double no_wrench[6] = {0.0};
  static const stewart_base still = {{NAN, NAN, NAN}, {0.0}, {0.0}, {0.0}};
  solve_many(platform, count, motions, 1, no_wrench, 1, &still, 0,
             NUMBERS(stewart_result), (double *)results);
}

#include "legs.c"
#include "kinematics.c"
#include "dynamics.c"
#include "motors.c"
#include "setpoints.c"
#include "messages.c"
#include "plant.c"
#include "drives.c"
#include "home.c"
#include "imu.c"
#include "joining.c"
#include "governor.c"
#include "cueing.c"
#include "records.c"
#include "hexapods.c"
