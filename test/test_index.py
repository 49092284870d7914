# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


"""The table of many bags: fleet.csv as other programs read it, index.html in a browser."""

from __future__ import annotations

from collections.abc import Iterator
import csv
from pathlib import Path
import re
from typing import Any, TYPE_CHECKING

from bag_summaries import bag_summary
import pytest

from stewart_dynamics.legs import TELESCOPIC
from stewart_dynamics.replay.bag_summary import BagSummary
from stewart_dynamics.replay.index import columns_of, row_of, write_fleet

if TYPE_CHECKING:
    from playwright.sync_api import Browser

COLUMNS = columns_of(TELESCOPIC)

HOSTILE = ['<img src=x onerror=alert(1)>', '</script><script>alert(2)</script>',
           '"><svg onload=alert(3)>', "'-alert(4)-'", 'javascript:alert(5)', '&lt;b&gt; &amp;',
           '=1+1', '+1', '-1', '@SUM(A1)', '=HYPERLINK("http://x.invalid");a', 'a"b,c;d\ne',
           '\tx', '<!-- <script>', 'caf\udce9', '℃ 50 %20#?.mcap', 'SHA256 FLEET']


POINTS = {'answered': 1000, 'duration_s': 10.0, 'base_unknown': 0, 'gaps': 0, 'restarts': 0,
          'jumps': 0}
UNANSWERED = {**POINTS, 'answered': 0, 'duration_s': 0.0}
NEAR = {'determinant_nearest_m3': 0.25, 'determinant_nearest_at_s': 1.0, 'crossings': 0,
        'crossings_at_s': [], 'condition_max': 4.5, 'condition_max_at_s': 1.0, 'warnings': 0,
        'warnings_from_to_s': [], 'warning_s': 0.0, 'unsolved': 0, 'suppressed': 0}


def summary(peaks: list[float | None], **changes: Any) -> BagSummary:
    """Return a summary with these forces [N]."""
    legs = {f'leg_{n}': {
        'force_peak_n': peak, 'force_peak_at_s': n * 1.0,
        'force_margin_n': None if peak is None else 100.0 - abs(peak),
        'length_margin_m': None, 'rate_margin_m_s': 0.1 * n,
        **{f'{joint}_joint_angle_{key}': None for joint in ('base', 'platform')
           for key in ('max_rad', 'max_at_s', 'margin_rad')},
        'joint_force_peak_n': peak, 'joint_force_margin_n': None,
        'clearance_min_m': None, 'clearance_min_at_s': None, 'clearance_margin_m': None,
        'force_rms_n': None if peak is None else 0.5 * abs(peak),
        'power_peak_w': None if peak is None else -peak} for n, peak in enumerate(peaks)}
    return bag_summary({'software': 'stewart_dynamics 9', 'setpoints': POINTS, 'legs': legs,
                        'singularity': NEAR}, **changes)


def exceeded(limit: str, leg: str) -> dict[str, Any]:
    return {'limit': f'limits.{limit}', 'leg': leg, 'bound': 1.0, 'worst': 2.0, 'first_at_s': 3.0}


def rejected(*counts: int) -> list[dict[str, Any]]:
    return [{'topic': 'setpoint/pose', 'reason': f'reason {n}', 'count': count}
            for n, count in enumerate(counts)]


def row(bag: str, code: int = 0, of: BagSummary | None = None, error: str = '',
        results: str | None = None) -> dict[str, Any]:
    return {**row_of(code, of, error), 'bag': bag, 'results': results}


def table(folder: Path) -> list[dict[str, str]]:
    with (folder / 'fleet.csv').open(newline='', encoding='utf-8') as file:
        return list(csv.DictReader(file))


# fleet.csv

