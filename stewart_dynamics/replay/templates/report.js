'use strict';

// ---- the data

const report = JSON.parse(document.getElementById('data').textContent);

function decode(text, Kind) {
  return new Kind(Uint8Array.from(atob(text), each => each.charCodeAt(0)).buffer);
}

const decoded = new Map();

function curve(number) {
  if (!decoded.has(number)) {
    const packed = report.curves[number];
    decoded.set(number, {
      times: decode(packed.times, Float64Array), values: decode(packed.values, Float32Array)});
  }
  return decoded.get(number);
}

// The number of the entry nearest to a time, of times that never decrease.
function nearest(times, time) {
  let low = 0, high = times.length - 1;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (times[middle] < time) low = middle + 1; else high = middle;
  }
  return low > 0 && time - times[low - 1] <= times[low] - time ? low - 1 : low;
}

// The drawn value nearest to a time; nan where the line is interrupted.
function valueAt(number, time) {
  const {times, values} = curve(number);
  if (!times.length) return NaN;
  const at = nearest(times, time);
  // of several entries at one time, such as a sample and the gap after it, the sample
  for (let n = at; n < times.length && times[n] === times[at]; n++) {
    if (!Number.isNaN(values[n])) return values[n];
  }
  for (let n = at; n >= 0 && times[n] === times[at]; n--) {
    if (!Number.isNaN(values[n])) return values[n];
  }
  return NaN;
}

const THIN_SPACE = '\u202f';

// Spaces between thousands, a true minus.
function grouped(value, decimals = 0) {
  return value.toLocaleString('en', {minimumFractionDigits: decimals, maximumFractionDigits: decimals})
    .replaceAll(',', THIN_SPACE).replace('-', '−');
}

function shown(value) {
  if (!Number.isFinite(value)) return '–';
  const size = Math.abs(value);
  if (size === 0) return '0';
  if (size >= 1e6 || size < 1e-4) return value.toExponential(3).replaceAll('-', '−');
  return grouped(value, size >= 1e4 ? 0 : size < 1 ? 4 : 4 - Math.floor(Math.log10(size)));
}

function element(name, options = {}, ...children) {
  const made = document.createElement(name);
  for (const [key, value] of Object.entries(options)) {
    if (key === 'dataset') Object.assign(made.dataset, value); else made[key] = value;
  }
  made.append(...children);
  return made;
}

// A color of the style sheet.
const color = name => getComputedStyle(document.body).getPropertyValue(`--${name}`).trim();

function swatch(of) {
  const made = element('i', {className: 'swatch'});
  made.style.color = of;
  return made;
}

// A table: heads, and rows of a first cell and further ones; texts or elements.
function table(heads, rows) {
  const cell = (name, content) => element(name, {}, ...[content].flat());
  return element('table', {}, element('thead', {}, element('tr', {}, ...heads.map(each => cell('th', each)))),
    element('tbody', {}, ...rows.map(([first, ...others]) => element('tr', {}, cell('th', first),
      ...others.map(each => each instanceof HTMLTableCellElement ? each : cell('td', each))))));
}

// A table of names with cells for their values: the cells, row by row.
function listIn(readout, heads, names) {
  const cells = names.map(() => heads.slice(1).map(() => element('td', {textContent: '–'})));
  readout.append(table(heads, names.map((name, n) => [name, ...cells[n]])));
  return cells;
}

const PAPER = color('paper'), INK = color('ink'), FAINT = color('faint');
const FONT = {family: getComputedStyle(document.body).fontFamily, size: 12.5, color: INK};
// Fingers scroll the page, and turn the hexapod.
const TOUCH = window.matchMedia('(pointer: coarse)').matches;
const NARROW = 560;  // [px]
const CONFIG = {displaylogo: false, responsive: true, showTips: false, modeBarButtons: [
  ['toImage'], ['zoom2d', 'pan2d', 'zoomIn2d', 'zoomOut2d', 'resetScale2d']]};
const CONFIG_3D = {...CONFIG, modeBarButtons: [
  ['toImage'], ['zoom3d', 'pan3d', 'orbitRotation', 'tableRotation', 'resetCameraDefault3d']]};

// ---- time: one cursor and one range for all plots

const duration = report.end - report.begin;
const wholeRange = duration > 0 ? [report.begin, report.end]
  : [report.begin - 0.5, report.begin + 0.5];
const time = {cursor: report.begin, hover: null, range: wholeRange.slice()};
const plots = [];
let player = null;

