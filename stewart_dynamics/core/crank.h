/* SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * Cranks: a motor on the base turns a crank, and a rod of fixed length joins its end to the
 * platform joint. The drive's position is the angle of the crank, its effort the torque of its
 * shaft. The lever k, torque by push of the rod, is zero at a dead centre, where the rod lies in
 * the plane of crank and axis; its sign is the branch of the leg. Nothing that gives torques is
 * divided by it. Equations: docs/cranks.md.
 *
 * Part of stewart_dynamics.c, which says what the functions of a kind of legs are.
 */

#ifndef STEWART_LIBRARY

typedef struct {
  leg_line line;           /* of the rod, from the end of the crank */
  vector along, normal;    /* e and n */
  real cosine, sine;       /* of the angle, both times a positive number */
} crank_pose;

/* With l from the base joint to the platform joint, x = l . z, y = l . n0 and
   g = (|l|^2 + L1^2 - L2^2) / (2 L1): x cos q + y sin q = g. Nan where the rod does not reach. */
static crank_pose crank_pose_of(
  const stewart_leg * leg, const real position[3], const real r[9]) {
  crank_pose at;
  double size = leg->crank_length, rod = leg->rod_length;
  vector z = fixed3(leg->crank_direction), n0 = cross(fixed3(leg->crank_axis), z);
  at.line.arm = rotate(r, fixed3(leg->platform_joint));
  vector l = subtract(add(read3(position), at.line.arm), fixed3(leg->base_joint));
  real x = dot(l, z), y = dot(l, n0), square = x * x + y * y;
  real g = (dot(l, l) + (size * size - rod * rod)) * (0.5 / size);
  real h = leg->branch * root(square - g * g), per_square = 1.0 / square;
  at.cosine = x * g + y * h, at.sine = y * g - x * h;
  real cosine = at.cosine * per_square, sine = at.sine * per_square;
  at.along = add(scale(cosine, z), scale(sine, n0));
  at.normal = subtract(scale(cosine, n0), scale(sine, z));
  at.line.direction = times(1.0 / rod, subtract(l, times(size, at.along)));
  at.line.length = number(rod), at.line.per_length = number(1.0 / rod);
  at.line.lever = size / rod * h;
  return at;
}

/* Return the angle of a point from x, to 4e-16: atan2 in operations that lanes have side by side.
   The series is the polynomial of degree 10 in z = t^2 nearest to (atan(t) / t - 1) / z for
   |t| <= tan(pi / 8), to 4e-17. */
static real crank_arctangent(real y, real x) {
  static const double series[] = {
    -0.019176887104237525, 0.03923165828348216, -0.0508544973752125, 0.058581489127221394,
    -0.06664511447372731, 0.07692183190825433, -0.09090904578123873, 0.11111111015256361,
    -0.14285714284666542, 0.1999999999999552, -0.3333333333333333};
  real across = absolute(y), along = absolute(x);
  choice steep = across > along;
  real low = choose(steep, along, across), high = choose(steep, across, along);
  choice wide = low > 0.41421356237309503 * high;
  real t = choose(wide, low - high, low) / choose(wide, low + high, high);
  real z = t * t, sum = number(series[0]);
  for (size_t n = 1; n < sizeof series / sizeof *series; n++) {sum = sum * z + series[n];}
  real found = t + t * (z * sum);
  found = choose(wide, 0.25 * PI + found, found);
  found = choose(steep, 0.5 * PI - found, found);
  return signed_as(choose(x < 0.0, PI - found, found), y);
}

/* Return the angle within pi of the middle of the allowed ones. */
static real crank_angle(const stewart_leg * leg, const crank_pose * at) {
  double turns = 2.0 * PI * rint(leg->home_position / (2.0 * PI));
  double middle = leg->home_position - turns;
  real q = crank_arctangent(at->sine, at->cosine);
  q = choose(q > middle + PI, q - 2.0 * PI, choose(q < middle - PI, q + 2.0 * PI, q));
  return q + turns;
}

/* The motion of the crank; that of the ends of its rod, at the crank and at the platform. */
typedef struct {
  crank_pose at;
  drive_motion drive;
  vector arm_rate, tip_rate, end_rate, gap_rate, tip_acc, end_acc;
} crank_motion;

