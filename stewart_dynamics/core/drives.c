/* SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * The drives of a hexapod, whatever its legs are; axes and branches of cranks.
 */

#define NEAR_ZERO (0.5 * PI)  /* no crank is farther from its zero at home by itself [rad] */
#define ROUNDING 1e-9         /* of an angle at home [rad] */

void put_drives(
  const stewart_platform * platform, const stewart_output * output, drive_values * drives) {
  stewart_result result = output->result;
  int turning = platform->leg_kind == STEWART_CRANK;
  const double * positions = positions_of(platform, &result);
  const double * efforts = efforts_of(platform, &result);
  for (int i = 0; i < 6; i++) {
    const stewart_leg * leg = &platform->legs[i];
    unsigned exceeded = output->exceeded[i];
    drives->positions[i] = positions[i], drives->efforts[i] = efforts[i];
    drives->rates[i] = turning ? result.speeds[i] : result.rates[i];
    drives->rate_max[i] = rate_max_of(platform, i);
    drives->effort_max[i] = turning ? leg->crank_torque_max : leg->force_max;
    drives->below[i] = (exceeded & (turning ? STEWART_ANGLE_MIN : STEWART_LENGTH_MIN)) != 0;
    drives->above[i] = (exceeded & (turning ? STEWART_ANGLE_MAX : STEWART_LENGTH_MAX)) != 0;
  }
}

void level_cranks(const double * headings, double * axes, double * directions) {
  for (int i = 0; i < 6; i++) {
    double cosine = cos(headings[i]), sine = sin(headings[i]);
    put3(axes + 3 * i, make(sine, -cosine, 0.0));
    put3(directions + 3 * i, make(cosine, sine, 0.0));
  }
}

/* Whether an angle at home is within the limits, or near zero. */
static int likely_at_home(const stewart_leg * leg, double angle) {
  double low = isfinite(leg->angle_min) ? leg->angle_min : -NEAR_ZERO;
  double high = isfinite(leg->angle_max) ? leg->angle_max : NEAR_ZERO;
  double middle = 0.5 * (low + high), turned = angle - middle;
  turned = middle + (turned - 2.0 * PI * rint(turned / (2.0 * PI)));
  return low - ROUNDING <= turned && turned <= high + ROUNDING;
}

int64_t choose_branches(
  stewart_platform * platform, const stewart_pose * home, const double * wanted,
  double * angles) {
  int64_t undecided = 0;
  for (int i = 0; i < 6; i++) {
    stewart_leg * leg = &platform->legs[i];
    int possible[2];
    for (int n = 0; n < 2; n++) {
      leg->branch = n == 0 ? 1.0 : -1.0;
      crank_pose at = crank_pose_of(leg, home->position, home->rotation);
      angles[2 * i + n] = crank_arctangent(at.sine, at.cosine);
      possible[n] = likely_at_home(leg, angles[2 * i + n]);
    }
    leg->branch = wanted[i] != 0.0 ? wanted[i] : possible[0] ? 1.0 : -1.0;
    if (undecided == 0 && wanted[i] == 0.0 && possible[0] == possible[1]) {
      undecided = i + 1 + 6 * possible[0];
    }
  }
  return undecided;
}
