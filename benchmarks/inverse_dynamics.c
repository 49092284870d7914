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

// The arithmetic of stewart_dynamics/inverse_dynamics.py as a C programmer writes it: one
// sample after the other, structures and loops over the six legs. The measure for the batch.

#include <math.h>
#include <stdbool.h>
#include <stddef.h>

#define SMALLEST_PIVOT 1e-32  // matrix6.SMALLEST_PIVOT
#define MOST_STEPS 64         // inverse_dynamics._MOST_STEPS

// gcc leaves most loops around loops of six as loops by itself; unrolled they take a quarter
// less time.
#define UNROLL _Pragma("GCC unroll 6")

typedef struct { double x, y, z; } vector;

typedef struct {
  vector base_joint, platform_joint;
  double piston_mass, piston_com, cylinder_moment, joint_inertia;
  double reflected_mass, viscous, coulomb, coulomb_velocity, cylinder_mass;
} leg;

typedef struct {
  vector gravity;
  double size, mass;
  vector com;
  double inertia[6];  // xx xy xz yy yz zz
  leg legs[6];
} machine;

typedef struct {
  vector position;
  double rotation[9];  // row by row
  vector velocity, omega, acceleration, alpha;
} motion;

typedef struct { vector force, moment; } wrench;

typedef struct {
  double lengths[6], rates[6], forces[6], unit_load_forces[6];
  double determinant, determinant_rate, condition;
} result;

_Static_assert(sizeof(machine) == (14 + 6 * 15) * sizeof(double), "MACHINE");
_Static_assert(sizeof(motion) == 24 * sizeof(double), "MOTION");
_Static_assert(sizeof(wrench) == 6 * sizeof(double), "WRENCH");
_Static_assert(sizeof(result) == 27 * sizeof(double), "RESULT");

static inline vector add(vector a, vector b)
{
  return (vector){a.x + b.x, a.y + b.y, a.z + b.z};
}

static inline vector subtract(vector a, vector b)
{
  return (vector){a.x - b.x, a.y - b.y, a.z - b.z};
}

static inline vector scale(double k, vector a)
{
  return (vector){k * a.x, k * a.y, k * a.z};
}

static inline double dot(vector a, vector b)
{
  return a.x * b.x + a.y * b.y + a.z * b.z;
}

