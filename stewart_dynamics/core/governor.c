/* SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * The governor: the next state of a motion that follows a demand, from which a stop within all
 * limits exists. Method and equations: mechanics/governor.py.
 */

#include <string.h>

#define STOP_SAMPLES 16    /* of a stop, at which rates and loads are checked */
#define SAMPLES_AT_ONCE 8
#define STOP_POSES 48      /* most poses of a stop that are checked for a limit */
#define SHORTEST_PART 0.004 /* of a stop between two of them, times its rate */
#define CERTAIN 0.5        /* share of the largest condition number below which a bound will do */
#define MARGINS 1.6        /* between two of them: of both, less a quarter, by which legs shorten */
#define HALVINGS 5         /* of the share of the demand */
#define RECOVERY 0.25      /* time in which a share grows from 0 to 1 [s] */
#define SETTLED 1e-12      /* a smaller deviation from the demand is none [m, rad; times rates] */
#define LONGEST_STEP 0.01  /* a longer one is divided [s] */
#define CURVATURE 0.1      /* accelerations between two setpoints exceed both by this share */
#define NEGLIGIBLE 1e-10   /* difference between setpoints [m, rad] */
#define LARGEST 1e9        /* coordinate of a demand, or derivative of it, that is followed */
/* Margins: of positions of drives a part of the stroke; of forces, torques and the condition
   number, which change fastest between two samples, and of the other limits, parts of themselves.
   That of the clearance, and of lengths without a stroke, is a part of the characteristic length.
   */
#define OF_STROKE 0.005
#define OF_LOADS 0.03
#define OF_OTHERS 0.02
#define OF_SIZE 0.003
/* A stop from the largest rate of the drives needs this part of the stroke, where its rate is
   between two bounds [1/s]; the third is the rate without these limits. */
#define STOP_IN 0.15
#define SLOWEST_STOP 5.0
#define FASTEST_STOP 50.0
#define USUAL_STOP 10.0
#define RETURN_RATE 2.0    /* with which the deviation from the demand vanishes [1/s] */

/* Times of the samples of a stop, times its rate, first those that find most. The rate that the
   present acceleration leads to peaks at 1 to 1.3, with the curvature k^2: samples 0.18 apart miss
   0.4 % of it, and the turning of the legs some more. */
static const double stop_times[STOP_SAMPLES] = {
  0.0, 0.25, 0.6, 0.95, 1.3, 1.9, 3.2, HUGE_VAL, 0.12, 0.42, 0.77, 1.12, 1.5, 1.7, 2.4, 4.5};

/* Their places in the order of time. */
static const int in_order[STOP_SAMPLES] = {
  0, 8, 1, 9, 2, 10, 3, 11, 4, 12, 13, 5, 14, 6, 15, 7};

/* The samples of a stop from a state. */
typedef struct {
  const coordinates * from;
  stewart_motion motions[STOP_SAMPLES];
  stewart_result results[STOP_SAMPLES];  /* without condition numbers */
} stop_samples;

/* An interval between two samples of a stop has more of them, at most so many in all, where the
   square of a lever may fall by a part of itself below both, or changes by a factor of 2. */
#define DIP 0.02
#define MOST_BETWEEN 64

/* Limits of poses, each of which is checked at poses of its own. */
enum { DRIVES, ANGLES, CLEARANCES, SINGULARITIES, KINDS };

/* Lengths and levers of the lines of force [m], and by how much a limit of one kind is not
   exceeded: displacement of the platform joint before that of a drive is, clearances [m], angles of
   the joints [rad]; or the condition number, or more. */
typedef struct { double lengths[6], levers[6], room[12], condition; } pose_room;

/* Bounds of velocity and acceleration in an interval: of the head [m/s, m/s^2], and of a point by
   its distance from the head [1/s, 1/s^2]. */
typedef struct { double velocity, acceleration, turning, turning_rate; } motion_bounds;

/* Of a kind of legs, for the governor:
   margins: give the limits of the drive their margins; returns that of a displacement [m].
   stop_rate: the largest rate of the drive by its stroke [1/s], nan where they are not limited.
   put_room: write room of the drive in a pose, and return the limits that it exceeds.
   moved: of a displacement of the platform joint and the length of its path, the one that counts.
   turn: the most that the line of force turns while the joint moves so far; or infinite.
   levers_change: whether the levers depend on the pose.
   pieces: of an interval of a time between two samples with levers; arm: of the platform joint.
   unproven: the limit that is named where the check of a stop does not end. */
#ifndef STEWART_LIBRARY
#define STEWART_LIBRARY
#endif
#define STEWART_GOVERNOR
#include "telescopic.h"
#include "crank.h"
#undef STEWART_GOVERNOR

static double put_drive_margins(
  const stewart_platform * platform, stewart_leg * leg) {
  double size = platform->characteristic_length;
  switch (platform->leg_kind) {
    default: STEWART_LEG_KINDS(RETURN, margins, (size, leg))
  }
}

static double leg_stop_rate(const stewart_platform * platform, int i) {
  switch (platform->leg_kind) {
    default: STEWART_LEG_KINDS(RETURN, stop_rate, (&platform->legs[i]))
  }
}

