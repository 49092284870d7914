/* SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * Inputs that are not valid: each has its return code, and nothing is written. Exits with 0.
 */

#include "hexapod.h"

#include <float.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

static int failures = 0;
static stewart_motion good;
static stewart_state state;
static stewart_output output;
static const double untouched = -77.0;

#define EXPECT(condition) \
  do { \
    if (!(condition)) { \
      printf("line %d: %s\n", __LINE__, #condition); \
      failures++; \
    } \
  } while (0)

/* The code of a step; output and state may be written with some codes alone. */
static int step(const stewart_motion * motion, const double * wrench, const stewart_base * base)
{
  memset(&state, 0, sizeof state);
  output.forces[3] = output.result.lengths[2] = untouched;
  int code = stewart_step(&hexapod, motion, wrench, base, 0, &state, &output);
  int written = code == STEWART_OK || code == STEWART_SUPPRESSED || code == STEWART_SINGULAR;
  EXPECT(state.followed == written);
  EXPECT((output.forces[3] != untouched) == written);
  EXPECT((output.result.lengths[2] != untouched) == written);
  for (int i = 0; written && code != STEWART_OK && i < 6; i++) {
    EXPECT(output.forces[i] == 0.0);
  }
  return code;
}

static void check_null(void)
{
  stewart_result result;
  stewart_pose pose;
  stewart_motors motors;
  double six[6] = {1.0, 1.0, 1.0, 1.0, 1.0, 1.0}, rotation[9], far[3] = {1e200, 0.0, 0.0};
  stewart_platform heavy = hexapod;
  EXPECT(stewart_inverse_dynamics(NULL, &good, NULL, NULL, &result) == STEWART_NULL);
  EXPECT(stewart_inverse_dynamics(&hexapod, NULL, NULL, NULL, &result) == STEWART_NULL);
  EXPECT(stewart_inverse_dynamics(&hexapod, &good, NULL, NULL, NULL) == STEWART_NULL);
  EXPECT(stewart_step(NULL, &good, NULL, NULL, 0, &state, &output) == STEWART_NULL);
  EXPECT(stewart_step(&hexapod, NULL, NULL, NULL, 0, &state, &output) == STEWART_NULL);
  EXPECT(stewart_step(&hexapod, &good, NULL, NULL, 0, NULL, &output) == STEWART_NULL);
  EXPECT(stewart_step(&hexapod, &good, NULL, NULL, 0, &state, NULL) == STEWART_NULL);
  EXPECT(stewart_forward_kinematics(NULL, six, &pose) == STEWART_NULL);
  EXPECT(stewart_forward_kinematics(&hexapod, NULL, &pose) == STEWART_NULL);
  EXPECT(stewart_forward_kinematics(&hexapod, six, NULL) == STEWART_NULL);
  EXPECT(stewart_motor_torques(NULL, &good, six, &motors) == STEWART_NULL);
  EXPECT(stewart_motor_torques(&hexapod, NULL, six, &motors) == STEWART_NULL);
  EXPECT(stewart_motor_torques(&hexapod, &good, NULL, &motors) == STEWART_NULL);
  EXPECT(stewart_motor_torques(&hexapod, &good, six, NULL) == STEWART_NULL);
  EXPECT(stewart_rotation(NULL, rotation) == STEWART_NULL);
  EXPECT(stewart_rotation(six, NULL) == STEWART_NULL);
  EXPECT(stewart_add_payload(NULL, 1.0, six, six) == STEWART_NULL);
  EXPECT(stewart_add_payload(&heavy, 1.0, NULL, six) == STEWART_NULL);
  EXPECT(stewart_add_payload(&heavy, 1.0, six, NULL) == STEWART_NULL);
  EXPECT(stewart_add_payload(&heavy, NAN, six, six) == STEWART_NOT_FINITE);
  EXPECT(stewart_add_payload(&heavy, INFINITY, six, six) == STEWART_NOT_FINITE);
  EXPECT(stewart_add_payload(&heavy, -heavy.mass, six, six) == STEWART_OUT_OF_RANGE);
  EXPECT(stewart_add_payload(&heavy, DBL_MAX, far, six) == STEWART_OUT_OF_RANGE);
  EXPECT(!memcmp(&heavy, &hexapod, sizeof heavy));
  EXPECT(stewart_add_payload(&heavy, 10.0, six, six) == STEWART_OK);
  EXPECT(heavy.mass == hexapod.mass + 10.0);
}

/* NaN and infinity in each number of motion, wrench and base. */
static void check_not_finite(double bad)
{
  for (size_t n = 0; n < sizeof(stewart_motion) / sizeof(double); n++) {
    stewart_motion motion = good;
    memcpy((char *)&motion + n * sizeof bad, &bad, sizeof bad);
    EXPECT(step(&motion, NULL, NULL) == STEWART_NOT_FINITE);
  }
  for (size_t n = 0; n < sizeof(stewart_base) / sizeof(double); n++) {
    stewart_base base = {{0.0, 0.0, -9.8}, {0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
    memcpy((char *)&base + n * sizeof bad, &bad, sizeof bad);
    EXPECT(step(&good, NULL, &base) == STEWART_NOT_FINITE);
  }
  for (int n = 0; n < 6; n++) {
    double six[6] = {1.0, 1.0, 1.0, 1.0, 1.0, 1.0}, quaternion[4] = {0.0, 0.0, 0.0, 1.0};
    stewart_pose pose;
    memcpy(&pose, &good, sizeof pose);
    six[n] = quaternion[n % 4] = bad;
    EXPECT(step(&good, six, NULL) == STEWART_NOT_FINITE);
    EXPECT(stewart_forward_kinematics(&hexapod, six, &pose) == STEWART_NOT_FINITE);
    EXPECT(memcmp(&pose, &good, sizeof pose) == 0);
    EXPECT(stewart_rotation(quaternion, pose.rotation) == STEWART_NOT_FINITE);
    EXPECT(memcmp(&pose, &good, sizeof pose) == 0);
    six[n] = 1.0;
    pose.rotation[n] = bad;
    EXPECT(stewart_forward_kinematics(&hexapod, six, &pose) == STEWART_NOT_FINITE);
  }
}

static void check_rotations(void)
{
  stewart_motion motion = good;
  motion.rotation[0] = 1.0 + 4e-7;
  EXPECT(step(&motion, NULL, NULL) == STEWART_OK);
  motion.rotation[0] = 1.0 + 6e-7;
  EXPECT(step(&motion, NULL, NULL) == STEWART_NOT_A_ROTATION);
  motion = good;
  motion.rotation[1] = 2e-6;  /* columns that are not at right angles */
  EXPECT(step(&motion, NULL, NULL) == STEWART_NOT_A_ROTATION);
  motion = good;
  motion.rotation[8] = -1.0;  /* a reflection */
  EXPECT(step(&motion, NULL, NULL) == STEWART_NOT_A_ROTATION);
  for (int n = 0; n < 9; n++) {
    motion.rotation[n] = n % 2 ? -1e200 : 1e200;
  }
  EXPECT(step(&motion, NULL, NULL) == STEWART_NOT_A_ROTATION);
  memset(motion.rotation, 0, sizeof motion.rotation);
  EXPECT(step(&motion, NULL, NULL) == STEWART_NOT_A_ROTATION);

  double rotation[9], shorter[4] = {0.0, 0.0, 0.0, 0.9989}, longer[4] = {1e200, 0.0, 0.0, 1e200};
  EXPECT(stewart_rotation(shorter, rotation) == STEWART_NOT_UNIT);
  EXPECT(stewart_rotation(longer, rotation) == STEWART_NOT_UNIT);
}

static void check_range(void)
{
  const int64_t second = 1000000000;
  stewart_motion motion = good;
  motion.angular_velocity[2] = 1e200;
  EXPECT(step(&motion, NULL, NULL) == STEWART_OUT_OF_RANGE);
  motion = good;
  motion.position[0] = 1e300;
  EXPECT(step(&motion, NULL, NULL) == STEWART_OUT_OF_RANGE);
  EXPECT(stewart_step(&hexapod, &good, NULL, NULL, INT64_MAX, &state, &output) ==
         STEWART_OUT_OF_RANGE);
  EXPECT(stewart_step(&hexapod, &good, NULL, NULL, INT64_MIN, &state, &output) ==
         STEWART_OUT_OF_RANGE);
  memset(&state, 0, sizeof state);
  EXPECT(stewart_step(&hexapod, &good, NULL, NULL, -2147483648 * second, &state, &output) ==
         STEWART_OK);
  EXPECT(stewart_step(&hexapod, &good, NULL, NULL, 2147483648 * second - 1, &state, &output) ==
         STEWART_OK);
}

/* On the plane of the base joints all legs are in one plane: J_inv is singular. */
static void check_singular(void)
{
  stewart_motion motion = good;
  motion.position[2] = 0.0;
  EXPECT(step(&motion, NULL, NULL) == STEWART_SINGULAR);
  EXPECT(output.result.lengths[0] > 0.0 && fabs(output.result.determinant) < 1e-20);
  EXPECT(output.result.forces[0] == 0.0 && state.warning == STEWART_CONDITION);
  stewart_pose pose;
  memcpy(&pose, &motion, sizeof pose);
  EXPECT(stewart_forward_kinematics(&hexapod, output.result.lengths, &pose) == STEWART_SINGULAR);

  const double impossible[6] = {1.1, 1.1, 1.1, 1.1, 1.1, 9.0};
  memcpy(&pose, &good, sizeof pose);
  EXPECT(stewart_forward_kinematics(&hexapod, impossible, &pose) == STEWART_NO_POSE);
  EXPECT(memcmp(&pose, &good, sizeof pose) == 0);
}

int main(void)
{
  memset(&good, 0, sizeof good);
  good.rotation[0] = good.rotation[4] = good.rotation[8] = 1.0;
  good.position[2] = 1.1;
  EXPECT(step(&good, NULL, NULL) == STEWART_OK);
  stewart_motors motors;
  EXPECT(stewart_motor_torques(&hexapod, &good, output.forces, &motors) == STEWART_NO_MOTORS);
  check_null();
  check_not_finite(NAN);
  check_not_finite(HUGE_VAL);
  check_not_finite(-HUGE_VAL);
  check_rotations();
  check_range();
  check_singular();
  return failures == 0 ? 0 : 1;
}
