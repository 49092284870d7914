/* SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * The functions that Python calls beside those of stewart_dynamics.h and control.h, for many
 * samples.
 *
 * An array has a structure, or the numbers named, for each of `count` samples. `wrenches` and
 * `bases` have one for each or, where n_wrenches or n_bases is 1, one for all; a base with gravity
 * nan is still. Inputs are not checked; results of numbers that overflow are not finite. Python
 * reads the structures, the functions and the names of codes from this text.
 */

#ifndef STEWART_LIBRARY_H
#define STEWART_LIBRARY_H

#include "control.h"

/* A setpoint. Flags are 0 or 1. */
typedef struct {
  stewart_motion motion;
  double wrench[6];   /* load on the platform [N, N m] */
  stewart_base base;  /* nan: still, or not known */
  double base_known;  /* so is that of a fixed base */
  double restart;     /* time has jumped back before it */
  double stamped;     /* its stamp comes from messages, otherwise it is the time of arrival */
} setpoint;

/* A motion under loads, and what a call of one sample gives. */
typedef struct {
  stewart_motion motion;
  double forces[6], wrench[6]; /* of the drives; on the platform [N, N m] */
  stewart_base base;
  stewart_result result;
  double base_wrench[6];
} one_motion;

/* A quaternion x y z w and its rotation. */
typedef struct { double quaternion[4], rotation[9]; } one_rotation;

/* A pose that is searched from a guess, and how the search ended: its steps and residual [m]. */
typedef struct { stewart_pose pose; double lengths[6], steps, residual; } one_pose;

/* A measurement of the legs, and the external wrench that it gives: see external_wrench/. */
typedef struct {
  double lengths[6], rates[6], forces[6];
  double known[6];          /* load on the platform [N, N m] */
  double before[6];         /* external wrench of the last measurement [N, N m] */
  double gain, interval;    /* of the filter; since the last measurement [s] */
  stewart_motion motion;    /* the last one, or the guess */
  stewart_base base_before, base;
  double target;            /* det(J) at the last setpoint, or nan */
  stewart_motion motion_after;
  double after[6], differences[6]; /* external wrench [N, N m]; measured - model [N] */
  double steps, residual;   /* of the forward kinematics */
  double across;            /* the setpoint is on the other side of a singularity */
  double code;
} one_measurement;

/* End stops: a spring and a damper at either end of the drive's travel, infinite without, and
   where the lever of a leg is least, 0 without. */
typedef struct {
  double lowest[6], highest[6], least_lever[6], stiffness[6], damping[6];
} end_stops;

/* The simulated hexapod, its commands and loads in a period, and its state after it. */
typedef struct {
  double position[3], quaternion[4], twist[6];
} plant_state;

typedef struct {
  double by_torques;                   /* flag: commands are torques of the motors */
  double steps, step;                  /* in a period, and the length of one [s] */
  end_stops stops;
  double effort_max[6];
  double commands[6], wrench[6];       /* [N] or [N m]; on the platform [N, N m] */
  stewart_base bases[3];               /* at begin, middle and end of the period */
  plant_state state;
  double positions[6], rates[6], efforts[6], acceleration[6];
  double lever_ratios[6];              /* 1 at most, 0 at a dead centre */
  double sound;                        /* all steps could be computed */
  stewart_motors motors;
} one_plant;

/* What of that is the same in all periods of a hexapod. */
typedef struct { double by_torques; end_stops stops; double effort_max[6]; } plant_constants;

/* Washout filters; surge sway heave, or roll pitch yaw: see cueing/motion_cueing.py. */
typedef struct {
  double translation_gain[3], translation_frequency[3], translation_damping[3];
  double washout_frequency[3];
  double tilt_gain[2], tilt_frequency[2], tilt_damping[2], tilt_rate_max;
  double rotation_gain[3], rotation_frequency[3];
} washout_filters;

/* States of the filters, with their last input: acceleration, and angular velocity. */
typedef struct {
  double time, input[6], slope[6];
  double surge[3], sway[3], heave[3]; /* z, z', z'' */
  double tilt[4];                     /* sine of the pitch down and its rate, and of the roll */
  double tilt_rate_max;               /* it nears the one of the filters, where that was changed */
  double rotation[3];
  governor_state governor;
} cueing_state;

