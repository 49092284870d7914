# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Kinds of legs: features that a kind lacks, and all that a further kind needs."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
import re
import shutil
import sys

from programs import run_program
import pytest
from referees import ROOT
from stewart_dynamics import Capability, ParameterError, Parameters, StewartPlatform
from stewart_dynamics.export.linuxcnc import hal_lines
from stewart_dynamics.legs import CRANK, require_kind, TELESCOPIC
from stewart_dynamics.program import BAD_INPUT

CONFIG = ROOT / 'config'
TELESCOPIC_FILE, CRANK_FILE = CONFIG / 'platform.yaml', CONFIG / 'crank_platform.yaml'
CRANKS = Parameters.from_yaml(CRANK_FILE)
NOT_FOR_CRANKS = 'legs.crank.length: {}: available for telescopic legs alone'

LINUXCNC = '--linuxcnc: genhexkins has lengths of legs'
# Arguments of each program, and the feature that hexapods with cranks lack.
PROGRAMS = {
    'stewart_export --fmu --linuxcnc': LINUXCNC, 'stewart_export --linuxcnc': LINUXCNC}


@pytest.mark.parametrize('command', PROGRAMS)
def test_a_program_that_does_not_know_a_kind_says_so_first(tmp_path: Path, command: str) -> None:
    program, *arguments = command.split()
    _, out, err = run_program(program, *arguments, '--params', CRANK_FILE, '--output',
                              tmp_path / 'results', code=BAD_INPUT, folder=tmp_path)
    assert out == ''
    assert err == f'{program}: {CRANK_FILE}: {NOT_FOR_CRANKS.format(PROGRAMS[command])}\n'
    assert not list(tmp_path.iterdir())


CALLS: dict[str, Callable[[StewartPlatform], object]] = {
    'clearance between legs': lambda platform: Capability(platform).clearance(
        platform.home_pose()),
    LINUXCNC: lambda platform: hal_lines(platform.parameters)}


@pytest.mark.parametrize('feature', CALLS)
def test_a_call_that_does_not_know_a_kind_raises_one_line(feature: str) -> None:
    with pytest.raises(ParameterError) as found:
        CALLS[feature](StewartPlatform(CRANKS))
    assert str(found.value) == f'{CRANK_FILE}: {NOT_FOR_CRANKS.format(feature.strip())}'


def test_a_feature_may_know_several_kinds() -> None:
    telescopic = Parameters.from_yaml(TELESCOPIC_FILE)
    for parameters in (telescopic, CRANKS):
        require_kind(parameters, 'a feature', TELESCOPIC, CRANK)
    require_kind(CRANKS, 'a feature', CRANK)
    with pytest.raises(ParameterError) as found:
        require_kind(CRANKS, 'a feature')
    assert str(found.value) == f'{CRANK_FILE}: {NOT_FOR_CRANKS.format("a feature")}'


# A third kind, as somebody would add it: a telescopic leg whose drive moves it by a pantograph.
# Its position is that of the leg times a ratio, its effort the push divided by it.

