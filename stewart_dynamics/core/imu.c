/* SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * The motion of the base of an IMU on it.
 *
 * The angular acceleration is the difference quotient of two angular velocities, through a low-pass
 * filter of the first order, solved exactly for the time dt between them: k = 1 - exp(-2 pi cutoff
 * dt). Slow changes are delayed by dt (1 / k - 1 / 2), for short dt 1 / (2 pi cutoff); white noise
 * of standard deviation s in the angular velocity becomes s k / dt sqrt(2 / (2 - k)).
 */

#include <string.h>

void read_imu(
  const imu_mounting * imu, int64_t stamp, const double * reading, imu_filter * filter,
  stewart_base * base) {
  int64_t interval = filter->given != 0.0 ? stamp - filter->stamp : 0;
  double dt = (double)interval * 1e-9, gain = -expm1(-imu->rate * dt);
  for (int n = 0; n < 3; n++) {
    double old = filter->spin_rate[n];
    filter->spin_rate[n] = 0 < interval && interval <= imu->timeout
      ? old + gain * ((reading[n] - filter->spin[n]) / dt - old) : 0.0;
    filter->spin[n] = reading[n];
  }
  filter->stamp = stamp, filter->given = 1.0;
  /* An accelerometer does not distinguish gravity from acceleration: both are in gravity. */
  const double * r = imu->rotation;
  vector spin = rotate(r, read3(filter->spin)), spin_rate = rotate(r, read3(filter->spin_rate));
  vector arm = read3(imu->position);
  vector carried = add(cross(spin_rate, arm), cross(spin, cross(spin, arm)));
  put3(base->gravity, subtract(carried, rotate(r, read3(reading + 3))));
  put3(base->linear_acceleration, make(0.0, 0.0, 0.0));
  put3(base->angular_velocity, spin), put3(base->angular_acceleration, spin_rate);
}

int64_t base_of_imu(
  const imu_mounting * imu, int64_t stamp, const double * reading, imu_stream * stream,
  stewart_base * base) {
  int64_t since = stream->count > 0 ? stamp - stream->stamps[1] : 0;
  int repeated = stream->count > 0 && since <= imu->timeout &&
    !memcmp(reading, stream->reading, sizeof stream->reading);
  if (all_finite(reading, sizeof stream->reading) && !repeated) {
    stream->stamps[0] = stream->stamps[1], stream->bases[0] = stream->bases[1];
    read_imu(imu, stamp, reading, &stream->filter, &stream->bases[1]);
    memcpy(stream->reading, reading, sizeof stream->reading);
    stream->stamps[1] = stamp, since = 0;
    stream->count = stream->count < 2 ? stream->count + 1 : 2;
  }
  if (stream->count == 0 || since > imu->timeout) {return 0;}
  *base = stream->bases[1];
  if (stream->count < 2) {return 1;}
  double part = least((double)since / (double)(stream->stamps[1] - stream->stamps[0]), 1.0);
  const double * now = (const double *)&stream->bases[1];
  const double * then = (const double *)&stream->bases[0];
  double * to = (double *)base;
  for (size_t n = 0; n < sizeof *base / sizeof *to; n++) {
    to[n] = now[n] + (now[n] - then[n]) * part;
  }
  return 1;
}