/* Motions (count,) at times [s] of inputs (count, 6), acceleration and angular velocity of the
   vehicle, linear between the times; the state is the one before, of an earlier time, and then the
   last. Governed where `limited`. */
void cue_many(
  const stewart_platform * platform, const governor_limits * limits, int64_t limited,
  const washout_filters * filters, int64_t count, const double * times, const double * inputs,
  cueing_state * state,
  stewart_motion * motions);

/* Specific forces and angular velocities (count, 6) at a head of the platform, platform axes. */
void felt_many(
  const double * head, int64_t count, const stewart_motion * motions, double * felt);

/* Inverse dynamics; without `conditioned` the condition numbers, half of the work, are zero. Rows of
   results (count, width) have the first numbers of stewart_result. */
void solve_many(
  const stewart_platform * platform, int64_t count, const stewart_motion * motions,
  int64_t n_wrenches, const double * wrenches, int64_t n_bases, const stewart_base * bases,
  int64_t conditioned, int64_t width, double * results);

/* One sample: results; accelerations into the motion; the wrench on the base. They return whether
   all is finite and, of the first, J_inv can be solved. The last returns a code. */
int64_t solve_one(const stewart_platform * platform, one_motion * sample);
int64_t forward_dynamics_one(const stewart_platform * platform, one_motion * sample);
int64_t base_wrench_one(const stewart_platform * platform, one_motion * sample);
int64_t forward_kinematics_one(const stewart_platform * platform, one_pose * sample);

/* The kind of processor for which solve_many computes: 0 baseline, 1 AVX2, 2 AVX-512. */
int64_t processor_kind(void);

/* Outputs of setpoints: results, then all else that does not depend on earlier setpoints. Then the
   steps, in order, and what is to be published; returns how many are answered. Unless outputs are
   `solved`, they are computed first. */
void complete_outputs(
  const stewart_platform * platform, int64_t count, const setpoint * setpoints,
  stewart_output * outputs);
void solve_setpoints(
  const stewart_platform * platform, int64_t count, const setpoint * setpoints,
  stewart_output * outputs);
int64_t step_setpoints(
  const stewart_platform * platform, int64_t solved, int64_t count, const int64_t * stamps,
  const setpoint * setpoints, stewart_state * state, stewart_output * outputs);

/* A part of a message: its place, the first column of a row, and how many numbers; with none the
   byte there says whether the column is above zero. */
typedef struct { int64_t at, column, count; } message_part;

/* A message is for rows where a column is not nan, another is nan, another is above zero; -1: any. */
typedef struct { int64_t known, unknown, positive; } message_condition;

/* Types of messages that are a header and numbers: PoseStamped; TwistStamped, AccelStamped and
   WrenchStamped; Imu; MultiDOFJointTrajectory of one point and one joint. */
enum { MESSAGE_POSE = 0, MESSAGE_TWIST = 1, MESSAGE_IMU = 2, MESSAGE_COMBINED = 3 };

/* Why bytes are no message of a type; most come with the number that breaks a rule. */
enum {
  FAULT_NONE = 0, FAULT_ENCAPSULATION = 1, FAULT_ENDS = 2, FAULT_NANOSECONDS = 3, FAULT_TEXT = 4,
  FAULT_SEQUENCE = 5, FAULT_ENTRIES = 6, FAULT_NAMES = 7, FAULT_POINTS = 8, FAULT_TRANSFORMS = 9,
  FAULT_VELOCITIES = 10, FAULT_ACCELERATIONS = 11, FAULT_SHORTER = 12
};

/* What a message has beside its numbers: stamp [ns], length of frame_id, which begins at byte 16, and
   where the numbers are. */
typedef struct { int64_t stamp, fault, number, frame_size, places[3]; } message_content;

void read_message(
  int64_t type, int64_t size, const uint8_t * data, message_content * content, double * numbers);

