/* SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * Calls of the exported C source over arrays, for test_export.py and benchmarks/.
 */

#include "stewart_dynamics.h"

#include <stddef.h>

enum { HAS_WRENCH = 1, HAS_BASE = 2 };  /* bits of ``given`` */

const size_t sizes[] = {
  sizeof(stewart_platform), sizeof(stewart_motion), sizeof(stewart_base), sizeof(stewart_result),
  sizeof(stewart_state), sizeof(stewart_output), sizeof(stewart_motors)};

/* Each sample with a hexapod of its own, or (stride 0) all with one. */
void inverse_dynamics(
  size_t count, const stewart_platform * platforms, size_t stride, const stewart_motion * motions,
  const double (* wrenches)[6], const stewart_base * bases, const int * given,
  stewart_result * results, int * codes)
{
  for (size_t n = 0; n < count; n++) {
    codes[n] = stewart_inverse_dynamics(
      &platforms[n * stride], &motions[n], given[n] & HAS_WRENCH ? wrenches[n] : NULL,
      given[n] & HAS_BASE ? &bases[n] : NULL, &results[n]);
  }
}

void forward_kinematics(
  size_t count, const stewart_platform * platforms, const double (* lengths)[6],
  stewart_pose * poses, int * codes)
{
  for (size_t n = 0; n < count; n++) {
    codes[n] = stewart_forward_kinematics(&platforms[n], lengths[n], &poses[n]);
  }
}

/* The steps of one hexapod, from a state of zeros on; the state after each, and its motors. */
void steps(
  size_t count, const stewart_platform * platform, const stewart_motion * motions,
  const double (* wrenches)[6], const stewart_base * bases, const int * given,
  const int64_t * stamps, stewart_state * states, stewart_output * outputs, int * codes,
  stewart_motors * motors, int * motor_codes)
{
  for (size_t n = 0; n < count; n++) {
    if (n > 0) {
      states[n] = states[n - 1];
    }
    codes[n] = stewart_step(
      platform, &motions[n], given[n] & HAS_WRENCH ? wrenches[n] : NULL,
      given[n] & HAS_BASE ? &bases[n] : NULL, stamps[n], &states[n], &outputs[n]);
    motor_codes[n] = stewart_motor_torques(
      platform, &motions[n], outputs[n].result.forces, &motors[n]);
  }
}

void rotations(
  size_t count, const double (* quaternions)[4], double (* matrices)[9], int * codes)
{
  for (size_t n = 0; n < count; n++) {
    codes[n] = stewart_rotation(quaternions[n], matrices[n]);
  }
}
