/* SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * One sample; forward dynamics, base wrench, regressor, external wrench.
 */

/* ---- one sample ------------------------------------------------------------------------------ */

/* Whether a base adds a load: one of nan adds none. */
static int moves(const stewart_base * base) {return base->gravity[0] == base->gravity[0];}

static load load_of(const double wrench[6]) {
  load external = {read3(wrench), read3(wrench + 3)};
  return external;
}

/* Write the result of one sample, unchecked; see solve. */
FLAT static void solve_sample(
  const stewart_platform * platform, const stewart_motion * motion, const double wrench[6],
  const stewart_base * base, int conditioned, stewart_result * result) {
  load external = load_of(wrench);
  moving_base moving;
  if (moves(base)) {
    moving = base_of(platform, base);
    load carried = carry(platform, motion, &moving);
    external.force = subtract(external.force, carried.force);
    external.moment = subtract(external.moment, carried.moment);
  }
  clear_result(result);
  solve(platform, motion, external, moves(base) ? &moving : NULL, conditioned, result);
}

int64_t solve_one(const stewart_platform * platform, one_motion * sample) {
  const stewart_result * result = &sample->result;
  solve_sample(platform, &sample->motion, sample->wrench, &sample->base, 1,
               &sample->result);
  return all_finite(result, sizeof *result) && result->condition_number < UNSOLVABLE_CONDITION;
}

/* ---- forward dynamics ----------------------------------------------------------------------- */

/* A linear system for the acceleration: M and its right-hand side, in coordinates [v; size w],
   where all entries of M are masses. */
typedef struct { double mass[6][6], right[6]; } system6;

/* Add the M of a rigid body with this moment of mass [kg m] and inertia about the origin. */
static void add_body(
  system6 * work, double mass, vector moment, const double inertia[6], double per_size) {
  vector m = scale(per_size, moment);
  double k = per_size * per_size;
  for (int n = 0; n < 3; n++) {work->mass[n][n] += mass;}
  work->mass[3][1] -= m.z, work->mass[3][2] += m.y, work->mass[4][0] += m.z;
  work->mass[4][2] -= m.x, work->mass[5][0] -= m.y, work->mass[5][1] += m.x;
  work->mass[3][3] += k * inertia[0], work->mass[4][3] += k * inertia[1];
  work->mass[5][3] += k * inertia[2], work->mass[4][4] += k * inertia[3];
  work->mass[5][4] += k * inertia[4], work->mass[5][5] += k * inertia[5];
}

/* Add the inertia of a point mass about the origin of its arm. */
static void add_point(double inertia[6], double mass, vector a) {
  inertia[0] += mass * (a.y * a.y + a.z * a.z), inertia[1] += -mass * a.x * a.y;
  inertia[2] += -mass * a.x * a.z, inertia[3] += mass * (a.x * a.x + a.z * a.z);
  inertia[4] += -mass * a.y * a.z, inertia[5] += mass * (a.x * a.x + a.y * a.y);
}

/* Write R I R^T. */
static void turned_inertia(const double r[9], const double inertia[6], double turned_to[6]) {
  vector x = rotate(r, symmetric(inertia, read3(r)));
  vector y = rotate(r, symmetric(inertia, read3(r + 3)));
  vector z = rotate(r, symmetric(inertia, read3(r + 6)));
  turned_to[0] = x.x, turned_to[1] = x.y, turned_to[2] = x.z;
  turned_to[3] = y.y, turned_to[4] = y.z, turned_to[5] = z.z;
}

/* Add a force along a row, and a mass that moves with it. */
static void add_row(system6 * work, const double row[6], double push, double mass) {
  for (int i = 0; i < 6; i++) {
    work->right[i] += push * row[i];
    for (int k = 0; k <= i; k++) {work->mass[i][k] += mass * row[i] * row[k];}
  }
}

/* Add the coupling of a row with the motion of a point in a direction. */
static void add_coupling(
  system6 * work, const double row[6], vector arm, vector coupling, double per_size) {
  double of_point[6];
  put3(of_point, coupling), put3(of_point + 3, scale(per_size, cross(arm, coupling)));
  for (int i = 0; i < 6; i++) {
    for (int k = 0; k <= i; k++) {
      work->mass[i][k] += row[i] * of_point[k] + of_point[i] * row[k];
    }
  }
}