function sameRange(a, b) {
  const small = 1e-9 * (wholeRange[1] - wholeRange[0]);
  return Math.abs(a[0] - b[0]) <= small && Math.abs(a[1] - b[1]) <= small;
}

function zoomTo(range) {
  if (sameRange(range, time.range)) return;
  time.range = [+range[0], +range[1]];
  for (const plot of plots) plot.follow();
}

function moveCursor(to) {
  time.cursor = Math.min(Math.max(to, report.begin), report.end);
  document.getElementById('slider').value = time.cursor;
  document.getElementById('now').replaceChildren(
    `t = ${grouped(time.cursor, 3)} s`, element('span', {textContent: ` of ${grouped(report.end, 3)} s`}));
  for (const plot of plots) plot.showCursor();
  if (player) player.show();
}

// Move the cursor to a time, and the range of all plots if the time is outside.
function showTime(when) {
  const [begin, end] = time.range;
  if (when < begin || when > end) {
    const half = 0.5 * (end - begin);
    zoomTo([when - half, when + half]);
  }
  moveCursor(when);
}

function hoverAt(when) {
  time.hover = when;
  for (const plot of plots) plot.showCursor();
}

// ---- drawings, drawn when they come into view

const inView = new Set();
const byCanvas = new Map();
const watcher = new IntersectionObserver(entries => {
  for (const entry of entries) {
    const drawing = byCanvas.get(entry.target);
    if (!entry.isIntersecting) inView.delete(drawing);
    else {
      inView.add(drawing);
      // A 3-D scene can take seconds without a graphics card: the plots are drawn first.
      setTimeout(() => drawing.appear(), drawing instanceof TimePlot || drawing.drawn ? 0 : 500);
    }
  }
}, {rootMargin: '250px 0px'});

// A canvas and its readout, under a head.
class Drawing {
  constructor(place, options, ...head) {
    this.drawn = false;
    this.canvas = element('div', options);
    this.readout = element('aside', {className: 'readout'});
    place.append(element('div', {className: 'plot'}, element('div', {className: 'head'}, ...head),
      element('div', {className: 'body'}, this.canvas, this.readout)));
    byCanvas.set(this.canvas, this);
    watcher.observe(this.canvas);
  }

  get inView() { return this.drawn && inView.has(this); }
}

const titled = title => element('h3', {}, title);

const AXIS = {gridcolor: color('grid'), zerolinecolor: color('zero'), linecolor: FAINT,
  ticks: 'outside', tickcolor: FAINT, ticklen: 4, showline: true, mirror: true};

// ---- a plot over time

// Of plots over time and over frequency.
function layoutOf(xTitle, xaxis, yTitle, yaxis, more = {}) {
  const title = (text, standoff) => ({text, standoff, font: {size: 12.5}});
  return {
    // above the axes the tool bar has its place: it hides no label
    height: 288, margin: {l: 96, r: 14, t: 30, b: 42}, font: FONT, showlegend: false, hovermode: false,
    separators: `.${THIN_SPACE}`, dragmode: TOUCH ? false : 'zoom', paper_bgcolor: PAPER, plot_bgcolor: PAPER,
    xaxis: {...AXIS, zeroline: false, ...xaxis, title: title(xTitle, 6)},
    yaxis: {...AXIS, ...yaxis, title: title(yTitle, 8)}, ...more};
}

class TimePlot extends Drawing {
  constructor(spec, place) {
    const tools = element('div', {className: 'tools'});
    super(place, {className: 'canvas time', id: `plot_${spec.key}`}, titled(spec.title),
      element('span', {className: 'note', textContent: spec.note}), tools);
    this.spec = spec;
    this.variant = 0;
    this.hidden = new Set();
    this.cursor = element('div', {className: 'cursor'}, element('span'));
    this.tools = tools;
    if (spec.variants.length > 1) {
      const choice = element('select', {ariaLabel: 'curves'},
        ...spec.variants.map((each, n) => element('option', {value: n, textContent: each.name})));
      choice.addEventListener('change', () => this.choose(+choice.value));
      tools.append(choice);
    }
    this.listValues();
  }

  get curves() { return this.spec.variants[this.variant].curves; }

  listValues() {
    this.where = element('span', {textContent: 'at the cursor'});
    const toggles = this.curves.map(each => element(
      'button', {title: 'show or hide'}, swatch(each.color), each.name));
    this.readout.replaceChildren();
    this.values = listIn(this.readout, [this.where, `[${this.spec.unit}]`], toggles).map(([cell]) => cell);
    toggles.forEach((toggle, n) => {
      const show = () => toggle.closest('tr').classList.toggle('off', this.hidden.has(n));
      show();
      toggle.addEventListener('click', () => {
        if (!this.hidden.delete(n)) this.hidden.add(n);
        show();
        if (this.drawn) this.draw();
      });
    });
  }

