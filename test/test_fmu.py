# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The FMU: valid for FMPy, the bits of the step, figure 18, inputs that are not valid."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import closing
import importlib.util
import math
from pathlib import Path
import re
import shutil
import subprocess
from typing import Any
import zipfile

import numpy as np
from programs import call
import pytest
from referees import random_base_motion, random_motion, random_wrench, rng
from rosbags.highlevel import AnyReader
from snapshot import Snapshot
from stewart_dynamics import (
    InverseDynamics, Motion, ParameterError, Parameters, StewartPlatform)
from stewart_dynamics.bags.recording import Recording
from stewart_dynamics.core.binding import places
from stewart_dynamics.export import main
from stewart_dynamics.export.fmu import find_compiler, fmu, variables
from stewart_dynamics.export.golden_vectors import golden_vectors
from stewart_dynamics.mechanics.frames.rotation import (
    from_quaternion, quaternion_length, to_quaternion)
from stewart_dynamics.setpoints.joining import Setpoints
from stewart_dynamics.setpoints.step import Batch, Step

fmpy = pytest.importorskip('fmpy', reason='needs fmpy (requirements-fmi.txt)')
validate_fmu = pytest.importorskip('fmpy.validation').validate_fmu
COMPILER = find_compiler()
pytestmark = pytest.mark.skipif(COMPILER is None, reason='needs a C compiler')

ROOT = Path(__file__).resolve().parent.parent
PARAMETERS = Parameters.from_yaml(ROOT / 'config' / 'platform.yaml')
VARIABLES = variables(PARAMETERS)
REFERENCES = {each.name: n for n, each in enumerate(VARIABLES)}
FORCES = [REFERENCES[f'forces[{leg}]'] for leg in range(1, 7)]
JOINT_FORCES = [REFERENCES[f'joint_forces[{leg}]'] for leg in range(1, 7)]
LENGTHS = [REFERENCES[f'lengths[{leg}]'] for leg in range(1, 7)]
STATUS = [REFERENCES['status']]
HOME = [each.start for each in VARIABLES[:47]]
NOT_FINITE, NOT_UNIT, OUT_OF_RANGE, SINGULAR, SUPPRESSED, BROKEN_RULE = 2, 4, 5, 6, 7, 10
UNREACHABLE = 11


class Unit:
    """One instance of an FMU, driven without FMPy's interpolation of inputs."""

    def __init__(self, path: Path, version: str, folder: Path, token: str | None = None) -> None:
        self._is_3 = version == '3'
        described = fmpy.read_model_description(path)
        self.said: list[str] = []
        kind = fmpy.fmi3.FMU3Slave if self._is_3 else fmpy.fmi2.FMU2Slave
        self.fmu = kind(guid=token or described.guid, unzipDirectory=fmpy.extract(path, folder),
                        modelIdentifier=described.coSimulation.modelIdentifier,
                        instanceName='one')
        self.fmu.instantiate()
        self.time = 0.0
        if not self._is_3:
            self.fmu.setupExperiment()
        self.fmu.enterInitializationMode()

    def put(self, first: int, values: Sequence[float]) -> None:
        """Set variables that follow each other."""
        references = list(range(first, first + len(values)))
        (self.fmu.setFloat64 if self._is_3 else self.fmu.setReal)(
            references, [float(each) for each in values])

    def put_flag(self, name: str, value: bool) -> None:
        """Set a variable of type Boolean."""
        self.fmu.setBoolean([REFERENCES[name]], [value])

    def get(self, references: list[int]) -> list[float]:
        """Return variables of type Float64."""
        return list((self.fmu.getFloat64 if self._is_3 else self.fmu.getReal)(references))

    @property
    def status(self) -> int:
        """Return the code of the last step."""
        return int((self.fmu.getInt32 if self._is_3 else self.fmu.getInteger)(STATUS)[0])

    @property
    def warning(self) -> bool:
        """Return whether the singularity warning is on."""
        return bool(self.fmu.getBoolean([REFERENCES['warning']])[0])

    def step(self, size: float = 0.001) -> list[float]:
        """Return the forces of the inputs that were set."""
        self.fmu.doStep(currentCommunicationPoint=self.time, communicationStepSize=size)
        self.time += size
        return self.get(FORCES)

    def close(self) -> None:
        """End the instance."""
        self.fmu.terminate()
        self.fmu.freeInstance()


