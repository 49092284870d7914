/* SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * Messages in CDR that differ in nothing but stamps and numbers. The processor is little-endian.
 */

enum {STAMP = 4};  /* where that of a header is */

/* Copy numbers of a size in the order of a message's bytes. */
static void take(void * to, const uint8_t * from, int64_t count, size_t size, int little_endian) {
  memcpy(to, from, (size_t)count * size);
  uint8_t * byte = to;
  for (int64_t n = 0; !little_endian && n < count; n++, byte += size) {
    for (size_t k = 0; k < size / 2; k++) {
      uint8_t old = byte[k];
      byte[k] = byte[size - 1 - k], byte[size - 1 - k] = old;
    }
  }
}

static int is_alike(
  const uint8_t * a, const uint8_t * b, const uint8_t * compared, int64_t size) {
  uint8_t different = 0;
  for (int64_t n = 0; n < size; n++) {different |= (uint8_t)((a[n] ^ b[n]) & compared[n]);}
  return !different;
}

/* Take a sample; return whether it is valid. */
static int take_sample(
  const uint8_t * from, int64_t n_parts, const message_part * parts, int64_t quaternion,
  int64_t n_measured, const int64_t * measured, double largest, int64_t * stamp,
  double * values) {
  int little_endian = from[1] != 0, sound = 1;
  int32_t seconds;
  uint32_t nanoseconds;
  take(&seconds, from + STAMP, 1, sizeof seconds, little_endian);
  take(&nanoseconds, from + STAMP + sizeof seconds, 1, sizeof nanoseconds, little_endian);
  *stamp = (int64_t)seconds * 1000000000 + nanoseconds;
  if (nanoseconds >= 1000000000) {return 0;}
  for (const message_part * part = parts; part < parts + n_parts; part++) {
    double * to = values + part->column;
    take(to, from + part->at, part->count, sizeof *to, little_endian);
    for (int64_t n = 0; n < part->count; n++) {sound &= fabs(to[n]) <= largest;}
  }
  for (int64_t n = 0; n < n_measured; n++) {
    double covariance;
    take(&covariance, from + measured[n], 1, sizeof covariance, little_endian);
    sound &= covariance != -1.0;
  }
  double turn[4];
  if (quaternion >= 0) {take(turn, from + quaternion, 4, sizeof *turn, little_endian);}
  return sound && (quaternion < 0 || stewart_rotation(turn, values + 3) == STEWART_OK);
}

int64_t read_messages(
  int64_t size, const uint8_t * message, const uint8_t * fixed, int64_t n_parts,
  const message_part * parts, int64_t quaternion, int64_t n_measured, const int64_t * measured,
  double largest, int64_t width, int64_t count, const uint8_t * data, const int64_t * starts,
  const int64_t * sizes, int64_t * stamps, double * values) {
  for (int64_t k = 0; k < count; k++, values += width) {
    const uint8_t * from = data + starts[k];
    if (sizes[k] != size || !is_alike(from, message, fixed, size) ||
        !take_sample(from, n_parts, parts, quaternion, n_measured, measured, largest, &stamps[k],
                     values)) {
      return k;
    }
  }
  return count;
}

static void put_stamp(int64_t stamp, uint8_t * to) {
  int64_t second = 1000000000, rest = stamp % second;
  int32_t seconds = (int32_t)(stamp / second - (rest < 0));
  uint32_t nanoseconds = (uint32_t)(rest + (rest < 0 ? second : 0));
  memcpy(to, &seconds, sizeof seconds);
  memcpy(to + sizeof seconds, &nanoseconds, sizeof nanoseconds);
}

static int meets(const message_condition * condition, const double * row) {
  return (condition->known < 0 || !isnan(row[condition->known])) &&
    (condition->unknown < 0 || isnan(row[condition->unknown])) &&
    (condition->positive < 0 || row[condition->positive] > 0.0);
}

void write_messages(
  int64_t size, const uint8_t * message, int64_t n_stamps, const int64_t * stamp_places,
  int64_t n_parts, const message_part * parts, int64_t n_kinds,
  const message_condition * conditions, int64_t width, int64_t count, const int64_t * stamps,
  const double * rows, uint8_t * messages, uint8_t * having, int64_t * numbers) {
  for (int64_t n = 0; n < n_kinds; n++) {numbers[n] = 0;}
  for (int64_t k = 0; k < count; k++, messages += size, rows += width, having += n_kinds) {
    memcpy(messages, message, (size_t)size);
    for (int64_t n = 0; n < n_stamps; n++) {put_stamp(stamps[k], messages + stamp_places[n]);}
    for (const message_part * part = parts; part < parts + n_parts; part++) {
      const double * from = rows + part->column;
      if (part->count == 0) {
        messages[part->at] = *from > 0.0;
      } else {
        memcpy(messages + part->at, from, (size_t)part->count * sizeof(double));
      }
    }
    for (int64_t n = 0; n < n_kinds; n++) {
      having[n] = (uint8_t)meets(&conditions[n], rows);
      numbers[n] += having[n];
    }
  }
}