/* Why a message or sample is not used, or what the log is told. */
enum {
  EVENT_NONE = 0, EVENT_TWICE = 1, EVENT_TOO_OLD = 2, EVENT_NOT_JOINED = 3,
  EVENT_UNSTAMPED_DROPPED = 4, EVENT_ENDED = 5, EVENT_BEFORE_RESTART = 6, EVENT_RESTART = 7,
  EVENT_NOTICE_UNSTAMPED = 8, EVENT_MALFORMED = 9, EVENT_WRONG_FRAME = 10, EVENT_NOT_MEASURED = 11,
  EVENT_NOT_FINITE = 12, EVENT_OUT_OF_RANGE = 13, EVENT_NOT_UNIT = 14
};

/* A topic: type of its messages, bound of their numbers, and the frame_id that they must have, if it
   is not empty; frame_size -1: that of the first valid message that has one. Of longer ones the
   first FRAME_ROOM characters and the length are compared. */
enum { FRAME_ROOM = 256 };
typedef struct { double largest; int64_t type, frame_size; uint8_t frame[256]; } input_topic;

/* Samples of messages (count,) of a topic, each at its place in the data: stamps (count,) [ns] and
   values (count, width), quaternions as rotations, of an IMU angular velocity and specific force.
   Events (count,): EVENT_NONE where the message is valid. */
void read_samples(
  input_topic * topic, int64_t width, int64_t count, const uint8_t * data, const int64_t * starts,
  const int64_t * sizes, int64_t * stamps, double * values, int64_t * events);

/* A JointState: whether it can be used, its stamp [ns], how many of the joints and which it has (bits),
   numbers of its names, positions, velocities and efforts, which of the wanted fields are empty
   or not as long as the names (bits), where the names begin. */
enum {
  JOINTS_VALID = 0, JOINTS_NOT_FINITE = 1, JOINTS_MALFORMED = 2, JOINTS_MISSING = 3,
  JOINTS_LACKING = 4, JOINTS_UNEVEN = 5
};
typedef struct {
  int64_t state, stamp, fault, number, n_joints, there, counts[4], lacking, uneven, names_at;
} joint_state;

/* States of messages (count,) of the joints whose names, one after the other, have these ends, and
   their values (count, width): of all joints in one wanted field, then in the next; nan where a
   message lacks a joint. wanted (3,): position, velocity, effort. More than half of the joints must
   be there, or at most half of them, a part. */
enum { MOST_JOINTS = 32, MOST_ENTRIES = 1000 };
void read_joint_states(
  int64_t n_joints, const uint8_t * names, const int64_t * ends, const uint8_t * wanted,
  int64_t width, int64_t count, const uint8_t * data, const int64_t * starts,
  const int64_t * sizes, joint_state * states, double * values);

/* How a stamp follows the last used one, if one is known: a stamp that is earlier by more than the
   timeout is a restart [ns]. */
enum { STAMP_FRESH = 0, STAMP_RESTART = 1, STAMP_TWICE = 2, STAMP_TOO_OLD = 3 };
int64_t stamp_order(int64_t stamp, int64_t known, int64_t last, int64_t timeout);

/* What the motion of the base is computed from: a pose at rest, a pose that moves, an IMU. */
enum { BASE_AT_REST = 1, BASE_MOVING = 2, BASE_BY_IMU = 3 };

/* An event: of a topic, with stamps [ns], and the index of its message. */
typedef struct { int64_t kind, topic, stamp, last, message; } input_event;

/* Why a call returns: all messages are used; the next one has no stamp and needs the clock; events
   have no room. */
enum { JOIN_DONE = 0, JOIN_CLOCK = 1, JOIN_EVENTS = 2 };
/* Number of messages, index of the next one; numbers of setpoints, of samples of the base and of events so far; why
   the call returns; whether the times are those of a clock; whether setpoints are not answered. */
typedef struct {
  int64_t count, next, setpoints, bases, events, status, timed, held;
} join_progress;

/* The stream of messages on the topics of setpoints (0, 1, 2), of the base (3, 4, 5) and of the load
   (6), joined by stamp: see joining.c; of a topic MOST_WAITING samples may wait. topics (7,): they
   stay where they are. widths (6,): numbers of a sample, 0: no such topic; tolerance and timeouts
   [ns]; source and gravity of the base, world axes. */
enum { MOST_WAITING = 1000 };
int64_t input_stream_size(void);
void begin_stream(
  uint8_t * memory, input_topic * topics, const int64_t * widths, int64_t tolerance,
  int64_t timeout, int64_t base_timeout, int64_t source, const double * gravity,
  const imu_mounting * imu);

