/* SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * Motion cueing: the classical washout (L. D. Reid, M. A. Nahon, UTIAS Report 296, 1985).
 *
 *   translation  z''' + a2 z'' + a1 z' + a0 z = K u    (s^2 + 2 zeta w s + w^2)(s + w_b); p = z'
 *   tilt         y'' + 2 zeta w y' + w^2 y = w^2 K u / g   y: sine of the angle
 *   rotation     angle' + w angle = K rate
 */

#define TERMS 16              /* of a Taylor series */
#define STANDARD_GRAVITY 9.80665
#define MOST_TILT 0.6         /* sine of the largest tilt that is demanded: 37 degrees */
#define LIMITER 10.0          /* rate with which the rate of tilt nears its limit, times w */
#define BLENDING 4.0           /* rate with which the limit nears one that was changed [1/s] */
#define BISECTIONS 40
#define SHORT_PART 0.5         /* of a tilt's motion, times its fastest rate */
#define CHANGES 8             /* of sides of the law in such a part */

/* Advance x, x', ... of x^(n) + a[n-1] x^(n-1) + ... + a[0] x = u + slope t by a time.

   By its Taylor series, exact but for rounding: no step is longer than half of 1 / fastest, the
   time constant of the fastest root. Steps may have any length: nothing depends on the last. */
static void advance(
  int n, const double * a, double fastest, double u, double slope, double time, double * x) {
  static const double inverse[TERMS + 1] = {
    0.0, 1.0, 1.0 / 2, 1.0 / 3, 1.0 / 4, 1.0 / 5, 1.0 / 6, 1.0 / 7, 1.0 / 8, 1.0 / 9, 1.0 / 10,
    1.0 / 11, 1.0 / 12, 1.0 / 13, 1.0 / 14, 1.0 / 15, 1.0 / 16};
  int64_t steps = 1 + (int64_t)(2.0 * fastest * time);
  double h = time / (double)steps;
  for (int64_t step = 0; step < steps; step++, u += slope * h) {
    double d[TERMS + 4];  /* the derivatives of x, from x itself on */
    for (int i = 0; i < n; i++) {d[i] = x[i];}
    for (int k = 0; k <= TERMS; k++) {
      d[n + k] = k == 0 ? u : k == 1 ? slope : 0.0;
      for (int i = 0; i < n; i++) {d[n + k] -= a[i] * d[i + k];}
    }
    for (int i = 0; i < n; i++) {
      double sum = d[i + TERMS];
      for (int k = TERMS; k > 0; k--) {sum = d[i + k - 1] + h * inverse[k] * sum;}
      x[i] = sum;
    }
  }
}

/* The third-order filter of a translation: a[0] to a[2], and its fastest root. */
static double translation_filter(const washout_filters * f, int i, double a[3]) {
  double w = f->translation_frequency[i], z = f->translation_damping[i];
  double slow = f->washout_frequency[i];
  a[0] = w * w * slow, a[1] = w * w + 2.0 * z * w * slow, a[2] = 2.0 * z * w + slow;
  return largest(w * largest(1.0, 2.0 * z), slow);
}

typedef struct { double w, damping, rate_max, u, slope; } tilt_filter;

/* Acceleration of an angle whose sine is y[0], with the rate y[1] of the sine. */
static double angle_acceleration(const double y[2], double y_acceleration) {
  double squared = 1.0 - y[0] * y[0];
  return (y_acceleration + y[0] * y[1] * y[1] / squared) / sqrt(squared);
}

/* The acceleration of the angle by the filter, and its rate of change. */
static void find_wanted(
  const tilt_filter * f, double time, const double y[2], double * wanted, double * change) {
  double w = f->w, fall = 2.0 * f->damping * w, squared = 1.0 - y[0] * y[0];
  double y_acceleration = w * w * (f->u + f->slope * time - y[0]) - fall * y[1];
  double cosine = sqrt(squared), rate = y[1] / cosine;
  *wanted = angle_acceleration(y, y_acceleration);
  *change = (w * w * (f->slope - y[1]) - fall * y_acceleration + 3.0 * y[0] * rate * *wanted) /
    cosine + rate * rate * rate;
}

/* The side of the law, by which the acceleration is limited: 1 or -1 where it is larger that way
   than the limit of the rate lets it, else 0. */
static int tilt_side(const tilt_filter * f, double time, const double y[2]) {
  double wanted, change, rate = y[1] / sqrt(1.0 - y[0] * y[0]), k = LIMITER * f->w;
  find_wanted(f, time, y, &wanted, &change);
  return wanted > k * (f->rate_max - rate) ? 1 : -wanted > k * (f->rate_max + rate) ? -1 : 0;
}

/* The rate of change of the room of a side of the law: the acceleration that it lets, less
   that of the filter. */
static double change_of_room(const tilt_filter * f, int side, double time, const double y[2]) {
  double wanted, change;
  find_wanted(f, time, y, &wanted, &change);
  return -side * (LIMITER * f->w * wanted + change);
}

