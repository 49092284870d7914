# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


"""The report of a bag: the file, and the page in a browser."""

from __future__ import annotations

import base64
from collections.abc import Callable, Iterator
from contextlib import closing, ExitStack
import functools
from html.parser import HTMLParser
import json
from pathlib import Path
import re
import sys
import time
from typing import Any, TYPE_CHECKING

from bag_summaries import bag_summary
from checked_results import part_of
from msgspec.structs import replace
import numpy as np
from numpy.typing import NDArray
import pytest
from snapshot import Snapshot

from stewart_dynamics import Motion, Parameters, StewartError, StewartPlatform
from stewart_dynamics.colors import LEG_COLORS, ROLES
from stewart_dynamics.mechanics.dynamics.force_breakdown import ForceBreakdownRows, SOURCES
from stewart_dynamics.mechanics.frames.rotation import from_euler
from stewart_dynamics.mechanics.rows import BASE, NO_BASE
from stewart_dynamics.reference_motion.motion_functions import motion_at, sample_times
from stewart_dynamics.reference_motion.motion_parameters import ReferenceMotionParameters
from stewart_dynamics.replay.bag_report import Report, share_plotly
from stewart_dynamics.replay.bag_summary import BagSummary, Inputs, Rejected
from stewart_dynamics.replay.residuals import Comparison
from stewart_dynamics.replay.summary import Answered, powers_of, Summary
from stewart_dynamics.reporting.pages import (
    decimals, digits, number, plotly_script, thousands)
from stewart_dynamics.setpoints.base_wrench_step import BaseWrench
from stewart_dynamics.setpoints.step import Batch, Step

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

Array = NDArray[np.float64]

CONFIG = Path(__file__).resolve().parent.parent / 'config'
PARAMETERS = Parameters.from_yaml(CONFIG / 'platform.yaml')
PATIENCE = 300.0  # [s]
HOSTILE = ('</script ><script >window.hacked=1</script >', '<img src=x onerror=window.hacked=1>',
           '"><b>bold</b>', "';window.hacked=1;'", '${window.hacked=1}<br>', '<!--=data-->')


class Given:
    """A motion, its outputs, and their report."""

    def __init__(self, seconds: Array, motions: Array, parameters: Parameters = PARAMETERS,
                 bases: Array | None = None) -> None:
        self.seconds, self.motions, self.parameters = seconds, motions, parameters
        stamps = 1_700_000_000_000_000_000 + np.rint(seconds * 1e9).astype(np.int64)
        self.setpoints = Batch.from_parts(stamps, motions, bases=bases)
        self.outputs = Step(parameters)(self.setpoints)
        self.base_wrenches = BaseWrench(parameters)(self.setpoints)
        self.powers = powers_of(StewartPlatform(parameters), self.setpoints, self.outputs)
        self.breakdown = ForceBreakdownRows(parameters)(motions, self.setpoints.wrenches, bases)
        if bases is not None:
            self.breakdown[np.isnan(bases[:, 0])] = np.nan

    def answered(self, part: slice = slice(None), later: float = 0.0) -> Answered:
        """Return some of the setpoints as the replay gives them, or the same again later [s]."""
        return Answered(
            self.seconds[part] + later, self.setpoints.chosen(part),
            part_of(self.outputs, part),
            self.base_wrenches[part], self.powers[part], self.breakdown[part])

    def summary(self, **changes: Any) -> BagSummary:
        """Return what summary.json would hold."""
        summary = Summary(self.parameters)
        summary.add_block(self.answered())
        return replace(summary.values(), **{
            'version': 1, 'software': 'stewart_dynamics 0.1.0', 'bag': 'bags/example', 'run': '',
            'complete': True, 'missing': [], 'notices': [],
            'inputs': Inputs('/stewart_dynamics', {'setpoint/pose': '/a/pose'}),
            'rejected': [],
            'parameters': {name: value.ravel().tolist() if isinstance(value, np.ndarray) else value
                           for name, value in self.parameters.items()}, **changes})

    def report(self, measured: bool = False) -> Report:
        report = Report(self.parameters, measured)
        if len(self.seconds):
            report.add_block(self.answered())
        return report

    def write(self, path: Path, **changes: Any) -> BagSummary:
        summary = self.summary(**changes)
        self.report().write_page(path, summary)
        return summary


def trajectory(name: str, parameters: Parameters = PARAMETERS) -> Given:
    """Return a motion of config/, as it is recorded in bags/."""
    p = ReferenceMotionParameters.from_yaml(CONFIG / f'trajectory_{name}.yaml')
    seconds = sample_times(p) * 1e-9
    return Given(seconds, motion_at(p, seconds).rows, parameters)


