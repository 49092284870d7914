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
 * Legs are telescopic, or cranks with rods: each has a drive, whose position is the length of the
 * leg [m] or the angle of the crank [rad], and whose effort is a force [N] or a torque [N m].
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
  STEWART_NO_MOTORS = 9,      /* actuator.screw_lead is not in the parameters */
  STEWART_BROKEN_RULE = 10,   /* of the hexapod: stewart_check says which */
  STEWART_UNREACHABLE = 11,   /* a rod does not reach from its crank to the platform */
  STEWART_NO_SERVOS = 12,     /* servo.* is not in the parameters */
  STEWART_SERVO_RANGE = 13    /* an angle is outside the two angles of servo.* */
};

/* Kinds of legs, a line each: number, name, and prefix of its functions. */
#define STEWART_LEG_KINDS(KIND, function, arguments) \
  KIND(0, TELESCOPIC, telescopic, function, arguments) \
  KIND(1, CRANK, crank, function, arguments)
#define STEWART_KIND_NUMBER(number, NAME, prefix, function, arguments) STEWART_ ## NAME = number,

enum { STEWART_LEG_KINDS(STEWART_KIND_NUMBER, , ) };

/* Why the singularity warning is on: stewart_state.warning. */
enum {
  STEWART_NO_WARNING = 0,
  STEWART_CONDITION = 1, /* condition number above singularity.warn_condition */
  STEWART_PREDICTED = 2, /* det(J) = 0 is predicted within singularity.warn_time */
  STEWART_CROSSED = 3    /* det(J) has changed its sign since the last call */
};

/* The limits of a leg, a line each, then those of cranks alone: bit of stewart_output.exceeded,
 * name, field of stewart_leg; what the quantity depends on: pose, twist or load of the motion, or
 * motor; its numbers in stewart_output, which must be at least a MINIMUM or at most a MAXIMUM, or
 * have magnitudes of at most a LARGEST. */
#define STEWART_LIMITS(MINIMUM, MAXIMUM, LARGEST) \
  STEWART_LEG_LIMITS(MINIMUM, MAXIMUM, LARGEST) STEWART_CRANK_LIMITS(MINIMUM, MAXIMUM, LARGEST)
#define STEWART_LEG_LIMITS(MINIMUM, MAXIMUM, LARGEST) \
  MINIMUM(1, LENGTH_MIN, length_min, POSE, result.lengths) \
  MAXIMUM(2, LENGTH_MAX, length_max, POSE, result.lengths) \
  LARGEST(4, VELOCITY_MAX, velocity_max, TWIST, result.rates) \
  LARGEST(8, FORCE_MAX, force_max, LOAD, result.forces) \
  LARGEST(16, BASE_JOINT_ANGLE_MAX, base_joint_angle_max, POSE, base_joint_angles) \
  LARGEST(32, PLATFORM_JOINT_ANGLE_MAX, platform_joint_angle_max, POSE, platform_joint_angles) \
  LARGEST(256, JOINT_FORCE_MAX, joint_force_max, LOAD, result.joint_forces) \
  LARGEST(512, TORQUE_MAX, torque_max, MOTOR, motors.breakaway_torques) \
  LARGEST(2048, SPEED_MAX, speed_max, MOTOR, motors.speeds) \
  LARGEST(4096, TEMPERATURE_RISE_MAX, temperature_rise_max, MOTOR, rises)
#define STEWART_CRANK_LIMITS(MINIMUM, MAXIMUM, LARGEST) \
  MINIMUM(8192, ANGLE_MIN, angle_min, POSE, result.angles) \
  MAXIMUM(16384, ANGLE_MAX, angle_max, POSE, result.angles) \
  LARGEST(32768, CRANK_SPEED_MAX, crank_speed_max, TWIST, result.speeds) \
  LARGEST(65536, CRANK_TORQUE_MAX, crank_torque_max, LOAD, result.torques) \
  LARGEST(131072, ROD_FORCE_MAX, rod_force_max, LOAD, result.joint_forces) \
  MINIMUM(262144, LEVER_MIN, lever_min, POSE, lever_ratios)
#define STEWART_BIT(bit, NAME, field, DEPENDS, quantity) STEWART_ ## NAME = bit,
#define STEWART_FIELD(bit, NAME, field, DEPENDS, quantity) double field;

/* Limits that a leg exceeds: bits of stewart_output.exceeded. To those in _CLIPPED, forces and
 * torques to command are clipped; while another is exceeded, limits.action may suppress them. */