  choose(number) {
    this.variant = number;
    this.listValues();
    if (this.drawn) {
      this.yRange = this.usualRange();
      this.draw();
    }
  }

  traces() {
    const traces = [];
    this.curves.forEach((each, n) => {
      const {times, values} = curve(each.curve);
      const visible = !this.hidden.has(n);
      traces.push({
        type: 'scatter', mode: 'lines', x: times, y: values, visible, hoverinfo: 'skip',
        name: each.name, line: {color: each.color, width: each.width, dash: each.dash, simplify: false}});
      const isGap = k => Number.isNaN(values[k] ?? NaN);
      const alone = [...values.keys()].filter(k => isGap(k - 1) && !isGap(k) && isGap(k + 1));
      // a sample between two gaps is drawn as a marker
      if (alone.length) {
        traces.push({
          type: 'scatter', mode: 'markers', x: alone.map(k => times[k]), y: alone.map(k => values[k]),
          visible, hoverinfo: 'skip', name: each.name, marker: {color: each.color, size: 6}});
      }
    });
    return traces;
  }

  // From the smallest to the largest value, with the bounds if they are close. Values near a
  // singularity may be far larger than all others: they do not set the scale.
  usualRange() {
    const whole = this.extremes(() => true);
    let [low, high] = whole;
    this.spiky = false;
    if (!(low <= high)) return [-1, 1];
    if (this.spec.spikes && !this.everything) {
      const bound = Math.max(...this.spec.bounds.map(each => Math.abs(each.value)));
      let [least, largest] = this.extremes(when => !report.warnings.some(
        ([begun, ended]) => when >= begun && (ended === null || when <= ended)));
      if (bound > 0 && !(Math.max(-least, largest) < 4 * bound)) [least, largest] = [-bound, bound];
      const pad = 0.4 * (largest - least);
      if (high - low > 3 * (largest - least) && largest > least) {
        this.spiky = true;
        [low, high] = [Math.max(low, least - pad), Math.min(high, largest + pad)];
      }
    }
    const reach = 1.5 * (high - low);
    for (const {value} of this.spec.bounds) {
      if (value >= low - reach && value <= high + reach) {
        low = Math.min(low, value);
        high = Math.max(high, value);
      }
    }
    if (this.spec.log) {
      return [Math.log10(Math.max(low, 1e-3)) - 0.05, Math.log10(Math.max(high, 1e-3)) + 0.08];
    }
    const pad = Math.max(0.06 * (high - low), 1e-3 * Math.max(Math.abs(low), Math.abs(high))) || 1;
    return [low - pad, high + pad];
  }

  extremes(isTaken) {
    let low = Infinity, high = -Infinity;
    for (const each of this.curves) {
      const {times, values} = curve(each.curve);
      for (let n = 0; n < values.length; n++) {
        if ((values[n] < low || values[n] > high) && isTaken(times[n])) {
          low = Math.min(low, values[n]);
          high = Math.max(high, values[n]);
        }
      }
    }
    return [low, high];
  }

  layout() {
    const shapes = [], notes = [];
    const bands = (spans, role) => shapes.push(...spans.map(([begun, ended]) => ({
      type: 'rect', layer: 'below', xref: 'x', yref: 'paper', x0: begun, x1: ended === null ? report.end : ended,
      y0: 0, y1: 1, line: {width: 0}, fillcolor: color(role), opacity: 0.22})));
    bands(report.warnings, 'warning');
    bands(this.spec.contacts ? report.contacts : [], 'contact');
    for (const when of report.crossings) {
      shapes.push({type: 'line', layer: 'below', xref: 'x', yref: 'paper', x0: when, x1: when, y0: 0,
        y1: 1, line: {color: color('singular'), width: 1.2, dash: 'dot'}});
    }
    for (const {value, text, color: of} of this.spec.bounds) {
      shapes.push({type: 'line', xref: 'paper', yref: 'y', x0: 0, x1: 1, y0: value, y1: value,
        line: {color: of, width: 1.2, dash: 'dash'}});
      if (text) {
        notes.push({xref: 'paper', yref: 'y', x: 1, y: this.spec.log ? Math.log10(value) : value,
          text, showarrow: false, xanchor: 'right', yanchor: value < 0 ? 'top' : 'bottom',
          font: {size: 11, color: of}, bgcolor: 'rgba(255, 255, 255, 0.7)', borderpad: 0});
      }
    }
    const log = this.spec.log;
    return layoutOf('time [s]', {range: time.range.slice()}, log ? '' : `[${this.spec.unit}]`, {
      range: this.yRange.slice(), type: log ? 'log' : 'linear', exponentformat: log ? 'power' : 'none',
      separatethousands: true, ...(log ? {dtick: this.yRange[1] - this.yRange[0] > 1.2 ? 1 : 'D2'} : {})},
    {shapes, annotations: notes});
  }

