/* SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * A hexapod by virtual power, body by body: each leg part has its own acceleration, which the
 * joint of the platform determines. Nothing is taken from the core. See independent_hexapod.py.
 */

#include <math.h>
#include <stddef.h>
#include <string.h>

typedef struct {
  double base[6][3], platform[6][3];
  double legs[6][6];       /* mass, center of mass, inertia of cylinder and of piston */
  double actuators[6][4];  /* reflected mass, viscous, Coulomb friction, Coulomb velocity */
  double mass, center[3], inertia[9], gravity[3];
} hexapod;

/* The wrench of all bodies is mass a + rest, the acceleration of the legs jacobian a + bias, with
   a the acceleration of the platform. */
typedef struct {
  double mass[6][6], rest[6], jacobian[6][6], bias[6], lengths[6], rates[6];
} terms;

static double dot(const double a[3], const double b[3])
{return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];}

static void cross(const double a[3], const double b[3], double c[3]) {
  double x = a[1] * b[2] - a[2] * b[1], y = a[2] * b[0] - a[0] * b[2];
  c[2] = a[0] * b[1] - a[1] * b[0], c[0] = x, c[1] = y;
}

static void turn(const double r[9], const double a[3], double b[3])
{for (int i = 0; i < 3; i++) {b[i] = dot(r + 3 * i, a);}}

/* Add k [a]x to a block of a matrix. */
static void add_skew(double m[6][6], int row, int column, double k, const double a[3]) {
  for (int i = 0; i < 3; i++) {
    int j = (i + 1) % 3, l = (i + 2) % 3;
    m[row + j][column + i] += k * a[l], m[row + i][column + j] -= k * a[l];
  }
}

/* Add the mass matrix of a point with a mass, at an arm from the origin. */
static void add_point(double m[6][6], double mass, const double arm[3]) {
  for (int i = 0; i < 3; i++) {
    m[i][i] += mass;
    for (int j = 0; j < 3; j++) {
      m[3 + i][3 + j] += mass * ((i == j ? dot(arm, arm) : 0.0) - arm[i] * arm[j]);
    }
  }
  add_skew(m, 0, 3, -mass, arm), add_skew(m, 3, 0, mass, arm);
}