/* The platform that answers setpoints, the state of its step, and the messages of an answer, as for
   write_messages: the arrays stay where they are. */
void put_answers(
  uint8_t * memory, const stewart_platform * platform, stewart_state * state,
  const stewart_platform * servos, int64_t size, const uint8_t * message, int64_t n_stamps, const int64_t * stamp_places,
  int64_t n_parts, const message_part * parts, int64_t n_kinds,
  const message_condition * conditions);

/* Memory of messages and what they complete, which stays where it is. Messages: their topics, -1: not
   used, times of recording [ns], places in the data. Setpoints: their stamps [ns] and the index of
   the message that completed each; samples of the base: their stamps, motions, numbers and whether
   time jumped back; outputs and messages of answers: needed after put_answers. */
void put_memory(
  uint8_t * memory, const int64_t * topics, const int64_t * times, const int64_t * starts,
  const int64_t * sizes, const uint8_t * data, int64_t * stamps, setpoint * setpoints,
  int64_t * places, int64_t * base_stamps, stewart_base * bases, double * base_values,
  double * base_restarts, stewart_output * outputs, uint8_t * messages, uint8_t * having,
  int64_t event_room, input_event * events, join_progress * progress);

/* Other bytes of messages, which stay where they are. */
void put_data(uint8_t * memory, const uint8_t * data);

/* Join the messages in memory from progress->next on, and answer the setpoints that they complete.
   Answer the setpoints in memory. */
void join_messages(uint8_t * memory);
void answer_setpoints(uint8_t * memory);

/* Drop what waits of a group, setpoints (0) or base (1); with `restart`, samples of any time follow,
   and the next setpoint is a restart. */
void end_stream(uint8_t * memory, int64_t group, int64_t restart);

/* The motion of the base at a stamp, nan if unknown. The last one; returns whether there is one. */
void base_at(const uint8_t * memory, int64_t stamp, stewart_base * base);
int64_t last_base(const uint8_t * memory, int64_t * stamp, stewart_base * base);

/* The last load on the platform (6,) [N, N m]. */
void last_wrench(const uint8_t * memory, double * wrench);

/* Messages (count, size), all kinds side by side: copies of one row of them, with stamps (count,)
   [ns] at some places and numbers of rows (count, width) at others; which kinds (count, n_kinds) a
   row has. With servos rows are outputs, and six columns behind them their pulse widths. */
void write_messages(
  const stewart_platform * servos, int64_t size, const uint8_t * message, int64_t n_stamps,
  const int64_t * stamp_places, int64_t n_parts, const message_part * parts, int64_t n_kinds,
  const message_condition * conditions, int64_t width, int64_t count, const int64_t * stamps,
  const double * rows, uint8_t * messages, uint8_t * having);

/* Positions of the drives (count, 6) in poses: leg lengths [m] or angles of cranks [rad], nan where
   a rod does not reach. */
void positions_many(
  const stewart_platform * platform, int64_t count, const stewart_pose * poses,
  double * positions);

/* Pulse widths (count, 6) [s] of servos at positions of the drives (count, 6), nan where the code is
   not STEWART_OK: see stewart_servo_pulses. */
void servo_pulses_many(
  const stewart_platform * platform, int64_t count, const double * positions, double * pulses,
  int64_t * codes);

/* Distances (count, 6) by which legs miss the platform joints of poses [m]; 0: they reach them. */
void missing_many(
  const stewart_platform * platform, int64_t count, const stewart_pose * poses,
  double * distances);

/* Squares of the levers by their largest values, and their rates [1/s], both (count, 6): smooth at
   dead centres, and negative where a leg does not reach. */
void lever_squares_many(
  const stewart_platform * platform, int64_t count, const stewart_motion * motions,
  double * values, double * rates);

/* Poses of positions of the drives (count, 6) into motions, which have the guesses. */
void forward_kinematics_many(
  const stewart_platform * platform, int64_t count, const double * positions,
  stewart_motion * motions, int64_t * codes, int64_t * steps, double * residuals);