/* q' = d . B' / k, q'' = (d . B'' + L1 q'^2 d . e + |B' - A'|^2 / L2) / k; at a dead centre 0
   where they need not be infinite. */
static crank_motion crank_motion_of(const stewart_leg * leg, const stewart_motion * motion) {
  crank_motion of;
  crank_pose at = of.at = crank_pose_of(leg, motion->position, motion->rotation);
  double size = leg->crank_length;
  vector d = at.line.direction, arm_acc = turned(at.line.arm, motion, &of.arm_rate);
  of.end_rate = add(read3(motion->linear_velocity), of.arm_rate);
  of.end_acc = add(read3(motion->linear_acceleration), arm_acc);
  real along = dot(d, of.end_rate), per_lever = 1.0 / at.line.lever;
  real speed = choose(along != 0.0, along * per_lever, along);
  real squared = size * speed * speed;
  of.tip_rate = scale(size * speed, at.normal);
  of.gap_rate = subtract(of.end_rate, of.tip_rate);
  real drop = dot(d, of.end_acc) + squared * dot(d, at.along) +
    at.line.per_length * dot(of.gap_rate, of.gap_rate);
  real acceleration = choose(drop != 0.0, drop * per_lever, drop);
  of.tip_acc = subtract(scale(size * acceleration, at.normal), scale(squared, at.along));
  of.drive.position = crank_angle(leg, &at);
  of.drive.rate = speed, of.drive.acceleration = acceleration;
  return of;
}

/* F_A = m_a A(A) + m_ab A(B), F_B = m_ab A(A) + m_b A(B); the torque that moves the shaft without
   a push of the rod is I_uu q'' + (mx n - my e) . A(c) + L1 m_ab n . A(B), with moments of mass
   mx, my and inertia of the crank and m_a, and what the turning of the base adds. */
static void crank_move(
  const stewart_platform * platform, int i, const stewart_motion * motion,
  const moving_base * base, leg_motion * to) {
  const stewart_leg * leg = &platform->legs[i];
  crank_motion of = crank_motion_of(leg, motion);
  double inverse_size = 1.0 / platform->characteristic_length;
  const double * inertia = leg->turning_inertia;
  vector a = of.at.line.arm, d = of.at.line.direction, e = of.at.along, n = of.at.normal;
  vector gravity = fixed3(platform->gravity), c = fixed3(leg->base_joint);
  vector at_joint = make(-gravity.x, -gravity.y, -gravity.z);
  vector at_tip = subtract(of.tip_acc, gravity), at_end = subtract(of.end_acc, gravity);
  real effort = inertia[5] * of.drive.acceleration;
  if (base) {
    vector u = fixed3(leg->crank_axis), spin = base->spin;
    vector w = make(dot(e, spin), dot(n, spin), dot(u, spin));
    vector w_rate = make(dot(e, base->spin_rate), dot(n, base->spin_rate),
                         dot(u, base->spin_rate));
    vector tip = add(c, times(leg->crank_length, e)), end = add(read3(motion->position), a);
    at_joint = add(at_joint, add(base->felt, rotate(base->carrying, c)));
    at_tip = add(at_tip, add(base->felt, rotate(base->carrying, tip)));
    at_tip = add(at_tip, times(2.0, cross(spin, of.tip_rate)));
    at_end = add(at_end, add(base->felt, rotate(base->carrying, end)));
    at_end = add(at_end, times(2.0, cross(spin, of.end_rate)));
    effort += symmetric(inertia, w_rate).z + cross(w, symmetric(inertia, w)).z;
  }
  effort += dot(at_joint, subtract(times(leg->turning_moment[0], n),
                                   times(leg->turning_moment[1], e)));
  effort += leg->coupling_mass * leg->crank_length * dot(n, at_end);
  to->effort = effort + move_actuator(leg, of.drive.rate, of.drive.acceleration);
  to->moved.force = add(times(leg->coupling_mass, at_tip), times(leg->platform_end_mass, at_end));
  to->moved.moment = cross(a, to->moved.force);
  to->near_platform = -dot(d, to->moved.force);
  to->near_base = dot(d, add(times(leg->crank_end_mass, at_tip),
                             times(leg->coupling_mass, at_end)));
  to->position = of.drive.position, to->rate = of.drive.rate, to->lever = of.at.line.lever;

  vector d_rate = scale(of.at.line.per_length, of.gap_rate);
  put3(to->row, d), put3(to->row + 3, times(inverse_size, cross(a, d)));
  put3(to->row_rate, d_rate);
  put3(to->row_rate + 3,
       times(inverse_size, add(cross(of.arm_rate, d), cross(a, d_rate))));
}

