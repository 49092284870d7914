/* SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * Messages of several topics joined by stamp: setpoints, with the load and the motion of the base
 * that are valid when they are complete.
 *
 * Stamps that are joined differ by at most the tolerance; samples wait for those of the other
 * topics. Samples without a stamp are joined in order of arrival. Between the stamps of two samples
 * of the base its motion is interpolated linearly; after the last one it is extrapolated along the
 * line through the last two, by at most the time between them. It is unknown if the newest sample
 * that is not newer than the setpoint is missing or older than the timeout.
 */

enum {
  OF_A_GROUP = 3, BASE_GROUP = 1, GROUPS = 2, WRENCH_TOPIC = 6, MOST_JOINED = 24,
  OF_BASE = 1000  /* samples that are kept, for setpoints that had to wait */
};

/* What has come of a topic without a stamp since the last setpoint. */
enum { NOTHING, UNUSABLE, USABLE };

/* A topic: its samples that wait, in order of arrival, each at a place of the values. */
typedef struct {
  int64_t width;  /* numbers of a sample */
  int64_t waiting, last;
  int64_t stamps[MOST_WAITING + 1], places[MOST_WAITING + 1];  /* places behind: free ones */
  int64_t without_stamp, unstamped;  /* the last message had no stamp; see above */
  double unstamped_values[MOST_JOINED];
  double values[MOST_WAITING + 1][MOST_JOINED];
} waiting_samples;

/* Topics that are joined. */
typedef struct {
  int64_t topics, width, tolerance, timeout, used;  /* used: the topics have a last stamp */
  int64_t noticed;                     /* that stamps are zero */
  int64_t first, arrived[OF_A_GROUP];  /* topics without stamps: first of a setpoint, or -1; order */
  int64_t n_arrived;
  waiting_samples inputs[OF_A_GROUP];
} topic_group;

/* Messages, and what they complete: see put_memory. */
typedef struct {
  const int64_t * topics, * times, * starts, * sizes;
  const uint8_t * data;
  int64_t * stamps, * places, * base_stamps;
  setpoint * setpoints;
  stewart_base * bases;
  double * base_values, * base_restarts;
  stewart_output * outputs;
  uint8_t * messages, * having;
  int64_t event_room;
  input_event * events;
  join_progress * progress;
} stream_memory;

typedef struct {
  topic_group groups[GROUPS];
  input_topic * topics;  /* those of the groups, and that of the load */
  double wrench[6];
  int64_t restarting, restart_timeout;
  int64_t source;
  double gravity[3];
  imu_mounting imu;
  imu_filter filter;
  int64_t newest, count, stamps[OF_BASE];  /* samples of the base: a ring */
  stewart_base bases[OF_BASE];
  const stewart_platform * platform;  /* that answers setpoints, from this state */
  stewart_state * state;
  message_rows answers;
  stream_memory at;
} input_stream;

/* What a call writes. */
typedef struct {
  input_event * events;
  int64_t * count;
  int64_t message;
} event_list;

static void note_event(event_list * list, int64_t kind, int64_t topic, int64_t stamp, int64_t last) {
  input_event event = {kind, topic, stamp, last, list->message};
  list->events[(*list->count)++] = event;
}

int64_t input_stream_size(void) {return (int64_t)sizeof(input_stream);}

void begin_stream(
  uint8_t * memory, input_topic * topics, const int64_t * widths, int64_t tolerance, int64_t timeout,
  int64_t base_timeout, int64_t source, const double * gravity, const imu_mounting * imu) {
  input_stream * stream = (input_stream *)memory;
  int64_t timeouts[GROUPS] = {timeout, base_timeout};
  for (int g = 0; g < GROUPS; g++) {
    topic_group * group = &stream->groups[g];
    group->tolerance = tolerance, group->timeout = timeouts[g], group->first = -1;
    for (int n = 0; n < OF_A_GROUP; n++) {
      int64_t width = widths[OF_A_GROUP * g + n];
      group->inputs[n].width = width, group->width += width, group->topics += width > 0;
      for (int64_t k = 0; k <= MOST_WAITING; k++) {group->inputs[n].places[k] = k;}
    }
  }
  stream->topics = topics, stream->restart_timeout = timeout, stream->source = source;
  memcpy(stream->gravity, gravity, sizeof stream->gravity);
  stream->imu = *imu;
}

