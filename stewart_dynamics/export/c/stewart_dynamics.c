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
 * The same operations in the same order as the Python library, so that each result has the same
 * bits; the names of its modules in stewart_dynamics/mechanics/ stand above the parts. Equations
 * and their sources: docs/theory.md. Frames, units and signs: stewart_dynamics.h.
 */

#include "stewart_dynamics.h"

#include <math.h>
#include <stddef.h>

#if defined(__FAST_MATH__)
#error "compile without -ffast-math: results would differ, and NaN would not be noticed"
#endif
#if defined(__clang__)
#pragma STDC FP_CONTRACT OFF
#elif defined(_MSC_VER)
#pragma fp_contract(off)
#endif

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

/* ---- vectors ------------------------------------------------------------------------------ */

typedef struct { double x, y, z; } vector;

static vector make(double x, double y, double z)
{
  vector v;
  v.x = x;
  v.y = y;
  v.z = z;
  return v;
}

static vector read3(const double a[3]) {return make(a[0], a[1], a[2]);}

static vector add(vector a, vector b) {return make(a.x + b.x, a.y + b.y, a.z + b.z);}

static vector subtract(vector a, vector b) {return make(a.x - b.x, a.y - b.y, a.z - b.z);}

static vector scale(double k, vector a) {return make(k * a.x, k * a.y, k * a.z);}

static double dot(vector a, vector b) {return a.x * b.x + a.y * b.y + a.z * b.z;}

static vector cross(vector a, vector b)
{
  return make(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x);
}

/* R a */
static vector rotate(const double r[9], vector a)
{
  return make(r[0] * a.x + r[1] * a.y + r[2] * a.z, r[3] * a.x + r[4] * a.y + r[5] * a.z,
              r[6] * a.x + r[7] * a.y + r[8] * a.z);
}

/* R^T a */
static vector rotate_back(const double r[9], vector a)
{
  return make(r[0] * a.x + r[3] * a.y + r[6] * a.z, r[1] * a.x + r[4] * a.y + r[7] * a.z,
              r[2] * a.x + r[5] * a.y + r[8] * a.z);
}

/* I a of a symmetric I: xx xy xz yy yz zz */
static vector symmetric(const double i[6], vector a)
{
  return make(i[0] * a.x + i[1] * a.y + i[2] * a.z, i[1] * a.x + i[3] * a.y + i[4] * a.z,
              i[2] * a.x + i[4] * a.y + i[5] * a.z);
}

static double dot6(const double a[6], const double b[6])
{
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3] + a[4] * b[4] + a[5] * b[5];
}

static double least(double a, double b) {return b < a ? b : a;}

static double largest(double a, double b) {return b > a ? b : a;}

/* ---- checks of inputs --------------------------------------------------------------------- */

static int finite_all(const double * numbers, int count)
{
  int n;
  for (n = 0; n < count; n++) {
    if (!isfinite(numbers[n])) {
      return 0;
    }
  }
  return 1;
}

static int check_pose(const double position[3], const double r[9])
{
  vector x = make(r[0], r[3], r[6]), y = make(r[1], r[4], r[7]), z = make(r[2], r[5], r[8]);
  if (!finite_all(position, 3) || !finite_all(r, 9)) {
    return STEWART_NOT_FINITE;
  }
  /* written so that an overflow does not pass */
  if (!(fabs(dot(x, x) - 1.0) <= ORTHOGONALITY && fabs(dot(y, y) - 1.0) <= ORTHOGONALITY &&
    fabs(dot(z, z) - 1.0) <= ORTHOGONALITY && fabs(dot(x, y)) <= ORTHOGONALITY &&
    fabs(dot(x, z)) <= ORTHOGONALITY && fabs(dot(y, z)) <= ORTHOGONALITY &&
    dot(cross(x, y), z) > 0.0))
  {
    return STEWART_NOT_A_ROTATION;
  }
  return STEWART_OK;
}

/* ---- dynamics/bodies: the forces that move each leg and the platform ----------------------- */

typedef struct {
  vector arm;             /* a = R p: the platform joint from the platform's origin [m] */
  vector direction;       /* s, from base joint to platform joint */
  double length;          /* L [m] */
  double inverse_length;  /* 1 / L, 0 where L is 0 */
} leg_line;

static leg_line line_of(
  const stewart_leg * leg, const double position[3], const double rotation[9])
{
  leg_line line;
  vector along;
  line.arm = rotate(rotation, read3(leg->platform_joint));
  along = subtract(add(read3(position), line.arm), read3(leg->base_joint));
  line.length = sqrt(dot(along, along));
  line.inverse_length = line.length > 0.0 ? 1.0 / line.length : 0.0;
  line.direction = scale(line.inverse_length, along);
  return line;
}

typedef struct {
  double gravity_mass;   /* m_ge [kg] */
  double piston_moment;  /* m2 c2 with c2 = L - S2 [kg m] */
  double across;         /* effective mass across the leg, I_e / L^2 + m_ce [kg] */
} leg_inertia;