def test_a_row_has_the_worst_of_all_legs(tmp_path: Path) -> None:
    limits = [exceeded('length_max', 'leg_2'), exceeded('force_max', 'leg_1'),
              exceeded('force_max', 'leg_3'),
              exceeded('', 'leg_1') | {'limit': 'drive.torque_max'}]
    write_fleet(tmp_path, [row('a', 1, summary(
        [3.0, -120.5, 7.0, 120.0], limits=limits, rejected=rejected(3, 4),
        singularity={**NEAR, 'determinant_nearest_m3': -1e-7, 'crossings': 2,
                     'crossings_at_s': [1.0, 2.0], 'condition_max': 8e3, 'warnings': 1,
                     'warnings_from_to_s': [[0.5, None]]}), results='deep/a')])
    assert table(tmp_path) == [{
        'bag': 'a', 'code': '1', 'result': 'limit or warning', 'complete': 'true',
        'setpoints': '1000', 'duration_s': '10.0', 'force_worst_n': '-120.5',
        'force_worst_leg': 'leg_1',
        'force_worst_at_s': '1.0', 'force_margin_n': '-20.5', 'length_margin_m': '',
        'rate_margin_m_s': '0.0', 'base_joint_angle_margin_rad': '',
        'platform_joint_angle_margin_rad': '', 'clearance_margin_m': '',
        'limits_exceeded': 'length_max: leg_2; force_max: leg_1, leg_3; '
                           'drive.torque_max: leg_1',
        'force_rms_n': '60.25', 'power_peak_w': '120.5', 'determinant_nearest_m3': '-1e-07',
        'crossings': '2', 'condition_max': '8000.0', 'warnings': '1', 'rejected': '7',
        'reason': 'limits.length_max, 1 m, exceeded by leg_2: 2 m at worst, first at t = 3.00 s; '
                  'limits.force_max, 1 N, exceeded by leg_1 and 1 other leg: 2 N at worst, first '
                  'at t = 3.00 s; drive.torque_max, 1 N m, exceeded by leg_1: 2 N m at worst, '
                  'first at t = 3.00 s; det(J) crossed zero at t = 1.00 s and 1 time more: forces '
                  'grow without bound there; singularity warning at t = 0.50 s, 0.50 s before the '
                  'crossing, for 0.00 s in all; setpoint/pose: 4 rejected: reason 1; '
                  'setpoint/pose: 3 rejected: reason 0',
        **{column.key: '' for column in COLUMNS if column.optional and column.key not in (
            'base_joint_angle_margin_rad', 'platform_joint_angle_margin_rad',
            'clearance_margin_m')}, 'results': 'deep/a'}]


def test_results_without_answers_have_their_own_word(tmp_path: Path) -> None:
    unanswered = summary([None] * 6, setpoints=UNANSWERED, rejected=[
        {'topic': 'setpoint/pose', 'reason': reason, 'count': count}
        for reason, count in (('wrong frame_id', 2), ('not finite', 900))])
    write_fleet(tmp_path, [row('a', 3, unanswered, 'no setpoint could be answered'),
                           row('b', 3, summary([1.0]), 'cut off')])
    assert [(cells['result'], cells['reason']) for cells in table(tmp_path)] == [
        ('nothing answered', 'no setpoint could be answered; setpoint/pose: 900 rejected: not '
                             'finite; setpoint/pose: 2 rejected: wrong frame_id'),
        ('incomplete', 'cut off')]


@pytest.mark.parametrize(('counts', 'code', 'result', 'reason'), [
    ([10], 0, 'done', 'setpoint/pose: 10 rejected: reason 0'),
    ([6, 5], 0, 'messages rejected', 'setpoint/pose: 6 rejected: reason 0; setpoint/pose: 5 '
                                     'rejected: reason 1'),
    ([900], 1, 'limit or warning', 'setpoint/pose: 900 rejected: reason 0'),
    ([5, 4, 3, 2, 1], 0, 'messages rejected', '; '.join(
        f'setpoint/pose: {5 - n} rejected: reason {n}' for n in range(3))
        + '; 3 not used for other reasons')])
def test_rejected_messages_are_a_reason(
        counts: list[int], code: int, result: str, reason: str, tmp_path: Path) -> None:
    write_fleet(tmp_path, [row('a', code, summary([1.0], rejected=rejected(*counts)))])
    cells, = table(tmp_path)
    assert (cells['result'], cells['reason']) == (result, reason)
    assert cells['code'] == f'{code}'


def test_a_row_has_the_result_of_the_comparison_with_measured_forces(tmp_path: Path) -> None:
    measured = {
        'setpoints_compared': 9, 'headline': 'they differ', 'residual_share': 0.25,
        'contacts': {'count': 2, 'strongest': [{
            'from_s': 0.0, 'to_s': 1.0, 'axis': 'force_x', 'force_n': [], 'moment_n_m': []}]},
        'legs': {f'leg_{n}': {'residual_rms_n': 10.0 * n} for n in range(6)}}
    write_fleet(tmp_path, [row('a', 0, summary([1.0], measured=measured)), row('b')])
    cells, without = table(tmp_path)
    keys = [column.key for column in COLUMNS if column.optional]
    assert [cells[key] for key in keys[-4:]] == ['50.0', '0.25', '2', 'they differ']
    assert {*(cells[key] for key in keys[:-4]), *(without[key] for key in keys)} == {''}


