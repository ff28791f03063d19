// Colours and small helpers. What curves and arrows stand for has the colours of Okabe and Ito (2008), flights have
// others; colour-blind readers tell all of them apart (tests/pages/test_look.py).

const COLOURS = ['#0072B2', '#D55E00', '#009E73', '#CC79A7', '#E69F00', '#56B4E9'];
const BRIGHT = ['#4BA3E3', '#F0803C', '#2BC79A', '#E29BC4', '#F0B93A', '#7CCBF5'];
const FLIGHTS = ['#002299', '#FF4444', '#8800FF', '#770000', '#665566', '#440055'];
const BRIGHT_FLIGHTS = ['#2266AA', '#FFEE00', '#BB00FF', '#995533', '#887788', '#BBFFBB'];
export const DASHES = [[], [8, 3, 2, 3], [2, 3], [10, 4], [6, 2, 2, 2, 2, 2], [1, 3]];

let dark = false;
const listeners = [];

export const isDark = () => dark;

/** Colour of the flight of an index, as the theme has it. */
export const colourOf = (index) => (dark ? BRIGHT_FLIGHTS : FLIGHTS)[index % FLIGHTS.length];

/** Colour of a column of a signal, where a page has one flight. */
export const colourOfColumn = (index) => (dark ? BRIGHT : COLOURS)[index % COLOURS.length];

/** Colours by what they stand for, as the theme has them. */
export function palette() {
  const [blue, vermilion, green, purple, orange, sky] = dark ? BRIGHT : COLOURS;
  return dark
    ? { blue, vermilion, green, purple, orange, sky, ink: '#e3e8ee', soft: '#97a1ac', line: '#3b444f', paper: '#14181d', tint: '#20262d', body: '#b9c2cc' }
    : { blue, vermilion, green, purple, orange, sky, ink: '#1b1f24', soft: '#57606a', line: '#d0d7de', paper: '#ffffff', tint: '#f4f6f8', body: '#4a545e' };
}

export function onTheme(listener) {
  listeners.push(listener);
}

function set(value) {
  if (value === dark) return;
  dark = value;
  for (const listener of listeners) listener();
}

/** Follow the system's theme, unless the reader chose one. Printing is light. */
export function startTheme(button) {
  const system = matchMedia('(prefers-color-scheme: dark)');
  let chosen = null;
  const apply = () => {
    const wish = chosen ?? (system.matches ? 'dark' : 'light');
    document.documentElement.dataset.theme = wish;
    button.textContent = wish === 'dark' ? 'Light' : 'Dark';
    button.title = `Show the page ${wish === 'dark' ? 'light' : 'dark'}`;
    set(wish === 'dark');
  };
  button.addEventListener('click', () => {
    chosen = dark ? 'light' : 'dark';
    apply();
  });
  system.addEventListener('change', apply);
  let before = null;
  addEventListener('beforeprint', () => {
    before = chosen;
    chosen = 'light';
    apply();
  });
  addEventListener('afterprint', () => {
    chosen = before;
    apply();
  });
  apply();
}

/** An element with a class and a text; text is never markup. */
export function element(tag, className = '', text = '') {
  const made = document.createElement(tag);
  if (className) made.className = className;
  if (text !== '') made.textContent = text;
  return made;
}

/** A number in so many significant digits, for people. */
export function shown(value, digits = 4) {
  if (!Number.isFinite(value)) return '–';
  const size = Math.abs(value);
  if (size === 0) return '0';
  if (size !== 0 && (size >= 1e5 || size < 1e-3)) return value.toExponential(1).replace('-', '−').replace('e−', 'e-');
  const decimals = size >= 1000 ? 0 : Math.max(0, digits - 1 - Math.floor(Math.log10(Math.max(size, 1e-3))));
  return value.toFixed(decimals).replace('-', '−');
}

export const unitText = (unit) => (unit === '1' ? '' : unit.replaceAll('^2', '²').replace('N m', 'N·m'));

export const degrees = (radians) => (radians * 180) / Math.PI;

const SHAPES = {
  fault: 'M2 2 L10 10 M10 2 L2 10', alarm: 'M6 1.5 L11 10.5 L1 10.5 Z', false_alarm: 'M6 1.5 L11 10.5 L1 10.5 Z', isolated: 'M6 1 a5 5 0 1 0 .01 0 M6 4 a2 2 0 1 0 .01 0',
  cleared: 'M6 2 a4 4 0 1 0 .01 0', switch: 'M6 1 L11 6 L6 11 L1 6 Z', touch_down: 'M1 2 L11 2 L6 10.5 Z', end: 'M2 2 H10 V10 H2 Z',
  spin: 'M10.5 6 a4.5 4.5 0 1 1 -1.6 -3.4 M9.6 .6 V3.2 H7', saturation: 'M1 6 H11', given_up: 'M1 4 H11 M1 8 H11',
};
const FILLED = ['alarm', 'switch', 'touch_down', 'end'];

/** The sign of a kind of event: shape and colour both tell it. */
export function sign(kind, colour) {
  const space = 'http://www.w3.org/2000/svg';
  const svg = document.createElementNS(space, 'svg');
  svg.setAttribute('viewBox', '0 0 12 12');
  svg.setAttribute('class', 'sign');
  svg.setAttribute('aria-hidden', 'true');
  const path = document.createElementNS(space, 'path');
  path.setAttribute('d', SHAPES[kind] ?? SHAPES.cleared);
  path.setAttribute('stroke', colour);
  path.setAttribute('stroke-width', '1.8');
  path.setAttribute('fill', FILLED.includes(kind) ? colour : 'none');
  svg.append(path);
  return svg;
}