static leg_inertia inertia_of(const stewart_leg * leg, double length, double inverse_length)
{
  leg_inertia inertia;
  double center = leg->cylinder_center_of_mass;
  double joint_inertia =
    leg->cylinder_mass * (center * center) + leg->cylinder_inertia + leg->piston_inertia;
  double piston_distance = length - leg->piston_center_of_mass;
  inertia.piston_moment = leg->piston_mass * piston_distance;
  inertia.across = (joint_inertia + inertia.piston_moment * piston_distance) *
    inverse_length * inverse_length;
  inertia.gravity_mass =
    (leg->cylinder_mass * center + inertia.piston_moment) * inverse_length;
  return inertia;
}

typedef struct { vector force, moment; } load;  /* moment about the platform's origin */

typedef struct {
  double length, rate;
  load on_leg;         /* at its platform joint, to move the leg */
  double actuator;     /* force that moves the actuator itself: reflected mass, friction */
  double row[6];       /* of J_inv, its right half divided by the characteristic length */
  double row_rate[6];  /* its time derivative */
} leg_dynamics;

static void put_row(double row[6], vector left, vector right)
{
  row[0] = left.x;
  row[1] = left.y;
  row[2] = left.z;
  row[3] = right.x;
  row[4] = right.y;
  row[5] = right.z;
}

static void move_leg(
  const stewart_leg * leg, const stewart_motion * motion, vector gravity, double inverse_size,
  leg_dynamics * moved)
{
  vector omega = read3(motion->angular_velocity);
  vector acceleration = read3(motion->linear_acceleration);
  leg_line line = line_of(leg, motion->position, motion->rotation);
  vector a = line.arm, s = line.direction;

  /* the platform joint's velocity and acceleration (x_i', x_i''), along and across the leg */
  vector a_rate = cross(omega, a);
  vector x_rate = add(read3(motion->linear_velocity), a_rate);
  double rate = dot(s, x_rate);
  vector across = subtract(x_rate, scale(rate, s));
  double across_squared = dot(across, across);
  vector x_acc = add(
    add(acceleration, cross(read3(motion->angular_acceleration), a)), cross(omega, a_rate));
  double along_acc = dot(s, x_acc);
  vector across_acc = subtract(x_acc, scale(along_acc, s));
  double along_gravity = dot(s, gravity);
  vector across_gravity = subtract(gravity, scale(along_gravity, s));

  /* M_i, C_i, G_i; skew(s)^2 y is -(y across the leg) */
  leg_inertia inertia = inertia_of(leg, line.length, line.inverse_length);
  double coriolis_mass = inertia.piston_moment * line.inverse_length - inertia.across;
  vector force = add(
    add(subtract(scale(inertia.across, across_acc), scale(inertia.gravity_mass, across_gravity)),
        scale(2.0 * coriolis_mass * rate * line.inverse_length, across)),
    scale(leg->piston_mass * (along_acc - along_gravity + leg->piston_center_of_mass *
          line.inverse_length * line.inverse_length * across_squared), s));

  double slip = rate / leg->coulomb_velocity;
  double length_acc = along_acc + across_squared * line.inverse_length;
  vector s_rate = scale(line.inverse_length, across);
  moved->length = line.length;
  moved->rate = rate;
  moved->on_leg.force = force;
  moved->on_leg.moment = cross(a, force);
  moved->actuator = leg->reflected_mass * length_acc + leg->viscous_friction * rate +
    leg->coulomb_friction * (slip < -1.0 ? -1.0 : slip > 1.0 ? 1.0 : slip);
  put_row(moved->row, s, scale(inverse_size, cross(a, s)));
  put_row(moved->row_rate, s_rate,
          scale(inverse_size, add(cross(a_rate, s), cross(a, s_rate))));
}

static load move_platform(const stewart_platform * platform, const stewart_motion * motion)
{
  load moved;
  vector omega = read3(motion->angular_velocity);
  vector alpha = read3(motion->angular_acceleration);
  vector com = rotate(motion->rotation, read3(platform->center_of_mass));
  vector com_acc = add(
    add(read3(motion->linear_acceleration), cross(alpha, com)), cross(omega, cross(omega, com)));
  vector omega_p = rotate_back(motion->rotation, omega);
  vector alpha_p = rotate_back(motion->rotation, alpha);
  vector moment_p = add(symmetric(platform->inertia, alpha_p),
                        cross(omega_p, symmetric(platform->inertia, omega_p)));
  moved.force = scale(platform->mass, subtract(com_acc, read3(platform->gravity)));
  moved.moment = add(rotate(motion->rotation, moment_p), cross(com, moved.force));
  return moved;
}

/* ---- dynamics/base_load: the load of a moving base, as a wrench on the platform ------------ */

typedef struct {
  vector felt;         /* acceleration of the base's origin, less the gravity not in g [m/s^2] */
  vector spin;         /* W, angular velocity of the base [rad/s] */
  vector spin_rate;    /* W' [rad/s^2] */
  double carrying[9];  /* maps r to W' x r + W x (W x r) */
} moving_base;