static unsigned put_drive_room(
  const stewart_platform * platform, int i, double margin, const stewart_motion * motion,
  pose_room * to) {
  switch (platform->leg_kind) {
    default: STEWART_LEG_KINDS(RETURN, put_room, (
      &platform->legs[i], margin, motion, to->lengths[i], &to->room[i]))
  }
}

static double moved_of(const stewart_platform * platform, double way, double path) {
  switch (platform->leg_kind) {
    default: STEWART_LEG_KINDS(RETURN, moved, (way, path))
  }
}

static double turn_of(
  const stewart_platform * platform, int i, double margin, const pose_room * from, double moved) {
  switch (platform->leg_kind) {
    default: STEWART_LEG_KINDS(RETURN, turn, (
      &platform->legs[i], margin, from->lengths[i], from->levers[i], moved))
  }
}

static double pieces_of(
  const stewart_platform * platform, int i, double lever, double next_lever,
  const motion_bounds * most, double arm, double time) {
  switch (platform->leg_kind) {
    default: STEWART_LEG_KINDS(RETURN, pieces, (
      &platform->legs[i], lever, next_lever, most, arm, time))
  }
}

static int levers_change(const stewart_platform * platform) {
  switch (platform->leg_kind) {
    default: STEWART_LEG_KINDS(RETURN, levers_change, ())
  }
}

static unsigned unproven_limit(const stewart_platform * platform) {
  switch (platform->leg_kind) {
    default: STEWART_LEG_KINDS(RETURN, unproven, ())
  }
}

/* ---- the limits that are kept --------------------------------------------------------------- */

/* The torque of a curve at a speed, as numpy.interp has it. */
static double interpolate(int count, const double (* curve)[2], double speed) {
  for (int n = 0; n < count; n++) {
    const double * b = curve[n], * a = n > 0 ? curve[n - 1] : b;
    if (speed < b[0] && n > 0) {
      return speed == a[0] ? a[1] : (b[1] - a[1]) / (b[0] - a[0]) * (speed - a[0]) + a[1];
    }
    if (speed < b[0]) {return b[1];}
  }
  return curve[count - 1][1];
}

/* Write the lowest torques of a torque-speed curve, margins of speed around. */
static void put_lowest_nearby(const stewart_platform * platform, stewart_platform * within) {
  const double near[2] = {1.0 - OF_OTHERS, 1.0 / (1.0 - OF_OTHERS)};
  const double (* curve)[2] = platform->torque_speed;
  double (* lowest)[2] = within->torque_speed;
  int count = platform->n_torque_speed, found = 0;
  int most = (int)(sizeof within->torque_speed / sizeof within->torque_speed[0]);
  for (int n = 0; n < 3 * count; n++) {
    double part = n < count ? 1.0 : near[n / count - 1], speed = curve[n % count][0] * part;
    int place = 0;
    while (place < found && lowest[place][0] < speed) {place++;}
    if (!(speed <= near[0] * curve[count - 1][0]) || found == most ||
        (place < found && lowest[place][0] == speed)) {continue;}
    memmove(lowest[place + 1], lowest[place], (size_t)(found - place) * sizeof lowest[0]);
    lowest[place][0] = speed, found++;
  }
  for (int n = 0; n < found; n++) {
    double low = lowest[n][0] * near[0], high = lowest[n][0] * near[1];
    double torque = least(interpolate(count, curve, low), interpolate(count, curve, high));
    for (int k = 0; k < count; k++) {
      if (low < curve[k][0] && curve[k][0] < high) {torque = least(torque, curve[k][1]);}
    }
    lowest[n][1] = torque * (1.0 - OF_LOADS);
  }
  within->n_torque_speed = found;
}

/* Give the limits of a leg their margins. */
static void put_margins(
  const stewart_platform * platform, int i, stewart_leg * leg, governor_limits * limits) {
  int count = platform->n_torque_speed;
  limits->base_angle_margin[i] =
    isinf(leg->base_joint_angle_max) ? 0.0 : OF_OTHERS * leg->base_joint_angle_max;
  limits->platform_angle_margin[i] =
    isinf(leg->platform_joint_angle_max) ? 0.0 : OF_OTHERS * leg->platform_joint_angle_max;
#define BOUND(bit, NAME, field, DEPENDS, quantity)
#define MAGNITUDE(bit, NAME, field, DEPENDS, quantity) \
  leg->field *= DEPENDS == LOAD ? 1.0 - OF_LOADS : DEPENDS == TWIST ? 1.0 - OF_OTHERS : 1.0;
  STEWART_LIMITS(BOUND, BOUND, MAGNITUDE)
#undef BOUND
#undef MAGNITUDE
  leg->base_joint_angle_max -= limits->base_angle_margin[i];
  leg->platform_joint_angle_max -= limits->platform_angle_margin[i];
  leg->torque_max *= 1.0 - OF_LOADS;
  /* There is no torque beyond the torque-speed curve. */
  leg->speed_max = (1.0 - OF_OTHERS) * least(
    leg->speed_max, count > 0 ? platform->torque_speed[count - 1][0] : HUGE_VAL);
  limits->drive_margin[i] = put_drive_margins(platform, leg);
  /* Friction changes its sign where a leg reverses between two samples. */
  double change = 2.0 * leg->coulomb_friction;
  limits->friction_torque[i] = platform->with_motors
    ? change / leg->motor_ratio * largest(1.0 / leg->efficiency, 1.0) : 0.0;
  leg->loss_velocity = HUGE_VAL;  /* breakaway torques at any rate, as if it could reverse */
}

