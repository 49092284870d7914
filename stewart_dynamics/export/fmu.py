# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""A hexapod as a Functional Mock-up Unit (FMI 3.0 or 2.0), with its sources."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
import io
import math
import os
from pathlib import Path
import platform
import re
import shutil
import subprocess
import tempfile
from typing import NamedTuple
import uuid
from xml.etree import ElementTree as ET
import zipfile

import numpy as np

from stewart_dynamics import __version__
from stewart_dynamics.arrays import Array
from stewart_dynamics.core.binding import places
from stewart_dynamics.errors import StewartError
from stewart_dynamics.export.c_project import digest, hexadecimal, platform_source, source, SOURCES
from stewart_dynamics.legs.kind import LegKind
from stewart_dynamics.mechanics.frames.motion import motion_rows, Pose
from stewart_dynamics.mechanics.frames.rotation import to_quaternion
from stewart_dynamics.mechanics.kinematics.home_pose import homes
from stewart_dynamics.mechanics.rows import CONDITION
from stewart_dynamics.mechanics.singularity_warning import stop_condition_of
from stewart_dynamics.mechanics.stewart_platform import StewartPlatform
from stewart_dynamics.parameters.body import Body
from stewart_dynamics.parameters.table import INERTIA, Parameters, SUPPRESS_FORCES

# SI base units of each unit, by their exponents in FMI.
_UNITS = {'m': {'m': 1}, 'm/s': {'m': 1, 's': -1}, 'm/s2': {'m': 1, 's': -2}, 'm3': {'m': 3},
          'm3/s': {'m': 3, 's': -1}, 'rad': {'rad': 1}, 'rad/s': {'rad': 1, 's': -1},
          'rad/s2': {'rad': 1, 's': -2}, 'N': {'kg': 1, 'm': 1, 's': -2},
          'N.m': {'kg': 1, 'm': 2, 's': -2}, 'kg': {'kg': 1}, 'kg.m2': {'kg': 1, 'm': 2},
          's': {'s': 1}}
# Units in which tools show a unit: name, and its value for 1 of the unit.
_SHOWN = {'m': ('mm', 1e3), 'm/s': ('mm/s', 1e3), 'rad': ('deg', math.degrees(1.0)),
          'rad/s': ('deg/s', math.degrees(1.0)),
          'rad/s2': ('deg/s2', math.degrees(1.0))}
# Where an FMU has its binary: by version, system and processor.
_FOLDERS = {('3', 'Linux', 'x86_64'): 'x86_64-linux', ('3', 'Linux', 'aarch64'): 'aarch64-linux',
            ('3', 'Darwin', 'x86_64'): 'x86_64-darwin', ('3', 'Darwin', 'arm64'): 'aarch64-darwin',
            ('2', 'Linux', 'x86_64'): 'linux64', ('2', 'Darwin', 'x86_64'): 'darwin64'}
_COMPILERS = ('cc', 'gcc', 'clang')
_LEVERS = 110  # FMU_LEVERS of fmu.h
_NOISE = 1e-14  # parts of the largest coordinate of a pose: below it rounding errors
_KINDS_OF_2 = {'Float64': 'Real', 'Int32': 'Integer', 'Boolean': 'Boolean'}


class Variable(NamedTuple):
    """A variable of the FMU; its value reference is its place in the list, or is given."""

    name: str
    causality: str
    description: str
    unit: str = ''
    kind: str = 'Float64'  # type in FMI 3.0
    start: float | None = None  # None for outputs
    reference: int | None = None

    @property
    def variability(self) -> str:
        """Return when the value may change."""
        if self.causality == 'parameter':
            return 'tunable'
        return 'continuous' if self.kind == 'Float64' else 'discrete'

    @property
    def start_text(self) -> str:
        """Return the start value with all its digits."""
        return repr(self.start) if self.kind != 'Boolean' else 'true' if self.start else 'false'


def variables(parameters: Parameters) -> list[Variable]:
    """
    Return the variables in the order of ``fmu.h``; they start at rest at the home pose.

    Where the parameters do not give the height of the platform there, they start at a pose at
    which the forces can be solved. The last variables are those of the motors, with drives, and
    of the levers, where the drives turn.
    """
    position, quaternion = _start_pose(parameters)
    start = [*position, *quaternion, *np.zeros(18), *parameters.gravity,
             *np.zeros(9), *_numbers(parameters.payload.body), *_numbers(parameters.platform.body),
             parameters.singularity.warn_condition,
             parameters.singularity.stop_condition, parameters.singularity.warn_time,
             parameters.singularity.action == SUPPRESS_FORCES,
             parameters.limits.action == SUPPRESS_FORCES]
    given = [*_inputs(), *_tunable()]
    return [*(each._replace(start=float(value))
              for each, value in zip(given, start, strict=True)), *_outputs(parameters.leg_kind),
            *(_of_motors() if parameters.drives else ()),
            *(_of_levers() if has_levers(parameters.leg_kind) else ())]


