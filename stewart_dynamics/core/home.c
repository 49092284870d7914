/* SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * Joints on circles; the home pose, and the directions of the legs there. What home is, and why:
 * mechanics/kinematics/home_pose.py.
 */

#define LENGTH_RATIO 100.0  /* largest length, in larger radii: legs have 1 to 10 */
#define YAWS 36             /* turns that are tried */
#define SWEEPS 30           /* of Jacobi's method; 4 are usual */
#define HEIGHT_HALVINGS 60
#define UPRIGHT 1e-3        /* a leg this near the normal has the tangent as its mount's x [rad] */
#define ALONG_A_LEG 0.1     /* least sine between a leg and the fixed axis of its universal joint */

/* Heights that are tried if the parameters do not give one, in larger radii. */
static const double tried_heights[5] = {0.3, 0.6, 1.0, 1.7, 3.0};

/* A vector of unit length. */
static vector unit(vector a) {
  double length = norm(a);
  return make(a.x / length, a.y / length, a.z / length);
}

void joints_on_circle(double radius, const double * angles, double height, double * joints) {
  for (int i = 0; i < 6; i++) {
    put3(joints + 3 * i, make(radius * cos(angles[i]), radius * sin(angles[i]), height));
  }
}

/* The direction in which points spread least: eigenvector of the smallest eigenvalue, by Jacobi's
   rotations. Exact where the points are in a plane of two axes. */
static vector least_spread(double a[3][3]) {
  double v[3][3] = {{1.0, 0.0, 0.0}, {0.0, 1.0, 0.0}, {0.0, 0.0, 1.0}};
  for (int sweep = 0; sweep < SWEEPS; sweep++) {
    for (int p = 0; p < 2; p++) {
      for (int q = p + 1; q < 3; q++) {
        if (a[p][q] == 0.0) {continue;}
        double theta = 0.5 * (a[q][q] - a[p][p]) / a[p][q];
        double t = copysign(1.0, theta) / (fabs(theta) + sqrt(theta * theta + 1.0));
        double c = 1.0 / sqrt(t * t + 1.0), s = t * c;
        for (int n = 0; n < 3; n++) {
          double x = a[n][p], y = a[n][q];
          a[n][p] = c * x - s * y, a[n][q] = s * x + c * y;
        }
        for (int n = 0; n < 3; n++) {
          double x = a[p][n], y = a[q][n], u = v[n][p], w = v[n][q];
          a[p][n] = c * x - s * y, a[q][n] = s * x + c * y;
          v[n][p] = c * u - s * w, v[n][q] = s * u + c * w;
        }
        a[p][q] = a[q][p] = 0.0;
      }
    }
  }
  int k = 0;
  for (int n = 1; n < 3; n++) {k = a[n][n] < a[k][k] ? n : k;}
  return make(v[0][k], v[1][k], v[2][k]);
}

void level_axes(int64_t count, const double * around, double * axes) {
  static const double units[3][3] = {{1.0, 0.0, 0.0}, {0.0, 1.0, 0.0}, {0.0, 0.0, 1.0}};
  double moments[3][3] = {{0.0}}, components[3];
  for (int64_t n = 0; n < count; n++) {
    for (int k = 0; k < 9; k++) {
      moments[k / 3][k % 3] += around[3 * n + k / 3] * around[3 * n + k % 3];
    }
  }
  if (!all_finite(moments, sizeof moments)) {
    for (int k = 0; k < 9; k++) {axes[k] = units[k / 3][k % 3];}
    return;
  }
  vector normal = least_spread(moments);
  put3(components, normal);
  int nearest = 0;
  for (int n = 1; n < 3; n++) {
    nearest = fabs(components[n]) > fabs(components[nearest]) ? n : nearest;
  }
  normal = scale(components[nearest] < 0.0 ? -1.0 : 1.0, normal);
  vector first = unit(cross(read3(units[(nearest + 2) % 3]), normal));
  put_matrix(axes, first, cross(normal, first), normal);
}

void put_home_legs(const stewart_platform * platform, home_legs * legs) {
  legs->length = 0.0;
  for (int i = 0; i < 6; i++) {
    const stewart_leg * leg = &platform->legs[i];
    vector anchor;
    legs->length += anchor_of(platform, i, leg->home_position, &anchor) / 6.0;
    put3(legs->base[i], anchor);
    put3(legs->platform[i], read3(leg->platform_joint));
    legs->shortest[i] = leg->length_min, legs->longest[i] = leg->length_max;
  }
}

