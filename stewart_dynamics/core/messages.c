/* SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * Messages in CDR, little-endian as the processor, that differ in nothing but stamps and numbers.
 */

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