def has_levers(kind: LegKind) -> bool:
    """Return whether results of a kind of legs have levers."""
    return bool(places('stewart_result')['levers'].stop <= kind.width)


def _start_pose(parameters: Parameters) -> tuple[Array, Array]:
    """Return position and quaternion of the first possible home pose that is not singular."""
    positions, rotations = homes(parameters)
    conditions = StewartPlatform(parameters).solve(
        motion_rows(Pose(positions, rotations)))[:, CONDITION]
    regular = conditions < stop_condition_of(parameters)
    at = int(np.argmax(regular))  # the first pose if all of them are singular
    return _without_noise(positions[at]), _without_noise(np.array(to_quaternion(rotations[at])))


def _without_noise(numbers: Array) -> Array:
    """Return numbers with zeros in place of rounding errors."""
    return np.where(np.abs(numbers) > _NOISE * np.abs(numbers).max(), numbers, 0.0)


def _inputs() -> Iterator[Variable]:
    for name, unit, axes, text in (
            ('position', 'm', 'xyz', "position of the platform's origin, base frame"),
            ('orientation', '', 'xyzw', 'unit quaternion that turns platform axes to base axes'),
            ('linear_velocity', 'm/s', 'xyz', "velocity of the platform's origin, base axes"),
            ('angular_velocity', 'rad/s', 'xyz', 'angular velocity of the platform, base axes'),
            ('linear_acceleration', 'm/s2', 'xyz', 'derivative of linear_velocity'),
            ('angular_acceleration', 'rad/s2', 'xyz', 'derivative of angular_velocity'),
            ('wrench.force', 'N', 'xyz', 'external force on the platform, base axes'),
            ('wrench.moment', 'N.m', 'xyz', "external moment about the platform's origin"),
            ('base.gravity', 'm/s2', 'xyz', 'acceleration of free fall, base axes'),
            ('base.linear_acceleration', 'm/s2', 'xyz', "of the base's origin, base axes"),
            ('base.angular_velocity', 'rad/s', 'xyz', 'of the base, base axes'),
            ('base.angular_acceleration', 'rad/s2', 'xyz', 'of the base, base axes')):
        for axis in axes:
            yield Variable(f'{name}.{axis}', 'input', text, unit)
    yield from _body('payload', 'input', 'of a payload on the platform; 0: none')


def _body(name: str, causality: str, text: str) -> Iterator[Variable]:
    """Yield the ten numbers of a body on the platform."""
    yield Variable(f'{name}.mass', causality, f'mass {text}', 'kg')
    for axis in 'xyz':
        yield Variable(f'{name}.center_of_mass.{axis}', causality,
                       'its center of mass, platform frame', 'm')
    for moment in INERTIA:
        yield Variable(f'{name}.inertia.{moment}', causality,
                       'its inertia about the center of mass, platform axes', 'kg.m2')


def _numbers(body: Body) -> list[float]:
    return [body.mass, *body.center.tolist(), *body.inertia.tolist()]


def _tunable() -> Iterator[Variable]:
    yield from _body('platform', 'parameter', 'of the empty platform')
    yield Variable('singularity.warn_condition', 'parameter', 'condition number of the warning')
    yield Variable('singularity.stop_condition', 'parameter',
                   'condition number at which singularity.suppress_forces begins')
    yield Variable('singularity.warn_time', 'parameter',
                   'warn when a crossing of det(J) = 0 is predicted sooner than this', 's')
    yield Variable('singularity.suppress_forces', 'parameter',
                   'forces are zero above stop_condition', '', 'Boolean')
    yield Variable('limits.suppress_forces', 'parameter',
                   'forces are zero while a limit is exceeded', '', 'Boolean')


def _of_legs(name: str, unit: str, text: str, kind: str = 'Float64') -> Iterator[Variable]:
    """Yield an output for each leg, whose number the text has."""
    for leg in range(1, 7):
        yield Variable(f'{name}[{leg}]', 'output', text.format(leg=leg), unit, kind)


