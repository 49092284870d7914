// SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
// SPDX-License-Identifier: Apache-2.0

/*
 * A hexapod as a Functional Mock-up Unit (FMU) for co-simulation: its variables, one instance and
 * one step. fmi2.c and fmi3.c are the functions of FMI 2.0 and 3.0 around it. Instances share
 * nothing; a step allocates nothing.
 */

#ifndef STEWART_FMU_H
#define STEWART_FMU_H

#include <stddef.h>
#include <stdint.h>

#include "stewart_dynamics.h"

#if defined(_WIN32)
#define FMU_EXPORT __declspec(dllexport)
#elif defined(__GNUC__)
#define FMU_EXPORT __attribute__((visibility("default")))
#else
#define FMU_EXPORT
#endif

/* Value references of the variables: their places in fmu_instance.values. The names, units and
   descriptions in modelDescription.xml are in the same order. */
enum {
  FMU_POSITION = 0,
  FMU_ORIENTATION = 3,  /* quaternion x y z w */
  FMU_LINEAR_VELOCITY = 7,
  FMU_ANGULAR_VELOCITY = 10,
  FMU_LINEAR_ACCELERATION = 13,
  FMU_ANGULAR_ACCELERATION = 16,
  FMU_WRENCH = 19,
  FMU_BASE_GRAVITY = 25,
  FMU_BASE_LINEAR_ACCELERATION = 28,
  FMU_BASE_ANGULAR_VELOCITY = 31,
  FMU_BASE_ANGULAR_ACCELERATION = 34,
  FMU_PAYLOAD_MASS = 37,
  FMU_PAYLOAD_CENTER_OF_MASS = 38,
  FMU_PAYLOAD_INERTIA = 41,
  FMU_MASS = 47,  /* of the empty platform, the first parameter */
  FMU_CENTER_OF_MASS = 48,
  FMU_INERTIA = 51,
  FMU_WARN_CONDITION = 57,
  FMU_STOP_CONDITION = 58,
  FMU_WARN_TIME = 59,
  FMU_SUPPRESS_NEAR_SINGULARITY = 60,
  FMU_SUPPRESS_AT_LIMITS = 61,
  FMU_POSITIONS = 62,  /* of the drives: lengths or angles; the first output */
  FMU_RATES = 68,
  FMU_EFFORTS = 74,    /* to command: forces or torques */
  FMU_JOINT_FORCES = 80,
  FMU_DETERMINANT = 86,
  FMU_DETERMINANT_RATE = 87,
  FMU_CONDITION_NUMBER = 88,
  FMU_WARNING = 89,
  FMU_EXCEEDED = 90,
  FMU_STATUS = 96,
  FMU_TIME = 97,
  FMU_MOTOR_SPEEDS = 98,  /* the first of those that exist with drives alone */
  FMU_MOTOR_TORQUES = 104,
  FMU_LEVERS = 110,       /* exist where the drives turn */
  FMU_VALUES = 116
};

typedef enum {FMU_REAL, FMU_INTEGER, FMU_BOOLEAN, FMU_OTHER} fmu_type;

typedef struct {
  double values[FMU_VALUES];  /* of all types: integers and booleans are exact */
  stewart_state state;
  int initializing;           /* outputs are computed when they are read */
} fmu_memory;

typedef struct {
  fmu_memory memory;  /* all that changes: what Get and SetFMUState copy */
  void * environment;
  void (* log)(void);  /* of the importer; its type depends on the version of FMI */
  char name[64];       /* FMI 2.0 only */
} fmu_instance;

/* Of this hexapod, in model.c, which stewart_export writes. */
extern const stewart_platform * const fmu_platform;
extern const double fmu_start[FMU_POSITIONS];  /* inputs at the home pose, and parameters */
extern const char * const fmu_token;         /* instantiationToken or guid */
extern const int fmu_with_levers;            /* whether the variables at FMU_LEVERS exist */

/* The numbers of a step that the kind of legs has at FMU_POSITIONS, FMU_RATES and FMU_EFFORTS. */
const double * fmu_positions(const stewart_output * output);
const double * fmu_rates(const stewart_output * output);
const double * fmu_efforts(const stewart_output * output);

/* Return a new instance, or NULL where the token is another hexapod's or memory is lacking. */
fmu_instance * fmu_create(const char * token);

/* Put start values, as before the first step. */
void fmu_reset(fmu_instance * instance);

/* Return the place of a variable's value, or NULL where it has another type; settable: where it
   is not an input or parameter. */
double * fmu_value(fmu_instance * instance, uint32_t reference, fmu_type type, int settable);

/* Compute the outputs of the inputs at a time [s]; return the code of stewart_dynamics.h, which
   the variable status is, too. With a code that is not STEWART_OK the forces are zero. */
int fmu_step(fmu_instance * instance, double time);

/* Return a code as text. */
const char * fmu_text(int code);

#endif /* STEWART_FMU_H */
