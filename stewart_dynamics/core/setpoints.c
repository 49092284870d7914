/* SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * The node's step for many setpoints.
 */

void complete_outputs(
  const stewart_platform * platform, int64_t count, const setpoint * setpoints,
  stewart_output * outputs) {
  for (int64_t k = 0; k < count; k++) {
    complete_output(
      platform, &setpoints[k].motion, setpoints[k].base_known > 0.0, &outputs[k]);
  }
}

void solve_setpoints(
  const stewart_platform * platform, int64_t count, const setpoint * setpoints,
  stewart_output * outputs) {
  lane_rows motions = {(const double *)&setpoints->motion, NUMBERS(setpoint)};
  lane_rows wrenches = {setpoints->wrench, NUMBERS(setpoint)};
  lane_rows bases = {(const double *)&setpoints->base, NUMBERS(setpoint)};
  solve_lanes()(platform, count, motions, wrenches, bases, 1, (double *)&outputs->result,
                NUMBERS(stewart_output), NUMBERS(stewart_result));
  complete_outputs(platform, count, setpoints, outputs);
}

int64_t step_setpoints(
  const stewart_platform * platform, int64_t solved, int64_t count, const int64_t * stamps,
  const setpoint * setpoints, stewart_state * state, stewart_output * outputs) {
  int64_t answered = 0;
  for (int64_t k = 0; k < count; k++) {
    const setpoint * of = &setpoints[k];
    stewart_output * to = &outputs[k];
    if (!solved) {
      solve_sample(platform, &of->motion, of->wrench, &of->base, 1, &to->result);
      complete_outputs(platform, 1, of, to);
    }
    if (stamps[k] < -STAMPS_END || stamps[k] >= STAMPS_END) {to->answered = 0.0;}
    double slack = of->stamped > 0.0 ? platform->sync_tolerance : platform->timeout;
    advance_step(platform, stamps[k], JITTER + slack, of->restart > 0.0, state, to);
    answered += to->answered > 0.0;
  }
  return answered;
}