/* Solve the positive definite system in place: L L^T x = right. */
static void cholesky(system6 * work) {
  for (int n = 0; n < 6; n++) {
    for (int k = 0; k <= n; k++) {
      double rest = work->mass[n][k];
      for (int m = 0; m < k; m++) {rest -= work->mass[n][m] * work->mass[k][m];}
      /* zero where masses underflow: the result is not finite then */
      work->mass[n][k] = k < n ? rest / work->mass[k][k] : rest > 0.0 ? sqrt(rest) : 0.0;
    }
    double rest = work->right[n];
    for (int m = 0; m < n; m++) {rest -= work->mass[n][m] * work->right[m];}
    work->right[n] = rest / work->mass[n][n];
  }
  for (int n = 5; n >= 0; n--) {
    double rest = work->right[n];
    for (int m = n + 1; m < 6; m++) {rest -= work->mass[m][n] * work->right[m];}
    work->right[n] = rest / work->mass[n][n];
  }
}

/* Write the acceleration of a motion under efforts of the drives. */
FLAT static void accelerate(
  const stewart_platform * platform, stewart_motion * motion, const double efforts[6],
  const double wrench[6], const stewart_base * base) {
  double per_size = 1.0 / platform->characteristic_length, inertia[6];
  int turns = moves(base);
  const double * r = motion->rotation;
  system6 work = {{{0.0}}, {0.0}};
  for (int n = 0; n < 3; n++) {
    motion->linear_acceleration[n] = motion->angular_acceleration[n] = 0.0;
  }
  double mass = platform->mass;
  vector com = rotate(r, read3(platform->center_of_mass)), moment = scale(mass, com);
  turned_inertia(r, platform->inertia, inertia);
  add_point(inertia, mass, com);
  load rest = load_of(wrench), moved = move_platform(platform, motion);
  rest.force = subtract(rest.force, moved.force);
  rest.moment = subtract(rest.moment, moved.moment);
  moving_base moving;
  if (turns) {
    moving = base_of(platform, base);
    load carried = carry(platform, motion, &moving);
    rest.force = subtract(rest.force, carried.force);
    rest.moment = subtract(rest.moment, carried.moment);
  }
  leg_motion legs[6];
  leg_mass masses[6];
  move_legs(platform, motion, turns ? &moving : NULL, legs);
  put_masses(platform, motion, legs, masses);
  for (int i = 0; i < 6; i++) {
    const leg_motion * of = &legs[i];
    const leg_mass * own = &masses[i];
    vector arm = rotate(r, read3(platform->legs[i].platform_joint));
    mass += own->point;
    moment = add(moment, scale(own->point, arm));
    add_point(inertia, own->point, arm);
    rest.force = subtract(rest.force, of->moved.force);
    rest.moment = subtract(rest.moment, of->moved.moment);
    if (own->line != 0.0) {add_row(&work, of->row, 0.0, own->line);}
    add_row(&work, own->row, efforts[i] - own->effort, own->drive);
    if (dot(own->coupling, own->coupling) != 0.0) {
      add_coupling(&work, own->row, arm, own->coupling, per_size);
    }
  }
  add_body(&work, mass, moment, inertia, per_size);
  double right[6];
  put3(right, rest.force), put3(right + 3, scale(per_size, rest.moment));
  for (int n = 0; n < 6; n++) {work.right[n] += right[n];}
  cholesky(&work);
  for (int n = 0; n < 3; n++) {
    motion->linear_acceleration[n] = work.right[n];
    motion->angular_acceleration[n] = per_size * work.right[3 + n];
  }
}

int64_t forward_dynamics_one(const stewart_platform * platform, one_motion * sample) {
  accelerate(platform, &sample->motion, sample->forces, sample->wrench, &sample->base);
  return all_finite(&sample->motion, sizeof sample->motion);
}

void forward_dynamics_many(
  const stewart_platform * platform, int64_t count, stewart_motion * motions,
  const double * efforts, int64_t n_wrenches, const double * wrenches, int64_t n_bases,
  const stewart_base * bases) {
  for (int64_t n = 0; n < count; n++) {
    accelerate(platform, &motions[n], &efforts[6 * n], &wrenches[n_wrenches == 1 ? 0 : 6 * n],
               &bases[n_bases == 1 ? 0 : n]);
  }
}

/* ---- base wrench ---------------------------------------------------------------------------- */

static load platform_momentum_rate(
  const stewart_platform * platform, const stewart_motion * motion, const absolute_motion * of) {
  load rates;
  const double * r = motion->rotation, * inertia = platform->inertia;
  vector com = rotate(r, read3(platform->center_of_mass));
  vector omega = rotate_back(r, of->omega), alpha = rotate_back(r, of->alpha);
  vector moment = add(symmetric(inertia, alpha), cross(omega, symmetric(inertia, omega)));
  rates.force = scale(
    platform->mass, add(of->acceleration, carried_along(of->omega, of->alpha, com)));
  rates.moment = add(rotate(r, moment), cross(add(of->position, com), rates.force));
  return rates;
}

