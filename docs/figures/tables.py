# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Write the generated tables, security/policy.xml, the controller's parameters, the schema.

    python docs/figures/tables.py

Parameters and topics come from the tables of the code, measured figures from
benchmarks/results/, the errors in the loop from the files in docs/figures/. Each table is between
two comments of its page.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import groupby
import json
import math
from pathlib import Path
from types import UnionType
from typing import Annotated, Any, get_args, get_origin, Union

from msgspec import UnsetType
from msgspec.json import schema_components
from msgspec.structs import fields
from stewart_dynamics.calibration.calibration_record import CalibrationResult
from stewart_dynamics.cueing.cueing_parameters import CueingParameters
from stewart_dynamics.cueing.cueing_result import CueingResult
from stewart_dynamics.datasheet.datasheet_record import Datasheet
from stewart_dynamics.identification.identification_record import IdentificationResult
from stewart_dynamics.legs import CRANK, KINDS
from stewart_dynamics.legs.kind import LegKind
from stewart_dynamics.node.dynamics_node import BACKLOG
from stewart_dynamics.node.topics import PUBLISHED, SUBSCRIBED, Topic
from stewart_dynamics.parameters.circles import circle_names
from stewart_dynamics.parameters.parameter_set import Parameter, ParameterSet
from stewart_dynamics.parameters.structure import LEG_FIELDS, LISTS, PLATFORM_FIELDS
from stewart_dynamics.parameters.table import BY_IMU, FIXED, Parameters
from stewart_dynamics.questions.editor_schema import SCHEMA, schema_text
from stewart_dynamics.records import of_kind, Record
from stewart_dynamics.reference_motion.motion_parameters import ReferenceMotionParameters
from stewart_dynamics.replay.bag_summary import BagSummary
from stewart_dynamics.setpoints.consistency import (
    DELAY, DELAY_IN_SAMPLES, PERIOD, PERSISTENT, SHARE, SLOWEST, TICK, TOLERANCE, WEAKEST)
from stewart_dynamics.setpoints.input_stream import WAITING
from stewart_dynamics.simulator.simulator_parameters import SimulatorParameters
import yaml

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent.parent
SCHEMA_FILE = ROOT / 'config' / SCHEMA
# Schemas in config/ of the documents that programs write, and their records.
DOCUMENTS: dict[str, type[Record]] = {
    'summary.schema.json': BagSummary, 'cueing.schema.json': CueingResult,
    'identification.schema.json': IdentificationResult,
    'calibration.schema.json': CalibrationResult, 'datasheet.schema.json': Datasheet}
CONTROLLER_PARAMETERS = (ROOT / 'ros2_control' / 'stewart_dynamics_controller' / 'src'
                         / 'stewart_dynamics_controller_parameters.yaml')
HEAD = '| name | type | unit | default | meaning |\n| --- | --- | --- | --- | --- |\n'

# Parameters of the controller that the node does not have.
CONTROLLER = (
    Parameter('reference', 'string', 'reference interfaces: motion of the platform, or of the '
              'legs', '', 'legs', choices=('legs', 'platform')),
    Parameter('command_interfaces', 'string', 'interfaces of each joint that are commanded; '
              'position, effort, torque or torque_per_mille must be one of them',
              default=('effort',), sizes=tuple(range(1, 7)),
              choices=('position', 'velocity', 'effort', 'torque', 'torque_per_mille',
                       'motor_velocity')),
    Parameter('initial_pose', 'double', 'x y z alpha beta gamma near which the platform is when '
              'the controller starts; required where reference is legs', 'm, rad', (),
              sizes=(6,)),
    Parameter('governor', 'bool', 'hold what references of the platform demand within all limits, '
              'so that a stop always exists', default=False),
    Parameter('base.source', 'string', 'how the base moves: not at all, or as an IMU on it '
              'measures', '', FIXED, choices=(FIXED, BY_IMU)),
    Parameter('imu_sensor', 'string', 'sensor whose state interfaces angular_velocity.x .. and '
              'linear_acceleration.x .. are the readings where base.source is imu', '', ''))

