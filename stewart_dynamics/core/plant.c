/* SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * The simulated hexapod: motion under efforts of the drives or motor torques, integrated at a fixed step.
 * Method and equations: simulator/plant.py.
 */

#define MOST_ATTEMPTS 64   /* solutions until one is taken as it is; one or two are usual */
#define CAREFUL 8          /* from this one on a single direction of power is changed at a time */
#define LARGEST_MOVE 0.5   /* of a step: turn [rad], or a joint's move by its leg's length */

/* Write the acceleration of a motion under motor torques, which are clipped to those available,
   and the efforts of the drives; `others` act on the drives, not through screws or gears. */
static void accelerate_by_torques(
  const stewart_platform * platform, stewart_motion * motion, double torques[6],
  const double others[6], const double wrench[6],
  const stewart_base * base, double efforts[6]) {
  stewart_platform changed = *platform;
  double power[6], factor[6], pushes[6];
  for (int k = 0; k < 3; k++) {
    motion->linear_acceleration[k] = motion->angular_acceleration[k] = 0.0;
  }
  for (int i = 0; i < 6; i++) {
    double rate = drive_of(platform, i, motion).rate;
    double most = curve_torque(platform, platform->legs[i].motor_ratio * rate);
    torques[i] = clipped(torques[i], least(platform->legs[i].torque_max, most));
    power[i] = torques[i] * rate;
  }
  for (int attempt = 0, settled = 0; attempt < MOST_ATTEMPTS && !settled; attempt++) {
    for (int i = 0; i < 6; i++) {
      const stewart_leg * leg = &platform->legs[i];
      factor[i] = factor_of(leg, power[i], drive_of(platform, i, motion).rate);
      changed.legs[i].reflected_mass = leg->reflected_mass / factor[i];
      pushes[i] = leg->motor_ratio * torques[i] / factor[i] + others[i];
    }
    accelerate(&changed, motion, pushes, wrench, base);
    settled = 1;
    for (int i = 0; i < 6; i++) {
      const stewart_leg * leg = &platform->legs[i];
      drive_motion of = drive_of(platform, i, motion);
      double inertial = leg->reflected_mass * of.acceleration;
      double through = (leg->motor_ratio * torques[i] - inertial) / factor[i];
      efforts[i] = through + inertial;
      if ((through * of.rate > 0.0) != (power[i] > 0.0) && (settled || attempt < CAREFUL)) {
        power[i] = through * of.rate, settled = 0;
      }
    }
  }
}

/* Return the effort of a drive's end stops [N or N m]: springs and dampers, which never pull. */
static double stop_effort(const end_stops * stops, int i, double position, double rate) {
  double too_low = stops->lowest[i] - position, too_high = position - stops->highest[i];
  double spring = stops->stiffness[i], damper = stops->damping[i] * rate;
  if (too_low > 0.0) {return largest(0.0, spring * too_low - damper);}
  return too_high > 0.0 ? -largest(0.0, spring * too_high + damper) : 0.0;
}

/* Add the end stop near a dead centre, which acts on drive and platform joint by the slope of the
   lever: to the effort of the drive, and to the wrench on the platform. */
static void add_lever_stop(
  const stewart_platform * platform, const end_stops * stops, int i,
  const stewart_motion * motion, double rate, double * effort, double wrench[6]) {
  lever_slope lever = lever_slope_of(platform, i, motion->position, motion->rotation);
  double too_near = stops->least_lever[i] - lever.ratio;
  if (!(too_near > 0.0)) {return;}
  vector arm = rotate(motion->rotation, read3(platform->legs[i].platform_joint));
  vector joint = add(
    read3(motion->linear_velocity), cross(read3(motion->angular_velocity), arm));
  double lever_rate = lever.of_drive * rate + dot(lever.of_joint, joint);
  double push = largest(0.0, stops->stiffness[i] * too_near - stops->damping[i] * lever_rate);
  vector force = scale(push, lever.of_joint);
  *effort += push * lever.of_drive;
  put3(wrench, add(read3(wrench), force));
  put3(wrench + 3, add(read3(wrench + 3), cross(arm, force)));
}