  draw() {
    Plotly.react(this.canvas, this.traces(), this.layout(), CONFIG);
    if (!this.drawn) this.attach();
    this.drawn = true;
    this.offerEverything();
    this.showCursor();
  }

  appear() {
    if (!this.drawn) {
      this.yRange = this.usualRange();
      this.draw();
    } else {
      this.follow();
      this.showCursor();
    }
  }

  // Take the common range.
  follow() {
    if (!this.inView) return;
    if (!sameRange(this.canvas._fullLayout.xaxis.range, time.range)) {
      Plotly.relayout(this.canvas, {'xaxis.range': time.range.slice()});
    }
  }

  attach() {
    this.canvas.append(this.cursor);
    this.canvas.on('plotly_relayout', () => {
      const {xaxis, yaxis} = this.canvas._fullLayout;
      this.yRange = yaxis.range.slice();
      zoomTo(xaxis.autorange ? wholeRange : xaxis.range);
    });
    this.canvas.on('plotly_afterplot', () => this.showCursor());
    let pressed = null;
    this.canvas.addEventListener('pointermove', event => {
      if (event.pointerType === 'mouse') hoverAt(this.timeAt(event));
    });
    this.canvas.addEventListener('pointerleave', () => hoverAt(null));
    this.canvas.addEventListener('pointerdown', event => { pressed = [event.clientX, event.clientY]; }, true);
    // a click, not the end of a drag
    window.addEventListener('pointerup', event => {
      if (pressed && Math.hypot(event.clientX - pressed[0], event.clientY - pressed[1]) < 4) {
        const when = this.timeAt(event);
        if (when !== null) { stop(); moveCursor(when); }
      }
      pressed = null;
    }, true);
  }

  timeAt(event) {
    const {xaxis, yaxis} = this.canvas._fullLayout;
    const box = this.canvas.getBoundingClientRect();
    const x = event.clientX - box.left - xaxis._offset, y = event.clientY - box.top - yaxis._offset;
    return x < 0 || x > xaxis._length || y < 0 || y > yaxis._length ? null : xaxis.p2d(x);
  }

  offerEverything() {
    if (!this.spec.spikes || this.offer || !this.spiky) return;
    this.offer = element('button', {className: 'small', textContent: 'show full range'});
    this.offer.addEventListener('click', () => {
      this.everything = !this.everything;
      this.offer.textContent = this.everything ? 'show usual range' : 'show full range';
      this.yRange = this.usualRange();
      Plotly.relayout(this.canvas, {'yaxis.range': this.yRange.slice()});
    });
    this.tools.append(this.offer);
  }

  placeCursor(at, text) {
    const {xaxis, yaxis} = this.canvas._fullLayout;
    const x = xaxis.d2p(at);
    Object.assign(this.cursor.style, {
      display: x >= -1 && x <= xaxis._length + 1 ? 'block' : 'none', left: `${xaxis._offset + x - 0.75}px`,
      top: `${yaxis._offset}px`, height: `${yaxis._length}px`});
    this.cursor.classList.toggle('late', x > 0.8 * xaxis._length);
    this.cursor.firstChild.textContent = text;
  }

  showCursor() {
    if (!this.inView) return;
    const when = time.hover === null ? time.cursor : time.hover;
    this.placeCursor(when, `${grouped(when, 3)} s`);
    this.curves.forEach((each, n) => { this.values[n].textContent = shown(valueAt(each.curve, when)); });
  }
}

// ---- a plot over frequency

const DECADES = 7;  // at most, below the highest value: noise of rounding is not shown
const spectra = [];
let pointedAt = null;  // frequency under the mouse [Hz]

function pointAt(frequency) {
  pointedAt = frequency;
  for (const spectrum of spectra) spectrum.showCursor();
}

function highest({times, values}) {
  let most = 0;
  values.forEach((value, k) => { if (value > values[most]) most = k; });
  return {time: times[most], value: values[most]};
}

// Three digits.
function brief(value) { return shown(+value.toPrecision(3)).replace(/(\.\d*?)0+$/, '$1').replace(/\.$/, ''); }