FLAT void base_wrenches_many(
  const stewart_platform * platform, int64_t count, const stewart_motion * motions,
  int64_t n_wrenches, const double * wrenches, int64_t n_bases, const stewart_base * bases,
  double * results) {
  for (int64_t n = 0; n < count; n++) {
    const stewart_motion * motion = &motions[n];
    absolute_motion of = absolute_of(motion, &bases[n_bases == 1 ? 0 : n]);
    load rest = load_of(&wrenches[n_wrenches == 1 ? 0 : 6 * n]);
    load rates = platform_momentum_rate(platform, motion, &of);
    rest.moment = add(rest.moment, cross(of.position, rest.force));
    rest.force = subtract(rest.force, rates.force);
    rest.moment = subtract(rest.moment, rates.moment);
    for (int i = 0; i < 6; i++) {
      rates = leg_momentum_rate(platform, i, motion, &of);
      rest.force = subtract(rest.force, rates.force);
      rest.moment = subtract(rest.moment, rates.moment);
    }
    put3(&results[6 * n], rest.force), put3(&results[6 * n + 3], rest.moment);
  }
}

int64_t base_wrench_one(const stewart_platform * platform, one_motion * sample) {
  base_wrenches_many(
    platform, 1, &sample->motion, 1, sample->wrench, 1, &sample->base, sample->base_wrench);
  return all_finite(sample->base_wrench, sizeof sample->base_wrench);
}

/* ---- regressor ------------------------------------------------------------------------------ */

/* Columns of the regressor: ten of the platform; of the legs, from LEGS on, six numbers each of
   their masses and moments, then of the reflected mass, viscous and Coulomb friction, offset of
   each: the order of dynamics/linear_parameters.py. */
enum { MASS = 0, FIRST_MOMENT = 1, INERTIA = 4, LEGS = 10, OF_DRIVES = 24 };

/* Write the ten numbers of the platform, for a force of a leg u, with the moment h. */
static void put_platform(
  const stewart_motion * motion, const absolute_motion * of, vector u, vector h, double * row) {
  const double * r = motion->rotation;
  vector f = of->omega, d = of->alpha;
  double carrying[9];  /* maps r to w' x r + w x (w x r) */
  put_matrix(
    carrying, make(-(f.y * f.y + f.z * f.z), f.x * f.y - d.z, f.x * f.z + d.y),
    make(f.x * f.y + d.z, -(f.x * f.x + f.z * f.z), f.y * f.z - d.x),
    make(f.x * f.z - d.y, f.y * f.z + d.x, -(f.x * f.x + f.y * f.y)));
  row[MASS] = dot(u, of->acceleration);
  put3(row + FIRST_MOMENT, rotate_back(
    r, add(rotate_back(carrying, u), cross(of->acceleration, h))));
  vector w = rotate_back(r, f), dw = rotate_back(r, d), p = rotate_back(r, h), q = cross(p, w);
  double * inertia = row + INERTIA;
  inertia[0] = p.x * dw.x + q.x * w.x;
  inertia[1] = p.x * dw.y + p.y * dw.x + q.x * w.y + q.y * w.x;
  inertia[2] = p.x * dw.z + p.z * dw.x + q.x * w.z + q.z * w.x;
  inertia[3] = p.y * dw.y + q.y * w.y;
  inertia[4] = p.y * dw.z + p.z * dw.y + q.y * w.z + q.z * w.y;
  inertia[5] = p.z * dw.z + q.z * w.z;
}

/* Write a regressor; returns how many numbers it has. */
static int64_t put_regressor(
  const stewart_platform * platform, const stewart_motion * motion, const absolute_motion * of,
  double * rows) {
  double inverse[6][6], per_size = 1.0 / platform->characteristic_length;
  leg_columns columns[6];
  int count = 0;
  for (int i = 0; i < 6; i++) {
    count = put_columns(platform, i, motion, of, &columns[i]);
    for (int n = 0; n < 6; n++) {inverse[n][i] = columns[i].row[n];}
  }
  invert(inverse);
  int width = LEGS + 6 * count + OF_DRIVES, drives = LEGS + 6 * count;
  for (int i = 0; i < 6; i++) {
    const leg_columns * own = &columns[i];
    double * row = &rows[width * i];
    vector u = scale(own->lever, read3(inverse[i]));
    vector h = scale(own->lever, scale(per_size, read3(inverse[i] + 3)));
    for (int n = 0; n < width; n++) {row[n] = 0.0;}
    put_platform(motion, of, u, h, row);
    for (int k = 0; k < 6; k++) {
      vector by = add(u, cross(h, columns[k].arm));
      for (int n = 0; n < count; n++) {
        row[LEGS + 6 * n + k] =
          dot(by, columns[k].of_mass[n]) + (k == i ? own->effort[n] : 0.0);
      }
    }
    row[drives + i] = own->acceleration;
    row[drives + 6 + i] = own->rate;
    row[drives + 12 + i] = slip(own->rate / platform->legs[i].coulomb_velocity);
    row[drives + 18 + i] = 1.0;
  }
  return 6 * width;
}

