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

"""
Make what the README shows: the picture of the paper's motion, and the tables of parameters.

``make docs`` runs it. The picture is drawn from what stewart_replay writes for bags/singular.
"""

from __future__ import annotations

import csv
from pathlib import Path
import tempfile

import matplotlib
import numpy as np

from stewart_dynamics.parameters import Parameter, Parameters, ParameterSet
from stewart_dynamics.replay.one import replay
from stewart_dynamics.trajectory import TrajectoryParameters

matplotlib.use('Agg')
from matplotlib import pyplot  # noqa: E402, I100, I202

ROOT = Path(__file__).resolve().parent.parent
README = ROOT / 'README.md'
PICTURE = ROOT / 'docs' / 'singular.png'


def table(kind: type[ParameterSet]) -> str:
    """Return a Markdown table of a node's parameters."""
    lines = ['| name | type | unit | default | meaning |', '| --- | --- | --- | --- | --- |']
    for parameter in kind.table.values():
        rule = f'; {parameter.rule}' if parameter.rule else ''
        lines.append(f'| `{parameter.name}` | {parameter.ros_type} | {parameter.unit} | '
                     f'{_default(parameter)} | {parameter.text}{rule} |')
    return '\n'.join(lines)


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
        return 'see there' if 'by default' in parameter.text else 'none'
    return f'`{default}`' if isinstance(default, str) else f'{default}'.lower()


def readme(text: str) -> str:
    """Return the README with its tables made anew."""
    for name, kind in (('node', Parameters), ('trajectory', TrajectoryParameters)):
        begin, end = f'<!-- parameters of the {name} -->\n', f'<!-- end of {name} -->'
        before, _, rest = text.partition(begin)
        _, _, after = rest.partition(end)
        text = f'{before}{begin}{table(kind)}\n{end}{after}'
    return text


def draw(path: Path) -> None:
    """Draw det(J) and the leg forces of the recorded singular motion."""
    parameters = Parameters.from_yaml(ROOT / 'config' / 'platform.yaml')
    with tempfile.TemporaryDirectory() as folder:
        replay(ROOT / 'bags' / 'singular', parameters, Path(folder) / 'singular')
        with (Path(folder) / 'singular' / 'legs.csv').open(encoding='utf-8') as file:
            rows = list(csv.DictReader(file))
    time = np.array([int(row['stamp (ns)']) for row in rows])
    time = (time - time[0]) * 1e-9
    det = np.array([float(row['det(J) (m^3)']) for row in rows])
    warned = time[[row['singularity warning'] == '1' for row in rows]]
    limit = parameters['limits.force_max'][0] / 1e3
    pyplot.rcParams.update({'font.size': 10, 'axes.grid': True, 'grid.color': '0.88',
                            'axes.spines.top': False, 'axes.spines.right': False})
    figure, (above, below) = pyplot.subplots(
        2, 1, sharex=True, figsize=(8, 6), height_ratios=(2, 3), layout='constrained')
    above.plot(time, det, color='black')
    above.axhline(0.0, color='firebrick', linewidth=0.8)
    at = int(np.flatnonzero(np.sign(det[:-1]) != np.sign(det[1:]))[0])
    crossing = time[at] + det[at] / (det[at] - det[at + 1]) * (time[at + 1] - time[at])
    above.plot(crossing, 0.0, 'o', color='firebrick', markersize=5)
    above.annotate(f'crosses zero at t = {crossing:.2f} s', (crossing, 0.0),
                   xytext=(-6, 52), textcoords='offset points', ha='right', color='firebrick',
                   arrowprops={'arrowstyle': '-', 'color': 'firebrick', 'linewidth': 0.8})
    above.set_ylabel('det(J)  [m³]')
    for leg in parameters['joints']:
        force = np.array([float(row[f'{leg} demanded force (N)']) for row in rows]) / 1e3
        # No line from the one branch to the other.
        below.plot(np.insert(time, at + 1, crossing), np.insert(force, at + 1, np.nan),
                   label=leg.replace('_', ' '), linewidth=1.4)
    below.set_ylim(-3.0 * limit, 3.0 * limit)
    for sign in (-1.0, 1.0):
        below.axhline(sign * limit, color='0.35', linestyle='--', linewidth=1.0)
    below.annotate('limits.force_max', (0.05, limit), xytext=(0, 4),
                   textcoords='offset points', color='0.35')
    below.set_ylabel('leg force  [kN], + pushes')
    below.set_xlabel('time  [s]')
    below.legend(ncols=3, loc='lower left', frameon=False)
    below.set_xlim(time[0], time[-1])
    for axes in (above, below):
        axes.axvspan(warned[0], warned[-1], color='gold', alpha=0.25, linewidth=0)
    above.annotate('singularity warning', (warned[0], det.max()), xytext=(4, -6),
                   textcoords='offset points', color='darkgoldenrod')
    # No date and no version in the file: the same numbers give the same bytes.
    figure.savefig(path, dpi=130, metadata={'Software': None})


def main() -> None:
    """Make the picture and the tables."""
    draw(PICTURE)
    README.write_text(readme(README.read_text(encoding='utf-8')), encoding='utf-8')


if __name__ == '__main__':
    main()