void put_answers(
  uint8_t * memory, const stewart_platform * platform, stewart_state * state,
  const stewart_platform * servos, int64_t size, const uint8_t * message, int64_t n_stamps, const int64_t * stamp_places,
  int64_t n_parts, const message_part * parts, int64_t n_kinds,
  const message_condition * conditions) {
  input_stream * stream = (input_stream *)memory;
  message_rows rows = {
    servos, size, message, n_stamps, stamp_places, n_parts, parts, n_kinds, conditions};
  stream->platform = platform, stream->state = state, stream->answers = rows;
}

int64_t stamp_order(int64_t stamp, int64_t known, int64_t last, int64_t timeout) {
  if (!known || stamp > last) {return STAMP_FRESH;}
  return stamp == last ? STAMP_TWICE : stamp >= last - timeout ? STAMP_TOO_OLD : STAMP_RESTART;
}

static uint64_t distance(int64_t a, int64_t b) {
  return a > b ? (uint64_t)a - (uint64_t)b : (uint64_t)b - (uint64_t)a;
}

/* Return the place of a stamp in the order of waiting samples, -1: it does not wait. */
static int64_t find_stamp(const waiting_samples * input, int64_t stamp) {
  if (input->waiting && input->stamps[0] == stamp) {return 0;}
  int64_t n = input->waiting - 1;
  while (n >= 0 && input->stamps[n] != stamp) {n--;}
  return n;
}

/* Return the first of the nearest stamps. */
static int64_t find_nearest(const waiting_samples * input, int64_t stamp) {
  int64_t nearest = 0;
  for (int64_t n = 1; n < input->waiting; n++) {
    if (distance(input->stamps[n], stamp) < distance(input->stamps[nearest], stamp)) {nearest = n;}
  }
  return nearest;
}

static void remove_sample(waiting_samples * input, int64_t n) {
  int64_t place = input->places[n], behind = --input->waiting - n;
  memmove(&input->stamps[n], &input->stamps[n + 1], (size_t)behind * sizeof *input->stamps);
  memmove(&input->places[n], &input->places[n + 1], (size_t)behind * sizeof *input->places);
  input->places[input->waiting] = place;
}

static void drop_unstamped(topic_group * group, int64_t first_topic, event_list * list) {
  for (int64_t n = 0; n < group->n_arrived; n++) {
    int64_t topic = group->arrived[n];
    if (group->inputs[topic].unstamped == USABLE) {
      note_event(list, EVENT_UNSTAMPED_DROPPED, first_topic + topic, 0, 0);
    }
    group->inputs[topic].unstamped = NOTHING;
  }
  group->n_arrived = 0;
}

/* Drop all that waits. */
static void drop_waiting(topic_group * group, int64_t first_topic, int64_t kind, event_list * list) {
  for (int64_t topic = 0; topic < group->topics; topic++) {
    waiting_samples * input = &group->inputs[topic];
    for (int64_t n = 0; n < input->waiting; n++) {
      note_event(list, kind, first_topic + topic, input->stamps[n], 0);
    }
    input->waiting = 0;  /* all places are free, whatever their order */
  }
  drop_unstamped(group, first_topic, list);
}

void end_stream(uint8_t * memory, int64_t group, int64_t restart) {
  input_stream * stream = (input_stream *)memory;
  event_list list = {stream->at.events, &stream->at.progress->events, -1};
  drop_waiting(&stream->groups[group], OF_A_GROUP * group, EVENT_ENDED, &list);
  if (restart) {
    stream->groups[group].used = 0;
    if (group == BASE_GROUP) {stream->count = 0;} else {stream->restarting = 1;}
  }
}

/* Drop samples that can no longer be used after these stamps; return whether time jumped back. */
static int drop_passed(
  topic_group * group, int64_t first_topic, const int64_t * stamps, event_list * list) {
  int64_t before = group->inputs[0].last;
  int restart =
    stamp_order(stamps[0], group->used, before, group->timeout) == STAMP_RESTART;
  if (restart) {note_event(list, EVENT_RESTART, first_topic, stamps[0], before);}
  for (int64_t topic = 0; topic < group->topics; topic++) {
    waiting_samples * input = &group->inputs[topic];
    /* after a restart, samples from before it lie in the future */
    int64_t future = restart ? input->last - group->timeout : INT64_MAX;
    for (int64_t n = 0; n < input->waiting;) {
      int64_t other = input->stamps[n];
      if (other != stamps[topic] && (other < stamps[topic] || other > future)) {
        note_event(list, EVENT_NOT_JOINED, first_topic + topic, other, 0);
        remove_sample(input, n);
      } else {
        n++;
      }
    }
    input->last = stamps[topic];
  }
  group->used = 1;
  return restart;
}

