/* SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * Many hexapods side by side: loops and layout alone, see library.h. A part of library.c; NVRTC
 * compiles this file by itself, with all that it includes, and each function with STEWART_KERNEL
 * is a kernel: a thread for each sample of each hexapod, or for each hexapod.
 */

#ifdef __CUDACC_RTC__
#include "stewart_dynamics.c"
#define STEWART_KERNEL extern "C" __global__
#include "library.h"
#define FLAT __noinline__  /* functions of many lines, called from several places: inlined, they
                               take minutes to compile */
#define ONCE __noinline__
#define NUMBERS(structure) ((int64_t)(sizeof(structure) / sizeof(double)))
#include "legs.c"
#include "dynamics.c"
#include "plant.c"
#define EACH(n, count) \
  int64_t n = (int64_t)blockIdx.x * blockDim.x + threadIdx.x; n < (count); \
  n += (int64_t)gridDim.x * blockDim.x
#else
#define EACH(n, count) int64_t n = 0; n < (count); n++
#endif

/* Copy numbers from an array, `stride` apart; or into one. */
static void gather(int64_t count, const double * from, int64_t stride, double * to)
{for (int64_t n = 0; n < count; n++) {to[n] = from[n * stride];}}

static void scatter(int64_t count, const double * from, double * to, int64_t stride)
{for (int64_t n = 0; n < count; n++) {to[n * stride] = from[n];}}

/* Where the numbers of sample s of hexapod h begin in an array with strides _h, _s and _n. */
#define AT(array) (array + h * array ## _h + s * array ## _s)
#define GATHER(array, to) gather( \
  (int64_t)(sizeof(to) / sizeof(double)), AT(array), array ## _n, (double *)&to)

STEWART_KERNEL void hexapods_solve(
  const stewart_platform * platforms, const int64_t * which, int64_t hexapods, int64_t samples,
  int64_t conditioned, int64_t width,
  const double * motions, int64_t motions_h, int64_t motions_s, int64_t motions_n,
  const double * wrenches, int64_t wrenches_h, int64_t wrenches_s, int64_t wrenches_n,
  const double * bases, int64_t bases_h, int64_t bases_s, int64_t bases_n,
  double * results, int64_t results_h, int64_t results_s, int64_t results_n) {
  for (EACH(n, hexapods * samples)) {
    int64_t h = n / samples, s = n % samples;
    stewart_motion motion;
    stewart_base base;
    stewart_result result;
    double wrench[6];
    GATHER(motions, motion), GATHER(wrenches, wrench), GATHER(bases, base);
    solve_sample(&platforms[which[h]], &motion, wrench, &base, (int)conditioned, &result);
    scatter(width, (const double *)&result, AT(results), results_n);
  }
}

STEWART_KERNEL void hexapods_limits(
  const stewart_platform * platforms, const int64_t * which, int64_t hexapods, int64_t samples,
  const double * motions, int64_t motions_h, int64_t motions_s, int64_t motions_n,
  const double * wrenches, int64_t wrenches_h, int64_t wrenches_s, int64_t wrenches_n,
  const double * bases, int64_t bases_h, int64_t bases_s, int64_t bases_n,
  int64_t * exceeded, int64_t exceeded_h, int64_t exceeded_s, int64_t exceeded_n) {
  for (EACH(n, hexapods * samples)) {
    int64_t h = n / samples, s = n % samples;
    const stewart_platform * platform = &platforms[which[h]];
    stewart_motion motion;
    stewart_base base;
    stewart_output output;
    double wrench[6];
    GATHER(motions, motion), GATHER(wrenches, wrench), GATHER(bases, base);
    solve_sample(platform, &motion, wrench, &base, 1, &output.result);
    complete_output(platform, &motion, 1, &output);
    for (int i = 0; i < 6; i++) {
      AT(exceeded)[i * exceeded_n] =
        output.answered > 0.0 ? (int64_t)check_leg(platform, &output, i) : -1;
    }
  }
}

STEWART_KERNEL void hexapods_accelerate(
  const stewart_platform * platforms, const int64_t * which, int64_t hexapods, int64_t samples,
  const double * motions, int64_t motions_h, int64_t motions_s, int64_t motions_n,
  const double * efforts, int64_t efforts_h, int64_t efforts_s, int64_t efforts_n,
  const double * wrenches, int64_t wrenches_h, int64_t wrenches_s, int64_t wrenches_n,
  const double * bases, int64_t bases_h, int64_t bases_s, int64_t bases_n,
  double * accelerations, int64_t accelerations_h, int64_t accelerations_s,
  int64_t accelerations_n) {
  for (EACH(n, hexapods * samples)) {
    int64_t h = n / samples, s = n % samples;
    stewart_motion motion;
    stewart_base base;
    double effort[6], wrench[6];
    GATHER(motions, motion), GATHER(efforts, effort);
    GATHER(wrenches, wrench), GATHER(bases, base);
    accelerate(&platforms[which[h]], &motion, effort, wrench, &base);
    scatter(6, motion.linear_acceleration, AT(accelerations), accelerations_n);
  }
}

