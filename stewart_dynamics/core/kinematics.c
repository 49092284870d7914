/* SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * Lengths, poses, twists; angles of the joints and clearance of the legs; Euler angles.
 */

void euler_angles_many(int64_t count, const double * rotations, double * angles) {
  for (int64_t n = 0; n < count; n++, rotations += 9, angles += 3) {
    const double * r = rotations;
    double gamma = atan2(r[3], r[0]), c = cos(gamma), s = sin(gamma);
    angles[0] = atan2(s * r[2] - c * r[5], c * r[4] - s * r[1]);
    angles[1] = atan2(-r[6], (double)hypotl(r[0], r[3]));  /* rounded once, on all systems */
    angles[2] = gamma;
  }
}

void positions_many(
  const stewart_platform * platform, int64_t count, const stewart_pose * poses,
  double * positions) {
  for (int64_t n = 0; n < count; n++) {
    for (int i = 0; i < 6; i++) {
      positions[6 * n + i] =
        position_of(platform, i, poses[n].position, poses[n].rotation);
    }
  }
}

void servo_pulses_many(
  const stewart_platform * platform, int64_t count, const double * positions, double * pulses,
  int64_t * codes) {
  for (int64_t n = 0; n < count; n++) {
    for (int i = 0; i < 6; i++) {pulses[6 * n + i] = NAN;}
    codes[n] = stewart_servo_pulses(platform, &positions[6 * n], &pulses[6 * n]);
  }
}

void missing_many(
  const stewart_platform * platform, int64_t count, const stewart_pose * poses,
  double * distances) {
  for (int64_t n = 0; n < count; n++) {
    for (int i = 0; i < 6; i++) {
      distances[6 * n + i] =
        missing_distance(platform, i, poses[n].position, poses[n].rotation);
    }
  }
}

void lever_squares_many(
  const stewart_platform * platform, int64_t count, const stewart_motion * motions,
  double * values, double * rates) {
  for (int64_t n = 0; n < count; n++) {
    for (int i = 0; i < 6; i++) {
      lever_square of = lever_square_of(platform, i, &motions[n]);
      values[6 * n + i] = of.value, rates[6 * n + i] = of.rate;
    }
  }
}

FLAT void forward_kinematics_many(
  const stewart_platform * platform, int64_t count, const double * positions,
  stewart_motion * motions, int64_t * codes, int64_t * steps, double * residuals) {
  for (int64_t n = 0; n < count; n++) {
    int taken;
    codes[n] = find_pose(
      platform, &positions[6 * n], (stewart_pose *)&motions[n], &taken, &residuals[n]);
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
    leg_line lines[6];
    double rows[6][6], inverse[6][6];
    lines_at(platform, at->position, at->rotation, lines);
    scaled_jacobian(platform, lines, rows, inverse);
    put_twist(platform, lines, inverse, &rates[6 * n], at);
  }
}

void joint_angles_many(
  const stewart_platform * platform, int64_t count, const stewart_motion * motions,
  double * angles) {
  for (int64_t n = 0; n < count; n++, angles += 12) {
    put_joint_angles(platform, &motions[n], angles, angles + 6);
  }
}

void joint_haversines_many(
  const stewart_platform * platform, int64_t count, const stewart_motion * motions,
  double * values, double * rates) {
  for (int64_t n = 0; n < count; n++) {
    const double * r = motions[n].rotation;
    vector omega = read3(motions[n].angular_velocity);
    for (int i = 0; i < 6; i++) {
      const stewart_leg * leg = &platform->legs[i];
      leg_line at = line_of(platform, i, motions[n].position, r);
      vector s = at.direction;
      double known = 0.0 < at.length && at.length < HUGE_VAL ? 1.0 : NAN;
      vector x_rate = add(read3(motions[n].linear_velocity), cross(omega, at.arm));
      x_rate = subtract(x_rate, anchor_rate_of(platform, i, &motions[n]));
      vector s_rate = scale(at.per_length, subtract(x_rate, scale(dot(s, x_rate), s)));
      vector axis = read3(leg->base_joint_axis), half = subtract(axis, s);
      values[12 * n + i] = known * 0.25 * dot(half, half);
      rates[12 * n + i] = -0.5 * dot(axis, s_rate);
      axis = read3(leg->platform_joint_axis), half = subtract(axis, rotate_back(r, s));
      values[12 * n + 6 + i] = known * 0.25 * dot(half, half);
      rates[12 * n + 6 + i] =
        -0.5 * dot(axis, rotate_back(r, subtract(s_rate, cross(omega, s))));
    }
  }
}

void clearances_many(
  const stewart_platform * platform, int64_t count, const stewart_motion * motions,
  double * clearances, int64_t * nearest) {
  for (int64_t n = 0; n < count; n++) {
    put_clearances(platform, &motions[n], &clearances[6 * n], &nearest[6 * n]);
  }
}
