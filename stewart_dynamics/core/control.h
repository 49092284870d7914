/* SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * What a controller that is fed live setpoints needs beside stewart_dynamics.h: joints on circles,
 * the home pose and the axes of joints that follow from it, an IMU on the base, the governor.
 *
 * The ros2_control controller compiles control.c; Python calls the same functions in its library
 * and reads the structures from this text. Inputs are not checked.
 */

#ifndef STEWART_CONTROL_H
#define STEWART_CONTROL_H

#include "stewart_dynamics.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Legs as the home pose is found with them: straight lines from the base, of telescopic legs from
 * their base joints, to the platform joints, in the frames of both, between two lengths; length: of
 * the mean one at home [m]. */
typedef struct {
  double base[6][3], platform[6][3], shortest[6], longest[6], length;
} home_legs;

/* Level poses within the limits of length: see mechanics/kinematics/home_pose.py. */
typedef struct {
  double axes[9];                     /* the third row: normal to the plane of the base joints */
  double base[6][3], platform[6][3];  /* joints from their centers, in these axes [m] */
  double base_radius, platform_radius, across; /* across: longest leg in the plane [m] */
  double reachable, certain, known;   /* flags: of a pose, of the side, of the height */
  double yaw, side, length;           /* length: of the mean leg [m] */
  double count, heights[10];          /* the most likely first; along the normal [m] */
  stewart_pose poses[10];
  double base_directions[6][3], platform_directions[6][3]; /* of the legs in the first of them */
  double mounts[6][9];                /* of the legs in the URDF: see kinematics/leg_joints.py */
} home_poses;

/* How an IMU is mounted on the base: position [m], IMU axes to base axes; the rate of the filter,
 * 2 pi cutoff [1/s]; base.timeout [ns]. */
typedef struct { double position[3], rotation[9], rate; int64_t timeout; } imu_mounting;

/* The last reading, and the filtered angular acceleration; IMU axes. All zero: no reading yet. */
typedef struct { int64_t stamp; double given, spin[3], spin_rate[3]; } imu_filter;

/* The last two readings of an IMU that is read in each cycle. All zero: no reading yet. */
typedef struct {
  imu_filter filter;
  int64_t stamps[2], count;
  double reading[6];
  stewart_base bases[2];
} imu_stream;

/* Coordinates of a governed motion, with their derivatives: displacement of the head, and angles of
 * R = Rz Ry Rx, both from home and in its axes [m, rad]. */
typedef struct { double value[6], rate[6], acceleration[6]; } coordinates;

/* Where governor_state.held has the singularity; bit n of stewart_output.exceeded is there n. */
enum { GOVERNED_SINGULARITY = 24 };

/* What a governor keeps besides the limits of the platform's legs: see mechanics/governor.py. All
 * have its margins, which stand here by themselves for positions of drives, as displacements of the
 * platform joints, clearance [m] and angles of joints [rad]. */
typedef struct {
  stewart_pose home;
  double head[3];                     /* platform frame [m] */
  double stop_rate, return_rate;      /* of the stop, and of the return to the demand [1/s] */
  double friction_torque[6];          /* change of the torque where the leg reverses [N m] */
  double condition_max, side;         /* side: sign of det(J) at home */
  double stop_condition;              /* without a margin */
  double arms[6], radii[6], reach;    /* distances of platform joints from the head, and from the
                                         origin; of the farthest part from the head [m] */
  double drive_margin[6], base_angle_margin[6], platform_angle_margin[6], clearance_margin;
} governor_limits;

/* A governed motion, all zero at rest at home; following: it is the demand. */
typedef struct {
  coordinates now;
  double share[6];                    /* of the demand, at last */
  double held[25];                    /* time in which each limit held the demand back [s] */
  double following;
  double stopping;                    /* it is brought to rest, whatever the demand is */
} governor_state;

/* A governed stream, with its last demand; time nan: it has none yet. */
typedef struct { double time; coordinates demand; governor_state governor; } governed_stream;

/* The drives in a step, whatever the legs are: positions, rates and demanded efforts, of telescopic
 * legs [m, m/s, N], of cranks [rad, rad/s, N m]; limits; flags: a position is below or above its
 * limits. */
typedef struct {
  double positions[6], rates[6], efforts[6], rate_max[6], effort_max[6], below[6], above[6];
} drive_values;

void put_drives(
  const stewart_platform * platform, const stewart_output * output, drive_values * drives);

/* Axes of motors and directions of cranks (6, 3) of headings [rad]: level, and positive angles
 * lift the ends of the cranks. */
void level_cranks(const double * headings, double * axes, double * directions);

/* Writes the branches of cranks: those that are wanted, 1 or -1, and for 0 the one whose angle at
 * home is within the limits; angles (6, 2): of the branches 1 and -1 at home [rad], nan where the
 * rod does not reach. Returns 0; or the leg, from 1, of which none is possible, from 7, of which both
 * are. */
int64_t choose_branches(
  stewart_platform * platform, const stewart_pose * home, const double * wanted, double * angles);

/* Six joints on a circle about the z axis of their frame [m]; angles from x toward y [rad]. */
void joints_on_circle(double radius, const double * angles, double height, double * joints);

/* Two axes in the plane of points (count, 3) from their center, and its normal, row by row. */
void level_axes(int64_t count, const double * around, double * axes);

/* The lines of force, from where they begin with the drives at their home positions. */
void put_home_legs(const stewart_platform * platform, home_legs * legs);

/* side: that of the platform, 1 or -1; 0: where the limits of length let it be, else 1. */
void find_home(const home_legs * legs, int64_t side, home_poses * home);

/* Gives screws that turn with their legs the axes of their universal joints: those that are set, of
 * unit length, else those of the mounts. Returns 0; or the leg, from 1, along which at home the axis
 * of the base is, from 7 that of the platform. */
int64_t put_universal_axes(const home_poses * home, stewart_platform * platform);

/* The motion of the base of a reading: angular velocity and specific force, IMU axes. */
void read_imu(
  const imu_mounting * imu, int64_t stamp, const double * reading, imu_filter * filter,
  stewart_base * base);

/* Writes the motion of the base in a cycle; returns whether it is known. A reading that repeats the
 * last one is none for base.timeout, since an IMU may be slower than the cycles; nor is one with
 * a nan. Then the last two go on as those of the node do. */
int64_t base_of_imu(
  const imu_mounting * imu, int64_t stamp, const double * reading, imu_stream * stream,
  stewart_base * base);

/* A complete hexapod with the margins of a governor, and what else that keeps about a home pose and
 * a head of the platform [m]. */
void put_governor(
  const stewart_platform * platform, const stewart_pose * home, const double * head,
  stewart_platform * within, governor_limits * limits);

/* Coordinates (count,) of motions; not finite for a pitch of 90 degrees that turns. */
void coordinates_of(
  const governor_limits * limits, int64_t count, const stewart_motion * motions,
  coordinates * states);

/* The limit, counted from 1, that a governed state or the stop from it exceeds; 0 if none. */
int64_t governed_limit(
  const stewart_platform * platform, const governor_limits * limits, const coordinates * state);

/* Motions (count,) that follow demands (count,) at times [s] as far as the limits let them; the
 * first is the state of the stream. A demand that is not finite brings it to rest. */
void govern_many(
  const stewart_platform * platform, const governor_limits * limits, int64_t count,
  const double * times, const coordinates * demands, governed_stream * stream,
  stewart_motion * motions);

#ifdef __cplusplus
}
#endif

#endif /* STEWART_CONTROL_H */
