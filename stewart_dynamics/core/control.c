/* SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * The functions of stewart_dynamics.h and control.h, compiled as one piece without the rest of the
 * library: one sample at a time, for any processor, with the same bits.
 */

#include "stewart_dynamics.c"

#include "control.h"

/* Write the results of motions without load on a base at rest, without condition numbers. */
static void solve_unloaded(
  const stewart_platform * platform, int64_t count, const stewart_motion * motions,
  stewart_result * results) {
  const load none = {{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
  for (int64_t n = 0; n < count; n++) {
    clear_result(&results[n]);
    solve(platform, &motions[n], none, NULL, 0, &results[n]);
  }
}

#include "drives.c"
#include "home.c"
#include "imu.c"
#include "governor.c"
