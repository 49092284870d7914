# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Documents of real results: they follow their JSON schemas and are read back as records."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import closing
import json
from pathlib import Path
import sys
from typing import Any

from estimate_cases import CASES, RATE, recorded, Truth
import jsonschema
from msgspec import ValidationError
from msgspec.structs import replace
import numpy as np
import pytest
from referees import rng, ROOT
from stewart_dynamics import Parameters, Pose, StewartPlatform
from stewart_dynamics.calibration.calibration_record import CalibrationResult
from stewart_dynamics.calibration.measured_poses import MeasuredPoses
from stewart_dynamics.calibration.one_run import CalibrationOptions, run as calibrate
from stewart_dynamics.cueing.cueing_result import CueingResult
from stewart_dynamics.cueing.report_command_line import main as cueing
from stewart_dynamics.datasheet import main as datasheet
from stewart_dynamics.datasheet.datasheet_record import Datasheet
from stewart_dynamics.identification.identification_options import IdentificationOptions
from stewart_dynamics.identification.identification_record import IdentificationResult
from stewart_dynamics.identification.identification_results import document
from stewart_dynamics.identification.identify import Identification
from stewart_dynamics.identification.windows import Window
from stewart_dynamics.mechanics.frames.rotation import from_euler
from stewart_dynamics.records import Record, record_of
from stewart_dynamics.replay.bag_summary import BagSummary
from stewart_dynamics.replay.summary import Summary
from stewart_dynamics.whole_file import to_json

sys.path.insert(0, str(ROOT / 'examples'))
from town_drive import write_csv  # noqa: E402, I100, I202

BAG = ROOT / 'bags' / 'clear'


def file_of(kind: str) -> Path:
    """Return the parameter file of the hexapod with a kind of legs."""
    return ROOT / 'config' / {'telescopic': 'platform.yaml', 'crank': 'crank_platform.yaml'}[kind]


def summary(kind: str, folder: Path) -> str:
    """Return the summary of no setpoints."""
    parameters = Parameters.from_yaml(file_of(kind))
    return to_json(replace(Summary(parameters).values(), parameters=parameters.plain()))


def cued(kind: str, folder: Path) -> str:
    """Return the result of a drive through town."""
    write_csv(folder / 'town.csv')
    assert cueing([str(folder / 'town.csv'), '--params', str(file_of(kind)), '--output',
                   str(folder / 'out')]) == 0
    return (folder / 'out' / 'cueing.json').read_text(encoding='utf-8')


def identified(kind: str, folder: Path) -> str:
    """Return the result of a short recording."""
    given, options = CASES[kind].given, IdentificationOptions()
    legs = recorded(Truth(given), 'rich', 3, seconds=6.0)
    with closing(Identification(given, options)) as work:
        work.add(folder, [Window(0, 1.0 / RATE, legs.positions, legs.rates, legs.efforts,
                                 np.zeros(legs.efforts.shape, dtype=bool))])
        return to_json(document(work.result(), options))


def calibrated(kind: str, folder: Path) -> str:
    """Return the result of poses near home, one of them an outlier."""
    platform, random = StewartPlatform.from_yaml(file_of(kind)), rng()
    p, home = platform.parameters, platform.home_pose()
    poses = Pose(home.position + 0.02 * random.normal(size=(20, 3)),
                 from_euler(0.05 * random.normal(size=(20, 3))))
    positions = p.leg_kind.calibrated_legs(p).measured_positions(
        platform.inverse_kinematics(poses)) + 1e-5 * random.normal(size=(20, 6))
    positions[3] += 0.05
    names = tuple(f'row {n}' for n in range(20))
    return to_json(calibrate(
        MeasuredPoses(positions, poses, names), 'poses.csv', p, folder / 'out',
        CalibrationOptions(unknowns=('zero',), accept_mistakes=True, report=False)))


def rated(kind: str, folder: Path) -> str:
    """Return the datasheet with a box, a motion and a stuck leg."""
    (folder / 'box.yaml').write_text('x: 0.6\n')
    assert datasheet([
        '--params', str(file_of(kind)), '--box', str(folder / 'box.yaml'), '--leg-stiffness',
        '1e7', '--stuck', 'leg_3', '--uncertainty', '3', '--output', str(folder / 'out'),
        *(['--motion', str(BAG)] if kind == 'telescopic' else [])]) == 0
    return (folder / 'out' / 'datasheet.json').read_text(encoding='utf-8')


@pytest.mark.parametrize('kind', CASES)
@pytest.mark.parametrize(('name', 'record', 'make'), [
    ('summary', BagSummary, summary), ('cueing', CueingResult, cued),
    ('identification', IdentificationResult, identified),
    ('calibration', CalibrationResult, calibrated), ('datasheet', Datasheet, rated)])
def test_a_document_follows_its_schema_and_is_read_from_it(
        name: str, record: type[Record], make: Callable[[str, Path], str], kind: str,
        tmp_path: Path) -> None:
    content: dict[str, Any] = json.loads(make(kind, tmp_path))
    schema = json.loads((ROOT / 'config' / f'{name}.schema.json').read_text(encoding='utf-8'))
    jsonschema.Draft202012Validator.check_schema(schema)
    check = jsonschema.Draft202012Validator(schema)
    check.validate(content)
    leg_kind = Parameters.from_yaml(file_of(kind)).leg_kind
    assert json.loads(to_json(record_of(record, content, leg_kind))) == content
    content['software'] = 3
    assert not check.is_valid(content)
    with pytest.raises(ValidationError, match='software'):
        record_of(record, content, leg_kind)