static load crank_carry(
  const stewart_leg * leg, const stewart_motion * motion, const moving_base * base) {
  vector none = make(number(0.0), number(0.0), number(0.0));
  load carried = {none, none};  /* crank_move has the load of the base */
  (void)leg, (void)motion, (void)base;
  return carried;
}

static void crank_put(
  const stewart_platform * platform, int i, const leg_motion * of, real push,
  stewart_result * result) {
  real near_platform = push + of->near_platform, near_base = push + of->near_base;
  result->lengths[i] = number(platform->legs[i].rod_length), result->rates[i] = number(0.0);
  result->forces[i] = near_platform;
  result->joint_forces[i] = choose(
    absolute(near_base) > absolute(near_platform), near_base, near_platform);
  result->angles[i] = of->position, result->speeds[i] = of->rate;
  result->torques[i] = of->lever * push + of->effort, result->levers[i] = of->lever;
}

static void crank_finish(
  const stewart_platform * platform, const stewart_motion * motion, const real balanced[6],
  stewart_result * result)
{(void)platform, (void)motion, (void)balanced, (void)result;}

#ifndef STEWART_LANES

static leg_line crank_line(const stewart_leg * leg, const real position[3], const real r[9])
{return crank_pose_of(leg, position, r).line;}

static drive_motion crank_drive(const stewart_leg * leg, const stewart_motion * motion)
{return crank_motion_of(leg, motion).drive;}

static double crank_anchor(const stewart_leg * leg, double position, vector * anchor) {
  vector z = read3(leg->crank_direction), n0 = cross(read3(leg->crank_axis), z);
  vector e = add(scale(cos(position), z), scale(sin(position), n0));
  *anchor = add(read3(leg->base_joint), scale(leg->crank_length, e));
  return leg->rod_length;
}

/* A pose of this angle may be one of the other branch, beyond a dead centre. */
static int crank_assembled(
  const stewart_leg * leg, double position, const double origin[3], const double r[9]) {
  vector z = read3(leg->crank_direction), n0 = cross(read3(leg->crank_axis), z);
  vector n = subtract(scale(cos(position), n0), scale(sin(position), z)), anchor;
  crank_anchor(leg, position, &anchor);
  leg_line at = line_from(anchor, leg, origin, r);
  return leg->branch * dot(at.direction, n) >= -FLATNESS;
}

/* k q'' = d . B'' + L1 q'^2 d . e + |B' - A'|^2 / L2. */
static double crank_straight(
  const stewart_leg * leg, const double position[3], const double r[9], vector x_rate,
  double rate, double acceleration) {
  crank_pose at = crank_pose_of(leg, position, r);
  double size = leg->crank_length;
  vector gap = subtract(x_rate, scale(size * rate, at.normal));
  return at.line.lever * acceleration -
    size * rate * rate * dot(at.line.direction, at.along) - at.line.per_length * dot(gap, gap);
}

static double crank_missing(const stewart_leg * leg, const double position[3], const double r[9]) {
  vector arm = rotate(r, read3(leg->platform_joint)), u = read3(leg->crank_axis);
  vector l = subtract(add(read3(position), arm), read3(leg->base_joint));
  double height = dot(l, u), size = leg->crank_length, rod = leg->rod_length;
  double radius = sqrt(largest(dot(l, l) - height * height, 0.0));
  double nearest = hypot(radius - size, height), farthest = hypot(radius + size, height);
  double missing = largest(largest(nearest - rod, rod - farthest), 0.0);
  /* At the end of reach rounding decides: as for the angle. */
  return missing == 0.0 && isnan(crank_pose_of(leg, position, r).line.lever)
    ? rod * LAST_DIGIT : missing;
}

