/* SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * Messages in CDR (XCDR1, "plain CDR": OMG DDS-XTypes 1.3, 7.4.3): four bytes that give the byte
 * order, then the fields, each aligned to its own size. The processor is little-endian.
 */

/* ---- reading -------------------------------------------------------------------------------- */

/* A message: the place of the next field, and the first fault, with the number that shows it. */
typedef struct {
  const uint8_t * data;
  int64_t size, at, fault, number;
  int little_endian;
} cdr_message;

static void note_fault(cdr_message * of, int64_t fault, int64_t number) {
  if (of->fault) {return;}
  int other = of->size > 0 && of->data[0] != 0;
  of->fault = fault == FAULT_ENDS && other ? FAULT_ENCAPSULATION : fault, of->number = number;
}

/* Copy numbers of a size in the order of a message's bytes, if it has them at a place. */
static void copy_numbers(cdr_message * of, int64_t at, int64_t count, size_t size, void * to) {
  size_t whole = (size_t)count * size;
  if (at + (int64_t)whole > of->size) {note_fault(of, FAULT_ENDS, 0);}
  if (of->fault) {
    memset(to, 0, whole);
    return;
  }
  memcpy(to, of->data + at, whole);
  uint8_t * byte = to;
  for (int64_t n = 0; !of->little_endian && n < count; n++, byte += size) {
    for (size_t k = 0; k < size / 2; k++) {
      uint8_t old = byte[k];
      byte[k] = byte[size - 1 - k], byte[size - 1 - k] = old;
    }
  }
}

static int64_t read_count(cdr_message * of) {
  uint32_t count;
  int64_t at = (of->at + 3) & ~INT64_C(3);
  copy_numbers(of, at, 1, sizeof count, &count);
  of->at = at + 4;
  return count;
}

/* Read the length of a sequence: of at most so many entries, if this is not zero. */
static int64_t read_length(cdr_message * of, int64_t most) {
  int64_t length = read_count(of);
  if (length > of->size) {note_fault(of, FAULT_SEQUENCE, length);}
  if (most && length > most) {note_fault(of, FAULT_ENTRIES, length);}
  return of->fault ? 0 : length;
}

/* A string and its zero byte. */
static void check_text(cdr_message * of, int64_t at, int64_t size) {
  if (size && (at + size > of->size || of->data[at + size - 1] != 0)) {
    note_fault(of, FAULT_TEXT, 0);
  }
}

/* Return where numbers begin, and go behind them. */
static int64_t pass_numbers(cdr_message * of, int64_t count) {
  int64_t at = ((of->at + 3) & ~INT64_C(7)) + 4;
  of->at = at + 8 * count;
  return at;
}

/* A header. */
typedef struct { int32_t seconds; uint32_t nanoseconds, frame_size; } message_header;

static cdr_message begin_message(const uint8_t * data, int64_t size, message_header * head) {
  cdr_message of = {data, size, 16, FAULT_NONE, 0, size > 1 && data[1] == 1};
  if (size < 2) {note_fault(&of, FAULT_ENDS, 0);}
  if (size > 1 && data[1] > 1) {note_fault(&of, FAULT_ENCAPSULATION, 0);}
  copy_numbers(&of, 4, 3, sizeof(uint32_t), head);
  of.at += head->frame_size;
  return of;
}

/* Return the stamp [ns] of a header. */
static int64_t check_header(cdr_message * of, const message_header * head) {
  if (!of->fault && of->data[0] != 0) {note_fault(of, FAULT_ENCAPSULATION, 0);}
  if (head->nanoseconds >= 1000000000) {note_fault(of, FAULT_NANOSECONDS, head->nanoseconds);}
  check_text(of, 16, head->frame_size);
  return (int64_t)head->seconds * 1000000000 + head->nanoseconds;
}

/* Types of messages with a header and numbers, and how many they are. */
static const int64_t type_numbers[] = {7, 6, 37, 19};