class SpectrumPlot extends TimePlot {
  constructor(spec, place) {
    super(spec, place);
    this.canvas.className = 'canvas spectrum';
    this.showCursor();
  }

  usualRange() {
    let high = 0, low = Infinity;
    for (const each of this.curves) {
      for (const value of curve(each.curve).values) {
        if (value > high) high = value;
        if (value > 0 && value < low) low = value;
      }
    }
    if (!(high > 0)) return [-1, 1];
    const top = Math.log10(high) + 0.15;
    return [Math.max(Math.log10(low) - 0.15, top - DECADES), top];
  }

  layout() {
    const {times} = curve(this.curves[0].curve);
    const ends = [Math.log10(times[0]), Math.log10(times[times.length - 1])];
    const log = range => ({type: 'log', range, exponentformat: 'power', zeroline: false,
      minor: {ticks: 'outside', ticklen: 2, tickcolor: FAINT, showgrid: true, gridcolor: color('wash')}});
    return layoutOf('frequency [Hz]', {...log(ends), dtick: ends[1] - ends[0] > 1.2 ? 1 : 'D2'},
      `[${this.spec.unit}]`, {...log(this.yRange.slice()), dtick: 1});
  }

  follow() {}

  attach() {
    this.canvas.append(this.cursor);
    this.canvas.on('plotly_afterplot', () => this.showCursor());
    for (const kind of ['pointermove', 'pointerdown']) {
      this.canvas.addEventListener(kind, event => pointAt(this.timeAt(event)));
    }
    this.canvas.addEventListener('pointerleave', event => { if (event.pointerType === 'mouse') pointAt(null); });
  }

  // The values at the frequency under the mouse; without one, the highest values.
  showCursor() {
    const place = this.drawn && pointedAt !== null;
    if (place) this.placeCursor(pointedAt, `${shown(pointedAt)} Hz`); else this.cursor.style.display = 'none';
    this.where.textContent = place ? 'at the cursor' : 'highest';
    const found = this.curves.map(each => highest(curve(each.curve)));
    const least = Math.max(...found.map(each => each.value)) * 10 ** -DECADES;
    this.curves.forEach((each, n) => {
      const {value, time: frequency} = found[n];
      this.values[n].textContent = place ? shown(valueAt(each.curve, pointedAt))
        : value > least ? `${brief(value)} at ${brief(frequency)} Hz` : '0';
    });
  }
}

// ---- the hexapod in three dimensions

const FORCE_SCALE = report.forceColors.map((each, n, all) => [n / (all.length - 1), each]);
const PLATFORM = color('platform'), PLATFORM_EDGE = color('platform-edge');

const frames = {
  times: decode(report.frames.times, Float64Array), numbers: decode(report.frames.numbers, Float64Array)};

const placesInFrame = Object.entries(report.frames.places);
const NUMBERS = Math.max(...placesInFrame.map(([, [, end]]) => end));

// Position, rotation, angles, positions and efforts of the drives, anchors of moving lines of force.
function frameAt(number) {
  return Object.fromEntries(placesInFrame.map(
    ([name, [begin, end]]) => [name, frames.numbers.subarray(NUMBERS * number + begin, NUMBERS * number + end)]));
}

// Where the platform joints are in a frame, base axes.
function platformJoints(frame) {
  return report.platformJoints.map(p => [0, 1, 2].map(
    k => frame.position[k] + frame.rotation[3 * k] * p[0] + frame.rotation[3 * k + 1] * p[1]
      + frame.rotation[3 * k + 2] * p[2]));
}

const inUnit = quantity => `${quantity.name} [${quantity.unit}]`;
const column = (points, k) => points.map(point => point[k]);
const xyz = points => ({x: column(points, 0), y: column(points, 1), z: column(points, 2)});
const SILENT = {hoverinfo: 'skip', showlegend: false};

function outline(points, options) {
  return {type: 'scatter3d', mode: 'lines+markers', ...xyz([...points, points[0]]), ...SILENT, ...options};
}

// A plate over the joints: triangles from the first of them.
function plate(points, of, opacity) {
  return {type: 'mesh3d', ...xyz(points), i: [0, 0, 0, 0], j: [1, 2, 3, 4], k: [2, 3, 4, 5], color: of,
    opacity, flatshading: true, ...SILENT};
}

// The legs as one line with gaps, and a number for the color of each of its points.
function legLines(joints, frame) {
  return xyz(report.baseJoints.flatMap((base, n) => [
    base, ...(frame.anchors ? [[...frame.anchors.subarray(3 * n, 3 * n + 3)]] : []), joints[n], [null, null, null]]));
}

