/* SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * Lengths, poses, twists; angles of the joints and clearance of the legs.
 */

void lengths_many(
  const stewart_platform * platform, int64_t count, const stewart_pose * poses, double * lengths) {
  for (int64_t n = 0; n < count; n++) {
    for (int i = 0; i < 6; i++) {
      lengths[6 * n + i] =
        pose_of(&platform->legs[i], poses[n].position, poses[n].rotation).length;
    }
  }
}

FLAT void forward_kinematics_many(
  const stewart_platform * platform, int64_t count, const double * lengths,
  stewart_motion * motions, int64_t * codes, int64_t * steps, double * residuals) {
  for (int64_t n = 0; n < count; n++) {
    int taken;
    codes[n] = find_pose(
      platform, &lengths[6 * n], (stewart_pose *)&motions[n], &taken, &residuals[n]);
    steps[n] = taken;
  }
}

FLAT int64_t forward_kinematics_one(const stewart_platform * platform, one_pose * sample) {
  int steps, code = find_pose(platform, sample->lengths, &sample->pose, &steps, &sample->residual);
  sample->steps = steps;
  return code;
}

void twists_many(
  const stewart_platform * platform, int64_t count, const double * rates,
  stewart_motion * motions) {
  for (int64_t n = 0; n < count; n++) {
    stewart_motion * at = &motions[n];
    leg_pose legs[6];
    double rows[6][6], inverse[6][6];
    scaled_jacobian(platform, at->position, at->rotation, legs, rows, inverse);
    from_legs(platform, inverse, &rates[6 * n], at->linear_velocity, at->angular_velocity);
  }
}

void joint_angles_many(
  const stewart_platform * platform, const double * axes, int64_t count,
  const stewart_motion * motions, double * angles) {
  for (int64_t n = 0; n < count; n++) {
    const double * r = motions[n].rotation;
    for (int i = 0; i < 6; i++) {
      vector s = pose_of(&platform->legs[i], motions[n].position, r).direction;
      angles[12 * n + i] = joint_angle(&axes[3 * i], s);
      angles[12 * n + 6 + i] = joint_angle(&axes[18 + 3 * i], rotate_back(r, s));
    }
  }
}

void joint_haversines_many(
  const stewart_platform * platform, const double * axes, int64_t count,
  const stewart_motion * motions, double * values, double * rates) {
  for (int64_t n = 0; n < count; n++) {
    const double * r = motions[n].rotation;
    vector omega = read3(motions[n].angular_velocity);
    for (int i = 0; i < 6; i++) {
      leg_pose at = pose_of(&platform->legs[i], motions[n].position, r);
      vector s = at.direction;
      double known = 0.0 < at.length && at.length < HUGE_VAL ? 1.0 : NAN;
      vector x_rate = add(read3(motions[n].linear_velocity), cross(omega, at.arm));
      vector s_rate = scale(at.per_length, subtract(x_rate, scale(dot(s, x_rate), s)));
      vector axis = read3(&axes[3 * i]), half = subtract(axis, s);
      values[12 * n + i] = known * 0.25 * dot(half, half);
      rates[12 * n + i] = -0.5 * dot(axis, s_rate);
      axis = read3(&axes[18 + 3 * i]), half = subtract(axis, rotate_back(r, s));
      values[12 * n + 6 + i] = known * 0.25 * dot(half, half);
      rates[12 * n + 6 + i] =
        -0.5 * dot(axis, rotate_back(r, subtract(s_rate, cross(omega, s))));
    }
  }
}

static double norm(vector a) {return sqrt(dot(a, a));}

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

/* Return the distance of a segment from a plate of corners (count, 3), zero where it crosses it;
   where it is `enough` away from the plate's plane, the distance from the plane. */