/* Write joints from their center; return the center. */
static vector center_joints(const double joints[6][3], double around[6][3], double * radius) {
  vector sum = {0.0, 0.0, 0.0};
  double distances = 0.0;
  for (int i = 0; i < 6; i++) {sum = add(sum, read3(joints[i]));}
  vector center = make(sum.x / 6.0, sum.y / 6.0, sum.z / 6.0);
  for (int i = 0; i < 6; i++) {
    vector from_center = subtract(read3(joints[i]), center);
    put3(around[i], from_center), distances += norm(from_center);
  }
  *radius = distances / 6.0;
  return center;
}

/* The rotation about the third axis. */
static void put_yaw(double yaw, double r[9]) {
  double c = cos(yaw), s = sin(yaw);
  put_matrix(r, make(c, 0.0 - s, 0.0), make(s, c, 0.0), make(0.0, 0.0, 1.0));
}

/* Legs at a turn, while the center of the platform is at that of the base [m]. */
static void put_offsets(const home_poses * home, double yaw, vector offsets[6]) {
  double r[9];
  put_yaw(yaw, r);
  for (int i = 0; i < 6; i++) {
    offsets[i] = subtract(rotate(r, read3(home->platform[i])), read3(home->base[i]));
  }
}

/* Whether all legs are within their limits at some height, on one side. */
static int fits(const home_legs * legs, const vector offsets[6], double side) {
  double lowest = -HUGE_VAL, highest = HUGE_VAL;
  for (int i = 0; i < 6; i++) {
    double low = legs->shortest[i], high = legs->longest[i];
    double across = sqrt(offsets[i].x * offsets[i].x + offsets[i].y * offsets[i].y);
    /* The height of a leg is that of the platform plus the platform joint's own. */
    double along = side * offsets[i].z;
    double from = sqrt(largest(low * low - across * across, 0.0)) - along;
    double to = (high >= across ? sqrt(fabs(high * high - across * across)) : -HUGE_VAL) - along;
    if (isnan(from) || isnan(to)) {return 0;}
    lowest = largest(lowest, from), highest = least(highest, to);
  }
  return lowest <= highest;
}

/* The distance from the base at which the mean leg has a length, on one side. */
static double height_of(const home_poses * home, double side, const vector legs[6]) {
  double low = 0.0, high = home->length + home->base_radius + home->platform_radius;
  for (int n = 0; n < HEIGHT_HALVINGS; n++) {
    double middle = 0.5 * (low + high), total = 0.0;
    for (int i = 0; i < 6; i++) {
      double raised = legs[i].z + side * middle;
      total += sqrt(legs[i].x * legs[i].x + legs[i].y * legs[i].y + raised * raised);
    }
    *(total / 6.0 < home->length ? &low : &high) = middle;
  }
  return high;
}

/* Write which turn is nearest to 0 of those at which all legs are within their limits. */
static void find_yaw(const home_legs * legs, int64_t side, home_poses * home) {
  int above[YAWS], below[YAWS], any_above = 0, any_below = 0;
  home->across = 0.0;
  for (int n = 0; n < YAWS; n++) {
    vector offsets[6];
    put_offsets(home, 10.0 * n * (PI / 180.0), offsets);
    above[n] = fits(legs, offsets, 1.0), below[n] = fits(legs, offsets, -1.0);
    any_above = any_above || above[n], any_below = any_below || below[n];
    for (int i = 0; i < 6; i++) {
      vector flat = make(offsets[i].x, offsets[i].y, 0.0);
      home->across = largest(home->across, norm(flat));
    }
  }
  home->certain = side != 0 || any_above != any_below;
  home->side = side < 0 || (side == 0 && home->certain != 0.0 && any_below) ? -1.0 : 1.0;
  home->reachable = home->side > 0.0 ? any_above : any_below;
  double least_turn = HUGE_VAL;
  home->yaw = 0.0;
  for (int n = 0; n < YAWS; n++) {
    double yaw = 10.0 * n * (PI / 180.0), turn = fabs(fmod(yaw + PI, 2.0 * PI) - PI);
    if ((home->side > 0.0 ? above[n] : below[n]) && turn < least_turn) {
      least_turn = turn, home->yaw = yaw;
    }
  }
}

/* Write the pose at a height along the normal. */
static void put_pose(
  const home_poses * home, vector base_center, vector platform_center, double height,
  stewart_pose * pose) {
  double turn[9], between[9];
  put_yaw(home->yaw, turn);
  const double * axes = home->axes;
  for (int k = 0; k < 9; k++) {between[k] = dot(column(axes, k / 3), column(turn, k % 3));}
  for (int k = 0; k < 9; k++) {
    pose->rotation[k] = dot(read3(between + 3 * (k / 3)), column(axes, k % 3));
  }
  put3(pose->position, add(subtract(base_center, rotate(pose->rotation, platform_center)),
                           scale(height, read3(home->axes + 6))));
}

