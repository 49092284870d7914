# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Vector pictures (SVG) for pages: shapes and text in CSS pixels, charts with axes."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from stewart_dynamics.arrays import Array
from stewart_dynamics.colors import custom_properties, ROLES


class Picture:
    """
    A picture, drawn in the order of the calls; (0, 0) is its upper left corner.

    Attributes of elements are keyword arguments with ``_`` for ``-``; ``css`` is the class.

    width, height: [px]
    title: description for those who cannot see it.
    """

    def __init__(self, width: float, height: float, title: str) -> None:
        self.width, self.height, self.title = width, height, title
        self._elements: list[str] = []

    def add(self, tag: str, text: str | None = None, **attributes: Any) -> None:
        """Add an element; text is escaped."""
        given = ' '.join(f'{_name(name)}="{_text(value)}"' for name, value in attributes.items()
                         if value is not None)
        content = '/>' if text is None else f'>{escape(text)}</{tag}>'
        self._elements.append(f'<{tag} {given}{content}')

    def line(self, begin: ArrayLike, end: ArrayLike, **attributes: Any) -> None:
        """Add a line between two points (2,)."""
        (x1, y1), (x2, y2) = np.asarray(begin), np.asarray(end)
        self.add('line', x1=x1, y1=y1, x2=x2, y2=y2, **attributes)

    def path(self, *lines: ArrayLike, closed: bool = False, **attributes: Any) -> None:
        """Add lines through points (N, 2); points that are not finite break a line."""
        text = ''.join(_path(np.asarray(each, dtype=float), closed) for each in lines)
        if text:
            self.add('path', d=text, **attributes)

    def circle(self, center: ArrayLike, radius: float, **attributes: Any) -> None:
        """Add a circle."""
        x, y = np.asarray(center)
        self.add('circle', cx=x, cy=y, r=radius, **attributes)

    def text(self, at: ArrayLike, text: str, anchor: str = 'start', turned: float = 0.0,
             **attributes: Any) -> None:
        """Add text with its baseline at a point, turned counterclockwise [degrees]."""
        x, y = np.asarray(at)
        turn = f'rotate({_short(-turned)} {_short(x)} {_short(y)})' if turned else None
        self.add('text', text, x=x, y=y, text_anchor=anchor, transform=turn, **attributes)

    def svg(self) -> str:
        """Return the element; names of users in it are escaped."""
        width, height = _short(self.width), _short(self.height)
        return (f'<svg viewBox="0 0 {width} {height}" width="{width}" height="{height}" '
                f'role="img" aria-label="{escape(self.title)}">{"".join(self._elements)}</svg>')

    def document(self, style: str, *groups: str) -> str:
        """Return a file of its own: on white, with a style sheet, below groups of elements."""
        head, body = self.svg().removesuffix('</svg>').split('>', 1)
        return '\n'.join([
            f'{head} xmlns="http://www.w3.org/2000/svg">', f'<style>\n{custom_properties()}{style}'
            '</style>', f'<rect width="100%" height="100%" fill="{ROLES["paper"]}"/>', body,
            *groups, '</svg>', ''])


