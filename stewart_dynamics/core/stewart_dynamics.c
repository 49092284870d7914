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
#define STAMPS_END (INT64_C(2147483648) * INT64_C(1000000000)) /* [ns] */
#define LAGUERRE_STEPS 64          /* 4 to 7 are usual, 42 the most with equal eigenvalues */
#define RESIDUAL 1e-12             /* of lengths found by the forward kinematics [m] */
#define NEWTON_STEPS 50            /* 6 at most from nearly everywhere */
#define HOMOTOPY_STEPS 200         /* of Newton's method in all */

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

typedef struct {
  vector arm, direction;      /* a = R p, and s from base joint to platform joint */
  real length, per_length;    /* L [m], and 1 / L, 0 where L is 0 */
  real piston_moment;         /* m2 c2 with c2 = L - S2 [kg m] */
  real across_mass;           /* effective mass across the leg, I_e / L^2 + m_ce [kg] */
  real gravity_mass;          /* m_ge [kg] */
} leg_pose;

static leg_pose pose_of(const stewart_leg * leg, const real position[3], const real r[9]) {
  leg_pose at;
  double center = leg->cylinder_center_of_mass;
  double inertia =
    leg->cylinder_mass * (center * center) + leg->cylinder_inertia + leg->piston_inertia;
  at.arm = rotate(r, fixed3(leg->platform_joint));
  vector along = subtract(add(read3(position), at.arm), fixed3(leg->base_joint));
  at.length = root(dot(along, along));
  at.per_length = choose(at.length > 0.0, 1.0 / at.length, number(0.0));
  at.direction = scale(at.per_length, along);
  real piston_distance = at.length - leg->piston_center_of_mass;
  at.piston_moment = leg->piston_mass * piston_distance;
  at.across_mass = (inertia + at.piston_moment * piston_distance) * at.per_length * at.per_length;
  at.gravity_mass = (leg->cylinder_mass * center + at.piston_moment) * at.per_length;
  return at;
}

typedef struct { vector force, moment; } load;  /* moment about the platform's origin */

/* Return Coulomb friction by its full force, at a rate by that below which it is linear. */
static real slip(real a) {return choose(a < -1.0, number(-1.0), choose(a > 1.0, number(1.0), a));}

/* Return the force that moves an actuator at a rate and an acceleration of its drive. */
static real move_actuator(const stewart_leg * leg, real rate, real acceleration) {
  return leg->reflected_mass * acceleration + leg->viscous_friction * rate +
    leg->coulomb_friction * slip(rate / leg->coulomb_velocity);
}

/* Return the load that moves leg i; write its length, its rate, the force that moves its actuator,
   and its row of J_inv, moments divided by the characteristic length, with the row's rate. */
static load move_leg(
  const stewart_platform * platform, int i, const stewart_motion * motion, real * length,
  real * rate, real * actuator, real row[6], real row_rate[6]) {
  const stewart_leg * leg = &platform->legs[i];
  load moved;
  vector omega = read3(motion->angular_velocity);
  leg_pose at = pose_of(leg, motion->position, motion->rotation);
  real per_length = at.per_length;
  double inverse_size = 1.0 / platform->characteristic_length;
  vector a = at.arm, s = at.direction, gravity = fixed3(platform->gravity);

  /* the platform joint's velocity and acceleration (x_i', x_i''), along and across the leg */
  vector a_rate = cross(omega, a);
  vector x_rate = add(read3(motion->linear_velocity), a_rate);
  *length = at.length, *rate = dot(s, x_rate);
  vector across = subtract(x_rate, scale(*rate, s));
  real across_squared = dot(across, across);
  vector turning = cross(read3(motion->angular_acceleration), a);
  vector x_acc = add(add(read3(motion->linear_acceleration), turning), cross(omega, a_rate));
  real along_acc = dot(s, x_acc);
  vector across_acc = subtract(x_acc, scale(along_acc, s));
  real along_gravity = dot(s, gravity);
  vector across_gravity = subtract(gravity, scale(along_gravity, s));

  /* M_i, C_i, G_i; skew(s)^2 y is -(y across the leg) */
  real coriolis_mass = at.piston_moment * per_length - at.across_mass;
  real along = leg->piston_mass * (along_acc - along_gravity + leg->piston_center_of_mass *
    per_length * per_length * across_squared);
  moved.force = scale(at.across_mass, across_acc);
  moved.force = subtract(moved.force, scale(at.gravity_mass, across_gravity));
  moved.force = add(moved.force, scale(2.0 * coriolis_mass * *rate * per_length, across));
  moved.force = add(moved.force, scale(along, s));
  moved.moment = cross(a, moved.force);

  *actuator = move_actuator(leg, *rate, along_acc + across_squared * per_length);

  vector s_rate = scale(per_length, across);
  put3(row, s), put3(row + 3, times(inverse_size, cross(a, s))), put3(row_rate, s_rate);
  put3(row_rate + 3, times(inverse_size, add(cross(a_rate, s), cross(a, s_rate))));
  return moved;
}

