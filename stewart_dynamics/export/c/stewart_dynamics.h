// Copyright 2026 The stewart_dynamics developers
//
// Licensed under the Apache License, Version 2.0 (the "License");
// you may not use this file except in compliance with the License.
// You may obtain a copy of the License at
//
//     http://www.apache.org/licenses/LICENSE-2.0
//
// Unless required by applicable law or agreed to in writing, software
// distributed under the License is distributed on an "AS IS" BASIS,
// WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
// See the License for the specific language governing permissions and
// limitations under the License.

/*
 * Leg lengths, rates and forces of a Gough-Stewart platform (hexapod), for real-time computers.
 *
 * C99, also C++; needs nothing but math.h and stdint.h. No function allocates memory, recurses,
 * keeps anything between calls, or runs a loop without a bound; all may run in several tasks at
 * once. Results are those of the Python library and the ROS 2 node stewart_dynamics, bit for bit,
 * if products are not fused into sums (-ffp-contract=off) and doubles are of 64 bits (no x87).
 *
 * Units are SI. The base frame is fixed to the base, the platform frame to the platform; vectors
 * are in base axes unless the text says platform axes. Leg i goes from its base joint to its
 * platform joint. A force pushes (tends to extend the leg) where it is positive. Arrays of six
 * are in the order of the legs in the parameter file.
 *
 * Each cycle: fill a stewart_motion with the setpoint, call stewart_step, and command the forces
 * of the stewart_output if it returns STEWART_OK. What to do at another code is said beside it.
 */

#ifndef STEWART_DYNAMICS_H
#define STEWART_DYNAMICS_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* What functions return. Where they return another code than OK, no force may be commanded. */
enum {
  STEWART_OK = 0,
  STEWART_NULL = 1,           /* a pointer is NULL that must not be; nothing is written */
  STEWART_NOT_FINITE = 2,     /* an input is NaN or infinite: keep the last setpoint or stop */
  STEWART_NOT_A_ROTATION = 3, /* R^T R is more than 1e-6 off the identity, or R is a reflection */
  STEWART_NOT_UNIT = 4,       /* a quaternion's length is more than 1e-3 off 1 */
  STEWART_OUT_OF_RANGE = 5,   /* numbers overflow, or a stamp is out of +-2^31 s */
  STEWART_SINGULAR = 6,       /* J_inv cannot be solved: lengths are valid, forces are zero */
  STEWART_SUPPRESSED = 7,     /* as singularity.action or limits.action says: forces are zero */
  STEWART_NO_POSE = 8         /* no pose with these lengths is found: is the guess a good one? */
};

/* Why the singularity warning is on: stewart_state.warning. */
enum {
  STEWART_NO_WARNING = 0,
  STEWART_CONDITION = 1, /* condition number above singularity.warn_condition */
  STEWART_PREDICTED = 2, /* det(J) = 0 is predicted within singularity.warn_time */
  STEWART_CROSSED = 3    /* det(J) has changed its sign since the last call */
};

/* Limits that a leg exceeds: bits of stewart_output.exceeded. */
enum {
  STEWART_LENGTH_MIN = 1,
  STEWART_LENGTH_MAX = 2,
  STEWART_VELOCITY_MAX = 4,
  STEWART_FORCE_MAX = 8, /* the force commanded is clipped to the limit */
  STEWART_JUMP = 16,     /* too far from the last setpoint for limits.velocity_max */
  STEWART_BASE_JOINT_ANGLE_MAX = 32,
  STEWART_PLATFORM_JOINT_ANGLE_MAX = 64,
  STEWART_LEG_CLEARANCE_MIN = 128
};

/* A leg, with the names of the parameter file. */
typedef struct {
  double base_joint[3];            /* of geometry.base_joints, base frame [m] */
  double platform_joint[3];        /* of geometry.platform_joints, platform frame [m] */
  double zero_length;              /* length where the published position is zero [m] */
  double cylinder_mass;            /* [kg] */
  double cylinder_center_of_mass;  /* from the base joint [m] */
  double cylinder_inertia;         /* transverse, about the center of mass [kg m^2] */
  double piston_mass;              /* [kg] */
  double piston_center_of_mass;    /* from the platform joint [m] */
  double piston_inertia;           /* transverse, about the center of mass [kg m^2] */
  double reflected_mass;           /* of the actuator [kg] */
  double viscous_friction;         /* [N s/m] */
  double coulomb_friction;         /* [N] */
  double coulomb_velocity;         /* rate below which Coulomb friction is linear [m/s], > 0 */
  double length_min, length_max;   /* limits [m]; 0 and infinite if not set */
  double velocity_max;             /* [m/s]; infinite if not set */
  double force_max;                /* [N]; infinite if not set */
  double base_joint_axis[3];       /* unit vector, base axes; used with the limit below */
  double base_joint_angle_max;     /* between axis and leg [rad]; infinite if not set */
  double platform_joint_axis[3];   /* unit vector, platform axes; used with the limit below */
  double platform_joint_angle_max; /* between axis and leg [rad]; infinite if not set */
  double cylinder_radius, cylinder_length, piston_radius; /* [m]; for leg_clearance_min */
} stewart_leg;

/* A hexapod: constant while it is used. stewart_export writes one from a parameter file. */
typedef struct {
  double gravity[3];               /* acceleration of free fall [m/s^2] */
  double mass;                     /* of platform and payload [kg] */
  double center_of_mass[3];        /* platform axes [m] */
  double inertia[6];               /* xx xy xz yy yz zz about it, platform axes [kg m^2] */
  stewart_leg legs[6];
  double leg_clearance_min;        /* between the surfaces of legs [m]; -infinite if not set */
  double characteristic_length;    /* by which moments are divided for the condition number [m] */
  double warn_condition;           /* singularity.warn_condition */
  double stop_condition;           /* singularity.stop_condition */
  double warn_time;                /* singularity.warn_time [s] */
  double sync_tolerance;           /* setpoint.sync_tolerance [s]: the stamps' uncertainty */
  int suppress_near_singularity;   /* singularity.action is suppress_forces */
  int suppress_at_limits;          /* limits.action is suppress_forces */
} stewart_platform;

