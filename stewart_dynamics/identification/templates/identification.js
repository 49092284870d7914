'use strict';
const data = JSON.parse(document.getElementById('data').textContent);
const color = (name) => getComputedStyle(document.body).getPropertyValue(`--${name}`).trim();
const FONT = {family: 'system-ui, sans-serif', size: 13, color: color('ink')};
const CONFIG = {responsive: true, displaylogo: false, modeBarButtonsToRemove: ['select2d', 'lasso2d']};

function numbers(text) {
  const bytes = Uint8Array.from(atob(text), (each) => each.charCodeAt(0));
  return new Float32Array(bytes.buffer);
}

function layout(y, more) {
  return {
    font: FONT, margin: {l: 70, r: 16, t: 10, b: 44}, legend: {orientation: 'h', y: 1.12},
    xaxis: {title: {text: 'time [s]'}, gridcolor: color('grid'), zeroline: false},
    yaxis: {title: {text: y}, gridcolor: color('grid'), zerolinecolor: color('zero')},
    hovermode: 'x unified', ...more,
  };
}

const columns = data.curves.map(numbers);
const times = columns[0];
const line = (name, y, of, width, dash) => (
  {x: times, y, name, type: 'scatter', mode: 'lines', line: {color: of, width, dash}, connectgaps: false});
const drawn = Math.ceil(times.length / 3000);  // of so many residuals over the rate one
const less = (a, b) => a.map((each, n) => each - b[n]);

// Forces and residuals of one leg.
let range = null;
function show(leg) {
  const [effort, before, after, rate] = [1, 7, 13, 19].map((first) => columns[first + leg]);
  Plotly.react('forces', [
    line('measured', effort, color('black'), 2.2), line('by the file', before, color('leg4'), 1.4),
    line('by the identified parameters', after, color('leg0'), 1.4, 'dot')], layout(`${data.effort} [${data.unit}]`), CONFIG);
  Plotly.react('residuals', [
    line('residual by the file', less(effort, before), color('leg4'), 1.2),
    line('by the identified parameters', less(effort, after), color('leg0'), 1.2)], layout(`residual [${data.unit}]`), CONFIG);
  const some = (each) => each.filter((_, n) => n % drawn === 0);
  Plotly.react('rates', [[before, 'by the file', 'leg4'], [after, 'by the identified parameters', 'leg0']].map(([force, name, of]) => ({
    x: some(rate), y: some(less(effort, force)), name, type: 'scatter', mode: 'markers', marker: {size: 3, color: color(of), opacity: 0.5},
  })), layout(`residual [${data.unit}]`, {
    xaxis: {title: {text: `${data.rate} of the leg [${data.rate_unit}]`}, gridcolor: color('grid'), zerolinecolor: color('zero')}, hovermode: 'closest',
  }), CONFIG);
  document.querySelectorAll('#legs button').forEach((button, n) => button.setAttribute('aria-pressed', n === leg));
}

data.legs.forEach((name, leg) => {
  const button = document.createElement('button');
  button.type = 'button';
  button.textContent = name;
  button.addEventListener('click', () => show(leg));
  document.getElementById('legs').append(button);
});
show(data.first);
for (const [one, other] of [['forces', 'residuals'], ['residuals', 'forces']]) {
  document.getElementById(one).on('plotly_relayout', (change) => {
    const wanted = change['xaxis.autorange'] ? null : [change['xaxis.range[0]'], change['xaxis.range[1]']];
    if (wanted && wanted[0] === undefined || JSON.stringify(wanted) === JSON.stringify(range)) return;
    range = wanted;
    Plotly.relayout(other, wanted ? {'xaxis.range': wanted.slice()} : {'xaxis.autorange': true});
  });
}

const spectra = data.spectra.map(({frequencies, values}) => ({x: numbers(frequencies), y: numbers(values)}));
if (spectra.length) {
  const traces = spectra.map(({x, y}, n) => ({
    x, y, mode: 'lines', name: n < 6 ? 'by the file' : data.legs[n - 6], legendgroup: n < 6 ? 'file' : data.legs[n - 6],
    showlegend: n === 0 || n > 5, line: {color: color(n < 6 ? 'faint' : `leg${n - 6}`), width: n < 6 ? 1 : 1.5},
    opacity: n < 6 ? 0.6 : 1,
  }));
  Plotly.newPlot('spectrum', traces, layout(`residual [${data.unit}/√Hz]`, {
    xaxis: {title: {text: 'frequency [Hz]'}, type: 'log', gridcolor: color('grid')},
    yaxis: {title: {text: `residual [${data.unit}/√Hz]`}, type: 'log', gridcolor: color('grid')}, hovermode: 'closest',
  }), CONFIG);
} else document.getElementById('spectrum').textContent = 'Too few samples for a spectrum.';