PAYLOAD = {each: f'payload.{each}' for each in ('mass', 'center_of_mass', 'inertia')}
# Parameters of the node that the controller reads: those that the structure in C holds or follows
# from, and the IMU; not the pulses of servos, which hardware interfaces take.
CONTROLLER_NAMES = ('joints', 'base_frame', *(
    name for fields in (PLATFORM_FIELDS, PAYLOAD, LEG_FIELDS, *(
        kind.fields for kind in KINDS), LISTS)
    for name in fields.values()
    if name != 'setpoint.sync_tolerance' and not name.startswith('servo.')),
    *(name for name in Parameters.table if name.startswith(tuple(
        own for kind in KINDS for own in kind.own if own.endswith(('.', '_'))))
      and not name.startswith('servo.')), *circle_names('base'),
    *circle_names('platform'), 'geometry.platform_side',
    'drive.rated_torque', 'drive.screw_rotation', 'drive.screw_hand', 'singularity.action',
    'limits.action', 'base.source', 'base.timeout', 'base.imu.position', 'base.imu.orientation',
    'base.imu.cutoff')

# Keys of summary.json by the sections of its page.
_SUMMARY = {
    'the run': ('version', 'software', 'bag', 'run', 'complete', 'missing', 'notices', 'inputs',
                'rejected', 'quasi_static', 'limit_met', 'mistakes', 'parameters', 'fingerprint'),
    'the setpoints': ('setpoints',), 'the legs': ('legs',), 'the motors': ('motors',),
    'the response': ('response',), 'the limits': ('limits', 'limits_not_checked'),
    'the singularity': ('singularity',), 'the force breakdown': ('force_breakdown',),
    'the base wrench': ('base_wrench',), 'the uncertainty': ('uncertainty',),
    'the measured efforts': ('measured',)}

# Those that are set first; legs.* stands for the two parts of a leg.
FIRST = ('joints', 'geometry.base_joints', 'geometry.platform_joints', 'platform.mass',
         'platform.center_of_mass', 'platform.inertia', 'actuator.reflected_mass',
         'limits.force_max', 'singularity.action', 'setpoint.source')


def rows(names: Mapping[str, Parameter]) -> str:
    """Return the rows of these parameters in a Markdown table."""
    lines = []
    for parameter in names.values():
        rule = f'; {parameter.rule}' if parameter.rule else ''
        lines.append(f'| `{parameter.name}` | {parameter.ros_type} | {parameter.unit} | '
                     f'{_default(parameter)} | {parameter.text}{rule} |')
    return HEAD + '\n'.join(lines)


def parameters_of(kind: type[ParameterSet]) -> str:
    """Return the table of a program's parameters, without those of the hexapod if it adds some."""
    own = kind is Parameters
    return rows({name: parameter for name, parameter in kind.table.items()
                 if own or name not in Parameters.table
                 or kind not in (CueingParameters, SimulatorParameters)})


def topics(title: str, table: Sequence[Topic]) -> str:
    """Return a table of topics."""
    lines = [f'| {title} | type | meaning |', '| --- | --- | --- |']
    for topic in table:
        meaning = topic.meaning + (f'; with `{topic.parameter}`' if topic.parameter else '')
        lines.append(
            f'| `{topic.ros_name}` | {topic.kind.replace("/msg", "")} | {meaning} |')
    return '\n'.join(lines)


def queues() -> str:
    """Return the lengths of the node's queues."""
    return (f'At most {WAITING} samples of each topic wait for those of the other topics, and '
            f'{WAITING} messages\nin the middleware; at most {BACKLOG} setpoints wait for an '
            'answer.')