C_FILE = r"""/* A telescopic leg with a pantograph at its drive. */

#ifndef STEWART_LIBRARY

static leg_line pantograph_line(
  const stewart_leg * leg, const real position[3], const real r[9]) {
  leg_line at = telescopic_line(leg, position, r);
  at.lever = number(1.0 / leg->pantograph_ratio);
  return at;
}

static drive_motion pantograph_drive(const stewart_leg * leg, const stewart_motion * motion) {
  drive_motion drive = telescopic_drive(leg, motion);
  double ratio = leg->pantograph_ratio;
  drive.position = ratio * drive.position, drive.rate = ratio * drive.rate;
  drive.acceleration = ratio * drive.acceleration;
  return drive;
}

static void pantograph_move(
  const stewart_platform * platform, int i, const stewart_motion * motion,
  const moving_base * base, leg_motion * of) {
  const stewart_leg * leg = &platform->legs[i];
  drive_motion drive = pantograph_drive(leg, motion);
  telescopic_move(platform, i, motion, base, of);
  of->position = drive.position, of->rate = drive.rate;
  of->lever = number(1.0 / leg->pantograph_ratio);
  of->effort = move_actuator(leg, drive.rate, drive.acceleration);
}

static void pantograph_put(
  const stewart_platform * platform, int i, const leg_motion * of, real push,
  stewart_result * result) {
  telescopic_put(platform, i, of, push, result);
  result->forces[i] = of->lever * push + of->effort;
}

#ifndef STEWART_LANES

static void pantograph_drive_row(
  const stewart_leg * leg, const double position[3], const double r[9], double per_size,
  double row[6]) {
  telescopic_drive_row(leg, position, r, per_size, row);
  for (int n = 0; n < 6; n++) {row[n] *= leg->pantograph_ratio;}
}

static double pantograph_anchor(const stewart_leg * leg, double position, vector * anchor)
{return telescopic_anchor(leg, position / leg->pantograph_ratio, anchor);}

static double pantograph_straight(
  const stewart_leg * leg, const double position[3], const double r[9], vector x_rate,
  double rate, double acceleration) {
  double ratio = leg->pantograph_ratio;
  return telescopic_straight(leg, position, r, x_rate, rate / ratio, acceleration / ratio);
}

static int pantograph_given(const stewart_leg * leg) {return leg->pantograph_ratio > 0.0;}

#endif

#elif defined STEWART_GOVERNOR

/* Limits of the lengths. */
static stewart_leg pantograph_alone(const stewart_leg * leg) {
  stewart_leg alone = *leg;
  alone.length_min /= leg->pantograph_ratio, alone.length_max /= leg->pantograph_ratio;
  return alone;
}

static double pantograph_margins(double size, stewart_leg * leg) {
  stewart_leg alone = pantograph_alone(leg);
  double margin = telescopic_margins(size, &alone);
  leg->length_min = alone.length_min * leg->pantograph_ratio;
  leg->length_max = alone.length_max * leg->pantograph_ratio, leg->force_max = alone.force_max;
  return margin;
}

static unsigned pantograph_put_room(
  const stewart_leg * leg, double margin, const stewart_motion * motion, double length,
  double * room) {
  stewart_leg alone = pantograph_alone(leg);
  length = telescopic_line(leg, motion->position, motion->rotation).length;
  return telescopic_put_room(&alone, margin, motion, length, room);
}

/* At most: the length may be the position of the drive. */
static double pantograph_turn(
  const stewart_leg * leg, double margin, double length, double lever, double moved)
{return telescopic_turn(leg, margin, length / leg->pantograph_ratio, lever, moved);}

#else

static double pantograph_position(
  const stewart_leg * leg, const double position[3], const double r[9])
{return leg->pantograph_ratio * telescopic_position(leg, position, r);}

static measured_leg pantograph_measured(const stewart_leg * leg, const stewart_motion * motion) {
  measured_leg of = telescopic_measured(leg, motion);
  of.position *= leg->pantograph_ratio, of.rate *= leg->pantograph_ratio;
  return of;
}

static void pantograph_mass(
  const stewart_platform * platform, int i, const stewart_motion * motion, const leg_motion * of,
  leg_mass * to) {
  const stewart_leg * leg = &platform->legs[i];
  telescopic_mass(platform, i, motion, of, to);
  to->line = to->drive - leg->reflected_mass, to->drive = leg->reflected_mass;
  for (int n = 0; n < 6; n++) {to->row[n] *= leg->pantograph_ratio;}
}

static int pantograph_columns(
  const stewart_platform * platform, int i, const stewart_motion * motion,
  const absolute_motion * of, leg_columns * columns) {
  double ratio = platform->legs[i].pantograph_ratio;
  int count = telescopic_columns(platform, i, motion, of, columns);
  columns->lever = 1.0 / ratio, columns->rate *= ratio, columns->acceleration *= ratio;
  return count;
}

#endif

"""
PYTHON_FILE = """from stewart_dynamics.legs.telescopic import Telescopic


class Pantograph(Telescopic):
    name = 'pantograph'
    marker = 'actuator.pantograph_ratio'
    own = *Telescopic.own, 'actuator.pantograph_ratio'
    fields = {**Telescopic.fields, 'pantograph_ratio': 'actuator.pantograph_ratio'}


PANTOGRAPH = Pantograph()
"""
# Lines that are added to files of the package, each behind a line.
EDITS = {
    'core/stewart_dynamics.h': [
        ('  KIND(1, CRANK, crank, function, arguments)',
         ' \\\n  KIND(2, PANTOGRAPH, pantograph, function, arguments)'),
        ('/* where the published position is zero [m] */\n', '  double pantograph_ratio;\n')],
    'core/stewart_dynamics.c': [('#include "crank.h"\n', '#include "pantograph.h"\n')],
    'core/legs.c': [('#include "crank.h"\n', '#include "pantograph.h"\n')],
    'core/governor.c': [('#include "crank.h"\n', '#include "pantograph.h"\n')],
    'legs/__init__.py': [
        ('from stewart_dynamics.legs.kind import LegKind\n',
         'from stewart_dynamics.legs.pantograph import PANTOGRAPH\n'),
        ('(TELESCOPIC, CRANK', ', PANTOGRAPH')],
    'parameters/table.py': [(
        '    """Inertia and friction of the actuators, along the legs."""\n',
        "\n    pantograph_ratio: Array | None = _legs('ratio of a pantograph', '', (), "
        'minimum=0.0, above=True)')]}
