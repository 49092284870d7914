/* SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * Forward dynamics, base wrench, regressor, external wrench.
 */

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

/* Write the acceleration of a motion under leg forces. */
FLAT static void accelerate(
  const stewart_platform * platform, stewart_motion * motion, const double forces[6],
  const double wrench[6], const stewart_base * base) {
  double per_size = 1.0 / platform->characteristic_length, inertia[6];
  int turning = platform->legs[0].pitch != 0.0, moving = moves(base);
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
  if (moving) {
    load carried = carry(platform, motion, base);
    rest.force = subtract(rest.force, carried.force);
    rest.moment = subtract(rest.moment, carried.moment);
  }
  for (int i = 0; i < 6; i++) {
    const stewart_leg * leg = &platform->legs[i];
    double length, rate, actuator, row[6], row_rate[6];
    leg_pose at = pose_of(leg, motion->position, r);
    load own = move_leg(platform, i, motion, &length, &rate, &actuator, row, row_rate);
    mass += at.across_mass;
    moment = add(moment, scale(at.across_mass, at.arm));
    add_point(inertia, at.across_mass, at.arm);
    rest.force = subtract(rest.force, own.force);
    rest.moment = subtract(rest.moment, own.moment);
    if (turning) {
      double drive_row[6];
      drive_motion drive = move_drive(leg, motion);
      turning_row(platform, i, motion, drive_row);
      add_row(&work, row, 0.0, leg->piston_mass - at.across_mass);
      add_row(&work, drive_row, forces[i] - move_actuator(leg, drive.rate, drive.acceleration),
              leg->reflected_mass);
    } else {
      add_row(&work, row, forces[i] - actuator,
              leg->piston_mass + leg->reflected_mass - at.across_mass);
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
  const double * forces, int64_t n_wrenches, const double * wrenches, int64_t n_bases,
  const stewart_base * bases) {
  for (int64_t n = 0; n < count; n++) {
    accelerate(platform, &motions[n], &forces[6 * n], &wrenches[n_wrenches == 1 ? 0 : 6 * n],
               &bases[n_bases == 1 ? 0 : n]);
  }
}

/* ---- motion in axes that do not turn -------------------------------------------------------- */

/* Return W' x r + W x (W x r): the acceleration of a point fixed to a turning body. */
static vector carried_along(vector spin, vector spin_rate, vector arm)
{return add(cross(spin_rate, arm), cross(spin, cross(spin, arm)));}

/* A platform and a base in motion: velocities less that of the base's origin, accelerations as
   they are felt, less gravity. */
typedef struct { vector position, velocity, omega, acceleration, alpha, felt, spin, spin_rate; }
  absolute_motion;

static absolute_motion absolute_of(const stewart_motion * motion, const stewart_base * base) {
  absolute_motion of;
  vector velocity = read3(motion->linear_velocity), omega = read3(motion->angular_velocity);
  of.position = read3(motion->position);
  of.spin = read3(base->angular_velocity), of.spin_rate = read3(base->angular_acceleration);
  of.felt = subtract(read3(base->linear_acceleration), read3(base->gravity));
  of.velocity = add(velocity, cross(of.spin, of.position));
  of.acceleration = add(
    add(read3(motion->linear_acceleration), carried_along(of.spin, of.spin_rate, of.position)),
    scale(2.0, cross(of.spin, velocity)));
  of.acceleration = add(of.acceleration, of.felt);
  of.omega = add(omega, of.spin);
  of.alpha = add(add(read3(motion->angular_acceleration), of.spin_rate), cross(of.spin, omega));
  return of;
}

/* A leg's vector L s, and its derivatives in these axes; joint: its base joint's acceleration. */
typedef struct {
  leg_pose at;
  double rate, acceleration;            /* of the length */
  vector joint, s_rate, s_acceleration;
  vector across;                        /* the part of s'' across the leg */
} absolute_leg;

static absolute_leg leg_of(
  const stewart_leg * leg, const stewart_motion * motion, const absolute_motion * of) {
  absolute_leg found;
  leg_pose at = pose_of(leg, motion->position, motion->rotation);
  vector s = at.direction, base_joint = read3(leg->base_joint);
  vector rate = subtract(add(of->velocity, cross(of->omega, at.arm)), cross(of->spin, base_joint));
  found.joint = add(of->felt, carried_along(of->spin, of->spin_rate, base_joint));
  vector acceleration = subtract(
    add(of->acceleration, carried_along(of->omega, of->alpha, at.arm)), found.joint);
  found.at = at, found.rate = dot(s, rate);
  found.s_rate = scale(at.per_length, subtract(rate, scale(found.rate, s)));
  double along = dot(s, acceleration), turning = dot(found.s_rate, found.s_rate);
  found.acceleration = along + at.length * turning;
  vector sliding = scale(2.0 * found.rate, found.s_rate);
  found.s_acceleration = scale(at.per_length, subtract(
    subtract(acceleration, scale(found.acceleration, s)), sliding));
  found.across = scale(at.per_length, subtract(subtract(acceleration, scale(along, s)), sliding));
  return found;
}

/* ---- base wrench ---------------------------------------------------------------------------- */

/* Return the rates of a leg's momentum, and of its moment of momentum about the base's origin. */
static load leg_momentum_rate(
  const stewart_leg * leg, const stewart_motion * motion, const absolute_motion * of) {
  load rates;
  absolute_leg found = leg_of(leg, motion, of);
  vector s = found.at.direction;
  double center = leg->cylinder_center_of_mass, distance =
    found.at.length - leg->piston_center_of_mass;  /* of the piston's from the base joint */
  double inertia =
    leg->cylinder_mass * (center * center) + leg->cylinder_inertia + leg->piston_inertia;
  double moment = leg->cylinder_mass * center + leg->piston_mass * distance;
  vector sliding = scale(2.0 * leg->piston_mass * found.rate, found.s_rate);
  rates.force = add(
    add(scale(leg->cylinder_mass + leg->piston_mass, found.joint),
        scale(moment, found.s_acceleration)),
    add(sliding, scale(leg->piston_mass * found.acceleration, s)));
  vector turning = add(
    add(scale(moment, found.joint),
        scale(inertia + leg->piston_mass * distance * distance, found.s_acceleration)),
    scale(distance, sliding));
  rates.moment = add(cross(read3(leg->base_joint), rates.force), cross(s, turning));
  return rates;
}

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
      rates = leg_momentum_rate(&platform->legs[i], motion, &of);
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

/* Columns of the regressor, six numbers each from CYLINDER_MASS on, one for each leg: the order of
   dynamics/linear_parameters.py. */
enum {
  MASS = 0, FIRST_MOMENT = 1, INERTIA = 4, CYLINDER_MASS = 10, CYLINDER_FIRST = 16,
  CYLINDER_SECOND = 22, PISTON_MASS = 28, PISTON_FIRST = 34, PISTON_SECOND = 40,
  REFLECTED_MASS = 46, VISCOUS_FRICTION = 52, COULOMB_FRICTION = 58, OFFSET = 64, LINEAR = 70
};

/* The forces at a leg's platform joint for a unit of its parameters; its drive's motion. */
typedef struct {
  vector arm, of_first, of_second, of_piston, of_piston_first;
  double rate, acceleration;
} leg_columns;

static leg_columns columns_of(
  const stewart_leg * leg, const stewart_motion * motion, const absolute_motion * of) {
  leg_columns columns;
  absolute_leg found = leg_of(leg, motion, of);
  vector s = found.at.direction;
  double turning = dot(found.s_rate, found.s_rate), length = found.at.length;
  vector sliding = scale(2.0 * found.rate, found.s_rate);
  vector hanging = subtract(found.joint, scale(dot(s, found.joint), s));
  columns.arm = found.at.arm;
  columns.of_first = scale(found.at.per_length, hanging);
  columns.of_second = scale(found.at.per_length, found.across);
  /* with c = L - S: m c^2 + I = m L^2 - 2 L m S + J */
  columns.of_piston = add(
    add(hanging, add(scale(length, found.across), sliding)),
    scale(dot(s, found.joint) + found.acceleration - length * turning, s));
  columns.of_piston_first = subtract(scale(turning, s), add(
    columns.of_first, add(scale(2.0, found.across), scale(found.at.per_length, sliding))));
  columns.rate = found.rate, columns.acceleration = found.acceleration;
  return columns;
}

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

static void put_regressor(
  const stewart_platform * platform, const stewart_motion * motion, const absolute_motion * of,
  double * rows) {
  double inverse[6][6], per_size = 1.0 / platform->characteristic_length;
  leg_columns columns[6];
  for (int i = 0; i < 6; i++) {
    const stewart_leg * leg = &platform->legs[i];
    leg_pose at = pose_of(leg, motion->position, motion->rotation);
    double row[6];
    columns[i] = columns_of(leg, motion, of);
    put3(row, at.direction), put3(row + 3, scale(per_size, cross(at.arm, at.direction)));
    if (leg->pitch != 0.0) {
      drive_motion drive = move_drive(leg, motion);
      turning_row(platform, i, motion, row);
      columns[i].rate = drive.rate, columns[i].acceleration = drive.acceleration;
    }
    for (int n = 0; n < 6; n++) {inverse[n][i] = row[n];}
  }
  invert(inverse);
  for (int i = 0; i < 6; i++) {
    double * row = &rows[LINEAR * i];
    vector u = read3(inverse[i]), h = scale(per_size, read3(inverse[i] + 3));
    for (int n = 0; n < LINEAR; n++) {row[n] = 0.0;}
    put_platform(motion, of, u, h, row);
    for (int k = 0; k < 6; k++) {
      vector by = add(u, cross(h, columns[k].arm));
      row[CYLINDER_FIRST + k] = dot(by, columns[k].of_first);
      row[CYLINDER_SECOND + k] = row[PISTON_SECOND + k] = dot(by, columns[k].of_second);
      row[PISTON_MASS + k] = dot(by, columns[k].of_piston);
      row[PISTON_FIRST + k] = dot(by, columns[k].of_piston_first);
    }
    row[REFLECTED_MASS + i] = columns[i].acceleration;
    row[VISCOUS_FRICTION + i] = columns[i].rate;
    row[COULOMB_FRICTION + i] = slip(columns[i].rate / platform->legs[i].coulomb_velocity);
    row[OFFSET + i] = 1.0;
  }
}

FLAT void regressors_many(
  const stewart_platform * platform, int64_t count, const stewart_motion * motions,
  int64_t n_bases, const stewart_base * bases, double * results) {
  for (int64_t n = 0; n < count; n++) {
    stewart_base still = {{0.0}, {0.0}, {0.0}, {0.0}};
    const stewart_base * base = &bases[n_bases == 1 ? 0 : n];
    put3(still.gravity, read3(platform->gravity));
    absolute_motion of = absolute_of(&motions[n], moves(base) ? base : &still);
    put_regressor(platform, &motions[n], &of, &results[6 * LINEAR * n]);
  }
}

/* ---- external wrench ------------------------------------------------------------------------ */

/* Add w_ext = J_q^T (f_model - f_measured), times a weight. */
static void add_external_wrench(
  const stewart_platform * platform, const double position[3], const double rotation[9],
  const double model[6], const double measured[6], double weight, double wrench[6]) {
  stewart_motion motion;
  put3(motion.position, read3(position));
  put_matrix(motion.rotation, read3(rotation), read3(rotation + 3), read3(rotation + 6));
  for (int i = 0; i < 6; i++) {
    const stewart_leg * leg = &platform->legs[i];
    double row[6], force = weight * (model[i] - measured[i]);
    leg_pose at = pose_of(leg, position, rotation);
    put3(row, at.direction), put3(row + 3, cross(at.arm, at.direction));
    if (leg->pitch != 0.0) {
      turning_row(platform, i, &motion, row);
      for (int n = 3; n < 6; n++) {row[n] *= platform->characteristic_length;}
    }
    for (int n = 0; n < 6; n++) {wrench[n] += force * row[n];}
  }
}

void external_wrenches_many(
  const stewart_platform * platform, int64_t count, const stewart_pose * poses,
  const double * model_forces, const double * measured_forces, double * wrenches) {
  for (int64_t n = 0; n < count; n++) {
    for (int i = 0; i < 6; i++) {wrenches[6 * n + i] = 0.0;}
    add_external_wrench(
      platform, poses[n].position, poses[n].rotation, &model_forces[6 * n],
      &measured_forces[6 * n], 1.0, &wrenches[6 * n]);
  }
}

/* Add an end of the interval between two measurements: half of the wrench and of the model. */
static void add_end(
  const stewart_platform * platform, one_measurement * m, const stewart_motion * motion,
  const stewart_base * base) {
  stewart_result result;
  solve_sample(platform, motion, m->known, base, &result);
  add_external_wrench(platform, motion->position, motion->rotation, result.forces, m->forces, 0.5,
                      m->after);
  for (int i = 0; i < 6; i++) {m->differences[i] += 0.5 * (m->forces[i] - result.forces[i]);}
}

void estimate_one(const stewart_platform * platform, one_measurement * m) {
  double rows[6][6], inverse[6][6], dt = m->interval;
  leg_pose legs[6];
  int steps;
  stewart_motion * before = &m->motion, * now = &m->motion_after;
  *now = *before;
  m->across = scaled_jacobian(
    platform, before->position, before->rotation, legs, rows, inverse) * m->target < 0.0;
  m->code = find_pose(platform, m->lengths, (stewart_pose *)now, &steps, &m->residual);
  m->steps = steps;
  if (m->code != STEWART_OK) {return;}
  scaled_jacobian(platform, now->position, now->rotation, legs, rows, inverse);
  from_legs(platform, inverse, m->rates, now->linear_velocity, now->angular_velocity);
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
