/* SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * The computation of the Python library and of the ROS 2 node stewart_dynamics, which call this
 * source. Equations and their sources: docs/theory.md. Frames, units and signs:
 * stewart_dynamics.h.
 */

#include "stewart_dynamics.h"

#include <math.h>
#include <stddef.h>

#ifdef __FAST_MATH__
#error "compile without -ffast-math: results would differ, and NaN would pass the checks"
#endif
#ifdef __clang__
#pragma STDC FP_CONTRACT OFF
#endif

#define PI 3.14159265358979323846
#define SMALLEST_PIVOT 1e-32       /* smaller ones are taken as this: the inverse is finite */
#define UNSOLVABLE_CONDITION 1e12  /* fewer than four valid digits of sixteen remain */
#define ORTHOGONALITY 1e-6         /* of R^T R from the identity */
#define QUATERNION_TOLERANCE 1e-3  /* of a quaternion's length from 1 */
#define LIMIT_TOLERANCE 1e-9       /* of limits, relative: above rounding errors */
#define HYSTERESIS 0.8             /* a warning ends below this part of its threshold */
#define JITTER 1e-3                /* of stamps [s] */
#define ONE_POINT 1e-12            /* of joints from their center, by their coordinates */
#define FLATNESS 1e-6              /* of the corners of a plate, by its size */
#define DEFINITENESS 1e-12         /* of an inertia that rounding made indefinite, by its trace */
#define STAMPS_END INT64_C(2147483648000000000) /* of stamps, also negative: 2^31 s [ns] */
#define LAGUERRE_STEPS 64          /* 4 to 7 are usual, 42 the most with equal eigenvalues */
#define RESIDUAL 1e-12             /* of lengths found by the forward kinematics [m] */
#define NEWTON_STEPS 50            /* 6 at most from nearly everywhere */
#define HOMOTOPY_STEPS 200         /* of Newton's method in all */
#define LAST_DIGIT 1e-16           /* of a length, by it */
#define RIGHT_ANGLE 1e-3           /* cosine below which two directions are perpendicular */

/* ---- numbers -------------------------------------------------------------------------------- */

#ifndef STEWART_LANES  /* the library computes several samples at once with this source: lanes.c */

typedef double real;  /* a number of the sample */
typedef int choice;   /* whether a comparison is true */

static real number(double a) {return a;}
static real choose(choice first, real a, real b) {return first ? a : b;}
static int any(choice each) {return each;}
static real root(real a) {return sqrt(a);}
static real absolute(real a) {return fabs(a);}
static real signed_as(real a, real sign) {return copysign(a, sign);}
static real angle(real y, real x) {return atan2(y, x);}

/* Exchange six numbers of a and b, each so many places after the last one. */
static void exchange(choice wanted, real * a, real * b, int step) {
  for (int n = 0; wanted && n < 6 * step; n += step) {
    real old = a[n];
    a[n] = b[n], b[n] = old;
  }
}

#endif

/* ---- vectors and rotations ------------------------------------------------------------------ */

typedef struct { real x, y, z; } vector;

static vector make(real x, real y, real z) {vector v = {x, y, z}; return v;}
static vector read3(const real a[3]) {return make(a[0], a[1], a[2]);}
static vector fixed3(const double a[3]) {return make(number(a[0]), number(a[1]), number(a[2]));}
static vector add(vector a, vector b) {return make(a.x + b.x, a.y + b.y, a.z + b.z);}
static vector subtract(vector a, vector b) {return make(a.x - b.x, a.y - b.y, a.z - b.z);}
static vector scale(real k, vector a) {return make(k * a.x, k * a.y, k * a.z);}
static vector times(double k, vector a) {return make(k * a.x, k * a.y, k * a.z);}
static real dot(vector a, vector b) {return a.x * b.x + a.y * b.y + a.z * b.z;}

static vector cross(vector a, vector b)
{return make(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x);}

static vector rotate(const real r[9], vector a)  /* R a */
{return make(dot(read3(r), a), dot(read3(r + 3), a), dot(read3(r + 6), a));}

static vector column(const real r[9], int n) {return make(r[n], r[3 + n], r[6 + n]);}

static vector rotate_back(const real r[9], vector a)  /* R^T a */
{return make(dot(column(r, 0), a), dot(column(r, 1), a), dot(column(r, 2), a));}

/* I a, I of xx xy xz yy yz zz */
static vector symmetric(const double i[6], vector a) {
  return make(i[0] * a.x + i[1] * a.y + i[2] * a.z, i[1] * a.x + i[3] * a.y + i[4] * a.z,
    i[2] * a.x + i[4] * a.y + i[5] * a.z);
}

static real dot6(const real a[6], const real b[6])
{return a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3] + a[4] * b[4] + a[5] * b[5];}

static void put3(real to[3], vector a) {to[0] = a.x, to[1] = a.y, to[2] = a.z;}

static void put_matrix(real to[9], vector row0, vector row1, vector row2)
{put3(to, row0), put3(to + 3, row1), put3(to + 6, row2);}

/* ---- the forces that move each leg and the platform ----------------------------------------- */

typedef struct { vector force, moment; } load;  /* moment about the platform's origin */

/* Return Coulomb friction by its full force, at a rate by that below which it is linear. */
static real slip(real a) {return choose(a < -1.0, number(-1.0), choose(a > 1.0, number(1.0), a));}

/* Return the force that moves an actuator at a rate and an acceleration of its drive. */
static real move_actuator(const stewart_leg * leg, real rate, real acceleration) {
  return leg->reflected_mass * acceleration + leg->viscous_friction * rate +
    leg->coulomb_friction * slip(rate / leg->coulomb_velocity);
}

/* Write the first and return the second derivative of a vector that turns with the platform. */
static vector turned(vector a, const stewart_motion * motion, vector * rate) {
  vector omega = read3(motion->angular_velocity);
  *rate = cross(omega, a);
  return add(cross(read3(motion->angular_acceleration), a), cross(omega, *rate));
}

static load move_platform(const stewart_platform * platform, const stewart_motion * motion) {
  load moved;
  const real * r = motion->rotation;
  const double * inertia = platform->inertia;
  vector omega = read3(motion->angular_velocity), alpha = read3(motion->angular_acceleration);
  vector com = rotate(r, fixed3(platform->center_of_mass));
  vector com_acc = add(read3(motion->linear_acceleration), cross(alpha, com));
  com_acc = add(com_acc, cross(omega, cross(omega, com)));
  vector omega_p = rotate_back(r, omega), alpha_p = rotate_back(r, alpha);
  vector moment_p = add(symmetric(inertia, alpha_p), cross(omega_p, symmetric(inertia, omega_p)));
  moved.force = times(platform->mass, subtract(com_acc, fixed3(platform->gravity)));
  moved.moment = add(rotate(r, moment_p), cross(com, moved.force));
  return moved;
}

/* ---- the load of a moving base, as a wrench on the platform --------------------------------- */

typedef struct {
  vector felt;             /* the origin's acceleration, less the gravity not in g [m/s^2] */
  vector spin, spin_rate;  /* W and W' [rad/s, rad/s^2] */
  real carrying[9];      /* maps r to W' x r + W x (W x r) */
} moving_base;

static moving_base base_of(const stewart_platform * platform, const stewart_base * base) {
  moving_base b;
  vector w = read3(base->angular_velocity), d = read3(base->angular_acceleration);
  b.felt = subtract(read3(base->gravity), fixed3(platform->gravity));
  b.felt = subtract(read3(base->linear_acceleration), b.felt);
  b.spin = w, b.spin_rate = d;
  put_matrix(b.carrying, make(-(w.y * w.y + w.z * w.z), w.x * w.y - d.z, w.x * w.z + d.y),
    make(w.x * w.y + d.z, -(w.x * w.x + w.z * w.z), w.y * w.z - d.x),
    make(w.x * w.z - d.y, w.y * w.z + d.x, -(w.x * w.x + w.y * w.y)));
  return b;
}

static load carry_platform(
  const stewart_platform * platform, const stewart_motion * motion, const moving_base * base) {
  load carried;
  const real * r = motion->rotation;
  const double * inertia = platform->inertia;
  vector omega = read3(motion->angular_velocity);
  vector com = rotate(r, fixed3(platform->center_of_mass));
  vector com_rate = add(read3(motion->linear_velocity), cross(omega, com));
  /* its angular velocity is W + w, its angular acceleration W' + w' + W x w */
  vector w = rotate_back(r, omega), base_w = rotate_back(r, base->spin);
  vector alpha = rotate_back(r, add(base->spin_rate, cross(base->spin, omega)));
  vector moment = cross(add(w, base_w), symmetric(inertia, base_w));
  moment = add(symmetric(inertia, alpha), moment);
  moment = add(moment, cross(base_w, symmetric(inertia, w)));
  carried.force = add(base->felt, rotate(base->carrying, add(read3(motion->position), com)));
  carried.force = add(carried.force, times(2.0, cross(base->spin, com_rate)));
  carried.force = times(platform->mass, carried.force);
  carried.moment = add(rotate(r, moment), cross(com, carried.force));
  return carried;
}

/* ---- inverse, determinant, condition number ------------------------------------------------- */