/* Write the rotation of a quaternion, which within a step is not of unit length. */
static void put_rotation(const double q[4], double rotation[9]) {
  double k = 1.0 / sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  double x = k * q[0], y = k * q[1], z = k * q[2], w = k * q[3];
  put_matrix(
    rotation, make(1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)),
    make(2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)),
    make(2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)));
}

/* Write the base's motion after a part of the period, between 0 and 1. */
static void move_base(const one_plant * plant, double part, stewart_base * base) {
  const double * begin = (const double *)&plant->bases[0];
  const double * middle = (const double *)&plant->bases[1];
  const double * end = (const double *)&plant->bases[2];
  double * now = (double *)base;
  for (size_t n = 0; moves(&plant->bases[0]) && n < sizeof *base / sizeof *now; n++) {
    now[n] = (1.0 - part) * (1.0 - 2.0 * part) * begin[n] + 4.0 * part * (1.0 - part) * middle[n] +
      part * (2.0 * part - 1.0) * end[n];
  }
}

/* The motion of a state, its efforts and, where they are the commands, the clipped torques. */
typedef struct { stewart_motion motion; double efforts[6], torques[6]; } driven_motion;

/* Write a state's time derivative under its loads and a motion of the base. */
ONCE static driven_motion differentiate(
  const stewart_platform * platform, const one_plant * plant, const plant_state * state,
  const stewart_base * base, plant_state * slope) {
  driven_motion of;
  double load_of_all[6], stop[6];
  int by_wrench = platform->legs[0].pitch != 0.0;
  vector velocity = read3(state->twist), omega = read3(state->twist + 3);
  put3(of.motion.position, read3(state->position));
  put_rotation(state->quaternion, of.motion.rotation);
  put3(of.motion.linear_velocity, velocity), put3(of.motion.angular_velocity, omega);
  for (int k = 0; k < 3; k++) {
    of.motion.linear_acceleration[k] = of.motion.angular_acceleration[k] = 0.0;
  }
  for (int k = 0; k < 6; k++) {load_of_all[k] = plant->wrench[k];}
  for (int i = 0; i < 6; i++) {
    measured_leg leg = measured_of(platform, i, &of.motion);
    stop[i] = stop_effort(&plant->stops, i, leg.position, leg.rate);
    if (by_wrench) {
      leg_line at = line_of(platform, i, of.motion.position, of.motion.rotation);
      double row[6];
      put3(row, at.direction), put3(row + 3, cross(at.arm, at.direction));
      for (int k = 0; k < 6; k++) {load_of_all[k] += stop[i] * row[k];}
      stop[i] = 0.0;
    }
    if (plant->stops.least_lever[i] > 0.0) {
      add_lever_stop(
        platform, &plant->stops, i, &of.motion, leg.rate, &stop[i], load_of_all);
    }
    of.torques[i] = plant->commands[i];
    of.efforts[i] = of.torques[i] + stop[i];
  }
  if (plant->by_torques > 0.0) {
    accelerate_by_torques(platform, &of.motion, of.torques, stop, load_of_all,
                          base, of.efforts);
  } else {
    accelerate(platform, &of.motion, of.efforts, load_of_all, base);
  }
  vector imaginary = read3(state->quaternion);
  put3(slope->position, velocity);
  put3(slope->quaternion, scale(
    0.5, add(scale(state->quaternion[3], omega), cross(omega, imaginary))));
  slope->quaternion[3] = -0.5 * dot(omega, imaginary);
  put3(slope->twist, read3(of.motion.linear_acceleration));
  put3(slope->twist + 3, read3(of.motion.angular_acceleration));
  return of;
}

/* Write the positions, rates and levers of the legs; return the largest of the angular speed and of
   how fast they change [1/s]; infinite where a leg has no length or does not reach. */
