/* SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * The node's step: singularity warning, limits, and the forces to publish.
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

/* Check a result and write the forces to publish; return whether it is answered. */
static int check_setpoint(
  const stewart_platform * platform, int stamp_valid, int base_known, int restart,
  const double followed[6], double elapsed, stewart_state * state, stewart_result * result,
  double forces[6], int * exceeding, int * jumped) {
  unsigned any_limit = 0;
  *exceeding = *jumped = 0;
  if (!stamp_valid || !all_finite(result, sizeof *result)) {return 0;}
  if (restart) {  /* this sample is the first, but for the count of crossings */
    state->warning = STEWART_NO_WARNING, state->stopped = 0, state->determinant = 0.0;
  }
  advance_warning(platform, result, state);
  int solved = result->condition_number < UNSOLVABLE_CONDITION && base_known;
  for (int i = 0; i < 6; i++) {
    const stewart_leg * leg = &platform->legs[i];
    if (!solved) {result->forces[i] = result->joint_forces[i] = NAN;}
    any_limit |= check_leg(leg, result, i, 1.0) |
      above(fabs(result->lengths[i] - followed[i]), leg->velocity_max * elapsed, STEWART_JUMP);
  }
  command_forces(platform, result, solved, state->stopped, any_limit, NAN, forces);
  *exceeding = any_limit != 0, *jumped = (any_limit & STEWART_JUMP) != 0;
  return 1;
}

void step_one(const stewart_platform * platform, one_setpoint * setpoint) {
  stewart_state state = state_of(&setpoint->before);
  int exceeding, jumped;
  solve_sample(
    platform, &setpoint->motion, setpoint->wrench, &setpoint->base, &setpoint->result);
  setpoint->answered = check_setpoint(
    platform, setpoint->stamp_valid > 0.0, setpoint->base_known > 0.0, setpoint->restart > 0.0,
    setpoint->followed, setpoint->elapsed, &state, &setpoint->result, setpoint->forces,
    &exceeding, &jumped);
  setpoint->after = numbers_of(&state);
  setpoint->exceeding = exceeding, setpoint->jumped = jumped;
}

void check_many(
  const stewart_platform * platform, int64_t count, const int64_t * stamps,
  const uint8_t * bases_known, const uint8_t * restarts, const double * slack,
  warning_state * state, int64_t * followed_at, double * followed, stewart_result * results,
  double * forces, warning_state * states, uint8_t * answered, uint8_t * exceeding,
  uint8_t * jumped) {
  stewart_state now = state_of(state);
  int restart = 0;
  for (int64_t n = 0; n < count; n++) {
    int exceeds, jumps, valid = -STAMPS_END <= stamps[n] && stamps[n] < STAMPS_END;
    double elapsed = HUGE_VAL;
    restart = restart || restarts[n];  /* if this one is not answered, the next is the restart */
    if (valid && !restart && stamps[n] > *followed_at) {
      elapsed = (double)(stamps[n] - *followed_at) * 1e-9 + slack[n];
    }
    answered[n] = (uint8_t)check_setpoint(
      platform, valid, bases_known[n], restart, followed, elapsed, &now, &results[n],
      &forces[6 * n], &exceeds, &jumps);
    exceeding[n] = (uint8_t)exceeds, jumped[n] = (uint8_t)jumps;
    restart = restart && !answered[n];
    if (answered[n] && !jumps) {
      *followed_at = stamps[n];
      for (int i = 0; i < 6; i++) {followed[i] = results[n].lengths[i];}
    }
    states[n] = numbers_of(&now);
  }
  *state = numbers_of(&now);
}
