# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
One identification and its results: identified.yaml, identification.json, report.html, terminal.

Files are renamed only when all are complete. Like the replay's report the page needs no network:
plotly.js is included, numbers are base64 of typed arrays.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from contextlib import closing
import math
from pathlib import Path
import re
import shlex
import textwrap

from msgspec import UNSET, UnsetType
from msgspec.structs import replace
import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.bags.find import bytes_of
from stewart_dynamics.errors import StewartError
from stewart_dynamics.estimation.confidence_level import PERCENT, TWO_SIDED
from stewart_dynamics.estimation.posterior import IDENTIFIABLE
from stewart_dynamics.identification.extraction import Extracts
from stewart_dynamics.identification.identification_options import IdentificationOptions
from stewart_dynamics.identification.identification_record import (
    IdentificationResult, LegResiduals, Options, ResidualsOfLegs)
from stewart_dynamics.identification.identify import (
    Identification, Identified, Residuals)
from stewart_dynamics.identification.lack_of_fit import NEXT, PIECE, WHOLE
from stewart_dynamics.identification.parameter_fit import residual_of, shifted_by
from stewart_dynamics.mechanics.least_squares import Identifiability, identifiability
from stewart_dynamics.parameters.table import Parameters
from stewart_dynamics.records import of_kind
from stewart_dynamics.replay.statements import plural
from stewart_dynamics.reporting.estimates import (
    Cause, combined, Estimate, estimate, FoundLackOfFit, IDENTIFIED, justified, LikelyError,
    NOT_IDENTIFIABLE, not_identifiable_lines, table_lines, WITHOUT_VALUE)
from stewart_dynamics.reporting.pages import base64_of, page, plotly_script
from stewart_dynamics.reporting.results_folder import (
    check_free, IDENTIFICATION, IDENTIFIED_PARAMETERS, remove_abandoned, REPORT_PAGE, whole_folder)
from stewart_dynamics.reporting.spectrum import drawn, Spectrum
from stewart_dynamics.whole_file import now, write_files, write_json
from tqdm import tqdm

_TEMPLATES = Path(__file__).with_name('templates')
NOT_TESTED = ('not tested for a lack of fit: what can be used of the motion is too short: '
              f'{WHOLE} cut-off periods are needed, in pieces of at least {PIECE}, besides the '
              'ends that the filters take')
# Largest number of samples in the curves of the report; later samples are not drawn.
_MOST = 12_000


def run(bags: Sequence[Path], parameters: Parameters, folder: Path, options: IdentificationOptions,
        warn: Callable[[str], None]) -> IdentificationResult:
    """
    Identify from bags into a folder; return the content of identification.json.

    ``warn`` is called with possible errors that were accepted. Raises StewartError if a bag cannot
    be used, or a possible error is found: nothing is written.
    """
    before = check_free(folder, options, IDENTIFICATION)
    remove_abandoned([folder])
    with closing(Identification(parameters, options)) as work:
        with tqdm(total=sum(map(bytes_of, bags)), unit='B', unit_scale=True, disable=None,
                  leave=False, dynamic_ncols=True) as bar:
            for bag in bags:
                work.read(bag, bar.update)
        found = work.result()
        for likely in found.likely:
            if not options.accept_mistakes:
                raise StewartError(f'{bags[0]}: {likely.text}; nothing is written '
                                   '(--accept-mistakes writes)')
            warn(f'warning: {likely.text}')
        result = document(found, options)
        with whole_folder(folder, options, IDENTIFICATION, before) as partial:
            _rounded(found).to_yaml(partial / IDENTIFIED_PARAMETERS, comments(result))
            write_json(partial / IDENTIFICATION, result)
            if options.report:
                write_report(partial / REPORT_PAGE, work.extracts, found, result)
    return result


def _rounded(found: Identified) -> Parameters:
    """Return the parameters rounded to the digits that the intervals justify."""
    errors = found.fit.deviations
    try:
        return found.unknowns.parameters(justified(found.written, errors))
    except StewartError:  # a body at its bound may not be rounded
        return found.parameters


