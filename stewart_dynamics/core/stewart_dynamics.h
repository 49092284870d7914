/* SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * Leg lengths, rates and forces of a Gough-Stewart platform (hexapod), for real-time computers.
 *
 * C99, also C++; needs nothing but math.h and stdint.h. No function allocates memory, recurses,
 * keeps anything between calls, or has a loop without a bound; all can run in several tasks at
 * once. Results are those of the Python library and the ROS 2 node stewart_dynamics, bit for bit,
 * where products are not fused into sums (-ffp-contract=off) and doubles have 64 bits (not x87).
 *
 * Units are SI. The base frame is fixed to the base, the platform frame to the platform; vectors
 * are in base axes unless the text says platform axes. Legs are in the order of the parameter
 * file, from their base joint to their platform joint; a positive force pushes (extends the leg).
 *
 * Each cycle: fill a stewart_motion with the setpoint, call stewart_step, and command the forces
 * of the stewart_output if it returns STEWART_OK. docs/real_time.md has examples.
 */

#ifndef STEWART_DYNAMICS_H
#define STEWART_DYNAMICS_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Return codes of all functions. No force may be commanded unless it is STEWART_OK. */
enum {
  STEWART_OK = 0,
  STEWART_NULL = 1,           /* a pointer is NULL that must not be */
  STEWART_NOT_FINITE = 2,     /* an input is NaN or infinite */
  STEWART_NOT_A_ROTATION = 3, /* R^T R is more than 1e-6 off the identity, or R is a reflection */
  STEWART_NOT_UNIT = 4,       /* the length of a quaternion is more than 1e-3 off 1 */
  STEWART_OUT_OF_RANGE = 5,   /* numbers overflow, or a stamp is not within +-2^31 s */
  STEWART_SINGULAR = 6,       /* J_inv cannot be solved: forces are zero */
  STEWART_SUPPRESSED = 7,     /* by singularity.action or limits.action: forces are zero */
  STEWART_NO_POSE = 8,        /* no pose with these lengths found from this guess */
  STEWART_NO_MOTORS = 9       /* actuator.screw_lead is not in the parameters */
};

/* Why the singularity warning is on: stewart_state.warning. */
enum {
  STEWART_NO_WARNING = 0,
  STEWART_CONDITION = 1, /* condition number above singularity.warn_condition */
  STEWART_PREDICTED = 2, /* det(J) = 0 is predicted within singularity.warn_time */
  STEWART_CROSSED = 3    /* det(J) has changed its sign since the last call */
};

/* Limits that a leg exceeds: bits of stewart_output.exceeded. All but _FORCE_MAX suppress forces
 * where limits.action says so. */
enum {
  STEWART_LENGTH_MIN = 1,
  STEWART_LENGTH_MAX = 2,
  STEWART_VELOCITY_MAX = 4,
  STEWART_FORCE_MAX = 8, /* the force to command is clipped to the limit */
  STEWART_BASE_JOINT_ANGLE_MAX = 16,
  STEWART_PLATFORM_JOINT_ANGLE_MAX = 32,
  STEWART_LEG_CLEARANCE_MIN = 64,
  STEWART_JUMP = 128, /* too far from the last setpoint for limits.velocity_max */
  STEWART_JOINT_FORCE_MAX = 256
};

/* A leg, with the names of the parameter file; its inertias are transverse, about the CoM. */
typedef struct {
  double base_joint[3], platform_joint[3]; /* base frame; platform frame [m] */
  double zero_length;                      /* where the published position is zero [m] */
  double cylinder_mass, cylinder_center_of_mass, cylinder_inertia; /* CoM from base joint */
  double piston_mass, piston_center_of_mass, piston_inertia;       /* CoM from platform joint */
  double reflected_mass, viscous_friction, coulomb_friction;       /* [kg], [N s/m], [N] */
  double coulomb_velocity; /* rate below which Coulomb friction is linear [m/s], above 0 */
  double length_min, length_max, velocity_max, force_max; /* 0 or infinite if not set */
  double joint_force_max;                                 /* [N] */
  double base_joint_axis[3], base_joint_angle_max; /* unit vector, base axes; [rad] or infinite */
  double platform_joint_axis[3], platform_joint_angle_max;  /* platform axes */
  double cylinder_radius, cylinder_length, piston_radius;   /* for leg_clearance_min [m] */
  double screw_lead, gear_ratio;                            /* lead 0 if not set [m/turn] */
  double efficiency, back_driving_efficiency;
  double twist_ratio; /* turns of the motor by turn of the leg, 0 where the screw is guided */
  double base_universal_axis[3], platform_universal_axis[3];
} stewart_leg;

/* A hexapod, constant while it is used. stewart_export writes one from a parameter file. */
typedef struct {
  double gravity[3];                             /* acceleration of free fall [m/s^2] */
  double mass, center_of_mass[3];                /* of platform with payload; platform axes */
  double inertia[6];                             /* xx xy xz yy yz zz about it, platform axes */
  stewart_leg legs[6];
  double leg_clearance_min;                      /* [m], -infinite if not set */
  double characteristic_length;                  /* divides moments in the condition number [m] */
  double warn_condition, stop_condition;         /* condition numbers */
  double warn_time;                              /* before a predicted crossing [s] */
  double sync_tolerance;                         /* uncertainty of stamps [s] */
  int suppress_near_singularity;                 /* singularity.action is suppress_forces */
  int suppress_at_limits;                        /* limits.action is suppress_forces */
} stewart_platform;