/* The rate of a stop [1/s]. */
static double stop_rate_of(const stewart_platform * platform) {
  double rate = 0.0;
  for (int i = 0; i < 6; i++) {
    double of_leg = leg_stop_rate(platform, i);
    if (isnan(of_leg)) {return USUAL_STOP;}
    rate = largest(rate, of_leg);
  }
  return least(largest(2.0 * rate / STOP_IN, SLOWEST_STOP), FASTEST_STOP);
}

void put_governor(
  const stewart_platform * platform, const stewart_pose * home, const double * head,
  stewart_platform * within, governor_limits * limits) {
  stewart_motion at_home;
  stewart_result result;
  memset(&at_home, 0, sizeof at_home), memset(limits, 0, sizeof *limits);
  memcpy(&at_home, home, sizeof *home);
  *within = *platform;
  limits->home = *home;
  put3(limits->head, read3(head));
  limits->stop_rate = stop_rate_of(platform), limits->return_rate = RETURN_RATE;
  limits->stop_condition = least(platform->stop_condition, UNSOLVABLE_CONDITION);
  limits->condition_max = (1.0 - OF_LOADS) * limits->stop_condition;
  limits->clearance_margin = OF_SIZE * platform->characteristic_length;
  within->leg_clearance_min += limits->clearance_margin;
  for (int i = 0; i < 6; i++) {
    vector joint = read3(platform->legs[i].platform_joint);
    limits->arms[i] = norm(subtract(joint, read3(head))), limits->radii[i] = norm(joint);
    limits->reach = largest(limits->reach, limits->arms[i]);
    put_margins(platform, i, &within->legs[i], limits);
  }
  for (int n = 0; platform->with_clearance && n < platform->n_platform_outline; n++) {
    vector corner = read3(platform->platform_outline[n]);
    limits->reach = largest(limits->reach, norm(subtract(corner, read3(head))));
  }
  if (platform->n_torque_speed > 0) {put_lowest_nearby(platform, within);}
  solve_unloaded(within, 1, &at_home, &result);
  limits->side = copysign(1.0, result.determinant);
}

/* ---- motions and coordinates ---------------------------------------------------------------- */

/* A hexapod whose limits have the margins of a governor, and what else that keeps. */
typedef struct {
  const stewart_platform * platform;
  const governor_limits * limits;
} governed;

/* The state after a time of the stop v'' + 2 k v' + k^2 v = 0 from a state. */
static coordinates stopped(const coordinates * from, double k, double time) {
  coordinates to;
  double kt = k * time, left = exp(-kt), gone = isinf(kt) ? 0.0 : kt * left;
  for (int i = 0; i < 6; i++) {
    double v = from->rate[i], b = from->acceleration[i] + k * v;
    to.value[i] = from->value[i] + v * (1.0 - left) / k + b * (1.0 - left - gone) / (k * k);
    to.rate[i] = v * left + b * gone / k;
    to.acceleration[i] = from->acceleration[i] * left - b * gone;
  }
  return to;
}

/* The state after a time of the return e''' + 3 k e'' + 3 k^2 e' + k^3 e = 0 to zero. */
static coordinates rerotate(const coordinates * from, double k, double time) {
  coordinates to;
  double left = exp(-k * time);
  for (int i = 0; i < 6; i++) {
    /* e = (c0 + c1 t + c2 t^2 / 2) exp(-k t) */
    double c0 = from->value[i], c1 = from->rate[i] + k * c0;
    double c2 = from->acceleration[i] + 2.0 * k * c1 - k * k * c0;
    double p = c0 + time * (c1 + 0.5 * time * c2), q = c1 + time * c2;
    to.value[i] = left * p;
    to.rate[i] = left * (q - k * p);
    to.acceleration[i] = left * (c2 - 2.0 * k * q + k * k * p);
  }
  return to;
}

/* The motion of the platform in the base frame at coordinates: displacement of the head and
   angles of R = Rz Ry Rx, both from home and in its axes. */
static void put_motion(
  const governor_limits * g, const coordinates * at, stewart_motion * motion) {
  double sa = sin(at->value[3]), ca = cos(at->value[3]);
  double sb = sin(at->value[4]), cb = cos(at->value[4]);
  double sc = sin(at->value[5]), cc = cos(at->value[5]);
  double da = at->rate[3], db = at->rate[4], dc = at->rate[5];
  double dda = at->acceleration[3], ddb = at->acceleration[4], ddc = at->acceleration[5];
  double r[9] = {
    cc * cb, cc * sb * sa - sc * ca, cc * sb * ca + sc * sa,
    sc * cb, sc * sb * sa + cc * ca, sc * sb * ca - cc * sa,
    -sb, cb * sa, cb * ca};
  /* w = E angles', w' = E angles'' + E' angles' */
  vector w = {cc * cb * da - sc * db, sc * cb * da + cc * db, dc - sb * da};
  vector wd = {
    cc * cb * dda - sc * ddb - (sc * cb * dc + cc * sb * db) * da - cc * dc * db,
    sc * cb * dda + cc * ddb + (cc * cb * dc - sc * sb * db) * da - sc * dc * db,
    ddc - sb * dda - cb * db * da};
  const double * home = g->home.rotation;
  vector head = read3(g->head), arm = rotate(r, head), turning = cross(w, arm);
  put3(motion->position, add(read3(g->home.position), rotate(
    home, add(head, subtract(read3(at->value), arm)))));
  put3(motion->linear_velocity, rotate(home, subtract(read3(at->rate), turning)));
  put3(motion->linear_acceleration, rotate(home, subtract(
    read3(at->acceleration), add(cross(wd, arm), cross(w, turning)))));
  put3(motion->angular_velocity, rotate(home, w));
  put3(motion->angular_acceleration, rotate(home, wd));
  for (int i = 0; i < 3; i++) {
    for (int j = 0; j < 3; j++) {
      motion->rotation[3 * i + j] =
        home[3 * i] * r[j] + home[3 * i + 1] * r[3 + j] + home[3 * i + 2] * r[6 + j];
    }
  }
}