static double * crank_positions(stewart_result * result) {return result->angles;}
static double * crank_efforts(stewart_result * result) {return result->torques;}
static double * crank_commands(stewart_output * output) {return output->torques;}
static double crank_rate_max(const stewart_leg * leg) {return leg->crank_speed_max;}
static double crank_lever_ratio(const stewart_leg * leg, double lever)
{return fabs(lever) / leg->crank_length;}

/* The square of the lever [m^2], and its rate: (L1 / L2)^2 (x^2 + y^2 - g^2), the reserve of
   reach. Unlike the lever it is smooth at a dead centre, and it is negative out of reach. */
typedef struct { double value, rate; } crank_reserve;

static crank_reserve crank_reserve_of(const stewart_leg * leg, const stewart_motion * motion) {
  double size = leg->crank_length;
  vector z = read3(leg->crank_direction), n0 = cross(read3(leg->crank_axis), z);
  vector arm = rotate(motion->rotation, read3(leg->platform_joint));
  vector l = subtract(add(read3(motion->position), arm), read3(leg->base_joint));
  vector l_rate = add(read3(motion->linear_velocity),
                      cross(read3(motion->angular_velocity), arm));
  double g = (dot(l, l) + size * size - leg->rod_length * leg->rod_length) * (0.5 / size);
  double reserve_rate = 2.0 * (dot(l, z) * dot(l_rate, z) + dot(l, n0) * dot(l_rate, n0) -
                               g * dot(l, l_rate) / size);
  double part = size / leg->rod_length;
  double reserve = dot(l, z) * dot(l, z) + dot(l, n0) * dot(l, n0) - g * g;
  crank_reserve of = {part * part * reserve, part * part * reserve_rate};
  return of;
}

static double crank_lever_time(
  const stewart_leg * leg, const stewart_motion * motion, double lever) {
  double least_lever = leg->lever_min * leg->crank_length;
  double left = lever * lever - least_lever * least_lever;
  double rate = crank_reserve_of(leg, motion).rate;
  if (!(left > 0.0)) {return 0.0;}
  return rate < 0.0 ? -left / rate : HUGE_VAL;
}
static int crank_given(const stewart_leg * leg) {return leg->crank_length > 0.0;}

/* The rod as two points with a coupling, and the crank with the point at its end: exact where the
   rod has no inertia about its own axis. */
static void crank_complete(stewart_leg * leg) {
  double size = leg->crank_length, rod = leg->rod_length, mass = leg->rod_mass;
  const double * center = leg->crank_center_of_mass;
  if (isnan(leg->rod_center_of_mass)) {leg->rod_center_of_mass = 0.5 * rod;}
  if (isnan(leg->rod_inertia)) {leg->rod_inertia = mass * rod * rod / 12.0;}
  double part = leg->rod_center_of_mass / rod, turning = leg->rod_inertia / (rod * rod);
  leg->crank_end_mass = mass * (1.0 - part) * (1.0 - part) + turning;
  leg->coupling_mass = mass * part * (1.0 - part) - turning;
  leg->platform_end_mass = mass * part * part + turning;
  leg->turning_moment[0] = leg->crank_mass * center[0] + leg->crank_end_mass * size;
  leg->turning_moment[1] = leg->crank_mass * center[1];
  vector arm = read3(center);
  double own[6] = {
    arm.y * arm.y + arm.z * arm.z, -arm.x * arm.y, -arm.x * arm.z,
    arm.x * arm.x + arm.z * arm.z, -arm.y * arm.z, arm.x * arm.x + arm.y * arm.y};
  double end = leg->crank_end_mass * size * size;
  for (int n = 0; n < 6; n++) {
    leg->turning_inertia[n] = leg->crank_inertia[n] + leg->crank_mass * own[n] +
      (n == 3 || n == 5 ? end : 0.0);
  }
  leg->motor_ratio = leg->gear_ratio, leg->pitch = 0.0;
  if (leg->motor_inertia > 0.0) {
    leg->reflected_mass = leg->gear_ratio * leg->gear_ratio * leg->motor_inertia;
  }
  leg->home_position = 0.5 * (leg->angle_min + leg->angle_max);
  if (!isfinite(leg->home_position)) {leg->home_position = 0.0;}
  put_unit(leg->crank_axis);
  vector z = read3(leg->crank_direction), u = read3(leg->crank_axis);
  double across = fabs(dot(z, u)), size_of_z = norm(z);
  if (across <= RIGHT_ANGLE * size_of_z) {
    if (across > 1e-15 * size_of_z) {  /* a complete leg stays as it is, to the bit */
      put3(leg->crank_direction, subtract(z, scale(dot(z, u), u)));
    }
    put_unit(leg->crank_direction);
  }
}