def _outputs(kind: LegKind) -> Iterator[Variable]:
    position, rate, effort = kind.position, kind.rate, kind.effort
    positive = effort.positive.replace('+', 'positive')
    for name, unit, text in (
            (position.field, position.unit, f'{position.name} of leg {{leg}}'),
            (rate.field, rate.unit, f'rate of the {position.name} of leg {{leg}}'),
            (effort.field, effort.unit.replace(' ', '.'), f'{effort.name} to command to leg '
             f'{{leg}}, {positive}; zero unless status is 0'),
            ('joint_forces', 'N', 'force in rod and joints of leg {leg}, positive pushes; zero '
             'unless status is 0')):
        yield from _of_legs(name, unit, text)
    yield Variable('determinant', 'output', 'det(J), zero at a singularity', 'm3')
    yield Variable('determinant_rate', 'output', 'time derivative of determinant', 'm3/s')
    yield Variable('condition_number', 'output',
                   'of J_inv, moments divided by the characteristic length')
    yield Variable('warning', 'output', 'singularity warning', '', 'Boolean')
    yield from _of_legs('exceeded', '', 'limits that leg {leg} exceeds: bits STEWART_LENGTH_MIN, '
                        '... of stewart_dynamics.h', 'Int32')
    yield Variable('status', 'output', '0: forces are valid; else a code of stewart_dynamics.h',
                   '', 'Int32')
    yield Variable('time', 'independent', 'time of the last step', 's')


def _of_motors() -> Iterator[Variable]:
    yield from _of_legs('motor_speeds', 'rad/s', 'speed of the motor of leg {leg}')
    yield from _of_legs('motor_torques', 'N.m', 'torque of the motor of leg {leg} for the force '
                        'to command, not limited; zero unless status is 0')


def _of_levers() -> Iterator[Variable]:
    for n, each in enumerate(_of_legs(
            'levers', 'm', 'lever of leg {leg}: its torque by the force of its rod')):
        yield each._replace(reference=_LEVERS + n)


def flat_name(name: str) -> str:
    """Return the name of a variable with letters, digits and _ alone: ``lengths_1``."""
    return re.sub(r'\W', '_', name.rstrip(']'))


def fmu(parameters: Parameters, name: str, version: str = '3',
        compiler: list[str] | None = None, *, flat: bool = False) -> bytes:
    """
    Return the FMU as the bytes of its file, the same for the same parameters and compiler.

    name: its model identifier, a name in C.
    version: version of FMI, 3 or 2.
    compiler: words of the command of a C compiler, for the binary of this computer; None: no
        binary.
    flat: variables have flat names, ``lengths_1`` and ``position_x`` in place of ``lengths[1]``
        and ``position.x``.
    Raises StewartError: the compiler fails.
    """
    listed = variables(parameters)
    if flat:
        listed = [each._replace(name=flat_name(each.name)) for each in listed]
    token = f'{{{uuid.UUID(bytes=bytes.fromhex(digest(parameters))[:16])}}}'
    sources = {each: source(each)
               for each in (*SOURCES, 'fmu.h', 'fmu.c', f'fmi{version}.c')}
    sources['model.c'] = _model_source(parameters, listed, token)
    compiled = [each for each in sources if each.endswith('.c')]
    content: dict[str, str | bytes] = {
        'modelDescription.xml': _description(listed, name, token, version, compiled, flat)}
    content |= {f'sources/{each}': text for each, text in sources.items()}
    if version == '3':
        content['sources/buildDescription.xml'] = _build_description(name, compiled)
    if compiler is not None:
        path, binary = _binary(sources, name, version, compiler)
        content[path] = binary
    file = io.BytesIO()
    with zipfile.ZipFile(file, 'w', zipfile.ZIP_DEFLATED) as archive:
        for path, data in content.items():
            archive.writestr(zipfile.ZipInfo(path), data, zipfile.ZIP_DEFLATED)
    return file.getvalue()


def find_compiler() -> list[str] | None:
    """Return the words of the command in $CC, or of a C compiler on the PATH; None: not found."""
    for each in (os.environ.get('CC', ''), *_COMPILERS):
        words = each.split()
        if words and shutil.which(words[0]):
            return words
    return None


def has_binaries(version: str) -> bool:
    """Return whether FMUs of a version of FMI have a folder for binaries of this computer."""
    return (version, platform.system(), platform.machine()) in _FOLDERS


def _model_source(parameters: Parameters, listed: list[Variable], token: str) -> str:
    start = [each for each in listed if each.start is not None]
    return '\n'.join((
        f'/* A hexapod, written by stewart_export {__version__}.',
        f' * SHA-256 of its parameters: {digest(parameters)} */', '',
        '#include "fmu.h"', '', '#include <math.h>', '',
        'static ' + platform_source(parameters, 'hexapod'),
        'const stewart_platform * const fmu_platform = &hexapod;',
        f'const int fmu_with_levers = {int(has_levers(parameters.leg_kind))};', '',
        *(f'const double * fmu_{of}(const stewart_output * output) {{return output->{field};}}'
          for of, field in (('positions', f'result.{parameters.leg_kind.position.field}'),
                            ('rates', f'result.{parameters.leg_kind.rate.field}'),
                            ('efforts', parameters.leg_kind.commands))), '',
        'const double fmu_start[FMU_POSITIONS] = {',
        *(f'  {hexadecimal(each.start or 0.0)},  /* {each.name}: {each.start:.9g} */'
          for each in start), '};', '', f'const char * const fmu_token = "{token}";', ''))