/* The rates of the angles of a rotation that turns with w: E^-1 w. */
static vector euler_rates(const double angles[3], vector w) {
  double cb = cos(angles[1]), sb = sin(angles[1]), cg = cos(angles[2]), sg = sin(angles[2]);
  double alpha_rate = (cg * w.x + sg * w.y) / cb;
  return make(alpha_rate, cg * w.y - sg * w.x, w.z + sb * alpha_rate);
}

void coordinates_of(
  const governor_limits * g, int64_t count, const stewart_motion * motions,
  coordinates * states) {
  const double * home = g->home.rotation;
  vector head = read3(g->head);
  for (int64_t n = 0; n < count; n++) {
    const stewart_motion * motion = &motions[n];
    coordinates * to = &states[n];
    double r[9];
    for (int k = 0; k < 9; k++) {
      r[k] = dot(column(home, k / 3), column(motion->rotation, k % 3));
    }
    vector velocity = rotate_back(home, read3(motion->linear_velocity));
    vector acceleration = rotate_back(home, read3(motion->linear_acceleration));
    vector w = rotate_back(home, read3(motion->angular_velocity));
    vector wd = rotate_back(home, read3(motion->angular_acceleration));
    vector arm = rotate(r, head), turning = cross(w, arm);
    vector way = rotate_back(home, subtract(read3(motion->position), read3(g->home.position)));
    double * angles = &to->value[3];
    angles[2] = atan2(r[3], r[0]);
    double cg = cos(angles[2]), sg = sin(angles[2]);
    angles[0] = atan2(sg * r[2] - cg * r[5], cg * r[4] - sg * r[1]);
    angles[1] = atan2(-r[6], hypot(r[0], r[3]));
    double cb = cos(angles[1]), sb = sin(angles[1]);
    vector rates = euler_rates(angles, w);
    double da = rates.x, db = rates.y, dc = rates.z;
    /* E' angles' */
    vector carried = {
      -(sg * cb * dc + cg * sb * db) * da - cg * dc * db,
      (cg * cb * dc - sg * sb * db) * da - sg * dc * db, -cb * db * da};
    put3(to->value, subtract(add(way, arm), head));
    put3(to->rate, add(velocity, turning)), put3(&to->rate[3], rates);
    put3(to->acceleration, add(add(acceleration, cross(wd, arm)), cross(w, turning)));
    put3(&to->acceleration[3], euler_rates(angles, subtract(wd, carried)));
  }
}

/* ---- what a state and the stop from it exceed ------------------------------------------------ */

/* The lowest of some bits, counted from 1; 0 if there is none. */
static int lowest(unsigned bits) {
  int bit = 1;
  while (bits && !(bits & 1u)) {bits >>= 1, bit++;}
  return bits ? bit : 0;
}

/* Write a bound of the condition number of a result, larger by up to the number of legs, where that
   is enough; else the condition number. Returns det(J). */
static double find_condition(
  const governed * on, const stewart_motion * motion, const stewart_result * known, double * to) {
  const stewart_platform * platform = on->platform;
  double enough = CERTAIN * on->limits->condition_max;
  leg_line at[6];
  double rows[6][6], inverse[6][6], of_rows = 6.0, of_inverse = 0.0;
  if (known && platform->legs[0].pitch == 0.0) {
    for (int i = 0; i < 6; i++) {
      double moment = on->limits->radii[i] / platform->characteristic_length;
      of_rows += moment * moment;
      of_inverse += known->unit_load_forces[i] * known->unit_load_forces[i];
    }
    *to = sqrt(of_rows * of_inverse);
    if (*to < enough) {return known->determinant;}
  }
  lines_at(platform, motion->position, motion->rotation, at);
  double determinant = scaled_jacobian(platform, at, rows, inverse);
  *to = CONDITION_OF(rows, inverse);
  return determinant;
}

/* Write the room of a pose; return the limit of a kind, counted from 1, that it exceeds, or 0.
   known: a result of it, or NULL. */
