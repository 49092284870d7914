# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


"""The input topics of a bag: given by name, under their usual names, or found by type."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from stewart_dynamics.bags.recording import joined, Recording, topics_in
from stewart_dynamics.description.model import JOINT_STATES
from stewart_dynamics.errors import BagError, StewartError
from stewart_dynamics.external_wrench.measured_legs import MEASURED_LEGS
from stewart_dynamics.messages import type_names
from stewart_dynamics.parameters.table import Parameters
from stewart_dynamics.replay.replay_options import Options
from stewart_dynamics.response.recorded_response import MEASURED, MEASURED_POSE
from stewart_dynamics.setpoints import input_messages as inputs
from stewart_dynamics.setpoints.base_wrench_step import BASE_WRENCH
from stewart_dynamics.setpoints.output_messages import LEG_STATES, MOTOR_STATES

# JointState topics that the node publishes, under its name: computed, never measured legs.
_COMPUTED = LEG_STATES, MOTOR_STATES, JOINT_STATES
_OF_BASE = tuple(dict.fromkeys(key for keys in inputs.BASE_SOURCES.values() for key in keys))


def find_topics(recording: Recording, parameters: Parameters, options: Options) -> dict[str, str]:
    """Return the name in the bag of each topic that is read."""
    wanted = inputs.SOURCES[parameters.setpoint.source]
    of_base = inputs.BASE_SOURCES[parameters.base.source]
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
        found[key] = _named(recording, key, options) or recording.find_topic(
            inputs.INPUT_TYPES[key], None, f'{options.node}/{key}', _option(key),
            _others(key, options, named.values()), _advice(recording, key))
    for key in of_base:
        found[key] = named.get(key) or _base_by_type(
            recording, key, options, parameters.base.source, found)
    # A WrenchStamped found by its type could be anything: a load cell, an estimate.
    if load := _named(recording, inputs.WRENCH, options, ending=False):
        found[inputs.WRENCH] = load
    if options.measured_table is not None:
        return found
    if options.measured_pose:
        found[MEASURED_POSE] = recording.checked_topic(
            options.measured_pose, type_names.POSE_STAMPED)
    elif options.measured:
        found[MEASURED] = recording.checked_topic(options.measured, type_names.JOINT_STATE)
    elif options.response:
        found[MEASURED] = find_measured_legs(recording, options.node, None)
    names = list(found.values())
    for name in names:
        if names.count(name) > 1:
            raise BagError(f'{recording.path}: {name}: selected as '
                           f'{" and ".join(key for key in found if found[key] == name)}')
    return found


def find_measured_legs(recording: Recording, node: str, given: str | None, taken: str = '') -> str:
    """Return the topic of the measured legs; raise BagError if it is not found."""
    computed = _computed_by(node)
    own = [name for name in recording.topics_of(type_names.JOINT_STATE) if name in computed]
    advice = f'; {joined(own)}: computed by the node, not measured' if own else ''
    return recording.find_topic(type_names.JOINT_STATE, given, f'{node}/{MEASURED_LEGS}',
                                '--measured', {*computed, taken}, advice)


def find_calibrated_legs(recording: Recording, node: str, given: str | None) -> tuple[str, bool]:
    """
    Return the topic of the legs' positions, and whether they are commanded, not measured.

    Commanded ones are taken only if they are given, or the bag has no candidate for measured ones.
    """
    commanded, usual = f'{node}/{LEG_STATES}', f'{node}/{MEASURED_LEGS}'
    if (not given and usual not in recording.topics
            and commanded in recording.topics_of(type_names.JOINT_STATE)
            and not recording.topics_of(type_names.JOINT_STATE, _computed_by(node))):
        return commanded, True
    legs = find_measured_legs(recording, node, given)
    return legs, legs == commanded


def notices_of(recording: Recording, topics: Mapping[str, str], parameters: Parameters,
               options: Options) -> list[str]:
    """Return notices about the choice of topics."""
    notices = [f'{key} is read from {name}, the only topic that matches'
               for key, name in topics.items()
               if key in inputs.INPUT_TYPES and name != f'{options.node}/{key}'
               and name not in options.topics.values()]
    loads = recording.topics_of(inputs.INPUT_TYPES[inputs.WRENCH],
                                {*topics.values(), f'{options.node}/{BASE_WRENCH}'})
    if loads and inputs.WRENCH not in topics:
        notices.append(f'{joined(loads)}: not used as external wrench; --wrench selects one')
    base = sorted(
        name for name, kind in recording.topics.items() if name not in topics.values()
        and (name in [f'{options.node}/{key}' for key in _OF_BASE]
             or kind == inputs.INPUT_TYPES[inputs.BASE_IMU]
             or name.endswith(f'/{inputs.BASE_POSE}')))
    if base:
        notices.append(f'{joined(base)}: not used: base.source is {parameters.base.source}')
    legs = recording.topics_of(type_names.JOINT_STATE, {
        *topics_in(topics.get(MEASURED, '')), *_computed_by(options.node)})
    if legs and MEASURED not in topics:
        notices.append(f'{joined(legs)}: not used; --measured compares the efforts of measured '
                       'legs with the computed forces')
    return notices


def _computed_by(node: str) -> set[str]:
    """Return the JointState topics that a node publishes."""
    return {f'{node}/{name}' for name in _COMPUTED}


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
        return recording.checked_topic(given or usual, kind)
    found = [name for name in recording.topics_of(kind) if name.endswith(f'/{key}')]
    return found[0] if ending and len(found) == 1 else None


def _others(key: str, options: Options, taken: Iterable[str]) -> set[str]:
    """Return the names of topics that are other inputs than one, by use or by name."""
    return {*taken, *(f'{options.node}/{other}' for other in inputs.INPUT_TYPES if other != key)}


def _base_by_type(recording: Recording, key: str, options: Options, source: str,
                  found: Mapping[str, str]) -> str:
    """Return the same for a topic of the base, unless setpoints are of its type, too."""
    kind = inputs.INPUT_TYPES[key]
    candidates = recording.topics_of(kind, _others(key, options, found.values()))
    if len(candidates) == 1 and kind not in {inputs.INPUT_TYPES[each] for each in found
                                             if each not in _OF_BASE}:
        return candidates[0]
    text = (f'{recording.path}: base.source is {source}, and the bag has no topic '
            f'{options.node}/{key}')
    if candidates:
        raise BagError(f'{text}; of its type, {kind}, it has {joined(candidates)}: '
                       f'{_option(key)} selects one')
    raise BagError(f'{text}, nor another of its type, {kind}, that is no setpoint; it contains '
                   f'{recording.contents}')


def _advice(recording: Recording, key: str) -> str:
    kinds = set(recording.topics.values())
    if key in (inputs.TWIST, inputs.ACCEL) and inputs.INPUT_TYPES[inputs.POSE] in kinds:
        return '; --differentiate computes twist and acceleration from the poses'
    if inputs.INPUT_TYPES[inputs.COMBINED] in kinds:
        return '; --combined reads setpoints in one message'
    return ''