PROGRAM = """
import sys

import numpy as np
from stewart_dynamics import (
    BaseMotion, GovernedStream, Motion, ParameterError, Parameters, StewartPlatform)
from stewart_dynamics.legs import KINDS
from stewart_dynamics.mechanics.dynamics.linear_parameters import linear_parameters
from stewart_dynamics.setpoints.step import Batch, Step

assert [kind.name for kind in KINDS] == ['telescopic', 'crank', 'pantograph']
straight = Parameters.from_yaml('config/platform.yaml').replaced({
    'actuator.viscous_friction': 0.0, 'actuator.coulomb_friction': 0.0,
    'actuator.reflected_mass': 0.0})
lengths = {name: 2.0 * straight[name] for name in (
    'limits.length_min', 'limits.length_max', 'limits.velocity_max')}
doubled = straight.replaced({'actuator.pantograph_ratio': 2.0, **lengths})
one, two = map(StewartPlatform, (straight, doubled))
assert two.structure['leg_kind'] == 2
random = np.random.default_rng(1)
home = one.home_pose()
assert np.array_equal(two.home_pose().position, home.position)
motion = Motion.from_euler(home.position + random.uniform(-0.1, 0.1, (50, 3)), *random.uniform(
    -0.3, 0.3, (5, 50, 3)))
wrench = random.uniform(-500.0, 500.0, (50, 6))
base = BaseMotion(random.uniform(-9.0, 9.0, (50, 3)), *random.uniform(-1.0, 1.0, (3, 50, 3)))


def near(found, expected):
    size = np.abs(expected).max()
    assert np.abs(found - expected).max() <= 1e-12 * size, np.abs(found - expected).max() / size


for each in (None, base):
    found, expected = (platform.inverse_dynamics(motion, wrench, each) for platform in (one, two))
    near(expected.forces, 0.5 * found.forces)
    near(expected.lengths, 2.0 * found.lengths)
    near(expected.rates, 2.0 * found.rates)
    near(expected.joint_forces, found.joint_forces)
    near(two.base_wrench(motion, wrench, each), one.base_wrench(motion, wrench, each))
    again = two.forward_dynamics(motion, expected.forces, wrench, each)
    near(again.linear_acceleration, motion.linear_acceleration)
    near(again.angular_acceleration, motion.angular_acceleration)
single = two.inverse_dynamics(motion[3], wrench[3], base[3])
assert np.array_equal(single.forces, expected.forces[3])
near(two.inverse_kinematics(motion), expected.lengths)
near(two.forward_kinematics(expected.lengths, motion).position, motion.position)
near(two.twist(motion, expected.rates)[:, :3], motion.linear_velocity)
with_rotor = StewartPlatform(doubled.replaced({
    'actuator.reflected_mass': 30.0, 'actuator.viscous_friction': 200.0}))
forces = with_rotor.inverse_dynamics(motion, None, base).forces
matrix = with_rotor.regressor(motion, base).matrix
near(matrix @ linear_parameters(with_rotor.parameters), forces)
rows = with_rotor.forward_dynamics(motion, forces, None, base).linear_acceleration
near(rows, motion.linear_acceleration)
# The step of node and replay: the limits are those of the drive.
outputs = Step(doubled.replaced({'limits.force_max': 100.0}))(Batch.from_parts(0, motion[0].rows))
assert np.abs(outputs.records['forces']).max() <= 100.0
# The governor keeps them, too.
stream = GovernedStream(doubled)
away = home.position + np.outer(np.arange(1000) > 100, [0.0, 0.0, 2.0])
governed = stream.advance(0.004 * np.arange(1000), Motion(away, [home.rotation] * 1000))
longest = two.inverse_kinematics(governed).max()
assert 0.985 * doubled.limits.length_max[0] < longest < doubled.limits.length_max[0], longest
assert stream.held['limits.length_max'] > 0.1
# Copies, files and wrong names.
doubled.to_yaml(sys.argv[1])
assert Parameters.from_yaml(sys.argv[1]) == doubled
for changes in ({'legs.rod.length': 1.0}, {'limits.torque_max': 1.0}):
    try:
        doubled.replaced(changes)
    except ParameterError as exc:
        assert 'must not be given with actuator.pantograph_ratio' in str(exc), exc
    else:
        raise AssertionError
"""