def test_a_bag_without_numbers_has_empty_cells(tmp_path: Path) -> None:
    nothing = summary([None] * 6, setpoints=UNANSWERED, singularity={**NEAR, **dict.fromkeys((
        'determinant_nearest_m3', 'determinant_nearest_at_s', 'condition_max',
        'condition_max_at_s'))})
    write_fleet(tmp_path, [row('none', 0, nothing, results='none'), row('bad', 2, None, 'why')])
    none, bad = table(tmp_path)
    assert (none['force_worst_n'], none['force_worst_leg'], none['condition_max']) == ('',) * 3
    assert {key: cell for key, cell in bad.items() if cell} == {
        'bag': 'bad', 'code': '2', 'result': 'failed', 'reason': 'why'}


def test_no_cell_is_a_formula_or_is_split(tmp_path: Path) -> None:
    write_fleet(tmp_path, [row(name, 2, None, name) for name in HOSTILE])
    rows = table(tmp_path)
    assert len(rows) == len(HOSTILE)
    for name, cells in zip(HOSTILE, rows, strict=True):
        name = name.encode('utf-8', 'backslashreplace').decode()
        assert not re.match(r'[=+@\t\r\n-]', cells['bag'] + cells['reason'])
        # the same path, and the same words
        assert cells['bag'] in (name, f'./{name}')
        assert cells['reason'] in (name, f"'{name}")
    # no text stands outside quotes, where a semicolon would end a cell
    text = (tmp_path / 'fleet.csv').read_text(encoding='utf-8')
    assert not set(re.sub(r'"(?:[^"]|"")*"', '', text)) - set('0123456789.,\r\n')


# index.html

class Page:
    """The page in a browser, with its errors."""

    def __init__(self, page: Any) -> None:
        self.page = page
        self.errors: list[str] = []
        self.requests: list[str] = []
        page.on('console', lambda message: self.errors.append(message.text))
        page.on('pageerror', lambda error: self.errors.append(f'{error}'))
        page.on('request', lambda request: self.requests.append(request.url))
        page.on('dialog', lambda dialog: (self.errors.append(dialog.message),
                                          dialog.dismiss()))

    def show(self, folder: Path, rows: list[dict[str, Any]]) -> None:
        write_fleet(folder, rows)
        self.page.goto((folder / 'index.html').as_uri())

    def column(self, head: str) -> list[str]:
        """Return the texts of a column, from above."""
        texts: list[str] = self.page.eval_on_selector_all(
            'tbody tr', '(lines, n) => lines.map((line) => line.children[n]?.innerText ?? "")',
            self._number(head))
        return texts

    def sort(self, head: str) -> str:
        self.page.click(f'th:nth-child({self._number(head) + 1}) button')
        order: str = self.page.get_attribute(
            f'th:nth-child({self._number(head) + 1})', 'aria-sort')
        return order

    @staticmethod
    def _number(key: str) -> int:
        return [column.key for column in COLUMNS if column.head].index(key)


@pytest.fixture
def page(browser: Browser) -> Iterator[Page]:
    """Return a page that must have no errors and load nothing but itself."""
    context = browser.new_context(viewport={'width': 1500, 'height': 800})
    made = Page(context.new_page())
    yield made
    context.close()
    assert made.errors == []
    assert {url.rpartition('/')[2] for url in made.requests} <= {'index.html', 'report.html'}


PEAKS = [9.0, -100.0, None, 20.5, -3.0, 1000.0]


def six() -> list[dict[str, Any]]:
    names = ['b', 'a10', 'a9', 'C', 'd', 'e']
    codes = [0, 1, 2, 3, 0, 1]
    return [row(name, code, None if peak is None else summary([peak], limits=[
        exceeded('force_max', 'leg_0')] if abs(peak) >= 100 else []),
        'some words' if code in (2, 3) else '', None if code == 2 else name)
        for name, code, peak in zip(names, codes, PEAKS, strict=True)]