class _Elements(HTMLParser):
    """The elements of a page, and its visible text."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.names: list[str] = []
        self.attributes: list[str] = []
        self.text = ''
        self._hidden = 0
        self.feed(page.replace('<wbr>', ''))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.names.append(tag)
        self.attributes += [name for name, _ in attrs]
        self._hidden += tag in ('script', 'style')

    def handle_endtag(self, tag: str) -> None:
        self._hidden -= tag in ('script', 'style')

    def handle_data(self, data: str) -> None:
        self.text += '' if self._hidden else f'{data} '


def write_measured(given: Given, path: Path, pushed: slice = slice(200, 260)) -> None:
    """Write the report of a motion whose measured forces differ, and for a while by far."""
    report, comparison = given.report(measured=True), Comparison(PARAMETERS)
    forces = given.outputs.demanded_efforts
    measured = forces + np.random.default_rng(1).normal(size=forces.shape)
    measured[pushed] += 300.0
    for compared in (
            comparison.add_measured(given.setpoints.stamps, measured),
            comparison.add_setpoints(given.seconds, given.setpoints, given.outputs),
            comparison.finish()):
        report.add_measured(*compared)
    report.write_page(path, given.summary(measured=comparison.values()))


def text_of(path: Path) -> str:
    """Return the visible text of a page, with single blanks."""
    return ' '.join(re.split('[ \\n]+', _Elements(path.read_text(encoding='utf-8')).text))


def data_text(path: Path) -> str:
    """Return what the report gives its script, as it stands in the file."""
    page = path.read_text(encoding='utf-8')
    return page.split('<script id="data" type="application/json">')[1].split('</script>')[0]


def data_of(path: Path) -> Any:
    """Return what the report gives its script."""
    return json.loads(data_text(path))


def curve_of(data: Any, plot: str, number: int, variant: int = 0) -> tuple[Array, Array]:
    """Return times and values of one curve in a plot."""
    spec = next(each for each in data['plots'] if each['key'] == plot)
    curve = data['curves'][spec['variants'][variant]['curves'][number]['curve']]
    return (np.frombuffer(base64.b64decode(curve['times']), '<f8'),
            np.frombuffer(base64.b64decode(curve['values']), '<f4').astype(float))


# ---- the file


@pytest.mark.slow
def test_a_million_setpoints_fit_into_ten_megabytes(tmp_path: Path) -> None:
    block = Given(np.arange(5000) * 1e-3, np.resize(trajectory('clear').motions, (5000, 24)))
    report = Report(PARAMETERS, measured=True)
    noise = np.random.default_rng(1).standard_normal((4, 5000, 6))
    for n in range(200):
        report.add_block(block.answered(later=5.0 * n))
        report.add_measured(5.0 * n + block.seconds, *noise[:3])
    path = tmp_path / 'report.html'
    report.write_page(path, block.summary())
    assert data_of(path)['samples'] == 1_000_000
    assert path.stat().st_size < 10e6


def test_plots_contain_the_samples_and_every_peak(tmp_path: Path) -> None:
    given = trajectory('singular')
    summary = given.write(tmp_path / 'report.html')
    data = data_of(tmp_path / 'report.html')
    columns = {'position': given.motions[:, :3] - given.motions[0, :3],
               'velocity': given.motions[:, 12:15],
               'angular_velocity': np.degrees(given.motions[:, 15:18]),
               'acceleration': given.motions[:, 18:21],
               'angular_acceleration': np.degrees(given.motions[:, 21:24]),
               'length': given.outputs.drive_positions, 'rate': given.outputs.rates,
               'force': given.outputs.demanded_efforts,
               'powers': given.outputs.demanded_efforts * given.outputs.rates,
               'determinant': given.outputs.determinants[:, None],
               'condition': given.outputs.conditions[:, None],
               'base_force': given.base_wrenches[:, :3],
               'base_moment': given.base_wrenches[:, 3:]}
    for plot, truth in columns.items():
        for n, column in enumerate(truth.T):
            at, values = curve_of(data, plot, n)
            assert np.array_equal(at, given.seconds), plot
            assert np.array_equal(values, column.astype(np.float32)), plot
    for n, leg in enumerate(summary.legs.values()):
        for plot, peak in (('force', leg.effort_peak), ('powers', leg.power_peak_w),
                           ('rate', leg.rate_peak)):
            assert peak is not None
            _, values = curve_of(data, plot, n)
            assert np.abs(values).max() == abs(np.float32(peak))
        # a fixed base is no source
        parts = sum(curve_of(data, 'force_breakdown', 1 + c, n)[1]
                    for c in range(len(SOURCES) - 1))
        whole = curve_of(data, 'force_breakdown', 0, n)[1]
        assert np.abs(parts - whole).max() <= 1e-6 * np.abs(whole).max()


def test_angles_are_those_of_the_paper_and_continue_past_half_a_turn(tmp_path: Path) -> None:
    seconds = np.arange(400) * 0.01
    angles = np.stack([0.4 * np.sin(seconds), 0.3 * np.cos(seconds), 3.0 * seconds], axis=1)
    motion = Motion(np.tile([0.0, 0.0, 1.1], (400, 1)), from_euler(angles))
    given = Given(seconds, motion.rows)
    report = Report(PARAMETERS)
    for part in (slice(0, 150), slice(150, 151), slice(151, 400)):
        report.add_block(given.answered(part))
    report.write_page(tmp_path / 'report.html', given.summary())
    data = data_of(tmp_path / 'report.html')
    drawn = np.stack([curve_of(data, 'angles', n)[1] for n in range(3)], axis=1)
    np.testing.assert_allclose(drawn, np.degrees(angles), atol=1e-4)


def moving(unknown: slice = slice(0, 0)) -> Given:
    """Return a motion on a base that heaves, in part not known."""
    given = trajectory('clear')
    bases = np.zeros((len(given.seconds), BASE))
    bases[:, 2] = -9.80665
    bases[:, 5] = 2.0 * np.sin(2.0 * np.pi * 5.0 * given.seconds)
    bases[unknown] = NO_BASE
    return Given(given.seconds, given.motions, PARAMETERS.replaced({'base.source': 'motion'}),
                 bases)


def test_a_spectrum_shows_at_which_frequency_the_base_is_loaded(tmp_path: Path) -> None:
    given = moving()
    given.write(tmp_path / 'report.html')
    data = data_of(tmp_path / 'report.html')
    frequencies, values = curve_of(data, 'base_force_spectrum', 2)
    assert frequencies[-1] == pytest.approx(50.0)  # the Nyquist rate
    assert np.all(np.diff(frequencies) > 0.0)
    near = (frequencies > 4.0) & (frequencies < 6.0)
    assert values[near].max() == values[frequencies > 1.0].max()
    assert abs(frequencies[near][values[near].argmax()] - 5.0) < 0.3
    mass = (PARAMETERS['platform.mass'] + PARAMETERS['legs.cylinder.mass'].sum()
            + PARAMETERS['legs.piston.mass'].sum())
    power = np.sum(values[near] ** 2) * (frequencies[1] - frequencies[0])
    assert power == pytest.approx((2.0 * mass) ** 2 / 2.0, rel=0.01)
    # a fixed base has no source of its own
    for name, of, shown in (('moving', given, True), ('still', trajectory('clear'), False)):
        of.write(tmp_path / f'{name}.html')
        plot = next(each for each in data_of(tmp_path / f'{name}.html')['plots']
                    if each['key'] == 'force_breakdown')
        names = [curve['name'] for curve in plot['variants'][0]['curves']]
        assert ('base motion' in names) is shown
        assert ('Base motion' in text_of(tmp_path / f'{name}.html')) is shown


def test_a_base_that_is_not_known_is_shown(tmp_path: Path) -> None:
    moving(slice(100, 130)).write(tmp_path / 'report.html')
    text = text_of(tmp_path / 'report.html')
    for shown in ('Not all messages could be used',
                  "the base's motion is not known in 30 setpoints, first at 1.000 s: they have no "
                  'force', 'limits.force_max could not be checked in 30 setpoints',
                  "Without 30 setpoints where the base's motion is not known.",
                  'base.source : motion'):
        assert shown in text, shown
    data = data_of(tmp_path / 'report.html')
    for plot in ('base_force', 'force', 'force_breakdown'):
        _, values = curve_of(data, plot, 1)
        assert np.flatnonzero(np.isnan(values)).tolist() == list(range(100, 130))


def test_few_setpoints_have_no_spectrum(tmp_path: Path) -> None:
    whole = trajectory('clear')
    Given(whole.seconds[:50], whole.motions[:50]).write(tmp_path / 'report.html')
    keys = [plot['key'] for plot in data_of(tmp_path / 'report.html')['plots']]
    assert 'base_moment' in keys
    assert 'base_moment_spectrum' not in keys


def test_names_are_text_and_never_markup(tmp_path: Path) -> None:
    paths = tmp_path / 'hostile.html', tmp_path / 'plain.html'
    bags = '/a/</script><script>window.hacked=1</script>\udcff/<!--=plotly-->', '/a/b/c'
    for path, bag, joints, (one, other, third) in zip(
            paths, bags, (HOSTILE, PARAMETERS['joints']), (HOSTILE[:3], ('m', 'n', '')),
            strict=True):
        trajectory('clear', PARAMETERS.replaced({'joints': list(joints)})).write(
            path, bag=bag, notices=[other], complete=False, missing=[one], run=other,
            rejected=[Rejected(one, other, 2, third, 1.0)],
            inputs=Inputs('/n', {'setpoint/pose': one}, differentiated_cutoff_hz=5.0))
    hostile, harmless = (_Elements(path.read_text(encoding='utf-8')) for path in paths)
    assert hostile.names == harmless.names
    assert hostile.attributes == harmless.attributes
    assert not [name for name in hostile.attributes if name.startswith('on')]
    assert hostile.names.count('script') == 3
    for name in HOSTILE:
        assert name in hostile.text
    assert not set('<>&') & set(data_text(paths[0]))
    assert data_of(paths[0])['legs'] == list(HOSTILE)


def test_the_report_shows_what_is_wrong_with_a_bag(tmp_path: Path) -> None:
    trajectory('singular').write(
        tmp_path / 'report.html', complete=False, missing=['chunk 3: its CRC is wrong'],
        notices=['the bag has no checksums'], rejected=[
            Rejected('setpoint/pose', reason, count, first, seconds)
            for reason, count, first, seconds in (
                ('not finite', 1234, 'nan', 0.25),
                ('same stamp twice', 1, 'stamp 1700000000500000000 ns', 0.5),
                ('older', 1, 'stamp 1700000000500000000 ns is 0.1 s older than the last used',
                 12.25),
                ('quaternion', 1, 'length 1.01, must be within 0.001 of 1', None))])
    text = text_of(tmp_path / 'report.html')
    for shown in ('Results are incomplete', 'chunk 3: its CRC is wrong',
                  'not finite', '1\u202f234',
                  'Limits are exceeded', 'limits.force_max', 'A singularity is reached',
                  'det(J) crossed zero at', 'the bag has no checksums', 'reflected_mass',
                  '0.500', '12.250', '0.1 s older than the last used', 'length 1.01, must be'):
        assert shown in text, shown
    # seconds since the start in place of stamps
    assert '1700000000500000000' not in text


def test_numbers_have_one_style_of_thousands() -> None:
    space = '\u202f'
    assert [number(value, 1) for value in (-999.96, 1000.0, 12345.67, -1234567.8, 0.04)] == [
        f'−1{space}000.0', f'1{space}000.0', f'12{space}345.7', f'−1{space}234{space}568', '0.0']
    assert [decimals(each) for each in (
        [0.02352, 0.024226, None], [-282.2, 99.0], [12345.6], [0.0, np.nan])] == [5, 1, 0, 1]
    assert [digits(value) for value in (8064.14, -23456.7, 123456.7, 0.25814, 1e12)] == [
        f'8{space}064.1', f'−23{space}457', f'123{space}457', '0.25814', '1e+12']
    assert thousands(1001) == f'1{space}001'


def test_measured_forces_and_contacts_are_shown_and_drawn(tmp_path: Path) -> None:
    given = trajectory('clear')
    write_measured(given, tmp_path / 'report.html')
    data = data_of(tmp_path / 'report.html')
    at, residual = curve_of(data, 'residuals', 3)
    assert np.array_equal(at, given.seconds)
    assert residual[:200].mean() == pytest.approx(0.0, abs=0.5)
    assert residual[200:260].mean() == pytest.approx(300.0, abs=1.0)
    (begun, ended), = data['contacts']
    assert begun == pytest.approx(2.0, abs=0.1)
    assert ended == pytest.approx(2.6, abs=0.1)
    text = text_of(tmp_path / 'report.html')
    assert 'Measured against computed' in text
    assert 'Contact, most in' in text
    assert 'one sample' not in text
    write_measured(given, tmp_path / 'short.html', slice(200, 201))
    assert 'one sample' in text_of(tmp_path / 'short.html')


def test_each_color_is_declared_once() -> None:
    declared = [*LEG_COLORS, *ROLES.values()]
    assert len(declared) == len(set(declared))
    for file in (CONFIG.parent / 'stewart_dynamics').rglob('*.*'):
        if file.suffix in ('.py', '.js', '.css', '.html') and file.stem != 'colors':
            assert not re.search('(?<!&)#[0-9a-f]{3,8}\\b', file.read_text()), file


def test_every_section_with_tables_has_a_link_and_every_time_a_plot(tmp_path: Path) -> None:
    given = trajectory('singular')
    for name, write in (('plain', given.write),
                        ('measured', functools.partial(write_measured, given))):
        write(tmp_path / name)
        page = (tmp_path / name).read_text(encoding='utf-8')
        sections = set(re.findall(r'<section id="(\w+)"', page))
        links = set(re.findall(r'<a href="#(\w+)">', page.split('<nav>')[1].split('</nav>')[0]))
        assert links == sections - {'verdict', 'notices'}
        assert ('comparison' in links) is (name == 'measured')
        assert 'force_breakdown' in links
        plots = {plot['key'] for plot in data_of(tmp_path / name)['plots']}
        assert set(re.findall(r'data-plot="(\w+)"', page)) <= plots


def test_missing_plotly_is_reported_in_one_line(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch, snapshot: Snapshot) -> None:
    # an entry that is None is how Python itself marks a module that cannot be imported
    monkeypatch.setitem(sys.modules, 'plotly', None)
    plotly_script.cache_clear()
    path = tmp_path / 'report.html'
    with snapshot.raises(StewartError) as caught:
        Report(PARAMETERS).write_page(path, bag_summary())
    assert '\n' not in str(caught.value)
    assert not path.exists()


# ---- in a browser


@pytest.fixture(scope='module')
def page(browser: Browser) -> Page:
    """Return the one page: the next report in it finds plotly compiled."""
    page = browser.new_page()
    page.set_default_timeout(1000.0 * PATIENCE)
    return page


class Opened:
    """A report in the browser, and its errors."""

    def __init__(self, page: Page, path: Path) -> None:
        self.page = page
        self.faults: list[str] = []
        self.requests: list[str] = []
        self._listeners: dict[Any, Callable[[Any], None]] = {
            'pageerror': lambda error: self.faults.append(str(error)),
            'console': lambda message: self.faults.append(message.text)
            if message.type == 'error' else None,
            'request': lambda request: self.requests.append(request.url)}
        for event, listener in self._listeners.items():
            page.on(event, listener)
        page.set_viewport_size({'width': 1300, 'height': 900})
        page.emulate_media(media='screen')
        page.mouse.move(0, 0)
        self.url = path.as_uri()
        page.goto(self.url)

    def close(self) -> None:
        """Leave the page to the next report."""
        for event, listener in self._listeners.items():
            self.page.remove_listener(event, listener)

    def until(self, expression: str) -> None:
        """Wait until an expression is true; the page's policy forbids playwright's own way."""
        end = time.monotonic() + PATIENCE
        while not self.page.evaluate(expression):
            assert time.monotonic() < end, f'{expression} does not come true: {self.faults}'
            self.page.wait_for_timeout(20)

    @property
    def plots(self) -> list[str]:
        found: list[str] = self.page.evaluate('[...byCanvas.keys()].map(canvas => canvas.id)')
        return found

    def see(self, plot: str) -> None:
        """Scroll to a plot until it is drawn: others that are drawn meanwhile may move it away."""
        found = f'document.getElementById({plot!r})'
        self.until(f"({found}.scrollIntoView({{behavior: 'instant', block: 'center'}}), "
                   f'Boolean({found}._fullLayout))')

    def see_everything(self) -> None:
        for plot in self.plots:
            self.see(plot)

    def check(self) -> None:
        """There are no errors, and nothing but the file was loaded."""
        assert self.faults == []
        assert [url for url in self.requests if not url.startswith(('data:', 'blob:'))] == [
            self.url]


@pytest.fixture
def opened(page: Page, tmp_path: Path) -> Iterator[Callable[..., Opened]]:
    """Return a function that writes a report and opens it; its errors are those of the test."""
    with ExitStack() as stack:
        def begin(given: Given, write: Callable[[Path], Any] | None = None, checked: bool = True,
                  **changes: Any) -> Opened:
            path = tmp_path / 'report.html'
            (write or (lambda path: given.write(path, **changes)))(path)
            report = stack.enter_context(closing(Opened(page, path)))
            if checked:
                stack.callback(report.check)
            return report

        yield begin


def test_everything_is_drawn_without_an_error_or_the_network(
        opened: Callable[..., Opened]) -> None:
    given = trajectory('singular')
    report = opened(given, functools.partial(write_measured, given))
    report.see_everything()
    assert len(report.plots) == 23
    assert report.page.evaluate("document.querySelectorAll('#platform canvas').length") > 0


def joints_shown(report: Opened) -> Array:
    """Return the platform joints in the picture (6, 3)."""
    return np.array(report.page.evaluate(
        "(() => { const trace = document.getElementById('platform').data[4];"
        ' return [0, 1, 2, 3, 4, 5].map(n => [trace.x[n], trace.y[n], trace.z[n]]); })()'))


def joints_of(given: Given, sample: int) -> Array:
    motion = given.motions[sample]
    joints: Array = motion[:3] + PARAMETERS['geometry.platform_joints'] @ motion[3:12].reshape(
        3, 3).T
    return joints


def test_the_slider_moves_platform_colors_and_cursor(opened: Callable[..., Opened]) -> None:
    given = trajectory('clear')
    report = opened(given)
    report.see('platform')
    np.testing.assert_allclose(joints_shown(report), joints_of(given, 0), atol=1e-12)
    for sample in (437, 1000):
        report.page.locator('#slider').fill(str(given.seconds[sample] + 0.002))
        report.see('platform')
        report.until(f'player.frame === {sample} && !player.busy')
        np.testing.assert_allclose(joints_shown(report), joints_of(given, sample), atol=1e-12)
        colors = report.page.evaluate("document.getElementById('platform').data[5].line.color")
        np.testing.assert_allclose(colors[::3], given.outputs.demanded_efforts[sample])
        report.see('plot_force')
        report.until("document.querySelector('#plot_force .cursor').style.display === 'block'")
        place = report.page.evaluate(
            "parseFloat(document.querySelector('#plot_force .cursor').style.left)")
        axis = report.page.evaluate(
            '(({_offset, _length}) => [_offset, _length])'
            "(document.getElementById('plot_force')._fullLayout.xaxis)")
        assert place == pytest.approx(axis[0] + axis[1] * sample / 1000, abs=1.5)
        shown = report.page.locator('.plot:has(#plot_force) .readout td').all_inner_texts()
        np.testing.assert_allclose(
            [float(text.replace('−', '-').replace('\u202f', '')) for text in shown],
            given.outputs.demanded_efforts[sample], rtol=1e-4)


def test_playing_runs_to_the_end_of_the_motion(opened: Callable[..., Opened]) -> None:
    given = trajectory('clear')
    report = opened(given)
    report.see('platform')
    report.page.select_option('#speed', '5')
    report.page.locator('#play').click()
    report.until('playing.since === null && time.cursor === report.end')
    report.until('player.frame === 1000 && !player.busy')
    np.testing.assert_allclose(joints_shown(report), joints_of(given, 1000), atol=1e-12)


def test_zooming_one_plot_zooms_all(opened: Callable[..., Opened]) -> None:
    report = opened(trajectory('singular'))
    ranges = "document.getElementById('plot_{}')._fullLayout.xaxis.range"
    for plot in ('rate', 'length', 'force'):  # one is drawn already, one is not yet
        if plot != 'length':
            report.see(f'plot_{plot}')
    box = report.page.locator('#plot_force').bounding_box()
    assert box is not None
    mouse = report.page.mouse
    mouse.move(box['x'] + 300, box['y'] + 120)
    mouse.down()
    mouse.move(box['x'] + 500, box['y'] + 122, steps=5)
    mouse.up()
    report.until(f'{ranges.format("force")}[0] > 0.5')
    zoomed = report.page.evaluate(ranges.format('force'))
    assert 0.5 < zoomed[0] < zoomed[1] < 9.5
    for plot in ('rate', 'length', 'position', 'force_breakdown'):
        report.see(f'plot_{plot}')
        report.until(f'sameRange({ranges.format(plot)}, {zoomed})')
    report.page.locator('#whole').click()
    report.until(f'sameRange({ranges.format("force_breakdown")}, [0, 10])')
    report.see('plot_force')
    report.until(f'sameRange({ranges.format("force")}, [0, 10])')


def test_a_spike_does_not_set_the_scale_and_the_full_range_can_be_shown(
        opened: Callable[..., Opened]) -> None:
    given = trajectory('singular')
    report = opened(given)
    report.see('plot_force')
    extent = "document.getElementById('plot_force')._fullLayout.yaxis.range"
    most = float(np.abs(given.outputs.demanded_efforts).max())
    low, high = report.page.evaluate(extent)
    assert 6000.0 < max(-low, high) < 0.05 * most
    report.page.locator('.plot:has(#plot_force) .tools button').click()
    report.until(f'Math.max(...{extent}.map(Math.abs)) >= {most}')
    drawn = report.page.evaluate(
        "Math.max(...document.getElementById('plot_force').data.flatMap("
        'trace => Array.from(trace.y, Math.abs)))')
    assert drawn == np.float32(most)


def test_a_click_on_a_time_scrolls_to_its_plot(opened: Callable[..., Opened]) -> None:
    report = opened(trajectory('singular'))
    report.see('plot_length')
    report.page.evaluate('zoomTo([1.0, 2.0])')
    button = report.page.locator('#peaks button.at').nth(1)
    when = float(button.get_attribute('data-at') or '')
    assert when > 2.0
    button.click()
    report.until("inView.has(byCanvas.get(document.getElementById('plot_force')))")
    report.until("(() => { const box = document.getElementById('plot_force')"
                 '.getBoundingClientRect();'
                 ' return box.top >= 0 && box.bottom <= innerHeight; })()')
    assert report.page.evaluate('time.cursor') == when
    report.until(f"document.getElementById('now').textContent.startsWith('t = {when:.3f} s')")
    begin, end = report.page.evaluate('time.range')
    assert begin < when < end and end - begin == pytest.approx(1.0)


def test_hover_shows_the_time_at_the_cursor_of_every_plot(opened: Callable[..., Opened]) -> None:
    report = opened(trajectory('clear'))
    report.see('plot_position')
    report.see('plot_length')
    box = report.page.locator('#plot_length .nsewdrag').first.bounding_box()
    assert box
    report.page.mouse.move(box['x'] + 0.25 * box['width'], box['y'] + 0.5 * box['height'])
    shown = "document.querySelector('#plot_length .cursor span').textContent"
    report.until(f'Math.abs(parseFloat({shown}) - 2.5) < 0.05')
    assert report.page.evaluate('time.cursor') == 0.0
    report.page.mouse.move(5, 5)
    report.until(f"{shown} === '0.000 s'")


def test_nothing_is_wider_than_a_phone_or_paper(opened: Callable[..., Opened]) -> None:
    given = trajectory('clear')
    report = opened(given, functools.partial(write_measured, given))
    report.page.set_viewport_size({'width': 390, 'height': 800})
    report.see('platform')
    assert report.page.evaluate('document.documentElement.scrollWidth') == 390
    box = report.page.locator('#platform').bounding_box()
    scene = report.page.locator('#platform .svg-container').bounding_box()
    assert box and scene
    assert scene['width'] <= box['width'] <= 390
    report.page.set_viewport_size({'width': 696, 'height': 1000})
    report.page.emulate_media(media='print')
    report.page.evaluate("window.dispatchEvent(new Event('beforeprint'))")
    report.until('[...byCanvas.values()].every(drawing => drawing.drawn)')
    assert report.page.evaluate('document.documentElement.scrollWidth') == 696


def test_the_tables_of_the_motors_fit_and_columns_have_one_number_of_decimals(
        opened: Callable[..., Opened]) -> None:
    report = opened(trajectory('clear', PARAMETERS.replaced({
        'actuator.reflected_mass': None, 'actuator.screw_lead': 0.01, 'drive.motor_inertia': 5e-5,
        'drive.torque_max': 20.0, 'drive.torque_continuous': 9.0, 'drive.speed_max': 900.0,
        'drive.torque_constant': 0.35, 'drive.resistance': 1.5, 'drive.thermal_resistance': 0.9,
        'drive.thermal_time_constant': 90.0, 'drive.temperature_rise_max': 80.0})))
    report.page.set_viewport_size({'width': 1280, 'height': 800})
    assert report.page.evaluate(
        "[...document.querySelectorAll('#drives .scroll')].every("
        'box => box.scrollWidth <= box.clientWidth)')
    tables = report.page.locator('#drives table').filter(has_text='Motor').all()[:2]
    for table in tables:
        rows = [row.locator('td').all_inner_texts() for row in table.locator('tbody tr').all()]
        assert len(rows) == len(rows[0]) == 6
        for cells in zip(*rows, strict=True):
            assert len({len(cell.partition('.')[2]) for cell in cells}) == 1


def test_paper_shows_the_whole_hexapod(opened: Callable[..., Opened]) -> None:
    report = opened(trajectory('clear'))
    report.see('platform')
    eye = "document.getElementById('platform').layout.scene.camera.eye"
    before = report.page.evaluate(eye)
    for event, factor in (('beforeprint', 1.44), ('afterprint', 1.0)):
        report.page.evaluate(f"window.dispatchEvent(new Event('{event}'))")
        report.until('[...byCanvas.values()].every(drawing => drawing.drawn)')
        assert report.page.evaluate(eye) == pytest.approx(
            {axis: factor * value for axis, value in before.items()})
    # Names of parameters break between their words.
    assert 'limits.<wbr>force_<wbr>max' in report.page.inner_html('#parameters')


def test_reports_share_a_file_of_plotly(opened: Callable[..., Opened], tmp_path: Path) -> None:
    given = trajectory('clear')
    shared = share_plotly(tmp_path / 'all bags')
    assert share_plotly(tmp_path / 'all bags') == shared

    def write(path: Path) -> None:
        given.report().write_page(path, given.summary(), shared)

    report = opened(given, write, checked=False)
    assert (tmp_path / 'report.html').stat().st_size < 2_000_000
    report.see('plot_force')
    assert report.faults == []
    assert report.requests == [report.url, shared.as_uri()]
    shared.rename(tmp_path / 'moved')
    report.page.reload()
    report.until("document.getElementById('plots').textContent.includes('need the file plotly')")


def test_the_leg_can_be_selected_and_a_curve_hidden(opened: Callable[..., Opened]) -> None:
    given = trajectory('clear')
    report = opened(given)
    report.see('plot_force_breakdown')
    plot = report.page.locator('.plot:has(#plot_force_breakdown)')
    plot.locator('select').select_option(label='leg_4')
    first = "document.getElementById('plot_force_breakdown').data[0].y[0]"
    report.until(f'{first} === {float(np.float32(given.outputs.demanded_efforts[0, 3]))!r}')
    plot.locator('.readout button').nth(1).click()
    report.until("document.getElementById('plot_force_breakdown').data[1].visible === false")


def test_a_spectrum_has_its_own_axes_and_values_at_its_cursor(
        opened: Callable[..., Opened]) -> None:
    report = opened(moving())
    report.see('plot_base_force_spectrum')
    canvas = "document.getElementById('plot_base_force_spectrum')"
    axes = report.page.evaluate(
        f'(() => {{ const {{xaxis, yaxis}} = {canvas}._fullLayout; return [xaxis.type, yaxis.type,'
        ' xaxis.title.text, yaxis.title.text, ...xaxis.range]; })()')
    assert axes[:4] == ['log', 'log', 'frequency [Hz]', '[N/√Hz]']
    assert axes[5] == pytest.approx(np.log10(50.0))
    readout = report.page.locator('.plot:has(#plot_base_force_spectrum) .readout')
    assert readout.locator('thead').inner_text().startswith('highest')
    assert ' at ' in readout.locator('tbody td').nth(2).inner_text()
    # the zoom of the plots over time is not that of the spectra
    report.page.evaluate('zoomTo([1, 2])')
    report.see('plot_base_moment')
    report.until("document.getElementById('plot_base_moment')._fullLayout.xaxis.range[1] === 2")
    assert report.page.evaluate(f'{canvas}._fullLayout.xaxis.range[1]') == axes[5]
    report.see('plot_base_force_spectrum')
    box = report.page.locator('#plot_base_force_spectrum .nsewdrag').bounding_box()
    assert box is not None
    at = (np.log10(5.0) - axes[4]) / (axes[5] - axes[4])
    report.page.mouse.move(box['x'] + at * box['width'], box['y'] + 0.5 * box['height'])
    report.until('pointedAt !== null')
    assert report.page.evaluate('pointedAt') == pytest.approx(5.0, rel=0.05)
    assert readout.locator('thead').inner_text().startswith('at the cursor')
    shown = float(readout.locator('tbody td').nth(2).inner_text().replace('\u202f', ''))
    assert shown > 100.0
    cursor = report.page.locator('#plot_base_force_spectrum .cursor')
    assert cursor.inner_text().endswith(' Hz')
    report.page.mouse.move(5, 5)
    report.until('pointedAt === null')
    assert not cursor.is_visible()
    # one component alone: the weight does not hide it
    plot = report.page.locator('.plot:has(#plot_base_force)')
    report.see('plot_base_force')
    plot.locator('select').select_option(label='F x')
    report.until("document.getElementById('plot_base_force').data.length === 1")


def test_a_single_setpoint(opened: Callable[..., Opened]) -> None:
    whole = trajectory('clear')
    report = opened(Given(whole.seconds[:1], whole.motions[:1]))
    report.see_everything()
    report.see('plot_force')
    points = report.page.evaluate("document.querySelectorAll('#plot_force path.point').length")
    assert points == 6
    report.page.locator('#play').click()
    report.until('playing.since === null')


def test_poses_that_cannot_be_solved_leave_gaps(opened: Callable[..., Opened]) -> None:
    whole = trajectory('clear')
    motions = whole.motions.copy()
    motions[300:400] = 0.0
    motions[300:400, 3:12] = np.eye(3).ravel()
    given = Given(whole.seconds, motions)
    assert np.isnan(given.outputs.demanded_efforts[300:400]).all()
    report = opened(given)
    report.see_everything()
    report.page.locator('#slider').fill('3.5')
    report.see('platform')
    report.until("player.legValues[0][0].textContent === 'none'")
    report.see('plot_force')
    missing = report.page.evaluate(
        "Array.from(document.getElementById('plot_force').data[0].y, Number.isNaN)")
    assert np.flatnonzero(missing).tolist() == list(range(300, 400))


def test_without_any_setpoint(opened: Callable[..., Opened]) -> None:
    report = opened(Given(np.empty(0), np.empty((0, 24))),
                    missing=['no setpoint could be answered'])
    report.until("document.getElementById('plots').textContent.includes('there are no plots')")
    assert 'no setpoint could be answered' in report.page.inner_text('#verdict')


@pytest.mark.slow
def test_hostile_names_are_shown_and_not_executed(opened: Callable[..., Opened]) -> None:
    given = trajectory('clear', PARAMETERS.replaced({'joints': list(HOSTILE)}))
    report = opened(given, bag=f'/a/{HOSTILE[1]}', notices=list(HOSTILE))
    report.see_everything()
    report.page.locator('#slider').fill('5')
    report.see('platform')
    report.until('player.frame === player.wanted && !player.busy')
    assert report.page.evaluate('window.hacked') is None
    assert report.page.evaluate("document.querySelectorAll('img, b b').length") == 0
    for name in HOSTILE:
        assert name in report.page.inner_text('#peaks')
        assert name in report.page.locator('.plot:has(#plot_force) .readout').inner_text()