/* Replace a by its inverse (Gauss-Jordan, partial pivoting); return det(a). Rows are near 1. */
static real invert(real a[6][6]) {
  choice swapped[6][6];
  real determinant = number(1.0);
  for (int n = 0; n < 6; n++) {
    for (int i = n + 1; i < 6; i++) {
      swapped[n][i] = absolute(a[i][n]) > absolute(a[n][n]);
      determinant = choose(swapped[n][i], -determinant, determinant);
      exchange(swapped[n][i], &a[n][0], &a[i][0], 1);
    }
    real pivot = choose(absolute(a[n][n]) > SMALLEST_PIVOT, a[n][n], number(SMALLEST_PIVOT));
    real inverse = 1.0 / pivot;
    determinant *= pivot;
    a[n][n] = number(1.0);
    for (int j = 0; j < 6; j++) {a[n][j] *= inverse;}
    for (int i = 0; i < 6; i++) {
      real k = a[i][n];
      for (int j = 0; i != n && j < 6; j++) {
        a[i][j] = j == n ? -k * inverse : a[i][j] - k * a[n][j];
      }
    }
  }
  /* The swaps of rows, undone in reverse order as swaps of the inverse's columns. */
  for (int n = 4; n >= 0; n--) {
    for (int i = 5; i > n; i--) {
      exchange(swapped[n][i], &a[0][n], &a[0][i], 6);
    }
  }
  return determinant;
}

typedef struct { real diagonal[6], squares[5]; } tridiagonal;  /* squares: off-diagonal */

/* Householder's tridiagonal matrix of g (lower triangle, overwritten), eigenvalues times k. */
static tridiagonal tridiagonalize(real g[6][6], real k) {
  tridiagonal t;
  real kk = k * k;
  t.diagonal[0] = k * g[0][0];
  for (int n = 0; n < 4; n++) {
    real v[6], w[6], square = number(0.0), wv = number(0.0);
    for (int i = n + 1; i < 6; i++) {v[i] = g[i][n], square += v[i] * v[i];}
    real length = root(square), half = square + length * absolute(v[n + 1]);
    real b = choose(half > 0.0, 1.0 / half, number(0.0));
    v[n + 1] += signed_as(length, v[n + 1]);
    for (int i = n + 1; i < 6; i++) {
      real sum = g[i][n + 1] * v[n + 1];
      for (int j = n + 2; j < 6; j++) {sum += (i < j ? g[j][i] : g[i][j]) * v[j];}
      w[i] = b * sum, wv += w[i] * v[i];
    }
    real c = 0.5 * b * wv;
    for (int i = n + 1; i < 6; i++) {
      w[i] -= c * v[i];
      for (int j = n + 1; j < i; j++) {g[i][j] = g[i][j] - v[i] * w[j] - w[i] * v[j];}
      g[i][i] -= 2.0 * v[i] * w[i];
    }
    t.diagonal[n + 1] = k * g[n + 1][n + 1];
    t.squares[n] = kk * square;
  }
  t.diagonal[5] = k * g[5][5];
  t.squares[4] = kk * (g[5][4] * g[5][4]);
  return t;
}

/* Return x one step nearer the largest eigenvalue of t, from above, or x where it is there. */
static real laguerre_step(real x, const tridiagonal * t) {
  /* the leading minor and its derivatives, and those of the minor before */
  real p = x - t->diagonal[0], dp = number(1.0), ddp = number(0.0);
  real q = number(1.0), dq = number(0.0), ddq = number(0.0);
  for (int n = 1; n < 6; n++) {
    real y = x - t->diagonal[n], e = t->squares[n - 1];
    real next = y * p - e * q, dnext = p + y * dp - e * dq;
    real ddnext = 2.0 * dp + y * ddp - e * ddq;
    q = p, dq = dp, ddq = ddp;
    p = next, dp = dnext, ddp = ddnext;
  }
  real square = 25.0 * dp * dp - 30.0 * p * ddp;
  real divisor = dp + root(choose(square > 0.0, square, number(0.0)));
  real nearer = x - 6.0 * p / choose(divisor > 0.0, divisor, number(1.0));
  return choose((p > 0.0) & (divisor > 0.0) & (nearer > 0.0) & (nearer < x), nearer, x);
}

/* Return a a^T, tridiagonal, with eigenvalues divided by their sum, the trace. */
static tridiagonal squared(real a[6][6], real * trace) {
  real g[6][6];
  *trace = number(0.0);
  for (int i = 0; i < 6; i++) {
    for (int j = 0; j <= i; j++) {g[i][j] = dot6(a[i], a[j]);}
    *trace += g[i][i];
  }
  return tridiagonalize(g, choose(*trace > 0.0, 1.0 / *trace, number(0.0)));
}

#ifndef CONDITION_OF  /* the library has a faster one, of the same bits: lanes.c */
#define CONDITION_OF condition_of
/* Return the product of the largest singular values of a matrix and of its inverse. */
static real condition_of(real a[6][6], real inverse[6][6]) {
  real trace, inverse_trace;
  tridiagonal t = squared(a, &trace), u = squared(inverse, &inverse_trace);
  /* no eigenvalue is larger than the trace but for rounding */
  real x = number(1.0 + 1e-14), y = x;
  for (int n = 0; n < LAGUERRE_STEPS; n++) {
    real nearer_x = laguerre_step(x, &t), nearer_y = laguerre_step(y, &u);
    if (!any((nearer_x < x) | (nearer_y < y))) {break;}
    x = nearer_x, y = nearer_y;
  }
  return root(trace) * root(inverse_trace) * (root(x) * root(y));
}
#endif

#ifndef STEWART_LANES

/* ---- one sample: numbers -------------------------------------------------------------------- */

static double least(double a, double b) {return b < a ? b : a;}
static double largest(double a, double b) {return b > a ? b : a;}

/* Whether all doubles of an array, or of a structure of doubles, are finite. */
static int all_finite(const void * doubles, size_t size) {
  const double * numbers = (const double *)doubles;
  size_t n = 0;
  while (n < size / sizeof(double) && isfinite(numbers[n])) {n++;}
  return n == size / sizeof(double);
}

static double norm(vector a) {return sqrt(dot(a, a));}

/* Whether an inertia xx xy xz yy yz zz, with a part of its trace added, is positive definite. */
static int is_definite(const double i[6], double part) {
  double added = part * (i[0] + i[3] + i[5]);
  double xx = i[0] + added, yy = i[3] + added, zz = i[5] + added;
  double y = yy - i[1] * i[1] / xx, yz = i[4] - i[1] * i[2] / xx;
  return xx > 0.0 && y > 0.0 && zz - i[2] * i[2] / xx - yz * yz / y > 0.0;
}

/* Give an axis unit length, unless it has that or is not set. */
static void put_unit(double axis[3]) {
  double size = largest(fabs(axis[0]), largest(fabs(axis[1]), fabs(axis[2])));
  if (!(size > 0.0 && fabs(norm(read3(axis)) - 1.0) > 1e-15)) {return;}
  vector scaled = make(axis[0] / size, axis[1] / size, axis[2] / size);
  double length = norm(scaled);
  put3(axis, make(scaled.x / length, scaled.y / length, scaled.z / length));
}

/* Whether an axis has a direction, or is not set. */
static int has_direction(const double axis[3])
{return axis[0] != 0.0 || axis[1] != 0.0 || axis[2] != 0.0;}

#endif

/* ---- legs ----------------------------------------------------------------------------------- */

/* The line along which a leg pushes the platform joint: a = R p, and the direction d toward it. */
typedef struct {
  vector arm, direction;
  real length, per_length;  /* of the leg, or of its rod [m], and 1 / length, 0 where that is 0 */
  real lever;               /* effort of the drive by the push along the line */
} leg_line;

typedef struct { real position, rate, acceleration; } drive_motion;

/* What moves a leg: the load at its platform joint, and the effort of its drive, lever * push +
   effort. The push along the line differs at its ends. */
typedef struct {
  load moved;
  real position, rate, lever, effort;
  real near_platform, near_base;  /* added to the push */
  real row[6], row_rate[6];       /* of J_d, moments by the characteristic length, and its rate */
} leg_motion;

/* Return the line to the platform joint from an anchor. */
static leg_line line_from(
  vector anchor, const stewart_leg * leg, const real position[3], const real r[9]) {
  leg_line at;
  at.arm = rotate(r, fixed3(leg->platform_joint));
  vector along = subtract(add(read3(position), at.arm), anchor);
  at.length = root(dot(along, along));
  at.per_length = choose(at.length > 0.0, 1.0 / at.length, number(0.0));
  at.direction = scale(at.per_length, along);
  at.lever = number(1.0);
  return at;
}

/* A kind of legs is a file of these functions, whose names begin with its prefix:
   line: the line of force in a pose.
   move: what moves the leg; base: NULL where it is still.
   carry: the load at the platform joint that the motion of the base adds to that.
   drive: the motion of the drive.
   put, finish: write the numbers of the leg, and of all legs, for pushes along the lines.
   anchor: where the line begins at a position of the drive; returns its length.
   assembled: whether the leg at a position of the drive is assembled as the hexapod is.
   straight: the part of a drive's acceleration, times the lever, that is linear in the
     acceleration of the platform.
   missing: distance by which the leg misses its platform joint [m].
   positions, efforts, commands: of the drives, among the results and the outputs.
   rate_max, lever_ratio: limit of the drive's rate; magnitude of the lever by its largest.
   lever_time: until the lever falls to its limit [s].
   given: whether a leg is of this kind, unless a later one is given as well.
   complete, check: see stewart_complete, stewart_check.
   For the library, in the second part of the file: see legs.c. */
#include "telescopic.h"
#include "crank.h"

