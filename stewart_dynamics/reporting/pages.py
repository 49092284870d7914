# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


"""
HTML pages from the templates in this package, by Jinja2 with autoescaping.

A page contains its style and scripts; its content security policy allows no other scripts, by
their digests. Names given by users are text, never markup.
"""

from __future__ import annotations

import base64
from collections.abc import Iterable, Mapping, Sequence
import functools
import hashlib
import importlib.util
import json
import math
import os
from pathlib import Path
from typing import Any
from urllib.parse import quote

from jinja2 import Environment, FileSystemLoader, StrictUndefined
import numpy as np
from numpy.typing import ArrayLike
from stewart_dynamics.colors import custom_properties
from stewart_dynamics.errors import StewartError
from stewart_dynamics.whole_file import plain, to_json

_SHARED = Path(__file__).with_name('templates')

# Between thousands: a narrow space that does not break, as SI recommends.
_THIN_SPACE = '\u202f'
# From here on, numbers are written with a power of ten.
MOST_PLAIN = 1e10


def number(value: float | None, decimals: int) -> str:
    """Return a number with a given number of decimals, without decimals from 1e5 on."""
    if value is None or not math.isfinite(value):
        return '–'
    return typeset(f'{value:,.{decimals}f}') if abs(value) < 1e5 else digits(value)


def fixed(value: float, decimals: int) -> str:
    """Return a number with a given number of decimals for a text, large ones in five digits."""
    return f'{value:.{decimals}f}' if abs(value) < MOST_PLAIN else f'{value:.5g}'


def digits(value: float | None) -> str:
    """Return a number with five digits, or all digits before the point."""
    if value is None or not math.isfinite(value):
        return '–'
    if not 1e3 <= abs(value) < MOST_PLAIN:
        return typeset(f'{value:.5g}')
    text = f'{value:.5g}' if abs(value) < 1e5 else f'{value:.0f}'
    decimals = len(text.partition('.')[2]) if 'e' not in text else 0
    return typeset(f'{value:,.{decimals}f}')


def decimals(values: Iterable[float | None]) -> int:
    """Return the number of decimals that gives the largest of some numbers four digits."""
    largest = max((abs(each) for each in values if each is not None and math.isfinite(each)),
                  default=0.0)
    return max(0, min(3 - math.floor(math.log10(largest)), 9)) if largest else 1


def decimals_of(kind: int, values: Iterable[float | None]) -> int:
    """Return ``LegKind.decimals`` for values: those of their largest where it leaves it open."""
    return kind if kind >= 0 else decimals(values)


def thousands(count: int) -> str:
    """Return a count with spaces between thousands."""
    return typeset(f'{count:,}')


def typeset(text: str) -> str:
    """Return numbers with narrow spaces for commas, and true minus signs."""
    return text.replace(',', _THIN_SPACE).replace('-', '−')


@functools.lru_cache(maxsize=2)
def _environment(folder: Path) -> Environment:
    made = Environment(loader=FileSystemLoader([folder, _SHARED]), autoescape=True,
                       undefined=StrictUndefined, keep_trailing_newline=True)
    made.filters.update(number=number, digits=digits, thousands=thousands, exactly=to_json,
                        decimals=decimals,
                        unit=lambda text: text.replace('^2', '²'))
    made.tests['finite'] = lambda value: value is not None and math.isfinite(value)
    # Data cannot end the element that contains them: the filter escapes < > & and '.
    made.policies.update({'json.dumps_function': to_json, 'json.dumps_kwargs': {}})
    return made


def page(folder: Path, template: str, scripts: Sequence[str] = (), shared: bool = False,
         document: bool = False, **values: Any) -> str:
    """
    Return a page.

    template: name of the template (.html), its style (.css) and its script (.js), if it has one.
    scripts: other scripts that the page is allowed to run.
    shared: the page is allowed to run scripts in files.
    document: the page has the common style of documents (document.css) before its own, and a
        white ground; another page may follow the reader's dark screen.
    values: variables of the template.
    """
    style, script = folder.joinpath(f'{template}.css').read_text(encoding='utf-8'), ''
    own = folder / f'{template}.js'
    if own.is_file():
        script = f"\n{own.read_text(encoding='utf-8')}"
    common = _SHARED.joinpath('document.css').read_text(encoding='utf-8') if document else ''
    style = custom_properties(dark=not document) + common + style
    hashes = ' '.join([*(f"'sha256-{_digest(each)}'" for each in (*scripts, script) if each),
                       *(["'self'"] if shared else [])]) or "'none'"
    return _environment(folder).get_template(f'{template}.html').render(
        hashes=hashes, script=script, style=style, **plain(values))


def _digest(script: str) -> str:
    return base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()


def link(path: Path, to: Path) -> str:
    """Return the relative address of a file in the page at a path."""
    return quote(os.fsencode(Path(os.path.relpath(to, path.parent)).as_posix()))


def link_to_other(path: Path, names: Sequence[Path], document: str,
                  parameters: Mapping[str, Any]) -> str | None:
    """
    Return the relative address of the page of another program with the same parameters, or None.

    It is searched beside the folder of the page at a path, and beside the folder around that.

    document: name of the JSON document beside the other page, which has its parameters.
    parameters: all values, as in that document.
    """
    folders = path.absolute().parents[1:3]
    return next((link(path.absolute(), found) for folder in folders for name in names
                 if (found := folder / name).is_file()
                 and _of_same_hexapod(found.with_name(document), parameters)), None)


def _of_same_hexapod(document: Path, parameters: Mapping[str, Any]) -> bool:
    """Return whether a JSON document has these parameters."""
    try:
        others = json.loads(document.read_bytes())['parameters']
        # which the options of a program may change
        return bool(dict(parameters) | {'setpoint.source': others['setpoint.source']} == others)
    except (OSError, ValueError, LookupError, TypeError):
        return False


def base64_of(numbers: ArrayLike, kind: str) -> str:
    """Return numbers as a typed array, in base64."""
    return base64.b64encode(np.ascontiguousarray(numbers, dtype=kind).tobytes()).decode()


@functools.lru_cache(maxsize=1)
def plotly_script() -> str:
    """Return plotly.js; the package plotly is not imported."""
    found = importlib.util.find_spec('plotly')
    for folder in found.submodule_search_locations or () if found else ():
        try:
            script = (Path(folder) / 'package_data' / 'plotly.min.js').read_text(encoding='utf-8')
        except OSError:
            continue
        # A browser reads line ends as \n, and ends a script at the first of these.
        script = script.replace('\r\n', '\n').replace('\r', '\n')
        return script.replace('</script', r'<\/script').replace('<!--', r'<\!--')
    raise StewartError('the report needs plotly, which is not installed: pip install plotly, or '
                       'use --no-report')
