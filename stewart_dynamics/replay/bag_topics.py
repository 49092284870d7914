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

from collections.abc import Container, Mapping

from stewart_dynamics.bags.recording import Recording
from stewart_dynamics.description.model import JOINT_STATES
from stewart_dynamics.errors import BagError, StewartError
from stewart_dynamics.messages import type_names
from stewart_dynamics.parameters.table import Parameters
from stewart_dynamics.replay.replay_options import Options
from stewart_dynamics.setpoints import inputs
from stewart_dynamics.setpoints.base_wrench import BASE_WRENCH

MEASURED = 'measured'
# Maximum number of listed texts of a kind.
LISTED = 20
_OF_BASE = tuple(dict.fromkeys(key for keys in inputs.BASE_SOURCES.values() for key in keys))


def find_topics(recording: Recording, parameters: Parameters, options: Options) -> dict[str, str]:
    """Return the name in the bag of each topic that is read."""
    wanted = inputs.SOURCES[parameters['setpoint.source']]
    of_base = inputs.BASE_SOURCES[parameters['base.source']]
    for key in inputs.INPUT_TYPES:
        if key not in (*wanted, *of_base, inputs.WRENCH) and name_of(key) in options.topics:
            source = 'base.source' if key in _OF_BASE else 'setpoint.source'
            raise StewartError(f'{_option(key)}: is not read where {source} is '
                               f'{parameters[source]}')
    # Setpoints and the base's motion may be of one type: a topic that is named as the base's is no
    # setpoint, and the base's is not found by its type then.
    named = {key: name for key in of_base if (name := _named(recording, key, options))}
    found = {}
    for key in wanted:
        found[key] = _named(recording, key, options) or _by_type(
            recording, key, options, {*named.values()})
    for key in of_base:
        found[key] = named.get(key) or _base_by_type(
            recording, key, options, parameters['base.source'], found)
    # A WrenchStamped found by its type could be anything: a load cell, an estimate.
    if load := _named(recording, inputs.WRENCH, options, ending=False):
        found[inputs.WRENCH] = load
    if options.measured:
        found[MEASURED] = _of_type(recording, options.measured, type_names.JOINT_STATE)
    names = list(found.values())
    for name in names:
        if names.count(name) > 1:
            raise BagError(f'{recording.path}: {name}: selected as '
                           f'{" and ".join(key for key in found if found[key] == name)}')
    return found


def notices_of(recording: Recording, topics: Mapping[str, str], parameters: Parameters,
               options: Options) -> list[str]:
    """Return notices about the choice of topics."""
    notices = [f'{key} is read from {name}, the only topic that matches'
               for key, name in topics.items()
               if key in inputs.INPUT_TYPES and name != f'{options.node}/{key}'
               and name not in options.topics.values()]
    loads = sorted(name for name, kind in recording.topics.items()
                   if kind == inputs.INPUT_TYPES[inputs.WRENCH] and name not in topics.values()
                   and name != f'{options.node}/{BASE_WRENCH}')
    if loads and inputs.WRENCH not in topics:
        notices.append(f'{_joined(loads)}: not used as external wrench; --wrench selects one')
    base = sorted(
        name for name, kind in recording.topics.items() if name not in topics.values()
        and (name in [f'{options.node}/{key}' for key in _OF_BASE]
             or kind == inputs.INPUT_TYPES[inputs.BASE_IMU]
             or name.endswith(f'/{inputs.BASE_POSE}')))
    if base:
        notices.append(f'{_joined(base)}: not used: base.source is {parameters["base.source"]}')
    legs = sorted(name for name, kind in recording.topics.items()
                  if kind == type_names.JOINT_STATE and name not in topics.values()
                  and name not in (f'{options.node}/leg_states', f'{options.node}/{JOINT_STATES}'))
    if legs and MEASURED not in topics:
        notices.append(f'{_joined(legs)}: not used; --measured compares the efforts of measured '
                       'legs with the computed forces')
    return notices


def name_of(key: str) -> str:
    """Return the name of an input in Options.topics: pose, base_pose."""
    return key.removeprefix('setpoint/').replace('/', '_')


def _option(key: str) -> str:
    return f'--{name_of(key).replace("_", "-")}'


def _named(recording: Recording, key: str, options: Options, ending: bool = True) -> str | None:
    """Return a topic's name in the bag: as given, the usual one, or the only one ending so."""
    kind = inputs.INPUT_TYPES[key]
    usual = f'{options.node}/{key}'
    given = options.topics.get(name_of(key))
    if given or usual in recording.topics:
        return _of_type(recording, given or usual, kind)
    found = [name for name, other in recording.topics.items()
             if other == kind and name.endswith(f'/{key}')] if ending else []
    return found[0] if len(found) == 1 else None


def _by_type(recording: Recording, key: str, options: Options, taken: Container[str]) -> str:
    """Return the only topic that has the type of an input and is not another input."""
    kind = inputs.INPUT_TYPES[key]
    usual = f'{options.node}/{key}'
    candidates = _candidates(recording, key, options, taken)
    if len(candidates) == 1:
        return candidates[0]
    if candidates:
        raise BagError(f'{recording.path}: has no topic {usual}, and several of its type, '
                       f'{kind}: {_joined(candidates)}: select one by {_option(key)}')
    raise BagError(f'{recording.path}: has no topic {usual}, nor another of its type, {kind}; '
                   f'it contains {_held(recording)}{_advice(recording, key)}')


def _base_by_type(recording: Recording, key: str, options: Options, source: str,
                  found: Mapping[str, str]) -> str:
    """Return the same for a topic of the base, unless setpoints are of its type, too."""
    kind = inputs.INPUT_TYPES[key]
    candidates = _candidates(recording, key, options, found.values())
    if len(candidates) == 1 and kind not in {inputs.INPUT_TYPES[each] for each in found
                                             if each not in _OF_BASE}:
        return candidates[0]
    text = (f'{recording.path}: base.source is {source}, and the bag has no topic '
            f'{options.node}/{key}')
    if candidates:
        raise BagError(f'{text}; of its type, {kind}, it has {_joined(candidates)}: '
                       f'{_option(key)} selects one')
    raise BagError(f'{text}, nor another of its type, {kind}, that is no setpoint; it contains '
                   f'{_held(recording)}')


def _candidates(recording: Recording, key: str, options: Options, taken: Container[str],
                ) -> list[str]:
    others = [f'{options.node}/{other}' for other in inputs.INPUT_TYPES if other != key]
    return sorted(name for name, kind in recording.topics.items()
                  if kind == inputs.INPUT_TYPES[key] and name not in taken and name not in others)


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
    held = _joined([f'{name} ({kind})' for name, kind in sorted(
        recording.topics.items())]) or 'no topics'
    damage = listed(recording.damage)
    return held + (f'; could not be read: {"; ".join(damage)}' if damage else '')


def _joined(names: list[str]) -> str:
    return ', '.join(listed(names))


def listed(texts: list[str]) -> list[str]:
    """Return the first texts, and the number of the others."""
    if len(texts) <= LISTED:
        return list(texts)
    return [*texts[:LISTED], f'and {len(texts) - LISTED} more']
