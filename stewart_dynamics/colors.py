# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Colors of pages, plots and figures."""

from __future__ import annotations

from collections.abc import Mapping

# Okabe and Ito's palette for the color-blind, without yellow, which is not visible on white.
LEG_COLORS = ('#0072b2', '#d55e00', '#009e73', '#cc79a7', '#e69f00', '#56b4e9')
AXIS_COLORS = LEG_COLORS[1], LEG_COLORS[2], LEG_COLORS[0]

# Colors of pages and drawings, by their role.
ROLES = {
    'paper': '#ffffff', 'ink': '#1d2430', 'black': '#222222', 'soft': '#5d6675',
    'faint': '#8a93a1', 'zero': '#b9c1cc', 'line': '#d9dee5', 'grid': '#e7ebf0',
    'wash': '#f5f7f9', 'pointed': '#eef4fb', 'accent': '#0b5fa5',
    'good': '#1b7f4b', 'warn': '#a45f00', 'bad': '#b3261e',
    'good-wash': '#e3f4ea', 'warn-wash': '#fdf0d8', 'bad-wash': '#fce4e4',
    'near': '#b36b00', 'singular': '#c00000', 'warning': '#f0aa28', 'contact': '#825abe',
    'base': '#cbd2dc', 'platform': '#3b7dbd', 'platform-edge': '#1b4f86',
    'platform-wash': '#e6ebf1', 'edge': '#4a5568', 'piston': '#a3adba'}
# Roles of other colors where the reader prefers a dark screen, on pages that follow that.
_DARK = {
    'paper': '#15191e', 'ink': '#e4e8ed', 'faint': '#97a2b0', 'line': '#2f3740',
    'wash': '#1d232a', 'pointed': '#212b36', 'accent': '#72b3f5',
    'good': '#63cf95', 'warn': '#f0b354', 'bad': '#ff7b7b',
    'good-wash': '#173526', 'warn-wash': '#3d2f12', 'bad-wash': '#451d1f'}
# From the strongest pull over no force to the strongest push.
FORCE_COLORS = '#1f5fb4', '#86b0dc', '#c4c4c4', '#e79a7d', '#b2182b'


def custom_properties(dark: bool = False) -> str:
    """Return colors as properties for style sheets and scripts: --ink, --leg0; --leg in .leg0."""
    named = ROLES | {f'leg{n}': color for n, color in enumerate(LEG_COLORS)}
    light = f':root {{ {_properties(named)} }}\n' + ''.join(
        f'.leg{n} {{ --leg: var(--leg{n}); }}\n' for n in range(len(LEG_COLORS)))
    return light if not dark else (
        f'{light}@media screen and (prefers-color-scheme: dark) {{ :root {{ '
        f'color-scheme: dark; {_properties(_DARK)} }} }}\n')


def _properties(colors: Mapping[str, str]) -> str:
    return ' '.join(f'--{name}: {color};' for name, color in colors.items())