/* Pose of the platform frame in the base frame; rotation: platform to base axes, row by row. */
typedef struct { double position[3], rotation[9]; } stewart_pose;

/* A pose with its twist and acceleration: of the platform's origin [m/s, m/s^2], and angular. */
typedef struct {
  double position[3], rotation[9];
  double linear_velocity[3], angular_velocity[3]; /* not the rates of Euler angles [rad/s] */
  double linear_acceleration[3], angular_acceleration[3];
} stewart_motion;

/* How the base moves: its origin's acceleration, its turning. A constant velocity is no load. */
typedef struct {
  double gravity[3]; /* acceleration of free fall in base axes, which turn with the base */
  double linear_acceleration[3], angular_velocity[3], angular_acceleration[3];
} stewart_base;

typedef struct {
  double lengths[6], rates[6]; /* [m], [m/s] */
  double forces[6];            /* of the drives, before any limit [N]; with moments of screws */
  double determinant;          /* det(J_inv) [m^3]; zero at a singularity */
  double determinant_rate;     /* its time derivative [m^3/s] */
  double condition_number;     /* of J_inv, at least 1 */
  double unit_load_forces[6];  /* largest force of each leg under a unit load on the platform */
  double joint_forces[6];      /* along the legs, in joints and rods: without the actuators' own */
} stewart_result;

/* What stewart_step keeps from call to call: all zero before the first, or to start anew. */
typedef struct {
  int warning;             /* STEWART_NO_WARNING, or why the warning is on */
  int stopped;             /* inside singularity.stop_condition */
  uint32_t crossings;      /* changes of sign of det(J) */
  double determinant;      /* the last that was not zero [m^3] */
  double time_to_crossing; /* of det(J) = 0 at its present rate [s]; infinite: never */
  int followed;            /* whether the next two are given */
  int64_t stamp;           /* of the last setpoint that was not a jump [ns] */
  double lengths[6];       /* at that setpoint [m] */
} stewart_state;

typedef struct {
  stewart_result result;
  double forces[6];     /* to command [N]: clipped to force_max; zero unless STEWART_OK */
  unsigned exceeded[6]; /* limits that each leg exceeds: bits STEWART_LENGTH_MIN, ... */
} stewart_output;

/* Motors: zero where the published leg position is zero, + extends; [rad], ..., [N m]. */
typedef struct { double angles[6], speeds[6], accelerations[6], torques[6]; } stewart_motors;

/* Inverse dynamics: lengths, rates and forces of the legs, and how near a singularity it is.
 *
 * wrench: force [N] and moment [N m] on the platform at its origin; NULL: none.
 * base: NULL: still, with the platform's gravity.
 * The result is written with STEWART_OK and STEWART_SINGULAR alone. */
int stewart_inverse_dynamics(
  const stewart_platform * platform, const stewart_motion * motion, const double wrench[6],
  const stewart_base * base, stewart_result * result);

/* The node's step: inverse dynamics, then singularity warning with its hysteresis and limits;
 * forces are clipped to limits.force_max, and suppressed where the parameters say so.
 *
 * stamp: time of the setpoint, of any clock that rises [ns]; between stamps velocity_max holds.
 * State and output are written with STEWART_OK, _SUPPRESSED and _SINGULAR alone. */
int stewart_step(
  const stewart_platform * platform, const stewart_motion * motion, const double wrench[6],
  const stewart_base * base, int64_t stamp, stewart_state * state, stewart_output * output);

/* The motors' angles, and torques that give leg forces, with drive.* in the parameters.
 *
 * motion: one that stewart_step has accepted. forces: of the result or of the output [N].
 * Motors are written with STEWART_OK alone. Torques are not limited; at rest without losses. */
int stewart_motor_torques(
  const stewart_platform * platform, const stewart_motion * motion, const double forces[6],
  stewart_motors * motors);

/* Forward kinematics: the pose of six lengths [m], on the guess's side of singularities.
 *
 * pose: the guess (the last pose, or the one commanded), then the answer, with STEWART_OK alone;
 * its lengths are within 1e-12 m of those given. */
int stewart_forward_kinematics(
  const stewart_platform * platform, const double lengths[6], stewart_pose * pose);

/* The twist and the acceleration of the platform that give leg rates [m/s] and their time
 * derivatives [m/s^2] at the motion's pose; written with STEWART_OK alone. */
int stewart_motion_of_legs(
  const stewart_platform * platform, const double rates[6], const double accelerations[6],
  stewart_motion * motion);

/* Adds a payload to the platform, as one rigid body with it: its mass [kg], center of mass [m] and
 * inertia about that [kg m^2], as those of the platform. With mass and inertia negated it removes
 * one. Written with STEWART_OK alone; STEWART_OUT_OF_RANGE: no mass is left. */
int stewart_add_payload(
  stewart_platform * platform, double mass, const double center_of_mass[3],
  const double inertia[6]);

/* The rotation, row by row, of a quaternion x y z w; written with STEWART_OK alone. */
int stewart_rotation(const double quaternion[4], double rotation[9]);

#ifdef __cplusplus
}
#endif

#endif /* STEWART_DYNAMICS_H */