static int crank_check(const stewart_platform * platform, const stewart_leg * leg) {
  vector z = read3(leg->crank_direction);
  int massless = 1;
  for (int n = 0; n < 6; n++) {massless = massless && leg->crank_inertia[n] == 0.0;}
  if (!isfinite(leg->crank_length) || !all_finite(leg->crank_axis, 6 * sizeof(double)) ||
      !all_finite(leg->crank_center_of_mass, 9 * sizeof(double)) ||
      !isfinite(leg->rod_length) || !isfinite(leg->rod_center_of_mass)) {
    return STEWART_RULE_FINITE;
  }
  if (!(leg->rod_length > 0.0)) {return STEWART_RULE_ROD_LENGTH;}
  if (!(leg->crank_mass >= 0.0 && leg->rod_mass >= 0.0 && leg->rod_inertia >= 0.0)) {
    return STEWART_RULE_LEG_MASS;
  }
  if (!massless && !is_definite(leg->crank_inertia, DEFINITENESS)) {
    return STEWART_RULE_CRANK_INERTIA;
  }
  if (!has_direction(leg->crank_axis)) {return STEWART_RULE_CRANK_AXIS;}
  if (!has_direction(leg->crank_direction) ||
      !(fabs(dot(z, read3(leg->crank_axis))) <= RIGHT_ANGLE * norm(z))) {
    return STEWART_RULE_CRANK_DIRECTION;
  }
  if (fabs(leg->branch) != 1.0) {return STEWART_RULE_BRANCH;}
  if (!(leg->lever_min >= 0.0)) {return STEWART_RULE_LIMIT;}
  if (!(leg->lever_min < 1.0)) {return STEWART_RULE_LEVER;}
  if (!(leg->angle_min < leg->angle_max)) {return STEWART_RULE_ANGLES;}
  double at_min = leg->servo_angle_at_min, at_max = leg->servo_angle_at_max;
  if (isnan(at_min) != isnan(at_max)) {return STEWART_RULE_SERVO_POINTS;}
  if (at_min == at_max) {return STEWART_RULE_SERVO_ANGLES;}
  if (!isnan(at_min) && !(leg->servo_pulse_min < leg->servo_pulse_max)) {
    return STEWART_RULE_SERVO_PULSES;
  }
  return platform->with_clearance ? STEWART_RULE_SHAPE : STEWART_VALID;
}

#endif

#elif defined STEWART_GOVERNOR

/* With the ratio P = (k / L1)^2, |grad P| <= 2 sqrt(1 - P) (1 / L1 + 1 / L2) for a displacement of
   the platform joint: the sine of the angle between the rod and the direction in which the crank's
   end moves, sqrt(1 - P), changes by at most this number times the displacement: docs/cranks.md. */
static double crank_steepness(const stewart_leg * leg)
{return 1.0 / leg->crank_length + 1.0 / leg->rod_length;}

static double crank_sine(double ratio) {return sqrt(largest(1.0 - ratio * ratio, 0.0));}

/* The angle is within pi of home_position: past that it would jump by a turn. The margin is one of
   displacements of the platform joint: the lever falls with the root of the distance from the end
   of reach. */
static double crank_margins(double size, stewart_leg * leg) {
  (void)size;
  leg->angle_min = largest(leg->angle_min, leg->home_position - PI);
  leg->angle_max = least(leg->angle_max, leg->home_position + PI);
  double range = least(leg->angle_max - leg->angle_min, PI);
  double margin = OF_STROKE * 2.0 * leg->crank_length * sin(0.5 * range);
  double sine = crank_sine(leg->lever_min) - margin * crank_steepness(leg);
  leg->lever_min = crank_sine(largest(sine, 0.0));
  leg->crank_torque_max -= 2.0 * leg->coulomb_friction;  /* its sign may change between samples */
  return margin;
}