FLAT void regressors_many(
  const stewart_platform * platform, int64_t count, const stewart_motion * motions,
  int64_t n_bases, const stewart_base * bases, double * results) {
  for (int64_t n = 0; n < count; n++) {
    stewart_base still = {{0.0}, {0.0}, {0.0}, {0.0}};
    const stewart_base * base = &bases[n_bases == 1 ? 0 : n];
    put3(still.gravity, read3(platform->gravity));
    absolute_motion of = absolute_of(&motions[n], moves(base) ? base : &still);
    results += put_regressor(platform, &motions[n], &of, results);
  }
}

/* ---- external wrench ------------------------------------------------------------------------ */

/* Add w_ext = J_q^T (f_model - f_measured), times a weight. */
static void add_external_wrench(
  const stewart_platform * platform, const double position[3], const double rotation[9],
  const double model[6], const double measured[6], double weight, double wrench[6]) {
  for (int i = 0; i < 6; i++) {
    double row[6], effort = weight * (model[i] - measured[i]);
    put_drive_row(platform, i, position, rotation, 1.0, row);
    for (int n = 0; n < 6; n++) {wrench[n] += effort * row[n];}
  }
}

void external_wrenches_many(
  const stewart_platform * platform, int64_t count, const stewart_pose * poses,
  const double * model_efforts, const double * measured_efforts, double * wrenches) {
  for (int64_t n = 0; n < count; n++) {
    for (int i = 0; i < 6; i++) {wrenches[6 * n + i] = 0.0;}
    add_external_wrench(
      platform, poses[n].position, poses[n].rotation, &model_efforts[6 * n],
      &measured_efforts[6 * n], 1.0, &wrenches[6 * n]);
  }
}

/* Add an end of the interval between two measurements: half of the wrench and of the model. */
static void add_end(
  const stewart_platform * platform, one_measurement * m, const stewart_motion * motion,
  const stewart_base * base) {
  stewart_result result;
  solve_sample(platform, motion, m->known, base, 1, &result);
  const double * model = efforts_of(platform, &result);
  add_external_wrench(
    platform, motion->position, motion->rotation, model, m->forces, 0.5, m->after);
  for (int i = 0; i < 6; i++) {m->differences[i] += 0.5 * (m->forces[i] - model[i]);}
}

void estimate_one(const stewart_platform * platform, one_measurement * m) {
  double rows[6][6], inverse[6][6], dt = m->interval;
  leg_line lines[6];
  int steps;
  stewart_motion * before = &m->motion, * now = &m->motion_after;
  *now = *before;
  lines_at(platform, before->position, before->rotation, lines);
  m->across = scaled_jacobian(platform, lines, rows, inverse) * m->target < 0.0;
  m->code = find_pose(platform, m->lengths, (stewart_pose *)now, &steps, &m->residual);
  m->steps = steps;
  if (m->code != STEWART_OK) {return;}
  lines_at(platform, now->position, now->rotation, lines);
  scaled_jacobian(platform, lines, rows, inverse);
  put_twist(platform, lines, inverse, m->rates, now);
  for (int n = 0; n < 3; n++) {
    now->linear_acceleration[n] = before->linear_acceleration[n] =
      dt > 0.0 ? (now->linear_velocity[n] - before->linear_velocity[n]) / dt : 0.0;
    now->angular_acceleration[n] = before->angular_acceleration[n] =
      dt > 0.0 ? (now->angular_velocity[n] - before->angular_velocity[n]) / dt : 0.0;
  }
  for (int n = 0; n < 6; n++) {m->after[n] = m->differences[n] = 0.0;}
  if (dt > 0.0) {  /* the mean of both ends */
    add_end(platform, m, before, &m->base_before);
    add_end(platform, m, now, &m->base);
    for (int n = 0; n < 6; n++) {
      m->after[n] = m->before[n] + m->gain * (m->after[n] - m->before[n]);
    }
  }
  if (!all_finite(now, sizeof *now) || !all_finite(m->after, sizeof m->after) ||
    !all_finite(m->differences, sizeof m->differences)) {
    m->code = STEWART_OUT_OF_RANGE;
  }
}