static inline vector cross(vector a, vector b)
{
  return (vector){a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

static inline vector rotate(const double r[9], vector a)
{
  return (vector){
    r[0] * a.x + r[1] * a.y + r[2] * a.z,
    r[3] * a.x + r[4] * a.y + r[5] * a.z,
    r[6] * a.x + r[7] * a.y + r[8] * a.z};
}

static inline vector rotate_back(const double r[9], vector a)
{
  return (vector){
    r[0] * a.x + r[3] * a.y + r[6] * a.z,
    r[1] * a.x + r[4] * a.y + r[7] * a.z,
    r[2] * a.x + r[5] * a.y + r[8] * a.z};
}

static inline vector symmetric(const double i[6], vector a)
{
  return (vector){
    i[0] * a.x + i[1] * a.y + i[2] * a.z,
    i[1] * a.x + i[3] * a.y + i[4] * a.z,
    i[2] * a.x + i[4] * a.y + i[5] * a.z};
}

static inline double dot6(const double a[6], const double b[6])
{
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3] + a[4] * b[4] + a[5] * b[5];
}

// Force and moment at the platform's origin that move the platform.
static inline wrench platform_wrench(const machine * m, const motion * x)
{
  vector com = rotate(x->rotation, m->com);
  vector acceleration = add(
    add(x->acceleration, cross(x->alpha, com)), cross(x->omega, cross(x->omega, com)));
  vector force = scale(m->mass, subtract(acceleration, m->gravity));
  vector omega = rotate_back(x->rotation, x->omega);
  vector alpha = rotate_back(x->rotation, x->alpha);
  vector moment = add(
    symmetric(m->inertia, alpha), cross(omega, symmetric(m->inertia, omega)));
  return (wrench){force, add(rotate(x->rotation, moment), cross(com, force))};
}

typedef struct {
  double length, rate, actuator;
  wrench load;                        // on the platform joint, taken at the platform's origin
  double jacobian[6], jacobian_rate[6];  // moments divided by the characteristic length
} leg_motion;

static inline leg_motion move_leg(
  const leg * l, const motion * x, vector gravity, double inverse_size)
{
  leg_motion out;
  vector a = rotate(x->rotation, l->platform_joint);
  vector leg_vector = subtract(add(x->position, a), l->base_joint);
  double length = sqrt(dot(leg_vector, leg_vector));
  double inverse_length = length > 0.0 ? 1.0 / length : 0.0;
  vector s = scale(inverse_length, leg_vector);

  vector a_rate = cross(x->omega, a);
  vector joint_rate = add(x->velocity, a_rate);
  double rate = dot(s, joint_rate);
  vector across = subtract(joint_rate, scale(rate, s));
  double across_squared = dot(across, across);
  vector joint_acc = add(add(x->acceleration, cross(x->alpha, a)), cross(x->omega, a_rate));
  double along_acc = dot(s, joint_acc);
  vector across_acc = subtract(joint_acc, scale(along_acc, s));
  double along_gravity = dot(s, gravity);
  vector across_gravity = subtract(gravity, scale(along_gravity, s));

  double piston_distance = length - l->piston_com;
  double piston_moment = l->piston_mass * piston_distance;
  double inertia = (l->joint_inertia + piston_moment * piston_distance)
    * inverse_length * inverse_length;
  double gravity_mass = (l->cylinder_moment + piston_moment) * inverse_length;
  double coriolis_mass = piston_moment * inverse_length - inertia;
  double along = l->piston_mass * (along_acc - along_gravity
    + l->piston_com * inverse_length * inverse_length * across_squared);
  vector force = subtract(scale(inertia, across_acc), scale(gravity_mass, across_gravity));
  force = add(force, scale(2.0 * coriolis_mass * rate * inverse_length, across));
  force = add(force, scale(along, s));

  double slip = rate / l->coulomb_velocity;
  slip = slip < -1.0 ? -1.0 : slip > 1.0 ? 1.0 : slip;
  out.length = length;
  out.rate = rate;
  out.actuator = l->reflected_mass * (along_acc + across_squared * inverse_length)
    + l->viscous * rate + l->coulomb * slip;
  out.load = (wrench){force, cross(a, force)};

  vector s_rate = scale(inverse_length, across);
  vector moment = scale(inverse_size, cross(a, s));
  vector moment_rate = scale(inverse_size, add(cross(a_rate, s), cross(a, s_rate)));
  double row[6] = {s.x, s.y, s.z, moment.x, moment.y, moment.z};
  double row_rate[6] = {
    s_rate.x, s_rate.y, s_rate.z, moment_rate.x, moment_rate.y, moment_rate.z};
  for (int n = 0; n < 6; n++) {
    out.jacobian[n] = row[n];
    out.jacobian_rate[n] = row_rate[n];
  }
  return out;
}

static inline void exchange(double * restrict a, double * restrict b)
{
  double old = *a;
  *a = *b;
  *b = old;
}

// Turn a into its inverse in place, by Gauss-Jordan with partial pivoting; return det(a).
static inline double invert(double a[6][6])
{
  int pivots[6];
  double det = 1.0;
  UNROLL for (int n = 0; n < 6; n++) {
    int best = n;
    UNROLL for (int i = n + 1; i < 6; i++) {
      if (fabs(a[i][n]) > fabs(a[best][n])) {
        best = i;
      }
    }
    pivots[n] = best;
    if (best != n) {
      det = -det;
      UNROLL for (int j = 0; j < 6; j++) {
        exchange(&a[n][j], &a[best][j]);
      }
    }
    det *= a[n][n];
    double inverse = 1.0 / (fabs(a[n][n]) > SMALLEST_PIVOT ? a[n][n] : SMALLEST_PIVOT);
    a[n][n] = 1.0;
    UNROLL for (int j = 0; j < 6; j++) {
      a[n][j] *= inverse;
    }
    UNROLL for (int i = 0; i < 6; i++) {
      if (i != n) {
        double k = a[i][n];
        a[i][n] = 0.0;
        UNROLL for (int j = 0; j < 6; j++) {
          a[i][j] -= k * a[n][j];
        }
      }
    }
  }
  UNROLL for (int n = 5; n >= 0; n--) {
    if (pivots[n] != n) {
      UNROLL for (int i = 0; i < 6; i++) {
        exchange(&a[i][n], &a[i][pivots[n]]);
      }
    }
  }
  return det;
}

// The lower triangle of a a^T; return its trace.
static inline double gram(double a[6][6], double g[6][6])
{
  double trace = 0.0;
  for (int i = 0; i < 6; i++) {
    for (int j = 0; j <= i; j++) {
      g[i][j] = dot6(a[i], a[j]);
    }
    trace += g[i][i];
  }
  return trace;
}

typedef struct { double diagonal[6], squares[5]; } tridiagonal;  // off the diagonal: squares

// Householder's tridiagonal matrix of g (lower triangle, overwritten), eigenvalues times k.
static inline void tridiagonalize(double g[6][6], double k, tridiagonal * restrict t)
{
  t->diagonal[0] = k * g[0][0];
  UNROLL for (int n = 0; n < 4; n++) {
    double v[6], w[6], square = 0.0;
    UNROLL for (int i = n + 1; i < 6; i++) {
      v[i] = g[i][n];
      square += v[i] * v[i];
    }
    double length = sqrt(square);
    double half = square + length * fabs(v[n + 1]);
    double b = half > 0.0 ? 1.0 / half : 0.0;
    v[n + 1] += copysign(length, v[n + 1]);
    double wv = 0.0;
    UNROLL for (int i = n + 1; i < 6; i++) {
      double sum = 0.0;
      UNROLL for (int j = n + 1; j < 6; j++) {
        sum += (i < j ? g[j][i] : g[i][j]) * v[j];
      }
      w[i] = b * sum;
      wv += w[i] * v[i];
    }
    double c = 0.5 * b * wv;
    UNROLL for (int i = n + 1; i < 6; i++) {
      w[i] -= c * v[i];
    }
    UNROLL for (int i = n + 1; i < 6; i++) {
      UNROLL for (int j = n + 1; j <= i; j++) {
        g[i][j] -= v[i] * w[j] + w[i] * v[j];
      }
    }
    t->diagonal[n + 1] = k * g[n + 1][n + 1];
    t->squares[n] = k * k * square;
  }
  t->diagonal[5] = k * g[5][5];
  t->squares[4] = k * k * g[5][4] * g[5][4];
}

// Laguerre's step down on the largest eigenvalue of t; x itself where it is there.
static inline double laguerre_step(double x, const tridiagonal * t)
{
  double q = 1.0, dq = 0.0, ddq = 0.0;
  double p = x - t->diagonal[0], dp = 1.0, ddp = 0.0;
  for (int n = 1; n < 6; n++) {
    double y = x - t->diagonal[n], e = t->squares[n - 1];
    double next = y * p - e * q;
    double dnext = p + y * dp - e * dq;
    double ddnext = 2.0 * dp + y * ddp - e * ddq;
    q = p, dq = dp, ddq = ddp;
    p = next, dp = dnext, ddp = ddnext;
  }
  double root = 25.0 * dp * dp - 30.0 * p * ddp;
  double divisor = dp + sqrt(root > 0.0 ? root : 0.0);
  double nearer = x - 6.0 * p / (divisor > 0.0 ? divisor : 1.0);
  return p > 0.0 && divisor > 0.0 && 0.0 < nearer && nearer < x ? nearer : x;
}

static inline void solve_one(
  const machine * restrict m, const motion * restrict x, const wrench * restrict external,
  result * restrict out)
{
  double jacobian[6][6], jacobian_rate[6][6], inverse[6][6], actuator[6];
  double inverse_size = 1.0 / m->size;
  wrench load = platform_wrench(m, x);
  load.force = subtract(load.force, external->force);
  load.moment = subtract(load.moment, external->moment);
  for (int i = 0; i < 6; i++) {
    leg_motion l = move_leg(&m->legs[i], x, m->gravity, inverse_size);
    out->lengths[i] = l.length;
    out->rates[i] = l.rate;
    actuator[i] = l.actuator;
    load.force = add(load.force, l.load.force);
    load.moment = add(load.moment, l.load.moment);
    for (int j = 0; j < 6; j++) {
      jacobian[i][j] = l.jacobian[j];
      jacobian_rate[i][j] = l.jacobian_rate[j];
      inverse[j][i] = l.jacobian[j];
    }
  }

  // The rows of (J^T)^-1: forces of a wrench, largest forces of unit loads, d(det)/dt.
  double det = invert(inverse) * m->size * m->size * m->size;
  vector moment = scale(inverse_size, load.moment);
  double w[6] = {load.force.x, load.force.y, load.force.z, moment.x, moment.y, moment.z};
  double change = 0.0;
  for (int i = 0; i < 6; i++) {
    out->forces[i] = dot6(inverse[i], w) + actuator[i];
    change += dot6(inverse[i], jacobian_rate[i]);
  }
  out->determinant = det;
  out->determinant_rate = det * change;

  // The condition number: the largest eigenvalues of J J^T and of its inverse.
  double g[6][6], h[6][6];
  double g_trace = gram(jacobian, g), h_trace = gram(inverse, h);
  for (int i = 0; i < 6; i++) {
    out->unit_load_forces[i] = sqrt(h[i][i]);
  }
  tridiagonal s, t;
  tridiagonalize(g, g_trace > 0.0 ? 1.0 / g_trace : 0.0, &s);
  tridiagonalize(h, h_trace > 0.0 ? 1.0 / h_trace : 0.0, &t);
  double y = 1.0 + 1e-14, z = 1.0 + 1e-14;  // the trace, but for rounding
  for (int n = 0; n < MOST_STEPS; n++) {
    double nearer_y = laguerre_step(y, &s), nearer_z = laguerre_step(z, &t);
    bool there = nearer_y == y && nearer_z == z;
    y = nearer_y, z = nearer_z;
    if (there) {
      break;
    }
  }
  out->condition = sqrt(g_trace) * sqrt(h_trace) * (sqrt(y) * sqrt(z));
}

// wrench_step: 1, or 0 where all samples have the same wrench.
void solve(
  const machine * restrict m, const motion * restrict motions, const wrench * restrict wrenches,
  size_t wrench_step, result * restrict results, size_t many)
{
  for (size_t k = 0; k < many; k++) {
    solve_one(m, &motions[k], &wrenches[k * wrench_step], &results[k]);
  }
}
