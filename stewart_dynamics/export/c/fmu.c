// SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
// SPDX-License-Identifier: Apache-2.0

/* One instance of the hexapod as an FMU: fmu.h. */

#include "fmu.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

fmu_instance * fmu_create(const char * token)
{
  fmu_instance * instance = NULL;
  if (token != NULL && strcmp(token, fmu_token) == 0) {
    instance = calloc(1, sizeof *instance);
  }
  if (instance != NULL) {
    fmu_reset(instance);
  }
  return instance;
}

void fmu_reset(fmu_instance * instance)
{
  memset(&instance->memory, 0, sizeof instance->memory);
  memcpy(instance->memory.values, fmu_start, sizeof fmu_start);
}

double * fmu_value(fmu_instance * instance, uint32_t reference, fmu_type type, int settable)
{
  fmu_type actual = FMU_REAL;
  if (reference >= FMU_VALUES ||
    (reference >= FMU_LEVERS ? !fmu_with_levers :
    reference >= FMU_MOTOR_SPEEDS && !fmu_platform->with_motors) ||
    (settable && reference >= FMU_POSITIONS))
  {
    return NULL;
  }
  if (reference >= FMU_EXCEEDED && reference <= FMU_STATUS) {
    actual = FMU_INTEGER;
  } else if (reference == FMU_WARNING || reference == FMU_SUPPRESS_NEAR_SINGULARITY ||
    reference == FMU_SUPPRESS_AT_LIMITS)
  {
    actual = FMU_BOOLEAN;
  }
  return type == actual ? &instance->memory.values[reference] : NULL;
}

/* Put parameters and payload of the instance into a hexapod; return a code of stewart_dynamics.h. */
static int put_parameters(const double * values, stewart_platform * platform)
{
  const double * payload = values + FMU_PAYLOAD_MASS;
  int where;
  platform->mass = values[FMU_MASS];
  memcpy(platform->center_of_mass, values + FMU_CENTER_OF_MASS, 3 * sizeof *values);
  memcpy(platform->inertia, values + FMU_INERTIA, 6 * sizeof *values);
  platform->warn_condition = values[FMU_WARN_CONDITION];
  platform->stop_condition = values[FMU_STOP_CONDITION];
  platform->warn_time = values[FMU_WARN_TIME];
  platform->suppress_near_singularity = values[FMU_SUPPRESS_NEAR_SINGULARITY] != 0.0;
  platform->suppress_at_limits = values[FMU_SUPPRESS_AT_LIMITS] != 0.0;
  if (stewart_check(platform, &where) != STEWART_VALID || payload[0] < 0.0) {
    return STEWART_BROKEN_RULE;
  }
  return payload[0] == 0.0 ? STEWART_OK : stewart_add_payload(
    platform, payload[0], values + FMU_PAYLOAD_CENTER_OF_MASS, values + FMU_PAYLOAD_INERTIA);
}

/* The inputs in the order of the variables: the structures are arrays of doubles. */
static void put_motion(const double * values, stewart_motion * motion, stewart_base * base)
{
  memcpy(motion->position, values + FMU_POSITION, sizeof motion->position);
  memcpy(motion->linear_velocity, values + FMU_LINEAR_VELOCITY, 3 * sizeof *values);
  memcpy(motion->angular_velocity, values + FMU_ANGULAR_VELOCITY, 3 * sizeof *values);
  memcpy(motion->linear_acceleration, values + FMU_LINEAR_ACCELERATION, 3 * sizeof *values);
  memcpy(motion->angular_acceleration, values + FMU_ANGULAR_ACCELERATION, 3 * sizeof *values);
  memcpy(base->gravity, values + FMU_BASE_GRAVITY, 3 * sizeof *values);
  memcpy(base->linear_acceleration, values + FMU_BASE_LINEAR_ACCELERATION, 3 * sizeof *values);
  memcpy(base->angular_velocity, values + FMU_BASE_ANGULAR_VELOCITY, 3 * sizeof *values);
  memcpy(base->angular_acceleration, values + FMU_BASE_ANGULAR_ACCELERATION, 3 * sizeof *values);
}

int fmu_step(fmu_instance * instance, double time)
{
  double * values = instance->memory.values;
  stewart_platform platform = *fmu_platform;
  stewart_motion motion;
  stewart_base base;
  stewart_output output;
  int code, rotation, n;
  if (instance->memory.initializing) {  /* each set of inputs is the first */
    memset(&instance->memory.state, 0, sizeof instance->memory.state);
  }
  put_motion(values, &motion, &base);
  rotation = stewart_rotation(values + FMU_ORIENTATION, motion.rotation);
  code = put_parameters(values, &platform);
  if (code == STEWART_OK) {
    code = fabs(time) < 2e9 ? rotation : STEWART_OUT_OF_RANGE;
  }
  if (code == STEWART_OK) {
    code = stewart_step(
      &platform, &motion, values + FMU_WRENCH, &base, (int64_t)floor(time * 1e9 + 0.5),
      &instance->memory.state, &output);
  }
  if (code == STEWART_OK || code == STEWART_SUPPRESSED || code == STEWART_SINGULAR) {
    memcpy(values + FMU_POSITIONS, fmu_positions(&output), 6 * sizeof *values);
    memcpy(values + FMU_RATES, fmu_rates(&output), 6 * sizeof *values);
    memcpy(values + FMU_LEVERS, output.result.levers, 6 * sizeof *values);
    memcpy(values + FMU_MOTOR_SPEEDS, output.motors.speeds, 6 * sizeof *values);
    values[FMU_DETERMINANT] = output.result.determinant;
    values[FMU_DETERMINANT_RATE] = output.result.determinant_rate;
    values[FMU_CONDITION_NUMBER] = output.result.condition_number;
    values[FMU_WARNING] = output.warning != STEWART_NO_WARNING;
    for (n = 0; n < 6; n++) {
      values[FMU_EXCEEDED + n] = output.exceeded[n];
    }
  }
  for (n = 0; n < 6; n++) {
    values[FMU_EFFORTS + n] = code == STEWART_OK ? fmu_efforts(&output)[n] : 0.0;
    values[FMU_JOINT_FORCES + n] = code == STEWART_OK ? output.result.joint_forces[n] : 0.0;
    values[FMU_MOTOR_TORQUES + n] = code == STEWART_OK ? output.motors.commands[n] : 0.0;
  }
  values[FMU_STATUS] = code;
  values[FMU_TIME] = time;
  return code;
}

const char * fmu_text(int code)
{
  switch (code) {
    case STEWART_OK: return "forces are computed";
    case STEWART_NOT_FINITE: return "forces are zero: an input is NaN or infinite";
    case STEWART_NOT_UNIT: return "forces are zero: orientation is not a unit quaternion";
    case STEWART_SINGULAR: return "forces are zero: det(J) is zero";
    case STEWART_SUPPRESSED: return "forces are zero: singularity.action or limits.action";
    case STEWART_UNREACHABLE: return "forces are zero: a leg does not reach the platform";
    case STEWART_BROKEN_RULE: return "forces are zero: a parameter breaks a rule";
    default: return "forces are zero: an input or the time is out of range";
  }
}
