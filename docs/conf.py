# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Sphinx configuration of the documentation: ``make docs-site`` builds it to docs/_build/html."""

from __future__ import annotations

import gc
from pathlib import Path
import re
import shutil
from typing import Any
from xml.etree import ElementTree

from docutils import nodes
from docutils.utils.math.latex2mathml import tex2mathml
from sphinx.application import Sphinx
from sphinx.config import Config

ROOT = Path(__file__).resolve().parent.parent

# All pages stay in memory: the search for garbage would take a fifth of the time.
gc.set_threshold(100_000)

project = 'stewart_dynamics'
author = 'The stewart_dynamics developers'
copyright = f'2026, {author}'  # noqa: A001
release = ElementTree.parse(ROOT / 'package.xml').getroot().findtext('version')

extensions = ['myst_nb', 'numpydoc', 'sphinx.ext.autodoc']
exclude_patterns = ['_build', 'figures']

myst_enable_extensions = ['dollarmath']
# The anchors that GitHub gives headings, so that links work there as well.
myst_heading_anchors = 4

# Pages of notebooks show the outputs that are stored in them; test_notebooks.py executes them.
nb_execution_mode = 'off'
nb_merge_streams = True

# Warnings are errors, and an unknown reference is a warning.
nitpicky = True
nitpick_ignore_regex = [
    # Types of other packages and of annotations: they have no page here.
    ('py:.*', r'(numpy|np|pathlib|collections|typing|typing_extensions)\..*'),
]

autodoc_member_order = 'bysource'
autodoc_typehints = 'none'
autodoc_default_options = {'members': True}
numpydoc_show_class_members = False

html_theme = 'furo'
html_title = project
html_math_renderer = 'mathml'
html_copy_source = False
html_show_sphinx = False
html_theme_options = {
    'light_css_variables': {'color-brand-primary': '#0072b2', 'color-brand-content': '#0072b2'},
    'dark_css_variables': {'color-brand-primary': '#56b4e9', 'color-brand-content': '#56b4e9'},
}
html_static_path = ['_static']
html_css_files = ['site.css']
_LONG = 60  # characters of a text that makes a table too wide for a phone


# Formulas as MathML, which browsers draw themselves: the pages need no network and no script.

def visit_math(translator: Any, node: nodes.math) -> None:
    """Write a formula in a line of text."""
    translator.body.append(tex2mathml(node.astext()))
    raise nodes.SkipNode


def visit_displaymath(translator: Any, node: nodes.math_block) -> None:
    """Write a formula on lines of its own."""
    translator.body.append(f'<div class="math">{tex2mathml(node.astext(), as_block=True)}</div>')
    raise nodes.SkipNode


# A table of texts is wider than a phone: there each row becomes a list, whose cells are labeled by
# the heads (site.css).

def label_cells(app: Sphinx, doctree: nodes.document, docname: str) -> None:
    """Give tables with long texts the class ``texts``, and their cells the heads as labels."""
    for table in doctree.findall(nodes.table):
        heads = [each.astext() for head in table.findall(nodes.thead)
                 for each in head.findall(nodes.entry)]
        rows = [[*row.findall(nodes.entry)] for body in table.findall(nodes.tbody)
                for row in body.findall(nodes.row)]
        longest = max((len(cell.astext()) for row in rows for cell in row), default=0)
        if len(heads) < 3 or longest < _LONG:
            continue
        table['classes'].append('texts')
        for row in rows:
            for head, cell in zip(heads[1:], row[1:], strict=True):
                if cell.astext():
                    cell[0].insert(0, nodes.inline('', f'{head}: ', classes=['label']))


# Pages of files that stand elsewhere: written here for each build, and ignored by git.

def write_pages(app: Sphinx, config: Config) -> None:
    """Copy notebooks and benchmarks' results to docs/; write CHANGELOG.rst to docs/releases/."""
    # No symbolic links: newer MyST replaces one by its target, which is no page.
    folders = notebooks, results, releases = [
        ROOT / 'docs' / name for name in ('notebooks', 'results', 'releases')]
    for folder in folders:
        shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(ROOT / 'examples' / 'notebooks', notebooks)
    shutil.copytree(ROOT / 'benchmarks' / 'results', results)
    releases.mkdir()
    _, *parts = re.split(r'^(\S.*)\n-+\n', (ROOT / 'CHANGELOG.rst').read_text(encoding='utf-8'),
                         flags=re.MULTILINE)
    pages = {title.split()[0].lower(): f'{title}\n{"=" * len(title)}\n{text}'
             for title, text in zip(parts[::2], parts[1::2], strict=True)}
    pages['overview'] = '\n   '.join(['Releases\n========\n\n.. toctree::\n', *pages]) + '\n'
    for name, text in pages.items():
        (releases / f'{name}.rst').write_text(text, encoding='utf-8')


# Links lead to the files that GitHub shows; on the site these are included in pages.
_PAGES = {
    '../CHANGELOG.rst': 'releases/overview.rst', '../CONTRIBUTING.md': 'contributing.md',
    '../README.md': 'index.md', '../SECURITY.md': 'security_policy.md',
    '../benchmarks/README.md': 'performance.md', '../benchmarks/results/': 'results/',
    '../examples/notebooks/': 'notebooks/',
    '../security/README.md': 'security.md', '../../docs/': '../'}


def lead_to_pages(*arguments: Any) -> None:
    """Replace links to files outside docs/ in a page, or in a file that it includes."""
    content = arguments[-1]
    if (ROOT / 'docs' / arguments[1]).resolve().parent == ROOT:
        content[0] = re.sub(r'\]\((?!docs/|#|\w+:)', '](../', content[0])
        content[0] = content[0].replace('](docs/', '](')
    for file, page in _PAGES.items():
        content[0] = content[0].replace(f']({file}', f']({page}')


def setup(app: Sphinx) -> None:
    """Register the formulas and the rewriting of links."""
    app.connect('config-inited', write_pages)
    app.connect('doctree-resolved', label_cells)
    app.connect('source-read', lead_to_pages)
    app.connect('include-read', lead_to_pages)
    app.add_html_math_renderer('mathml', (visit_math, None), (visit_displaymath, None))