static double crank_stop_rate(const stewart_leg * leg) {
  double rate = leg->crank_speed_max / (leg->angle_max - leg->angle_min);
  return isfinite(leg->crank_speed_max) && rate > 0.0 ? rate : (double)NAN;
}

/* Distance of a platform joint from those at which the crank has an angle: half a sphere about the
   end of the crank [m]. */
static double crank_distance(const stewart_leg * leg, double position, vector joint) {
  vector anchor, z = read3(leg->crank_direction), n0 = cross(read3(leg->crank_axis), z);
  double rod = crank_anchor(leg, position, &anchor);
  vector n = subtract(scale(cos(position), n0), scale(sin(position), z));
  vector from = subtract(joint, anchor);
  double length = norm(from), height = leg->branch * dot(from, n);
  double radius = sqrt(largest(length * length - height * height, 0.0));
  return height >= 0.0 ? fabs(length - rod) : hypot(height, radius - rod);
}

static unsigned crank_put_room(
  const stewart_leg * leg, double margin, const stewart_motion * motion, double length,
  double * room) {
  crank_pose at = crank_pose_of(leg, motion->position, motion->rotation);
  double ratio = crank_lever_ratio(leg, at.line.lever), position = crank_angle(leg, &at);
  vector joint = add(read3(motion->position), at.line.arm);
  (void)length;
  if (!(ratio >= leg->lever_min)) {return STEWART_LEVER_MIN;}
  *room = (crank_sine(leg->lever_min) - crank_sine(ratio)) / crank_steepness(leg);
  double low = crank_distance(leg, leg->angle_min, joint) - margin;
  double high = crank_distance(leg, leg->angle_max, joint) - margin;
  *room = least(*room, least(low, high));
  return (position > leg->angle_min && low >= 0.0 ? 0u : STEWART_ANGLE_MIN) |
         (position < leg->angle_max && high >= 0.0 ? 0u : STEWART_ANGLE_MAX);
}

/* On a path the sine grows by at most its length; on a straight way to its end there may be poses
   out of reach. */
static double crank_moved(double way, double path) {(void)way; return path;}

/* A rod turns by at most 1 / (L2 k / L1) of the displacement of its joint. The sine is at most the
   one before and the displacement, and where that passes the limit, the limit: stops whose levers
   are not yet known to be within it end before. */
static double crank_turn(
  const stewart_leg * leg, double margin, double length, double lever, double moved) {
  double steep = crank_steepness(leg), sine = crank_sine(crank_lever_ratio(leg, lever));
  double most = crank_sine(leg->lever_min) + margin * steep, end = sine + moved * steep;
  double turned_to = asin(least(end, most)) - asin(sine), beyond = largest(end - most, 0.0) / steep;
  double turn = turned_to / (length * steep);
  return beyond > 0.0 ? turn + beyond / (length * crank_sine(most)) : turn;
}

static int crank_levers_change(void) {return 1;}

/* P'' <= |x'|^2 2 max(1, L2 / L1) / L2^2 + 2 (1 / L1 + 1 / L2) |x''|, and between two samples P is
   above their chord less P'' time^2 / 8. */
static double crank_pieces(
  const stewart_leg * leg, double lever, double next_lever, const motion_bounds * most,
  double arm, double time) {
  double size = leg->crank_length, rod = leg->rod_length;
  double a = lever * lever / (size * size), b = next_lever * next_lever / (size * size);
  double velocity = most->velocity + arm * most->turning;
  double acceleration = most->acceleration + arm * most->turning_rate;
  double convex = 2.0 * largest(1.0, rod / size) / (rod * rod) * velocity * velocity +
    2.0 * crank_steepness(leg) * acceleration;
  double dip = 0.125 * time * time * convex, lowest_known = leg->lever_min * leg->lever_min;
  double lowest_square = largest(least(a, b) - dip, 0.25 * lowest_known);
  if (dip <= DIP * lowest_square && a < 2.0 * b && b < 2.0 * a) {return 1.0;}
  return largest(ceil(sqrt(dip / (DIP * lowest_square))), ceil(fabs(log2(a / b))));
}

