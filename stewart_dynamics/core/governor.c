/* SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * The governor: the next state of a motion that follows a demand, from which a stop within all
 * limits exists. Method and equations: mechanics/governor.py.
 */

#include <string.h>

#define STOP_SAMPLES 16    /* of a stop that are checked */
#define COARSE_SAMPLES 8   /* enough within this share of the limits of rates and loads: */
#define COARSE_SHARE 0.95
#define HALVINGS 5         /* of the share of the demand */
#define RECOVERY 0.25      /* time in which a share grows from 0 to 1 [s] */
#define SETTLED 1e-12      /* a smaller deviation from the demand is none [m, rad; times rates] */
#define LONGEST_STEP 0.01  /* a longer one is divided [s] */

/* Times of the samples of a stop, times its rate; after the coarse ones, the last of which is at
   rest, those between them. The rate that the present acceleration leads to peaks at 1 to 1.3, with
   the curvature k^2: samples 0.35 apart, which coarse ones are, miss 1.5 % of it, the others 0.3 %,
   and the turning of the legs some more. */
static const double stop_times[STOP_SAMPLES] = {
  0.0, 0.25, 0.6, 0.95, 1.3, 1.9, 3.2, HUGE_VAL, 0.12, 0.42, 0.77, 1.12, 1.5, 1.7, 2.4, 4.5};

/* A hexapod whose limits have the margins of a governor, and what else that keeps. */
typedef struct {
  machine of;
  const governor_limits * limits;
} governed;

/* The state after a time of the stop v'' + 2 k v' + k^2 v = 0 from a state. */
static coordinates stopped(const coordinates * from, double k, double time) {
  coordinates to;
  double kt = k * time, left = exp(-kt), gone = isinf(kt) ? 0.0 : kt * left;
  for (int i = 0; i < 6; i++) {
    double v = from->rate[i], b = from->acceleration[i] + k * v;
    to.value[i] = from->value[i] + v * (1.0 - left) / k + b * (1.0 - left - gone) / (k * k);
    to.rate[i] = v * left + b * gone / k;
    to.acceleration[i] = from->acceleration[i] * left - b * gone;
  }
  return to;
}

/* The state after a time of the return e''' + 3 k e'' + 3 k^2 e' + k^3 e = 0 to zero. */
static coordinates rerotate(const coordinates * from, double k, double time) {
  coordinates to;
  double left = exp(-k * time);
  for (int i = 0; i < 6; i++) {
    /* e = (c0 + c1 t + c2 t^2 / 2) exp(-k t) */
    double c0 = from->value[i], c1 = from->rate[i] + k * c0;
    double c2 = from->acceleration[i] + 2.0 * k * c1 - k * k * c0;
    double p = c0 + time * (c1 + 0.5 * time * c2), q = c1 + time * c2;
    to.value[i] = left * p;
    to.rate[i] = left * (q - k * p);
    to.acceleration[i] = left * (c2 - 2.0 * k * q + k * k * p);
  }
  return to;
}

/* The motion of the platform in the base frame at coordinates: displacement of the head and
   angles of R = Rz Ry Rx, both from home and in its axes. */
static void put_motion(
  const governor_limits * g, const coordinates * at, stewart_motion * motion) {
  double sa = sin(at->value[3]), ca = cos(at->value[3]);
  double sb = sin(at->value[4]), cb = cos(at->value[4]);
  double sc = sin(at->value[5]), cc = cos(at->value[5]);
  double da = at->rate[3], db = at->rate[4], dc = at->rate[5];
  double dda = at->acceleration[3], ddb = at->acceleration[4], ddc = at->acceleration[5];
  double r[9] = {
    cc * cb, cc * sb * sa - sc * ca, cc * sb * ca + sc * sa,
    sc * cb, sc * sb * sa + cc * ca, sc * sb * ca - cc * sa,
    -sb, cb * sa, cb * ca};
  /* w = E angles', w' = E angles'' + E' angles' */
  vector w = {cc * cb * da - sc * db, sc * cb * da + cc * db, dc - sb * da};
  vector wd = {
    cc * cb * dda - sc * ddb - (sc * cb * dc + cc * sb * db) * da - cc * dc * db,
    sc * cb * dda + cc * ddb + (cc * cb * dc - sc * sb * db) * da - sc * dc * db,
    ddc - sb * dda - cb * db * da};
  const double * home = g->home.rotation;
  vector head = read3(g->head), arm = rotate(r, head), turning = cross(w, arm);
  put3(motion->position, add(read3(g->home.position), rotate(
    home, add(head, subtract(read3(at->value), arm)))));
  put3(motion->linear_velocity, rotate(home, subtract(read3(at->rate), turning)));
  put3(motion->linear_acceleration, rotate(home, subtract(
    read3(at->acceleration), add(cross(wd, arm), cross(w, turning)))));
  put3(motion->angular_velocity, rotate(home, w));
  put3(motion->angular_acceleration, rotate(home, wd));
  for (int i = 0; i < 3; i++) {
    for (int j = 0; j < 3; j++) {
      motion->rotation[3 * i + j] =
        home[3 * i] * r[j] + home[3 * i + 1] * r[3 + j] + home[3 * i + 2] * r[6 + j];
    }
  }
}