#define CALL(number, NAME, prefix, function, arguments) \
  case number: prefix ## _ ## function arguments; break;
#define CALL_EACH(number, NAME, prefix, function, arguments) \
  case number: for (int i = 0; i < 6; i++) {prefix ## _ ## function arguments;} break;
#define RETURN(number, NAME, prefix, function, arguments) \
  case number: return prefix ## _ ## function arguments;

/* Write what moves the legs; all legs at once, so that the loop is that of one kind. */
static void move_legs(
  const stewart_platform * platform, const stewart_motion * motion, const moving_base * base,
  leg_motion legs[6]) {
  switch (platform->leg_kind) {
    default: STEWART_LEG_KINDS(CALL_EACH, move, (platform, i, motion, base, &legs[i]))
  }
}

static load carry_leg(
  const stewart_platform * platform, int i, const stewart_motion * motion,
  const moving_base * base) {
  switch (platform->leg_kind) {
    default: STEWART_LEG_KINDS(RETURN, carry, (&platform->legs[i], motion, base))
  }
}

/* Write the numbers of the legs for pushes along the lines. */
static void put_legs(
  const stewart_platform * platform, const leg_motion legs[6], const real pushes[6],
  stewart_result * result) {
  switch (platform->leg_kind) {
    default: STEWART_LEG_KINDS(CALL_EACH, put, (platform, i, &legs[i], pushes[i], result))
  }
}

static void finish_legs(
  const stewart_platform * platform, const stewart_motion * motion, const real balanced[6],
  stewart_result * result) {
  switch (platform->leg_kind) {
    default: STEWART_LEG_KINDS(CALL, finish, (platform, motion, balanced, result))
  }
}

#ifndef STEWART_LANES

static leg_line line_of(
  const stewart_platform * platform, int i, const real position[3], const real r[9]) {
  switch (platform->leg_kind) {
    default: STEWART_LEG_KINDS(RETURN, line, (&platform->legs[i], position, r))
  }
}

static drive_motion drive_of(
  const stewart_platform * platform, int i, const stewart_motion * motion) {
  switch (platform->leg_kind) {
    default: STEWART_LEG_KINDS(RETURN, drive, (&platform->legs[i], motion))
  }
}

static double anchor_of(
  const stewart_platform * platform, int i, double position, vector * anchor) {
  switch (platform->leg_kind) {
    default: STEWART_LEG_KINDS(RETURN, anchor, (&platform->legs[i], position, anchor))
  }
}

static int assembled_of(
  const stewart_platform * platform, int i, double position, const stewart_pose * pose) {
  switch (platform->leg_kind) {
    default: STEWART_LEG_KINDS(RETURN, assembled, (
      &platform->legs[i], position, pose->position, pose->rotation))
  }
}

static double straight_of(
  const stewart_platform * platform, int i, const stewart_motion * motion, vector x_rate,
  double rate, double acceleration) {
  switch (platform->leg_kind) {
    default: STEWART_LEG_KINDS(RETURN, straight, (
      &platform->legs[i], motion->position, motion->rotation, x_rate, rate, acceleration))
  }
}

static double missing_distance(
  const stewart_platform * platform, int i, const double position[3], const double r[9]) {
  switch (platform->leg_kind) {
    default: STEWART_LEG_KINDS(RETURN, missing, (&platform->legs[i], position, r))
  }
}

static double * positions_of(const stewart_platform * platform, stewart_result * result) {
  switch (platform->leg_kind) {
    default: STEWART_LEG_KINDS(RETURN, positions, (result))
  }
}

static double * efforts_of(const stewart_platform * platform, stewart_result * result) {
  switch (platform->leg_kind) {
    default: STEWART_LEG_KINDS(RETURN, efforts, (result))
  }
}

static double * commands_of(const stewart_platform * platform, stewart_output * output) {
  switch (platform->leg_kind) {
    default: STEWART_LEG_KINDS(RETURN, commands, (output))
  }
}

static double rate_max_of(const stewart_platform * platform, int i) {
  switch (platform->leg_kind) {
    default: STEWART_LEG_KINDS(RETURN, rate_max, (&platform->legs[i]))
  }
}

static double lever_ratio_of(const stewart_platform * platform, int i, double lever) {
  switch (platform->leg_kind) {
    default: STEWART_LEG_KINDS(RETURN, lever_ratio, (&platform->legs[i], lever))
  }
}

static double lever_time_of(
  const stewart_platform * platform, int i, const stewart_motion * motion, double lever) {
  switch (platform->leg_kind) {
    default: STEWART_LEG_KINDS(RETURN, lever_time, (&platform->legs[i], motion, lever))
  }
}

static int kind_of(const stewart_leg * leg) {
  int kind = STEWART_TELESCOPIC;
#define GIVEN(number, NAME, prefix, function, arguments) \
  if (prefix ## _ ## function arguments) {kind = number;}
  STEWART_LEG_KINDS(GIVEN, given, (leg))
#undef GIVEN
  return kind;
}

static void complete_leg(int kind, stewart_leg * leg) {
  switch (kind) {
    default: STEWART_LEG_KINDS(CALL, complete, (leg))
  }
}

static int check_kind(const stewart_platform * platform, const stewart_leg * leg) {
  switch (platform->leg_kind) {
    default: STEWART_LEG_KINDS(RETURN, check, (platform, leg))
  }
}

#endif

/* ---- inverse dynamics ----------------------------------------------------------------------- */

/* Return the load that the motion of the base adds to what moves platform and legs. */
static load carry(
  const stewart_platform * platform, const stewart_motion * motion, const moving_base * base) {
  load carried = carry_platform(platform, motion, base);
  for (int i = 0; i < 6; i++) {
    load leg = carry_leg(platform, i, motion, base);
    carried.force = add(carried.force, leg.force);
    carried.moment = add(carried.moment, leg.moment);
  }
  return carried;
}

/* Write the result of a motion under a wrench, unchecked; the condition number, half of the work,
   only if it is wanted. base: NULL, or one whose load on platform and legs is in the wrench.
   Numbers that other kinds of legs have are not written. */
static void solve(
  const stewart_platform * platform, const stewart_motion * motion, load wrench,
  const moving_base * base, int conditioned, stewart_result * result) {
  leg_motion legs[6];
  real rows[6][6], inverse[6][6], balanced[6], pushes[6];
  double size = platform->characteristic_length;
  load moved = move_platform(platform, motion);
  moved.force = subtract(moved.force, wrench.force);
  moved.moment = subtract(moved.moment, wrench.moment);
  move_legs(platform, motion, base, legs);
  for (int i = 0; i < 6; i++) {
    const leg_motion * leg = &legs[i];
    moved.force = add(moved.force, leg->moved.force);
    moved.moment = add(moved.moment, leg->moved.moment);
    for (int j = 0; j < 6; j++) {inverse[j][i] = rows[i][j] = leg->row[j];}
  }

  /* With J the scaled J_d, row n of (J^T)^-1 maps the wrench to the push of leg n, its length
     is the largest push of that leg under a unit load, and d(det)/dt = det tr(J^-1 J') is the
     sum of its products with the rows of J'. */
  real determinant = invert(inverse), change = number(0.0);
  put3(balanced, moved.force), put3(balanced + 3, times(1.0 / size, moved.moment));
  for (int i = 0; i < 6; i++) {
    pushes[i] = dot6(inverse[i], balanced);
    result->unit_load_forces[i] = root(dot6(inverse[i], inverse[i]));
    change += dot6(inverse[i], legs[i].row_rate);
  }
  put_legs(platform, legs, pushes, result);
  determinant *= size * size * size;
  result->determinant = determinant, result->determinant_rate = determinant * change;
  result->condition_number = conditioned ? CONDITION_OF(rows, inverse) : number(0.0);
  finish_legs(platform, motion, balanced, result);
}

#ifndef STEWART_LANES

/* ---- one sample: checks --------------------------------------------------------------------- */

static int check_rotation(const double r[9]) {
  vector x = column(r, 0), y = column(r, 1), z = column(r, 2);
  double xx = fabs(dot(x, x) - 1.0), yy = fabs(dot(y, y) - 1.0), zz = fabs(dot(z, z) - 1.0);
  double xy = fabs(dot(x, y)), xz = fabs(dot(x, z)), yz = fabs(dot(y, z));
  double error = largest(largest(xx, yy), largest(zz, largest(xy, largest(xz, yz))));
  return error <= ORTHOGONALITY && dot(cross(x, y), z) > 0.0 ? STEWART_OK : STEWART_NOT_A_ROTATION;
}

int stewart_rotation(const double quaternion[4], double rotation[9]) {
  if (!quaternion || !rotation) {return STEWART_NULL;}
  if (!all_finite(quaternion, 4 * sizeof(double))) {return STEWART_NOT_FINITE;}
  double x = quaternion[0], y = quaternion[1], z = quaternion[2], w = quaternion[3];
  double length = sqrt(x * x + y * y + z * z + w * w);
  if (!(fabs(length - 1.0) <= QUATERNION_TOLERANCE)) {return STEWART_NOT_UNIT;}
  x /= length, y /= length, z /= length, w /= length;
  put_matrix(
    rotation, make(1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)),
    make(2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)),
    make(2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)));
  return STEWART_OK;
}