static message_content read_content(
  int64_t type, const uint8_t * data, int64_t size, double * numbers) {
  static const int64_t parts[] = {7, 6, 6}, faults[] = {
    FAULT_TRANSFORMS, FAULT_VELOCITIES, FAULT_ACCELERATIONS};
  message_header head;
  cdr_message of = begin_message(data, size, &head);
  message_content found = {0, FAULT_NONE, 0, 0, {0}};
  if (type != MESSAGE_COMBINED) {
    found.places[0] = pass_numbers(&of, type_numbers[type]);
    copy_numbers(&of, found.places[0], type_numbers[type], sizeof *numbers, numbers);
  } else {
    int64_t names = read_length(&of, 0), points;
    if (names > 1) {note_fault(&of, FAULT_NAMES, names);}
    for (int64_t n = 0; n < names && !of.fault; n++) {
      int64_t length = read_length(&of, 0);
      check_text(&of, of.at, length);
      of.at += length;
    }
    if ((points = read_length(&of, 0)) != 1) {note_fault(&of, FAULT_POINTS, points);}
    for (int n = 0; n < 3; n++) {
      int64_t count = read_length(&of, 0);
      if (count != 1) {note_fault(&of, faults[n], count);}
      found.places[n] = pass_numbers(&of, parts[n]);
      copy_numbers(&of, found.places[n], parts[n], sizeof *numbers, numbers);
      numbers += parts[n];
    }
    if (of.at + 8 > size) {note_fault(&of, FAULT_ENDS, 0);}  /* time_from_start, not used */
  }
  found.stamp = check_header(&of, &head);
  found.frame_size = head.frame_size ? head.frame_size - 1 : 0;
  found.fault = of.fault, found.number = of.number;
  return found;
}

void read_message(
  int64_t type, int64_t size, const uint8_t * data, message_content * content, double * numbers) {
  *content = read_content(type, data, size, numbers);
}

static int all_within(int64_t count, const double * numbers, double most) {
  int within = 1;
  for (int64_t n = 0; n < count; n++) {within &= fabs(numbers[n]) <= most;}
  return within;
}

/* Read a sample; return its event, EVENT_NONE if it is valid. */
static int64_t read_sample(
  input_topic * topic, int64_t size, const uint8_t * data, int64_t * stamp, double * values) {
  double raw[37], * numbers = raw;
  message_content content = read_content(topic->type, data, size, raw);
  int64_t count = type_numbers[topic->type], frame = content.frame_size;
  const uint8_t * name = data + 16;
  size_t compared = (size_t)(frame < FRAME_ROOM ? frame : FRAME_ROOM);
  *stamp = content.stamp;
  if (content.fault) {return EVENT_MALFORMED;}
  if (frame && topic->frame_size >= 0 &&
      (frame != topic->frame_size || memcmp(name, topic->frame, compared) != 0)) {
    return EVENT_WRONG_FRAME;
  }
  if (topic->type == MESSAGE_IMU) {
    if (raw[16] == -1.0 || raw[28] == -1.0) {return EVENT_NOT_MEASURED;}
    memmove(raw + 16, raw + 25, 3 * sizeof *raw);
    numbers = raw + 13, count = 6;
  }
  if (!all_finite(numbers, (size_t)count * sizeof *numbers)) {return EVENT_NOT_FINITE;}
  if (!all_within(count, numbers, topic->largest)) {return EVENT_OUT_OF_RANGE;}
  if (topic->type == MESSAGE_POSE || topic->type == MESSAGE_COMBINED) {
    if (stewart_rotation(raw + 3, values + 3) != STEWART_OK) {return EVENT_NOT_UNIT;}
    memcpy(values, raw, 3 * sizeof *raw);
    memcpy(values + 12, raw + 7, (size_t)(count - 7) * sizeof *raw);
  } else {
    memcpy(values, numbers, (size_t)count * sizeof *raw);
  }
  if (frame && topic->frame_size < 0) {
    topic->frame_size = frame;
    memcpy(topic->frame, name, compared);
  }
  return EVENT_NONE;
}

void read_samples(
  input_topic * topic, int64_t width, int64_t count, const uint8_t * data, const int64_t * starts,
  const int64_t * sizes, int64_t * stamps, double * values, int64_t * events) {
  for (int64_t k = 0; k < count; k++, values += width) {
    events[k] = read_sample(topic, sizes[k], data + starts[k], &stamps[k], values);
  }
}