static moving_base base_of(const stewart_platform * platform, const stewart_base * base)
{
  moving_base b;
  vector w = read3(base->angular_velocity), d = read3(base->angular_acceleration);
  b.felt = subtract(read3(base->linear_acceleration),
                    subtract(read3(base->gravity), read3(platform->gravity)));
  b.spin = w;
  b.spin_rate = d;
  b.carrying[0] = -(w.y * w.y + w.z * w.z);
  b.carrying[1] = w.x * w.y - d.z;
  b.carrying[2] = w.x * w.z + d.y;
  b.carrying[3] = w.x * w.y + d.z;
  b.carrying[4] = -(w.x * w.x + w.z * w.z);
  b.carrying[5] = w.y * w.z - d.x;
  b.carrying[6] = w.x * w.z - d.y;
  b.carrying[7] = w.y * w.z + d.x;
  b.carrying[8] = -(w.x * w.x + w.y * w.y);
  return b;
}

static load carry_leg(
  const stewart_leg * leg, const stewart_motion * motion, const moving_base * base)
{
  load carried;
  leg_line line = line_of(leg, motion->position, motion->rotation);
  leg_inertia inertia = inertia_of(leg, line.length, line.inverse_length);
  vector s = line.direction;
  vector x_rate = add(read3(motion->linear_velocity),
                      cross(read3(motion->angular_velocity), line.arm));
  vector joint = add(base->felt, rotate(base->carrying, read3(leg->base_joint)));
  vector q = cross(base->spin, s);
  double q_squared = dot(q, q);
  vector turning = scale(inertia.across * line.length,
                         add(rotate(base->carrying, s), scale(q_squared, s)));
  vector coriolis = add(
    scale(2.0 * inertia.piston_moment * line.inverse_length * dot(s, x_rate), q),
    scale(2.0 * inertia.across * dot(base->spin, s), cross(s, x_rate)));
  double along = (leg->piston_mass - inertia.gravity_mass) * dot(s, joint) -
    inertia.piston_moment * (q_squared + 2.0 * line.inverse_length * dot(x_rate, q));
  carried.force = add(
    add(add(scale(inertia.gravity_mass, joint), scale(along, s)), turning), coriolis);
  carried.moment = cross(line.arm, carried.force);
  return carried;
}

static load carry_platform(
  const stewart_platform * platform, const stewart_motion * motion, const moving_base * base)
{
  load carried;
  const double * r = motion->rotation;
  vector omega = read3(motion->angular_velocity);
  vector com = rotate(r, read3(platform->center_of_mass));
  /* its angular velocity is W + w, its angular acceleration W' + w' + W x w */
  vector w = rotate_back(r, omega), base_w = rotate_back(r, base->spin);
  vector alpha = rotate_back(r, add(base->spin_rate, cross(base->spin, omega)));
  vector momentum = symmetric(platform->inertia, base_w);
  vector moment = add(
    add(symmetric(platform->inertia, alpha), cross(add(w, base_w), momentum)),
    cross(base_w, symmetric(platform->inertia, w)));
  vector com_rate = add(read3(motion->linear_velocity), cross(omega, com));
  carried.force = scale(platform->mass, add(
    add(base->felt, rotate(base->carrying, add(read3(motion->position), com))),
    scale(2.0, cross(base->spin, com_rate))));
  carried.moment = add(rotate(r, moment), cross(com, carried.force));
  return carried;
}

/* ---- matrix6: inverse, determinant, largest eigenvalue ------------------------------------- */

/* Replace a by its inverse (Gauss-Jordan, partial pivoting); return det(a). Rows are near 1. */
static double invert(double a[6][6])
{
  int swapped[6][6];
  double determinant = 1.0;
  int i, j, n;
  for (n = 0; n < 6; n++) {
    double pivot, inverse;
    for (i = n + 1; i < 6; i++) {
      swapped[n][i] = fabs(a[i][n]) > fabs(a[n][n]);
      if (swapped[n][i]) {
        determinant = -determinant;
        for (j = 0; j < 6; j++) {
          double old = a[n][j];
          a[n][j] = a[i][j];
          a[i][j] = old;
        }
      }
    }
    pivot = fabs(a[n][n]) > SMALLEST_PIVOT ? a[n][n] : SMALLEST_PIVOT;
    inverse = 1.0 / pivot;
    determinant *= pivot;
    a[n][n] = 1.0;
    for (j = 0; j < 6; j++) {
      a[n][j] *= inverse;
    }
    for (i = 0; i < 6; i++) {
      if (i != n) {
        double k = a[i][n];
        for (j = 0; j < 6; j++) {
          a[i][j] -= k * a[n][j];
        }
        a[i][n] = -k * inverse;
      }
    }
  }
  /* The swaps of rows, undone in reverse order as swaps of the inverse's columns. */
  for (n = 4; n >= 0; n--) {
    for (i = 5; i > n; i--) {
      for (j = 0; swapped[n][i] && j < 6; j++) {
        double old = a[j][n];
        a[j][n] = a[j][i];
        a[j][i] = old;
      }
    }
  }
  return determinant;
}

/* Write the lower triangle of a a^T; return its trace. */
static double gram(double a[6][6], double g[6][6])
{
  double trace = 0.0;
  int i, j;
  for (i = 0; i < 6; i++) {
    for (j = 0; j <= i; j++) {
      g[i][j] = dot6(a[i], a[j]);
    }
    trace += g[i][i];
  }
  return trace;
}