def consistent() -> str:
    """Return which differences of twists and accelerations are consistent."""
    seconds = 1e-9 * TICK * PERIOD
    return (f'A difference counts above {100.0 * TOLERANCE:g} % of the motion plus what jitter of '
            f'stamps,\nnoise and quantization, and a delay of {DELAY_IN_SAMPLES:g} samples or '
            f'{1e3 * DELAY:g} ms explain; the first three are estimated\nfrom the samples. A '
            f'quantity is reported after {PERSISTENT} periods of {PERIOD} windows in a row '
            f'({seconds:.1g} s each at 1 kHz,\n{PERIOD / 10.0:g} s at 10 Hz) in which at least '
            f'{100.0 * SHARE:g} % of the windows with motion differ. Nothing is judged at rest,\n'
            f"slower than {100.0 * SLOWEST:g} % of the platform's radius per second, below an "
            f'acceleration of {WEAKEST:g} m/s^2, and across\ngaps and restarts.')


def granted() -> str:
    """Return the node's topics in the words of a policy of SROS2."""
    lines = []
    for right, table in (('subscribe', SUBSCRIBED), ('publish', PUBLISHED)):
        for parameter, together in groupby(table, key=lambda topic: topic.parameter):
            if parameter:
                lines.append(f'          <!-- {parameter} -->')
            lines += [f'          <topics {right}="ALLOW">',
                      *(f'            <topic>{topic.ros_name}</topic>' for topic in together),
                      '          </topics>']
    return '\n'.join(lines)


def controller_parameters() -> str:
    """
    Return the declaration of the controller's parameters for generate_parameter_library.

    The hexapod's parameters are declared as in the node. An array of one value per leg has 1 or 6
    entries there, never a single value: the library knows one type for each parameter.
    """
    document: dict[str, Any] = {}
    own = {parameter.name: parameter for parameter in CONTROLLER}
    for name in dict.fromkeys((*CONTROLLER_NAMES, *own)):
        parameter = own.get(name) or Parameters.table[name]
        section = document
        *sections, last = name.split('.')
        for each in sections:
            section = section.setdefault(each, {})
        section[last] = _declaration(parameter)
    header = Path(__file__).read_text(encoding='utf-8').partition('"""')[0]
    return f'{header}# Written by docs/figures/tables.py (make docs).\n' + yaml.safe_dump(
        {'stewart_dynamics_controller': document}, sort_keys=False, width=99)


def _declaration(parameter: Parameter) -> dict[str, Any]:
    """Return the fields of a parameter in generate_parameter_library."""
    unit = f' [{parameter.unit}]' if parameter.unit else ''
    array = bool(parameter.sizes)
    fields: dict[str, Any] = {
        'type': parameter.kind + '_array' * array, 'description': f'{parameter.text}{unit}'}
    required = parameter.required and not parameter.instead
    if any(parameter.name in kind.defaults for kind in KINDS):
        fields['default_value'] = []  # by the kind of legs
    elif parameter.default is not None:
        fields['default_value'] = list(parameter.default) if array else parameter.default
    elif array and not required:
        fields['default_value'] = []  # not set: others are given in its place
    elif not required:
        fields['default_value'] = math.nan  # not set
    if not parameter.while_active:
        fields['read_only'] = True
    rules: dict[str, Any] = {}
    if len(parameter.sizes) == 1 and (required or parameter.default):
        rules['fixed_size<>'] = [parameter.sizes[0]]
    if parameter.choices:
        rules['subset_of<>' if array else 'one_of<>'] = [list(parameter.choices)]
    if parameter.minimum > -math.inf and (parameter.default is not None or required):
        rules['lower_element_bounds<>' if array else 'gt<>' if parameter.above else 'gt_eq<>'] = [
            parameter.minimum]
    if rules:
        fields['validation'] = rules
    return fields


def _default(parameter: Parameter) -> str:
    default = parameter.default
    if parameter.required:
        return 'required'
    if isinstance(default, tuple):
        if not default:
            return 'none'
        if len(default) == 6 and all(entry == default[0] for entry in default):
            default = default[:1]
        if parameter.name == 'joints':
            return '`leg_1` .. `leg_6`'
        return ', '.join(f'`{entry}`' if isinstance(entry, str) else f'{entry}'
                         for entry in default)
    if default is None:
        return 'see meaning' if 'by default' in parameter.text else 'none'
    return f'`{default}`' if isinstance(default, str) else f'{default}'.lower()