/* Advance a tilt by a time on one side of its law: angle'' = k (+-rate_max - angle') there. */
static void advance_on_side(
  const tilt_filter * f, int side, double begin, double time, const double from[2], double y[2]) {
  double w = f->w;
  y[0] = from[0], y[1] = from[1];
  if (side == 0) {
    double a[2] = {w * w, 2.0 * f->damping * w};
    double u = f->u + f->slope * begin;
    advance(2, a, w * largest(1.0, 2.0 * f->damping), w * w * u, w * w * f->slope, time, y);
    return;
  }
  double k = LIMITER * w, most = side * f->rate_max, gone = -expm1(-k * time);
  double rate = y[1] / sqrt(1.0 - y[0] * y[0]);
  double angle = asin(y[0]) + most * time + (rate - most) * gone / k;
  rate += (most - rate) * gone;
  y[0] = sin(angle), y[1] = cos(angle) * rate;
}

/* A time, at most `high`, at which a tilt has left a side of its law; `high` where it has not. Of a
   short part: between its ends the room of either side of the law has one minimum at most. */
static double find_left(
  const tilt_filter * f, int side, double begin, double high, const double from[2]) {
  double y[2];
  advance_on_side(f, side, begin, high, from, y);
  if (tilt_side(f, begin + high, y) != side || side != 0) {return high;}
  for (int toward = -1; toward <= 1; toward += 2) {
    if (change_of_room(f, toward, begin, from) >= 0.0 ||
        change_of_room(f, toward, begin + high, y) <= 0.0) {continue;}
    double low = 0.0, later = high, tried[2];
    for (int n = 0; n < BISECTIONS; n++) {
      double middle = 0.5 * (low + later);
      advance_on_side(f, 0, begin, middle, from, tried);
      if (tilt_side(f, begin + middle, tried) != 0) {return middle;}
      *(change_of_room(f, toward, begin + middle, tried) < 0.0 ? &low : &later) = middle;
    }
  }
  return high;
}

/* Advance a tilt by a time, in short parts; sides of its law change where it does, to rounding. */
static void advance_tilt(const tilt_filter * f, double time, double y[2]) {
  double longest = SHORT_PART / (f->w * largest(1.0, 2.0 * f->damping)), done = 0.0;
  int64_t parts = 1 + (int64_t)(time / longest);
  for (int64_t part = 1; part <= parts; part++) {
    double end = part == parts ? time : (double)part * (time / (double)parts);
    for (int changes = 0; done < end; changes++) {
      int side = tilt_side(f, done, y);
      double low = 0.0, high = find_left(f, side, done, end - done, y), tried[2];
      advance_on_side(f, side, done, high, y, tried);
      int other = tilt_side(f, done + high, tried);
      if (other != side && changes < CHANGES) {
        for (int n = 0; n < BISECTIONS; n++) {
          double middle = 0.5 * (low + high);
          advance_on_side(f, side, done, middle, y, tried);
          *(tilt_side(f, done + middle, tried) == side ? &low : &high) = middle;
        }
        advance_on_side(f, side, done, high, y, tried);
      } else if (side == 0 && other != 0) {
        /* Too many changes: the side that limits it never exceeds the limit. */
        advance_on_side(f, other, done, high, y, tried);
      }
      y[0] = tried[0], y[1] = tried[1];
      done += high;
    }
  }
}

static double sine_of_tilt(const washout_filters * f, int i, double u) {
  double y = f->tilt_gain[i] * u / STANDARD_GRAVITY;
  return largest(-MOST_TILT, least(MOST_TILT, y));
}

/* The tilt's filter between two inputs a time apart. */
static tilt_filter tilt_between(
  const washout_filters * f, double rate_max, int i, double from, double to, double time) {
  double begin = sine_of_tilt(f, i, from), end = sine_of_tilt(f, i, to);
  tilt_filter found = {f->tilt_frequency[i], f->tilt_damping[i],
    (1.0 - 1e-12) * rate_max, begin,  /* rounding does not exceed it */
    time > 0.0 ? (end - begin) / time : 0.0};
  return found;
}

static double * translation_of(cueing_state * state, int i)
{return i == 0 ? state->surge : i == 1 ? state->sway : state->heave;}