enum {
  STEWART_LIMITS(STEWART_BIT, STEWART_BIT, STEWART_BIT)
  STEWART_LEG_CLEARANCE_MIN = 64, /* stewart_platform.leg_clearance_min */
  STEWART_JUMP = 128,             /* too far from the last setpoint for limits.velocity_max, or
                                     of cranks limits.speed_max */
  STEWART_TORQUE_SPEED = 1024,    /* stewart_platform.torque_speed */
  STEWART_CLIPPED = 67080         /* STEWART_FORCE_MAX, _TORQUE_MAX, _TORQUE_SPEED,
                                     _CRANK_TORQUE_MAX */
};

/* A leg, with the names of the parameter file; its inertias are transverse, about the CoM. A crank
 * has the axes [e n u]: along the crank, in the direction in which its end moves where it turns in
 * the positive sense, along the motor's axis. Reflected mass, friction and losses of a crank are
 * those at its shaft: [kg m^2], [N m s/rad], [N m], [rad/s].
 * Not set: NAN; a limit: infinite, with its sign; length_min, lever_min: 0; screw_lead: 0. */
typedef struct {
  double base_joint[3], platform_joint[3]; /* base frame; platform frame [m]; of a crank: where the
                                              plane in which its end moves cuts the motor's axis */
  double zero_length;                      /* where the published position is zero [m] */
  double cylinder_mass, cylinder_center_of_mass, cylinder_inertia; /* CoM from base joint */
  double piston_mass, piston_center_of_mass, piston_inertia;       /* CoM from platform joint */
  double reflected_mass, viscous_friction, coulomb_friction;       /* [kg], [N s/m], [N] */
  double coulomb_velocity; /* rate below which Coulomb friction is linear [m/s], above 0 */
  STEWART_LIMITS(STEWART_FIELD, STEWART_FIELD, STEWART_FIELD) /* length_min, length_max, ... */
  double base_joint_axis[3], platform_joint_axis[3]; /* unit vectors, base axes; platform axes */
  double cylinder_radius, cylinder_length, piston_radius; /* for leg_clearance_min [m] */
  double screw_lead, gear_ratio;                          /* [m/turn] */
  double efficiency, back_driving_efficiency;
  double motor_inertia, screw_inertia;                /* [kg m^2]; reflected_mass follows */
  double torque_constant, resistance;                 /* [N m/A], [Ohm] */
  double thermal_resistance, thermal_time_constant;   /* [K/W], [s] */
  double twist_ratio; /* turns of the motor by turn of the leg, 0 where the screw is guided */
  double base_universal_axis[3], platform_universal_axis[3];
  double crank_length, rod_length;         /* [m]; 0: the leg is telescopic */
  double crank_axis[3], crank_direction[3]; /* unit vectors, base axes: of the motor; of the crank
                                               at the angle 0 */
  double branch;                           /* sign of the lever: 1 or -1 */
  double crank_mass, crank_center_of_mass[3], crank_inertia[6]; /* [e n u], from the motor's axis;
                                                                   xx xy xz yy yz zz */
  double rod_mass, rod_center_of_mass, rod_inertia; /* CoM from the end of the crank; by default of
                                                       a uniform rod */
  double servo_pulse_min, servo_pulse_max;          /* [s]; with the angles at them [rad]: */
  double servo_angle_at_min, servo_angle_at_max;
  /* Written by stewart_complete: turn of the motor by metre [rad/m]; metres by turn of the leg
   * [m/rad]; losses of a motor that drives, and is driven, less 1; rate below which they are
   * linear [m/s]. */
  double motor_ratio, pitch, driving_loss, driven_loss, loss_velocity;
  /* Of a crank: the rod as two points with a coupling, at the crank and at the platform [kg]; the
   * moment of mass along e and n [kg m] and the inertia [kg m^2] of the crank and the point at its
   * end, about the base joint. */
  double crank_end_mass, coupling_mass, platform_end_mass;
  double turning_moment[2], turning_inertia[6];
  /* Position of the drive at home: halfway between its limits, if it has both; else zero_length,
   * or the angle 0. */
  double home_position;
} stewart_leg;

/* A hexapod, constant while it is used: all that the parameter file says of its forces.
 * stewart_export writes one; who fills or changes one calls stewart_complete, then stewart_check.
 */