/* Whether one of six values is above a share of its bound; nan is. */
static int one_above(const double * values, const double * most, double share) {
  for (int i = 0; i < 6; i++) {
    if (!(fabs(values[i]) <= share * most[i])) {return 1;}
  }
  return 0;
}

/* The lowest of some bits, counted from 1; 0 if there is none. */
static int lowest(unsigned bits) {
  int bit = 1;
  while (bits && !(bits & 1u)) {bits >>= 1, bit++;}
  return bits ? bit : 0;
}

/* The limit, counted from 1, that a motion exceeds, 0 if none; of rates and loads a share of it. */
static int exceeded_by(
  const governed * on, const stewart_motion * motion, const stewart_result * result,
  double share) {
  const governor_limits * g = on->limits;
  const machine * of = &on->of;
  const stewart_leg * legs = of->platform->legs;
  unsigned exceeded = 0;
  if (!(result->condition_number < g->condition_max && result->determinant * g->side > 0.0)) {
    return GOVERNED_SINGULARITY + 1;
  }
  for (int i = 0; i < 6; i++) {exceeded |= check_leg(&legs[i], result, i, share);}
  if (!exceeded && of->checks->angles != 0.0) {
    double angles[12];
    put_angles(of, motion, angles);
    for (int i = 0; i < 6; i++) {exceeded |= check_angles(&legs[i], angles[i], angles[i + 6]);}
  }
  if (!exceeded && of->checks->clearance != 0.0) {
    double clearances[6];
    int64_t nearest[6];
    put_clearances(of, motion, clearances, nearest);
    exceeded |= check_clearances(of, clearances);
  }
  if (exceeded || of->checks->motors == 0.0) {return lowest(exceeded);}
  motor_row row;
  leg_drives at_any_rate = *of->drives;  /* breakaway torques, as if each leg could reverse */
  for (int i = 0; i < 6; i++) {at_any_rate.legs[i].slow = HUGE_VAL;}
  put_motors(of->platform, &at_any_rate, of->n_curve, of->curve, motion, result->forces,
             result->forces, &row);
  for (int i = 0; i < 6; i++) {row.available_torques[i] *= g->load_share;}
  return one_above(row.speeds, g->speed_max, share) ? GOVERNED_SPEED_MAX + 1
    : one_above(row.breakaway_torques, row.available_torques, share) ? GOVERNED_TORQUE_MAX + 1 : 0;
}

/* The limit, counted from 1, that one of some motions exceeds, 0 if none. */
static int one_exceeded(
  const governed * on, const stewart_motion * motions, const stewart_result * results,
  double share) {
  int found = 0;
  for (int n = 0; n < COARSE_SAMPLES && !found; n++) {
    found = exceeded_by(on, &motions[n], &results[n], share);
  }
  return found;
}

/* The limit, counted from 1, that a state or the stop from it exceeds, 0 if none. */
static int inadmissible(const governed * on, const coordinates * state) {
  static const double no_wrench[6] = {0.0};
  static const stewart_base still = {{NAN, NAN, NAN}, {0.0}, {0.0}, {0.0}};
  double rate = on->limits->stop_rate;
  int found = 0;
  for (int first = 0; first < STOP_SAMPLES && !found; first += COARSE_SAMPLES) {
    stewart_motion motions[COARSE_SAMPLES];
    stewart_result results[COARSE_SAMPLES];
    for (int n = 0; n < COARSE_SAMPLES; n++) {
      coordinates at = stopped(state, rate, stop_times[first + n] / rate);
      put_motion(on->limits, &at, &motions[n]);
    }
    solve_many(on->of.platform, COARSE_SAMPLES, motions, 1, no_wrench, 1, &still, 1, results);
    if (first == 0 && !one_exceeded(on, motions, results, COARSE_SHARE)) {return 0;}
    found = one_exceeded(on, motions, results, 1.0);
  }
  return found;
}

/* Each coordinate between stop and demand, by its share of the demand. */
static coordinates toward(
  const coordinates * stop, const coordinates * demand, const double share[6]) {
  coordinates at;
  for (int i = 0; i < 6; i++) {
    double s = share[i];
    at.value[i] = stop->value[i] + s * (demand->value[i] - stop->value[i]);
    at.rate[i] = stop->rate[i] + s * (demand->rate[i] - stop->rate[i]);
    at.acceleration[i] =
      stop->acceleration[i] + s * (demand->acceleration[i] - stop->acceleration[i]);
  }
  return at;
}

/* Write the largest shares found, none above `most`, with which the next state is admissible;
   zero, the stop, always is. Returns the limit that `most` exceeds, 0 if none. */
