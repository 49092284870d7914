# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


"""The summary of a bag as text for a terminal."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
import re
import shlex
import textwrap

from stewart_dynamics.legs.kind import LegKind
from stewart_dynamics.mechanics.parameter_errors import find_parameter_errors
from stewart_dynamics.parameters.table import Parameters
from stewart_dynamics.program import NODE
from stewart_dynamics.replay.bag_summary import BagSummary, LegLoads, Measured
from stewart_dynamics.replay.statements import (
    at_time, INPUTS, JOINTS, LIMITS, LOADS, motion_statements, MOTOR_LIMITS, MOTORS, READING,
    SINGULARITY)
from stewart_dynamics.reporting.pages import decimals_of, fixed
from stewart_dynamics.response.response_measures import bandwidths
from stewart_dynamics.response.response_record import RecordedResponses
from stewart_dynamics.setpoints.rejections import Rejection

_LISTED = 5
_WIDTH = 100


def summary_text(summary: BagSummary, parameters: Parameters) -> str:
    """Return the summary of a bag; possible errors are no part of it."""
    lines = [f'{summary.bag}:']
    if summary.measured:
        lines += _measured_lines(summary.measured)
        if summary.measured.setpoints_compared:
            lines += ['payload and friction that fit the measured '
                      f'{parameters.leg_kind.effort.field}:',
                      f'  {_identify_command(summary, parameters)}']
    if summary.response:
        lines += _response_lines(summary.response)
    lines += summary_lines(summary)
    errors = find_parameter_errors(parameters)
    lines += [notice for notice in summary.notices if notice not in errors]
    for each in summary.rejected:
        rejection = Rejection(each.topic, each.reason).counted(each.count)
        when = '' if each.first_at_s is None else at_time(each.first_at_s, 3)
        lines.append(rejection.words(f'first{when}: {each.first}' if each.first else ''))
    return '\n'.join(lines)


def _identify_command(summary: BagSummary, parameters: Parameters) -> str:
    """Return the command that identifies payload and friction from the bag of a summary."""
    inputs = summary.inputs
    words = ['stewart_identify', summary.bag, '--params', parameters.source]
    for option, value in (
            ('--node', inputs.node if inputs.node != NODE else None),
            ('--measured', inputs.measured)):
        words += [option, value] if value else []
    for option, given in (('--motor-torque', inputs.motor_torque),
                          ('--motor-current', inputs.motor_current)):
        words += [option] if given else []
    return shlex.join(words)


def summary_lines(summary: BagSummary) -> list[str]:
    """Return the lines about the motion, no wider than 100 columns."""
    if not summary.setpoints.answered:
        return ['no setpoint could be answered']
    about = motion_statements(summary)
    heading, *reading = [each.line for each in about if each.topic == READING]
    kind: LegKind = summary.kind
    margins = [leg.effort_margin for leg in summary.legs.values()]
    clipped = [margin is not None and margin <= 0.0 for margin in margins]
    effort = kind.effort
    lines = [heading, '', *_legs_table(summary.legs, clipped, kind)]
    if summary.quasi_static:
        lines.append(f'velocities are not known: the {effort.field} are those at rest; '
                     f'{kind.rate.field}, power and energy are not known')
    if any(clipped):
        lines.append(f'* reaches {kind.effort_limit}: the published {effort.name} is clipped to '
                     'it')
    lines += [each.line for each in about if each.topic in (
        INPUTS, LIMITS, MOTOR_LIMITS, JOINTS, LOADS, MOTORS)]
    lines += [*reading, '', *(each.line for each in about if each.topic == SINGULARITY)]
    return [_filled(line) if len(line) > _WIDTH else line for line in lines]


def _filled(line: str) -> str:
    """Return a line in several ones; an option with a quoted value stays whole, to be copied."""
    whole = re.sub(r"--[a-z-]+ '[^']*'", lambda found: found[0].replace(' ', '\0'), line)
    return textwrap.fill(whole, _WIDTH, subsequent_indent='  ', break_long_words=False,
                         break_on_hyphens=False).replace('\0', ' ')


def measured_headline(measured: Measured) -> str:
    """Return by how much measured and computed efforts differ."""
    if not measured.setpoints_compared:
        return 'no setpoint could be compared'
    error = measured.likely_mistake
    likely = '' if error is None else f'possible error: {error.text}; ' + (
        '' if measured.external_wrench_given else 'no external wrench is given; ')
    effort = measured.kind.effort
    worst, leg = max((leg.residual_rms or 0.0, name) for name, leg in measured.legs.items())
    share = '' if measured.residual_share is None else (
        f', {100.0 * measured.residual_share:.3g} % of the measured {effort.name}')
    return (f'{likely}measured and computed {effort.field} differ by {measured.residual_rms:.3g} '
            f'{effort.unit} RMS{share}; most in {leg}, by {worst:.3g} {effort.unit}')


def _measured_lines(measured: Measured) -> list[str]:
    """Return the result of the comparison with measured efforts, the headline first."""
    lines = [measured.headline]
    if not measured.setpoints_compared:
        return lines
    effort = measured.kind.effort
    residuals = {leg: found.residual_rms or 0.0 for leg, found in measured.legs.items()}
    decimals = decimals_of(measured.kind.decimals, residuals.values())
    rms = ', '.join(f'{leg} {fixed(each, decimals)}' for leg, each in residuals.items())
    lines += [f'compared {measured.setpoints_compared} setpoints; measured minus computed '
              f'{effort.name}, RMS [{effort.unit}]: {rms}']
    contacts = measured.contacts
    lines += [f'contact {_span(each.from_s, each.to_s)}: external force '
              f'({", ".join(fixed(part, 1) for part in each.force_n)}) N'
              for each in contacts.strongest[:_LISTED]]
    if contacts.count > _LISTED:
        lines.append(f'and {contacts.count - _LISTED} more contacts')
    return lines


def _response_lines(response: RecordedResponses) -> list[str]:
    """Return the delay and bandwidths of each axis."""
    lines = []
    for axis, each in response.axes.items():
        if each.reason:
            lines.append(f'response of {axis:<2}  not stated: {each.reason}')
            continue
        delay = '-' if each.delay is None else f'{1e3 * each.delay:.2f} ms'
        words = ', '.join(f'{name} {words}' for name, words in bandwidths(each).items())
        lines.append(f'response of {axis:<2}  delay {delay}, {words}')
    return lines


def _span(begin: float, end: float) -> str:
    first, last = f'{begin:.2f}', f'{end:.2f}'
    return f'at t = {first} s' if first == last else f'from t = {first} to {last} s'


_NAME = 11
_MARKED = 'effort_peak'  # the column with marks


def _columns(kind: LegKind, legs: Mapping[str, LegLoads],
             ) -> list[tuple[str, str, str, int, int]]:
    """
    Return the columns of the table of legs: group, title, attribute, width, decimals.

    With the leg's name and the mark, they have the width _WIDTH.
    """
    of_efforts, of_powers = (
        decimals_of(kind.decimals, [getattr(leg, name) for leg in legs.values()])
        for name in ('effort_peak', 'power_peak_w'))
    effort, position, rate = (f'{each.name} [{each.unit}]' for each in (
        kind.effort, kind.position, kind.rate))
    return [
        (effort, 'peak', 'effort_peak', 10, of_efforts),
        (effort, 'at [s]', 'effort_peak_at', 9, 2),
        (effort, 'RMS', 'effort_rms', 9, of_efforts),
        (effort, 'margin', 'effort_margin', 9, of_efforts),
        ('power [W]', 'peak', 'power_peak_w', 10, of_powers),
        (position, 'from', 'position_min', 8, 4), (position, 'to', 'position_max', 8, 4),
        (position, 'margin', 'position_margin', 8, 4),
        (rate, 'peak', 'rate_peak', 9, 4), (rate, 'margin', 'rate_margin', 8, 4)]


def _legs_table(legs: Mapping[str, LegLoads], marked: Sequence[bool], kind: LegKind,
                ) -> list[str]:
    """Return the table of the legs; columns without numbers are left out."""
    columns = [column for column in _columns(kind, legs)
               if any(getattr(leg, column[2]) is not None for leg in legs.values())]
    spans: dict[str, int] = {}
    titles = f'{"leg":<{_NAME}}'
    for group, title, name, width, _ in columns:
        spans[group] = spans.get(group, 0) + width + (name == _MARKED)
        titles += f'{title:>{width}}' + ' ' * (name == _MARKED)
    lines = [' ' * _NAME + ''.join(f' {group:-^{span - 1}}' for group, span in spans.items()),
             titles]
    for (name, leg), mark in zip(legs.items(), marked, strict=True):
        line = f'{name:<{_NAME}.{_NAME}}'
        for _, _, column, width, digits in columns:
            marks = '* '[not mark] if column == _MARKED else ''
            line += _fitted(getattr(leg, column), width, digits) + marks
        lines.append(line)
    return lines


def _fitted(value: float | None, width: int, digits: int) -> str:
    """Return a number with these decimals, or fewer, so that a space is before it."""
    if value is None:
        return f'{"-":>{width}}'
    texts = [f'{value:{form}}' for form in (f'.{digits}f', '.0f', '.1e', '.0e')]
    return next((text for text in texts if len(text) < width), texts[-1]).rjust(width)