static double from_plate(
  const double * plate, int64_t count, vector p, vector p_end, double enough) {
  vector origin = read3(plate), area = make(0.0, 0.0, 0.0);
  for (int64_t n = 1; n < count - 1; n++) {
    area = add(area, cross(subtract(read3(&plate[3 * n]), origin),
                           subtract(read3(&plate[3 * n + 3]), origin)));
  }
  vector normal = scale(1.0 / norm(area), area);
  double height = dot(normal, subtract(p, origin));
  double end_height = dot(normal, subtract(p_end, origin));
  double lowest = least(fabs(height), fabs(end_height)), distance = HUGE_VAL;
  int crossing = (height < 0.0) != (end_height < 0.0), above = 1, end_above = 1;
  if (!crossing && lowest >= enough) {return lowest;}
  double part = crossing ? height / (height - end_height) : 0.0;
  vector x = add(p, scale(part, subtract(p_end, p)));
  for (int64_t n = 0; n < count; n++) {
    vector corner = read3(&plate[3 * n]), next = read3(&plate[n + 1 < count ? 3 * n + 3 : 0]);
    vector inward = cross(normal, subtract(next, corner));
    above = above && dot(inward, subtract(p, corner)) >= 0.0;
    end_above = end_above && dot(inward, subtract(p_end, corner)) >= 0.0;
    crossing = crossing && dot(inward, subtract(x, corner)) >= 0.0;
    distance = least(distance, norm(between(p, p_end, corner, next)));
  }
  if (crossing) {return 0.0;}
  distance = above ? least(distance, fabs(height)) : distance;
  return end_above ? least(distance, fabs(end_height)) : distance;
}

enum { BASE_PLATE = 6, MOVING_PLATE = 7 };

static void keep_nearest(
  double * clearances, int64_t * nearest, int leg, int other, double clearance) {
  if (clearance < clearances[leg]) {clearances[leg] = clearance, nearest[leg] = other;}
}

/* A plate limits the clearance of parts that are not joined to it: the moving one that of the
   cylinders, the one of the base that of the pistons, from the end of the cylinder on. */
static void check_plates(
  const stewart_platform * platform, int64_t n_base, const double * base, int64_t n_moving,
  const double * moving, const stewart_motion * motion, const leg_pose at[6], double * clearances,
  int64_t * nearest) {
  for (int i = 0; i < 6; i++) {
    const stewart_leg * leg = &platform->legs[i];
    vector joint = read3(leg->base_joint), s = at[i].direction;
    double cylinder = leg->cylinder_length < at[i].length ? leg->cylinder_length : at[i].length;
    if (n_moving) {
      vector begin = rotate_back(motion->rotation, subtract(joint, read3(motion->position)));
      vector end = add(begin, scale(cylinder, rotate_back(motion->rotation, s)));
      double radius = leg->cylinder_radius;
      keep_nearest(clearances, nearest, i, MOVING_PLATE,
                   from_plate(moving, n_moving, begin, end, clearances[i] + radius) - radius);
    }
    if (n_base) {
      vector begin = add(joint, scale(leg->cylinder_length, s));
      vector end = add(joint, scale(at[i].length, s));
      double radius = leg->piston_radius;
      keep_nearest(clearances, nearest, i, BASE_PLATE,
                   from_plate(base, n_base, begin, end, clearances[i] + radius) - radius);
    }
  }
}

void clearances_many(
  const stewart_platform * platform, int64_t n_base, const double * base, int64_t n_moving,
  const double * moving, int64_t count, const stewart_motion * motions, double * clearances,
  int64_t * nearest) {
  for (int64_t n = 0; n < count; n++, clearances += 6, nearest += 6) {
    leg_pose at[6];
    for (int i = 0; i < 6; i++) {
      at[i] = pose_of(&platform->legs[i], motions[n].position, motions[n].rotation);
      clearances[i] = HUGE_VAL, nearest[i] = i;
    }
    for (int i = 0; i < 6; i++) {
      for (int j = i + 1; j < 6; j++) {
        double clearance = clearance_of(
          &platform->legs[i], &platform->legs[j], &at[i], &at[j]);
        keep_nearest(clearances, nearest, i, j, clearance);
        keep_nearest(clearances, nearest, j, i, clearance);
      }
    }
    check_plates(platform, n_base, base, n_moving, moving, &motions[n], at, clearances, nearest);
  }
}
