// The plots over time: drawn when they come into sight, with the page's time as a line, and the values at it in words.

import uPlot from 'uplot';
import { DASHES, colourOf, colourOfColumn, element, onTheme, palette, shown, unitText } from './look.js';

const HEIGHT = 150; // px
const PRINTED = 332; // px, on paper

/** How a curve looks by its role, for a page with one flight. */
function lookOf(role) {
  const c = palette();
  return {
    true: { stroke: c.blue, width: 1.6, dash: [] },
    believed: { stroke: c.orange, width: 1.6, dash: [7, 3] },
    command: { stroke: c.green, width: 1.1, dash: [2, 2] },
    asked: { stroke: c.ink, width: 1.1, dash: [6, 4] },
    threshold: { stroke: c.purple, width: 1.4, dash: [8, 3, 2, 3] },
    more: { stroke: c.blue, width: 1.4, dash: [] },
  }[role];
}

/** The times of all flights together, and each flight's record at each; null where it has none. */
function joined(flights) {
  const [first, ...others] = flights;
  const same = others.every((flight) => {
    const last = Math.min(flight.time.length, first.time.length) - 1;
    return flight.time[last] === first.time[last] && flight.time[1] === first.time[1];
  });
  if (same) {
    const longest = flights.reduce((a, b) => (b.time.length > a.time.length ? b : a));
    return { time: longest.time, records: flights.map(() => null) };
  }
  const time = Float64Array.from(new Set(flights.flatMap((flight) => [...flight.time]))).sort();
  const records = flights.map((flight) => {
    const known = new Map([...flight.time].map((t, i) => [t, i]));
    return [...time].map((t) => known.get(t) ?? -1);
  });
  return { time, records };
}

/** Width in px that an upright axis takes: what its longest number needs, its minus sign included. */
function room(u, numbers, k, cycle) {
  const axis = u.axes[k];
  const least = cycle > 1 ? axis._size : 52; // it only grows while it is laid out, so that it settles
  u.ctx.font = axis.font[0];
  const widest = Math.max(0, ...(numbers ?? []).map((text) => u.ctx.measureText(text).width / devicePixelRatio));
  return Math.max(least, Math.ceil(widest + axis.ticks.size + axis.gap + 4));
}

/** Values of a column over the joined times; undefined where the flight has no record then, null for a gap. */
function valuesOn(flight, curve, grid, index) {
  const signal = flight.signals[curve.signal];
  const values = signal?.values[curve.column];
  if (!values) return new Array(grid.time.length).fill(null);
  const records = grid.records[index];
  const all = records === null
    ? Array.from({ length: grid.time.length }, (_, i) => (i < values.length ? values[i] : null))
    : records.map((record) => (record < 0 ? undefined : values[record]));
  return all.map((value) => (value !== undefined && value !== null && !Number.isFinite(value) ? null : value));
}

export class Plots {
  constructor(parent, flights, clock, onScrub) {
    this.parent = parent;
    this.flights = flights;
    this.clock = clock;
    this.onScrub = onScrub;
    this.chosen = 0;
    this.window = [Math.min(...flights.map((f) => f.start)), Math.max(...flights.map((f) => f.end))];
    this.grid = null;
    this.cards = [];
    this.seer = new IntersectionObserver((entries) => {
      for (const entry of entries) {
        const card = this.cards.find((one) => one.root === entry.target);
        if (!card) continue;
        card.near = entry.isIntersecting;
        if (card.near) this.draw(card);
      }
    }, { rootMargin: '300px' });
    this.build();
    onTheme(() => this.again());
    addEventListener('resize', () => this.again());
    addEventListener('beforeprint', () => {
      this.printing = true; // paper has two columns, whatever the screen has
      this.cards.forEach((card) => {
        this.draw(card);
        card.plot?.setSize({ width: PRINTED, height: HEIGHT });
      });
    });
    addEventListener('afterprint', () => {
      this.printing = false;
      this.again();
    });
    clock.onTime(() => this.lines());
    clock.onTime(() => this.mark(), 10);
    clock.onChange(() => this.mark());
  }

