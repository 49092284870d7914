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

"""Colors of pages, plots and figures."""

from __future__ import annotations

# Okabe and Ito's palette for the color-blind, without yellow, which is not visible on white.
LEG_COLORS = ('#0072b2', '#d55e00', '#009e73', '#cc79a7', '#e69f00', '#56b4e9')
AXIS_COLORS = LEG_COLORS[1], LEG_COLORS[2], LEG_COLORS[0]

# Colors of pages, by their role.
ROLES = {
    'ink': '#1d2430', 'black': '#222222', 'soft': '#5d6675', 'faint': '#8a93a1',
    'zero': '#b9c1cc', 'line': '#d9dee5', 'grid': '#e7ebf0', 'wash': '#f5f7f9',
    'accent': '#0b5fa5', 'good': '#1b7f4b', 'warn': '#a45f00', 'bad': '#b3261e',
    'near': '#b36b00', 'singular': '#c00000'}


def custom_properties() -> str:
    """Return the colors as properties for style sheets and scripts: --ink, --leg0."""
    named = ROLES | {f'leg{n}': color for n, color in enumerate(LEG_COLORS)}
    return f':root {{ {" ".join(f"--{name}: {color};" for name, color in named.items())} }}\n'