def with_pantographs(folder: Path) -> list[str]:
    """Write a copy of the package with the third kind; return the files that it adds or edits."""
    for name in ('stewart_dynamics', 'config'):
        shutil.copytree(ROOT / name, folder / name, ignore=shutil.ignore_patterns(
            '__pycache__', '*.so'))
    for name in ('setup.py', 'setup.cfg', 'pyproject.toml', 'README.md'):
        shutil.copy(ROOT / name, folder)
    package = folder / 'stewart_dynamics'
    for name, edits in EDITS.items():
        text = (package / name).read_text(encoding='utf-8')
        for behind, added in edits:
            assert text.count(behind) == 1, (name, behind)
            text = text.replace(behind, behind + added)
        (package / name).write_text(text, encoding='utf-8')
    # The functions of a kind that do not differ from those of telescopic legs.
    asked = {function for file in ('stewart_dynamics.c', 'legs.c', 'governor.c')
             for function in re.findall(
                 r'STEWART_LEG_KINDS\(\w+, (\w+), \(', (package / 'core' / file).read_text())}
    same = sorted(asked - set(re.findall(r'\bpantograph_(\w+)\(', C_FILE)))
    assert 'position' in asked and 'check' in same
    (package / 'core' / 'pantograph.h').write_text(C_FILE + ''.join(
        f'#define pantograph_{name} telescopic_{name}\n' for name in same))
    (package / 'legs' / 'pantograph.py').write_text(PYTHON_FILE)
    return ['core/pantograph.h', 'legs/pantograph.py', *EDITS]


@pytest.mark.slow
@pytest.mark.skipif(not any(map(shutil.which, ('cc', 'gcc'))), reason='needs a C compiler')
def test_a_kind_is_a_file_of_c_a_module_and_its_parameters(tmp_path: Path) -> None:
    """A third kind of legs: the library and the step compute with it, and no other file has it."""
    needed = with_pantographs(tmp_path)
    run_program(sys.executable, 'setup.py', '--quiet', 'build_ext', '--inplace', folder=tmp_path)
    run_program(sys.executable, '-c', PROGRAM, tmp_path / 'rig.yaml', folder=tmp_path)
    changed = [path.relative_to(tmp_path / 'stewart_dynamics').as_posix()
               for path in (tmp_path / 'stewart_dynamics').rglob('*.[hcp]*')
               if path.suffix in ('.c', '.h', '.py') and (
                   'pantograph' in path.read_text(encoding='utf-8').lower())]
    assert sorted(changed) == sorted(needed)
