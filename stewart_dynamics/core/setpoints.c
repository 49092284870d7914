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

/* When a setpoint comes: see one_setpoint. */
typedef struct {
  int stamp_valid, base_known, restart;
  double since, elapsed;
} arrival;

/* What is written of a setpoint beside its result. */
typedef struct {
  double * forces;
  checked_motors * motors;
  int exceeding, jumped;
} published;

/* Check a result, write what is published; return whether it is answered. */
static int check_setpoint(
  const machine * on, const stewart_motion * motion, const arrival * at, const double angles[12],
  const double clearances[6], const double followed[6], stewart_state * state,
  double windings[12], stewart_result * result, published * to) {
  const stewart_platform * platform = on->platform;
  unsigned exceeded = 0;
  to->exceeding = to->jumped = 0;
  if (!at->stamp_valid || !all_finite(result, sizeof *result)) {return 0;}
  if (at->restart) {  /* this sample is the first, but for the count of crossings */
    state->warning = STEWART_NO_WARNING, state->stopped = 0, state->determinant = 0.0;
  }
  advance_warning(platform, result, state);
  int solved = result->condition_number < UNSOLVABLE_CONDITION && at->base_known;
  for (int i = 0; i < 6; i++) {
    const stewart_leg * leg = &platform->legs[i];
    if (!solved) {result->forces[i] = result->joint_forces[i] = NAN;}
    exceeded |= check_leg(leg, result, i, 1.0) |
      above(fabs(result->lengths[i] - followed[i]), leg->velocity_max * at->elapsed, STEWART_JUMP);
    if (on->checks->angles != 0.0) {exceeded |= check_angles(leg, angles[i], angles[i + 6]);}
  }
  if (on->checks->clearance != 0.0) {exceeded |= check_clearances(on, clearances);}
  to->jumped = (exceeded & STEWART_JUMP) != 0;
  int running = 0, with_motors = on->checks->motors != 0.0;
  clip_forces(platform, result, to->forces);
  if (with_motors) {
    put_motors(platform, on->drives, on->n_curve, on->curve, motion, result->forces, to->forces,
               &to->motors->drives);
    check_motors(on->drives, at->since, to->jumped, windings, to->motors);
    running = to->motors->running > 0.0;
  }
  int suppressed = !solved || suppresses(platform, state->stopped, exceeded, running);
  to->exceeding = exceeded != 0 || (with_motors && to->motors->exceeding > 0.0);
  for (int i = 0; suppressed && i < 6; i++) {
    to->forces[i] = NAN;
    if (with_motors) {to->motors->drives.commands[i] = NAN;}
  }
  return 1;
}

void step_one(
  const stewart_platform * platform, const leg_drives * drives, int64_t n, const double * curve,
  int64_t n_base, const double * base, int64_t n_moving, const double * moving,
  const limit_checks * checks, one_setpoint * setpoint) {
  machine on = {platform, drives, n, curve, n_base, base, n_moving, moving, checks};
  stewart_state state = state_of(&setpoint->before);
  arrival at = {
    setpoint->stamp_valid > 0.0, setpoint->base_known > 0.0, setpoint->restart > 0.0,
    setpoint->since, setpoint->elapsed};
  published to = {setpoint->forces, &setpoint->motors, 0, 0};
  int64_t nearest[6] = {0};
  solve_sample(
    platform, &setpoint->motion, setpoint->wrench, &setpoint->base, &setpoint->result);
  if (checks->angles != 0.0) {put_angles(&on, &setpoint->motion, setpoint->joint_angles);}
  if (checks->clearance != 0.0) {
    put_clearances(&on, &setpoint->motion, setpoint->clearances, nearest);
  }
  for (int i = 0; i < 12; i++) {setpoint->windings[i] = setpoint->windings_before[i];}
  setpoint->answered = check_setpoint(
    &on, &setpoint->motion, &at, setpoint->joint_angles, setpoint->clearances,
    setpoint->followed, &state, setpoint->windings, &setpoint->result, &to);
  setpoint->after = numbers_of(&state);
  setpoint->exceeding = to.exceeding, setpoint->jumped = to.jumped;
  for (int i = 0; i < 6; i++) {setpoint->nearest[i] = (double)nearest[i];}
}

void check_many(
  const stewart_platform * platform, const leg_drives * drives, int64_t n, const double * curve,
  int64_t n_base, const double * base, int64_t n_moving, const double * moving,
  const limit_checks * checks, int64_t count, const int64_t * stamps,
  const uint8_t * bases_known, const uint8_t * restarts, const double * slack,
  const stewart_motion * motions, const double * joint_angles, const double * clearances,
  warning_state * state, int64_t * followed_at, double * followed, double * windings,
  stewart_result * results, double * forces, warning_state * states, checked_motors * motors,
  uint8_t * answered, uint8_t * exceeding, uint8_t * jumped) {
  machine on = {platform, drives, n, curve, n_base, base, n_moving, moving, checks};
  stewart_state now = state_of(state);
  int restart = 0;
  for (int64_t k = 0; k < count; k++) {
    restart = restart || restarts[k];  /* if this one is not answered, the next is the restart */
    arrival at = {
      -STAMPS_END <= stamps[k] && stamps[k] < STAMPS_END, bases_known[k], restart, 0.0, HUGE_VAL};
    if (at.stamp_valid && !restart && stamps[k] > *followed_at) {
      at.since = (double)(stamps[k] - *followed_at) * 1e-9;
      at.elapsed = at.since + slack[k];
    }
    published to = {&forces[6 * k], checks->motors != 0.0 ? &motors[k] : NULL, 0, 0};
    answered[k] = (uint8_t)check_setpoint(
      &on, &motions[k], &at, checks->angles != 0.0 ? &joint_angles[12 * k] : NULL,
      checks->clearance != 0.0 ? &clearances[6 * k] : NULL, followed, &now, windings,
      &results[k], &to);
    exceeding[k] = (uint8_t)to.exceeding, jumped[k] = (uint8_t)to.jumped;
    restart = restart && !answered[k];
    if (answered[k] && !to.jumped) {
      *followed_at = stamps[k];
      for (int i = 0; i < 6; i++) {followed[i] = results[k].lengths[i];}
    }
    states[k] = numbers_of(&now);
  }
  *state = numbers_of(&now);
}