/* ---- screws that turn with their legs ------------------------------------------------------- */

/* Write the first and return the second derivative of a vector that turns with the platform. */
static vector turned(vector a, const stewart_motion * motion, vector * rate) {
  vector omega = read3(motion->angular_velocity);
  *rate = cross(omega, a);
  return add(cross(read3(motion->angular_acceleration), a), cross(omega, *rate));
}

/* How far the drive of a leg moves for a turn of its leg [m/rad]; 0 where its screw is guided. */
static double pitch_of(const stewart_leg * leg) {
  return leg->twist_ratio == 0.0 ? 0.0 :
    leg->twist_ratio * leg->screw_lead / (2.0 * PI * leg->gear_ratio);
}

/* q of a drive: the length of its leg, less the extension by the turn of its leg. */
typedef struct { real position, rate, acceleration; } drive_motion;

static drive_motion move_drive(const stewart_leg * leg, const stewart_motion * motion) {
  drive_motion drive;
  leg_pose at = pose_of(leg, motion->position, motion->rotation);
  vector s = at.direction, a_rate, a_acc = turned(at.arm, motion, &a_rate);
  vector x_rate = add(read3(motion->linear_velocity), a_rate);
  vector x_acc = add(read3(motion->linear_acceleration), a_acc);
  real rate = dot(s, x_rate);
  double pitch = pitch_of(leg);
  vector s_rate = scale(at.per_length, subtract(x_rate, scale(rate, s)));
  real acc = dot(s, x_acc) + at.length * dot(s_rate, s_rate);
  drive.position = at.length, drive.rate = rate, drive.acceleration = acc;
  if (pitch == 0.0) {return drive;}
  vector s_acc = subtract(subtract(x_acc, scale(acc, s)), scale(2.0 * rate, s_rate));
  s_acc = scale(at.per_length, s_acc);
  vector u = fixed3(leg->base_universal_axis), w_rate;
  vector w = rotate(motion->rotation, fixed3(leg->platform_universal_axis));
  vector w_acc = turned(w, motion, &w_rate);
  real us = dot(u, s), us_rate = dot(u, s_rate), us_acc = dot(u, s_acc);
  real ws = dot(w, s), ws_rate = dot(w_rate, s) + dot(w, s_rate);
  real ws_acc = dot(w_acc, s) + 2.0 * dot(w_rate, s_rate) + dot(w, s_acc);
  vector n = cross(u, w), n_rate = cross(u, w_rate), n_acc = cross(u, w_acc);
  real y = dot(s, n), y_rate = dot(s_rate, n) + dot(s, n_rate);
  real y_acc = dot(s_acc, n) + 2.0 * dot(s_rate, n_rate) + dot(s, n_acc);
  real x = dot(u, w) - us * ws, x_turn = dot(u, w_rate) - us_rate * ws - us * ws_rate;
  real x_turn_rate = dot(u, w_acc) - us_acc * ws - 2.0 * us_rate * ws_rate - us * ws_acc;
  real inverse = 1.0 / (x * x + y * y);
  real twist_rate = (x * y_rate - y * x_turn) * inverse;
  real twist_acc = (x * y_acc - y * x_turn_rate -
    2.0 * (x * x_turn + y * y_rate) * twist_rate) * inverse;
  drive.position += pitch * angle(y, x);
  drive.rate += pitch * twist_rate;
  drive.acceleration += pitch * twist_acc;
  return drive;
}