static int find_room(
  const governed * on, int kind, const stewart_motion * motion, const stewart_result * known,
  pose_room * to) {
  const governor_limits * g = on->limits;
  const stewart_leg * legs = on->platform->legs;
  unsigned exceeded = 0;
  for (int i = 0; i < 6; i++) {
    if (known) {
      to->lengths[i] = known->lengths[i], to->levers[i] = known->levers[i];
    } else {
      leg_line at = line_of(on->platform, i, motion->position, motion->rotation);
      to->lengths[i] = at.length, to->levers[i] = at.lever;
    }
  }
  if (kind == SINGULARITIES) {
    double determinant = find_condition(on, motion, known, &to->condition);
    return to->condition < g->condition_max && determinant * g->side > 0.0 ? 0
      : GOVERNED_SINGULARITY + 1;
  } else if (kind == DRIVES) {
    for (int i = 0; i < 6; i++) {
      exceeded |= put_drive_room(on->platform, i, g->drive_margin[i], motion, to);
    }
  } else if (kind == ANGLES) {
    double base_angles[6], angles[6];
    put_joint_angles(on->platform, motion, base_angles, angles);
    for (int i = 0; i < 6; i++) {
      double base = legs[i].base_joint_angle_max, moving = legs[i].platform_joint_angle_max;
      to->room[i] = isinf(base) ? HUGE_VAL : base - base_angles[i];  /* without it it is nan */
      to->room[i + 6] = isinf(moving) ? HUGE_VAL : moving - angles[i];
      exceeded |= above(base_angles[i], base, STEWART_BASE_JOINT_ANGLE_MAX) |
        above(angles[i], moving, STEWART_PLATFORM_JOINT_ANGLE_MAX);
    }
  } else {
    double clearances[6];
    int64_t nearest[6];
    put_clearances(on->platform, motion, clearances, nearest);
    for (int i = 0; i < 6; i++) {
      to->room[i] = clearances[i] - on->platform->leg_clearance_min;
      exceeded |= below(clearances[i], on->platform->leg_clearance_min, STEWART_LEG_CLEARANCE_MIN);
    }
  }
  return lowest(exceeded);
}

/* Largest displacement of the head, length of its path, and largest turn, from one state of a stop
   until a time. */
typedef struct { double way, path, turn; } displacement;

static displacement displace(const coordinates * from, double k, double time) {
  double kt = k * time, left = exp(-kt), gone = isinf(kt) ? 0.0 : kt * left;
  double of_rate = (1.0 - left) / k, of_change = (1.0 - left - gone) / (k * k), square = 0.0;
  double rates = 0.0, changes = 0.0;
  displacement to = {0.0, 0.0, 0.0};
  for (int i = 0; i < 6; i++) {
    double v = from->rate[i], b = from->acceleration[i] + k * v;
    double way = fabs(v) * of_rate + fabs(b) * of_change;
    if (i < 3) {
      square += way * way, rates += v * v, changes += b * b;
    } else {
      to.turn += way;
    }
  }
  to.way = sqrt(square), to.path = sqrt(rates) * of_rate + sqrt(changes) * of_change;
  return to;
}

/* Whether a displacement from a pose could exceed the limits of a kind by more than some of their
   margins.

   Each point of a leg whose platform joint moves by d moves by at most d, and distances between two
   of them change by no more than both move; its turn is that of its kind. Singular values of J
   change by no more than its rows do (Weyl), and the largest is at least 1. */
static int leaves(
  const governed * on, int kind, const pose_room * from, displacement by, double margins) {
  const governor_limits * g = on->limits;
  double farthest = by.way + by.turn * g->reach, square = 0.0;
  for (int i = 0; i < 6; i++) {
    double round = by.turn * g->arms[i];
    double d = moved_of(on->platform, by.way + round, by.path + round);
    double turn = turn_of(on->platform, i, g->drive_margin[i], from, d);
    if (!(turn < HUGE_VAL)) {return 1;}
    if (kind == DRIVES) {
      if (!(d <= from->room[i] + margins * g->drive_margin[i])) {return 1;}
    } else if (kind == ANGLES) {
      if (!(turn <= from->room[i] + margins * g->base_angle_margin[i]) ||
          !(turn + by.turn <= from->room[i + 6] + margins * g->platform_angle_margin[i])) {
        return 1;
      }
    } else if (kind == CLEARANCES) {
      /* A cylinder may end beyond the joint: where the piston begins for the plate of the base. */
      d *= largest(1.0, on->platform->legs[i].cylinder_length / from->lengths[i]);
      if (!(d + farthest <= from->room[i] + margins * g->clearance_margin)) {return 1;}
    } else {
      double moment = g->radii[i] * (by.turn + turn) / on->platform->characteristic_length;
      square += turn * turn + moment * moment;
    }
  }
  double change = sqrt(square), condition = from->condition;
  return kind == SINGULARITIES && !(condition * (1.0 + change) < (1.0 - condition * change) * (
    margins > 0.0 ? g->stop_condition : g->condition_max));
}

/* The limit of a kind, counted from 1, that a pose of a stop exceeds, 0 if none.

   Conservative advancement: from one pose to a later one that cannot be reached without passing
   poses that are surely within the limits. Both are within the margins, so that between them each
   pose is nearer than a margin to poses that one of them reaches. */
