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

void write_messages(
  int64_t size, const uint8_t * message, int64_t n_stamps, const int64_t * stamp_places,
  int64_t n_parts, const int64_t * parts, int64_t width, int64_t count, const int64_t * stamps,
  const double * rows, uint8_t * messages) {
  for (int64_t k = 0; k < count; k++, messages += size, rows += width) {
    memcpy(messages, message, (size_t)size);
    for (int64_t n = 0; n < n_stamps; n++) {put_stamp(stamps[k], messages + stamp_places[n]);}
    for (const int64_t * part = parts; part < parts + 3 * n_parts; part += 3) {
      if (part[2] == 0) {
        messages[part[0]] = rows[part[1]] > 0.0;
      } else {
        memcpy(messages + part[0], rows + part[1], (size_t)part[2] * sizeof(double));
      }
    }
  }
}