static joint_state read_joint_state(
  int64_t n_joints, const uint8_t * names, const int64_t * ends, const uint8_t * wanted,
  int64_t size, const uint8_t * data, double * values) {
  message_header head;
  cdr_message of = begin_message(data, size, &head);
  joint_state found = {0};
  int64_t places[MOST_JOINTS], width = 0;
  found.stamp = check_header(&of, &head);
  found.counts[0] = read_length(&of, MOST_ENTRIES), found.names_at = of.at;
  for (int64_t j = 0; j < n_joints; j++) {places[j] = -1;}
  for (int64_t n = 0; n < found.counts[0] && !of.fault; n++) {
    int64_t length = read_length(&of, 0), begin = 0;
    check_text(&of, of.at, length);
    for (int64_t j = 0; j < n_joints && !of.fault; begin = ends[j++]) {
      if (places[j] < 0 && ends[j] - begin == (length ? length - 1 : 0) &&
          memcmp(data + of.at, names + begin, (size_t)(ends[j] - begin)) == 0) {
        places[j] = n, found.n_joints++;
        break;
      }
    }
    of.at += length;
  }
  int64_t numbers_at[3];
  for (int n = 0; n < 3; n++) {
    int64_t count = found.counts[1 + n] = read_length(&of, MOST_ENTRIES);
    numbers_at[n] = count ? pass_numbers(&of, count) : of.at;
    int lacks = wanted[n] && !count, uneven = wanted[n] && count != found.counts[0];
    found.lacking |= (int64_t)lacks << n, found.uneven |= (int64_t)uneven << n;
    width += wanted[n] ? n_joints : 0;
  }
  if (of.at > size) {note_fault(&of, FAULT_SHORTER, of.at);}
  found.fault = of.fault, found.number = of.number;
  int64_t missing = n_joints - found.n_joints;
  for (int64_t k = 0; k < width; k++) {values[k] = NAN;}
  found.state = found.fault ? JOINTS_MALFORMED :
    missing && (!found.n_joints || found.n_joints > missing) ? JOINTS_MISSING :
    found.lacking ? JOINTS_LACKING : found.uneven ? JOINTS_UNEVEN : JOINTS_VALID;
  for (int64_t n = 0; n < 3 && found.state <= JOINTS_NOT_FINITE; n++) {
    for (int64_t j = 0; j < n_joints && wanted[n]; j++) {
      if (places[j] >= 0) {
        copy_numbers(&of, numbers_at[n] + 8 * places[j], 1, sizeof *values, &values[j]);
        found.there |= INT64_C(1) << j;
        if (!isfinite(values[j])) {found.state = JOINTS_NOT_FINITE;}
      }
    }
    values += wanted[n] ? n_joints : 0;
  }
  return found;
}

void read_joint_states(
  int64_t n_joints, const uint8_t * names, const int64_t * ends, const uint8_t * wanted,
  int64_t width, int64_t count, const uint8_t * data, const int64_t * starts,
  const int64_t * sizes, joint_state * states, double * values) {
  for (int64_t k = 0; k < count; k++, values += width) {
    states[k] = read_joint_state(
      n_joints, names, ends, wanted, sizes[k], data + starts[k], values);
  }
}

/* ---- writing -------------------------------------------------------------------------------- */

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

/* What write_messages writes. */
typedef struct {
  const stewart_platform * servos;
  int64_t size;
  const uint8_t * message;
  int64_t n_stamps;
  const int64_t * stamp_places;
  int64_t n_parts;
  const message_part * parts;
  int64_t n_kinds;
  const message_condition * conditions;
} message_rows;

/* An output, and the pulse widths of servos, nan where there are none [s]. */
typedef struct { stewart_output output; double pulses[6]; } published_output;

static void write_rows(
  const message_rows * of, int64_t width, int64_t count, const int64_t * stamps,
  const double * rows, uint8_t * messages, uint8_t * having) {
  published_output published;
  for (int64_t k = 0; k < count; k++, messages += of->size, having += of->n_kinds) {
    const double * row = rows + k * width;
    if (of->servos) {
      memcpy(&published.output, row, sizeof published.output);
      for (int i = 0; i < 6; i++) {published.pulses[i] = NAN;}
      if (!isnan(commands_of(of->servos, &published.output)[0])) {
        stewart_servo_pulses(of->servos, positions_of(of->servos, &published.output.result),
                             published.pulses);
      }
      row = (const double *)&published;
    }
    memcpy(messages, of->message, (size_t)of->size);
    for (int64_t n = 0; n < of->n_stamps; n++) {
      put_stamp(stamps[k], messages + of->stamp_places[n]);
    }
    for (const message_part * part = of->parts; part < of->parts + of->n_parts; part++) {
      const double * from = row + part->column;
      if (part->count == 0) {
        messages[part->at] = *from > 0.0;
      } else {
        memcpy(messages + part->at, from, (size_t)part->count * sizeof(double));
      }
    }
    for (int64_t n = 0; n < of->n_kinds; n++) {
      having[n] = (uint8_t)meets(&of->conditions[n], row);
    }
  }
}

void write_messages(
  const stewart_platform * servos, int64_t size, const uint8_t * message, int64_t n_stamps,
  const int64_t * stamp_places, int64_t n_parts, const message_part * parts, int64_t n_kinds,
  const message_condition * conditions, int64_t width, int64_t count, const int64_t * stamps,
  const double * rows, uint8_t * messages, uint8_t * having) {
  message_rows of = {
    servos, size, message, n_stamps, stamp_places, n_parts, parts, n_kinds, conditions};
  write_rows(&of, width, count, stamps, rows, messages, having);
}