def test_a_click_on_a_head_sorts(page: Page, tmp_path: Path) -> None:
    page.show(tmp_path, six())
    assert page.column('bag') == ['b', 'a10', 'a9', 'C', 'd', 'e']
    # by size, not as text; empty cells last
    assert page.sort('force_worst_n') == 'ascending'
    assert page.column('bag') == ['d', 'b', 'C', 'a10', 'e', 'a9']
    assert page.column('force_worst_n')[:5] == [
        '−3.00', '9.00', '20.50', '−100.00', '1\u202f000.00']
    assert page.sort('force_worst_n') == 'descending'
    assert page.column('bag') == ['e', 'a10', 'C', 'b', 'd', 'a9']
    # the least margin, with its sign, is the worst
    page.sort('force_margin_n')
    assert page.column('bag') == ['e', 'a10', 'C', 'b', 'd', 'a9']
    assert page.column('force_margin_n')[0] == '−900.00'
    # numbers in names in their order
    page.sort('bag')
    assert page.column('bag') == ['a9', 'a10', 'b', 'C', 'd', 'e']
    # results by severity; equal ones in the order of the table
    page.sort('result')
    page.sort('result')
    assert page.column('bag') == ['a9', 'C', 'a10', 'e', 'b', 'd']
    assert page.page.locator('th[aria-sort]').count() == 1


def test_absolute_and_relative_names_have_no_common_folder(page: Page, tmp_path: Path) -> None:
    page.show(tmp_path, [row('/a/b'), row('c/d')])
    assert page.column('bag') == ['/a/b', 'c/d']


def test_totals_are_those_of_all_bags(page: Page, tmp_path: Path) -> None:
    """Also with cranks; bags that failed are left out."""
    cranks = {'torque_worst_n_m': -3.5, 'torque_worst_leg': 'leg_2', 'setpoints': 2000,
              'duration_s': 90.0, 'determinant_nearest_m3': -0.25}
    for rows, told in (
            (six(), 'bags 6 setpoints 5 000 recorded 50.0 s worst force 1 000 N leg_0, e '
                    'det(J) nearest 0 0.25 m³ b'),
            ([row(f'/of/{name}', 0) | cranks for name in 'ab'],
             'bags 2 setpoints 4 000 recorded 3.0 min worst torque −3.5 N m leg_2, a '
             'det(J) nearest 0 −0.25 m³ a')):
        page.show(tmp_path, rows)
        assert ' '.join(page.page.inner_text('dl').split()) == told


def test_failed_bags_and_exceeded_limits_are_highlighted(page: Page, tmp_path: Path) -> None:
    page.show(tmp_path, six())

    def color(selector: str) -> list[int]:
        text = page.page.eval_on_selector(selector, 'it => getComputedStyle(it).color')
        return [int(number) for number in re.findall(r'\d+', text)]

    for selector in ('tr:nth-child(2) td.limits_exceeded', 'tr:nth-child(3) .pill',
                     'tr:nth-child(3) td.reason', 'tr:nth-child(4) td.reason',
                     'tr:nth-child(6) td.bad'):
        red, green, blue = color(f'tbody {selector}')
        assert red > 2 * max(green, blue), selector
    # the error of a failed bag is beside its name, in place of its numbers
    assert page.page.inner_text('tbody tr:nth-child(3) td:nth-child(3)') == 'some words'


def test_reasons_are_visible_at_1440_pixels(page: Page, tmp_path: Path) -> None:
    limits = [exceeded(limit, f'leg_{n}') for n in range(6)
              for limit in ('length_max', 'force_max', 'velocity_max')]
    long = 'a_recording_with_a_long_name/of_a_long_day'
    reason = 'part of it could not be read: ' + '; '.join(
        f'the chunk at byte {n}' for n in range(9))
    page.page.set_viewport_size({'width': 1440, 'height': 800})
    page.show(tmp_path, [
        row(f'{long}/limits', 1, summary([1.0], limits=limits)),
        row(f'{long}/damaged', 3, summary([1.0]), reason), row(f'{long}/failed', 2, None, reason),
        row(f'{long}/rejected', 3, summary([None], setpoints=UNANSWERED),
            'no setpoint could be answered')])
    boxes = page.page.eval_on_selector_all(
        'td.reason div', 'all => all.map((it) => it.getBoundingClientRect().right)')
    assert len(boxes) == 4
    assert max(boxes) < 1440
    assert page.page.locator('nav button').all_inner_texts() == [
        'all 4', 'limit or warning 1', 'incomplete 1', 'nothing answered 1', 'failed 1']
    # and on A4 across, with margins of 10 mm, all columns
    page.page.set_viewport_size({'width': 1047, 'height': 700})
    page.page.emulate_media(media='print')
    assert page.page.eval_on_selector('table', 'it => it.getBoundingClientRect().right') <= 1047