def document(found: Identified, options: IdentificationOptions) -> IdentificationResult:
    """Return the content of identification.json."""
    p, u, asked = found.parameters, found.unknowns, found.unknowns.asked
    lack, what, states = found.lack_of_fit, *_identifiability(found)
    sure = all(lack is not None and each.what == lack.cause for each in found.likely)
    errors, parts = _errors(found), found.fit.parts(u)
    unclear = np.flatnonzero([state != IDENTIFIED for state in states])
    return of_kind(IdentificationResult, p.leg_kind)(
        date=now(),
        bags=[replace(bag, delay_s=delay + bag.delay_s if error > 0.0 else None,
                      delay_standard_error_s=error if error > 0.0 else None)
              for bag, delay, error in zip(
                  found.bags, found.fit.delays, found.fit.delay_errors, strict=True)],
        options=Options(
            list(options.kinds), options.motor_torque, options.motor_current, options.cutoff,
            options.hold_out, options.delay, options.accept_mistakes),
        samples=found.samples, efforts_left_out=found.unsound, efforts_outliers=found.outliers,
        parameters=[estimate(
            u.names[n], u.units[n], u.start[n], found.fit.values[n], state, errors[n], share,
            u.names[n] in found.fit.at_bound, sure, prior=True, written=found.written[n],
            file_deviation=u.deviations[n],
            parts={name: each[n] for name, each in parts.items() if each[n] > 0.0})
            for n, state, share in zip(asked, states, what.shares, strict=True)],
        # Without single parameters: their intervals are too wide because of the lack of fit.
        combinations=[each for each in combined(
            what, [u.names[n] for n in asked], [u.units[n] for n in asked],
            found.fit.values[asked], found.fit.covariance[np.ix_(asked, asked)], unclear,
            (errors - found.fit.deviations)[asked]) if len(each.parameters) > 1],
        base_parameters=_base_parameters(found, sure) or UNSET,
        rank=what.rank, unknowns=len(asked), singular_values=what.singular_values.tolist(),
        residuals=_residuals(p, found.residuals),
        validation=None if found.validation is None else _residuals(
            p, found.validation, found.validation.samples),
        tested_for_lack_of_fit=found.tested,
        lack_of_fit=None if lack is None else FoundLackOfFit(
            lack.cause, _notice(found, sure), 'widened' if sure else 'none',
            [Cause(*each[:5]) for each in lack.ranked], lack.left),
        likely_mistakes=[LikelyError(*each) for each in found.likely], identified=p.plain())


def _base_parameters(found: Identified, sure: bool) -> list[Estimate]:
    """Return estimates of ``LegKind.base_parameters`` that are uncertain."""
    u, p, fit = found.unknowns, found.parameters, found.fit
    estimates: list[Estimate] = []
    for each in p.leg_kind.base_parameters(p):
        for leg, joint in enumerate(p.joints):
            sums = np.zeros(len(u.start))
            for name, coefficients in each.terms.items():
                sums[u.names.index(f'{name}.{joint}')] = coefficients[leg]
            before = float(np.linalg.norm(sums @ u.root))
            if not before:
                continue  # the file knows it exactly
            shifts = 0.0 if found.lack_of_fit is None else float(
                np.abs(sums) @ found.lack_of_fit.shifts) / TWO_SIDED
            error = math.sqrt(max(float(sums @ fit.covariance @ sums), 0.0)) + shifts
            state = IDENTIFIED if error < IDENTIFIABLE * before else NOT_IDENTIFIABLE
            estimates.append(estimate(
                f'{each.name}.{joint}', each.unit, float(sums @ u.start),
                float(sums @ fit.values), state, error, 0.0, False, sure, prior=True,
                file_deviation=before))
    return estimates


def _identifiability(found: Identified) -> tuple[Identifiability, list[str]]:
    """Return what the data say of the asked parameters without the prior, and their states."""
    u, block = found.unknowns, np.ix_(found.unknowns.asked, found.unknowns.asked)
    scales = u.deviations[u.asked]
    scales[scales == 0.0] = 1.0  # what the file knows exactly
    before, after = (each[block] / np.outer(scales, scales)
                     for each in (u.root @ u.root.T, found.fit.covariance))
    data = np.linalg.pinv(after, hermitian=True) - np.linalg.pinv(before, hermitian=True)
    largest = (IDENTIFIABLE ** -2 - 1.0) ** -0.5
    what = identifiability(data / np.outer(scales, scales), scales, largest_error=largest)
    known = _errors(found)[u.asked] < IDENTIFIABLE * u.deviations[u.asked]
    return what, [IDENTIFIED if each else NOT_IDENTIFIABLE for each in known]