/* Write the demand of the filters' states. */
static void put_demand(const washout_filters * f, cueing_state * state, coordinates * demand) {
  for (int i = 0; i < 3; i++) {
    double a[3], u = f->translation_gain[i] * state->input[i], * z = translation_of(state, i);
    translation_filter(f, i, a);
    demand->value[i] = z[1], demand->rate[i] = z[2];
    demand->acceleration[i] = u - a[2] * z[2] - a[1] * z[1] - a[0] * z[0];
    double w = f->rotation_frequency[i], gain = f->rotation_gain[i];
    double rate = gain * state->input[3 + i] - w * state->rotation[i];
    demand->value[3 + i] = state->rotation[i], demand->rate[3 + i] = rate;
    demand->acceleration[3 + i] = gain * state->slope[3 + i] - w * rate;
  }
  for (int i = 0; i < 2; i++) {
    const double * y = &state->tilt[2 * i];
    tilt_filter tilt = tilt_between(
      f, state->tilt_rate_max, i, state->input[i], state->input[i], 0.0);
    int axis = i == 0 ? 4 : 3, side = tilt_side(&tilt, 0.0, y);
    double sign = i == 0 ? -1.0 : 1.0, rate = y[1] / sqrt(1.0 - y[0] * y[0]);
    demand->value[axis] += sign * asin(y[0]);
    demand->rate[axis] += sign * rate;
    demand->acceleration[axis] += sign * (side == 0 ? angle_acceleration(
      y, tilt.w * tilt.w * (tilt.u - y[0]) - 2.0 * tilt.damping * tilt.w * y[1])
      : LIMITER * tilt.w * (side * tilt.rate_max - rate));
  }
}

/* Advance the filters by a time to an input, linear from the last one. */
static void wash_out(
  const washout_filters * f, const double input[6], double time, cueing_state * state) {
  for (int i = 0; i < 3; i++) {
    double a[3], gain = f->translation_gain[i], fastest = translation_filter(f, i, a);
    advance(3, a, fastest, gain * state->input[i], gain * state->slope[i], time,
            translation_of(state, i));
    gain = f->rotation_gain[i];
    advance(1, &f->rotation_frequency[i], f->rotation_frequency[i], gain * state->input[3 + i],
            gain * state->slope[3 + i], time, &state->rotation[i]);
  }
  /* A step of the limit would be one of the acceleration. */
  state->tilt_rate_max += (f->tilt_rate_max - state->tilt_rate_max) * -expm1(-BLENDING * time);
  for (int i = 0; i < 2; i++) {
    tilt_filter tilt = tilt_between(
      f, state->tilt_rate_max, i, state->input[i], input[i], time);
    advance_tilt(&tilt, time, &state->tilt[2 * i]);
  }
  memcpy(state->input, input, sizeof state->input);
}

/* Begin at rest at home, at the first input. */
static void begin_cueing(
  const governed * on, int limited, const washout_filters * f, const double input[6],
  cueing_state * state) {
  coordinates first;
  memcpy(state->input, input, sizeof state->input);
  state->tilt_rate_max = f->tilt_rate_max;
  put_demand(f, state, &first);
  state->governor.following = !limited || !inadmissible(on, &first);
  if (state->governor.following != 0.0) {state->governor.now = first;}
  for (int i = 0; i < 6; i++) {state->governor.share[i] = state->governor.following;}
}

/* Advance by a time to an input, in steps that the governor can take. */
static void cue(
  const governed * on, int limited, const washout_filters * f, const double input[6],
  double time, cueing_state * state) {
  int64_t steps = limited ? 1 + (int64_t)(time / LONGEST_STEP) : 1;
  double from[6], next[6], step = time / (double)steps;
  memcpy(from, state->input, sizeof from);
  coordinates begin, end;
  put_demand(f, state, &begin);
  for (int i = 0; i < 6; i++) {state->slope[i] = (input[i] - from[i]) / time;}
  for (int64_t k = 1; k <= steps; k++, begin = end) {
    double part = (double)k / (double)steps;
    for (int i = 0; i < 6; i++) {
      next[i] = k == steps ? input[i] : from[i] + part * (input[i] - from[i]);
    }
    wash_out(f, next, step, state);
    put_demand(f, state, &end);
    govern(on, limited, &begin, &end, step, &state->governor);
  }
}

void cue_many(
  const stewart_platform * platform, const governor_limits * limits, int64_t limited,
  const washout_filters * filters, int64_t count, const double * times, const double * inputs,
  cueing_state * state, stewart_motion * motions) {
  governed on = {platform, limits};
  for (int64_t k = 0; k < count; k++) {
    if (isnan(state->time)) {
      begin_cueing(&on, limited != 0, filters, &inputs[6 * k], state);
    } else {
      cue(&on, limited != 0, filters, &inputs[6 * k], times[k] - state->time, state);
    }
    state->time = times[k];
    put_motion(limits, &state->governor.now, &motions[k]);
  }
}

void felt_many(
  const double * head, int64_t count, const stewart_motion * motions, double * felt) {
  for (int64_t k = 0; k < count; k++, felt += 6) {
    const stewart_motion * m = &motions[k];
    vector arm = rotate(m->rotation, read3(head)), w = read3(m->angular_velocity);
    vector carried = add(cross(read3(m->angular_acceleration), arm), cross(w, cross(w, arm)));
    vector force = add(read3(m->linear_acceleration), carried);
    force.z += STANDARD_GRAVITY;
    put3(felt, rotate_back(m->rotation, force));
    put3(felt + 3, rotate_back(m->rotation, w));
  }
}