@pytest.fixture(scope='module', params=['3', '2'])
def version(request: pytest.FixtureRequest) -> str:
    """Return a version of FMI."""
    return str(request.param)


@pytest.fixture(scope='module')
def path(version: str, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the FMU of config/platform.yaml."""
    path = tmp_path_factory.mktemp('fmu') / f'hexapod{version}.fmu'
    path.write_bytes(fmu(PARAMETERS, 'hexapod', version, COMPILER))
    return path


@pytest.fixture
def unit(path: Path, version: str, tmp_path: Path) -> Iterator[Unit]:
    """Return an instance in its initialization mode."""
    unit = Unit(path, version, tmp_path)
    yield unit
    unit.close()


def at_home(parameters: Parameters) -> InverseDynamics:
    """Return the inverse dynamics at rest at the home pose."""
    platform = StewartPlatform(parameters)
    home = platform.home_pose()
    return platform.inverse_dynamics(Motion(home.position, home.rotation))


def test_valid_and_at_home_without_inputs(path: Path) -> None:
    """No problem for FMPy; without inputs the FMU simulates the home pose at rest."""
    assert not validate_fmu(str(path))
    done = fmpy.simulate_fmu(str(path), stop_time=0.01, output_interval=0.001)
    home = at_home(PARAMETERS)
    assert len(done) == 11
    for leg in range(6):
        assert set(done[f'forces[{leg + 1}]']) == {home.forces[leg]}
        assert set(done[f'lengths[{leg + 1}]']) == {home.lengths[leg]}
    assert set(done['status']) == {0}


def test_figure_18(unit: Unit) -> None:
    """The paper's motion through a singularity: figure 18 with the bits of the node."""
    bag = ROOT / 'bags' / 'singular'
    setpoints = Setpoints(PARAMETERS, lambda rejection, details: None, print)
    with closing(Recording(bag)) as recording:
        parts = [setpoints.join_messages(messages) for messages, _ in recording.messages(
            {f'/stewart_dynamics/{topic}': topic for topic in setpoints.topics})]
    expected = Step(PARAMETERS)(Batch.joined(parts))
    unit.fmu.exitInitializationMode()
    rows = _recorded_inputs(bag)
    for n, row in enumerate(rows):
        unit.put(0, row)
        assert unit.step(0.01) == expected.efforts[n].tolist(), n
        assert unit.get(LENGTHS) == expected.drive_positions[n].tolist()
        assert unit.get(JOINT_FORCES) == expected.joint_forces[n].tolist()
        assert unit.warning == expected.warnings[n]
    assert len(rows) == len(expected.stamps) == 1001
    assert np.sign(expected.determinants).min() < 0.0 < expected.determinants.max()


def test_random_motions_on_a_moving_base(unit: Unit) -> None:
    """Random motions, wrenches and motions of the base: the bits of the library."""
    random, platform = rng(), StewartPlatform(PARAMETERS)
    motions = random_motion(PARAMETERS, random, 200).rows
    wrenches = random_wrench(PARAMETERS, random, 200)
    bases = random_base_motion(PARAMETERS, random, 200).rows
    unit.fmu.exitInitializationMode()
    for motion, wrench, base in zip(motions, wrenches, bases, strict=True):
        quaternion = to_quaternion(motion[3:12].reshape(3, 3)).tolist()
        unit.put(0, [*motion[:3], *quaternion, *motion[12:], *wrench, *base])
        forces = unit.step()
        length = quaternion_length(*quaternion)
        motion[3:12] = from_quaternion(*(each / length for each in quaternion))
        result = platform.solve(motion[None], wrench[None], base[None])[0]
        assert unit.get(LENGTHS) == result[:6].tolist()
        most = PARAMETERS['limits.force_max']
        assert forces == np.clip(result[12:18], -most, most).tolist()
        assert unit.status == 0


BAD: list[tuple[int, list[float], int]] = [
    (0, [math.nan], NOT_FINITE), (7, [math.inf], NOT_FINITE), (19, [math.nan], NOT_FINITE),
    (25, [math.nan], NOT_FINITE), (3, [0.0, 0.0, 0.0, 1.002], NOT_UNIT),
    (3, [0.0, 0.0, 0.0, 0.0], NOT_UNIT), (0, [1e200], OUT_OF_RANGE), (37, [-1.0], BROKEN_RULE),
    (37, [math.nan], NOT_FINITE), (47, [-1.0], BROKEN_RULE), (47, [math.nan], BROKEN_RULE),
    (51, [0.0], BROKEN_RULE), (57, [0.5], BROKEN_RULE),
    (58, [2.0], BROKEN_RULE), (2, [0.0], SINGULAR)]


def test_bad_input(unit: Unit) -> None:
    """Forces are zero and the status says why; the next valid input is answered."""
    start = [each.start for each in VARIABLES[:60]]
    unit.fmu.exitInitializationMode()
    good = unit.step()
    for first, values, status in BAD:
        unit.put(first, values)
        assert unit.step() == [0.0] * 6
        assert unit.status == status
        assert np.isfinite(unit.get([*LENGTHS, *FORCES])).all()
        unit.put(0, start)
        assert unit.step() == good
        assert unit.status == 0


def _inertias() -> list[list[float]]:
    """Return random inertias, every other with a negative principal moment, and special ones."""
    random, found = rng(), []
    for n in range(60):
        moments = random.uniform(0.1, 20.0, 3)
        moments[n % 3] *= (1.0, -1.0, 1e-3, -1e-3)[n % 4]
        turn = np.linalg.qr(random.normal(size=(3, 3)))[0]
        whole = turn @ np.diag(moments) @ turn.T
        found.append(whole[np.triu_indices(3)].tolist())
    return [*found, [1.0, 0.0, 0.0, -1.0, 0.0, -1.0], [-1.0, 0.0, 0.0, -1.0, 0.0, 1.0],
            [1.0, 2.0, 0.0, 1.0, 0.0, 1.0], [0.0, 0.1, 0.0, 0.0, 0.0, 0.0]]


def test_an_inertia_is_one_that_the_parameter_file_takes(unit: Unit) -> None:
    """The platform's must be positive definite, a payload's semidefinite; the status says so."""
    unit.fmu.exitInitializationMode()
    unit.step()
    for body, given in (('platform', {}), ('payload', {'payload.mass': 20.0})):
        for name, value in given.items():
            unit.put(REFERENCES[name], [value])
        points = [[0.0] * 6, [-0.0] * 6] if body == 'payload' else []
        for inertia in [*_inertias(), *points]:
            unit.put(REFERENCES[f'{body}.inertia.ixx'], inertia)
            forces = unit.step()
            try:
                taken = PARAMETERS.replaced({**given, f'{body}.inertia': inertia})
            except ParameterError:
                assert (unit.status, forces) == (BROKEN_RULE, [0.0] * 6), inertia
            else:
                assert (unit.status, forces) == (0, at_home(taken).forces.tolist()), inertia
        unit.put(REFERENCES['platform.inertia.ixx'], list(PARAMETERS['platform.inertia']))


def test_parameters_are_tunable(unit: Unit) -> None:
    """A payload changes the forces as it changes those of the library."""
    unit.fmu.exitInitializationMode()
    unit.put(REFERENCES['platform.mass'], [250.0])
    heavy = PARAMETERS.replaced({'platform.mass': 250.0})
    assert unit.step() == at_home(heavy).forces.tolist()


def test_a_payload_is_an_input(unit: Unit) -> None:
    """A driver gets in and out: the bits of the library, whose parameters have the payload."""
    unit.fmu.exitInitializationMode()
    empty = unit.step()
    driver = [82.0, 0.1, -0.2, 0.6, 9.0, 0.1, 0.2, 8.0, -0.3, 3.0]
    unit.put(REFERENCES['payload.mass'], driver)
    laden = PARAMETERS.replaced({'payload.mass': driver[0], 'payload.center_of_mass': driver[1:4],
                                 'payload.inertia': driver[4:]})
    assert unit.step() == at_home(laden).forces.tolist()
    unit.put(REFERENCES['payload.mass'], [0.0])
    assert unit.step() == empty


def test_descriptions_name_the_leg_before_what_else_they_say() -> None:
    for each in variables(PARAMETERS.replaced({
            'actuator.reflected_mass': None, 'actuator.screw_lead': 0.005,
            'drive.motor_inertia': 1e-4})):
        assert '{' not in each.description
        if '[' in each.name:
            leg = each.name.split('[')[1].rstrip(']')
            assert f'leg {leg}' in each.description.split(';')[0]
            assert each.description.count('leg ') == 1


@pytest.mark.parametrize('file', ['platform.yaml', 'ship_hexapod.yaml', 'telescope.yaml'])
def test_starts_have_no_rounding_errors(file: str) -> None:
    """A coordinate of a symmetrical hexapod is zero, not -9e-18; the pose is that of home."""
    parameters = Parameters.from_yaml(ROOT / 'config' / file)
    home = StewartPlatform(parameters).home_pose()
    start = [each.start or 0.0 for each in variables(parameters)]
    assert all(each == 0.0 or abs(each) > 1e-12 for each in start)
    assert start[:3] == pytest.approx(home.position.tolist(), abs=1e-15)
    assert np.abs(np.reshape(from_quaternion(*start[3:7]), (3, 3)) - home.rotation).max() < 1e-15


def test_units_are_shown_in_millimetres_and_degrees(path: Path) -> None:
    described = fmpy.read_model_description(str(path))
    shown = {each.name: each.displayUnit for each in described.modelVariables}
    assert [shown[name] for name in (
        'position.x', 'lengths[1]', 'rates[1]', 'angular_velocity.z', 'base.angular_velocity.z',
        'payload.center_of_mass.z', 'forces[1]', 'linear_acceleration.x', 'orientation.x')] == [
            'mm', 'mm', 'mm/s', 'deg/s', 'deg/s', 'mm', None, None, None]
    factors = {each.name: each.factor for unit in described.unitDefinitions
               for each in unit.displayUnits}
    assert factors == {'mm': 1000.0, 'mm/s': 1000.0, 'deg/s': 180.0 / math.pi,
                       'deg/s2': 180.0 / math.pi}


def test_flat_names_on_request(version: str, tmp_path: Path) -> None:
    """Letters, digits and underscores alone; the same variables otherwise, and valid."""
    path = tmp_path / 'hexapod.fmu'
    path.write_bytes(fmu(PARAMETERS, 'hexapod', version, COMPILER, flat=True))
    assert not validate_fmu(str(path))
    described = fmpy.read_model_description(str(path))
    assert described.variableNamingConvention == 'flat'
    names = [each.name for each in described.modelVariables]
    assert len(set(names)) == len(names) == len(VARIABLES)
    assert all(re.fullmatch('[a-z0-9_]+', name) for name in names)
    assert {'lengths_1', 'position_x', 'payload_center_of_mass_z', 'wrench_force_x',
            'singularity_warn_condition', 'exceeded_6', 'status'} < set(names)
    done = fmpy.simulate_fmu(str(path), stop_time=0.01, output_interval=0.001)
    assert set(done['forces_1']) == {at_home(PARAMETERS).forces[0]}


def test_flat_names_belong_to_an_fmu(tmp_path: Path) -> None:
    params = str(ROOT / 'config' / 'platform.yaml')
    error = call(main, '--params', params, '--output', tmp_path, '--flat', code=2).err
    assert '--flat: needs --fmu' in error
    call(main, '--params', params, '--output', tmp_path, '--flat', '--fmu')
    described = fmpy.read_model_description(str(tmp_path / 'hexapod.fmu'))
    assert 'forces_1' in [each.name for each in described.modelVariables]


def test_a_payload_of_the_file_is_the_start_value() -> None:
    laden = PARAMETERS.replaced({'payload.mass': 82.0, 'payload.center_of_mass': [0.1, 0.0, 0.6]})
    starts = {each.name: each.start for each in variables(laden)}
    assert starts['payload.mass'] == 82.0 and starts['payload.center_of_mass.z'] == 0.6
    assert starts['platform.mass'] == PARAMETERS['platform.mass']


def test_initialization(unit: Unit) -> None:
    """Outputs are read while inputs are set; the side of a singularity is that of the last."""
    home = unit.get(FORCES)
    unit.put(2, [-HOME[2]])
    assert unit.get([REFERENCES['determinant']])[0] < 0.0
    unit.put(2, [HOME[2]])
    assert unit.get(FORCES) == home
    assert unit.get([REFERENCES['determinant']])[0] > 0.0
    unit.fmu.exitInitializationMode()
    assert not unit.warning
    assert unit.step() == home


def test_suppressed(unit: Unit) -> None:
    """Above stop_condition forces are zero if singularity.suppress_forces is set."""
    unit.fmu.exitInitializationMode()
    assert not unit.warning
    unit.put(REFERENCES['singularity.warn_condition'], [1.0, 1.0])
    assert unit.step() != [0.0] * 6
    assert unit.warning
    unit.put_flag('singularity.suppress_forces', True)
    assert unit.step() == [0.0] * 6
    assert unit.status == SUPPRESSED


def test_instances_share_nothing(unit: Unit, path: Path, version: str, tmp_path: Path) -> None:
    """Two instances in one process; a state that is put back; a reset."""
    other = Unit(path, version, tmp_path / 'other')
    for each in (unit, other):
        each.fmu.exitInitializationMode()
    home = unit.step()
    other.put(2, [HOME[2] - 0.1])
    low = other.step()
    assert low != home
    assert unit.step() == home
    state = (other.fmu.getFMUState if version == '3' else other.fmu.getFMUstate)()
    other.put(2, [HOME[2]])
    assert other.step() == home
    (other.fmu.setFMUState if version == '3' else other.fmu.setFMUstate)(state)
    assert other.step() == low
    (other.fmu.freeFMUState if version == '3' else other.fmu.freeFMUstate)(state)
    other.fmu.reset()
    if version == '2':
        other.fmu.setupExperiment()
    other.fmu.enterInitializationMode()
    assert other.get(FORCES) == home  # computed while it is initialized
    other.fmu.exitInitializationMode()
    other.close()


def test_variables_of_other_types(unit: Unit, version: str) -> None:
    """A reference of another type, an output that is set, and one that does not exist fail."""
    for references in ([REFERENCES['forces[1]']], [REFERENCES['status']], [10_000]):
        with pytest.raises(fmpy.fmi1.FMICallException):
            unit.put(references[0], [0.0])
    for references in ([REFERENCES['warning']], [10_000]):
        with pytest.raises(fmpy.fmi1.FMICallException):
            unit.get(references)
    unit.fmu.exitInitializationMode()


def test_token_of_another_hexapod(path: Path, version: str, tmp_path: Path) -> None:
    """An instance is not made for the description of another hexapod."""
    other = PARAMETERS.replaced({'platform.mass': 151.0})
    changed = tmp_path / 'other.fmu'
    changed.write_bytes(fmu(other, 'hexapod', version))
    token = fmpy.read_model_description(str(changed)).guid
    assert token != fmpy.read_model_description(str(path)).guid
    with pytest.raises(Exception, match='instantiate'):
        Unit(path, version, tmp_path, token)


@pytest.mark.parametrize('compiler', ['gcc', 'clang'])
def test_sources_conform_to_the_standard(path: Path, version: str, compiler: str,
                                         tmp_path: Path) -> None:
    """The sources in the FMU compile without a warning, also with the standard's headers."""
    if shutil.which(compiler) is None:
        pytest.skip(f'needs {compiler}')
    sources = Path(fmpy.extract(str(path), str(tmp_path))) / 'sources'
    headers = Path(fmpy.__file__).parent / 'c-code'
    strict = [compiler, '-Wall', '-Wextra', '-Wpedantic', '-Wconversion', '-Wdouble-promotion',
              '-Werror', '-fsyntax-only']
    for standard in ('c99', 'gnu17'):  # CMake's default has GNU's extensions
        subprocess.run([*strict, f'-std={standard}', *sorted(sources.glob('*.c'))], check=True)
    subprocess.run([*strict, '-Wno-pedantic', f'-I{headers}', '-include',
                    f'fmi{version}Functions.h', sources / f'fmi{version}.c'], check=True)


def test_without_a_compiler(version: str, tmp_path: Path) -> None:
    """Without a compiler the FMU has its sources alone, and is the same each time."""
    once, again = (fmu(PARAMETERS, 'hexapod', version) for _ in range(2))
    assert once == again
    path = tmp_path / 'sources.fmu'
    path.write_bytes(once)
    names = zipfile.ZipFile(path).namelist()
    assert 'modelDescription.xml' in names
    assert not [name for name in names if name.startswith('binaries')]
    assert (version == '3') == ('sources/buildDescription.xml' in names)


def test_program(version: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The FMU stands beside the C files; without a compiler one line says so."""
    params = str(ROOT / 'config' / 'platform.yaml')
    written = tmp_path / 'with'
    option = ['--fmu'] if version == '3' else ['--fmu', '2']
    error = call(main, '--params', params, '--output', written, '--name', 'arm', *option).err
    assert 'no binary' not in error
    described = fmpy.read_model_description(str(written / 'arm.fmu'))
    assert described.fmiVersion == f'{version}.0'
    assert described.coSimulation.modelIdentifier == 'arm'
    names = zipfile.ZipFile(written / 'arm.fmu').namelist()
    assert [Path(name).stem for name in names if name.startswith('binaries/')] == ['arm']
    monkeypatch.setenv('PATH', str(tmp_path))
    monkeypatch.delenv('CC', raising=False)
    error = call(main, '--params', params, '--output', tmp_path, *option).err
    assert 'hexapod.fmu has no binary: no C compiler' in error
    monkeypatch.setenv('CC', shutil.which('false', path='/bin:/usr/bin') or 'false')
    failed = tmp_path / 'failed'
    error = call(main, '--params', params, '--output', failed, *option, code=2).err
    assert 'cannot compile the FMU' in error
    assert not failed.exists()


def _recorded_inputs(bag: Path) -> list[list[float]]:
    """Return the inputs up to angular_acceleration of the setpoints of a bag, by their stamps."""
    setpoints: dict[int, list[float]] = {}
    with AnyReader([bag]) as reader:
        for connection, _, data in sorted(
                reader.messages(), key=lambda each: 'pose twist accel'.index(
                    each[0].topic.rsplit('/', 1)[1])):
            message: Any = reader.deserialize(data, connection.msgtype)
            stamp = message.header.stamp.sec * 10 ** 9 + message.header.stamp.nanosec
            row = setpoints.setdefault(stamp, [])
            if connection.topic.endswith('pose'):
                p, q = message.pose.position, message.pose.orientation
                row += [p.x, p.y, p.z, q.x, q.y, q.z, q.w]
            else:
                of = message.twist if connection.topic.endswith('twist') else message.accel
                for each in (of.linear, of.angular):
                    row += [each.x, each.y, each.z]
    return [row for _, row in sorted(setpoints.items())]


def test_without_limits_of_length_it_starts_where_forces_can_be_solved(
        version: str, tmp_path: Path, snapshot: Snapshot) -> None:
    """A file that the node takes is exported; it starts at rest at a pose that is not singular."""
    p = PARAMETERS.replaced({
        'limits.length_min': None, 'limits.length_max': None, 'geometry.zero_length': 0.0})
    with snapshot.raises(ParameterError):
        StewartPlatform(p).home_pose()
    path = tmp_path / 'hexapod.fmu'
    path.write_bytes(fmu(p, 'hexapod', version, COMPILER))
    assert not validate_fmu(str(path))
    done = fmpy.simulate_fmu(str(path), stop_time=0.01, output_interval=0.001)
    assert set(done['status']) == {0}


def test_motors_have_the_bits_of_the_library(version: str, tmp_path: Path) -> None:
    """Speeds and torques of the motors, where drives are given."""
    p = PARAMETERS.replaced({
        'actuator.reflected_mass': None, 'actuator.screw_lead': 0.005, 'drive.gear_ratio': 3.0,
        'drive.motor_inertia': 1.37e-4, 'drive.efficiency': 0.9, 'limits.force_max': None})
    path = tmp_path / 'hexapod.fmu'
    path.write_bytes(fmu(p, 'hexapod', version, COMPILER))
    assert not validate_fmu(str(path))
    places = {each.name: n for n, each in enumerate(variables(p))}
    unit, platform = Unit(path, version, tmp_path / 'unit'), StewartPlatform(p)
    unit.fmu.exitInitializationMode()
    for motion in random_motion(p, rng(), 50).rows:
        quaternion = to_quaternion(motion[3:12].reshape(3, 3)).tolist()
        unit.put(0, [*motion[:3], *quaternion, *motion[12:]])
        unit.step()
        length = quaternion_length(*quaternion)
        motion[3:12] = from_quaternion(*(each / length for each in quaternion))
        motors = platform.motors(Motion.of_rows(motion))
        for name, wanted in (('speeds', motors.speeds), ('torques', motors.torques)):
            found = unit.get([places[f'motor_{name}[{leg}]'] for leg in range(1, 7)])
            assert found == wanted.tolist()
    unit.put(0, [math.nan])
    unit.step()
    assert unit.get([places[f'motor_torques[{leg}]'] for leg in range(1, 7)]) == [0.0] * 6
    unit.close()


def test_the_example_in_fmpy_has_the_forces_of_the_library(path: Path) -> None:
    """The last sample: heaving with the driver, as FMPy steps it."""
    spec = importlib.util.spec_from_file_location('example', ROOT / 'demo' / 'fmu_in_fmpy.py')
    assert spec is not None and spec.loader is not None
    example: Any = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(example)
    found = example.simulated(path, 0.4)
    laden = PARAMETERS.replaced({
        'payload.mass': 82.0, 'payload.center_of_mass': [0.0, 0.0, 0.5]})
    # A step computes the outputs of the inputs before it: those of the last sample but one.
    at = {name: values[0] for name, values in example.heaving(
        HOME[2], np.array([found['time'][-2]])).items()}
    rotation = np.reshape(from_quaternion(*HOME[3:7]), (3, 3))
    motion = Motion([*HOME[:2], at['position.z']], rotation,
                    [0.0, 0.0, at['linear_velocity.z']], np.zeros(3),
                    [0.0, 0.0, at['linear_acceleration.z']], np.zeros(3))
    expected = StewartPlatform(laden).inverse_dynamics(motion).forces
    assert [found[f'forces[{leg}]'][-1] for leg in range(1, 7)] == pytest.approx(
        expected.tolist(), rel=1e-9)


@pytest.mark.parametrize('drives', [{}, {
    'drive.gear_ratio': 40.0, 'drive.motor_inertia': 1e-4, 'actuator.reflected_inertia': None}],
    ids=['bare', 'with motors'])
def test_cranks_have_angles_torques_and_levers(
        version: str, drives: dict[str, Any], tmp_path: Path) -> None:
    """A motion from home until the legs do not reach: the bits of the library, by their names."""
    parameters = Parameters.from_yaml(ROOT / 'config' / 'crank_platform.yaml').replaced(drives)
    path, platform = tmp_path / 'rig.fmu', StewartPlatform(parameters)
    path.write_bytes(fmu(parameters, 'rig', version, COMPILER))
    assert not validate_fmu(str(path))
    described = fmpy.read_model_description(str(path))
    references = {each.name: int(each.valueReference) for each in described.modelVariables}
    of_legs = {name: [references[f'{name}[{leg}]'] for leg in range(1, 7)]
               for name in ('angles', 'speeds', 'torques', 'levers', 'joint_forces')}
    assert not {'lengths[1]', 'rates[1]', 'forces[1]'} & set(references)
    assert ('motor_torques[1]' in references) == bool(drives)
    for name, unit in ('angles', 'rad'), ('speeds', 'rad/s'), ('torques', 'N.m'), ('levers', 'm'):
        assert {each.unit for each in described.modelVariables
                if each.name.startswith(f'{name}[')} == {unit}
    unit_ = Unit(path, version, tmp_path / 'one')
    unit_.fmu.exitInitializationMode()
    most = parameters['limits.torque_max']
    for row in golden_vectors(parameters):
        motion, wrench = row[2:26].copy(), row[26:32]
        quaternion = np.array(to_quaternion(motion[3:12].reshape(3, 3)))
        motion[3:12] = from_quaternion(*(quaternion / quaternion_length(*quaternion)))
        unit_.put(0, [*motion[:3], *quaternion, *motion[12:], *wrench])
        unit_.step()
        result = platform.solve(motion[None], wrench[None])[0]
        assert unit_.status == 0
        for name in ('angles', 'speeds', 'levers', 'joint_forces'):
            assert unit_.get(of_legs[name]) == result[places('stewart_result')[name]].tolist()
        assert unit_.get(of_legs['torques']) == np.clip(
            result[places('stewart_result')['torques']], -most, most).tolist()
        if drives:
            at = references['motor_speeds[1]']
            assert unit_.get([at]) == [40.0 * unit_.get(of_legs['speeds'])[0]]
        else:
            with pytest.raises(fmpy.fmi1.FMICallException):
                unit_.get([104])
    angles = unit_.get(of_legs['angles'])
    unit_.put(0, [0.0, 0.0, 3.0])
    unit_.step()
    assert unit_.status == UNREACHABLE
    assert unit_.get(of_legs['torques']) == [0.0] * 6 and unit_.get(of_legs['angles']) == angles
    unit_.close()