/* Write the rotation from the axes of the mount of a leg to base axes: z along the leg at home, x in
   the plane of the base joints. */
static void put_mount(const home_poses * home, int i, vector outward, double mount[9]) {
  vector normal = read3(home->axes + 6), z = read3(home->base_directions[i]);
  vector x = cross(normal, z);
  if (norm(x) < UPRIGHT) {x = cross(normal, outward);}
  if (x.x == 0.0 && x.y == 0.0 && x.z == 0.0) {x = read3(home->axes);}
  x = unit(subtract(x, scale(dot(x, z), z)));
  vector y = unit(cross(z, x));
  put_matrix(mount, make(x.x, y.x, z.x), make(x.y, y.y, z.y), make(x.z, y.z, z.z));
}

void find_home(const home_legs * legs, int64_t side, home_poses * home) {
  double distance = 0.0;
  vector flat[6];
  vector base_center = center_joints(legs->base, home->base, &home->base_radius);
  vector platform_center = center_joints(legs->platform, home->platform, &home->platform_radius);
  level_axes(6, home->base[0], home->axes);
  for (int i = 0; i < 6; i++) {
    put3(home->base[i], rotate(home->axes, read3(home->base[i])));
    put3(home->platform[i], rotate(home->axes, read3(home->platform[i])));
  }
  find_yaw(legs, side, home);
  put_offsets(home, home->yaw, flat);  /* at no height */
  for (int i = 0; i < 6; i++) {distance += norm(flat[i]);}
  home->length = legs->length;
  double radius = largest(home->base_radius, home->platform_radius);
  home->known = distance / 6.0 < home->length && home->length < LENGTH_RATIO * radius;
  int count = 0, on_a_side = home->known != 0.0 ? 1 : 5;
  for (int n = 0; n < 2 * on_a_side; n++) {
    double of = n < on_a_side ? home->side : -home->side;
    home->heights[count++] = home->known != 0.0 ? of * height_of(home, of, flat)
      : of * tried_heights[n % on_a_side] * radius;
  }
  home->count = count;
  for (int n = 0; n < count; n++) {
    put_pose(home, base_center, platform_center, home->heights[n], &home->poses[n]);
  }
  const stewart_pose * at = &home->poses[0];
  for (int i = 0; i < 6; i++) {
    vector end = add(read3(at->position), rotate(at->rotation, read3(legs->platform[i])));
    vector along = subtract(end, read3(legs->base[i]));
    vector direction = norm(along) > 0.0 ? unit(along) : read3(home->axes + 6);
    put3(home->base_directions[i], direction);
    put3(home->platform_directions[i], rotate_back(at->rotation, direction));
    put_mount(home, i, subtract(read3(legs->base[i]), base_center), home->mounts[i]);
  }
}

int64_t put_universal_axes(const home_poses * home, stewart_platform * platform) {
  const double * r = home->poses[0].rotation;
  double sines[12];
  int nearest[2] = {0, 6};
  for (int i = 0; i < 6; i++) {
    stewart_leg * leg = &platform->legs[i];
    vector s = read3(home->base_directions[i]);
    vector base = isnan(leg->base_universal_axis[0])
      ? column(home->mounts[i], 0) : read3(leg->base_universal_axis);
    vector moving = isnan(leg->platform_universal_axis[0])
      ? rotate_back(r, base) : read3(leg->platform_universal_axis);
    base = unit(base), moving = unit(moving);
    vector w = rotate(r, moving);
    sines[i] = norm(cross(base, s)), sines[i + 6] = norm(cross(w, s));
    nearest[0] = sines[i] < sines[nearest[0]] ? i : nearest[0];
    nearest[1] = sines[i + 6] < sines[nearest[1]] ? i + 6 : nearest[1];
    /* The axis of a joint has no sense: of its two directions the one with the smaller twist. */
    double cosine = dot(base, w) - dot(base, s) * dot(w, s);
    put3(leg->base_universal_axis, base);
    put3(leg->platform_universal_axis, scale(cosine < 0.0 ? -1.0 : 1.0, moving));
  }
  return sines[nearest[0]] < ALONG_A_LEG ? nearest[0] + 1
    : sines[nearest[1]] < ALONG_A_LEG ? nearest[1] + 1 : 0;
}