typedef struct { double diagonal[6], squares[5]; } tridiagonal;  /* squares: off the diagonal */

/* Householder's tridiagonal matrix of g (lower triangle, overwritten), eigenvalues times k. */
static tridiagonal tridiagonalize(double g[6][6], double k)
{
  tridiagonal t;
  double kk = k * k;
  int i, j, n;
  t.diagonal[0] = k * g[0][0];
  for (n = 0; n < 4; n++) {
    double v[6], w[6], square = 0.0, wv = 0.0, length, half, b, c;
    for (i = n + 1; i < 6; i++) {
      v[i] = g[i][n];
      square += v[i] * v[i];
    }
    t.squares[n] = kk * square;
    length = sqrt(square);
    half = square + length * fabs(v[n + 1]);
    b = half > 0.0 ? 1.0 / half : 0.0;
    v[n + 1] += copysign(length, v[n + 1]);
    for (i = n + 1; i < 6; i++) {
      double sum = g[i][n + 1] * v[n + 1];
      for (j = n + 2; j < 6; j++) {
        sum += (i < j ? g[j][i] : g[i][j]) * v[j];
      }
      w[i] = b * sum;
      wv += w[i] * v[i];
    }
    c = 0.5 * b * wv;
    for (i = n + 1; i < 6; i++) {
      w[i] -= c * v[i];
    }
    for (i = n + 1; i < 6; i++) {
      for (j = n + 1; j < i; j++) {
        g[i][j] = g[i][j] - v[i] * w[j] - w[i] * v[j];
      }
      g[i][i] -= 2.0 * v[i] * w[i];
    }
    t.diagonal[n + 1] = k * g[n + 1][n + 1];
  }
  t.diagonal[5] = k * g[5][5];
  t.squares[4] = kk * (g[5][4] * g[5][4]);
  return t;
}

/* Return x one step nearer the largest eigenvalue of t, from above, or x where it is there. */
static double laguerre_step(double x, const tridiagonal * t)
{
  double p = x - t->diagonal[0], dp = 1.0, ddp = 0.0;  /* the leading minor, its derivatives */
  double q = 1.0, dq = 0.0, ddq = 0.0;                 /* the minor before */
  double root, divisor, nearer;
  int n;
  for (n = 1; n < 6; n++) {
    double y = x - t->diagonal[n], e = t->squares[n - 1];
    double next = y * p - e * q;
    double dnext = p + y * dp - e * dq;
    double ddnext = 2.0 * dp + y * ddp - e * ddq;
    q = p;
    dq = dp;
    ddq = ddp;
    p = next;
    dp = dnext;
    ddp = ddnext;
  }
  root = 25.0 * dp * dp - 30.0 * p * ddp;
  divisor = dp + sqrt(root > 0.0 ? root : 0.0);
  nearer = x - 6.0 * p / (divisor > 0.0 ? divisor : 1.0);
  return p > 0.0 && divisor > 0.0 && 0.0 < nearer && nearer < x ? nearer : x;
}

/* Return the largest eigenvalue of g (lower triangle, overwritten) as a part of its trace. */
static double largest_eigenvalue(double g[6][6], double trace)
{
  tridiagonal t = tridiagonalize(g, trace > 0.0 ? 1.0 / trace : 0.0);
  double x = 1.0 + 1e-14;  /* no eigenvalue is larger, but for rounding */
  int n;
  for (n = 0; n < LAGUERRE_STEPS; n++) {
    double nearer = laguerre_step(x, &t);
    if (!(nearer < x)) {
      break;
    }
    x = nearer;
  }
  return x;
}

/* ---- dynamics/inverse_dynamics ------------------------------------------------------------- */

int stewart_inverse_kinematics(
  const stewart_platform * platform, const stewart_pose * pose, double lengths[6])
{
  double found[6];
  int code, i;
  if (platform == NULL || pose == NULL || lengths == NULL) {
    return STEWART_NULL;
  }
  code = check_pose(pose->position, pose->rotation);
  if (code != STEWART_OK) {
    return code;
  }
  for (i = 0; i < 6; i++) {
    found[i] = line_of(&platform->legs[i], pose->position, pose->rotation).length;
  }
  if (!finite_all(found, 6)) {
    return STEWART_OUT_OF_RANGE;
  }
  for (i = 0; i < 6; i++) {
    lengths[i] = found[i];
  }
  return STEWART_OK;
}