int stewart_add_payload(
  stewart_platform * platform, double mass, const double center_of_mass[3],
  const double inertia[6]) {
  if (!platform || !center_of_mass || !inertia) {return STEWART_NULL;}
  if (!all_finite(&mass, sizeof mass) || !all_finite(center_of_mass, 3 * sizeof(double)) ||
      !all_finite(inertia, 6 * sizeof(double))) {return STEWART_NOT_FINITE;}
  double total = platform->mass + mass, whole[9];  /* center of mass, inertia */
  if (!(total > 0.0)) {return STEWART_OUT_OF_RANGE;}
  double part_inertia[6];
  int is_point = 1;
  for (int n = 0; n < 6; n++) {
    part_inertia[n] = mass < 0.0 ? -inertia[n] : inertia[n];
    is_point = is_point && inertia[n] == 0.0;
  }
  if (!is_point && !is_definite(part_inertia, DEFINITENESS)) {return STEWART_BROKEN_RULE;}
  vector center = read3(platform->center_of_mass), arm = subtract(read3(center_of_mass), center);
  /* Parallel axes: both bodies about their common center of mass (Huygens and Steiner). */
  double part = mass / total, reduced = platform->mass * part, square = dot(arm, arm);
  put3(whole, add(center, scale(part, arm)));
  double turning[6] = {square - arm.x * arm.x, -arm.x * arm.y, -arm.x * arm.z,
    square - arm.y * arm.y, -arm.y * arm.z, square - arm.z * arm.z};
  for (int n = 0; n < 6; n++) {
    whole[3 + n] = platform->inertia[n] + (inertia[n] + reduced * turning[n]);
  }
  if (!isfinite(total) || !all_finite(whole, sizeof whole)) {return STEWART_OUT_OF_RANGE;}
  platform->mass = total;
  put3(platform->center_of_mass, read3(whole));
  for (int n = 0; n < 6; n++) {platform->inertia[n] = whole[3 + n];}
  return STEWART_OK;
}

/* ---- one sample: inverse dynamics ----------------------------------------------------------- */

/* Whether all legs reach their platform joints. */
static int reaches(
  const stewart_platform * platform, const double position[3], const double r[9]) {
  int reached = 1;
  for (int i = 0; i < 6; i++) {
    reached = reached && !(missing_distance(platform, i, position, r) > 0.0);
  }
  return reached;
}

int stewart_missing_distances(
  const stewart_platform * platform, const stewart_pose * pose, double distances[6]) {
  if (!platform || !pose || !distances) {return STEWART_NULL;}
  if (!all_finite(pose, sizeof *pose)) {return STEWART_NOT_FINITE;}
  int code = check_rotation(pose->rotation);
  for (int i = 0; code == STEWART_OK && i < 6; i++) {
    distances[i] = missing_distance(platform, i, pose->position, pose->rotation);
  }
  return code;
}

int stewart_servo_pulses(
  const stewart_platform * platform, const double angles[6], double pulses[6]) {
  double found[6];
  if (!platform || !angles || !pulses) {return STEWART_NULL;}
  if (!all_finite(angles, 6 * sizeof(double))) {return STEWART_NOT_FINITE;}
  for (int i = 0; i < 6; i++) {
    const stewart_leg * leg = &platform->legs[i];
    double least_pulse = leg->servo_pulse_min, span = leg->servo_pulse_max - least_pulse;
    double turn = leg->servo_angle_at_max - leg->servo_angle_at_min;
    double part = (angles[i] - leg->servo_angle_at_min) / turn;
    if (!(fabs(turn) > 0.0)) {return STEWART_NO_SERVOS;}
    if (!(fabs(part - 0.5) <= 0.5 + LIMIT_TOLERANCE)) {return STEWART_SERVO_RANGE;}
    found[i] = least(largest(least_pulse + span * part, least_pulse), leg->servo_pulse_max);
  }
  for (int i = 0; i < 6; i++) {pulses[i] = found[i];}
  return STEWART_OK;
}

/* Set the numbers that some kinds of legs do not have to zero. */
static void clear_result(stewart_result * result) {
  for (int i = 0; i < 6; i++) {
    result->angles[i] = result->speeds[i] = result->torques[i] = result->levers[i] = 0.0;
  }
}