def loop(figures: Mapping[str, Any]) -> str:
    """Return the table of the errors that demo/loop.py measured: RMS and peak."""
    lines = ['| simulated hexapod | legs, PD only | legs, PD + forces | ratio | platform, PD only '
             '| platform, PD + forces | ratio |', '| --- | --- | --- | --- | --- | --- | --- |']
    runs = figures['runs']
    for pd, forward in zip(runs[::2], runs[1::2], strict=True):
        payload = pd['payload'] - 1.0
        line = f'| payload {100.0 * payload:+.0f} % |' if payload else '| as in the parameters |'
        for name in ('all legs', 'position'):
            for run in (pd, forward):
                line += f' {_digits(run["rms"][name])} ({_digits(run["peak"][name])}) |'
            line += f' 1/{pd["rms"][name] / forward["rms"][name]:.0f} |'
        lines.append(line)
    return '\n'.join(lines)


def ship(figures: Mapping[str, Any]) -> str:
    """Return the table of the errors that demo/ship.py measured: RMS and peak."""
    lines = ['| feed-forward, `base.source` of the node | legs, um | platform in the world, um | '
             'platform in the world, urad | ratio to `fixed` |', '| --- | --- | --- | --- | --- |']
    runs = {run['base.source']: run for run in figures['runs']}
    for source, run in runs.items():
        line = f'| `{source}` |' if source else '| PD only |'
        for name in ('all legs', 'position', 'rotation'):
            line += f' {_digits(run["rms"][name])} ({_digits(run["peak"][name])}) |'
        ratio = runs['fixed']['rms']['position'] / run['rms']['position']
        lines.append(f'{line} {f"1/{ratio:.0f}" if ratio > 1.0 else ""} |')
    return '\n'.join(lines)


def identified(figures: Mapping[str, Any]) -> str:
    """Return the table of the parameters that demo/identify.py identified."""
    lines = ['| parameter | unit | file before | identified, 95 % interval | true |',
             '| --- | --- | --- | --- | --- |']
    for each in figures['parameters']:
        half = each['half_width']
        digits = max(1 - math.floor(math.log10(half)), 0) if half > 0.0 else 4
        lines.append(f'| `{each["name"]}` | {each["unit"]} | {each["before"]:g} | '
                     f'{each["after"]:.{digits}f} +- {half:.{digits}f} | {each["true"]:g} |')
    return '\n'.join(lines)


def before_and_after(figures: Mapping[str, Any]) -> str:
    """Return the table of the errors that demo/identify.py measured: RMS and peak."""
    lines = ['| forces of the node | legs, um | platform, um | platform, urad | legs, to before |',
             '| --- | --- | --- | --- | --- |']
    labels = {'before': 'by the file before', 'after': 'by the identified file',
              'true parameters': 'by the true parameters'}
    first = figures['runs'][0]['rms']['all legs']
    for run in figures['runs']:
        line = f'| {labels[run["name"]]} |'
        for name in ('all legs', 'position', 'rotation'):
            line += f' {_digits(run["rms"][name])} ({_digits(run["peak"][name])}) |'
        ratio = first / run['rms']['all legs']
        lines.append(f'{line} {f"1/{ratio:.0f}" if ratio > 1.0 else ""} |')
    return '\n'.join(lines)


def _digits(number: float) -> str:
    """Return three digits of a number, or all before its point."""
    return f'{number:.0f}' if number >= 100.0 else f'{number:.3g}'


def measured(page: str, row: str, column: str) -> str:
    """Return a figure of benchmarks/results/: that of the first table with both row and column."""
    file = ROOT / 'benchmarks' / 'results' / f'{page}.md'
    head: list[str] = []
    for line in file.read_text(encoding='utf-8').splitlines():
        cells = [cell.strip() for cell in line.strip('|').split('|')] if line[:1] == '|' else []
        if not cells:
            head = []
        elif not head:
            head = cells
        elif cells[0] == row and column in head:
            return cells[head.index(column)]
    raise SystemExit(f'{file.name}: no table has row {row!r} and column {column!r}')