def _errors(found: Identified) -> Array:
    """Return standard errors (k,), wider where there is a lack of fit."""
    return found.fit.deviations if found.lack_of_fit is None else (
        found.fit.deviations + found.lack_of_fit.shifts / TWO_SIDED)


def _notice(found: Identified, sure: bool) -> str:
    """Return the notice of a lack of fit in one line; ``sure``: there are intervals."""
    lack, asked = found.lack_of_fit, found.unknowns.asked
    assert lack is not None
    cause = (f'not explained; the largest part is {lack.text}' if lack.unexplained else
             f'likely {lack.text}')
    changes = 'no intervals are given: a possible error in the recording was accepted'
    if sure:
        errors, before = _errors(found)[asked], found.fit.deviations[asked]
        ratios = np.divide(errors, before, out=np.ones(len(asked)), where=before > 0.0)
        widest = int(np.argmax(ratios))
        changes = (
            'the intervals are widened by the change that '
            f'{"any of the possible causes" if lack.unexplained else "this"} would make: '
            f'{found.unknowns.names[asked[widest]]} is {ratios[widest]:.2g} times as wide, half '
            f'of all at most {np.median(ratios):.2g} times')
    advice = NEXT[lack.cause].format(file=shlex.quote(found.parameters.source))
    return f'the residuals are more than noise: {cause}; {changes}; next: {advice}'


def _residuals(p: Parameters, residuals: Residuals, samples: int | UnsetType = UNSET,
               ) -> ResidualsOfLegs:
    """Return the residuals of each leg, and their RMS of all legs."""
    rms = {'before_rms': residuals.before, 'after_rms': residuals.after,
           'measured_rms': residuals.measured}
    of_leg = of_kind(LegResiduals, p.leg_kind)
    return of_kind(ResidualsOfLegs, p.leg_kind)(
        **{key: float(np.sqrt(np.mean(values ** 2))) for key, values in rms.items()},
        legs={joint: of_leg(**{key: values[leg] for key, values in rms.items()})
              for leg, joint in enumerate(p.joints)}, samples=samples)


def comments(result: IdentificationResult) -> dict[str, str]:
    """Return the comments of identified.yaml by parameter: intervals and date."""
    texts: dict[str, list[str]] = {}
    of_masses = {each.name: each.parameter for each in result.kind.masses}
    several = Counter(of_masses.values())
    for each in result.parameters:
        parts = each.name.split('.')
        name = '.'.join(parts[:2]) if parts[0] == 'platform' else '.'.join(parts[:-1])
        of_mass, name = name, of_masses.get(name, name)
        text = each.without_value
        if text is None:
            text = f'+-{each.half:.2g}' if each.interval else 'no interval'
            if name == 'gravity':  # the identified angle is not a value of the file
                text = f'turned about {parts[1][-1]} by {each.value:.5f} {text} rad'
            elif several[name] > 1:
                text = f'{of_mass.split(".", 2)[2]} {text} {each.unit}'
        texts.setdefault(name, []).append(text)
    kept = WITHOUT_VALUE[NOT_IDENTIFIABLE]
    return {name: f'{kept} from the motion' if set(each) == {kept} else
            f'identified {result.date[:10]}, {PERCENT}: '
            + ', '.join(each if len(set(each)) > 1 else each[:1])
            for name, each in texts.items()}


def result_text(result: IdentificationResult) -> str:
    """Return identification.json as text, at most 100 columns wide except for long names."""
    lack = result.lack_of_fit
    # A command that is advised has a line of its own, to be copied.
    sentence, *command = re.split(
        ': (?=stewart_)', f'LACK OF FIT: {lack.text}') if lack else ('',)
    notice = [*textwrap.wrap(sentence, 100), *(f'  {each}' for each in command)]
    if not result.tested_for_lack_of_fit:
        notice = textwrap.wrap(NOT_TESTED, 100)
    lines = [*notice, *_headline(result), '', *table_lines(result.parameters, 'identified'),
             *not_identifiable_lines(result, 'motion')]
    if base := result.shown_base_parameters:
        lines += ['', 'base parameters of the legs, which the efforts show by themselves:',
                  *table_lines(base, 'identified')]
    lines += _bags(result)
    return '\n'.join(lines)