  /** A heading per group, a card per panel; panels of all flights, once each. */
  build() {
    const panels = new Map();
    for (const flight of this.flights) for (const panel of flight.panels) if (!panels.has(panel.name)) panels.set(panel.name, panel);
    const groups = new Map();
    for (const panel of panels.values()) {
      if (!groups.has(panel.group)) groups.set(panel.group, []);
      groups.get(panel.group).push(panel);
    }
    for (const [name, members] of groups) this.group(name, members);
    this.more();
  }

  group(name, members) {
    const section = element('section', 'plots');
    section.append(element('h2', '', name));
    const cards = element('div', 'cards');
    section.append(cards);
    this.parent.append(section);
    for (const panel of members) this.card(cards, panel);
    return cards;
  }

  /** What no panel shows, by choice of the reader. */
  more() {
    const names = new Map();
    for (const flight of this.flights) {
      for (const [name, signal] of Object.entries(flight.signals)) names.set(name, signal);
    }
    const section = element('section', 'plots more');
    section.append(element('h2', '', 'Any other signal'));
    const row = element('p');
    const choice = element('select');
    choice.setAttribute('aria-label', 'signal to plot');
    choice.append(new Option('choose a signal …', ''));
    for (const name of [...names.keys()].sort()) choice.append(new Option(name, name));
    row.append(choice, element('span', 'soft', ' every signal that the parts of the loop recorded'));
    const cards = element('div', 'cards');
    section.append(row, cards);
    this.parent.append(section);
    choice.addEventListener('change', () => {
      const signal = names.get(choice.value);
      if (!signal) return;
      const curves = signal.columns.map((label, column) => ({ signal: choice.value, column, label: label || 'value', role: 'more' }));
      this.card(cards, { name: choice.value, title: choice.value, unit: signal.unit, about: signal.about, curves, levels: [], shade: null }, true);
      choice.value = '';
    });
  }

  card(parent, panel, closable = false) {
    const root = element('div', 'card');
    const head = element('div', 'head');
    const unit = unitText(panel.unit);
    head.append(element('b', '', panel.title + (unit ? ` (${unit})` : '')));
    const about = panel.about ?? this.flights.map((flight) => flight.signals[panel.name]?.about).find(Boolean);
    if (about) root.title = about;
    const values = element('span', 'values');
    head.append(values);
    const body = element('div', 'body');
    body.style.minHeight = `${HEIGHT}px`;
    root.append(head, body);
    parent.append(root);
    const card = { root, panel, body, values, plot: null, near: false };
    if (closable) {
      const close = element('button', 'close', '×');
      close.title = 'remove this plot';
      close.addEventListener('click', () => {
        card.plot?.destroy();
        root.remove();
        this.cards = this.cards.filter((one) => one !== card);
      });
      head.append(close);
    }
    this.cards.push(card);
    this.seer.observe(root);
    this.legend(card);
  }

  /** The curves of a card: of one flight by role, of several by flight and role. */
  curves(panel) {
    const alone = this.flights.length === 1;
    return this.flights.flatMap((flight, index) =>
      panel.curves.filter((curve) => flight.signals[curve.signal]?.values[curve.column]).map((curve, k) => {
        const look = { ...lookOf(curve.role) };
        if (curve.role === 'more') {
          look.stroke = alone ? colourOfColumn(k) : colourOf(index);
          look.dash = DASHES[(alone ? Math.floor(k / 6) : k) % DASHES.length];
        } else if (!alone) {
          look.stroke = colourOf(index);
        }
        return { ...curve, flight, index, look };
      }),
    );
  }