STEWART_KERNEL void hexapods_positions(
  const stewart_platform * platforms, const int64_t * which, int64_t hexapods, int64_t samples,
  const double * poses, int64_t poses_h, int64_t poses_s, int64_t poses_n,
  double * positions, int64_t positions_h, int64_t positions_s, int64_t positions_n) {
  for (EACH(n, hexapods * samples)) {
    int64_t h = n / samples, s = n % samples;
    stewart_pose pose;
    GATHER(poses, pose);
    for (int i = 0; i < 6; i++) {
      AT(positions)[i * positions_n] =
        position_of(&platforms[which[h]], i, pose.position, pose.rotation);
    }
  }
}

STEWART_KERNEL void hexapods_poses(
  const stewart_platform * platforms, const int64_t * which, int64_t hexapods, int64_t samples,
  const double * positions, int64_t positions_h, int64_t positions_s, int64_t positions_n,
  double * poses, int64_t poses_h, int64_t poses_s, int64_t poses_n,
  int64_t * codes, int64_t codes_h, int64_t codes_s) {
  for (EACH(n, hexapods * samples)) {
    int64_t h = n / samples, s = n % samples;
    stewart_pose pose;
    double position[6], residual;
    int steps;
    GATHER(positions, position), GATHER(poses, pose);
    *AT(codes) = find_pose(&platforms[which[h]], position, &pose, &steps, &residual);
    scatter(NUMBERS(pose), (const double *)&pose, AT(poses), poses_n);
  }
}

STEWART_KERNEL void hexapods_step(
  const stewart_platform * platforms, const plant_constants * constants, const int64_t * which,
  int64_t hexapods, double steps, double step, const uint8_t * chosen,
  const double * commands, int64_t commands_h, int64_t commands_n,
  const double * wrenches, int64_t wrenches_h, int64_t wrenches_n,
  const double * bases, int64_t bases_h, int64_t bases_n,
  double * states, int64_t states_h, int64_t states_n,
  double * legs, int64_t legs_h, int64_t legs_n,
  double * motors, int64_t motors_h, int64_t motors_n) {
  enum { LEGS = 31 };  /* numbers of one_plant from the positions to `sound` */
  for (EACH(h, hexapods)) {
    const stewart_platform * platform = &platforms[which[h]];
    const plant_constants * of = &constants[which[h]];
    double * to = legs + h * legs_h;
    one_plant plant;
    if (!chosen[h] || !(to[(LEGS - 1) * legs_n] > 0.0)) {continue;}  /* not sound: it is held */
    plant.by_torques = of->by_torques, plant.steps = steps, plant.step = step;
    plant.stops = of->stops;
    gather(6, of->effort_max, 1, plant.effort_max);
    gather(6, commands + h * commands_h, commands_n, plant.commands);
    gather(6, wrenches + h * wrenches_h, wrenches_n, plant.wrench);
    gather(NUMBERS(stewart_base), bases + h * bases_h, bases_n, (double *)&plant.bases[0]);
    plant.bases[1] = plant.bases[2] = plant.bases[0];
    gather(NUMBERS(plant_state), states + h * states_h, states_n, (double *)&plant.state);
    plant_advance(platform, &plant);
    scatter(NUMBERS(plant_state), (const double *)&plant.state, states + h * states_h, states_n);
    scatter(LEGS, plant.positions, to, legs_n);
    if (platform->with_motors) {
      double * motor = motors + h * motors_h;
      scatter(6, plant.motors.angles, motor, motors_n);
      scatter(6, plant.motors.speeds, motor + 6 * motors_n, motors_n);
      scatter(6, plant.motors.commands, motor + 12 * motors_n, motors_n);
    }
  }
}

#ifndef __CUDACC_RTC__

void complete_hexapods(
  int64_t count, stewart_platform * platforms, int64_t n_payloads, const double * payloads,
  int64_t * codes, int64_t * places) {
  for (int64_t n = 0; n < count; n++) {
    const double * payload = &payloads[n_payloads == 1 ? 0 : 10 * n];
    int where;
    stewart_complete(&platforms[n]);
    codes[n] = stewart_check(&platforms[n], &where), places[n] = where;
    if (codes[n] == STEWART_VALID && payload[0] > 0.0) {
      codes[n] = -stewart_add_payload(&platforms[n], payload[0], payload + 1, payload + 4);
    }
  }
}

#endif