static int check_poses(const governed * on, int kind, const stop_samples * stop) {
  const int limits[KINDS] = {
    lowest(unproven_limit(on->platform)) - 1, 4, 6, GOVERNED_SINGULARITY};
  double k = on->limits->stop_rate, now = 0.0;  /* times its rate */
  int last = 0, between = 0;  /* sample before or at this time */
  for (int n = 0; n < STOP_POSES; n++) {
    coordinates at = stopped(stop->from, k, now / k);
    stewart_motion motion;
    pose_room room;
    if (between) {put_motion(on->limits, &at, &motion);}
    int limit = find_room(on, kind, between ? &motion : &stop->motions[in_order[last]],
                          between ? NULL : &stop->results[in_order[last]], &room);
    if (limit || isinf(now)) {return limit;}
    if (!leaves(on, kind, &room, displace(&at, k, HUGE_VAL), 0.0)) {return 0;}
    int next = STOP_SAMPLES - 1;
    double time = HUGE_VAL;
    while (leaves(on, kind, &room, displace(&at, k, (time - now) / k), MARGINS)) {
      if (next > last + 1) {
        next = (last + next) / 2, time = stop_times[in_order[next]];
      } else {
        next = last, time = 0.5 * (now + least(time, now + 4.0));
        if (time - now < SHORTEST_PART) {return limits[kind] + 1;}
      }
    }
    between = next == last, last = next, now = time;
  }
  return limits[kind] + 1;
}

/* The limit of rates and loads, counted from 1, that a motion exceeds, 0 if none. */
static int overloads(
  const governed * on, const stewart_motion * motion, const stewart_result * result) {
  stewart_output found;
  unsigned exceeded = 0;
  found.result = *result;
  complete_loads(on->platform, motion, 1, &found);
  for (int i = 0; i < 6; i++) {  /* before what is not a number where a leg does not reach */
    if (!(found.lever_ratios[i] >= 0.0)) {return lowest(STEWART_LEVER_MIN);}
  }
  if (on->platform->with_motors && found.finite_motors == 0.0) {return GOVERNED_SINGULARITY + 1;}
  for (int i = 0; i < 6; i++) {
    double * torque = &found.motors.breakaway_torques[i];
    *torque = fabs(*torque) + on->limits->friction_torque[i];
    exceeded |= check_leg(on->platform, &found, i);
  }
  return lowest(exceeded);
}

/* Bounds in a time after a state of a stop, whose velocity is (v + b t) exp(-k t). The angular
   velocity is at most the sum of the rates of the angles, and its rate the sum of theirs and the
   square of that. */
static motion_bounds bounds_after(const coordinates * at, double k, double time) {
  motion_bounds most = {0.0, 0.0, 0.0, 0.0};
  for (int i = 0; i < 6; i++) {
    double b = fabs(at->acceleration[i] + k * at->rate[i]);
    double v = fabs(at->rate[i]) + b * time, a = b + k * v;
    if (i < 3) {
      most.velocity += v * v, most.acceleration += a * a;
    } else {
      most.turning += v, most.turning_rate += a;
    }
  }
  most.velocity = sqrt(most.velocity), most.acceleration = sqrt(most.acceleration);
  most.turning_rate += 2.0 * most.turning * most.turning;
  return most;
}

/* Write times of a stop between its samples, where levers may change faster than rates do; returns
   how many, or a number below 0 if they are too many. Its poses are within the limits. */
static int put_times_between(const governed * on, const stop_samples * stop, double * times) {
  double k = on->limits->stop_rate;
  int count = 0;
  /* In the last interval, which has no end, the platform hardly moves. */
  for (int n = 0; n < STOP_SAMPLES - 2; n++) {
    const double * levers = stop->results[in_order[n]].levers;
    const double * next_levers = stop->results[in_order[n + 1]].levers;
    double begin = stop_times[in_order[n]], time = stop_times[in_order[n + 1]] - begin;
    double pieces = 1.0;
    coordinates at = stopped(stop->from, k, begin / k);
    motion_bounds most = bounds_after(&at, k, time / k);
    for (int i = 0; i < 6; i++) {
      pieces = largest(pieces, pieces_of(
        on->platform, i, levers[i], next_levers[i], &most, on->limits->arms[i], time / k));
    }
    if (!(count + pieces <= MOST_BETWEEN + 1.0)) {return -1;}
    for (int m = 1; m < (int)pieces; m++) {times[count++] = (begin + time * (m / pieces)) / k;}
  }
  return count;
}

/* The limit of rates and loads, counted from 1, that a stop exceeds between its samples, 0 if none.
   */
static int overloads_between(const governed * on, const stop_samples * stop) {
  double times[MOST_BETWEEN];
  stewart_motion motions[SAMPLES_AT_ONCE];
  stewart_result results[SAMPLES_AT_ONCE];
  int count = levers_change(on->platform) ? put_times_between(on, stop, times) : 0;
  if (count < 0) {return lowest(unproven_limit(on->platform));}
  for (int first = 0; first < count; first += SAMPLES_AT_ONCE) {
    int some = count - first < SAMPLES_AT_ONCE ? count - first : SAMPLES_AT_ONCE;
    for (int n = 0; n < some; n++) {
      coordinates at = stopped(stop->from, on->limits->stop_rate, times[first + n]);
      put_motion(on->limits, &at, &motions[n]);
    }
    solve_unloaded(on->platform, some, motions, results);
    for (int n = 0; n < some; n++) {
      int found = overloads(on, &motions[n], &results[n]);
      if (found) {return found;}
    }
  }
  return 0;
}

