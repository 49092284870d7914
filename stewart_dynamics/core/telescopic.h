/* SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * Telescopic legs: a cylinder from the base joint, a piston to the platform joint. The drive's
 * position is the length, its effort the force along the leg. Where the screw is not guided, the
 * turn of the leg between its universal joints extends it as well. Equations: docs/theory.md.
 *
 * Part of stewart_dynamics.c, which says what the functions of a kind of legs are.
 */

#ifndef STEWART_LIBRARY

typedef struct {
  leg_line line;
  real piston_moment;         /* m2 c2 with c2 = L - S2 [kg m] */
  real across_mass;           /* effective mass across the leg, I_e / L^2 + m_ce [kg] */
  real gravity_mass;          /* m_ge [kg] */
} telescopic_pose;

static leg_line telescopic_line(
  const stewart_leg * leg, const real position[3], const real r[9])
{return line_from(fixed3(leg->base_joint), leg, position, r);}

static telescopic_pose telescopic_pose_of(
  const stewart_leg * leg, const real position[3], const real r[9]) {
  telescopic_pose at;
  double center = leg->cylinder_center_of_mass;
  double inertia =
    leg->cylinder_mass * (center * center) + leg->cylinder_inertia + leg->piston_inertia;
  leg_line line = at.line = telescopic_line(leg, position, r);
  real piston_distance = line.length - leg->piston_center_of_mass;
  at.piston_moment = leg->piston_mass * piston_distance;
  at.across_mass =
    (inertia + at.piston_moment * piston_distance) * line.per_length * line.per_length;
  at.gravity_mass = (leg->cylinder_mass * center + at.piston_moment) * line.per_length;
  return at;
}

static void telescopic_move(
  const stewart_platform * platform, int i, const stewart_motion * motion,
  const moving_base * base, leg_motion * of) {
  const stewart_leg * leg = &platform->legs[i];
  (void)base;  /* telescopic_carry has the load of the base */
  vector omega = read3(motion->angular_velocity);
  telescopic_pose at = telescopic_pose_of(leg, motion->position, motion->rotation);
  real per_length = at.line.per_length;
  double inverse_size = 1.0 / platform->characteristic_length;
  vector a = at.line.arm, s = at.line.direction, gravity = fixed3(platform->gravity);

  /* the platform joint's velocity and acceleration (x_i', x_i''), along and across the leg */
  vector a_rate = cross(omega, a);
  vector x_rate = add(read3(motion->linear_velocity), a_rate);
  real rate = dot(s, x_rate);
  vector across = subtract(x_rate, scale(rate, s));
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
  vector force = scale(at.across_mass, across_acc);
  force = subtract(force, scale(at.gravity_mass, across_gravity));
  force = add(force, scale(2.0 * coriolis_mass * rate * per_length, across));
  force = add(force, scale(along, s));
  of->moved.force = force, of->moved.moment = cross(a, force);

  of->position = at.line.length, of->rate = rate, of->lever = number(1.0);
  of->effort = move_actuator(leg, rate, along_acc + across_squared * per_length);

  vector s_rate = scale(per_length, across);
  put3(of->row, s), put3(of->row + 3, times(inverse_size, cross(a, s)));
  put3(of->row_rate, s_rate);
  put3(of->row_rate + 3, times(inverse_size, add(cross(a_rate, s), cross(a, s_rate))));
}

/* With q = W x s, y the velocity of the platform joint across the leg, and A_b the acceleration of
   the base joint, less the gravity that is not in g, the force at the platform joint is
   m_ge A_b + (m2 - m_ge) (s . A_b) s + (I_e / L^2 + m_ce) L (W' x s + W x q + |q|^2 s)
   - m2 c2 |q|^2 s + 2 m2 c2 / L (L' q - (y . q) s) + 2 (I_e / L^2 + m_ce) (W . s) s x y. */
static load telescopic_carry(
  const stewart_leg * leg, const stewart_motion * motion, const moving_base * base) {
  load carried;
  telescopic_pose at = telescopic_pose_of(leg, motion->position, motion->rotation);
  real per_length = at.line.per_length;
  vector s = at.line.direction, omega = read3(motion->angular_velocity);
  vector x_rate = add(read3(motion->linear_velocity), cross(omega, at.line.arm));
  vector joint = add(base->felt, rotate(base->carrying, fixed3(leg->base_joint)));
  vector q = cross(base->spin, s);
  real q_squared = dot(q, q);
  vector turning = add(rotate(base->carrying, s), scale(q_squared, s));
  vector coriolis = add(
    scale(2.0 * at.piston_moment * per_length * dot(s, x_rate), q),
    scale(2.0 * at.across_mass * dot(base->spin, s), cross(s, x_rate)));
  real along = (leg->piston_mass - at.gravity_mass) * dot(s, joint) -
    at.piston_moment * (q_squared + 2.0 * per_length * dot(x_rate, q));
  carried.force = add(scale(at.gravity_mass, joint), scale(along, s));
  carried.force = add(
    add(carried.force, scale(at.across_mass * at.line.length, turning)), coriolis);
  carried.moment = cross(at.line.arm, carried.force);
  return carried;
}