/* Write the result without any check. */
static void solve(
  const stewart_platform * platform, const stewart_motion * motion, vector force, vector moment,
  stewart_result * result)
{
  double rows[6][6], row_rates[6][6], inverse[6][6], products[6][6], actuators[6], wrench[6];
  double size = platform->characteristic_length, inverse_size = 1.0 / size;
  double determinant, change, trace, inverse_trace, condition;
  load moved = move_platform(platform, motion);
  int i, j;
  force = subtract(moved.force, force);
  moment = subtract(moved.moment, moment);
  for (i = 0; i < 6; i++) {
    leg_dynamics leg;
    move_leg(&platform->legs[i], motion, read3(platform->gravity), inverse_size, &leg);
    result->lengths[i] = leg.length;
    result->rates[i] = leg.rate;
    actuators[i] = leg.actuator;
    force = add(force, leg.on_leg.force);
    moment = add(moment, leg.on_leg.moment);
    for (j = 0; j < 6; j++) {
      rows[i][j] = leg.row[j];
      row_rates[i][j] = leg.row_rate[j];
      inverse[j][i] = leg.row[j];
    }
  }

  /* With J the scaled J_inv, row n of (J^T)^-1 maps the wrench to the force of leg n, its length
     is the largest force of that leg under a unit load, and d(det)/dt = det tr(J^-1 J') is the
     sum of its products with the rows of J'. */
  put_row(wrench, force, scale(inverse_size, moment));
  determinant = invert(inverse);
  determinant *= size * size * size;
  change = dot6(inverse[0], row_rates[0]);
  for (i = 1; i < 6; i++) {
    change += dot6(inverse[i], row_rates[i]);
  }
  for (i = 0; i < 6; i++) {
    result->forces[i] = dot6(inverse[i], wrench) + actuators[i];
  }
  result->determinant = determinant;
  result->determinant_rate = determinant * change;

  /* The condition number: the largest eigenvalues of J J^T and of its inverse. */
  inverse_trace = gram(inverse, products);
  for (i = 0; i < 6; i++) {
    result->unit_load_forces[i] = sqrt(products[i][i]);
  }
  condition = sqrt(largest_eigenvalue(products, inverse_trace));
  trace = gram(rows, products);
  condition = sqrt(largest_eigenvalue(products, trace)) * condition;
  result->condition_number = sqrt(trace) * sqrt(inverse_trace) * condition;
}

int stewart_inverse_dynamics(
  const stewart_platform * platform, const stewart_motion * motion, const double wrench[6],
  const stewart_base * base, stewart_result * result)
{
  stewart_result found;
  vector force = make(0.0, 0.0, 0.0), moment = force;
  int code, i;
  if (platform == NULL || motion == NULL || result == NULL) {
    return STEWART_NULL;
  }
  if (!finite_all(motion->linear_velocity, 3) || !finite_all(motion->angular_velocity, 3) ||
    !finite_all(motion->linear_acceleration, 3) || !finite_all(motion->angular_acceleration, 3) ||
    (wrench != NULL && !finite_all(wrench, 6)) ||
    (base != NULL && !(finite_all(base->gravity, 3) && finite_all(base->linear_acceleration, 3) &&
    finite_all(base->angular_velocity, 3) && finite_all(base->angular_acceleration, 3))))
  {
    return STEWART_NOT_FINITE;
  }
  code = check_pose(motion->position, motion->rotation);
  if (code != STEWART_OK) {
    return code;
  }
  if (wrench != NULL) {
    force = read3(wrench);
    moment = read3(wrench + 3);
  }
  if (base != NULL) {
    moving_base moving = base_of(platform, base);
    load carried = carry_platform(platform, motion, &moving);
    for (i = 0; i < 6; i++) {
      load leg = carry_leg(&platform->legs[i], motion, &moving);
      carried.force = add(carried.force, leg.force);
      carried.moment = add(carried.moment, leg.moment);
    }
    force = subtract(force, carried.force);
    moment = subtract(moment, carried.moment);
  }
  solve(platform, motion, force, moment, &found);
  if (!finite_all(found.lengths, 6) || !finite_all(found.rates, 6) ||
    !finite_all(found.forces, 6) || !finite_all(found.unit_load_forces, 6) ||
    !isfinite(found.determinant) || !isfinite(found.determinant_rate) ||
    !isfinite(found.condition_number))
  {
    return STEWART_OUT_OF_RANGE;
  }
  if (!(found.condition_number < UNSOLVABLE_CONDITION)) {
    code = STEWART_SINGULAR;
    for (i = 0; i < 6; i++) {
      found.forces[i] = 0.0;
    }
  }
  *result = found;
  return code;
}

/* ---- kinematics/joint_angles, kinematics/leg_clearance ------------------------------------- */

/* Angle between a joint's axis and its leg [rad]. */
static double joint_angle(const double axis[3], vector direction)
{
  vector sine = cross(read3(axis), direction);
  return atan2(sqrt(dot(sine, sine)), dot(read3(axis), direction));
}

/* Least |gap + u s - v t| for 0 <= u <= u_end, 0 <= v <= v_end; u is that of the two lines. */
static double distance_of(vector gap, vector s, vector t, double u, double u_end, double v_end)
{
  double cosine = dot(s, t), along_s = dot(gap, s), along_t = dot(gap, t), v, x, y, z;
  u = least(largest(u, 0.0), u_end);
  v = least(largest(cosine * u + along_t, 0.0), v_end);
  u = least(largest(cosine * v - along_s, 0.0), u_end);
  x = gap.x + u * s.x - v * t.x;
  y = gap.y + u * s.y - v * t.y;
  z = gap.z + u * s.z - v * t.z;
  return sqrt(x * x + y * y + z * z);
}