static void find_terms(
  const hexapod * h, const double x[3], const double r[9], const double twist[6], terms * t) {
  const double * v = twist, * w = twist + 3;
  double center[3], turned[9], momentum[3], force[3], moment[3];
  memset(t, 0, sizeof *t);
  turn(r, h->center, center);
  for (int i = 0; i < 3; i++) {  /* R I R^T */
    double row[3];
    for (int j = 0; j < 3; j++) {
      row[j] = r[3 * i] * h->inertia[j] + r[3 * i + 1] * h->inertia[3 + j] +
        r[3 * i + 2] * h->inertia[6 + j];
    }
    turn(r, row, turned + 3 * i);
  }
  add_point(t->mass, h->mass, center);
  for (int i = 0; i < 3; i++) {
    for (int j = 0; j < 3; j++) {t->mass[3 + i][3 + j] += turned[3 * i + j];}
  }
  cross(w, center, force), cross(w, force, force);
  for (int i = 0; i < 3; i++) {t->rest[i] = h->mass * (force[i] - h->gravity[i]);}
  turn(turned, w, momentum);
  cross(center, t->rest, moment), cross(w, momentum, momentum);
  for (int i = 0; i < 3; i++) {t->rest[3 + i] = moment[i] + momentum[i];}

  for (int leg = 0; leg < 6; leg++) {
    double m1 = h->legs[leg][0], s1 = h->legs[leg][1], i1 = h->legs[leg][2];
    double m2 = h->legs[leg][3], s2 = h->legs[leg][4], i2 = h->legs[leg][5];
    double a[3], s[3], moved[3], turning[3], still[3], drift[3], load[3];
    turn(r, h->platform[leg], a);
    for (int i = 0; i < 3; i++) {s[i] = x[i] + a[i] - h->base[leg][i];}
    double length = sqrt(dot(s, s));
    cross(w, a, moved);
    cross(w, moved, drift);  /* acceleration of a joint of a platform that only turns */
    for (int i = 0; i < 3; i++) {s[i] /= length, moved[i] += v[i];}
    double rate = dot(s, moved);
    for (int i = 0; i < 3; i++) {turning[i] = (moved[i] - rate * s[i]) / length;}  /* of s */
    double square = dot(turning, turning);
    /* The joint's acceleration q turns the direction by (q - s (s . q)) / length and this. */
    for (int i = 0; i < 3; i++) {still[i] = -square * s[i] - 2.0 * rate / length * turning[i];}
    double part = 1.0 - s2 / length;  /* of the joint's acceleration across, at the piston */
    double around = m1 * s1 * s1 + i1 + i2;
    double across = around / (length * length) + m2 * part * part;
    for (int i = 0; i < 3; i++) {
      load[i] = across * drift[i] + (around * still[i] - m1 * s1 * h->gravity[i]) / length -
        m2 * part * (s2 * still[i] + h->gravity[i]);
    }
    double along = m2 * (dot(s, drift) - s2 * dot(s, still) - dot(s, h->gravity)) - dot(s, load);
    for (int i = 0; i < 3; i++) {load[i] += along * s[i];}
    double * row = t->jacobian[leg];
    memcpy(row, s, sizeof s), cross(a, s, row + 3);
    add_point(t->mass, across, a);
    for (int i = 0; i < 6; i++) {
      for (int j = 0; j < 6; j++) {t->mass[i][j] += (m2 - across) * row[i] * row[j];}
    }
    cross(a, load, moment);
    for (int i = 0; i < 3; i++) {t->rest[i] += load[i], t->rest[3 + i] += moment[i];}
    t->bias[leg] = dot(s, drift) + length * square;
    t->lengths[leg] = length, t->rates[leg] = rate;
  }
}

/* Replace b by the solution of a x = b; a is overwritten. */
static void solve(double a[6][6], double b[6]) {
  for (int n = 0; n < 6; n++) {
    int most = n;
    for (int i = n + 1; i < 6; i++) {most = fabs(a[i][n]) > fabs(a[most][n]) ? i : most;}
    for (int j = 0; j < 6; j++) {
      double old = a[n][j];
      a[n][j] = a[most][j], a[most][j] = old;
    }
    double old = b[n];
    b[n] = b[most], b[most] = old;
    for (int i = n + 1; i < 6; i++) {
      double k = a[i][n] / a[n][n];
      for (int j = n; j < 6; j++) {a[i][j] -= k * a[n][j];}
      b[i] -= k * b[n];
    }
  }
  for (int n = 5; n >= 0; n--) {
    for (int j = n + 1; j < 6; j++) {b[n] -= a[n][j] * b[j];}
    b[n] /= a[n][n];
  }
}

static double friction(const hexapod * h, int leg, double rate) {
  const double * actuator = h->actuators[leg];
  return actuator[1] * rate + actuator[2] * fmin(fmax(rate / actuator[3], -1.0), 1.0);
}

/* Lengths, rates and forces of the legs in a motion. */
void moving(
  const hexapod * h, size_t count, const double (* positions)[3], const double (* rotations)[9],
  const double (* twists)[6], const double (* accelerations)[6], double (* legs)[3][6]) {
  for (size_t n = 0; n < count; n++) {
    const double * a = accelerations[n];
    terms t;
    double transposed[6][6], wrench[6];
    find_terms(h, positions[n], rotations[n], twists[n], &t);
    for (int i = 0; i < 6; i++) {
      wrench[i] = t.rest[i];
      for (int j = 0; j < 6; j++) {
        wrench[i] += t.mass[i][j] * a[j], transposed[i][j] = t.jacobian[j][i];
      }
    }
    solve(transposed, wrench);
    for (int i = 0; i < 6; i++) {
      double acceleration = t.bias[i];
      for (int j = 0; j < 6; j++) {acceleration += t.jacobian[i][j] * a[j];}
      legs[n][0][i] = t.lengths[i], legs[n][1][i] = t.rates[i];
      legs[n][2][i] = wrench[i] + h->actuators[i][0] * acceleration + friction(h, i, t.rates[i]);
    }
  }
}