/* The limit, counted from 1, that a state or the stop from it exceeds, 0 if none. */
static int inadmissible(const governed * on, const coordinates * state) {
  const stewart_platform * platform = on->platform;
  const int checked[KINDS] = {1, platform->with_joint_angles, platform->with_clearance, 1};
  double rate = on->limits->stop_rate;
  stop_samples stop;
  int found = 0;
  stop.from = state;
  for (int first = 0; first < STOP_SAMPLES && !found; first += SAMPLES_AT_ONCE) {
    for (int n = first; n < first + SAMPLES_AT_ONCE; n++) {
      coordinates at = stopped(state, rate, stop_times[n] / rate);
      put_motion(on->limits, &at, &stop.motions[n]);
    }
    solve_unloaded(platform, SAMPLES_AT_ONCE, &stop.motions[first], &stop.results[first]);
    for (int n = first; n < first + SAMPLES_AT_ONCE && !found; n++) {
      found = overloads(on, &stop.motions[n], &stop.results[n]);
    }
  }
  for (int kind = 0; kind < KINDS && !found; kind++) {
    if (checked[kind]) {found = check_poses(on, kind, &stop);}
  }
  return found ? found : overloads_between(on, &stop);
}

/* Each coordinate between stop and demand, by its share of the demand. */
static coordinates toward(
  const coordinates * stop, const coordinates * demand, const double share[6]) {
  coordinates at;
  for (int i = 0; i < 6; i++) {
    double s = share[i];
    if (s == 0.0) {  /* the demand may be anything */
      at.value[i] = stop->value[i], at.rate[i] = stop->rate[i];
      at.acceleration[i] = stop->acceleration[i];
      continue;
    }
    at.value[i] = stop->value[i] + s * (demand->value[i] - stop->value[i]);
    at.rate[i] = stop->rate[i] + s * (demand->rate[i] - stop->rate[i]);
    at.acceleration[i] =
      stop->acceleration[i] + s * (demand->acceleration[i] - stop->acceleration[i]);
  }
  return at;
}

/* Write the largest shares found, none above `most`, with which the next state is admissible;
   zero, the stop, always is. Returns the limit that `most` exceeds, 0 if none. */
static int find_shares(
  const governed * on, const coordinates * stop, const coordinates * demand,
  const double most[6], double share[6]) {
  coordinates at = toward(stop, demand, most);
  int limit = inadmissible(on, &at);
  memcpy(share, most, 6 * sizeof *share);
  if (!limit) {return 0;}
  /* One share of all first: the demand keeps its direction. */
  double low = 0.0, high = 1.0, tried[6];
  for (int n = 0; n < HALVINGS; n++) {
    double middle = 0.5 * (low + high);
    for (int i = 0; i < 6; i++) {tried[i] = middle * most[i];}
    at = toward(stop, demand, tried);
    *(inadmissible(on, &at) ? &high : &low) = middle;
  }
  for (int i = 0; i < 6; i++) {share[i] = low * most[i];}
  /* Then each coordinate alone: those that the limit does not concern go on. */
  for (int i = 0; i < 6; i++) {
    double kept = share[i];
    for (int n = 0; n < 2; n++) {
      share[i] = n == 0 ? most[i] : 0.5 * (kept + most[i]);
      at = toward(stop, demand, share);
      if (!inadmissible(on, &at)) {break;}
      share[i] = kept;
    }
  }
  return limit;
}

/* Advance a governed motion by a time, toward a demand whose states at begin and end are given. */
static void govern(
  const governed * on, int limited, const coordinates * begin, const coordinates * end,
  double time, governor_state * state) {
  if (state->stopping != 0.0) {
    state->now = stopped(&state->now, on->limits->stop_rate, time);
    state->following = 0.0;
    memset(state->share, 0, sizeof state->share);
    return;
  }
  if (state->following != 0.0) {
    if (!limited || !inadmissible(on, end)) {
      state->now = *end;
      return;
    }
    state->following = 0.0;
  }
  const double zero[6] = {0.0};
  coordinates deviation = toward(begin, &state->now, zero);
  double far = 0.0, k = on->limits->return_rate;
  for (int i = 0; i < 6; i++) {
    deviation.value[i] = state->now.value[i] - begin->value[i];
    deviation.rate[i] = state->now.rate[i] - begin->rate[i];
    deviation.acceleration[i] = state->now.acceleration[i] - begin->acceleration[i];
  }
  deviation = rerotate(&deviation, k, time);
  coordinates demand = *end;
  for (int i = 0; i < 6; i++) {
    demand.value[i] += deviation.value[i];
    demand.rate[i] += deviation.rate[i];
    demand.acceleration[i] += deviation.acceleration[i];
    far = largest(far, largest(fabs(deviation.value[i]), largest(
      fabs(deviation.rate[i]) / k, fabs(deviation.acceleration[i]) / (k * k))));
  }
  double most[6], whole = 1.0;
  for (int i = 0; i < 6; i++) {
    most[i] = least(1.0, state->share[i] + time / RECOVERY);
    whole = least(whole, most[i]);
  }
  if (limited) {
    coordinates stop = stopped(&state->now, on->limits->stop_rate, time);
    int limit = find_shares(on, &stop, &demand, most, state->share);
    state->now = whole == 1.0 && !limit ? demand : toward(&stop, &demand, state->share);
    for (int i = 0; limit && i < 6; i++) {
      state->held[limit - 1] += time * (1.0 - state->share[i]) / 6.0;
    }
    whole = limit ? 0.0 : whole;
  } else {
    state->now = demand;
    for (int i = 0; i < 6; i++) {state->share[i] = 1.0;}
    whole = 1.0;
  }
  if (whole == 1.0 && far < SETTLED) {
    state->following = 1.0;
    state->now = *end;
  }
}