/* Distance between the surfaces of two legs [m], a cylinder and a thinner piston each. */
static double clearance_of(
  const stewart_leg * a, const stewart_leg * b, const leg_line * p, const leg_line * q)
{
  vector s = p->direction, t = q->direction;
  vector gap = subtract(read3(a->base_joint), read3(b->base_joint));
  vector normal = cross(s, t);
  double square = dot(normal, normal);
  double u = square > 0.0 ? dot(gap, subtract(scale(dot(s, t), t), s)) / square : 0.0;
  double m = least(a->cylinder_length, p->length), n = least(b->cylinder_length, q->length);
  return least(
    least(distance_of(gap, s, t, u, p->length, q->length) - a->piston_radius - b->piston_radius,
          distance_of(gap, s, t, u, m, q->length) - a->cylinder_radius - b->piston_radius),
    least(distance_of(gap, s, t, u, p->length, n) - a->piston_radius - b->cylinder_radius,
          distance_of(gap, s, t, u, m, n) - a->cylinder_radius - b->cylinder_radius));
}

/* Write for each leg which limits of its joints and of clearance a motion exceeds. */
static void check_joints(
  const stewart_platform * platform, const stewart_motion * motion, unsigned exceeded[6])
{
  leg_line lines[6];
  int i, j;
  for (i = 0; i < 6; i++) {
    const stewart_leg * leg = &platform->legs[i];
    vector s;
    lines[i] = line_of(leg, motion->position, motion->rotation);
    s = lines[i].direction;
    exceeded[i] = 0;
    if (isfinite(leg->base_joint_angle_max) &&
      joint_angle(leg->base_joint_axis, s) > leg->base_joint_angle_max * (1.0 + LIMIT_TOLERANCE))
    {
      exceeded[i] |= STEWART_BASE_JOINT_ANGLE_MAX;
    }
    if (isfinite(leg->platform_joint_angle_max) &&
      joint_angle(leg->platform_joint_axis, rotate_back(motion->rotation, s)) >
      leg->platform_joint_angle_max * (1.0 + LIMIT_TOLERANCE))
    {
      exceeded[i] |= STEWART_PLATFORM_JOINT_ANGLE_MAX;
    }
  }
  for (i = 0; isfinite(platform->leg_clearance_min) && i < 6; i++) {
    for (j = i + 1; j < 6; j++) {
      if (clearance_of(&platform->legs[i], &platform->legs[j], &lines[i], &lines[j]) <
        platform->leg_clearance_min * (1.0 - LIMIT_TOLERANCE))
      {
        exceeded[i] |= STEWART_LEG_CLEARANCE_MIN;
        exceeded[j] |= STEWART_LEG_CLEARANCE_MIN;
      }
    }
  }
}

/* ---- singularity_warning, limits ----------------------------------------------------------- */

static void advance_warning(
  const stewart_platform * platform, const stewart_result * result, stewart_state * state)
{
  double det = result->determinant, rate = result->determinant_rate;
  double hysteresis = state->warning != STEWART_NO_WARNING ? HYSTERESIS : 1.0;
  double time = rate != 0.0 ? -det / rate : HUGE_VAL;
  if (!(time >= 0.0)) {
    time = HUGE_VAL;
  }
  state->warning = STEWART_NO_WARNING;
  if (det * state->determinant < 0.0) {
    state->warning = STEWART_CROSSED;
    state->crossings++;
  } else if (result->condition_number >= platform->warn_condition * hysteresis) {
    state->warning = STEWART_CONDITION;
  } else if (time < platform->warn_time / hysteresis) {
    state->warning = STEWART_PREDICTED;
  }
  state->stopped = result->condition_number >=
    platform->stop_condition * (state->stopped ? HYSTERESIS : 1.0);
  state->time_to_crossing = time;
  if (det != 0.0) {
    state->determinant = det;
  }
}

/* Return which limits of length, rate, force and jump a leg exceeds. */
static unsigned check_leg(
  const stewart_leg * leg, double length, double rate, double force, double jump, double elapsed)
{
  double velocity_max = leg->velocity_max * (1.0 + LIMIT_TOLERANCE);
  unsigned exceeded = 0;
  if (length < leg->length_min * (1.0 - LIMIT_TOLERANCE)) {
    exceeded |= STEWART_LENGTH_MIN;
  }
  if (length > leg->length_max * (1.0 + LIMIT_TOLERANCE)) {
    exceeded |= STEWART_LENGTH_MAX;
  }
  if (fabs(rate) > velocity_max) {
    exceeded |= STEWART_VELOCITY_MAX;
  }
  if (fabs(force) > leg->force_max * (1.0 + LIMIT_TOLERANCE)) {
    exceeded |= STEWART_FORCE_MAX;
  }
  if (fabs(jump) > velocity_max * elapsed) {
    exceeded |= STEWART_JUMP;
  }
  return exceeded;
}