# A quantity, the words around its figures, their page, and row and column of each.
Measured = tuple[str, str, str, tuple[tuple[str, str], ...]]
_INVERSE, _FORWARD = (f'`StewartPlatform.{kind}_dynamics`, one `Motion`'
                      for kind in ('inverse', 'forward'))
_NODE = 'separate, `stewart_dynamics`'
SPEED: tuple[Measured, ...] = (
    ('`platform.inverse_dynamics(motion)` of one sample', '{} ns, {} times `rnea` of Pinocchio',
     'inverse_dynamics', ((_INVERSE, 'ns'), (_INVERSE, 'times `pin.rnea` alone'))),
    ('a sample of a batch, one core; two cores', '{} ns; {} ns', 'inverse_dynamics',
     (('`solve_many` in C, one core', 'ns'),
      ('`StewartPlatform.solve`: the default, all cores', 'ns'))),
    ('`platform.forward_dynamics(motion, forces)`', '{} ns, {} times `aba` of Pinocchio',
     'forward', ((_FORWARD, 'ns'), (_FORWARD, 'times `pin.aba` alone'))),
    ('`platform.forward_kinematics(lengths, guess)` from 20 % of the height away', '{} ns',
     'forward', (('`StewartPlatform.forward_kinematics` from afar, guess a `Pose`', 'ns'),)),
    ('exported C, `stewart_step`: median, slowest motion, worst with interrupts',
     '{} ns, {} ns, {} us', 'exported_source', tuple(
         ('`stewart_step`, gcc', column)
         for column in ('median (ns)', 'slowest motion (ns)', 'worst (us)'))),
    ('node at 1 kHz, from the last message of a setpoint to its answer: median, 99th percentile',
     '{} us, {} us; {} and {} times an rclpy node that takes and publishes the same messages and '
     'computes nothing', 'node',
     tuple((_NODE, column) for column in ('p50', 'p99', 'p50, times typed', 'p99, times typed'))),
    ('node at 1 kHz: share of a core; setpoints lost', '{}; {}', 'node',
     ((_NODE, 'of a core'), (_NODE, 'lost'))),
    ('trajectory of 10,000 points, from sending it to its answer: median', '{} ms',
     'planned_trajectories', (('alone', 'median'),)),
    ('a period of 1 ms of the simulator, one step', '{} us', 'simulator',
     (('`Plant.advance`, 1 step', 'us'),)),
    ('replay of 1,000,000 setpoints with all outputs',
     '{} s, {} times reading and deserializing the bag with rosbags', 'replay',
     (('`stewart_replay`', 's'), ('`stewart_replay`', 'times rosbags'))),
    ('start of the node; of a bare rclpy node', '{} s; {} s', 'starts',
     (('the node, until it is ready', 's'), ('a bare lifecycle node with the same topics', 's'))),
    ('`import stewart_dynamics`; with the first inverse dynamics', '{} s; {} s', 'starts',
     (('`import stewart_dynamics`', 's'), ('the first inverse dynamics of the library', 's'))),
    ('whole datasheet of `stewart_capability`: processor time; elapsed', '{} s', 'capability',
     (('whole datasheet with stiffness (s); elapsed', 'measured'),)),
)
MEMORY: tuple[Measured, ...] = (
    ('node at 1 kHz, after one minute and after ten', '{} MB, {} MB', 'node',
     (('1', 'memory (MB)'), ('10', 'memory (MB)'))),
    ('replay of 1,000,000 setpoints with all outputs; longer bags need no more', '{} MB', 'replay',
     (('`stewart_replay`', 'peak memory (MB)'),)),
    ('identification from one bag of ten minutes at 1 kHz, and from ten', '{} MB, {} MB',
     'identification', (('1', 'peak memory (MB)'), ('10', 'peak memory (MB)'))),
    ('code and constants of the exported source, gcc -O2; -Os', '{} bytes; {} bytes',
     'exported_source', (('gcc -O2', 'code (bytes)'), ('gcc -Os', 'code (bytes)'))),
)