/* The coordinates of the motion of fifth order between two states a time apart, at a part of it. */
static coordinates between_states(
  const coordinates * begin, const coordinates * end, double time, double part) {
  coordinates at;
  double t = part * time, s = part;
  for (int i = 0; i < 6; i++) {
    double v = begin->rate[i], a = begin->acceleration[i];
    double x_by = end->value[i] - (begin->value[i] + time * (v + 0.5 * time * a));
    double v_by = time * (end->rate[i] - (v + time * a));
    double a_by = time * time * (end->acceleration[i] - a);
    double c3 = 10.0 * x_by - 4.0 * v_by + 0.5 * a_by, c4 = -15.0 * x_by + 7.0 * v_by - a_by;
    double c5 = 6.0 * x_by - 3.0 * v_by + 0.5 * a_by;
    at.value[i] = begin->value[i] + t * (v + 0.5 * t * a) + s * s * s * (c3 + s * (c4 + s * c5));
    at.rate[i] = v + t * a + s * s * (3.0 * c3 + s * (4.0 * c4 + s * 5.0 * c5)) / time;
    at.acceleration[i] = a + s * (6.0 * c3 + s * (12.0 * c4 + s * 20.0 * c5)) / (time * time);
  }
  return at;
}

/* Whether a state is that of a motion from another one, a time before, whose accelerations are
   between those of both, but for their CURVATURE. */
static int continues(const coordinates * begin, const coordinates * end, double time) {
  for (int i = 0; i < 6; i++) {
    double a = begin->acceleration[i], b = end->acceleration[i];
    double more = CURVATURE * largest(fabs(a), fabs(b)), range = fabs(b - a) + 2.0 * more;
    double change = end->rate[i] - begin->rate[i] - 0.5 * time * (a + b);
    double mean = 0.5 * (begin->rate[i] + end->rate[i]);
    double way = end->value[i] - begin->value[i] - time * mean;
    if (!(fabs(change) <= 0.5 * time * range + NEGLIGIBLE / LONGEST_STEP &&
          fabs(way) <= 0.125 * time * time * range + NEGLIGIBLE)) {return 0;}
  }
  return 1;
}

static int is_followed(const coordinates * demand) {
  const double * numbers = demand->value;
  for (size_t n = 0; n < sizeof *demand / sizeof *numbers; n++) {
    if (!(fabs(numbers[n]) <= LARGEST)) {return 0;}
  }
  return 1;
}

/* Advance a stream by a time to a demand. Its rates and accelerations may not be those of its
   poses: then these are taken from the differences. Where the hexapod could not follow these, the
   demand jumps: it is as if the motion had always been away from it. */
static void follow(
  const governed * on, double time, const coordinates * demand, governed_stream * stream) {
  double k = on->limits->stop_rate, last = least(time, LONGEST_STEP);
  governor_state * governor = &stream->governor;
  coordinates begin = stream->demand, end = *demand;
  if (!is_followed(demand)) {
    governor->now = stopped(&governor->now, k, time), governor->following = 0.0;
    memset(governor->share, 0, sizeof governor->share);
    stream->demand.value[0] = NAN;  /* the next one is a jump */
    return;
  }
  int jumped = 0;
  if (!continues(&begin, &end, time)) {
    for (int i = 0; i < 6; i++) {
      end.rate[i] = (end.value[i] - begin.value[i]) / time;
      end.acceleration[i] = (end.rate[i] - begin.rate[i]) / time;
    }
    jumped = inadmissible(on, &end);
  }
  if (jumped) {
    governor->held[jumped - 1] += time;
    governor->following = 0.0;
    governor->now = stopped(&governor->now, k, time - last);
    begin = end = *demand;
    for (int i = 0; i < 6; i++) {
      double v = end.rate[i], a = end.acceleration[i];
      begin.value[i] -= last * (v - 0.5 * last * a), begin.rate[i] -= last * a;
    }
    time = last;
  }
  int64_t steps = (int64_t)largest(1.0, ceil(time / LONGEST_STEP - 1e-6));
  coordinates from = begin;
  for (int64_t n = 1; n <= steps; n++) {
    coordinates to = n == steps ? end
      : between_states(&begin, &end, time, (double)n / (double)steps);
    govern(on, 1, &from, &to, time / (double)steps, governor);
    from = to;
  }
  stream->demand = end;
}

int64_t governed_limit(
  const stewart_platform * platform, const governor_limits * limits, const coordinates * state) {
  governed on = {platform, limits};
  return inadmissible(&on, state);
}

void govern_many(
  const stewart_platform * platform, const governor_limits * limits, int64_t count,
  const double * times, const coordinates * demands, governed_stream * stream,
  stewart_motion * motions) {
  governed on = {platform, limits};
  for (int64_t k = 0; k < count; k++) {
    if (isnan(stream->time)) {
      stream->demand = demands[k];
    } else {
      follow(&on, times[k] - stream->time, &demands[k], stream);
    }
    stream->time = times[k];
    put_motion(limits, &stream->governor.now, &motions[k]);
  }
}