int stewart_step(
  const stewart_platform * platform, const stewart_motion * motion, const double wrench[6],
  const stewart_base * base, int64_t stamp, stewart_state * state, stewart_output * output)
{
  stewart_output found;
  double elapsed = HUGE_VAL;
  unsigned any = 0;
  int code, i;
  if (state == NULL || output == NULL) {
    return STEWART_NULL;
  }
  if (stamp < -STAMPS_END || stamp >= STAMPS_END) {
    return STEWART_OUT_OF_RANGE;
  }
  code = stewart_inverse_dynamics(platform, motion, wrench, base, &found.result);
  if (code != STEWART_OK && code != STEWART_SINGULAR) {
    return code;
  }
  advance_warning(platform, &found.result, state);
  check_joints(platform, motion, found.exceeded);
  if (state->followed && stamp > state->stamp) {
    elapsed = (double)(stamp - state->stamp) * 1e-9 + (JITTER + platform->sync_tolerance);
  }
  for (i = 0; i < 6; i++) {
    double length = found.result.lengths[i];
    double jump = state->followed ? length - state->lengths[i] : 0.0;
    found.exceeded[i] |= check_leg(
      &platform->legs[i], length, found.result.rates[i], found.result.forces[i], jump, elapsed);
    any |= found.exceeded[i];
  }
  if (!(any & STEWART_JUMP)) {
    state->followed = 1;
    state->stamp = stamp;
    for (i = 0; i < 6; i++) {
      state->lengths[i] = found.result.lengths[i];
    }
  }
  if (code == STEWART_OK && ((state->stopped && platform->suppress_near_singularity) ||
    ((any & ~(unsigned)STEWART_FORCE_MAX) && platform->suppress_at_limits)))
  {
    code = STEWART_SUPPRESSED;
  }
  for (i = 0; i < 6; i++) {
    double most = platform->legs[i].force_max, force = found.result.forces[i];
    found.forces[i] = code == STEWART_OK ? least(largest(force, -most), most) : 0.0;
  }
  *output = found;
  return code;
}

/* ---- kinematics/forward_kinematics --------------------------------------------------------- */

/* The rotation nearest to a matrix close to one: R (3 - R^T R) / 2, a step of Newton's. */
static void orthonormalize(double r[9])
{
  double xx = r[0] * r[0] + r[3] * r[3] + r[6] * r[6];
  double yy = r[1] * r[1] + r[4] * r[4] + r[7] * r[7];
  double zz = r[2] * r[2] + r[5] * r[5] + r[8] * r[8];
  double xy = 0.5 * (r[0] * r[1] + r[3] * r[4] + r[6] * r[7]);
  double xz = 0.5 * (r[0] * r[2] + r[3] * r[5] + r[6] * r[8]);
  double yz = 0.5 * (r[1] * r[2] + r[4] * r[5] + r[7] * r[8]);
  double u = 1.5 - 0.5 * xx, v = 1.5 - 0.5 * yy, w = 1.5 - 0.5 * zz;
  int n;
  for (n = 0; n < 9; n += 3) {
    double x = r[n], y = r[n + 1], z = r[n + 2];
    r[n] = u * x - xy * y - xz * z;
    r[n + 1] = v * y - xy * x - yz * z;
    r[n + 2] = w * z - xz * x - yz * y;
  }
}

/* Turn r about a vector by 2 atan(|vector| / 2): Cayley's map, a rotation exactly. */
static void turn_by(vector vector_, const double r[9], double turned[9])
{
  vector h = scale(0.5, vector_);
  double k = 2.0 / (1.0 + h.x * h.x + h.y * h.y + h.z * h.z);
  double c = 1.0 - k * (h.x * h.x + h.y * h.y + h.z * h.z);
  double m[9];
  int i, j;
  m[0] = c + k * h.x * h.x;
  m[1] = k * (h.x * h.y - h.z);
  m[2] = k * (h.x * h.z + h.y);
  m[3] = k * (h.x * h.y + h.z);
  m[4] = c + k * h.y * h.y;
  m[5] = k * (h.y * h.z - h.x);
  m[6] = k * (h.x * h.z - h.y);
  m[7] = k * (h.y * h.z + h.x);
  m[8] = c + k * h.z * h.z;
  for (i = 0; i < 9; i += 3) {
    for (j = 0; j < 3; j++) {
      turned[i + j] = m[i] * r[j] + m[i + 1] * r[3 + j] + m[i + 2] * r[6 + j];
    }
  }
}

static double sum_of_squares(double a[6][6])
{
  double sum = dot6(a[0], a[0]);
  int i;
  for (i = 1; i < 6; i++) {
    sum += dot6(a[i], a[i]);
  }
  return sum;
}