  draw(card) {
    if (card.plot) return;
    const width = card.body.clientWidth;
    if (!width) return;
    this.grid ??= joined(this.flights);
    const colours = palette();
    const curves = this.curves(card.panel);
    const data = [this.grid.time, ...curves.map((curve) => valuesOn(curve.flight, curve, this.grid, curve.index))];
    const axis = { stroke: colours.soft, grid: { stroke: colours.line, width: 0.5 }, ticks: { stroke: colours.line, width: 0.5 }, font: '11px system-ui, sans-serif' };
    const options = {
      width,
      height: HEIGHT,
      legend: { show: false },
      cursor: { drag: { x: false, y: false }, x: false, y: false, points: { show: false } },
      scales: { x: { time: false, min: this.window[0], max: this.window[1] }, y: { range: (u, low, high) => this.range(card, low, high) } },
      axes: [{ ...axis, size: 26, values: (u, ticks) => ticks.map((t) => `${shown(t, 6).replace(/\.?0+$/, '')}`), space: 60 }, { ...axis, size: room, space: 26, values: (u, ticks) => ticks.map((t) => ticked(t, ticks)) }],
      series: [{}, ...curves.map((curve) => ({ stroke: curve.look.stroke, width: curve.look.width, dash: curve.look.dash, points: { show: false }, spanGaps: true }))],
      hooks: { drawClear: [(u) => this.behind(u, card)] },
    };
    card.plot = new uPlot(options, data, card.body);
    card.line = element('div', 'now-line');
    card.plot.over.append(card.line);
    this.scrubbing(card);
    this.place(card, this.clock.time);
    this.lines();
  }

  /** Room for the curves, for zero width never, and for a limit if it is not far away. */
  range(card, low, high) {
    if (low === null || high === null || !Number.isFinite(low) || !Number.isFinite(high)) return [-1, 1];
    let [a, b] = [low, high];
    for (const [value] of card.panel.levels) {
      if (value > b && value - b < 0.8 * (b - a || 1)) b = value;
      if (value < a && a - value < 0.8 * (b - a || 1)) a = value;
    }
    const least = Math.max(1e-3 * Math.max(Math.abs(a), Math.abs(b)), 1e-9);
    if (b - a < least) {
      const half = Math.max(Math.abs(a), 1e-6) * 0.1;
      [a, b] = [a - half, b + half];
    }
    const pad = 0.07 * (b - a);
    return [a - pad, b + pad];
  }

  /** Behind the curves: where a rotor is flagged or something was cut, fault onsets, limits. */
  behind(u, card) {
    const c = u.ctx;
    const colours = palette();
    const { left, top, width, height } = u.bbox;
    c.save();
    c.beginPath();
    c.rect(left, top, width, height);
    c.clip();
    const flight = this.flights[this.chosen];
    const [signal, column] = card.panel.shade ?? [];
    const values = flight.signals[signal]?.values[column]; // a flight with fewer rotors has none
    if (values) {
      c.fillStyle = `${colours.purple}30`;
      let from = -1;
      for (let i = 0; i <= values.length; i++) {
        const on = i < values.length && values[i] > 0.5;
        if (on && from < 0) from = i;
        if (!on && from >= 0) {
          const x0 = u.valToPos(flight.time[from], 'x', true);
          const x1 = u.valToPos(flight.time[Math.min(i, values.length - 1)], 'x', true);
          c.fillRect(x0, top, Math.max(x1 - x0, 1), height);
          from = -1;
        }
      }
    }
    c.lineWidth = devicePixelRatio || 1;
    c.strokeStyle = colours.ink;
    c.setLineDash([2, 3]);
    for (const event of flight.events) {
      if (event.kind !== 'fault') continue;
      const x = Math.round(u.valToPos(event.time, 'x', true));
      c.beginPath();
      c.moveTo(x, top);
      c.lineTo(x, top + height);
      c.stroke();
    }
    c.strokeStyle = colours.soft;
    c.setLineDash([1, 3]);
    for (const [value] of card.panel.levels) {
      const y = Math.round(u.valToPos(value, 'y', true));
      c.beginPath();
      c.moveTo(left, y);
      c.lineTo(left + width, y);
      c.stroke();
    }
    c.restore();
  }