function legColors(frame) {
  return [...frame.efforts].flatMap(
    effort => Array(frame.anchors ? 4 : 3).fill(Number.isFinite(effort) ? effort : 0));
}

// A narrow scene is seen from farther away.
function distance(width) { return Math.max(1, 620 / width); }

// Axes of equal scale that contain base and platform in all frames.
function scene(numbers, width) {
  const points = besideBase();
  for (const number of numbers) points.push(...platformJoints(frameAt(number)));
  const extreme = (choose, k) => points.reduce((found, point) => choose(found, point[k]), points[0][k]);
  const low = [0, 1, 2].map(k => extreme(Math.min, k)), high = [0, 1, 2].map(k => extreme(Math.max, k));
  const pad = 0.06 * Math.max(...high.map((value, k) => value - low[k]), 1e-9);
  const far = distance(width);
  const axis = (name, k) => ({title: {text: `${name} [m]`}, range: [low[k] - pad, high[k] + pad],
    gridcolor: color('line'), zerolinecolor: color('zero'), backgroundcolor: PAPER, showbackground: false,
    showspikes: false, tickfont: {size: 11}});
  return {xaxis: axis('X', 0), yaxis: axis('Y', 1), zaxis: axis('Z', 2), aspectmode: 'data',
    camera: {eye: {x: 1.15 * far, y: -1.35 * far, z: 0.62 * far}, center: {x: 0, y: 0, z: -0.12}}};
}

function shortened(name) { return name.length > 14 ? `${name.slice(0, 13)}…` : name; }

// Plotly interprets markup in texts that it draws, and cannot escape it in all of them.
function plainText(name) { return name.replace(/</g, '‹').replace(/>/g, '›'); }

// Positions of the names of the legs: outside of the base joints and on the far side of the platform,
// where no leg hides them, those of near joints apart.
function besideBase() {
  const mean = points => [0, 1, 2].map(k => column(points, k).reduce((a, b) => a + b) / 6);
  const minus = (a, b) => a.map((value, k) => value - b[k]), size = a => Math.hypot(...a) || 1;
  const middle = mean(report.baseJoints), away = minus(middle, mean(platformJoints(frameAt(0))));
  const radius = Math.max(...report.baseJoints.map(joint => size(minus(joint, middle))));
  const places = report.baseJoints.map(joint => joint.map(
    (value, k) => value + 0.14 * (value - middle[k]) + 0.22 * radius * away[k] / size(away)));
  return places.map((place, n) => {
    const [gap, other] = places.map((each, m) => [m === n ? Infinity : size(minus(place, each)), each])
      .reduce((a, b) => (a[0] <= b[0] ? a : b));
    const aside = Math.max(0, 0.5 * (0.5 * radius - gap)) / gap;
    return place.map((value, k) => value + aside * (value - other[k]));
  });
}

// Without the letters that all names begin with, where there is no room for more.
function namesInScene(narrow) {
  const [first, ...others] = report.legs;
  let common = 0;
  while (narrow && common < first.length - 1 && others.every(
    name => name[common] === first[common] && name.length > common + 1)) common++;
  return report.legs.map(name => plainText(shortened(name.slice(common))));
}

function baseTraces(narrow) {
  return [
    plate(report.baseJoints, color('faint'), 0.35),
    outline(report.baseJoints, {line: {color: color('soft'), width: 4}, marker: {size: 4, color: color('soft')}}),
    {type: 'scatter3d', mode: 'text', ...xyz(besideBase()), text: namesInScene(narrow),
      textposition: 'middle center', textfont: {size: 11, color: INK}, ...SILENT}];
}

// A scene of the hexapod is not much higher than wide.
function drawScene(canvas, traces, numbers, below = 0) {
  const height = Math.min(520, Math.max(300, Math.round(1.15 * canvas.clientWidth)));
  Plotly.newPlot(canvas, [...baseTraces(canvas.clientWidth < NARROW), ...traces], {height, margin: {l: 0, r: 0, t: 0, b: below}, font: FONT,
    showlegend: false, hovermode: false, separators: `.${THIN_SPACE}`, scene: scene(numbers, canvas.clientWidth),
    paper_bgcolor: PAPER}, CONFIG_3D);
}

// The effort at the end of the color scale; a few spikes do not set it.
function colorReach() {
  const sizes = [];
  for (let n = 0; n < frames.times.length; n++) {
    for (const effort of frameAt(n).efforts) if (Number.isFinite(effort)) sizes.push(Math.abs(effort));
  }
  if (!sizes.length) return 1;
  sizes.sort((a, b) => a - b);
  const most = sizes[sizes.length - 1], usual = sizes[Math.floor(0.5 * (sizes.length - 1))];
  const reach = most > 5 * usual && usual > 0 ? 3 * usual : most;
  return +reach.toPrecision(2) || 1;
}

