# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Draw docs/figures/badges.svg: ROS, Python and license, as the installed package declares them.

``make docs`` runs it. Pages load no picture from elsewhere.
"""

from __future__ import annotations

from importlib.metadata import metadata
from pathlib import Path
import re

from stewart_dynamics.colors import ROLES
from stewart_dynamics.reporting.vector_picture import Picture

FILE = Path(__file__).with_name('badges.svg')
LETTER, HEIGHT, GAP = 6.62, 20.0, 8.0  # width in a font of 11 px, sizes [px]


def badges() -> dict[str, str]:
    """Return the names and values of the badges."""
    package = metadata('stewart_dynamics')
    ros = [extra.rpartition('-')[2].replace('ros', 'jazzy') for extra in package.get_all(
        'Provides-Extra', []) if extra.startswith('ros')]
    first, end = re.findall(r'3\.(\d+)', package['Requires-Python'])
    return {'ROS 2': ' | '.join(ros), 'Python': f'3.{first} - 3.{int(end) - 1}',
            'license': package.get('License-Expression', package.get('License')), 'core': 'C99'}


def draw() -> str:
    """Return the picture."""
    named = badges()
    widths = [2.0 * GAP + LETTER * len(text) for pair in named.items() for text in pair]
    picture = Picture(sum(widths) + GAP * (len(named) - 1), HEIGHT, ', '.join(
        ' '.join(pair) for pair in named.items()))
    left = 0.0
    for n, (text, width) in enumerate(zip(
            (text for pair in named.items() for text in pair), widths, strict=True)):
        picture.add('rect', x=left, y=0.0, width=width, height=HEIGHT,
                    fill=ROLES['accent' if n % 2 else 'edge'])
        picture.text([left + width / 2.0, 14.0], text, 'middle', fill=ROLES['paper'],
                     font_family='monospace', font_size=11, textLength=LETTER * len(text))
        left += width + (GAP if n % 2 else 0.0)
    head, rest = picture.svg().split('>', 1)
    return f'{head} xmlns="http://www.w3.org/2000/svg">{rest}\n'


def main() -> None:
    """Draw the picture."""
    FILE.write_text(draw(), encoding='utf-8')
    print(FILE.relative_to(FILE.parents[2]))


if __name__ == '__main__':
    main()