/* Write the row of J_q of a leg whose screw turns, moments by the characteristic length. */
static void turning_row(
  const stewart_platform * platform, int i, const stewart_motion * motion, real row[6]) {
  const stewart_leg * leg = &platform->legs[i];
  leg_pose at = pose_of(leg, motion->position, motion->rotation);
  vector s = at.direction, u = fixed3(leg->base_universal_axis);
  vector w = rotate(motion->rotation, fixed3(leg->platform_universal_axis));
  real us = dot(u, s), ws = dot(w, s);
  double pitch = pitch_of(leg);
  real of_u = pitch / (1.0 - us * us), of_w = pitch / (1.0 - ws * ws);
  vector turn = subtract(scale(us * of_u, cross(s, u)), scale(ws * of_w, cross(s, w)));
  vector h = add(s, scale(at.per_length, turn));
  vector moment = add(cross(at.arm, h), scale(of_w, subtract(s, scale(ws, w))));
  put3(row, h), put3(row + 3, times(1.0 / platform->characteristic_length, moment));
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

/* With q = W x s, y the velocity of the platform joint across the leg, and A_b the acceleration of
   the base joint, less the gravity that is not in g, the force at the platform joint is
   m_ge A_b + (m2 - m_ge) (s . A_b) s + (I_e / L^2 + m_ce) L (W' x s + W x q + |q|^2 s)
   - m2 c2 |q|^2 s + 2 m2 c2 / L (L' q - (y . q) s) + 2 (I_e / L^2 + m_ce) (W . s) s x y. */
static load carry_leg(
  const stewart_leg * leg, const stewart_motion * motion, const moving_base * base) {
  load carried;
  leg_pose at = pose_of(leg, motion->position, motion->rotation);
  vector s = at.direction, omega = read3(motion->angular_velocity);
  vector x_rate = add(read3(motion->linear_velocity), cross(omega, at.arm));
  vector joint = add(base->felt, rotate(base->carrying, fixed3(leg->base_joint)));
  vector q = cross(base->spin, s);
  real q_squared = dot(q, q);
  vector turning = add(rotate(base->carrying, s), scale(q_squared, s));
  vector coriolis = add(
    scale(2.0 * at.piston_moment * at.per_length * dot(s, x_rate), q),
    scale(2.0 * at.across_mass * dot(base->spin, s), cross(s, x_rate)));
  real along = (leg->piston_mass - at.gravity_mass) * dot(s, joint) -
    at.piston_moment * (q_squared + 2.0 * at.per_length * dot(x_rate, q));
  carried.force = add(scale(at.gravity_mass, joint), scale(along, s));
  carried.force = add(add(carried.force, scale(at.across_mass * at.length, turning)), coriolis);
  carried.moment = cross(at.arm, carried.force);
  return carried;
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

/* Return the load of the base: it moves platform and legs along with it. */
static load carry(
  const stewart_platform * platform, const stewart_motion * motion, const stewart_base * base) {
  moving_base moving = base_of(platform, base);
  load carried = carry_platform(platform, motion, &moving);
  for (int i = 0; i < 6; i++) {
    load leg = carry_leg(&platform->legs[i], motion, &moving);
    carried.force = add(carried.force, leg.force);
    carried.moment = add(carried.moment, leg.moment);
  }
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

/* ---- inverse dynamics ----------------------------------------------------------------------- */

/* Write the result of a motion under a wrench, unchecked; the condition number, half of the work,
   only if it is wanted. */
static void solve(
  const stewart_platform * platform, const stewart_motion * motion, load wrench,
  int conditioned, stewart_result * result) {
  real rows[6][6], row_rates[6][6], inverse[6][6], actuators[6], balanced[6];
  double size = platform->characteristic_length;
  load moved = move_platform(platform, motion);
  moved.force = subtract(moved.force, wrench.force);
  moved.moment = subtract(moved.moment, wrench.moment);
  for (int i = 0; i < 6; i++) {
    load leg = move_leg(platform, i, motion, &result->lengths[i], &result->rates[i],
                        &actuators[i], rows[i], row_rates[i]);
    moved.force = add(moved.force, leg.force), moved.moment = add(moved.moment, leg.moment);
    for (int j = 0; j < 6; j++) {inverse[j][i] = rows[i][j];}
  }

  /* With J the scaled J_inv, row n of (J^T)^-1 maps the wrench to the force of leg n, its length
     is the largest force of that leg under a unit load, and d(det)/dt = det tr(J^-1 J') is the
     sum of its products with the rows of J'. */
  real determinant = invert(inverse), change = number(0.0);
  put3(balanced, moved.force), put3(balanced + 3, times(1.0 / size, moved.moment));
  for (int i = 0; i < 6; i++) {
    result->joint_forces[i] = dot6(inverse[i], balanced);
    result->forces[i] = result->joint_forces[i] + actuators[i];
    result->unit_load_forces[i] = root(dot6(inverse[i], inverse[i]));
    change += dot6(inverse[i], row_rates[i]);
  }
  determinant *= size * size * size;
  result->determinant = determinant, result->determinant_rate = determinant * change;
  result->condition_number = conditioned ? CONDITION_OF(rows, inverse) : number(0.0);
  if (pitch_of(&platform->legs[0]) == 0.0) {return;}

  /* Screws that turn with their legs: J_q^T f = wrench, by virtual work f q'. */
  for (int i = 0; i < 6; i++) {
    turning_row(platform, i, motion, rows[i]);
    for (int j = 0; j < 6; j++) {inverse[j][i] = rows[i][j];}
  }
  invert(inverse);
  for (int i = 0; i < 6; i++) {
    drive_motion drive = move_drive(&platform->legs[i], motion);
    result->joint_forces[i] = dot6(inverse[i], balanced);
    result->forces[i] = result->joint_forces[i] +
      move_actuator(&platform->legs[i], drive.rate, drive.acceleration);
    result->unit_load_forces[i] = root(dot6(inverse[i], inverse[i]));
  }
}

#ifndef STEWART_LANES

/* ---- one sample: checks --------------------------------------------------------------------- */

static double least(double a, double b) {return b < a ? b : a;}
static double largest(double a, double b) {return b > a ? b : a;}

/* Whether all doubles of an array, or of a structure of doubles, are finite. */
static int all_finite(const void * doubles, size_t size) {
  const double * numbers = (const double *)doubles;
  size_t n = 0;
  while (n < size / sizeof(double) && isfinite(numbers[n])) {n++;}
  return n == size / sizeof(double);
}

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
  stewart_platform whole = *platform;
  whole.mass = platform->mass + mass;
  if (!(whole.mass > 0.0)) {return STEWART_OUT_OF_RANGE;}
  vector center = read3(platform->center_of_mass), arm = subtract(read3(center_of_mass), center);
  /* Parallel axes: both bodies about their common center of mass (Huygens and Steiner). */
  double part = mass / whole.mass, reduced = platform->mass * part, square = dot(arm, arm);
  put3(whole.center_of_mass, add(center, scale(part, arm)));
  double turning[6] = {square - arm.x * arm.x, -arm.x * arm.y, -arm.x * arm.z,
    square - arm.y * arm.y, -arm.y * arm.z, square - arm.z * arm.z};
  for (int n = 0; n < 6; n++) {whole.inertia[n] += inertia[n] + reduced * turning[n];}
  if (!isfinite(whole.mass) || !all_finite(whole.center_of_mass, 3 * sizeof(double)) ||
      !all_finite(whole.inertia, 6 * sizeof(double))) {return STEWART_OUT_OF_RANGE;}
  *platform = whole;
  return STEWART_OK;
}

/* ---- one sample: inverse dynamics ----------------------------------------------------------- */

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
  if (base) {
    load carried = carry(platform, motion, base);
    external.force = subtract(external.force, carried.force);
    external.moment = subtract(external.moment, carried.moment);
  }
  solve(platform, motion, external, 1, &found);
  if (!all_finite(&found, sizeof found)) {return STEWART_OUT_OF_RANGE;}
  *result = found;
  if (found.condition_number < UNSOLVABLE_CONDITION) {return STEWART_OK;}
  for (int i = 0; i < 6; i++) {result->forces[i] = result->joint_forces[i] = 0.0;}
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
  const stewart_leg * a, const stewart_leg * b, const leg_pose * p, const leg_pose * q) {
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

/* Return the bit of a limit if a value is past it, above rounding errors; nan never is. */
static unsigned above(double value, double most, unsigned bit)
{return value > most * (1.0 + LIMIT_TOLERANCE) ? bit : 0u;}

static unsigned below(double value, double minimum, unsigned bit)
{return value < minimum * (1.0 - LIMIT_TOLERANCE) ? bit : 0u;}

/* Return which limits of its joints a leg exceeds. */
static unsigned check_angles(const stewart_leg * leg, double base_angle, double platform_angle) {
  return above(base_angle, leg->base_joint_angle_max, STEWART_BASE_JOINT_ANGLE_MAX) |
    above(platform_angle, leg->platform_joint_angle_max, STEWART_PLATFORM_JOINT_ANGLE_MAX);
}

/* Write for each leg which limits of its joints and of clearance a motion exceeds. */
static void check_joints(
  const stewart_platform * platform, const stewart_motion * motion, unsigned exceeded[6]) {
  const stewart_leg * legs = platform->legs;
  leg_pose at[6];
  for (int i = 0; i < 6; i++) {
    const stewart_leg * leg = &legs[i];
    at[i] = pose_of(leg, motion->position, motion->rotation);
    vector s = at[i].direction, s_p = rotate_back(motion->rotation, s);
    exceeded[i] = check_angles(
      leg, isfinite(leg->base_joint_angle_max) ? joint_angle(leg->base_joint_axis, s) : 0.0,
      isfinite(leg->platform_joint_angle_max) ? joint_angle(leg->platform_joint_axis, s_p) : 0.0);
  }
  for (int i = 0; isfinite(platform->leg_clearance_min) && i < 6; i++) {
    for (int j = i + 1; j < 6; j++) {
      unsigned near = below(clearance_of(&legs[i], &legs[j], &at[i], &at[j]),
                            platform->leg_clearance_min, STEWART_LEG_CLEARANCE_MIN);
      exceeded[i] |= near, exceeded[j] |= near;
    }
  }
}

/* ---- singularity warning, limits, the step -------------------------------------------------- */

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

/* Return which limits a leg exceeds by its result; of rates and loads, a share of them. */
static unsigned check_leg(
  const stewart_leg * leg, const stewart_result * result, int i, double share) {
  return below(result->lengths[i], leg->length_min, STEWART_LENGTH_MIN) |
    above(result->lengths[i], leg->length_max, STEWART_LENGTH_MAX) |
    above(fabs(result->rates[i]), share * leg->velocity_max, STEWART_VELOCITY_MAX) |
    above(fabs(result->forces[i]), share * leg->force_max, STEWART_FORCE_MAX) |
    above(fabs(result->joint_forces[i]), share * leg->joint_force_max, STEWART_JOINT_FORCE_MAX);
}

/* Whether the forces are suppressed; running: a motor is too fast or too hot. */
static int suppresses(
  const stewart_platform * platform, int stopped, unsigned exceeded, int running) {
  return (stopped && platform->suppress_near_singularity) ||
    (((exceeded & ~(unsigned)STEWART_FORCE_MAX) || running) && platform->suppress_at_limits);
}

/* Write the forces within the limit; nan stays nan. */
static void clip_forces(
  const stewart_platform * platform, const stewart_result * result, double forces[6]) {
  for (int i = 0; i < 6; i++) {
    double force = result->forces[i], most = platform->legs[i].force_max;
    forces[i] = force > most ? most : force < -most ? -most : force;
  }
}

int stewart_step(
  const stewart_platform * platform, const stewart_motion * motion, const double wrench[6],
  const stewart_base * base, int64_t stamp, stewart_state * state, stewart_output * output) {
  stewart_output found;
  unsigned any = 0;
  if (!state || !output) {return STEWART_NULL;}
  if (stamp < -STAMPS_END || stamp >= STAMPS_END) {return STEWART_OUT_OF_RANGE;}
  int code = stewart_inverse_dynamics(platform, motion, wrench, base, &found.result);
  if (code != STEWART_OK && code != STEWART_SINGULAR) {return code;}
  advance_warning(platform, &found.result, state);
  check_joints(platform, motion, found.exceeded);
  double elapsed = HUGE_VAL;
  if (state->followed && stamp > state->stamp) {
    elapsed = (double)(stamp - state->stamp) * 1e-9 + (JITTER + platform->sync_tolerance);
  }
  for (int i = 0; i < 6; i++) {
    const stewart_leg * leg = &platform->legs[i];
    double way = state->followed ? found.result.lengths[i] - state->lengths[i] : 0.0;
    found.exceeded[i] |= check_leg(leg, &found.result, i, 1.0) |
      above(fabs(way), leg->velocity_max * elapsed, STEWART_JUMP);
    any |= found.exceeded[i];
  }
  if (!(any & STEWART_JUMP)) {
    state->followed = 1, state->stamp = stamp;
    for (int i = 0; i < 6; i++) {state->lengths[i] = found.result.lengths[i];}
  }
  clip_forces(platform, &found.result, found.forces);
  if (code == STEWART_OK && suppresses(platform, state->stopped, any, 0)) {
    code = STEWART_SUPPRESSED;
    for (int i = 0; i < 6; i++) {found.forces[i] = 0.0;}
  }
  *output = found;
  return code;
}

/* ---- motors --------------------------------------------------------------------------------- */

/* Return the torque of a screw by that of an ideal one; losses are friction by the load. */
static double torque_factor(double power, double slipping, double driving, double driven)
{return 1.0 + (power > 0.0 ? driving : driven) * fabs(slipping);}

int stewart_motor_torques(
  const stewart_platform * platform, const stewart_motion * motion, const double forces[6],
  stewart_motors * motors) {
  stewart_motors found;
  if (!platform || !motion || !forces || !motors) {return STEWART_NULL;}
  if (!(platform->legs[0].screw_lead > 0.0)) {return STEWART_NO_MOTORS;}
  for (int i = 0; i < 6; i++) {
    const stewart_leg * leg = &platform->legs[i];
    drive_motion drive = move_drive(leg, motion);
    double rate = drive.rate, ratio = 2.0 * PI * leg->gear_ratio / leg->screw_lead;
    found.angles[i] = ratio * (drive.position - leg->zero_length);
    found.speeds[i] = ratio * rate;
    found.accelerations[i] = ratio * drive.acceleration;
    double through = forces[i] - leg->reflected_mass * drive.acceleration;  /* the screw */
    found.torques[i] = leg->reflected_mass / ratio / ratio * found.accelerations[i] +
      through / ratio * torque_factor(through * rate, slip(rate / leg->coulomb_velocity),
        1.0 / leg->efficiency - 1.0, leg->back_driving_efficiency - 1.0);
  }
  if (!all_finite(&found, sizeof found)) {return STEWART_OUT_OF_RANGE;}
  *motors = found;
  return STEWART_OK;
}

/* ---- twist and acceleration from the legs --------------------------------------------------- */

/* Write the scaled J_inv, its inverse and the legs at a pose; return the determinant. */
static double scaled_jacobian(
  const stewart_platform * platform, const double position[3], const double rotation[9],
  leg_pose legs[6], double rows[6][6], double inverse[6][6]) {
  double per_size = 1.0 / platform->characteristic_length;
  for (int i = 0; i < 6; i++) {
    legs[i] = pose_of(&platform->legs[i], position, rotation);
    put3(rows[i], legs[i].direction);
    put3(rows[i] + 3, scale(per_size, cross(legs[i].arm, legs[i].direction)));
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

/* Write the linear and the angular part whose product with J_inv is six numbers of the legs. */
static void from_legs(
  const stewart_platform * platform, double inverse[6][6], const double of_legs[6],
  double linear[3], double angular[3]) {
  double per_size = 1.0 / platform->characteristic_length;
  for (int n = 0; n < 3; n++) {
    linear[n] = dot6(inverse[n], of_legs);
    angular[n] = per_size * dot6(inverse[3 + n], of_legs);
  }
}

/* J_inv X' = L', and J_inv X'' = L'' - |x' across the leg|^2 / L - s . (w x (w x a)). */
int stewart_motion_of_legs(
  const stewart_platform * platform, const double rates[6], const double accelerations[6],
  stewart_motion * motion) {
  if (!platform || !rates || !accelerations || !motion) {return STEWART_NULL;}
  if (!all_finite(rates, 6 * sizeof *rates) ||
      !all_finite(accelerations, 6 * sizeof *accelerations) ||
      !all_finite(motion, sizeof(stewart_pose))) {return STEWART_NOT_FINITE;}
  int code = check_rotation(motion->rotation);
  if (code != STEWART_OK) {return code;}
  leg_pose legs[6];
  stewart_motion found = *motion;
  double rows[6][6], inverse[6][6], straight[6];
  scaled_jacobian(platform, found.position, found.rotation, legs, rows, inverse);
  if (!solvable(rows, inverse)) {return STEWART_SINGULAR;}
  from_legs(platform, inverse, rates, found.linear_velocity, found.angular_velocity);
  vector omega = read3(found.angular_velocity);
  for (int i = 0; i < 6; i++) {
    vector of_joint = cross(omega, legs[i].arm);
    vector x_rate = add(read3(found.linear_velocity), of_joint);
    double along = dot(legs[i].direction, x_rate);
    straight[i] = accelerations[i] - (dot(x_rate, x_rate) - along * along) * legs[i].per_length -
      dot(legs[i].direction, cross(omega, of_joint));
  }
  from_legs(platform, inverse, straight, found.linear_acceleration, found.angular_acceleration);
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

/* Newton's method from a pose, which becomes the one found; adds its steps to the count, and
   writes by how much a length differs at most [m]. */
static int newton(
  const stewart_platform * platform, const double lengths[6], stewart_pose * pose, int * count,
  double * largest_error) {
  double per_size = 1.0 / platform->characteristic_length;
  stewart_pose from = *pose, at = *pose;  /* the last pose accepted, and the one tried */
  double before = HUGE_VAL, residual = HUGE_VAL, side = 0.0, part = 1.0;
  *largest_error = residual;
  double step[6] = {0.0, 0.0, 0.0, 0.0, 0.0, 0.0};
  for (int steps = 0; steps < NEWTON_STEPS; steps++, ++*count) {
    leg_pose legs[6];
    double rows[6][6], inverse[6][6], error[6];
    double determinant = scaled_jacobian(
      platform, at.position, at.rotation, legs, rows, inverse);
    for (int i = 0; i < 6; i++) {error[i] = lengths[i] - legs[i].length;}
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

/* Find the pose of lengths from a guess; write the steps of Newton's method, and by how much a
   length differs at most [m]. */
static int find_pose(
  const stewart_platform * platform, const double lengths[6], stewart_pose * pose, int * steps,
  double * residual) {
  double squares[6], done = 0.0, way = 0.25, error;
  stewart_pose found = *pose;
  orthonormalize(found.rotation);
  orthonormalize(found.rotation);  /* twice: a guess may be 1e-6 off */
  for (int i = 0; i < 6; i++) {
    double length = pose_of(&platform->legs[i], found.position, found.rotation).length;
    squares[i] = length * length;
  }
  *steps = 0;
  int code = newton(platform, lengths, &found, steps, residual), more = 0;
  /* Where it does not converge, the lengths are led from those of the guess to those given in
     parts, along a straight line of their squares (homotopy); a part that fails is halved. */
  while (code == STEWART_NO_POSE && way >= 1.0 / 256.0 && more < HOMOTOPY_STEPS) {
    double between[6], reached = least(done + way, 1.0);
    for (int i = 0; i < 6; i++) {
      between[i] = reached == 1.0 ? lengths[i] :
        sqrt(squares[i] + reached * (lengths[i] * lengths[i] - squares[i]));
    }
    int reaches = newton(platform, between, &found, &more, &error) == STEWART_OK;
    done = reaches ? reached : done;
    way *= reaches ? 2.0 : 0.5;
    if (done == 1.0) {code = STEWART_OK, *residual = error;}
  }
  *steps += more;
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