static int find_shares(
  const governed * on, const coordinates * stop, const coordinates * demand,
  const double most[6], double share[6]) {
  coordinates at = toward(stop, demand, most);
  int limit = inadmissible(on, &at);
  memcpy(share, most, 6 * sizeof *share);
  if (!limit) {return 0;}
  /* One share of all first: the demand keeps its direction. */
  double low = 0.0, high = 1.0, tried[6];
  for (int n = 0; n < HALVINGS; n++) {
    double middle = 0.5 * (low + high);
    for (int i = 0; i < 6; i++) {tried[i] = middle * most[i];}
    at = toward(stop, demand, tried);
    *(inadmissible(on, &at) ? &high : &low) = middle;
  }
  for (int i = 0; i < 6; i++) {share[i] = low * most[i];}
  /* Then each coordinate alone: those that the limit does not concern go on. */
  for (int i = 0; i < 6; i++) {
    double kept = share[i];
    for (int n = 0; n < 2; n++) {
      share[i] = n == 0 ? most[i] : 0.5 * (kept + most[i]);
      at = toward(stop, demand, share);
      if (!inadmissible(on, &at)) {break;}
      share[i] = kept;
    }
  }
  return limit;
}

/* Advance a governed motion by a time, toward a demand whose states at begin and end are given. */
static void govern(
  const governed * on, int limited, const coordinates * begin, const coordinates * end,
  double time, governor_state * state) {
  if (state->stopping != 0.0) {
    state->now = stopped(&state->now, on->limits->stop_rate, time);
    state->following = 0.0;
    memset(state->share, 0, sizeof state->share);
    return;
  }
  if (state->following != 0.0) {
    if (!limited || !inadmissible(on, end)) {
      state->now = *end;
      return;
    }
    state->following = 0.0;
  }
  const double zero[6] = {0.0};
  coordinates deviation = toward(begin, &state->now, zero);
  double far = 0.0, k = on->limits->return_rate;
  for (int i = 0; i < 6; i++) {
    deviation.value[i] = state->now.value[i] - begin->value[i];
    deviation.rate[i] = state->now.rate[i] - begin->rate[i];
    deviation.acceleration[i] = state->now.acceleration[i] - begin->acceleration[i];
  }
  deviation = rerotate(&deviation, k, time);
  coordinates demand = *end;
  for (int i = 0; i < 6; i++) {
    demand.value[i] += deviation.value[i];
    demand.rate[i] += deviation.rate[i];
    demand.acceleration[i] += deviation.acceleration[i];
    far = largest(far, largest(fabs(deviation.value[i]), largest(
      fabs(deviation.rate[i]) / k, fabs(deviation.acceleration[i]) / (k * k))));
  }
  double most[6], whole = 1.0;
  for (int i = 0; i < 6; i++) {
    most[i] = least(1.0, state->share[i] + time / RECOVERY);
    whole = least(whole, most[i]);
  }
  if (limited) {
    coordinates stop = stopped(&state->now, on->limits->stop_rate, time);
    int limit = find_shares(on, &stop, &demand, most, state->share);
    state->now = whole == 1.0 && !limit ? demand : toward(&stop, &demand, state->share);
    for (int i = 0; limit && i < 6; i++) {
      state->held[limit - 1] += time * (1.0 - state->share[i]) / 6.0;
    }
    whole = limit ? 0.0 : whole;
  } else {
    state->now = demand;
    for (int i = 0; i < 6; i++) {state->share[i] = 1.0;}
    whole = 1.0;
  }
  if (whole == 1.0 && far < SETTLED) {
    state->following = 1.0;
    state->now = *end;
  }
}

int64_t governed_limit(
  const stewart_platform * platform, const leg_drives * drives, int64_t n, const double * curve,
  int64_t n_base, const double * base, int64_t n_moving, const double * moving,
  const limit_checks * checks, const governor_limits * limits, const coordinates * state) {
  governed on = {
    {platform, drives, n, curve, n_base, base, n_moving, moving, checks}, limits};
  return inadmissible(&on, state);
}

void govern_many(
  const stewart_platform * platform, const leg_drives * drives, int64_t n, const double * curve,
  int64_t n_base, const double * base, int64_t n_moving, const double * moving,
  const limit_checks * checks, const governor_limits * limits, int64_t count,
  const double * times, const coordinates * demands, governed_stream * stream,
  stewart_motion * motions) {
  governed on = {
    {platform, drives, n, curve, n_base, base, n_moving, moving, checks}, limits};
  for (int64_t k = 0; k < count; k++) {
    if (!isnan(stream->time)) {
      govern(&on, 1, &stream->demand, &demands[k], times[k] - stream->time, &stream->governor);
    }
    stream->time = times[k], stream->demand = demands[k];
    put_motion(limits, &stream->governor.now, &motions[k]);
  }
}