class Player extends Drawing {
  constructor(place) {
    super(place, {className: 'canvas tall', id: 'platform'});
    this.frame = -1;
    this.wanted = 0;
    this.busy = false;
    this.reach = colorReach();
    this.legValues = listIn(this.readout, ['leg', inUnit(report.effort), inUnit(report.position)],
      report.legs.map((name, n) => [swatch(color(`leg${n}`)), name]));
    this.poseValues = listIn(this.readout, ['platform', ''],
      ['X [m]', 'Y [m]', 'Z [m]', 'alpha [deg]', 'beta [deg]', 'gamma [deg]']);
    this.sample = element('p', {className: 'note'});
    this.readout.append(this.sample);
  }

  appear() {
    if (!this.drawn) this.draw();
    this.show();
  }

  draw() {
    const frame = frameAt(0), joints = platformJoints(frame);
    const narrow = this.canvas.clientWidth < NARROW;
    this.frame = 0;
    drawScene(this.canvas, [
      plate(joints, PLATFORM, 0.45),
      outline(joints, {line: {color: PLATFORM_EDGE, width: 5}, marker: {size: 4, color: PLATFORM_EDGE}}),
      {type: 'scatter3d', mode: 'lines', ...legLines(joints, frame), ...SILENT, connectgaps: false,
        line: {width: 13, color: legColors(frame), colorscale: FORCE_SCALE, cmin: -this.reach, cmax: this.reach,
          showscale: true, colorbar: {title: {text: `leg ${inUnit(report.effort)}${narrow ? ', ' : '<br>'}${report.effort.positive}`, side: 'top'},
            thickness: 14, outlinewidth: 0, separatethousands: true, exponentformat: 'none',
            ...(narrow ? {orientation: 'h', len: 0.9, nticks: 5, x: 0.5, y: 0, yanchor: 'top'} : {len: 0.7, x: 1})}}},
    ], frames.times.keys(), narrow ? 70 : 0);
    this.drawn = true;
    this.showValues(0);
  }

  show() {
    this.wanted = nearest(frames.times, time.cursor);
    if (!this.inView || this.busy || this.wanted === this.frame) return;
    this.busy = true;
    requestAnimationFrame(async () => {
      try {
        await this.take(this.wanted);
      } finally {
        this.busy = false;
      }
      this.show();
    });
  }

  async take(number) {
    const frame = frameAt(number), joints = platformJoints(frame);
    const places = [xyz(joints), xyz([...joints, joints[0]]), legLines(joints, frame)];
    this.frame = number;
    this.showValues(number);
    await Plotly.restyle(this.canvas, {
      x: places.map(each => each.x), y: places.map(each => each.y), z: places.map(each => each.z),
      'line.color': [undefined, PLATFORM_EDGE, legColors(frame)]}, [3, 4, 5]);
  }

  showValues(number) {
    const frame = frameAt(number);
    this.legValues.forEach(([effort, position], n) => {
      effort.textContent = Number.isFinite(frame.efforts[n]) ? shown(frame.efforts[n]) : 'none';
      position.textContent = shown(frame.positions[n]);
    });
    const pose = [...frame.position, ...frame.angles];
    this.poseValues.forEach(([cell], n) => { cell.textContent = shown(pose[n]); });
    this.sample.textContent = `sample at t = ${grouped(frames.times[number], 3)} s`
      + (frames.times.length < report.samples ? `, one of ${grouped(frames.times.length)} shown` : '');
  }
}

class InitialAndFinal extends Drawing {
  constructor(place) {
    super(place, {className: 'canvas tall', id: 'plot_ends'},
      titled('Platform at initial and final position'));
    this.ends = [[0, FAINT, 4, 'initial'], [frames.times.length - 1, color('leg1'), 5, 'final']];
    listIn(this.readout, [], this.ends.map(
      ([number, of, , name]) => [swatch(of), `${name}, t = ${grouped(frames.times[number], 3)} s`]));
  }

  appear() {
    if (this.drawn) return;
    this.drawn = true;
    drawScene(this.canvas, this.ends.flatMap(([number, of, width]) => {
      const frame = frameAt(number), joints = platformJoints(frame), line = {color: of, width};
      return [plate(joints, of, 0.4), outline(joints, {line, marker: {size: 4, color: of}}),
        {type: 'scatter3d', mode: 'lines', ...legLines(joints, frame), ...SILENT, line}];
    }), column(this.ends, 0));
  }
}