int stewart_inverse_dynamics(
  const stewart_platform * platform, const stewart_motion * motion, const double wrench[6],
  const stewart_base * base, stewart_result * result) {
  stewart_result found;
  load external = {{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
  if (!platform || !motion || !result) {return STEWART_NULL;}
  if (!all_finite(motion, sizeof *motion)) {return STEWART_NOT_FINITE;}
  if (wrench && !all_finite(wrench, 6 * sizeof(double))) {return STEWART_NOT_FINITE;}
  if (base && !all_finite(base, sizeof *base)) {return STEWART_NOT_FINITE;}
  int code = check_rotation(motion->rotation);
  if (code != STEWART_OK) {return code;}
  if (wrench) {external.force = read3(wrench), external.moment = read3(wrench + 3);}
  moving_base moving;
  if (base) {
    moving = base_of(platform, base);
    load carried = carry(platform, motion, &moving);
    external.force = subtract(external.force, carried.force);
    external.moment = subtract(external.moment, carried.moment);
  }
  clear_result(&found);
  solve(platform, motion, external, base ? &moving : NULL, 1, &found);
  if (!all_finite(&found, sizeof found)) {
    return reaches(platform, motion->position, motion->rotation) ? STEWART_OUT_OF_RANGE :
      STEWART_UNREACHABLE;
  }
  *result = found;
  if (found.condition_number < UNSOLVABLE_CONDITION) {return STEWART_OK;}
  for (int i = 0; i < 6; i++) {
    result->forces[i] = result->joint_forces[i] = result->torques[i] = 0.0;
  }
  return STEWART_SINGULAR;
}

/* ---- angles of the joints, clearance of the legs -------------------------------------------- */

/* Angle between a joint's axis and its leg [rad]. */
static double joint_angle(const double axis[3], vector direction) {
  vector sine = cross(read3(axis), direction);
  return atan2(sqrt(dot(sine, sine)), dot(read3(axis), direction));
}

/* The shortest gap + u s - v t for 0 <= u <= u_end, 0 <= v <= v_end; u is that of the lines. */
static vector shortest_of(vector gap, vector s, vector t, double u, double u_end, double v_end) {
  double cosine = dot(s, t);
  u = least(largest(u, 0.0), u_end);
  double v = least(largest(cosine * u + dot(gap, t), 0.0), v_end);
  u = least(largest(cosine * v - dot(gap, s), 0.0), u_end);
  return subtract(add(gap, scale(u, s)), scale(v, t));
}

/* Distance between the surfaces of two legs [m], a cylinder and a thinner piston each. */
static double clearance_of(
  const stewart_leg * a, const stewart_leg * b, const leg_line * p, const leg_line * q) {
  vector s = p->direction, t = q->direction, normal = cross(s, t);
  vector gap = subtract(read3(a->base_joint), read3(b->base_joint));
  double square = dot(normal, normal), clearance = HUGE_VAL;
  double u = square > 0.0 ? dot(gap, subtract(scale(dot(s, t), t), s)) / square : 0.0;
  for (int n = 0; n < 4; n++) {
    int thick = n & 1, other_thick = n & 2;
    double u_end = thick ? least(a->cylinder_length, p->length) : p->length;
    double v_end = other_thick ? least(b->cylinder_length, q->length) : q->length;
    vector d = shortest_of(gap, s, t, u, u_end, v_end);
    double between = sqrt(dot(d, d)) - (thick ? a->cylinder_radius : a->piston_radius) -
      (other_thick ? b->cylinder_radius : b->piston_radius);
    clearance = least(clearance, between);
  }
  return clearance;
}

/* Return the shortest vector from a segment q to a segment p. */
static vector between(vector p, vector p_end, vector q, vector q_end) {
  vector along = subtract(p_end, p), other = subtract(q_end, q), gap = subtract(p, q);
  double length = norm(along), other_length = norm(other);
  vector s = scale(length > 0.0 ? 1.0 / length : 0.0, along);
  vector t = scale(other_length > 0.0 ? 1.0 / other_length : 0.0, other);
  vector normal = cross(s, t);
  double square = dot(normal, normal);
  double u = square > 0.0 ? dot(gap, subtract(scale(dot(s, t), t), s)) / square : 0.0;
  return shortest_of(gap, s, t, u, length, other_length);
}

/* Return the normal of a plate of corners, as long as twice its area. */
static vector plate_area(int count, const double (* plate)[3]) {
  vector origin = read3(plate[0]), area = make(0.0, 0.0, 0.0);
  for (int n = 1; n < count - 1; n++) {
    area = add(area, cross(subtract(read3(plate[n]), origin),
                           subtract(read3(plate[n + 1]), origin)));
  }
  return area;
}

/* Return the distance of a segment from a plate of corners, zero where it crosses it; where it is
   `enough` away from the plate's plane, the distance from the plane. */
static double from_plate(
  int count, const double (* plate)[3], vector p, vector p_end, double enough) {
  vector origin = read3(plate[0]), area = plate_area(count, plate);
  vector normal = scale(1.0 / norm(area), area);
  double height = dot(normal, subtract(p, origin));
  double end_height = dot(normal, subtract(p_end, origin));
  double lowest = least(fabs(height), fabs(end_height)), distance = HUGE_VAL;
  int crossing = (height < 0.0) != (end_height < 0.0), over = 1, end_over = 1;
  if (!crossing && lowest >= enough) {return lowest;}
  double part = crossing ? height / (height - end_height) : 0.0;
  vector x = add(p, scale(part, subtract(p_end, p)));
  for (int n = 0; n < count; n++) {
    vector corner = read3(plate[n]), next = read3(plate[n + 1 < count ? n + 1 : 0]);
    vector inward = cross(normal, subtract(next, corner));
    over = over && dot(inward, subtract(p, corner)) >= 0.0;
    end_over = end_over && dot(inward, subtract(p_end, corner)) >= 0.0;
    crossing = crossing && dot(inward, subtract(x, corner)) >= 0.0;
    distance = least(distance, norm(between(p, p_end, corner, next)));
  }
  if (crossing) {return 0.0;}
  distance = over ? least(distance, fabs(height)) : distance;
  return end_over ? least(distance, fabs(end_height)) : distance;
}

enum { BASE_PLATE = 6, MOVING_PLATE = 7 };

static void keep_nearest(
  double clearances[6], int64_t nearest[6], int leg, int other, double clearance) {
  if (clearance < clearances[leg]) {clearances[leg] = clearance, nearest[leg] = other;}
}

/* A plate limits the clearance of parts that are not joined to it: the moving one that of the
   cylinders, the one of the base that of the pistons, from the end of the cylinder on. */
static void put_plates(
  const stewart_platform * platform, const stewart_motion * motion, const leg_line at[6],
  double clearances[6], int64_t nearest[6]) {
  for (int i = 0; i < 6; i++) {
    const stewart_leg * leg = &platform->legs[i];
    vector joint = read3(leg->base_joint), s = at[i].direction;
    double cylinder = leg->cylinder_length < at[i].length ? leg->cylinder_length : at[i].length;
    if (platform->n_platform_outline) {
      vector begin = rotate_back(motion->rotation, subtract(joint, read3(motion->position)));
      vector end = add(begin, scale(cylinder, rotate_back(motion->rotation, s)));
      double radius = leg->cylinder_radius;
      keep_nearest(clearances, nearest, i, MOVING_PLATE, from_plate(
        platform->n_platform_outline, platform->platform_outline, begin, end,
        clearances[i] + radius) - radius);
    }
    if (platform->n_base_outline) {
      vector begin = add(joint, scale(leg->cylinder_length, s));
      vector end = add(joint, scale(at[i].length, s));
      double radius = leg->piston_radius;
      keep_nearest(clearances, nearest, i, BASE_PLATE, from_plate(
        platform->n_base_outline, platform->base_outline, begin, end,
        clearances[i] + radius) - radius);
    }
  }
}

/* Write the clearance of each leg from the nearest leg or plate, and which that is. */
static void put_clearances(
  const stewart_platform * platform, const stewart_motion * motion, double clearances[6],
  int64_t nearest[6]) {
  leg_line at[6];
  for (int i = 0; i < 6; i++) {
    at[i] = line_of(platform, i, motion->position, motion->rotation);
    clearances[i] = HUGE_VAL, nearest[i] = i;
  }
  for (int i = 0; i < 6; i++) {
    for (int j = i + 1; j < 6; j++) {
      double clearance = clearance_of(&platform->legs[i], &platform->legs[j], &at[i], &at[j]);
      keep_nearest(clearances, nearest, i, j, clearance);
      keep_nearest(clearances, nearest, j, i, clearance);
    }
  }
  put_plates(platform, motion, at, clearances, nearest);
}

/* Write the angles of the joints [rad]; nan where an axis is. */
static void put_joint_angles(
  const stewart_platform * platform, const stewart_motion * motion, double base_angles[6],
  double platform_angles[6]) {
  for (int i = 0; i < 6; i++) {
    const stewart_leg * leg = &platform->legs[i];
    vector s = line_of(platform, i, motion->position, motion->rotation).direction;
    base_angles[i] = joint_angle(leg->base_joint_axis, s);
    platform_angles[i] = joint_angle(
      leg->platform_joint_axis, rotate_back(motion->rotation, s));
  }
}

/* ---- motors --------------------------------------------------------------------------------- */

/* Return the torque of a screw by that of an ideal one; losses are friction by the load. */
static double torque_factor(double power, double slipping, double driving, double driven)
{return 1.0 + (power > 0.0 ? driving : driven) * fabs(slipping);}

/* Return that for a rate of the drive and the power that its load takes. */
static double factor_of(const stewart_leg * leg, double power, double rate) {
  return torque_factor(
    power, slip(rate / leg->loss_velocity), leg->driving_loss, leg->driven_loss);
}

static double screw_torque(const stewart_leg * leg, double through, double rate)
{return through / leg->motor_ratio * factor_of(leg, through * rate, rate);}

/* Return the torque of the torque-speed curve at a speed; infinite without points. */
static double curve_torque(const stewart_platform * platform, double speed) {
  int count = platform->n_torque_speed;
  if (count == 0) {return HUGE_VAL;}
  double torque = platform->torque_speed[0][1], at = fabs(speed);
  for (int n = 1; n < count; n++) {
    const double * a = platform->torque_speed[n - 1], * b = platform->torque_speed[n];
    if (at > a[0]) {torque = a[1] + least((at - a[0]) / (b[0] - a[0]), 1.0) * (b[1] - a[1]);}
  }
  return at > platform->torque_speed[count - 1][0] * (1.0 + LIMIT_TOLERANCE) ? 0.0 : torque;
}

/* Return a value limited to +- most; nan stays nan. */
static double clipped(double value, double most)
{return value > most ? most : value < -most ? -most : value;}

/* Write the motors of demanded efforts; their commands are those of the efforts to command. */
static void put_motors(
  const stewart_platform * platform, const stewart_motion * motion, const double demanded[6],
  const double commands[6], stewart_motors * motors) {
  for (int i = 0; i < 6; i++) {
    const stewart_leg * leg = &platform->legs[i];
    drive_motion of = drive_of(platform, i, motion);
    double ratio = leg->motor_ratio, mass = leg->reflected_mass, speed = ratio * of.rate;
    double acceleration = ratio * of.acceleration, own = mass / ratio / ratio * acceleration;
    double through = demanded[i] - mass * of.acceleration;
    double torque = own + screw_torque(leg, through, of.rate), breakaway = torque;
    if (fabs(of.rate) < leg->loss_velocity) {
      double other = own + through / ratio * (1.0 + leg->driven_loss);
      breakaway = own + through / ratio * (1.0 + leg->driving_loss);
      breakaway = fabs(other) > fabs(breakaway) ? other : breakaway;
    }
    double available = least(leg->torque_max, curve_torque(platform, speed));
    double command = own + screw_torque(leg, commands[i] - mass * of.acceleration, of.rate);
    double current = torque / leg->torque_constant;
    double heat = leg->resistance * current * current;
    motors->angles[i] = ratio * (of.position - leg->zero_length);
    motors->speeds[i] = speed;
    motors->commands[i] = clipped(command, available);
    motors->breakaway_torques[i] = breakaway;
    motors->torques[i] = torque;
    motors->accelerations[i] = acceleration;
    motors->currents[i] = current;
    motors->power[i] = torque * speed + heat;
    motors->copper_heat[i] = heat;
    motors->available_torques[i] = available;
  }
}

int stewart_motor_torques(
  const stewart_platform * platform, const stewart_motion * motion, const double efforts[6],
  stewart_motors * motors) {
  stewart_motors found;
  if (!platform || !motion || !efforts || !motors) {return STEWART_NULL;}
  if (isnan(platform->legs[0].motor_ratio)) {return STEWART_NO_MOTORS;}
  put_motors(platform, motion, efforts, efforts, &found);
  if (!all_finite(found.angles, sizeof found.angles) ||
      !all_finite(found.speeds, sizeof found.speeds) ||
      !all_finite(found.torques, sizeof found.torques) ||
      !all_finite(found.accelerations, sizeof found.accelerations)) {return STEWART_OUT_OF_RANGE;}
  *motors = found;
  return STEWART_OK;
}

/* Return a temperature rise [K] after a time [s] of constant copper heat [W]. */
static double warmed(
  double rise, double heat, double time, double resistance, double time_constant)
{return rise + (rise - heat * resistance) * expm1(-time / time_constant);}

/* ---- limits --------------------------------------------------------------------------------- */

/* Return the bit of a limit if a value is past it, above rounding errors; nan never is. */
static unsigned above(double value, double most, unsigned bit)
{return value > most * (1.0 + copysign(LIMIT_TOLERANCE, most)) ? bit : 0u;}

static unsigned below(double value, double minimum, unsigned bit)
{return value < minimum * (1.0 - copysign(LIMIT_TOLERANCE, minimum)) ? bit : 0u;}

enum { POSE, TWIST, LOAD, MOTOR };  /* what the quantity of a limit depends on */

/* Return which limits a leg exceeds. */
static unsigned check_leg(
  const stewart_platform * platform, const stewart_output * found, int i) {
  const stewart_leg * leg = &platform->legs[i];
  unsigned exceeded = below(
    found->clearances[i], platform->leg_clearance_min, STEWART_LEG_CLEARANCE_MIN);
  unsigned of_motors = STEWART_TORQUE_SPEED;
  if (found->motors.available_torques[i] < leg->torque_max) {
    exceeded |= above(fabs(found->motors.breakaway_torques[i]),
                      found->motors.available_torques[i], STEWART_TORQUE_SPEED);
  }
#define MINIMUM(bit, NAME, field, DEPENDS, quantity) \
  exceeded |= below(found->quantity[i], leg->field, bit);
#define MAXIMUM(bit, NAME, field, DEPENDS, quantity) \
  exceeded |= above(found->quantity[i], leg->field, bit);
#define LARGEST(bit, NAME, field, DEPENDS, quantity) \
  exceeded |= above(fabs(found->quantity[i]), leg->field, bit); \
  of_motors |= DEPENDS == MOTOR ? bit : 0u;
  STEWART_LIMITS(MINIMUM, MAXIMUM, LARGEST)
#undef MINIMUM
#undef MAXIMUM
#undef LARGEST
  return found->finite_motors > 0.0 ? exceeded : exceeded & ~of_motors;
}

/* ---- singularity warning, the step ---------------------------------------------------------- */

static void advance_warning(
  const stewart_platform * platform, const stewart_result * result, stewart_state * state) {
  double det = result->determinant, rate = result->determinant_rate;
  double hysteresis = state->warning != STEWART_NO_WARNING ? HYSTERESIS : 1.0;
  double time = rate != 0.0 ? -det / rate : HUGE_VAL;
  state->time_to_crossing = time >= 0.0 ? time : HUGE_VAL;
  state->warning = STEWART_NO_WARNING;
  if (det * state->determinant < 0.0) {
    state->warning = STEWART_CROSSED, state->crossings++;
  } else if (result->condition_number >= platform->warn_condition * hysteresis) {
    state->warning = STEWART_CONDITION;
  } else if (state->time_to_crossing < platform->warn_time / hysteresis) {
    state->warning = STEWART_PREDICTED;
  }
  state->stopped = result->condition_number >=
    platform->stop_condition * (state->stopped ? HYSTERESIS : 1.0);
  state->determinant = det != 0.0 ? det : state->determinant;
}

static void fill_nan(double * numbers, size_t size) {
  for (size_t n = 0; n < size / sizeof(double); n++) {numbers[n] = NAN;}
}

/* Write forces and motors of an output, which follow from its result; known: the base's motion is.
   Joint angles and clearances are nan. */
static void complete_loads(
  const stewart_platform * platform, const stewart_motion * motion, int known,
  stewart_output * to) {
  stewart_result * result = &to->result;
  to->answered = all_finite(result, sizeof *result);
  to->solved = known && result->condition_number < UNSOLVABLE_CONDITION;
  for (int i = 0; i < 6; i++) {
    const stewart_leg * leg = &platform->legs[i];
    if (to->solved == 0.0) {
      result->forces[i] = result->joint_forces[i] = efforts_of(platform, result)[i] = NAN;
    }
    to->positions[i] = positions_of(platform, result)[i] - leg->zero_length;
    to->lever_ratios[i] = lever_ratio_of(platform, i, result->levers[i]);
    to->lever_times[i] = lever_time_of(platform, i, motion, result->levers[i]);
    to->forces[i] = clipped(result->forces[i], leg->force_max);
    to->torques[i] = clipped(result->torques[i], leg->crank_torque_max);
    to->base_joint_angles[i] = to->platform_joint_angles[i] = to->clearances[i] = NAN;
    to->rises[i] = NAN, to->nearest[i] = i, to->exceeded[i] = 0;
  }
  to->finite_motors = 0.0;
  if (!platform->with_motors) {
    fill_nan(to->motors.angles, sizeof to->motors);
    return;
  }
  put_motors(platform, motion, efforts_of(platform, result), commands_of(platform, to),
             &to->motors);
  int finite = all_finite(to->motors.angles, sizeof to->motors.angles) &&
    all_finite(to->motors.speeds, sizeof to->motors.speeds);
  for (int i = 0; i < 6; i++) {finite = finite && !isinf(to->motors.breakaway_torques[i]);}
  to->finite_motors = finite;
}

/* Write all of an output that follows from its result. */
static void complete_output(
  const stewart_platform * platform, const stewart_motion * motion, int known,
  stewart_output * to) {
  complete_loads(platform, motion, known, to);
  if (platform->with_joint_angles) {
    put_joint_angles(platform, motion, to->base_joint_angles, to->platform_joint_angles);
  }
  if (platform->with_clearance) {
    put_clearances(platform, motion, to->clearances, to->nearest);
  }
}

/* Advance the windings by a time, under the copper heat since the last setpoint. */
static void heat_windings(
  const stewart_platform * platform, double time, const stewart_state * state,
  stewart_output * to) {
  for (int i = 0; i < 6; i++) {
    const stewart_leg * leg = &platform->legs[i];
    to->rises[i] = warmed(state->rises[i], state->copper_heat[i], time, leg->thermal_resistance,
                          leg->thermal_time_constant);
  }
}

/* Keep an output as the one before the next. */
static void keep_output(
  const stewart_platform * platform, stewart_output * from, int64_t stamp,
  stewart_state * state) {
  const double * positions = positions_of(platform, &from->result);
  state->followed = 1, state->stamp = stamp;
  for (int i = 0; i < 6; i++) {
    double heat = from->motors.copper_heat[i];
    state->lengths[i] = positions[i], state->rises[i] = from->rises[i];
    state->copper_heat[i] = isfinite(heat) ? heat : state->copper_heat[i];
  }
}

/* Advance the state by a complete output: warning, windings, limits, what is to be commanded. A
   leg may move at its largest rate for an additional time, `slack` [s]. */
static void advance_step(
  const stewart_platform * platform, int64_t stamp, double slack, int restart,
  stewart_state * state, stewart_output * to) {
  to->restart = restart = restart || state->restarting > 0.0;
  state->restarting = restart && to->answered == 0.0;  /* then the next setpoint is the restart */
  if (to->answered == 0.0) {return;}
  int first = !state->followed, warned = state->warning != STEWART_NO_WARNING;
  if (restart) {  /* this setpoint is the first, but for the count of crossings */
    state->warning = STEWART_NO_WARNING, state->stopped = 0, state->determinant = 0.0;
  }
  advance_warning(platform, &to->result, state);
  to->changed = first || warned != (state->warning != STEWART_NO_WARNING);
  to->warning = state->warning, to->stopped = state->stopped;
  to->determinant = state->determinant, to->time_to_crossing = state->time_to_crossing;
  to->crossings = state->crossings;

  double since = 0.0, elapsed = HUGE_VAL;
  if (!first && !restart && stamp > state->stamp) {
    since = (double)(stamp - state->stamp) * 1e-9;
    elapsed = since + slack;
  }
  if (platform->with_motors) {heat_windings(platform, since, state, to);}
  unsigned any = 0;
  const double * positions = positions_of(platform, &to->result);
  for (int i = 0; i < 6; i++) {
    double way = first ? (double)NAN : positions[i] - state->lengths[i];
    to->mean_rates[i] = way / elapsed;
    to->exceeded[i] = check_leg(platform, to, i) |
      above(fabs(way), rate_max_of(platform, i) * elapsed, STEWART_JUMP);
    any |= to->exceeded[i];
  }
  to->jumped = (any & STEWART_JUMP) != 0, to->exceeding = any != 0;
  if (to->jumped == 0.0) {keep_output(platform, to, stamp, state);}
  if (to->solved == 0.0 || (state->stopped && platform->suppress_near_singularity) ||
      ((any & ~(unsigned)STEWART_CLIPPED) && platform->suppress_at_limits)) {
    double * commands = commands_of(platform, to);
    for (int i = 0; i < 6; i++) {to->forces[i] = commands[i] = to->motors.commands[i] = NAN;}
  }
}

int stewart_step(
  const stewart_platform * platform, const stewart_motion * motion, const double wrench[6],
  const stewart_base * base, int64_t stamp, stewart_state * state, stewart_output * output) {
  stewart_output found;
  if (!state || !output) {return STEWART_NULL;}
  if (stamp < -STAMPS_END || stamp >= STAMPS_END) {return STEWART_OUT_OF_RANGE;}
  int code = stewart_inverse_dynamics(platform, motion, wrench, base, &found.result);
  if (code != STEWART_OK && code != STEWART_SINGULAR) {return code;}
  complete_output(platform, motion, 1, &found);
  advance_step(platform, stamp, JITTER + platform->sync_tolerance, 0, state, &found);
  if (code == STEWART_OK && isnan(found.forces[0])) {code = STEWART_SUPPRESSED;}
  for (int i = 0; code != STEWART_OK && i < 6; i++) {
    found.forces[i] = found.torques[i] = found.motors.commands[i] = 0.0;
    if (code == STEWART_SINGULAR) {
      found.result.forces[i] = found.result.joint_forces[i] = found.result.torques[i] = 0.0;
    }
  }
  *output = found;
  return code;
}

/* ---- the rules of a hexapod ----------------------------------------------------------------- */

const char * stewart_rule(int code) {
  switch (code) {
#define RULE(code, NAME, parameters, rule) case code: return parameters ": " rule;
    STEWART_RULES(RULE)
#undef RULE
    default: return NULL;
  }
}

/* Mean distance of the platform joints from their center [m], and their largest coordinate. */
static double mean_radius(const stewart_platform * platform, double * extent) {
  vector center = {0.0, 0.0, 0.0};
  double sum = 0.0;
  *extent = 0.0;
  for (int i = 0; i < 6; i++) {
    vector joint = read3(platform->legs[i].platform_joint);
    center = add(center, joint);
    *extent = largest(*extent, largest(fabs(joint.x), largest(fabs(joint.y), fabs(joint.z))));
  }
  center = make(center.x / 6.0, center.y / 6.0, center.z / 6.0);
  for (int i = 0; i < 6; i++) {
    sum += norm(subtract(read3(platform->legs[i].platform_joint), center));
  }
  return sum / 6.0;
}

void stewart_complete(stewart_platform * platform) {
  double extent, radius = mean_radius(platform, &extent);
  if (!(platform->characteristic_length > 0.0)) {platform->characteristic_length = radius;}
  platform->with_joint_angles = 0;
  platform->leg_kind = kind_of(&platform->legs[0]);
  platform->with_clearance = isfinite(platform->leg_clearance_min);
  for (int i = 0; i < 6; i++) {
    stewart_leg * leg = &platform->legs[i];
    if (isnan(leg->back_driving_efficiency)) {
      leg->back_driving_efficiency = 2.0 - 1.0 / leg->efficiency;
    }
    complete_leg(platform->leg_kind, leg);
    leg->driving_loss = 1.0 / leg->efficiency - 1.0;
    leg->driven_loss = leg->back_driving_efficiency - 1.0;
    leg->loss_velocity = leg->coulomb_velocity;
    put_unit(leg->base_joint_axis), put_unit(leg->platform_joint_axis);
    put_unit(leg->base_universal_axis), put_unit(leg->platform_universal_axis);
    platform->with_joint_angles = platform->with_joint_angles ||
      isfinite(leg->base_joint_angle_max) || isfinite(leg->platform_joint_angle_max);
  }
}

/* Write the corners of a plate from the first one, of size 1 whatever its size is; return whether
   it has one. */
static int scale_plate(int count, const double (* plate)[3], double scaled[][3]) {
  double extent = 0.0, size = 0.0;
  for (int n = 0; n < 3 * count; n++) {extent = largest(extent, fabs(plate[n / 3][n % 3]));}
  for (int n = 0; n < 3 * count; n++) {
    scaled[n / 3][n % 3] = plate[n / 3][n % 3] / extent - plate[0][n % 3] / extent;
    size = largest(size, fabs(scaled[n / 3][n % 3]));
  }
  for (int n = 0; n < 3 * count; n++) {scaled[n / 3][n % 3] /= size;}
  return size > 0.0;
}

/* Return the rule of a plate that its corners break. */
static int check_plate(int count, const double (* plate)[3]) {
  double corners[sizeof ((stewart_platform *)NULL)->base_outline / (3 * sizeof(double))][3];
  double least_turn = HUGE_VAL, around = 0.0;
  if (count == 0) {return STEWART_VALID;}
  if (count < 3) {return STEWART_RULE_CORNERS;}
  if (!scale_plate(count, plate, corners)) {return STEWART_RULE_CORNERS_ON_A_LINE;}
  vector area = plate_area(count, (const double (*)[3])corners);
  if (!(norm(area) > FLATNESS)) {return STEWART_RULE_CORNERS_ON_A_LINE;}
  vector normal = scale(1.0 / norm(area), area);
  for (int n = 0; n < count; n++) {
    vector corner = read3(corners[n]), next = read3(corners[(n + 1) % count]);
    vector edge = subtract(next, corner);
    vector next_edge = subtract(read3(corners[(n + 2) % count]), next);
    if (fabs(dot(normal, corner)) > FLATNESS) {return STEWART_RULE_CORNERS_IN_A_PLANE;}
    double turn = dot(normal, cross(edge, next_edge));
    least_turn = least(least_turn, turn), around += atan2(turn, dot(edge, next_edge));
  }
  return least_turn < -FLATNESS || around > 3.0 * PI ? STEWART_RULE_CONVEX : STEWART_VALID;
}

static int check_drive(const stewart_leg * leg) {
  if (!(leg->efficiency > 0.0 && leg->efficiency <= 1.0)) {return STEWART_RULE_EFFICIENCY;}
  if (isfinite(leg->resistance) && isnan(leg->torque_constant)) {return STEWART_RULE_RESISTANCE;}
  if (isfinite(leg->thermal_resistance) &&
      (isnan(leg->resistance) || isnan(leg->thermal_time_constant))) {
    return STEWART_RULE_THERMAL_RESISTANCE;
  }
  if (isfinite(leg->thermal_time_constant) && isnan(leg->thermal_resistance)) {
    return STEWART_RULE_THERMAL_TIME_CONSTANT;
  }
  if (isfinite(leg->temperature_rise_max) && isnan(leg->thermal_resistance)) {
    return STEWART_RULE_TEMPERATURE_RISE;
  }
  return STEWART_VALID;
}

static int check_leg_rules(const stewart_platform * platform, const stewart_leg * leg) {
  int limits = 1;
#define BOUND(bit, NAME, field, DEPENDS, quantity) limits = limits && !isnan(leg->field);
#define LARGEST(bit, NAME, field, DEPENDS, quantity) limits = limits && leg->field > 0.0;
  STEWART_LIMITS(BOUND, BOUND, LARGEST)
#undef BOUND
#undef LARGEST
  if (!all_finite(leg->base_joint, 6 * sizeof(double)) || !isfinite(leg->zero_length)) {
    return STEWART_RULE_FINITE;
  }
  if (!(leg->reflected_mass >= 0.0 && leg->viscous_friction >= 0.0 &&
        leg->coulomb_friction >= 0.0)) {return STEWART_RULE_ACTUATOR;}
  if (!(leg->coulomb_velocity > 0.0)) {return STEWART_RULE_COULOMB_VELOCITY;}
  if (!limits) {return STEWART_RULE_LIMIT;}
  if (kind_of(leg) != platform->leg_kind) {return STEWART_RULE_KIND;}
  int rule = check_kind(platform, leg);
  if (rule != STEWART_VALID) {return rule;}
  if (!has_direction(leg->base_joint_axis)) {return STEWART_RULE_BASE_AXIS;}
  if (!has_direction(leg->platform_joint_axis)) {return STEWART_RULE_PLATFORM_AXIS;}
  return check_drive(leg);
}

/* Whether an array of this size has room for a count of points, each of some numbers. */
static int holds(int count, size_t size, size_t numbers)
{return 0 <= count && (size_t)count <= size / (numbers * sizeof(double));}

static int check_platform(const stewart_platform * platform) {
  double extent, radius = mean_radius(platform, &extent);
  if (!all_finite(platform->gravity, 3 * sizeof(double)) || !isfinite(platform->mass) ||
      !all_finite(platform->center_of_mass, 9 * sizeof(double))) {return STEWART_RULE_FINITE;}
  if (!(platform->mass > 0.0)) {return STEWART_RULE_MASS;}
  if (!is_definite(platform->inertia, 0.0)) {return STEWART_RULE_INERTIA;}
  if (!(radius > ONE_POINT * extent)) {return STEWART_RULE_ONE_POINT;}
  if (!(platform->characteristic_length > 0.0)) {return STEWART_RULE_CHARACTERISTIC_LENGTH;}
  if (!(platform->warn_condition >= 1.0)) {return STEWART_RULE_WARN_CONDITION;}
  if (!(platform->stop_condition >= platform->warn_condition)) {
    return STEWART_RULE_STOP_CONDITION;
  }
  if (!(platform->warn_time >= 0.0)) {return STEWART_RULE_WARN_TIME;}
  if (!holds(platform->n_torque_speed, sizeof platform->torque_speed, 2) ||
      !holds(platform->n_base_outline, sizeof platform->base_outline, 3) ||
      !holds(platform->n_platform_outline, sizeof platform->platform_outline, 3)) {
    return STEWART_RULE_POINTS;
  }
  for (int n = 0; n < platform->n_torque_speed; n++) {
    double before = n == 0 ? -1.0 : platform->torque_speed[n - 1][0];
    if (!(platform->torque_speed[n][0] > before && platform->torque_speed[n][0] >= 0.0)) {
      return STEWART_RULE_TORQUE_SPEED;
    }
  }
  return STEWART_VALID;
}

int stewart_check(const stewart_platform * platform, int * where) {
  int rule = check_platform(platform), place = -1;
  for (int leg = 0; leg < 6 && rule == STEWART_VALID; leg++) {
    rule = check_leg_rules(platform, &platform->legs[leg]);
    place = rule == STEWART_VALID ? -1 : leg;
  }
  for (int plate = 0; plate < 2 && rule == STEWART_VALID; plate++) {
    rule = plate == 0 ? check_plate(platform->n_base_outline, platform->base_outline) :
      check_plate(platform->n_platform_outline, platform->platform_outline);
    place = rule == STEWART_VALID ? -1 : plate;
  }
  if (where) {*where = place;}
  return rule;
}

/* ---- twist and acceleration from the legs --------------------------------------------------- */

static void lines_at(
  const stewart_platform * platform, const double position[3], const double rotation[9],
  leg_line lines[6]) {
  for (int i = 0; i < 6; i++) {lines[i] = line_of(platform, i, position, rotation);}
}

/* Write the scaled J_d of lines, and its inverse; return the determinant. */
static double scaled_jacobian(
  const stewart_platform * platform, const leg_line lines[6], double rows[6][6],
  double inverse[6][6]) {
  double per_size = 1.0 / platform->characteristic_length;
  for (int i = 0; i < 6; i++) {
    put3(rows[i], lines[i].direction);
    put3(rows[i] + 3, scale(per_size, cross(lines[i].arm, lines[i].direction)));
    for (int j = 0; j < 6; j++) {inverse[i][j] = rows[i][j];}
  }
  return invert(inverse);
}

/* Whether J_inv can be solved: by Frobenius norms, which bound the condition number. */
static int solvable(double rows[6][6], double inverse[6][6]) {
  double of_rows = 0.0, of_inverse = 0.0;
  for (int i = 0; i < 6; i++) {
    of_rows += dot6(rows[i], rows[i]);
    of_inverse += dot6(inverse[i], inverse[i]);
  }
  return sqrt(of_rows * of_inverse) < UNSOLVABLE_CONDITION;
}

/* Write the linear and the angular part whose product with J_d is six numbers of the lines. */
static void from_lines(
  const stewart_platform * platform, double inverse[6][6], const double of_lines[6],
  double linear[3], double angular[3]) {
  double per_size = 1.0 / platform->characteristic_length;
  for (int n = 0; n < 3; n++) {
    linear[n] = dot6(inverse[n], of_lines);
    angular[n] = per_size * dot6(inverse[3 + n], of_lines);
  }
}

/* Write the twist of rates of the drives: J_d X' = lever q'. */
static void put_twist(
  const stewart_platform * platform, const leg_line lines[6], double inverse[6][6],
  const double rates[6], stewart_motion * motion) {
  double along[6];
  for (int i = 0; i < 6; i++) {along[i] = lines[i].lever * rates[i];}
  from_lines(platform, inverse, along, motion->linear_velocity, motion->angular_velocity);
}

/* J_d X'' = straight part of q'' - d . (w x (w x a)). */
int stewart_motion_of_legs(
  const stewart_platform * platform, const double rates[6], const double accelerations[6],
  stewart_motion * motion) {
  if (!platform || !rates || !accelerations || !motion) {return STEWART_NULL;}
  if (!all_finite(rates, 6 * sizeof *rates) ||
      !all_finite(accelerations, 6 * sizeof *accelerations) ||
      !all_finite(motion, sizeof(stewart_pose))) {return STEWART_NOT_FINITE;}
  int code = check_rotation(motion->rotation);
  if (code != STEWART_OK) {return code;}
  if (!reaches(platform, motion->position, motion->rotation)) {return STEWART_UNREACHABLE;}
  leg_line lines[6];
  stewart_motion found = *motion;
  double rows[6][6], inverse[6][6], straight[6];
  lines_at(platform, found.position, found.rotation, lines);
  scaled_jacobian(platform, lines, rows, inverse);
  if (!solvable(rows, inverse)) {return STEWART_SINGULAR;}
  put_twist(platform, lines, inverse, rates, &found);
  vector omega = read3(found.angular_velocity);
  for (int i = 0; i < 6; i++) {
    vector of_joint = cross(omega, lines[i].arm);
    vector x_rate = add(read3(found.linear_velocity), of_joint);
    straight[i] = straight_of(platform, i, &found, x_rate, rates[i], accelerations[i]) -
      dot(lines[i].direction, cross(omega, of_joint));
  }
  from_lines(platform, inverse, straight, found.linear_acceleration, found.angular_acceleration);
  if (!all_finite(&found, sizeof found)) {return STEWART_OUT_OF_RANGE;}
  *motion = found;
  return STEWART_OK;
}

/* ---- forward kinematics --------------------------------------------------------------------- */

/* The rotation nearest to a matrix close to one: R (3 - R^T R) / 2, a step of Newton's. */
static void orthonormalize(double r[9]) {
  vector a = column(r, 0), b = column(r, 1), c = column(r, 2);
  double u = 1.5 - 0.5 * dot(a, a), v = 1.5 - 0.5 * dot(b, b), w = 1.5 - 0.5 * dot(c, c);
  double xy = 0.5 * dot(a, b), xz = 0.5 * dot(a, c), yz = 0.5 * dot(b, c);
  for (int n = 0; n < 9; n += 3) {
    double x = r[n], y = r[n + 1], z = r[n + 2];
    put3(r + n, make(u * x - xy * y - xz * z, v * y - xy * x - yz * z, w * z - xz * x - yz * y));
  }
}

/* Turn r about a vector by 2 atan(|vector| / 2): Cayley's map, a rotation exactly. */
static void turn_by(vector turn, const double r[9], double turned[9]) {
  vector h = scale(0.5, turn);
  double k = 2.0 / (1.0 + h.x * h.x + h.y * h.y + h.z * h.z);
  double c = 1.0 - k * dot(h, h), m[9];
  put_matrix(m, make(c + k * h.x * h.x, k * (h.x * h.y - h.z), k * (h.x * h.z + h.y)),
             make(k * (h.x * h.y + h.z), c + k * h.y * h.y, k * (h.y * h.z - h.x)),
             make(k * (h.x * h.z - h.y), k * (h.y * h.z + h.x), c + k * h.z * h.z));
  for (int j = 0; j < 3; j++) {
    vector to = rotate(m, column(r, j));
    turned[j] = to.x, turned[3 + j] = to.y, turned[6 + j] = to.z;
  }
}

/* Newton's method from a pose, which becomes the one found, for lines of these lengths; adds its
   steps to the count, and writes by how much a length differs at most [m]. */
static int newton(
  const stewart_platform * platform, const vector anchors[6], const double lengths[6],
  stewart_pose * pose, int * count, double * largest_error) {
  double per_size = 1.0 / platform->characteristic_length;
  stewart_pose from = *pose, at = *pose;  /* the last pose accepted, and the one tried */
  double before = HUGE_VAL, residual = HUGE_VAL, side = 0.0, part = 1.0;
  *largest_error = residual;
  double step[6] = {0.0, 0.0, 0.0, 0.0, 0.0, 0.0};
  for (int steps = 0; steps < NEWTON_STEPS; steps++, ++*count) {
    leg_line lines[6];
    double rows[6][6], inverse[6][6], error[6];
    for (int i = 0; i < 6; i++) {
      lines[i] = line_from(anchors[i], &platform->legs[i], at.position, at.rotation);
      error[i] = lengths[i] - lines[i].length;
    }
    double determinant = scaled_jacobian(platform, lines, rows, inverse);
    double squares = dot6(error, error);
    /* Rejected: on the other side of a singularity, or much farther from the lengths. A long
       first step may overshoot and still be the fastest. */
    if (squares < 16.0 * before && side * determinant >= 0.0) {
      residual = 0.0;
      for (int i = 0; i < 6; i++) {
        residual = largest(residual, fabs(error[i]));
        step[i] = dot6(inverse[i], error);
      }
      *largest_error = residual;
      if (!solvable(rows, inverse)) {return STEWART_SINGULAR;}
      from = at, before = squares, side = determinant, part = 1.0;
    } else if (residual > RESIDUAL) {
      part *= 0.5;
      if (part < 1e-3) {return STEWART_NO_POSE;}
    }
    /* If the residual is small enough this is the last step, to within rounding. */
    put3(at.position, add(read3(from.position), scale(part, read3(step))));
    turn_by(scale(part, scale(per_size, read3(step + 3))), from.rotation, at.rotation);
    if (residual <= RESIDUAL) {*pose = at; return STEWART_OK;}
  }
  return STEWART_NO_POSE;
}

/* Find the pose of the drives' positions from a guess; write the steps of Newton's method, and by
   how much the length of a line differs at most [m]. */
static int find_pose(
  const stewart_platform * platform, const double positions[6], stewart_pose * pose, int * steps,
  double * residual) {
  double lengths[6], squares[6], done = 0.0, way = 0.25, error;
  vector anchors[6];
  stewart_pose found = *pose;
  orthonormalize(found.rotation);
  orthonormalize(found.rotation);  /* twice: a guess may be 1e-6 off */
  for (int i = 0; i < 6; i++) {
    lengths[i] = anchor_of(platform, i, positions[i], &anchors[i]);
    double length =
      line_from(anchors[i], &platform->legs[i], found.position, found.rotation).length;
    squares[i] = length * length;
  }
  *steps = 0;
  int code = newton(platform, anchors, lengths, &found, steps, residual), more = 0;
  /* Where it does not converge, the lengths are led from those of the guess to those given in
     parts, along a straight line of their squares (homotopy); a part that fails is halved. */
  while (code == STEWART_NO_POSE && way >= 1.0 / 256.0 && more < HOMOTOPY_STEPS) {
    double between[6], reached = least(done + way, 1.0);
    for (int i = 0; i < 6; i++) {
      between[i] = reached == 1.0 ? lengths[i] :
        sqrt(squares[i] + reached * (lengths[i] * lengths[i] - squares[i]));
    }
    int converged =
      newton(platform, anchors, between, &found, &more, &error) == STEWART_OK;
    done = converged ? reached : done;
    way *= converged ? 2.0 : 0.5;
    if (done == 1.0) {code = STEWART_OK, *residual = error;}
  }
  *steps += more;
  for (int i = 0; code == STEWART_OK && i < 6; i++) {
    code = assembled_of(platform, i, positions[i], &found) ? STEWART_OK : STEWART_NO_POSE;
  }
  if (code == STEWART_OK) {*pose = found;}
  return code;
}

int stewart_forward_kinematics(
  const stewart_platform * platform, const double lengths[6], stewart_pose * pose) {
  int steps;
  double residual;
  if (!platform || !lengths || !pose) {return STEWART_NULL;}
  if (!all_finite(lengths, 6 * sizeof(double))) {return STEWART_NOT_FINITE;}
  if (!all_finite(pose, sizeof *pose)) {return STEWART_NOT_FINITE;}
  int code = check_rotation(pose->rotation);
  return code == STEWART_OK ? find_pose(platform, lengths, pose, &steps, &residual) : code;
}

#endif