static unsigned crank_unproven(void) {return STEWART_LEVER_MIN;}

#else  /* the library alone */

static void crank_drive_row(
  const stewart_leg * leg, const double position[3], const double r[9], double per_size,
  double row[6]) {
  leg_line at = crank_line(leg, position, r);
  vector h = scale(1.0 / at.lever, at.direction);
  put3(row, h), put3(row + 3, scale(per_size, cross(at.arm, h)));
}

static double crank_position(
  const stewart_leg * leg, const double position[3], const double r[9]) {
  crank_pose at = crank_pose_of(leg, position, r);
  return crank_angle(leg, &at);
}

/* (k / L1)' = n . B' / L2 - q' (L1 / L2 + d . e): no division by k. */
static lever_slope crank_slope(const stewart_leg * leg, const crank_pose * at) {
  lever_slope of;
  double size = leg->crank_length, rod = leg->rod_length;
  of.ratio = leg->branch * at->line.lever / size;
  of.of_drive = -leg->branch * (size / rod + dot(at->line.direction, at->along));
  of.of_joint = scale(leg->branch / rod, at->normal);
  return of;
}

/* The lever is one of what changes, by its own magnitude: in half of it a step does not come to the
   dead centre, and not from one side of it to the other. */
static measured_leg crank_measured(const stewart_leg * leg, const stewart_motion * motion) {
  crank_motion of = crank_motion_of(leg, motion);
  lever_slope lever = crank_slope(leg, &of.at);
  double lever_rate = lever.of_drive * of.drive.rate + dot(lever.of_joint, of.end_rate);
  double pace = largest(fabs(of.drive.rate), norm(of.end_rate) / leg->rod_length);
  if (lever_rate != 0.0) {pace = largest(pace, fabs(lever_rate) / lever.ratio);}
  measured_leg to = {of.drive.position, of.drive.rate, HUGE_VAL, lever};
  if (lever.ratio >= 0.0 && pace < HUGE_VAL) {to.pace = pace;}
  return to;
}

static lever_square crank_square(const stewart_leg * leg, const stewart_motion * motion) {
  crank_reserve reserve = crank_reserve_of(leg, motion);
  double per_square = 1.0 / (leg->crank_length * leg->crank_length);
  lever_square of = {per_square * reserve.value, per_square * reserve.rate};
  return of;
}

static vector crank_anchor_rate(const stewart_leg * leg, const stewart_motion * motion)
{return crank_motion_of(leg, motion).tip_rate;}

static void crank_mass(
  const stewart_platform * platform, int i, const stewart_motion * motion, const leg_motion * of,
  leg_mass * to) {
  const stewart_leg * leg = &platform->legs[i];
  crank_pose at = crank_pose_of(leg, motion->position, motion->rotation);
  to->point = leg->platform_end_mass, to->line = 0.0, to->effort = of->effort;
  to->drive = leg->turning_inertia[5] + leg->reflected_mass;
  to->coupling = scale(leg->coupling_mass * leg->crank_length, at.normal);
  for (int n = 0; n < 6; n++) {to->row[n] = of->row[n] / of->lever;}
}

/* A crank and its rod in axes that do not turn: positions from the base's origin, accelerations as
   they are felt, of the ends of the rod. */
typedef struct {
  crank_motion motion;
  vector tip, end, at_tip, at_end, axes[3], omega, alpha;
} absolute_crank;

static absolute_crank absolute_crank_of(
  const stewart_leg * leg, const stewart_motion * motion, const absolute_motion * of) {
  absolute_crank found;
  crank_motion by = found.motion = crank_motion_of(leg, motion);
  vector c = read3(leg->base_joint), u = read3(leg->crank_axis);
  found.axes[0] = by.at.along, found.axes[1] = by.at.normal, found.axes[2] = u;
  found.tip = add(c, scale(leg->crank_length, by.at.along));
  found.end = add(of->position, by.at.line.arm);
  found.at_tip = add(add(of->felt, carried_along(of->spin, of->spin_rate, found.tip)),
                     add(by.tip_acc, scale(2.0, cross(of->spin, by.tip_rate))));
  found.at_end = add(of->acceleration, carried_along(of->omega, of->alpha, by.at.line.arm));
  found.omega = add(of->spin, scale(by.drive.rate, u));
  found.alpha = add(of->spin_rate, scale(by.drive.acceleration, u));
  found.alpha = add(found.alpha, scale(by.drive.rate, cross(of->spin, u)));
  return found;
}