// ---- playing

const playing = {since: null, from: 0};

function label(text, ariaLabel) {
  Object.assign(document.getElementById('play'), {textContent: text, ariaLabel});
}

function stop() {
  playing.since = null;
  label('▶', 'play');
}

function play() {
  if (time.cursor >= report.end) moveCursor(report.begin);
  playing.from = time.cursor;
  playing.since = performance.now();
  label('❚❚', 'pause');
  requestAnimationFrame(playOn);
}

function playOn() {
  if (playing.since === null) return;
  const speed = +document.getElementById('speed').value;
  const now = playing.from + speed * Math.max(performance.now() - playing.since, 0) / 1000;
  moveCursor(now);
  if (now >= report.end) stop(); else requestAnimationFrame(playOn);
}

function setUpBar() {
  const slider = document.getElementById('slider'), speed = document.getElementById('speed');
  slider.min = report.begin;
  slider.max = report.end;
  const speeds = [0.1, 0.25, 0.5, 1, 2, 5, 10, 20, 50, 100, 200, 500, 1000].filter(
    each => each <= 1 || duration / each >= 2);
  for (const each of speeds) speed.append(element('option', {value: each, textContent: `${each} ×`}));
  // the whole motion in at most a minute
  speed.value = speeds.find(each => each >= 1 && duration / each <= 60) || speeds[speeds.length - 1];
  speed.addEventListener('change', () => { if (playing.since !== null) { stop(); play(); } });
  slider.addEventListener('input', () => {
    stop();
    moveCursor(frames.times[nearest(frames.times, +slider.value)]);
  });
  slider.addEventListener('keydown', event => {
    const step = {ArrowRight: 1, ArrowUp: 1, ArrowLeft: -1, ArrowDown: -1}[event.key];
    if (!step) return;
    event.preventDefault();
    stop();
    const next = nearest(frames.times, time.cursor) + step;
    moveCursor(frames.times[Math.min(Math.max(next, 0), frames.times.length - 1)]);
  });
  document.getElementById('play').addEventListener('click', () => {
    if (playing.since === null) play(); else stop();
  });
  document.getElementById('whole').addEventListener('click', () => zoomTo(wholeRange));
  document.getElementById('bar').hidden = false;
}

// ---- the page

function setUp() {
  if (!report.samples) return;
  const place = document.getElementById('plots');
  if (typeof Plotly === 'undefined') {
    document.getElementById('motion').hidden = true;
    place.replaceChildren(element('p', {className: 'note', textContent:
      'The plots need the file plotly-….min.js of the folder of results: move reports together with it.'}));
    return;
  }
  setUpBar();
  player = new Player(document.getElementById('motion'));
  for (const spec of report.plots) {
    if (spec.key === 'determinant') new InitialAndFinal(place);
    const section = document.getElementById(spec.section);
    if (spec.spectrum) spectra.push(new SpectrumPlot(spec, section));
    else plots.push(new TimePlot(spec, section));
  }
  moveCursor(report.begin);
}

document.addEventListener('click', event => {
  const button = event.target.closest('button.at');
  if (button && plots.length) {
    stop();
    showTime(+button.dataset.at);
    const plot = document.getElementById(`plot_${button.dataset.plot}`) || document.getElementById('plots');
    plot.scrollIntoView({block: 'center'});
  }
});

// For printing all plots are drawn, in the width of the paper.
const PAPER_WIDTH = 500;  // [px], beside the values in 186
const FAR = 1.44;  // of a scene of this width, with a color bar
window.addEventListener('beforeprint', () => {
  for (const drawing of byCanvas.values()) {
    inView.add(drawing);
    const far = Math.max(1, FAR / distance(drawing.canvas.clientWidth));
    drawing.appear();
    Plotly.relayout(drawing.canvas, {width: PAPER_WIDTH, ...seenFrom(drawing, far)});
    drawing.back = 1 / far;
  }
});
window.addEventListener('afterprint', () => {
  for (const drawing of byCanvas.values()) {
    Plotly.relayout(drawing.canvas, {width: null, autosize: true, ...seenFrom(drawing, drawing.back)});
  }
});
// The change of layout by which a scene is seen from farther away.
function seenFrom(drawing, far) {
  const {scene} = drawing.canvas.layout;
  if (!scene) return {};
  const {x, y, z} = scene.camera.eye;
  return {'scene.camera.eye': {x: far * x, y: far * y, z: far * z}};
}

setUp();
