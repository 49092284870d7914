/* SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * The time of each call of the exported C source, for exported_source.py.
 */

#define _POSIX_C_SOURCE 199309L

#include "hexapod.h"

#include <stddef.h>
#include <string.h>
#include <time.h>

static double now(void)
{
  struct timespec time;
  clock_gettime(CLOCK_MONOTONIC, &time);
  return 1e9 * (double)time.tv_sec + (double)time.tv_nsec;
}

/* Write the time of an empty measurement [ns], of which there are as many as calls. */
void nothing(size_t count, double * times)
{
  for (size_t n = 0; n < count; n++) {
    double begin = now();
    times[n] = now() - begin;
  }
}

/* Write the time of each stewart_step [ns], on the motions in turn; with a base and a wrench
   where they are given. Returns the number of steps without forces. */
int steps(
  size_t count, const stewart_motion * motions, const double * wrench, const stewart_base * base,
  double * times)
{
  int without = 0;
  stewart_state state;
  stewart_output output;
  for (size_t n = 0; n < count; n++) {
    memset(&state, 0, sizeof state);
    double begin = now();
    int code = stewart_step(&hexapod, &motions[n], wrench, base, 0, &state, &output);
    times[n] = now() - begin;
    without += code != STEWART_OK;
  }
  return without;
}

/* Write the time of each search for the pose of a motion from a guess; return the failures. */
int searches(
  size_t count, const stewart_motion * motions, const stewart_pose * guesses, double * times)
{
  int failed = 0;
  for (size_t n = 0; n < count; n++) {
    stewart_result result;
    stewart_pose pose = guesses[n];
    failed += stewart_inverse_dynamics(&hexapod, &motions[n], NULL, NULL, &result) != STEWART_OK;
    double begin = now();
    int code = stewart_forward_kinematics(&hexapod, result.lengths, &pose);
    times[n] = now() - begin;
    failed += code != STEWART_OK;
  }
  return failed;
}
