/* SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * The node's step: singularity warning, limits, motors, and the forces to publish.
 */

static stewart_state state_of(const warning_state * from) {
  stewart_state state;
  state.warning = (int)from->cause, state.stopped = from->stopped > 0.0;
  state.determinant = from->determinant, state.time_to_crossing = from->time_to_crossing;
  state.crossings = (uint32_t)from->crossings;
  return state;
}

static warning_state numbers_of(const stewart_state * state) {
  warning_state numbers;
  numbers.cause = state->warning, numbers.stopped = state->stopped;
  numbers.determinant = state->determinant, numbers.time_to_crossing = state->time_to_crossing;
  numbers.crossings = state->crossings;
  return numbers;
}

/* A hexapod with all that is checked: the first arguments of functions that Python calls. */
typedef struct {
  const stewart_platform * platform;
  const leg_drives * drives;
  int64_t n_curve;
  const double * curve;
  int64_t n_base;
  const double * base;
  int64_t n_moving;
  const double * moving;
  const limit_checks * checks;
} machine;

static void put_angles(const machine * on, const stewart_motion * motion, double angles[12])
{joint_angles_many(on->platform, on->checks->joint_axes, 1, motion, angles);}

static void put_clearances(
  const machine * on, const stewart_motion * motion, double clearances[6], int64_t nearest[6]) {
  clearances_many(on->platform, on->n_base, on->base, on->n_moving, on->moving, 1, motion,
                  clearances, nearest);
}

static unsigned check_clearances(const machine * on, const double clearances[6]) {
  unsigned exceeded = 0;
  for (int i = 0; i < 6; i++) {
    exceeded |= below(clearances[i], on->platform->leg_clearance_min, STEWART_LEG_CLEARANCE_MIN);
  }
  return exceeded;
}

/* Time since the last setpoint that was not a jump, 0 where there is none; the same with the
   tolerance of stamps, infinite where there is none [s]. */
typedef struct { double since, elapsed; } passed;

static passed passed_at(int64_t stamp, double slack, int restart, const step_state * before) {
  passed time = {0.0, HUGE_VAL};
  int64_t last = (int64_t)before->seconds * 1000000000 + (int64_t)before->nanoseconds;
  if (!restart && stamp > last) {
    time.since = (double)(stamp - last) * 1e-9;
    time.elapsed = time.since + slack;
  }
  return time;
}

/* Check a setpoint whose result is finite, write what is published, and update the state. */
static void check_setpoint(
  const machine * on, const setpoint * of, passed time, const double angles[12],
  const double clearances[6], step_state * before, setpoint_output * to, checked_motors * motors) {
  const stewart_platform * platform = on->platform;
  stewart_result * result = &to->result;
  unsigned exceeded = 0;
  int running = 0, first = isnan(before->lengths[0]), warned = before->warning.cause > 0.0;
  stewart_state state = state_of(&before->warning);
  if (to->restart > 0.0) {  /* this sample is the first, but for the count of crossings */
    state.warning = STEWART_NO_WARNING, state.stopped = 0, state.determinant = 0.0;
  }
  advance_warning(platform, result, &state);
  before->warning = to->warning = numbers_of(&state);
  to->changed = first || warned != (state.warning != STEWART_NO_WARNING);
  int solved = result->condition_number < UNSOLVABLE_CONDITION && of->base_known > 0.0;
  for (int i = 0; i < 6; i++) {
    const stewart_leg * leg = &platform->legs[i];
    double way = result->lengths[i] - before->lengths[i];
    if (!solved) {result->forces[i] = result->joint_forces[i] = NAN;}
    to->mean_rates[i] = way / time.elapsed;
    exceeded |= check_leg(leg, result, i, 1.0) |
      above(fabs(way), leg->velocity_max * time.elapsed, STEWART_JUMP);
    if (on->checks->angles != 0.0) {exceeded |= check_angles(leg, angles[i], angles[i + 6]);}
  }
  if (on->checks->clearance != 0.0) {exceeded |= check_clearances(on, clearances);}
  int jumped = (exceeded & STEWART_JUMP) != 0, with_motors = on->checks->motors != 0.0;
  clip_forces(platform, result, to->forces);
  if (with_motors) {
    put_motors(platform, on->drives, on->n_curve, on->curve, &of->motion, result->forces,
               to->forces, &motors->drives);
    check_motors(on->drives, time.since, jumped, before->windings, motors);
    running = motors->running > 0.0;
  }
  int suppressed = !solved || suppresses(platform, state.stopped, exceeded, running);
  to->jumped = jumped;
  to->exceeding = exceeded != 0 || (with_motors && motors->exceeding > 0.0);
  for (int i = 0; suppressed && i < 6; i++) {
    to->forces[i] = NAN;
    if (with_motors) {motors->drives.commands[i] = NAN;}
  }
}

int64_t check_setpoints(
  const stewart_platform * platform, const leg_drives * drives, int64_t n, const double * curve,
  int64_t n_base, const double * base, int64_t n_moving, const double * moving,
  const limit_checks * checks, const double * zero_lengths, double slack, double slack_of_arrival,
  int64_t solved, int64_t count, const int64_t * stamps, const setpoint * setpoints,
  double * joint_angles, double * clearances, step_state * state, setpoint_output * outputs,
  checked_motors * motors) {
  machine on = {platform, drives, n, curve, n_base, base, n_moving, moving, checks};
  int64_t answered = 0;
  for (int64_t k = 0; k < count; k++) {
    const setpoint * of = &setpoints[k];
    setpoint_output * to = &outputs[k];
    double * angles = checks->angles != 0.0 ? &joint_angles[12 * k] : NULL;
    double * clearance = checks->clearance != 0.0 ? &clearances[6 * k] : NULL;
    if (!solved) {
      int64_t nearest[6];
      solve_sample(platform, &of->motion, of->wrench, &of->base, &to->result);
      if (angles) {put_angles(&on, &of->motion, angles);}
      if (clearance) {put_clearances(&on, &of->motion, clearance, nearest);}
    }
    for (int i = 0; i < 6; i++) {to->positions[i] = to->result.lengths[i] - zero_lengths[i];}
    int restart = state->restarting > 0.0 || of->restart > 0.0;
    int sound = -STAMPS_END <= stamps[k] && stamps[k] < STAMPS_END &&
      all_finite(&to->result, sizeof to->result);
    to->answered = sound, to->restart = restart;
    state->restarting = restart && !sound;  /* then the next setpoint is the restart */
    if (!sound) {continue;}
    passed time = passed_at(
      stamps[k], of->stamped > 0.0 ? slack : slack_of_arrival, restart, state);
    check_setpoint(&on, of, time, angles, clearance, state, to,
                   checks->motors != 0.0 ? &motors[k] : NULL);
    if (to->jumped == 0.0) {
      state->seconds = (double)(stamps[k] / 1000000000);
      state->nanoseconds = (double)(stamps[k] % 1000000000);
      for (int i = 0; i < 6; i++) {state->lengths[i] = to->result.lengths[i];}
    }
    answered++;
  }
  return answered;
}