def _binary(sources: Mapping[str, str], name: str, version: str, compiler: list[str],
            ) -> tuple[str, bytes]:
    """Return path and content of the shared library of this computer."""
    system = platform.system()
    where = _FOLDERS[version, system, platform.machine()]
    with tempfile.TemporaryDirectory() as folder:
        for each, text in sources.items():
            Path(folder, each).write_text(text)
        library = f'{name}.{"dylib" if system == "Darwin" else "so"}'
        # -ffp-contract=off: the bits of the node.
        command = [*compiler, '-std=c99', '-O2', '-ffp-contract=off', '-fPIC', '-shared',
                   '-fvisibility=hidden', '-o', library,
                   *(each for each in sources if each.endswith('.c')), '-lm']
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
        if done.returncode:
            messages = done.stderr.strip().splitlines() or [f'exit code {done.returncode}']
            raise StewartError(f'{" ".join(compiler)}: cannot compile the FMU: {messages[-1]}')
        return f'binaries/{where}/{library}', Path(folder, library).read_bytes()


def _description(listed: list[Variable], name: str, token: str, version: str,
                 compiled: list[str], flat: bool) -> str:
    """Return modelDescription.xml."""
    new = version == '3'
    root = ET.Element('fmiModelDescription', {
        'fmiVersion': f'{version}.0', 'modelName': name,
        'instantiationToken' if new else 'guid': token,
        'description': 'Leg lengths and forces of a Gough-Stewart platform',
        'license': 'Apache-2.0', 'generationTool': f'stewart_export {__version__}',
        'variableNamingConvention': 'flat' if flat else 'structured'})
    interface = ET.SubElement(root, 'CoSimulation', {
        'modelIdentifier': name, 'canHandleVariableCommunicationStepSize': 'true',
        'canGetAndSetFMUState' if new else 'canGetAndSetFMUstate': 'true'})
    if not new:
        sources = ET.SubElement(interface, 'SourceFiles')
        for file in compiled:
            ET.SubElement(sources, 'File', name=file)
    units = ET.SubElement(root, 'UnitDefinitions')
    used = {each.unit for each in listed}
    for unit, exponents in _UNITS.items():
        if unit not in used:
            continue
        group = ET.SubElement(units, 'Unit', name=unit)
        ET.SubElement(group, 'BaseUnit', {
            base: str(exponent) for base, exponent in exponents.items()})
        if unit in _SHOWN:
            shown, factor = _SHOWN[unit]
            ET.SubElement(group, 'DisplayUnit', name=shown, factor=repr(factor))
    ET.SubElement(root, 'DefaultExperiment', startTime='0', stepSize='0.001')
    model = ET.SubElement(root, 'ModelVariables')
    references = [n if each.reference is None else each.reference
                  for n, each in enumerate(listed)]
    for reference, each in zip(references, listed, strict=True):
        general = {'name': each.name, 'valueReference': str(reference),
                   'causality': each.causality, 'variability': each.variability,
                   'description': each.description}
        of_type = {'unit': each.unit} if each.unit else {}
        if each.unit in _SHOWN:
            of_type['displayUnit'] = _SHOWN[each.unit][0]
        if each.start is not None:
            of_type['start'] = each.start_text
        if new:
            ET.SubElement(model, each.kind, general | of_type)
        else:
            ET.SubElement(ET.SubElement(model, 'ScalarVariable', general),
                          _KINDS_OF_2[each.kind], of_type)
    structure = ET.SubElement(root, 'ModelStructure')
    for tag in ('Output', 'InitialUnknown'):
        group = structure if new else ET.SubElement(structure, f'{tag}s')
        for n, each in enumerate(listed):
            if each.causality == 'output' and new:
                ET.SubElement(group, tag, valueReference=str(references[n]))
            elif each.causality == 'output':
                ET.SubElement(group, 'Unknown', index=str(n + 1))
    return _text(root)


def _build_description(name: str, compiled: list[str]) -> str:
    root = ET.Element('fmiBuildDescription', fmiVersion='3.0')
    configuration = ET.SubElement(root, 'BuildConfiguration', modelIdentifier=name)
    group = ET.SubElement(configuration, 'SourceFileSet', language='C99')
    for each in compiled:
        ET.SubElement(group, 'SourceFile', name=each)
    return _text(root)


def _text(root: ET.Element) -> str:
    ET.indent(root, '  ')
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{ET.tostring(root, encoding="unicode")}\n'