def figures_of(results: Sequence[Measured]) -> str:
    """Return a table of measured figures, each with a link to the page of its table."""
    return '\n'.join(['| figure | value | table |', '| --- | --- | --- |', *(
        f'| {what} | {words.format(*(measured(page, *cell) for cell in cells))} | '
        f'[{page.replace("_", " ")}](results/{page}.md) |'
        for what, words, page, cells in results)])


def document_schema(record: type[Record]) -> str:
    """Return the JSON schema of a document, of hexapods with each kind of legs."""
    kinds, records = schema_components(
        list(dict.fromkeys(of_kind(record, kind) for kind in KINDS)),
        ref_template='#/$defs/{name}')
    return json.dumps({'anyOf': kinds, '$defs': records}, indent=1) + '\n'


def document_keys(record: type[Record], *names: str, kind: LegKind = KINDS[0]) -> str:
    """Return the table of keys of a document, with the keys in them; without names of all."""
    listed = {each.name: each for each in fields(of_kind(record, kind))}
    places: dict[type[Record], str] = {}
    return '\n'.join(['| key | type | meaning |', '| --- | --- | --- |', *(
        row for name in names or listed for row in _key_rows(name, listed[name].type, places))])


def _key_rows(key: str, kind: Any, places: dict[type[Record], str]) -> Iterator[str]:
    """
    Yield the row of a key, unless it has no meaning of its own, and those of the keys in it.

    places: where the keys of each record are listed; they are listed once.
    """
    meaning = ''
    if get_origin(kind) is Annotated:
        kind, meta = get_args(kind)
        meaning = meta.description
    inner, place, names = kind, key, iter(('NAME', 'SOURCE'))
    while get_origin(inner) in (dict, list) or {type(None), UnsetType} & {*get_args(inner)}:
        if get_origin(inner) is list:
            place += '[]'
        elif get_origin(inner) is dict:
            place += f'.{next(names)}'
        inner = get_args(inner)[-1 if get_origin(inner) is dict else 0]
    of_record = _is_record(inner)
    known = of_record and inner in places
    if meaning or known or not of_record:
        same = f', keys as in `{places[inner]}`' if known else ''
        yield f'| `{key}` | {_type_words(kind)}{same} | {meaning} |'
    if of_record:
        places.setdefault(inner, place)
    listed: set[str] = set()
    for each in fields(inner) if of_record and not known else ():
        # Keys with the same keys in them stand once, by the name of their record.
        together = _is_record(each.type) and sum(
            other.type is each.type for other in fields(inner)) > 1
        name = (each.type.__name__.removesuffix('Response').upper() if together
                else each.encode_name)
        if name not in listed:
            yield from _key_rows(f'{place}.{name}', each.type, places)
        listed.add(name)


def _is_record(kind: Any) -> bool:
    return isinstance(kind, type) and get_origin(kind) is None and issubclass(kind, Record)


def _type_words(kind: Any) -> str:
    """Return the type of a key in words."""
    origin, arguments = get_origin(kind), get_args(kind)
    if origin is Annotated:
        return _type_words(arguments[0])
    if origin in (Union, UnionType):
        of_value = [each for each in arguments if each not in (type(None), UnsetType)]
        return (_type_words(of_value[0]) if len(of_value) == 1 else 'value') + (
            ' or null' if len(of_value) == 1 and type(None) in arguments else '') + (
            ', may be missing' if UnsetType in arguments else '')
    if origin is dict:
        return f'name: {_type_words(arguments[1])}'
    if origin is list:
        words, *rest = _type_words(arguments[0]).split(' ')
        return ' '.join(['list of', words if words == 'text' else f'{words}s', *rest])
    return {bool: 'flag', int: 'integer', float: 'number', str: 'text', tuple: 'pair'}.get(
        origin or kind, 'group')


