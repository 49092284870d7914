/* SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * Records of MCAP files: bags/mcap_file.py reads, replay/output_bag.py writes them.
 */

enum {
  RECORD_HEAD = 9, MESSAGE_HEAD = 31, SCHEMA = 3, CHANNEL = 4, MESSAGE = 5, MESSAGE_INDEX = 7,
  LAST_OPCODE = 12
};

/* Return the little-endian integer at a place; 0 if it is not in the data. */
static int64_t integer_at(const uint8_t * data, int64_t data_size, int64_t at, int size) {
  uint64_t value = 0;
  for (int k = 0; at + size <= data_size && k < size; k++) {
    value |= (uint64_t)data[at + k] << (8 * k);
  }
  return (int64_t)value;
}

void scan_records(
  int64_t size, const uint8_t * data, const int64_t * numbers, int64_t room, int64_t * found,
  int64_t * totals) {
  int64_t count = 0, at = 0;
  while (at + RECORD_HEAD <= size) {
    int64_t opcode = data[at], begin = at + RECORD_HEAD;
    int64_t length = integer_at(data, size, at + 1, 8);
    /* fields up to this offset are read */
    int64_t needed = opcode == MESSAGE ? 22 : opcode == MESSAGE_INDEX ? 6 :
      opcode == SCHEMA || opcode == CHANNEL ? 2 : 0;
    if (opcode > LAST_OPCODE || !(totals[0] >> opcode & 1) || begin + needed > size ||
      length < needed || length > totals[1] - begin) {
      break;
    }
    if (opcode == MESSAGE_INDEX && integer_at(data, size, begin + 2, 4) != length - 6) {break;}
    int64_t kind = -opcode, value = integer_at(data, size, begin, 2), skipped = 0;
    if (opcode == MESSAGE) {
      kind = numbers[value], value = integer_at(data, size, begin + 6, 8), skipped = 22;
    }
    if (opcode != MESSAGE || kind >= 0) {
      if (count < room) {
        found[count] = kind, found[room + count] = value >= 0 ? value : INT64_MAX;
        found[2 * room + count] = begin + skipped, found[3 * room + count] = length - skipped;
      }
      count++;
    }
    at = begin + length;
  }
  totals[0] = count, totals[1] = at;
}

void write_records(
  int64_t count, int64_t channel, const int64_t * times, const int64_t * starts,
  const int64_t * sizes, const uint8_t * data, const int64_t * places, uint8_t * content,
  int64_t * entries) {
  for (int64_t k = 0; k < count; k++) {
    uint8_t * record = content + places[k];
    int64_t length = MESSAGE_HEAD - RECORD_HEAD + sizes[k];
    record[0] = MESSAGE;
    memcpy(record + 1, &length, 8);
    memcpy(record + 9, &channel, 2);
    memset(record + 11, 0, 4);  /* sequence */
    memcpy(record + 15, &times[k], 8);
    memcpy(record + 23, &times[k], 8);
    memcpy(record + MESSAGE_HEAD, data + starts[k], (size_t)sizes[k]);
    entries[2 * k] = times[k], entries[2 * k + 1] = places[k];
  }
}