static load crank_momentum_rate(
  const stewart_leg * leg, const stewart_motion * motion, const absolute_motion * of) {
  absolute_crank at = absolute_crank_of(leg, motion, of);
  const double * center = leg->crank_center_of_mass, * inertia = leg->crank_inertia;
  vector c = read3(leg->base_joint), arm = {0.0, 0.0, 0.0}, moment = {0.0, 0.0, 0.0};
  vector w = make(dot(at.axes[0], at.omega), dot(at.axes[1], at.omega), dot(at.axes[2], at.omega));
  vector w_rate = make(
    dot(at.axes[0], at.alpha), dot(at.axes[1], at.alpha), dot(at.axes[2], at.alpha));
  vector turning = add(symmetric(inertia, w_rate), cross(w, symmetric(inertia, w)));
  double of_axes[3];
  put3(of_axes, turning);
  for (int n = 0; n < 3; n++) {
    arm = add(arm, scale(center[n], at.axes[n]));
    moment = add(moment, scale(of_axes[n], at.axes[n]));
  }
  vector at_joint = add(of->felt, carried_along(of->spin, of->spin_rate, c));
  vector of_crank = scale(
    leg->crank_mass, add(at_joint, carried_along(at.omega, at.alpha, arm)));
  vector of_tip = add(scale(leg->crank_end_mass, at.at_tip),
                      scale(leg->coupling_mass, at.at_end));
  vector of_end = add(scale(leg->coupling_mass, at.at_tip),
                      scale(leg->platform_end_mass, at.at_end));
  load rates = {add(of_crank, add(of_tip, of_end)), moment};
  rates.moment = add(rates.moment, cross(add(c, arm), of_crank));
  rates.moment = add(rates.moment, add(cross(at.tip, of_tip), cross(at.end, of_end)));
  return rates;
}

/* First moment of mass (3) and inertia (6) of the crank about its base joint, then the rod's mass
   at the crank, its coupling, and its mass at the platform: legs/crank.py. */
static int crank_columns(
  const stewart_platform * platform, int i, const stewart_motion * motion,
  const absolute_motion * of, leg_columns * columns) {
  const stewart_leg * leg = &platform->legs[i];
  absolute_crank at = absolute_crank_of(leg, motion, of);
  double size = leg->crank_length, * effort = columns->effort;
  vector felt = add(of->felt, carried_along(of->spin, of->spin_rate, read3(leg->base_joint)));
  vector normal = at.axes[1], none = {0.0, 0.0, 0.0};
  double w[3], d[3];
  for (int n = 0; n < 3; n++) {
    w[n] = dot(at.axes[n], at.omega), d[n] = dot(at.axes[n], at.alpha);
  }
  for (int n = 0; n < MOST_COLUMNS; n++) {columns->of_mass[n] = none, effort[n] = 0.0;}
  /* u . (r x A(c)) and u . (I w' + w x I w) */
  effort[0] = dot(normal, felt), effort[1] = -dot(at.axes[0], felt);
  effort[3] = -w[0] * w[1], effort[4] = w[0] * w[0] - w[1] * w[1], effort[5] = d[0] - w[1] * w[2];
  effort[6] = w[0] * w[1], effort[7] = d[1] + w[0] * w[2], effort[8] = d[2];
  effort[9] = size * dot(normal, at.at_tip);
  effort[10] = size * dot(normal, at.at_end);
  columns->of_mass[10] = at.at_tip, columns->of_mass[11] = at.at_end;
  leg_line line = at.motion.at.line;
  columns->arm = line.arm, columns->lever = line.lever;
  columns->rate = at.motion.drive.rate, columns->acceleration = at.motion.drive.acceleration;
  put3(columns->row, line.direction);
  put3(columns->row + 3, scale(1.0 / platform->characteristic_length,
                               cross(line.arm, line.direction)));
  return MOST_COLUMNS;
}

#endif