typedef struct {
  double gravity[3];                             /* acceleration of free fall [m/s^2] */
  double mass, center_of_mass[3];                /* of platform with payload; platform axes */
  double inertia[6];                             /* xx xy xz yy yz zz about it, platform axes */
  stewart_leg legs[6];
  double leg_clearance_min;                      /* [m], -infinite if not set */
  double characteristic_length;                  /* divides moments in the condition number [m] */
  double warn_condition, stop_condition;         /* condition numbers */
  double warn_time;                              /* before a predicted crossing [s] */
  double sync_tolerance, timeout;                /* of setpoints: setpoint.* [s] */
  double torque_speed[96][2];                    /* points: speed [rad/s] and torque [N m] */
  double base_outline[32][3], platform_outline[32][3]; /* corners of plates [m] */
  int n_torque_speed, n_base_outline, n_platform_outline;
  int with_motors;                               /* drive.* is given: stewart_step has motors */
  int suppress_near_singularity;                 /* singularity.action is suppress_forces */
  int suppress_at_limits;                        /* limits.action is suppress_forces */
  int with_joint_angles, with_clearance;         /* a limit needs them: stewart_complete */
  int leg_kind;                                  /* STEWART_TELESCOPIC, ...: stewart_complete */
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
  double joint_forces[6];      /* along the legs, in joints and rods: without the actuators' own;
                                  of a rod the larger one of both ends */
  /* Of cranks, else zero. Their lengths and rates are those of the rods, their forces those of the
   * rods at the platform, + pushes. */
  double angles[6], speeds[6]; /* [rad], [rad/s] */
  double torques[6];           /* of the drives, before any limit [N m] */
  double levers[6];            /* torque by the force of the rod [m]; zero at a dead centre */
} stewart_result;

/* Motors: zero where the published leg position is zero, + extends; nan where drive.* does not
 * give them. */
typedef struct {
  double angles[6], speeds[6];     /* [rad], [rad/s] */
  double commands[6];              /* torques to command: within the available ones [N m] */
  double breakaway_torques[6];     /* of the demanded forces: which limits are checked with */
  double torques[6];               /* of the demanded forces; at rest without losses */
  double accelerations[6];         /* [rad/s^2] */
  double currents[6], power[6];    /* [A]; from the bus [W] */
  double copper_heat[6];           /* part of the power that heats the winding [W] */
  double available_torques[6];     /* by torque_max and torque_speed at this speed [N m] */
} stewart_motors;

/* What stewart_step keeps from call to call: all zero before the first, or to start anew. */
typedef struct {
  int warning;             /* STEWART_NO_WARNING, or why the warning is on */
  int stopped;             /* inside singularity.stop_condition */
  uint32_t crossings;      /* changes of sign of det(J) */
  int followed;            /* whether stamp and what follows it are given */
  double determinant;      /* the last that was not zero [m^3] */
  double time_to_crossing; /* of det(J) = 0 at its present rate [s]; infinite: never */
  int64_t stamp;           /* of the last setpoint that was not a jump [ns] */
  double lengths[6];       /* positions of the drives at that setpoint: lengths [m] or angles */
  double rises[6];         /* of the temperatures of the windings at it [K] */
  double copper_heat[6];   /* since then [W] */
  double restarting;       /* flag: time has jumped back before a setpoint without a result */
} stewart_state;

/* What stewart_step finds. Numbers that no limit needs, and motors without drive.*, are nan. */
typedef struct {
  stewart_result result;
  double forces[6];        /* to command [N]: clipped to force_max; zero unless STEWART_OK */
  double torques[6];       /* likewise of cranks [N m]: clipped to crank_torque_max; else zero */
  double positions[6];     /* of the joints: lengths less zero_length [m], or angles [rad] */
  double lever_ratios[6];  /* lever of a crank by its length, 0 to 1; 1 of a telescopic leg */
  double lever_times[6];   /* until a lever falls to lever_min, at the present rate of its square
                              [s]: 0 where it has; infinite: never */
  double mean_rates[6];    /* of the drives from the last setpoint that was not a jump [m/s] or
                              [rad/s]; nan at the first */
  double base_joint_angles[6], platform_joint_angles[6]; /* [rad] */
  double clearances[6];    /* from the nearest other leg or plate [m] */
  stewart_motors motors;
  double rises[6];         /* of the temperatures of the windings [K] */
  /* The singularity warning as in stewart_state, and flags: whether it has changed, or is the
   * first; a limit is exceeded; the legs cannot follow; the motors' numbers are finite; the
   * forces can be computed, and are to be commanded. */
  double warning, stopped, determinant, time_to_crossing, crossings;
  double changed, exceeding, jumped, finite_motors, solved, answered, restart;
  unsigned exceeded[6];    /* limits that each leg exceeds: bits STEWART_LENGTH_MIN, ... */
  int64_t nearest[6];      /* what is nearest: a leg, 6 the plate of the base, 7 of the platform */
} stewart_output;

/* Rules that a hexapod must keep, a line each: code, name, parameters, rule. Codes are those of
 * stewart_check. */
