# Copyright 2026 The stewart_dynamics developers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.


"""The input topics of a bag: given by name, under their usual names, or found by type."""

from __future__ import annotations

from collections.abc import Mapping

from stewart_dynamics.errors import BagError, StewartError
from stewart_dynamics.parameters import Parameters
from stewart_dynamics.replay.options import Options
from stewart_dynamics.replay.recording import Recording
from stewart_dynamics.runtime import input_topics as inputs

MEASURED = 'measured'
_MEASURED_TYPE = 'sensor_msgs/msg/JointState'
# At most so many of a kind are listed.
LISTED = 20


def find_topics(recording: Recording, parameters: Parameters, options: Options) -> dict[str, str]:
    """Return the name in the bag of each topic that is read."""
    wanted = inputs.SOURCES[parameters['setpoint.source']]
    for name in options.topics:
        if name != 'wrench' and f'setpoint/{name}' not in wanted:
            raise StewartError(f'--{name}: is not read where setpoint.source is '
                               f'{parameters["setpoint.source"]}')
    found = {key: _topic(recording, key, options) for key in wanted}
    wrench = options.topics.get('wrench')
    # A WrenchStamped found by its type could be anything: a load cell, an estimate.
    if wrench or f'{options.node}/{inputs.WRENCH}' in recording.topics:
        found[inputs.WRENCH] = _topic(recording, inputs.WRENCH, options)
    if options.measured:
        found[MEASURED] = _of_type(recording, options.measured, _MEASURED_TYPE)
    names = list(found.values())
    for name in names:
        if names.count(name) > 1:
            raise BagError(f'{recording.path}: {name}: selected as '
                           f'{" and ".join(key for key in found if found[key] == name)}')
    return found


def notices_of(recording: Recording, topics: Mapping[str, str], options: Options) -> list[str]:
    """Return notices about the choice of topics."""
    notices = [f'{key} is read from {name}, the only topic that matches'
               for key, name in topics.items()
               if key in inputs.INPUT_TYPES and name != f'{options.node}/{key}'
               and name not in options.topics.values()]
    loads = sorted(name for name, kind in recording.topics.items()
                   if kind == inputs.INPUT_TYPES[inputs.WRENCH] and name not in topics.values())
    if loads and inputs.WRENCH not in topics:
        notices.append(f'{", ".join(loads)}: not used as external wrench; --wrench selects one')
    return notices


def _topic(recording: Recording, key: str, options: Options) -> str:
    """Return a topic's name in the bag: as given, the usual one, or the only one that matches."""
    kind = inputs.INPUT_TYPES[key]
    usual = f'{options.node}/{key}'
    given = options.topics.get(key.rpartition('/')[2])
    if given or usual in recording.topics:
        return _of_type(recording, given or usual, kind)
    of_type = sorted(name for name, other in recording.topics.items() if other == kind)
    named = [name for name in of_type if name.endswith(f'/{key}')]
    for candidates in (named, of_type):
        if len(candidates) == 1:
            return candidates[0]
    option = f'--{key.rpartition("/")[2]}'
    if of_type:
        raise BagError(f'{recording.path}: has no topic {usual}, and several of its type, '
                       f'{kind}: {", ".join(of_type)}: select one by {option}')
    raise BagError(f'{recording.path}: has no topic {usual}, nor another of its type, {kind}; '
                   f'it contains {_held(recording)}{_advice(recording, key)}')


def _advice(recording: Recording, key: str) -> str:
    kinds = set(recording.topics.values())
    if key in (inputs.TWIST, inputs.ACCEL) and inputs.INPUT_TYPES[inputs.POSE] in kinds:
        return '; --differentiate computes twist and acceleration from the poses'
    if inputs.INPUT_TYPES[inputs.COMBINED] in kinds:
        return '; --combined reads setpoints in one message'
    return ''


def _of_type(recording: Recording, name: str, kind: str) -> str:
    if name not in recording.topics:
        raise BagError(f'{recording.path}: has no topic {name}; it contains {_held(recording)}')
    if recording.topics[name] != kind:
        raise BagError(f'{recording.path}: {name}: is a {recording.topics[name]}, must be a '
                       f'{kind}')
    return name


def _held(recording: Recording) -> str:
    held = ', '.join(f'{name} ({kind})' for name, kind in sorted(
        recording.topics.items())) or 'no topics'
    damage = listed(recording.damage)
    return held + (f'; could not be read: {"; ".join(damage)}' if damage else '')


def listed(what: list[str]) -> list[str]:
    """Return the first texts, and the number of the others."""
    if len(what) <= LISTED:
        return list(what)
    return [*what[:LISTED], f'and {len(what) - LISTED} more']
