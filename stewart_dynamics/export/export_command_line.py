# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The command line of stewart_export."""

from __future__ import annotations

import argparse
from collections.abc import Sequence

from stewart_dynamics.program import add_node, add_parameters, DONE, Program
from stewart_dynamics.signals import interrupt_on_signals
from stewart_dynamics.whole_file import FilesOfFolder

_PROGRAM = Program('stewart_export', 'parameters, or files that exist or cannot be written')


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program; the exit code is explained in its help."""
    parser = _arguments()
    given = parser.parse_args(arguments)
    if given.flat and not given.fmu:
        parser.error('--flat: needs --fmu')
    return _PROGRAM.exit_code(lambda: _export(given, FilesOfFolder(given.output, given.force)))


def _arguments() -> argparse.ArgumentParser:
    parser = _PROGRAM.parser(
        description='Write the computation of the node for one hexapod as C99 source and as an '
                    'FMU, for real-time\ncomputers.',
        files='DIR gets stewart_dynamics.h and .c, the same for every hexapod; NAME.h and .c, '
              'this hexapod;\ngolden.csv and test_golden.c, results to compare with; and '
              'CMakeLists.txt; with --fmu NAME.fmu,\nwhich has its sources inside, and a binary '
              'for this computer where a C compiler is found\n($CC, cc, gcc or clang).')
    add_parameters(parser)
    _PROGRAM.add_results(parser)
    parser.add_argument('--fmu', nargs='?', const='3', choices=('3', '2'), metavar='VERSION',
                        help='write an FMU for co-simulation, too, of FMI 3.0 (3, the default) or '
                             'FMI 2.0 (2)')
    parser.add_argument('--flat', action='store_true',
                        help='with --fmu: flat names, lengths_1 and position_x in place of '
                             'lengths[1] and position.x, of which Simulink makes a vector and a '
                             'bus')
    parser.add_argument('--drives', action='store_true',
                        help='write the units of the amplifiers, too: NAME_drives.h and .md, and '
                             'NAME_ethercat_LEG.yaml; needs drive.rated_torque and more')
    parser.add_argument('--linuxcnc', action='store_true',
                        help='write NAME_linuxcnc.hal, too: HAL lines for genhexkins, the '
                             'kinematics of LinuxCNC for hexapods')
    parser.add_argument('--arduino', action='store_true',
                        help='write NAME_arduino.zip, too: a library for the Arduino IDE with a '
                             'sketch that moves six hobby servos; needs servo.*')
    parser.add_argument('--name', default='hexapod', metavar='NAME',
                        help='name of the hexapod in C (default: hexapod)')
    add_node(parser)
    return parser


def _export(given: argparse.Namespace, files_of_folder: FilesOfFolder) -> int:
    # Imported here, so that --help is fast.
    from stewart_dynamics.export.arduino import arduino_library
    from stewart_dynamics.export.c_project import c_project, check_name
    from stewart_dynamics.export.drive_files import drive_files
    from stewart_dynamics.export.fmu import find_compiler, fmu, has_binaries
    from stewart_dynamics.export.linuxcnc import hal_lines
    from stewart_dynamics.mechanics.parameter_errors import find_parameter_errors
    from stewart_dynamics.parameters.table import Parameters

    interrupt_on_signals()
    name = check_name(given.name)
    parameters = Parameters.from_yaml(given.params, given.node)
    _PROGRAM.warn(find_parameter_errors(parameters))
    files: dict[str, str | bytes] = {**c_project(parameters, name)}
    if given.fmu:
        compiler = find_compiler() if has_binaries(given.fmu) else None
        files[f'{name}.fmu'] = fmu(parameters, name, given.fmu, compiler, flat=given.flat)
        if compiler is None:
            _PROGRAM.complain(f'warning: {name}.fmu has no binary: no C compiler for this '
                              'computer is found ($CC, cc, gcc, clang)')
    if given.drives:
        files |= drive_files(parameters, name)
    if given.arduino:
        files[f'{name}_arduino.zip'] = arduino_library(parameters, name)
    if given.linuxcnc:
        files[f'{name}_linuxcnc.hal'] = hal_lines(parameters)
    for path in files_of_folder.write(files):
        _PROGRAM.say(str(path))
    return DONE