ONCE static double write_legs(
  const stewart_platform * platform, const plant_state * state, one_plant * plant) {
  stewart_motion motion = {{0.0}, {0.0}, {0.0}, {0.0}, {0.0}, {0.0}};
  vector omega = read3(state->twist + 3);
  double fastest = norm(omega);
  put3(motion.position, read3(state->position));
  put3(motion.linear_velocity, read3(state->twist)), put3(motion.angular_velocity, omega);
  put_rotation(state->quaternion, motion.rotation);
  for (int i = 0; i < 6; i++) {
    measured_leg leg = measured_of(platform, i, &motion);
    plant->positions[i] = leg.position, plant->rates[i] = leg.rate;
    plant->lever_ratios[i] =
      lever_slope_of(platform, i, motion.position, motion.rotation).ratio;
    fastest = largest(fastest, leg.pace);
  }
  return fastest;
}

/* Write state + h slope, number by number. */
static void step_from(
  const plant_state * state, double h, const plant_state * slope, plant_state * after) {
  const double * from = (const double *)state, * rate = (const double *)slope;
  double * to = (double *)after;
  for (size_t n = 0; n < sizeof *state / sizeof *from; n++) {to[n] = from[n] + h * rate[n];}
}

/* Write the state after one step of the classical Runge-Kutta method; return whether it is finite.
   The base's motion is that at the begin, and becomes that at the end. */
static int take_step(
  const stewart_platform * platform, const one_plant * plant, double number_of_step,
  stewart_base * base, plant_state * after) {
  plant_state slope, mean;
  double h = plant->step;
  differentiate(platform, plant, &plant->state, base, &mean);
  step_from(&plant->state, 0.5 * h, &mean, after);
  move_base(plant, (number_of_step + 0.5) / plant->steps, base);
  differentiate(platform, plant, after, base, &slope);
  step_from(&mean, 2.0, &slope, &mean);
  step_from(&plant->state, 0.5 * h, &slope, after);
  differentiate(platform, plant, after, base, &slope);
  step_from(&mean, 2.0, &slope, &mean);
  step_from(&plant->state, h, &slope, after);
  move_base(plant, (number_of_step + 1.0) / plant->steps, base);
  differentiate(platform, plant, after, base, &slope);
  step_from(&mean, 1.0, &slope, &mean);
  step_from(&plant->state, h / 6.0, &mean, after);
  int finite = all_finite(after, sizeof *after);
  double * q = after->quaternion;
  double length = sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  for (int k = 0; k < 4; k++) {q[k] /= length;}
  return finite;
}

void plant_advance(const stewart_platform * platform, one_plant * plant) {
  stewart_base base = plant->bases[0];
  plant_state after, slope;
  int by_torques = plant->by_torques > 0.0;
  for (int i = 0; i < 6 && !by_torques; i++) {
    double most = plant->effort_max[i];
    plant->commands[i] = least(largest(plant->commands[i], -most), most);
    plant->efforts[i] = plant->commands[i];
  }
  int sound = plant->step * write_legs(platform, &plant->state, plant) <= LARGEST_MOVE;
  for (int64_t k = 0; k < (int64_t)plant->steps; k++) {
    int finite = take_step(platform, plant, (double)k, &base, &after);
    sound = sound && finite &&
      plant->step * write_legs(platform, &after, plant) <= LARGEST_MOVE;
    if (!sound) {break;}
    plant->state = after;
  }
  driven_motion of =
    differentiate(platform, plant, &plant->state, &base, &slope);
  sound = sound && all_finite(slope.twist, sizeof slope.twist);
  for (int i = 0; i < 6 && by_torques; i++) {plant->efforts[i] = of.efforts[i];}
  if (platform->with_motors) {
    put_motors(platform, &of.motion, plant->efforts, plant->efforts, &plant->motors);
    for (int i = 0; i < 6 && by_torques; i++) {plant->motors.commands[i] = of.torques[i];}
  }
  for (int i = 0; i < 6; i++) {
    plant->acceleration[i] = sound ? slope.twist[i] : 0.0;
    if (!sound) {
      plant->state.twist[i] = plant->efforts[i] = 0.0;
      plant->motors.speeds[i] = plant->motors.commands[i] = 0.0;
    }
  }
  write_legs(platform, &plant->state, plant);
  plant->sound = sound;
}