def pages() -> dict[Path, dict[str, str]]:
    """Return of each page with generated tables their names and texts."""
    figures, on_a_ship, known = (json.loads((HERE / f'{name}.json').read_text(encoding='utf-8'))
                                 for name in ('loop', 'ship', 'identify'))
    return {
        ROOT / 'benchmarks' / 'README.md': {
            'speed': figures_of(SPEED), 'memory': figures_of(MEMORY)},
        ROOT / 'docs' / 'node.md': {
            'subscribed topics': topics('subscribed', SUBSCRIBED),
            'published topics': topics('published', PUBLISHED)},
        ROOT / 'docs' / 'faults.md': {
            'queues': queues(), 'consistent twists and accelerations': consistent()},
        ROOT / 'security' / 'policy.xml': {'topics of stewart_dynamics': granted()},
        ROOT / 'docs' / 'parameters.md': {
            'first parameters': rows({name: Parameters.table[name] for name in FIRST}),
            'parameters of stewart_dynamics': parameters_of(Parameters),
            'parameters of stewart_trajectory': parameters_of(ReferenceMotionParameters),
            'parameters of stewart_simulator': parameters_of(SimulatorParameters),
            'parameters of stewart_cueing': parameters_of(CueingParameters)},
        ROOT / 'docs' / 'motion_cueing.md': {
            'parameters of motion cueing': rows({
                name: parameter for name, parameter in Parameters.table.items()
                if name.startswith('cueing.')}),
            'keys of cueing.json': document_keys(CueingResult)},
        ROOT / 'docs' / 'identification.md': {
            'keys of identification.json': document_keys(IdentificationResult)},
        ROOT / 'docs' / 'calibration.md': {
            'keys of calibration.json': document_keys(CalibrationResult)},
        ROOT / 'docs' / 'capability.md': {
            'keys of datasheet.json': document_keys(Datasheet, kind=CRANK)},
        ROOT / 'docs' / 'cranks.md': {
            'parameters of cranks': rows({
                name: parameter for name, parameter in Parameters.table.items()
                if name.startswith(CRANK.own)})},
        ROOT / 'docs' / 'summary.md': {
            f'keys of {group}': document_keys(BagSummary, *names)
            for group, names in _SUMMARY.items()},
        ROOT / 'docs' / 'simulator.md': {
            'errors in the loop': loop(figures), 'errors on a ship': ship(on_a_ship)},
        ROOT / 'docs' / 'identify_from_bags.md': {
            'identified on the simulator': identified(known),
            'errors before and after': before_and_after(known)}}


def generated(text: str, tables: Mapping[str, str]) -> str:
    """Return a page with its tables replaced; they are between the comments of their names."""
    for name, table in tables.items():
        begin, end = f'<!-- {name} -->\n', f'<!-- end of {name} -->'
        before, found, rest = text.partition(begin)
        _, closed, after = rest.partition(end)
        if not found or not closed:
            raise SystemExit(f'comment missing: {begin.strip()} or {end}')
        # Behind the comment an empty line: Markdown sees a table only then.
        text = f'{before}{begin}\n{table}\n\n{end}{after}'
    return text


def main() -> None:
    """Write all tables."""
    for page, tables in pages().items():
        page.write_text(generated(page.read_text(encoding='utf-8'), tables), encoding='utf-8')
        print(f'{page.relative_to(ROOT)}: {", ".join(tables)}')
    CONTROLLER_PARAMETERS.write_text(controller_parameters(), encoding='utf-8')
    SCHEMA_FILE.write_text(schema_text(), encoding='utf-8')
    for name, record in DOCUMENTS.items():
        (ROOT / 'config' / name).write_text(document_schema(record), encoding='utf-8')
    for path in (CONTROLLER_PARAMETERS, SCHEMA_FILE,
                 *(ROOT / 'config' / name for name in DOCUMENTS)):
        print(path.relative_to(ROOT))


if __name__ == '__main__':
    main()