/* A joined sample. */
typedef struct {
  int64_t stamp;
  double values[MOST_JOINED], restart, stamped;
} joined_sample;

/* Join a sample without a stamp, unusable if its message is rejected, in order of arrival. A joined
   sample begins with the same topic as the first one, and has one sample of each topic. If it is
   incomplete when the next one begins, all of it is dropped: otherwise one lost sample would shift
   all that follow. */
static int join_unstamped(
  topic_group * group, int64_t first_topic, int64_t topic, const double * values, int64_t clock,
  joined_sample * joined, event_list * list) {
  waiting_samples * input = &group->inputs[topic];
  if (!group->noticed) {
    group->noticed = 1;
    note_event(list, EVENT_NOTICE_UNSTAMPED, first_topic + topic, 0, 0);
  }
  if (input->unstamped != NOTHING || topic == group->first) {
    drop_unstamped(group, first_topic, list);
  }
  input->unstamped = values ? USABLE : UNUSABLE;
  if (values) {
    memcpy(input->unstamped_values, values, (size_t)input->width * sizeof *values);
  }
  group->arrived[group->n_arrived++] = topic;
  if (group->n_arrived < group->topics) {return 0;}
  for (int64_t n = 0; n < group->topics; n++) {
    if (group->inputs[n].unstamped == UNUSABLE) {
      drop_unstamped(group, first_topic, list);
      return 0;
    }
  }
  if (group->first < 0) {group->first = group->arrived[0];}
  int64_t stamps[OF_A_GROUP];
  double * to = joined->values;
  for (int64_t n = 0; n < group->topics; n++) {
    input = &group->inputs[n];
    input->unstamped = NOTHING, stamps[n] = clock;
    memcpy(to, input->unstamped_values, (size_t)input->width * sizeof *to);
    to += input->width;
  }
  group->n_arrived = 0;
  /* The clock takes their place: from and to samples with stamps, time may jump back. */
  joined->stamp = clock, joined->stamped = 0.0;
  joined->restart = drop_passed(group, first_topic, stamps, list);
  return 1;
}

/* Find the samples that belong to a stamp; return whether there is one of each topic. */
static int find_samples(const topic_group * group, int64_t stamp, int64_t * stamps) {
  int64_t at = stamp, low = INT64_MAX, high = INT64_MIN;
  for (int64_t topic = 0; topic < group->topics; topic++) {
    const waiting_samples * input = &group->inputs[topic];
    if (find_stamp(input, at) < 0) {
      if (!group->tolerance || !input->waiting) {return 0;}
      at = input->stamps[find_nearest(input, at)];
    }
    stamps[topic] = at;
    low = at < low ? at : low, high = at > high ? at : high;
    at = stamps[0];  /* the first topic defines the stamp */
  }
  return distance(high, low) <= (uint64_t)group->tolerance;
}

/* Take a sample of a topic; return whether it completes one of all topics. */
static int join_sample(
  topic_group * group, int64_t first_topic, int64_t topic, int64_t stamp, const double * values,
  int64_t clock, joined_sample * joined, event_list * list) {
  waiting_samples * input = &group->inputs[topic];
  if (!values) {  /* a rejected one without a stamp keeps its place in the order */
    if (input->without_stamp) {
      join_unstamped(group, first_topic, topic, NULL, clock, joined, list);
    }
    return 0;
  }
  if (stamp == 0) {
    input->without_stamp = 1;
    return join_unstamped(group, first_topic, topic, values, clock, joined, list);
  }
  if (input->without_stamp) {
    input->without_stamp = 0, group->first = -1;
    if (input->unstamped != NOTHING) {
      if (input->unstamped == USABLE) {
        note_event(list, EVENT_UNSTAMPED_DROPPED, first_topic + topic, 0, 0);
      }
      input->unstamped = NOTHING;
      int64_t left = 0;
      for (int64_t n = 0; n < group->n_arrived; n++) {
        if (group->arrived[n] != topic) {group->arrived[left++] = group->arrived[n];}
      }
      group->n_arrived = left;
    }
  }
  /* A sample that still waits is followed as the last used one is. */
  int waits = find_stamp(input, stamp) >= 0;
  int64_t order = waits ? STAMP_TWICE :
    stamp_order(stamp, group->used, input->last, group->timeout);
  if (order == STAMP_TWICE || order == STAMP_TOO_OLD) {
    note_event(list, order == STAMP_TWICE ? EVENT_TWICE : EVENT_TOO_OLD, first_topic + topic, stamp,
               input->last);
    return 0;
  }
  int64_t place = input->places[input->waiting];
  input->stamps[input->waiting++] = stamp;
  memcpy(input->values[place], values, (size_t)input->width * sizeof *values);
  if (input->waiting > MOST_WAITING) {
    note_event(list, EVENT_NOT_JOINED, first_topic + topic, input->stamps[0], 0);
    remove_sample(input, 0);
  }
  int64_t stamps[OF_A_GROUP];
  if (!find_samples(group, stamp, stamps)) {return 0;}
  joined->stamp = stamps[0], joined->stamped = 1.0;
  joined->restart = drop_passed(group, first_topic, stamps, list);
  double * to = joined->values;
  for (int64_t n = 0; n < group->topics; n++) {
    input = &group->inputs[n];
    int64_t at = find_stamp(input, stamps[n]);
    memcpy(to, input->values[input->places[at]], (size_t)input->width * sizeof *to);
    to += input->width;
    remove_sample(input, at);
  }
  return 1;
}