/* Twists of rates of the drives (count, 6) into motions. */
void twists_many(
  const stewart_platform * platform, int64_t count, const double * rates,
  stewart_motion * motions);

/* Accelerations under efforts of the drives (count, 6) into motions. */
void forward_dynamics_many(
  const stewart_platform * platform, int64_t count, stewart_motion * motions,
  const double * efforts, int64_t n_wrenches, const double * wrenches, int64_t n_bases,
  const stewart_base * bases);

/* Wrenches of the hexapod on its base, at its origin, base axes (count, 6) [N, N m]. */
void base_wrenches_many(
  const stewart_platform * platform, int64_t count, const stewart_motion * motions,
  int64_t n_wrenches, const double * wrenches, int64_t n_bases, const stewart_base * bases,
  double * results);

/* Regressors (count, 6, columns): see dynamics/regressor.py. */
void regressors_many(
  const stewart_platform * platform, int64_t count, const stewart_motion * motions,
  int64_t n_bases, const stewart_base * bases, double * results);

/* Angles (count, 12) between legs and axes of base and platform joints [rad]. */
void joint_angles_many(
  const stewart_platform * platform, int64_t count, const stewart_motion * motions,
  double * angles);

/* sin^2(angle / 2) of the same, and its rate [1/s]; nan where numbers overflow. */
void joint_haversines_many(
  const stewart_platform * platform, int64_t count, const stewart_motion * motions,
  double * values, double * rates);

/* Clearance of each leg (count, 6) [m] from the nearest leg or plate; number of the leg, 6 for the
   plate of the base, 7 of the platform. */
void clearances_many(
  const stewart_platform * platform, int64_t count, const stewart_motion * motions,
  double * clearances, int64_t * nearest);

/* Friction (count, 6) at rates (count, 6) [N]; coefficients of each leg (6,). */
void friction_many(
  const double * viscous, const double * coulomb, const double * coulomb_velocity, int64_t count,
  const double * rates, double * forces);

/* Temperature rises (count, 6) [K] of windings with copper heat (count, 6) [W]; the first row of
   them is given. */
void warm_many(
  int64_t count, const double * times, const double * heat, const double * resistance,
  const double * time_constant, double * rises);

/* Forces (count, 6) of drives without losses, whose motors have the torques of forces with them, at
   rates and accelerations of the drives. */
void without_losses_many(
  const stewart_platform * platform, int64_t count, const double * forces, const double * rates,
  const double * accelerations, double * loads);

/* Angles alpha, beta, gamma (count, 3) [rad] of rotations (count, 9), row by row. */
void euler_angles_many(int64_t count, const double * rotations, double * angles);

/* Motors of motions, for demanded and published efforts of the drives (count, 6). */
void motors_many(
  const stewart_platform * platform, int64_t count, const stewart_motion * motions,
  const double * demanded, const double * published, stewart_motors * rows);

/* External wrenches (count, 6) of efforts of the model and measured ones (count, 6), in poses. */
void external_wrenches_many(
  const stewart_platform * platform, int64_t count, const stewart_pose * poses,
  const double * model_efforts, const double * measured_efforts, double * wrenches);
void estimate_one(const stewart_platform * platform, one_measurement * measurement);

/* A period of the simulated hexapod; without steps, its state as it is. */
void plant_advance(const stewart_platform * platform, one_plant * plant);

/* The records of an MCAP file: see bags/mcap_file.py. found is (4, room). */
void scan_records(
  int64_t size, const uint8_t * data, const int64_t * numbers, int64_t room, int64_t * found,
  int64_t * totals);

/* Records of messages of a channel, at places (count,) of the content of a chunk, and their entries
   (count, 2) of its index: recorded and published at times (count,) [ns], each message of a size
   (count,) from its start (count,) in the data. */
void write_records(
  int64_t count, int64_t channel, const int64_t * times, const int64_t * starts,
  const int64_t * sizes, const uint8_t * data, const int64_t * places, uint8_t * content,
  int64_t * entries);

/* Many hexapods: hexapod h has platforms[which[h]]. The strides of an array follow it, in numbers:
   from hexapod to hexapod, from sample to sample, and between the numbers of a sample; 0: one for
   all. A base of nan is still. Each is a kernel where NVRTC compiles hexapods.c. */
