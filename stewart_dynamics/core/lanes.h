/* SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * The functions of lanes.c that library.c calls.
 */

#ifndef STEWART_LANES_H
#define STEWART_LANES_H

#include "stewart_dynamics.h"

/* Rows of numbers for many samples: the first, and the distance to the next; 0: one for all. */
typedef struct { const double * first; int64_t stride; } lane_rows;

/* See solve_many in library.h; for each kind of processor. Of each result the first numbers, as
   many as the width says. */
typedef void lanes_function(
  const stewart_platform * platform, int64_t count, lane_rows motions, lane_rows wrenches,
  lane_rows bases, int conditioned, double * results, int64_t result_stride, int64_t width);

lanes_function solve_lanes_baseline;
#if defined(__x86_64__) || defined(_M_X64)
lanes_function solve_lanes_avx2, solve_lanes_avx512;
#endif

/* condition_of of one sample: the matrix in one lane, its inverse in the other. */
double condition_of_pair(double a[6][6], double inverse[6][6]);

#endif