#define STEWART_RULES(RULE) \
  RULE(1, FINITE, "", "must be finite") \
  RULE(2, MASS, "platform.mass", "must be more than 0") \
  RULE(3, INERTIA, "platform.inertia", "must be positive definite") \
  RULE(4, ONE_POINT, "geometry.platform_joints", "all six are at one point") \
  RULE(5, CHARACTERISTIC_LENGTH, "singularity.characteristic_length", "must be more than 0") \
  RULE(6, WARN_CONDITION, "singularity.warn_condition", "must be at least 1") \
  RULE(7, STOP_CONDITION, "singularity.stop_condition", \
       "must be at least singularity.warn_condition") \
  RULE(8, WARN_TIME, "singularity.warn_time", "must be at least 0") \
  RULE(9, LEG_MASS, "legs", "masses and inertias must be at least 0") \
  RULE(10, ACTUATOR, "actuator", "reflected mass and friction must be at least 0") \
  RULE(11, COULOMB_VELOCITY, "actuator.coulomb_velocity", "must be more than 0") \
  RULE(12, LIMIT, "limits", "must be more than 0") \
  RULE(13, LENGTHS, "limits.length_min", "must be less than limits.length_max") \
  RULE(14, SHAPE, "legs.cylinder.radius, legs.cylinder.length, legs.piston.radius", \
       "not set: needed by limits.leg_clearance_min") \
  RULE(15, RADII, "legs.piston.radius", "must be at most legs.cylinder.radius") \
  RULE(16, BASE_AXIS, "geometry.base_joint_axes", "a direction must not be 0, 0, 0") \
  RULE(17, PLATFORM_AXIS, "geometry.platform_joint_axes", "a direction must not be 0, 0, 0") \
  RULE(18, BASE_UNIVERSAL, "drive.base_universal_axes", "a direction must not be 0, 0, 0") \
  RULE(19, PLATFORM_UNIVERSAL, "drive.platform_universal_axes", \
       "a direction must not be 0, 0, 0") \
  RULE(20, SCREW_LEAD, "actuator.screw_lead", "not set: needed by drive.*") \
  RULE(21, EFFICIENCY, "drive.efficiency", "must be more than 0 and at most 1") \
  RULE(22, RESISTANCE, "drive.torque_constant", "not set: needed by drive.resistance") \
  RULE(23, THERMAL_RESISTANCE, "drive.resistance, drive.thermal_time_constant", \
       "not set: needed by drive.thermal_resistance") \
  RULE(24, THERMAL_TIME_CONSTANT, "drive.thermal_resistance", \
       "not set: needed by drive.thermal_time_constant") \
  RULE(25, TEMPERATURE_RISE, "drive.thermal_resistance", \
       "not set: needed by drive.temperature_rise_max") \
  RULE(26, TORQUE_SPEED, "drive.torque_speed", \
       "speeds must be strictly increasing, from 0 or more") \
  RULE(27, CORNERS, "geometry.base_outline, geometry.platform_outline", \
       "must have three corners or more") \
  RULE(28, CORNERS_ON_A_LINE, "geometry.base_outline, geometry.platform_outline", \
       "the corners are on one line") \
  RULE(29, CORNERS_IN_A_PLANE, "geometry.base_outline, geometry.platform_outline", \
       "the corners must be in one plane, to 1e-06 of its size") \
  RULE(30, CONVEX, "geometry.base_outline, geometry.platform_outline", \
       "must be convex, its corners in order around it") \
  RULE(31, POINTS, "drive.torque_speed, geometry.base_outline, geometry.platform_outline", \
       "more points than the structure holds") \
  RULE(32, KIND, "legs.crank.length", "all legs or none must have a crank") \
  RULE(33, ROD_LENGTH, "legs.rod.length", "must be more than 0") \
  RULE(34, CRANK_AXIS, "geometry.crank_axes", "a direction must not be 0, 0, 0") \
  RULE(35, CRANK_DIRECTION, "geometry.crank_directions", \
       "must be perpendicular to geometry.crank_axes, to 0.001 rad") \
  RULE(36, BRANCH, "geometry.crank_branch", "must be positive or negative") \
  RULE(37, CRANK_INERTIA, "legs.crank.inertia", "must be positive semidefinite") \
  RULE(38, ANGLES, "limits.angle_min", "must be less than limits.angle_max") \
  RULE(39, LEVER, "limits.lever_min", "must be less than 1") \
  RULE(40, SERVO_POINTS, "servo.angle_at_min, servo.angle_at_max", \
       "not set: needed by servo.*") \
  RULE(41, SERVO_ANGLES, "servo.angle_at_min", "must differ from servo.angle_at_max") \
  RULE(42, SERVO_PULSES, "servo.pulse_min", "must be less than servo.pulse_max")