#ifndef STEWART_KERNEL
#define STEWART_KERNEL
#endif

/* Inverse dynamics: see solve_many. */
STEWART_KERNEL void hexapods_solve(
  const stewart_platform * platforms, const int64_t * which, int64_t hexapods, int64_t samples,
  int64_t conditioned, int64_t width,
  const double * motions, int64_t motions_h, int64_t motions_s, int64_t motions_n,
  const double * wrenches, int64_t wrenches_h, int64_t wrenches_s, int64_t wrenches_n,
  const double * bases, int64_t bases_h, int64_t bases_s, int64_t bases_n,
  double * results, int64_t results_h, int64_t results_s, int64_t results_n);

/* Limits that each leg (6) exceeds, bits as in stewart_output, of poses, twists, loads and motors;
   -1: numbers overflow, or a leg does not reach. */
STEWART_KERNEL void hexapods_limits(
  const stewart_platform * platforms, const int64_t * which, int64_t hexapods, int64_t samples,
  const double * motions, int64_t motions_h, int64_t motions_s, int64_t motions_n,
  const double * wrenches, int64_t wrenches_h, int64_t wrenches_s, int64_t wrenches_n,
  const double * bases, int64_t bases_h, int64_t bases_s, int64_t bases_n,
  int64_t * exceeded, int64_t exceeded_h, int64_t exceeded_s, int64_t exceeded_n);

/* Accelerations (6), linear and angular, under efforts of the drives. */
STEWART_KERNEL void hexapods_accelerate(
  const stewart_platform * platforms, const int64_t * which, int64_t hexapods, int64_t samples,
  const double * motions, int64_t motions_h, int64_t motions_s, int64_t motions_n,
  const double * efforts, int64_t efforts_h, int64_t efforts_s, int64_t efforts_n,
  const double * wrenches, int64_t wrenches_h, int64_t wrenches_s, int64_t wrenches_n,
  const double * bases, int64_t bases_h, int64_t bases_s, int64_t bases_n,
  double * accelerations, int64_t accelerations_h, int64_t accelerations_s,
  int64_t accelerations_n);

/* Positions of the drives in poses; nan where a rod does not reach. */
STEWART_KERNEL void hexapods_positions(
  const stewart_platform * platforms, const int64_t * which, int64_t hexapods, int64_t samples,
  const double * poses, int64_t poses_h, int64_t poses_s, int64_t poses_n,
  double * positions, int64_t positions_h, int64_t positions_s, int64_t positions_n);

/* Poses of positions of the drives, from the guesses that they have; codes, one for each. */
STEWART_KERNEL void hexapods_poses(
  const stewart_platform * platforms, const int64_t * which, int64_t hexapods, int64_t samples,
  const double * positions, int64_t positions_h, int64_t positions_s, int64_t positions_n,
  double * poses, int64_t poses_h, int64_t poses_s, int64_t poses_n,
  int64_t * codes, int64_t codes_h, int64_t codes_s);

/* A period of the simulated hexapods that are chosen and sound: `steps` of a length [s], under
   constant commands, wrenches and bases. States: plant_state. Legs: the numbers of one_plant from
   the positions on. Motors (18): angles, speeds, torques. */
STEWART_KERNEL void hexapods_step(
  const stewart_platform * platforms, const plant_constants * constants, const int64_t * which,
  int64_t hexapods, double steps, double step, const uint8_t * chosen,
  const double * commands, int64_t commands_h, int64_t commands_n,
  const double * wrenches, int64_t wrenches_h, int64_t wrenches_n,
  const double * bases, int64_t bases_h, int64_t bases_n,
  double * states, int64_t states_h, int64_t states_n,
  double * legs, int64_t legs_h, int64_t legs_n,
  double * motors, int64_t motors_h, int64_t motors_n);

/* Complete and check hexapods (count,), then add their payloads (count, 10), or one for all: mass,
   center of mass, inertia. Codes: of the first rule that is broken; negative: of
   stewart_add_payload. Places: see stewart_check. */
void complete_hexapods(
  int64_t count, stewart_platform * platforms, int64_t n_payloads, const double * payloads,
  int64_t * codes, int64_t * places);

#endif