typedef struct { double position[3], rotation[9], twist[6]; } state;

/* Rates of a state under forces of the drives. */
static void find_rates(
  const hexapod * h, const state * at, const double forces[6], state * rates) {
  terms t;
  find_terms(h, at->position, at->rotation, at->twist, &t);
  for (int i = 0; i < 6; i++) {rates->twist[i] = -t.rest[i];}
  for (int leg = 0; leg < 6; leg++) {
    const double * row = t.jacobian[leg];
    double reflected = h->actuators[leg][0];
    double force = forces[leg] - reflected * t.bias[leg] - friction(h, leg, t.rates[leg]);
    for (int i = 0; i < 6; i++) {
      rates->twist[i] += row[i] * force;
      for (int j = 0; j < 6; j++) {t.mass[i][j] += reflected * row[i] * row[j];}
    }
  }
  solve(t.mass, rates->twist);
  memcpy(rates->position, at->twist, sizeof rates->position);
  for (int j = 0; j < 3; j++) {
    double column[3] = {at->rotation[j], at->rotation[3 + j], at->rotation[6 + j]};
    cross(at->twist + 3, column, column);
    for (int i = 0; i < 3; i++) {rates->rotation[3 * i + j] = column[i];}
  }
}

static state moved(const state * from, const state * rates, double time) {
  state to;
  const double * a = (const double *)from, * b = (const double *)rates;
  for (int i = 0; i < 18; i++) {((double *)&to)[i] = a[i] + time * b[i];}
  return to;
}

/* One step towards an orthogonal matrix, r (3 - r^T r) / 2. */
static void orthogonalize(double r[9]) {
  double new[9];
  for (int i = 0; i < 9; i++) {
    int row = 3 * (i / 3), column = i % 3;
    new[i] = 1.5 * r[i];
    for (int k = 0; k < 3; k++) {
      double product = r[k] * r[column] + r[3 + k] * r[3 + column] + r[6 + k] * r[6 + column];
      new[i] -= 0.5 * r[row + k] * product;
    }
  }
  memcpy(r, new, sizeof new);
}

/* Follow lengths and rates by a controller of each leg, from a pose at rest; the forces are held
   in a period. Integration by the midpoint method in equal parts of a period. */
void controlled(
  const hexapod * h, size_t count, const double position[3], const double rotation[9],
  const double (* lengths)[6], const double (* rates)[6], const double forces[6],
  const double gains[2], double period, size_t parts, double (* legs)[3][6]) {
  state at;
  memset(&at, 0, sizeof at);
  memcpy(at.position, position, sizeof at.position);
  memcpy(at.rotation, rotation, sizeof at.rotation);
  for (size_t n = 0; n < count; n++) {
    double step = period / parts;
    terms t;
    find_terms(h, at.position, at.rotation, at.twist, &t);
    for (int i = 0; i < 6; i++) {
      legs[n][0][i] = t.lengths[i], legs[n][1][i] = t.rates[i];
      legs[n][2][i] = forces[i] + gains[0] * (lengths[n][i] - t.lengths[i]) +
        gains[1] * (rates[n][i] - t.rates[i]);
    }
    for (size_t part = 0; part < parts; part++) {
      state slope, middle;
      find_rates(h, &at, legs[n][2], &slope);
      middle = moved(&at, &slope, 0.5 * step);
      find_rates(h, &middle, legs[n][2], &slope);
      at = moved(&at, &slope, step);
      orthogonalize(at.rotation);
    }
  }
}