@pytest.mark.parametrize('width', [1440, 390])
def test_names_are_cut_at_their_beginning(page: Page, tmp_path: Path, width: int) -> None:
    folder = '/a_folder/of_all_bags/'
    names = [f'{"long_" * 30}{n}/bag_{n}.mcap' for n in range(2)] + ['short']
    page.page.set_viewport_size({'width': width, 'height': 600})
    page.show(tmp_path, [row(f'{folder}{name}', 0, summary([1.0], rejected=rejected(500 * n)),
                             results=None if n else 'x') for n, name in enumerate(names)])
    cells = page.page.locator('tbody td:first-child')
    # without the folder of all of them, which is above
    assert cells.all_text_contents() == names
    assert page.page.inner_text('#software').endswith(f'bags in {folder}')
    assert cells.first.get_attribute('title') == f'{folder}{names[0]}'
    for n in range(3):
        cell = cells.nth(n).bounding_box()
        name = cells.nth(n).locator(':is(a, bdi)').bounding_box()
        assert name['x'] + name['width'] <= cell['x'] + cell['width']
    assert page.page.evaluate('document.documentElement.scrollWidth') <= width
    # many rejected messages are not green
    assert page.page.locator('tr.code0').count() == 1
    assert page.page.locator('tr.code1 .pill').all_inner_texts() == ['messages rejected'] * 2


def test_rows_are_filtered_by_result_and_by_text(page: Page, tmp_path: Path) -> None:
    page.show(tmp_path, six())
    buttons = page.page.locator('nav button')
    assert buttons.all_inner_texts() == ['all 6', 'done 2', 'limit or warning 2', 'incomplete 1',
                                         'failed 1']
    page.page.click('nav button:nth-child(3)')
    assert page.column('bag') == ['a10', 'e']
    page.page.fill('#filter', 'A1')
    assert page.column('bag') == ['a10']
    assert page.page.inner_text('#shown') == '1 of 6'
    page.page.click('nav button:nth-child(1)')
    page.page.fill('#filter', 'some WORDS')
    assert page.column('bag') == ['a9', 'C']
    page.page.fill('#filter', '')
    assert len(page.column('bag')) == 6
    assert page.page.inner_text('#shown') == ''


def test_hostile_names_are_text(page: Page, tmp_path: Path) -> None:
    page.show(tmp_path, [
        *(row(name, 2, None, name) for name in HOSTILE),
        *(row(name, 0, summary([1.0]), results=name.replace('/', '_')) for name in HOSTILE)])
    shown = page.page.eval_on_selector_all(
        'tbody tr td:first-child', 'cells => cells.map((cell) => cell.textContent)')
    assert shown == HOSTILE * 2
    for name in HOSTILE:
        page.page.fill('#filter', name.replace('\udce9', '').replace('\n', ''))
    page.page.fill('#filter', '')
    page.sort('bag')
    assert page.page.locator('main :is(img, svg, script, b)').count() == 0


def test_rows_link_to_reports(page: Page, tmp_path: Path) -> None:
    names = [name.replace('/', '_') for name in HOSTILE] + ['deep/er/x']
    for name in names:
        (tmp_path / name).mkdir(parents=True)
        (tmp_path / name / 'report.html').write_text(f'<title>{names.index(name)}</title>')
    (tmp_path / 'no report').mkdir()
    page.show(tmp_path, [row(name, 0, summary([1.0]), results=name)
                         for name in [*names, 'no report']])
    *links, folder = page.page.eval_on_selector_all('tbody a', 'all => all.map(a => a.href)')
    for n, link in enumerate(links):
        page.page.goto(link)
        assert page.page.title() == f'{n}'
    assert len(links) == len(names)
    assert folder == (tmp_path / 'no report').as_uri()


@pytest.mark.slow
def test_thousands_of_bags(page: Page, tmp_path: Path) -> None:
    page.show(tmp_path, [row(f'{n}', 0, summary([float(n % 997)])) for n in range(1500)])
    # the page is small, and the rows are not drawn all at once
    assert (tmp_path / 'index.html').stat().st_size < 300_000
    assert 50 < len(page.column('bag')) < 500
    page.page.fill('#filter', '1499')
    assert page.column('bag') == ['1499']
    page.page.fill('#filter', '')
    page.sort('force_worst_n')
    page.sort('force_worst_n')
    assert page.column('bag')[:5] == ['996', '995', '994', '993', '992']
    # the last row can be scrolled to
    for _ in range(100):
        if len(page.column('bag')) == 1500:
            break
        page.page.evaluate(
            'new Promise((done) => { const main = document.querySelector("main");'
            'main.addEventListener("scroll", done, {once: true});'
            'main.scrollTop = main.scrollHeight; })')
    assert len(page.column('bag')) == 1500
    assert page.column('bag')[-1] == '997'