class Chart:
    """
    Axes on a picture: a frame, its scales, grid and numbers.

    frame: left, top, width and height [px].
    x, y: ranges of the data.
    logarithmic: the scale of x is; its range is above zero.
    """

    def __init__(self, picture: Picture, frame: tuple[float, float, float, float],
                 x: tuple[float, float], y: tuple[float, float], *, logarithmic: bool = False,
                 ) -> None:
        self.picture, self.frame, self.x, self.y = picture, frame, x, y
        self._logarithmic = logarithmic

    def at(self, points: ArrayLike) -> Array:
        """Return where data (..., 2) are in the picture."""
        left, top, width, height = self.frame
        data = np.asarray(points, dtype=float)
        (x0, x1), (y0, y1) = self.x, self.y
        along = data[..., 0]
        if self._logarithmic:
            along, x0, x1 = np.log(along), math.log(x0), math.log(x1)
        return np.stack([left + (along - x0) / (x1 - x0) * width,
                         top + (y1 - data[..., 1]) / (y1 - y0) * height], axis=-1)

    def draw_axes(self, x_title: str, y_title: str, count: int = 5) -> None:
        """Draw grid, numbers and titles."""
        left, top, width, height = self.frame
        p = self.picture
        for value in (logarithmic_ticks if self._logarithmic else ticks)(*self.x, count):
            x, _ = self.at([value, self.y[0]])
            p.line([x, top], [x, top + height], css='zero' if value == 0.0 else 'grid')
            p.text([x, top + height + 13], tick_text(value), 'middle', css='tick')
        self.draw_levels(count)
        p.text([left + width, top + height + 27], x_title, 'end', css='axis')
        p.text([left - 30, top - 8], y_title, css='axis')

    def draw_levels(self, count: int, numbers: bool = True) -> None:
        """Draw the grid of y, and its numbers."""
        left, _, width, _ = self.frame
        for value in ticks(*self.y, count):
            _, y = self.at([self.x[0], value])
            self.picture.line([left, y], [left + width, y], css='zero' if value == 0.0 else 'grid')
            if numbers:
                self.picture.text([left - 5, y + 3.5], tick_text(value), 'end', css='tick')


def ticks(low: float, high: float, count: int) -> list[float]:
    """Return about ``count`` round values between two."""
    if not high > low:
        return [low]
    rough = (high - low) / count
    power = 10.0 ** math.floor(math.log10(rough))
    step = next(power * each for each in (1.0, 2.0, 2.5, 5.0, 10.0) if power * each >= rough)
    first = math.ceil(low / step - 1e-9)
    return [n * step for n in range(first, math.floor(high / step + 1e-9) + 1)]


def logarithmic_ticks(low: float, high: float, count: int) -> list[float]:
    """Return at least ``count`` round values between two, if there are as many."""
    powers = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
    found: list[float] = []
    for digits in ((1,), (1, 3), (1, 2, 5), range(1, 10)):
        found = [value for power in powers for digit in digits
                 if low * (1 - 1e-9) <= (value := float(f'{digit}e{power}')) <= high * (1 + 1e-9)]
        if len(found) >= count:
            break
    return found


def tick_text(value: float) -> str:
    """Return a round value in few digits."""
    return f'{value:.10g}'.replace('-', '−')


def hull(points: ArrayLike) -> Array:
    """Return the corners (M, 2) of the convex hull of points (N, 2), counterclockwise."""
    ordered = sorted(set(map(tuple, np.asarray(points, dtype=float).round(12).tolist())))
    if len(ordered) < 3:
        return np.array(ordered)
    return np.array(_half_hull(ordered)[:-1] + _half_hull(ordered[::-1])[:-1])


def _half_hull(points: Sequence[tuple[float, ...]]) -> list[tuple[float, ...]]:
    """Return the lower half of a hull by Andrew's monotone chain."""
    found: list[tuple[float, ...]] = []
    for x, y in points:
        while len(found) > 1:
            (x0, y0), (x1, y1) = found[-2:]
            if (x1 - x0) * (y - y0) - (y1 - y0) * (x - x0) > 0.0:
                break
            found.pop()
        found.append((x, y))
    return found


def _path(points: Array, closed: bool) -> str:
    text, begins = [], True
    for point in points:
        if np.isfinite(point).all():
            x, y = point
            text.append(f'{"M" if begins else "L"}{_short(x)} {_short(y)}')
        begins = not np.isfinite(point).all()
    return ''.join(text) + ('Z' if closed and text else '')


def _name(name: str) -> str:
    return 'class' if name == 'css' else name.replace('_', '-')


def _text(value: Any) -> str:
    return _short(value) if isinstance(value, float) else escape(str(value))


def _short(number: float) -> str:
    return f'{number:.2f}'.rstrip('0').rstrip('.') if abs(number) >= 5e-3 else '0'