#define STEWART_RULE_CODE(code, NAME, parameters, rule) STEWART_RULE_ ## NAME = code,

enum { STEWART_RULES(STEWART_RULE_CODE) STEWART_VALID = 0 };

/* Writes what follows from other numbers of a hexapod: motor_ratio, pitch, driving_loss, ...;
 * reflected_mass where inertias are given; characteristic_length where it is not above 0;
 * back_driving_efficiency where it is not set; axes of unit length; which checks are on. */
void stewart_complete(stewart_platform * platform);

/* Returns the first rule that a complete hexapod breaks: STEWART_VALID or STEWART_RULE_...; where,
 * unless it is NULL: the leg (0 to 5), for plates 0 the base's and 1 the platform's, else -1. */
int stewart_check(const stewart_platform * platform, int * where);

/* Returns a rule in words, beginning with the parameters; NULL for another code. */
const char * stewart_rule(int code);

/* Inverse dynamics: lengths, rates and forces of the legs, and how near a singularity it is.
 *
 * wrench: force [N] and moment [N m] on the platform at its origin; NULL: none.
 * base: NULL: still, with the platform's gravity.
 * The result is written with STEWART_OK and STEWART_SINGULAR alone. */
int stewart_inverse_dynamics(
  const stewart_platform * platform, const stewart_motion * motion, const double wrench[6],
  const stewart_base * base, stewart_result * result);

/* The node's step: inverse dynamics, joints, clearance, motors with the heat of their windings,
 * then singularity warning with its hysteresis and limits; forces and torques are clipped to their
 * limits, and suppressed where the parameters say so.
 *
 * stamp: time of the setpoint, of any clock that rises [ns]; between stamps velocity_max holds.
 * State and output are written with STEWART_OK, _SUPPRESSED and _SINGULAR alone. */
int stewart_step(
  const stewart_platform * platform, const stewart_motion * motion, const double wrench[6],
  const stewart_base * base, int64_t stamp, stewart_state * state, stewart_output * output);

/* The motors that give leg forces, with drive.* in the parameters.
 *
 * motion: one that stewart_step has accepted. forces: of the result or of the output [N].
 * Motors are written with STEWART_OK alone. Their torques are not limited, their commands are. */
int stewart_motor_torques(
  const stewart_platform * platform, const stewart_motion * motion, const double forces[6],
  stewart_motors * motors);

/* Forward kinematics: the pose of six lengths [m], or angles of cranks [rad], on the guess's side
 * of singularities.
 *
 * pose: the guess (the last pose, or the one commanded), then the answer, with STEWART_OK alone;
 * its lengths are within 1e-12 m of those given. */
int stewart_forward_kinematics(
  const stewart_platform * platform, const double lengths[6], stewart_pose * pose);

/* The twist and the acceleration of the platform that give leg rates [m/s] and their time
 * derivatives [m/s^2], or those of cranks, at the motion's pose; written with STEWART_OK alone. */
int stewart_motion_of_legs(
  const stewart_platform * platform, const double rates[6], const double accelerations[6],
  stewart_motion * motion);

/* Adds a payload to the platform, as one rigid body with it: its mass [kg], center of mass [m] and
 * inertia about that [kg m^2], as those of the platform. With mass and inertia negated it removes
 * one. Written with STEWART_OK alone; STEWART_OUT_OF_RANGE: no mass is left; STEWART_BROKEN_RULE:
 * the payload's inertia is not positive semidefinite (nor negated: negative). */
int stewart_add_payload(
  stewart_platform * platform, double mass, const double center_of_mass[3],
  const double inertia[6]);

/* Writes by how much each leg misses the platform joint of a pose [m]; 0: it reaches it. */
int stewart_missing_distances(
  const stewart_platform * platform, const stewart_pose * pose, double distances[6]);

/* Writes the pulse widths [s] that turn servos to angles [rad], on the line through the two points
 * of servo.*, never outside servo_pulse_min and servo_pulse_max. Written with STEWART_OK alone;
 * STEWART_SERVO_RANGE: an angle is past one of the points; STEWART_NOT_FINITE: a leg does not
 * reach. */
int stewart_servo_pulses(
  const stewart_platform * platform, const double angles[6], double pulses[6]);

/* The rotation, row by row, of a quaternion x y z w; written with STEWART_OK alone. */
int stewart_rotation(const double quaternion[4], double rotation[9]);

#ifdef __cplusplus
}
#endif

#endif /* STEWART_DYNAMICS_H */
