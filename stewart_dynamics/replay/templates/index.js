'use strict';
const fleet = JSON.parse(document.getElementById('fleet').textContent);
const at = Object.fromEntries(fleet.columns.map((column, n) => [column.key, n]));
const FAILED = 2;
const LONG = new Set(['reason', 'limits_exceeded', 'measured']);
const CHUNK = 300;

// Text from bags is inserted as text, never as HTML.
function element(name, text, className) {
  const made = document.createElement(name);
  if (text !== undefined) made.textContent = text;
  if (className) made.className = className;
  return made;
}

// Thin spaces between thousands, a true minus.
function shown(value, digits = 0) {
  return value.toLocaleString('en', {minimumFractionDigits: digits, maximumFractionDigits: digits})
    .replaceAll(',', '\u202f').replace('-', '−');
}

// One number of decimals for a column, so that magnitudes can be compared: four digits for its median.
const decimals = fleet.columns.map(({number}, m) => {
  const sizes = number ? fleet.rows.map((cells) => Math.abs(cells[m] ?? 0)).filter((size) => size).sort((x, y) => x - y) : [];
  if (!sizes.length || sizes.every(Number.isInteger)) return 0;
  return Math.min(6, Math.max(0, 3 - Math.floor(Math.log10(sizes[sizes.length >> 1]))));
});

function cellText(value, m) {
  if (value === null) return '';
  if (typeof value !== 'number') return String(value);
  const size = Math.abs(value);
  if (size >= 1e10 || size && size < 1e-3 && size < 10 ** (1 - decimals[m])) return value.toExponential(2).replace(/^-/, '−');
  if (size && size < 10 ** (1 - decimals[m]) && !Number.isInteger(value)) return value.toPrecision(3).replace('-', '−');
  return shown(value, decimals[m]);
}

// Highlighted cells.
function marked(key, value) {
  if (value === null || value === '') return '';
  if (key.includes('_margin_')) return value < 0 ? 'bad' : '';
  if (key === 'limits_exceeded' || key === 'crossings' && value > 0) return 'bad';
  return (key === 'warnings' || key === 'rejected') && value > 0 ? 'warn' : '';
}

const rows = fleet.rows.map((cells, n) => ({
  n, code: fleet.codes[n], cells, line: null,
  text: cells.filter((cell) => typeof cell === 'string').join('\n').toLowerCase(),
}));

// Names without the folder that all of them are in; a narrow column cuts their beginnings.
const nameOf = (cells) => cells[at.bag].slice(fleet.folder.length);

function lineOf(row) {
  if (row.line) return row.line;
  row.line = element('tr', undefined, 'code' + row.code);
  const reason = row.cells[at.reason];
  row.cells.forEach((value, m) => {
    const {key, number} = fleet.columns[m];
    const cell = element('td', undefined, [number ? 'number' : '', marked(key, value)].join(' ').trim());
    if (key === 'bag') {
      cell.title = value;
      const name = element(fleet.links[row.n] === null ? 'bdi' : 'a', nameOf(row.cells));
      name.dir = 'ltr';
      if (name.href !== undefined) name.href = fleet.links[row.n];
      cell.append(name);
    } else if (key === 'result') {
      const pill = element('span', value, 'pill');
      pill.title = reason;
      cell.append(pill);
    } else if (row.code === FAILED) {
      // It has no numbers: the error is shown instead.
      if (key !== 'reason') return;
      cell.colSpan = fleet.columns.length - row.line.children.length;
      cell.append(element('div', value));
    } else if (LONG.has(key)) cell.append(element('div', value));
    else cell.textContent = cellText(value, m);
    if (LONG.has(key)) cell.classList.add('long', key);
    row.line.append(cell);
  });
  return row.line;
}

// Sorting: cells without a value are last, in both directions.
const collator = new Intl.Collator('en', {numeric: true});
const body = document.querySelector('tbody');
let sorted = {column: -1, down: false};

function keyOf(row, m) {
  const {key, number, size} = fleet.columns[m];
  if (key === 'result') return fleet.severity.indexOf(row.cells[m]);
  const value = row.cells[m];
  if (value === null || value === '') return null;
  return number && size ? Math.abs(value) : value;
}

function sortBy(m) {
  sorted = {column: m, down: sorted.column === m && !sorted.down};
  const keys = new Map(rows.map((row) => [row, keyOf(row, m)]));
  rows.sort((a, b) => {
    const [x, y] = [keys.get(a), keys.get(b)];
    if (x === null || y === null) return (x === null) - (y === null) || a.n - b.n;
    const order = typeof x === 'number' ? x - y : collator.compare(x, y);
    return (sorted.down ? -order : order) || a.n - b.n;
  });
  document.querySelectorAll('th').forEach((head, k) => {
    if (k === m) head.setAttribute('aria-sort', sorted.down ? 'descending' : 'ascending');
    else head.removeAttribute('aria-sort');
  });
  show();
}

document.querySelectorAll('th button').forEach((button, m) => button.addEventListener('click', () => sortBy(m)));

// Rows shown: those that pass the filters, as far as the table has been scrolled.
let only = null;
let passing = [];
const filter = document.getElementById('filter');
const main = document.querySelector('main');

function more() {
  const from = body.children.length;
  const next = passing.slice(from, from + CHUNK).map(lineOf);
  body.append(...next);
}

function show() {
  const wanted = filter.value.toLowerCase();
  passing = rows.filter((row) => (only === null || row.cells[at.result] === only) && row.text.includes(wanted));
  body.replaceChildren();
  more();
  main.scrollTop = 0;
  document.getElementById('shown').value = passing.length === rows.length ? '' : `${shown(passing.length)} of ${shown(rows.length)}`;
}

main.addEventListener('scroll', () => {
  if (main.scrollTop + 3 * main.clientHeight > main.scrollHeight) more();
});
window.addEventListener('beforeprint', () => {
  while (body.children.length < passing.length) more();
});
filter.addEventListener('input', show);

const choices = document.querySelectorAll('nav button');
choices.forEach((button, n) => button.addEventListener('click', () => {
  only = n ? fleet.results[n] : null;
  choices.forEach((each) => each.setAttribute('aria-pressed', each === button));
  show();
}));
show();