/* Add a sample of the base, and write its motion. */
static void add_base(input_stream * stream, const joined_sample * sample, stewart_base * base) {
  const double * v = sample->values;
  if (sample->restart != 0.0 ||
      (stream->count && sample->stamp <= stream->stamps[stream->newest])) {
    stream->count = 0;
  }
  if (stream->source == BASE_BY_IMU) {
    read_imu(&stream->imu, sample->stamp, v, &stream->filter, base);
  } else {
    vector zero = make(0.0, 0.0, 0.0);
    int moves = stream->source == BASE_MOVING;
    put3(base->gravity, rotate_back(v + 3, read3(stream->gravity)));
    put3(base->linear_acceleration, moves ? rotate_back(v + 3, read3(v + 18)) : zero);
    put3(base->angular_velocity, moves ? rotate_back(v + 3, read3(v + 15)) : zero);
    put3(base->angular_acceleration, moves ? rotate_back(v + 3, read3(v + 21)) : zero);
  }
  stream->newest = (stream->newest + 1) % OF_BASE;
  stream->count += stream->count < OF_BASE;
  stream->stamps[stream->newest] = sample->stamp, stream->bases[stream->newest] = *base;
}

/* Return a - b, or the largest number. */
static int64_t since(int64_t a, int64_t b) {
  int64_t found;
  return __builtin_sub_overflow(a, b, &found) ? (a < b ? INT64_MIN : INT64_MAX) : found;
}

static int64_t ring_place(const input_stream * stream, int64_t n) {
  return (stream->newest - stream->count + 1 + n + OF_BASE) % OF_BASE;
}

void base_at(const uint8_t * memory, int64_t stamp, stewart_base * base) {
  const input_stream * stream = (const input_stream *)memory;
  double * to = (double *)base;
  const int64_t numbers = NUMBERS(stewart_base);
  for (int64_t n = 0; n < numbers; n++) {to[n] = NAN;}
  int64_t n = stream->count - 1, timeout = stream->groups[BASE_GROUP].timeout;
  while (n > 0 && stream->stamps[ring_place(stream, n - 1)] > stamp) {n--;}
  if (n < 0) {return;}
  int64_t place = ring_place(stream, n), at = stream->stamps[place];
  if (since(stamp, at) > timeout || (n == 0 && at > stamp)) {return;}
  const double * now = (const double *)&stream->bases[place];
  if (n == 0) {
    memcpy(base, now, sizeof *base);
    return;
  }
  int64_t earlier = ring_place(stream, n - 1), before = stream->stamps[earlier];
  if (at > stamp && since(stamp, before) > timeout) {return;}
  const double * then = (const double *)&stream->bases[earlier];
  double part = least((double)since(stamp, at) / (double)since(at, before), 1.0);
  for (int64_t k = 0; k < numbers; k++) {to[k] = now[k] + (now[k] - then[k]) * part;}
}

int64_t last_base(const uint8_t * memory, int64_t * stamp, stewart_base * base) {
  const input_stream * stream = (const input_stream *)memory;
  if (stream->count) {
    *stamp = stream->stamps[stream->newest], *base = stream->bases[stream->newest];
  }
  return stream->count > 0;
}

void last_wrench(const uint8_t * memory, double * wrench) {
  memcpy(wrench, ((const input_stream *)memory)->wrench, 6 * sizeof *wrench);
}