/* The motion of the drive: the length, less the extension by the turn of the leg. */
static drive_motion telescopic_drive(const stewart_leg * leg, const stewart_motion * motion) {
  drive_motion drive;
  leg_line at = telescopic_line(leg, motion->position, motion->rotation);
  vector s = at.direction, a_rate, a_acc = turned(at.arm, motion, &a_rate);
  vector x_rate = add(read3(motion->linear_velocity), a_rate);
  vector x_acc = add(read3(motion->linear_acceleration), a_acc);
  real rate = dot(s, x_rate);
  double pitch = leg->pitch;
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

/* Write the row of J_q, with moments times per_size. */
static void telescopic_drive_row(
  const stewart_leg * leg, const real position[3], const real r[9], double per_size,
  real row[6]) {
  leg_line at = telescopic_line(leg, position, r);
  vector s = at.direction, h = s, moment = cross(at.arm, s);
  if (leg->pitch != 0.0) {
    vector u = fixed3(leg->base_universal_axis);
    vector w = rotate(r, fixed3(leg->platform_universal_axis));
    real us = dot(u, s), ws = dot(w, s);
    double pitch = leg->pitch;
    real of_u = pitch / (1.0 - us * us), of_w = pitch / (1.0 - ws * ws);
    vector turn = subtract(scale(us * of_u, cross(s, u)), scale(ws * of_w, cross(s, w)));
    h = add(s, scale(at.per_length, turn));
    moment = add(cross(at.arm, h), scale(of_w, subtract(s, scale(ws, w))));
  }
  put3(row, h), put3(row + 3, times(per_size, moment));
}

static void telescopic_put(
  const stewart_platform * platform, int i, const leg_motion * of, real push,
  stewart_result * result) {
  (void)platform;
  result->lengths[i] = of->position, result->rates[i] = of->rate;
  result->joint_forces[i] = push, result->forces[i] = push + of->effort;
}

/* Write the forces of screws that turn with their legs: J_q^T f = wrench, by virtual work f q'. */
static void telescopic_finish(
  const stewart_platform * platform, const stewart_motion * motion, const real balanced[6],
  stewart_result * result) {
  real inverse[6][6];
  if (platform->legs[0].pitch == 0.0) {return;}
  for (int i = 0; i < 6; i++) {
    real row[6];
    telescopic_drive_row(&platform->legs[i], motion->position, motion->rotation,
                         1.0 / platform->characteristic_length, row);
    for (int j = 0; j < 6; j++) {inverse[j][i] = row[j];}
  }
  invert(inverse);
  for (int i = 0; i < 6; i++) {
    drive_motion drive = telescopic_drive(&platform->legs[i], motion);
    result->joint_forces[i] = dot6(inverse[i], balanced);
    result->forces[i] = result->joint_forces[i] +
      move_actuator(&platform->legs[i], drive.rate, drive.acceleration);
    result->unit_load_forces[i] = root(dot6(inverse[i], inverse[i]));
  }
}

#ifndef STEWART_LANES

static double telescopic_anchor(const stewart_leg * leg, double position, vector * anchor)
{*anchor = read3(leg->base_joint); return position;}

/* L'' = s . x'' + |x' across the leg|^2 / L. */
static int telescopic_assembled(
  const stewart_leg * leg, double position, const double origin[3], const double r[9])
{(void)leg, (void)position, (void)origin, (void)r; return 1;}

static double telescopic_straight(
  const stewart_leg * leg, const double position[3], const double r[9], vector x_rate,
  double rate, double acceleration) {
  leg_line at = telescopic_line(leg, position, r);
  double along = dot(at.direction, x_rate);
  (void)rate;
  return acceleration - (dot(x_rate, x_rate) - along * along) * at.per_length;
}

static double telescopic_missing(const stewart_leg * leg, const double position[3],
                                 const double r[9])
{(void)leg, (void)position, (void)r; return 0.0;}

static double * telescopic_positions(stewart_result * result) {return result->lengths;}
static double * telescopic_efforts(stewart_result * result) {return result->forces;}
static double * telescopic_commands(stewart_output * output) {return output->forces;}
static double telescopic_rate_max(const stewart_leg * leg) {return leg->velocity_max;}
static double telescopic_lever_ratio(const stewart_leg * leg, double lever)
{(void)leg, (void)lever; return 1.0;}
static double telescopic_lever_time(
  const stewart_leg * leg, const stewart_motion * motion, double lever)
{(void)leg, (void)motion, (void)lever; return HUGE_VAL;}

static int telescopic_given(const stewart_leg * leg) {(void)leg; return 1;}

static void telescopic_complete(stewart_leg * leg) {
  double gear = leg->gear_ratio, ratio = leg->screw_lead > 0.0 ?
    2.0 * PI * gear / leg->screw_lead : (double)NAN;
  if (leg->screw_lead > 0.0 && (leg->motor_inertia > 0.0 || leg->screw_inertia > 0.0)) {
    leg->reflected_mass =
      ratio * ratio * (leg->motor_inertia + leg->screw_inertia / (gear * gear));
  }
  leg->motor_ratio = ratio;
  leg->home_position = leg->length_min > 0.0 && isfinite(leg->length_max)
    ? 0.5 * (leg->length_min + leg->length_max) : leg->zero_length;
  leg->pitch = leg->twist_ratio == 0.0 ? 0.0 :
    leg->twist_ratio * leg->screw_lead / (2.0 * PI * gear);
}

static int telescopic_check(const stewart_platform * platform, const stewart_leg * leg) {
  if (!isfinite(leg->cylinder_center_of_mass) || !isfinite(leg->piston_center_of_mass)) {
    return STEWART_RULE_FINITE;
  }
  if (!(leg->cylinder_mass >= 0.0 && leg->piston_mass >= 0.0 && leg->cylinder_inertia >= 0.0 &&
        leg->piston_inertia >= 0.0)) {return STEWART_RULE_LEG_MASS;}
  if (!(leg->length_min < leg->length_max)) {return STEWART_RULE_LENGTHS;}
  if (platform->with_clearance && !(leg->cylinder_radius >= 0.0 && leg->cylinder_length >= 0.0 &&
                                    leg->piston_radius >= 0.0)) {return STEWART_RULE_SHAPE;}
  if (leg->piston_radius > leg->cylinder_radius) {return STEWART_RULE_RADII;}
  if (platform->with_motors && !(leg->screw_lead > 0.0)) {return STEWART_RULE_SCREW_LEAD;}
  if (!has_direction(leg->base_universal_axis)) {return STEWART_RULE_BASE_UNIVERSAL;}
  return has_direction(leg->platform_universal_axis) ? STEWART_VALID :
    STEWART_RULE_PLATFORM_UNIVERSAL;
}

#endif

#elif defined STEWART_GOVERNOR

static double telescopic_margins(double size, stewart_leg * leg) {
  double low = leg->length_min, high = leg->length_max;
  double stroke = low > 0.0 && isfinite(high) ? high - low : 0.0;
  double margin = stroke > 0.0 ? OF_STROKE * stroke : OF_SIZE * size;
  leg->length_min += margin, leg->length_max -= margin;
  leg->force_max -= 2.0 * leg->coulomb_friction;  /* it may change its sign between two samples */
  return margin;
}

static double telescopic_stop_rate(const stewart_leg * leg) {
  if (!(leg->length_min > 0.0 && isfinite(leg->length_max) && isfinite(leg->velocity_max))) {
    return NAN;
  }
  return leg->velocity_max / (leg->length_max - leg->length_min);
}

static unsigned telescopic_put_room(
  const stewart_leg * leg, double margin, const stewart_motion * motion, double length,
  double * room) {
  (void)margin, (void)motion;
  *room = least(length - leg->length_min, leg->length_max - length);
  return below(length, leg->length_min, STEWART_LENGTH_MIN) |
         above(length, leg->length_max, STEWART_LENGTH_MAX);
}

static double telescopic_moved(double way, double path) {(void)path; return way;}

/* Less than asin(d / L), of which this is more up to a quarter. */
static double telescopic_turn(
  const stewart_leg * leg, double margin, double length, double lever, double moved) {
  double sine = moved / length;
  (void)leg, (void)margin, (void)lever;
  return sine <= 0.25 ? 1.02 * sine : HUGE_VAL;
}

static int telescopic_levers_change(void) {return 0;}

static double telescopic_pieces(
  const stewart_leg * leg, double lever, double next_lever, const motion_bounds * most,
  double arm, double time)
{(void)leg, (void)lever, (void)next_lever, (void)most, (void)arm, (void)time; return 1.0;}

static unsigned telescopic_unproven(void) {return STEWART_LENGTH_MIN;}

#else  /* the library alone */

static double telescopic_position(
  const stewart_leg * leg, const double position[3], const double r[9])
{return telescopic_line(leg, position, r).length;}

static measured_leg telescopic_measured(const stewart_leg * leg, const stewart_motion * motion) {
  leg_line at = telescopic_line(leg, motion->position, motion->rotation);
  vector turning = cross(read3(motion->angular_velocity), at.arm);
  vector joint = add(read3(motion->linear_velocity), turning);
  measured_leg of = {
    at.length, dot(at.direction, joint), HUGE_VAL, {1.0, 0.0, {0.0, 0.0, 0.0}}};
  if (0.0 < at.length && at.length < HUGE_VAL) {of.pace = at.per_length * norm(joint);}
  return of;
}

static lever_square telescopic_square(const stewart_leg * leg, const stewart_motion * motion) {
  lever_square of = {1.0, 0.0};
  (void)leg, (void)motion;
  return of;
}

static vector telescopic_anchor_rate(const stewart_leg * leg, const stewart_motion * motion) {
  vector none = {0.0, 0.0, 0.0};
  (void)leg, (void)motion;
  return none;
}

static void telescopic_mass(
  const stewart_platform * platform, int i, const stewart_motion * motion, const leg_motion * of,
  leg_mass * to) {
  const stewart_leg * leg = &platform->legs[i];
  telescopic_pose at = telescopic_pose_of(leg, motion->position, motion->rotation);
  to->point = at.across_mass, to->line = 0.0, to->effort = of->effort;
  to->coupling = make(0.0, 0.0, 0.0);
  telescopic_drive_row(leg, motion->position, motion->rotation,
                       1.0 / platform->characteristic_length, to->row);
  if (leg->pitch == 0.0) {
    to->drive = leg->piston_mass + leg->reflected_mass - at.across_mass;
  } else {
    drive_motion drive = telescopic_drive(leg, motion);
    to->line = leg->piston_mass - at.across_mass, to->drive = leg->reflected_mass;
    to->effort = move_actuator(leg, drive.rate, drive.acceleration);
  }
}

/* A leg's vector L s, and its derivatives in axes that do not turn; joint: its base joint's
   acceleration. */
typedef struct {
  leg_line at;
  double rate, acceleration;            /* of the length */
  vector joint, s_rate, s_acceleration;
  vector across;                        /* the part of s'' across the leg */
} absolute_leg;

static absolute_leg absolute_leg_of(
  const stewart_leg * leg, const stewart_motion * motion, const absolute_motion * of) {
  absolute_leg found;
  leg_line at = telescopic_line(leg, motion->position, motion->rotation);
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

static load telescopic_momentum_rate(
  const stewart_leg * leg, const stewart_motion * motion, const absolute_motion * of) {
  load rates;
  absolute_leg found = absolute_leg_of(leg, motion, of);
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

/* Mass, first and second moment of the cylinder, then of the piston: legs/telescopic.py. */
static int telescopic_columns(
  const stewart_platform * platform, int i, const stewart_motion * motion,
  const absolute_motion * of, leg_columns * columns) {
  const stewart_leg * leg = &platform->legs[i];
  absolute_leg found = absolute_leg_of(leg, motion, of);
  vector s = found.at.direction;
  double turning = dot(found.s_rate, found.s_rate), length = found.at.length;
  vector sliding = scale(2.0 * found.rate, found.s_rate);
  vector hanging = subtract(found.joint, scale(dot(s, found.joint), s));
  vector of_first = scale(found.at.per_length, hanging);
  columns->of_mass[0] = scale(0.0, s), columns->of_mass[1] = of_first;
  columns->of_mass[2] = columns->of_mass[5] = scale(found.at.per_length, found.across);
  /* with c = L - S: m c^2 + I = m L^2 - 2 L m S + J */
  columns->of_mass[3] = add(
    add(hanging, add(scale(length, found.across), sliding)),
    scale(dot(s, found.joint) + found.acceleration - length * turning, s));
  columns->of_mass[4] = subtract(scale(turning, s), add(
    of_first, add(scale(2.0, found.across), scale(found.at.per_length, sliding))));
  for (int n = 0; n < 6; n++) {columns->effort[n] = 0.0;}
  columns->arm = found.at.arm, columns->lever = 1.0;
  columns->rate = found.rate, columns->acceleration = found.acceleration;
  telescopic_drive_row(leg, motion->position, motion->rotation,
                       1.0 / platform->characteristic_length, columns->row);
  if (leg->pitch != 0.0) {
    drive_motion drive = telescopic_drive(leg, motion);
    columns->rate = drive.rate, columns->acceleration = drive.acceleration;
  }
  return 6;
}

#endif