/* Newton's method from a pose, which becomes the one found; adds its steps to the count. */
static int newton(
  const stewart_platform * platform, const double lengths[6], stewart_pose * pose, int * count)
{
  double per_size = 1.0 / platform->characteristic_length;
  stewart_pose from = *pose, at = *pose;  /* the last pose accepted, and the one tried */
  double before = HUGE_VAL, residual = HUGE_VAL, side = 0.0, part = 1.0;
  vector step = make(0.0, 0.0, 0.0), turn = step, moved;
  int i, j, steps;
  for (steps = 0; steps < NEWTON_STEPS; steps++) {
    double rows[6][6], inverse[6][6], error[6], squares, determinant;
    for (i = 0; i < 6; i++) {
      leg_line line = line_of(&platform->legs[i], at.position, at.rotation);
      error[i] = lengths[i] - line.length;
      put_row(rows[i], line.direction, scale(per_size, cross(line.arm, line.direction)));
      for (j = 0; j < 6; j++) {
        inverse[i][j] = rows[i][j];
      }
    }
    squares = dot6(error, error);
    determinant = invert(inverse);
    /* Rejected: on the other side of a singularity, or much farther from the lengths. A long
       first step may overshoot and still be the fastest. */
    if (squares < 16.0 * before && side * determinant >= 0.0) {
      double condition = sqrt(sum_of_squares(rows) * sum_of_squares(inverse));
      residual = fabs(error[0]);
      for (i = 1; i < 6; i++) {
        residual = largest(residual, fabs(error[i]));
      }
      if (!(condition < UNSOLVABLE_CONDITION)) {
        *count += steps;
        return STEWART_SINGULAR;
      }
      from = at;
      before = squares;
      side = determinant;
      step = make(dot6(inverse[0], error), dot6(inverse[1], error), dot6(inverse[2], error));
      turn = scale(per_size, make(dot6(inverse[3], error), dot6(inverse[4], error),
                                  dot6(inverse[5], error)));
      part = 1.0;
    } else if (residual > RESIDUAL) {
      part *= 0.5;
      if (part < 1e-3) {
        *count += steps;
        return STEWART_NO_POSE;
      }
    }
    /* If the residual is small enough this is the last step, to within rounding. */
    moved = add(read3(from.position), scale(part, step));
    at.position[0] = moved.x;
    at.position[1] = moved.y;
    at.position[2] = moved.z;
    turn_by(scale(part, turn), from.rotation, at.rotation);
    if (residual <= RESIDUAL) {
      *count += steps;
      *pose = at;
      return STEWART_OK;
    }
  }
  *count += steps;
  return STEWART_NO_POSE;
}

int stewart_forward_kinematics(
  const stewart_platform * platform, const double lengths[6], stewart_pose * pose)
{
  stewart_pose found;
  double squares[6], done = 0.0, way = 0.25;
  int code, i, steps = 0;
  if (platform == NULL || lengths == NULL || pose == NULL) {
    return STEWART_NULL;
  }
  if (!finite_all(lengths, 6)) {
    return STEWART_NOT_FINITE;
  }
  code = check_pose(pose->position, pose->rotation);
  if (code != STEWART_OK) {
    return code;
  }
  found = *pose;
  orthonormalize(found.rotation);
  orthonormalize(found.rotation);  /* twice: a guess may be 1e-6 off */
  for (i = 0; i < 6; i++) {
    double length = line_of(&platform->legs[i], found.position, found.rotation).length;
    squares[i] = length * length;
  }
  code = newton(platform, lengths, &found, &steps);
  /* Where it does not converge, the lengths are led from those of the guess to those given in
     parts, along a straight line of their squares (homotopy); a part that fails is halved. */
  steps = 0;
  while (code == STEWART_NO_POSE && way >= 1.0 / 256.0 && steps < HOMOTOPY_STEPS) {
    double between[6], reached = least(done + way, 1.0);
    for (i = 0; i < 6; i++) {
      between[i] = reached == 1.0 ? lengths[i] :
        sqrt(squares[i] + reached * (lengths[i] * lengths[i] - squares[i]));
    }
    if (newton(platform, between, &found, &steps) != STEWART_OK) {
      way *= 0.5;
    } else if (reached == 1.0) {
      code = STEWART_OK;
    } else {
      done = reached;
      way *= 2.0;
    }
  }
  if (code == STEWART_OK) {
    *pose = found;
  }
  return code;
}

/* ---- frames/rotation ----------------------------------------------------------------------- */

int stewart_rotation(const double quaternion[4], double rotation[9])
{
  double x, y, z, w, length;
  if (quaternion == NULL || rotation == NULL) {
    return STEWART_NULL;
  }
  if (!finite_all(quaternion, 4)) {
    return STEWART_NOT_FINITE;
  }
  x = quaternion[0];
  y = quaternion[1];
  z = quaternion[2];
  w = quaternion[3];
  length = sqrt(x * x + y * y + z * z + w * w);
  if (!(fabs(length - 1.0) <= QUATERNION_TOLERANCE)) {
    return STEWART_NOT_UNIT;
  }
  x /= length;
  y /= length;
  z /= length;
  w /= length;
  rotation[0] = 1.0 - 2.0 * (y * y + z * z);
  rotation[1] = 2.0 * (x * y - w * z);
  rotation[2] = 2.0 * (x * z + w * y);
  rotation[3] = 2.0 * (x * y + w * z);
  rotation[4] = 1.0 - 2.0 * (x * x + z * z);
  rotation[5] = 2.0 * (y * z - w * x);
  rotation[6] = 2.0 * (x * z - w * y);
  rotation[7] = 2.0 * (y * z + w * x);
  rotation[8] = 1.0 - 2.0 * (x * x + y * y);
  return STEWART_OK;
}