/* Write a complete setpoint. */
static void put_setpoint(
  input_stream * stream, const joined_sample * sample, setpoint * to, event_list * list) {
  topic_group * base = &stream->groups[BASE_GROUP];
  int restart = sample->restart != 0.0 || stream->restarting;
  stream->restarting = 0;
  if (restart && stream->count &&
      since(stream->stamps[stream->newest], sample->stamp) > stream->restart_timeout) {
    stream->count = 0;  /* they are later */
    drop_waiting(base, OF_A_GROUP * BASE_GROUP, EVENT_BEFORE_RESTART, list);
    base->used = 0;
  }
  memcpy(&to->motion, sample->values, sizeof to->motion);
  memcpy(to->wrench, stream->wrench, sizeof to->wrench);
  base_at((const uint8_t *)stream, sample->stamp, &to->base);
  to->base_known = !base->topics || !isnan(to->base.gravity[0]);
  to->restart = restart, to->stamped = sample->stamped;
}

void put_memory(
  uint8_t * memory, const int64_t * topics, const int64_t * times, const int64_t * starts,
  const int64_t * sizes, const uint8_t * data, int64_t * stamps, setpoint * setpoints,
  int64_t * places, int64_t * base_stamps, stewart_base * bases, double * base_values,
  double * base_restarts, stewart_output * outputs, uint8_t * messages, uint8_t * having,
  int64_t event_room, input_event * events, join_progress * progress) {
  stream_memory at = {
    topics, times, starts, sizes, data, stamps, places, base_stamps, setpoints, bases, base_values,
    base_restarts, outputs, messages, having, event_room, events, progress};
  ((input_stream *)memory)->at = at;
}

void put_data(uint8_t * memory, const uint8_t * data) {((input_stream *)memory)->at.data = data;}

static void answer_from(input_stream * stream, int64_t n, int64_t end) {
  const stream_memory * at = &stream->at;
  const message_rows * rows = &stream->answers;
  step_setpoints(stream->platform, 0, end - n, at->stamps + n, at->setpoints + n, stream->state,
                 at->outputs + n);
  write_rows(rows, NUMBERS(stewart_output), end - n, at->stamps + n,
             (const double *)(at->outputs + n), at->messages + n * rows->size,
             at->having + n * rows->n_kinds);
}

void answer_setpoints(uint8_t * memory) {
  input_stream * stream = (input_stream *)memory;
  answer_from(stream, 0, stream->at.progress->setpoints);
}

void join_messages(uint8_t * memory) {
  input_stream * stream = (input_stream *)memory;
  const stream_memory * at = &stream->at;
  join_progress * progress = at->progress;
  event_list list = {at->events, &progress->events, 0};
  double values[MOST_JOINED];
  progress->status = JOIN_DONE;
  for (int64_t k = progress->next; k < progress->count; k++) {
    progress->next = k;
    int64_t topic = at->topics[k], stamp;
    if (topic < 0) {continue;}
    if (progress->events + 2 * OF_A_GROUP * (MOST_WAITING + 2) > at->event_room) {
      progress->status = JOIN_EVENTS;
      return;
    }
    list.message = k;
    int64_t event = read_sample(
      &stream->topics[topic], at->sizes[k], at->data + at->starts[k], &stamp, values);
    int valid = event == EVENT_NONE;
    if (!valid) {note_event(&list, event, topic, 0, 0);}
    if (topic == WRENCH_TOPIC) {
      if (valid) {memcpy(stream->wrench, values, sizeof stream->wrench);}
      continue;
    }
    if (valid && stamp == 0 && !progress->timed) {
      progress->status = JOIN_CLOCK;
      return;
    }
    int64_t first = topic / OF_A_GROUP * OF_A_GROUP;
    joined_sample joined;
    memset(joined.values, 0, sizeof joined.values);  /* without twist and acceleration: at rest */
    int complete = join_sample(&stream->groups[topic / OF_A_GROUP], first, topic - first, stamp,
                               valid ? values : NULL, at->times[k], &joined, &list);
    if (complete && first) {
      int64_t n = progress->bases++, width = stream->groups[BASE_GROUP].width;
      at->base_stamps[n] = joined.stamp, at->base_restarts[n] = joined.restart;
      memcpy(at->base_values + n * width, joined.values, (size_t)width * sizeof(double));
      add_base(stream, &joined, &at->bases[n]);
    } else if (complete) {
      int64_t n = progress->setpoints++;
      at->stamps[n] = joined.stamp, at->places[n] = k;
      put_setpoint(stream, &joined, &at->setpoints[n], &list);
      if (stream->platform && !progress->held) {answer_from(stream, n, n + 1);}
    }
  }
  progress->next = progress->count;
}