def _headline(result: IdentificationResult) -> list[str]:
    rms, held, unit = result.residuals, result.validation, result.kind.effort.unit
    lines = [f'residual RMS {rms.before_rms:.4g} {unit} by the file, '
             f'{rms.after_rms:.4g} {unit} by the identified parameters '
             f'({_percent(rms.after_rms, rms.measured_rms)} of the efforts)']
    if held is None:
        lines.append('not validated: too little data to hold some out')
    else:
        worst, of_worst = max(held.legs.items(), key=lambda leg: leg[1].after_rms)
        lines.append(
            f'on held-out time: {held.before_rms:.4g} {unit} by the file, '
            f'{held.after_rms:.4g} {unit} by a fit to the rest; worst leg {worst}, '
            f'{of_worst.after_rms:.4g} {unit}')
    return lines


def _percent(part: float, whole: float) -> str:
    return f'{100.0 * part / whole:.2g} %' if whole > 0.0 else '-'


def _bags(result: IdentificationResult) -> list[str]:
    lines = ['']
    for bag in result.bags:
        delay = '' if bag.delay_s is None or bag.delay_standard_error_s is None else (
            f', efforts {1e3 * abs(bag.delay_s):.2f} +- '
            f'{1e3 * TWO_SIDED * bag.delay_standard_error_s:.2f} ms '
            f'{"earlier" if bag.delay_s < 0.0 else "later"} than positions')
        lines.append(f'{bag.bag}: {plural(bag.samples, "sample")} in '
                     f'{bag.seconds:.1f} s of {bag.legs}{delay}')
        lines += [f'  {each}' for each in (*bag.left_out, *bag.notices)]
    if result.efforts_outliers:
        lines.append(f'{plural(result.efforts_outliers, "filtered effort")} left out as outliers')
    return lines


# -- the report -----------------------------------------------------------------------------------

def write_report(path: Path, extracts: Extracts, found: Identified,
                 result: IdentificationResult) -> None:
    """Write the page of a result, with the content of identification.json."""
    legs = list(found.parameters.joints)
    curves, spectra = _curves(extracts, found)
    kind = found.parameters.leg_kind
    data = {'legs': legs, 'curves': [base64_of(column, '<f4') for column in curves.T],
            'spectra': spectra, 'first': int(np.argmax(found.residuals.after)),
            'effort': kind.effort.name, 'unit': kind.effort.unit, 'rate': kind.rate.name,
            'rate_unit': kind.rate.unit}
    script = plotly_script()
    bag = result.bags[0].bag
    text = page(
        _TEMPLATES, 'identification', [script], document=True, r=result,
        name=Path(bag).name or bag, legs=legs, plotly=script, data=data, two_sided=TWO_SIDED,
        samples=len(curves), most=_MOST, not_tested=NOT_TESTED, kind=kind)
    write_files({path: text})


def _curves(extracts: Extracts, found: Identified) -> tuple[Array, list[dict[str, str]]]:
    """
    Return curves (M, 25), and spectra of residuals.

    The columns are times, efforts, forces before and after, and rates of the legs.
    """
    u = found.unknowns
    timeout = found.parameters.setpoint.timeout
    spectrum = Spectrum(12, timeout)
    curves: list[Array] = []
    count, elapsed = 0, 0.0
    for extract in extracts:
        delay = found.fit.delays[extract.bag]
        effort = extract.efforts @ shifted_by(delay)
        residuals = [extract.columns @ residual_of(u, values, delay)
                     for values in (u.start, found.written)]
        times = elapsed + extract.times - extract.times[0]
        spectrum.add(times, np.concatenate(residuals, axis=1).T)
        elapsed = float(times[-1]) + 10.0 * timeout  # no step between bags
        if count < _MOST:
            rows = np.concatenate(
                [extract.times[:, None], effort, effort - residuals[0], effort - residuals[1],
                 extract.legs[..., 1]], axis=1)[:_MOST - count]
            curves.append(np.concatenate([rows, np.full((1, rows.shape[1]), np.nan)]))
            count += len(rows)
    density = spectrum.density()
    spectra = [] if density is None else [
        dict(zip(('frequencies', 'values'), (
            base64_of(each, '<f4') for each in drawn(density.frequencies, amplitudes)),
            strict=True)) for amplitudes in density.amplitudes]
    return np.concatenate(curves), spectra