/* A pose of the platform frame in the base frame: v_base = rotation v_platform. */
typedef struct {
  double position[3]; /* of the platform frame's origin [m] */
  double rotation[9]; /* row by row */
} stewart_pose;

/* Pose, twist and acceleration of the platform frame relative to the base. */
typedef struct {
  double position[3];             /* of the platform frame's origin [m] */
  double rotation[9];             /* platform axes to base axes, row by row */
  double linear_velocity[3];      /* of the origin [m/s] */
  double angular_velocity[3];     /* [rad/s]; not the rates of Euler angles */
  double linear_acceleration[3];  /* [m/s^2] */
  double angular_acceleration[3]; /* [rad/s^2] */
} stewart_motion;

/* How the base moves; a constant velocity changes no force. */
typedef struct {
  double gravity[3];              /* acceleration of free fall, base axes [m/s^2] */
  double linear_acceleration[3];  /* of the base frame's origin [m/s^2] */
  double angular_velocity[3];     /* [rad/s] */
  double angular_acceleration[3]; /* [rad/s^2] */
} stewart_base;

typedef struct {
  double lengths[6];          /* of the legs [m] */
  double rates[6];            /* of the lengths [m/s] */
  double forces[6];           /* of the actuators, unlimited [N] */
  double determinant;         /* det(J_inv) [m^3]; zero at a singularity */
  double determinant_rate;    /* its time derivative [m^3/s] */
  double condition_number;    /* of J_inv, moments by the characteristic length; at least 1 */
  double unit_load_forces[6]; /* largest of each leg, force^2 + (moment / char. length)^2 = 1 */
} stewart_result;

/* What stewart_step keeps from call to call: all zero before the first, and to start anew. */
typedef struct {
  int warning;             /* STEWART_NO_WARNING or the reason of the warning */
  int stopped;             /* inside singularity.stop_condition */
  uint32_t crossings;      /* changes of sign of det(J) */
  double determinant;      /* the last that was not zero [m^3] */
  double time_to_crossing; /* after which det(J) is zero at its rate [s]; infinite: never */
  int followed;            /* whether the next two are given: */
  int64_t stamp;           /* of the last setpoint that was not a jump [ns] */
  double lengths[6];       /* of that setpoint [m] */
} stewart_state;

typedef struct {
  stewart_result result; /* its forces are those demanded, before any limit */
  double forces[6];      /* to command [N]: clipped to force_max; zero unless STEWART_OK */
  unsigned exceeded[6];  /* STEWART_LENGTH_MIN, ...: the limits that each leg exceeds */
} stewart_output;

/*
 * Write the leg lengths [m] of a pose.
 *
 * Returns STEWART_OK, _NULL, _NOT_FINITE, _NOT_A_ROTATION or _OUT_OF_RANGE; lengths are written
 * with STEWART_OK alone.
 */
int stewart_inverse_kinematics(
  const stewart_platform * platform, const stewart_pose * pose, double lengths[6]);

/*
 * Write lengths, rates and forces of the legs in a motion, and how near a singularity it is.
 *
 * wrench: force [N] and moment [N m] on the platform at its origin, base axes; NULL for none.
 * base: NULL where it is still; gravity is then the platform's.
 *
 * Returns STEWART_OK, _NULL, _NOT_FINITE, _NOT_A_ROTATION, _OUT_OF_RANGE or _SINGULAR; the result
 * is written with STEWART_OK and STEWART_SINGULAR alone.
 */
int stewart_inverse_dynamics(
  const stewart_platform * platform, const stewart_motion * motion, const double wrench[6],
  const stewart_base * base, stewart_result * result);

/*
 * Write the forces to command for one setpoint, as the node does: the inverse dynamics, then the
 * singularity warning with its hysteresis, the limits, clipped and suppressed forces.
 *
 * stamp: time of the setpoint [ns], of any clock; limits.velocity_max holds between setpoints of
 * rising stamps. state: of this hexapod, see there.
 *
 * Returns STEWART_SUPPRESSED, or what stewart_inverse_dynamics returns. State and output are
 * written with STEWART_OK, _SUPPRESSED and _SINGULAR alone.
 */
int stewart_step(
  const stewart_platform * platform, const stewart_motion * motion, const double wrench[6],
  const stewart_base * base, int64_t stamp, stewart_state * state, stewart_output * output);

/*
 * Find the pose of six leg lengths [m] by Newton's method, on the guess's side of singularities.
 *
 * pose: the guess (the last pose, or the one commanded), then the answer; its lengths differ by
 * less than 1e-12 m from those given.
 *
 * Returns STEWART_OK, _NULL, _NOT_FINITE, _NOT_A_ROTATION, _SINGULAR (the guess is singular, or a
 * pose on the way) or _NO_POSE; the pose is written with STEWART_OK alone.
 */
int stewart_forward_kinematics(
  const stewart_platform * platform, const double lengths[6], stewart_pose * pose);

/*
 * Write the rotation, row by row, of a quaternion x y z w, which is normalized first.
 *
 * Returns STEWART_OK, _NULL, _NOT_FINITE or _NOT_UNIT; the rotation is written with STEWART_OK
 * alone.
 */
int stewart_rotation(const double quaternion[4], double rotation[9]);

#ifdef __cplusplus
}
#endif

#endif /* STEWART_DYNAMICS_H */