  scrubbing(card) {
    const over = card.plot.over;
    let held = false;
    const seek = (event) => {
      const box = over.getBoundingClientRect();
      this.onScrub(card.plot.posToVal(event.clientX - box.left, 'x'));
    };
    over.addEventListener('pointerdown', (event) => {
      if (event.pointerType === 'touch') return;
      held = true;
      over.setPointerCapture(event.pointerId);
      seek(event);
    });
    over.addEventListener('pointermove', (event) => held && seek(event));
    for (const kind of ['pointerup', 'pointercancel']) over.addEventListener(kind, () => (held = false));
    // On a telephone a finger scrolls; a tap goes to the time.
    over.addEventListener('click', seek);
  }

  legend(card) {
    card.values.replaceChildren();
    card.numbers = this.curves(card.panel).map((curve) => {
      const item = element('span', 'item');
      const key = element('span', 'key-line');
      key.style.borderTopColor = curve.look.stroke;
      key.style.borderTopStyle = curve.look.dash.length ? (curve.look.dash[0] > 3 ? 'dashed' : 'dotted') : 'solid';
      const number = element('span', 'number');
      const label = this.flights.length > 1 ? `${curve.index + 1} ${curve.label}` : curve.label;
      item.append(key, element('span', 'soft', `${label} `), number);
      card.values.append(item);
      return { curve, number };
    });
    if (card.panel.levels.length) {
      const words = card.panel.levels.map(([value, word]) => `${word} ${shown(value, 3)}`).join(', ');
      card.values.append(element('span', 'item soft', `limits: ${words}`));
    }
  }

  /** The line of the moment in the plots that are in sight. */
  lines() {
    const { time } = this.clock;
    const share = (time - this.window[0]) / (this.window[1] - this.window[0] || 1);
    for (const card of this.cards) {
      if (!card.near || !card.plot) continue;
      card.line.style.display = share >= 0 && share <= 1 ? '' : 'none';
      card.line.style.left = `${100 * share}%`;
    }
  }

  mark() {
    const { time } = this.clock;
    for (const card of this.cards) if (card.near || card.plot) this.place(card, time);
    this.lines();
  }

  place(card, time) {
    if (!card.near) return;
    for (const { curve, number } of card.numbers) {
      const { flight } = curve;
      const text = time > flight.end + 1e-6 ? 'ended' : shown(flight.value(curve.signal, curve.column, flight.at(time)), 3);
      if (number.textContent !== text) number.textContent = text;
    }
  }

  show(window) {
    this.window = window;
    for (const card of this.cards) card.plot?.setScale('x', { min: window[0], max: window[1] });
    this.mark();
  }

  choose(index) {
    this.chosen = index;
    for (const card of this.cards) card.plot?.redraw(false);
  }

  again() {
    if (this.printing) return;
    for (const card of this.cards) {
      card.plot?.destroy();
      card.plot = null;
      this.legend(card);
      if (card.near) this.draw(card);
    }
  }
}

/** A tick in the fewest digits that tell it from its neighbours. */
function ticked(value, ticks) {
  if (Math.abs(value) < 1e-12) return '0';
  const step = ticks.length > 1 ? Math.abs(ticks[1] - ticks[0]) : Math.abs(value);
  if (Math.abs(value) >= 1e5 || step < 1e-4) return value.toExponential(step < Math.abs(value) / 10 ? 1 : 0).replace('-', '−').replace('e−', 'e-');
  let decimals = 0;
  while (decimals < 6 && Math.abs(step * 10 ** decimals - Math.round(step * 10 ** decimals)) > 1e-6) decimals += 1;
  return value.toFixed(decimals).replace('-', '−');
}
