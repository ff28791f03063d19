// The axis of events in words, the scrubber, the buttons, the keyboard.

import { SPEEDS } from './clock.js';
import { colourOf, element, onTheme, palette, shown, sign } from './look.js';

const WORDED = ['fault', 'alarm', 'false_alarm', 'isolated', 'switch', 'spin', 'touch_down', 'end'];

const ASIDE = ['saturation', 'given_up'];

function colourFor(kind) {
  const c = palette();
  return { fault: c.vermilion, alarm: c.purple, false_alarm: c.orange, isolated: c.green, cleared: c.soft, switch: c.blue, spin: c.blue, touch_down: c.green, end: c.ink, saturation: c.orange, given_up: c.vermilion }[kind];
}

/** What happened at once, and is of one kind, in one line. */
function together(events) {
  const found = [];
  for (const event of events) {
    const same = found.find((one) => one.time === event.time && one.kind === event.kind && one.until === null && event.until === null);
    if (same) same.text += `, ${event.text}`;
    else found.push({ ...event });
  }
  return found;
}

export class Timeline {
  constructor({ lanes, scrubber, clockText, play, speed, zoom, list, rest, latest }, flights, clock, onWindow) {
    Object.assign(this, { lanes, scrubber, clockText, play, speed, zoom, list, rest, latest, flights, clock, onWindow });
    this.whole = [clock.start, clock.end];
    this.window = this.whole;
    scrubber.min = 0;
    scrubber.max = 10000;
    scrubber.step = 'any';
    scrubber.addEventListener('input', () => clock.seek(this.timeOf(Number(scrubber.value) / 10000)));
    play.addEventListener('click', () => clock.toggle());
    for (const value of SPEEDS) speed.append(new Option(`${value}×`, value));
    speed.addEventListener('change', () => clock.setSpeed(Number(speed.value)));
    this.close = this.around();
    zoom.hidden = !this.close;
    zoom.addEventListener('click', () => this.setWindow(this.window === this.whole ? this.close : this.whole));
    clock.onTime(() => this.move());
    clock.onChange(() => this.state());
    onTheme(() => {
      this.fill();
      this.drawEvents();
    });
    new ResizeObserver(() => this.drawEvents()).observe(lanes);
    this.fill();
    this.drawEvents();
    this.move();
    this.state();
  }

  /** The seconds around the faults and alarms; null where that is most of the flight. */
  around() {
    const times = this.flights.flatMap((flight) => flight.events.filter((e) => ['fault', 'alarm', 'isolated'].includes(e.kind)).map((e) => e.time));
    if (!times.length) return null;
    const [a, b] = [Math.min(...times), Math.max(...times)];
    const room = Math.max(0.15, 1.5 * (b - a));
    const window = [Math.max(this.whole[0], a - room / 2), Math.min(this.whole[1], b + 2 * room)];
    return window[1] - window[0] < 0.5 * (this.whole[1] - this.whole[0]) ? window : null;
  }

  setWindow(window) {
    this.window = window;
    this.zoom.textContent = window === this.whole ? 'Zoom to faults' : 'Whole flight';
    this.drawEvents();
    this.move();
    this.onWindow(window);
  }

  timeOf(share) {
    return this.window[0] + share * (this.window[1] - this.window[0]);
  }

  shareOf(time) {
    return (time - this.window[0]) / (this.window[1] - this.window[0] || 1);
  }

  move() {
    const { time } = this.clock;
    const value = Math.min(Math.max(this.shareOf(time), 0), 1) * 10000;
    if (document.activeElement !== this.scrubber || this.clock.playing || Math.abs(value - this.scrubber.value) > 1) this.scrubber.value = value;
    const text = `${time.toFixed(3)} s`;
    this.clockText.textContent = text;
    this.scrubber.setAttribute('aria-valuetext', text);
    const last = this.flights.flatMap((flight) => flight.events).filter((e) => e.time <= time + 1e-6).reduce((a, b) => (a && a.time > b.time ? a : b), null);
    const words = last ? `${last.time.toFixed(3)} s: ${last.text}` : '';
    if (this.latest.textContent !== words) this.latest.textContent = words;
  }

  state() {
    this.play.textContent = this.clock.playing ? 'Pause' : 'Play';
    this.play.setAttribute('aria-pressed', this.clock.playing);
    if (!SPEEDS.includes(this.clock.speed) && ![...this.speed.options].some((o) => Number(o.value) === this.clock.speed)) {
      this.speed.append(new Option(`${this.clock.speed}×`, this.clock.speed));
    }
    this.speed.value = String(this.clock.speed);
    this.move();
  }

  drawEvents() {
    this.lanes.replaceChildren();
    const width = this.lanes.clientWidth;
    if (!width) return;
    this.flights.forEach((flight, k) => {
      const lane = element('div', 'lane');
      if (this.flights.length > 1) {
        const name = element('span', 'lane-name', `${k + 1}`);
        name.style.color = colourOf(k);
        lane.append(name);
      }
      this.lanes.append(lane);
      this.drawLane(lane, flight, width);
    });
  }

  drawLane(lane, flight, width) {
    // Where the words of each row end, in px. Several flights have a row each, so that the plots keep their room.
    const ends = new Array({ 1: 3, 2: 1 }[this.flights.length] ?? 0).fill(-Infinity);
    let rows = 0;
    for (const event of together(flight.events)) {
      // A flight ends one period after its last record.
      const share = event.kind === 'end' ? this.shareOf(Math.min(event.time, flight.end)) : this.shareOf(event.time);
      if (event.until !== null && event.until !== undefined) {
        const [from, to] = [share, this.shareOf(event.until)].map((s) => Math.min(Math.max(s, 0), 1));
        if (to <= 0 || from >= 1) continue;
        const bar = element('span', `bar ${event.kind}`);
        bar.style.left = `${100 * from}%`;
        bar.style.width = `max(2px, ${100 * (to - from)}%)`;
        bar.style.background = colourFor(event.kind);
        bar.title = `${shown(event.time, 5)} s: ${event.text}`;
        lane.append(bar);
        continue;
      }
      if (share < -1e-6 || share > 1 + 1e-6) continue;
      const x = share * width;
      const mark = element('button', 'event');
      mark.type = 'button';
      mark.tabIndex = -1; // the list below has them for the keyboard
      mark.style.left = `${100 * share}%`;
      mark.title = `${shown(event.time, 5)} s: ${event.text}`;
      mark.append(sign(event.kind, colourFor(event.kind)));
      mark.addEventListener('click', () => this.clock.seek(event.time));
      lane.append(mark);
      if (!WORDED.includes(event.kind)) continue;
      const words = element('span', 'words', event.text);
      mark.append(words);
      const needed = words.offsetWidth + 22;
      const flip = x + needed > width; // words at the right edge stand on the left of their sign
      const [from, to] = flip ? [x - needed, x + 10] : [x - 6, x + needed];
      const row = ends.findIndex((end) => end < from);
      if (row < 0 || (flip && from < 0)) {
        words.remove();
        continue;
      }
      ends[row] = to;
      rows = Math.max(rows, row + 1);
      mark.style.bottom = `calc(${(row + 1) * 1.3}rem + 8px)`;
      if (flip) mark.classList.add('flip');
    }
    lane.style.height = `calc(${(rows + 1) * 1.3}rem + 8px)`;
  }

  /** All events, to be read and to be gone to: what happened, and folded away which limits were met and what was cut. */
  fill() {
    const aside = (event) => ASIDE.includes(event.kind);
    this.lists(this.list, (event) => !aside(event));
    const count = this.flights.reduce((sum, flight) => sum + flight.events.filter(aside).length, 0);
    this.rest.hidden = !count;
    this.rest.firstElementChild.textContent = `Rotors at their limits, and what allocation cut: ${count}`;
    this.lists(this.rest.lastElementChild, aside);
  }

  /** Fill a list with some events; of several flights each has its own. */
  lists(list, which) {
    const several = this.flights.length > 1;
    list.replaceChildren();
    list.classList.add('events');
    list.classList.toggle('several', several);
    this.flights.forEach((flight, k) => {
      let parent = list;
      if (several) {
        const group = element('li');
        const colour = element('span', '', '■ ');
        colour.style.color = colourOf(k);
        const name = element('b');
        name.append(colour, `${k + 1} · ${flight.label}`);
        parent = element('ol');
        group.append(name, parent);
        list.append(group);
      }
      const found = flight.events.filter(which).sort((a, b) => a.time - b.time);
      for (const event of found) parent.append(this.row(event));
      if (!found.length) parent.append(element('li', 'soft', 'none'));
    });
  }

  /** An event in words, which leads to its time. */
  row(event) {
    const row = element('li');
    const go = element('button', 'go');
    go.type = 'button';
    go.append(element('span', 'n', `${event.time.toFixed(3)} s`), sign(event.kind, colourFor(event.kind)), element('span', '', event.text));
    go.addEventListener('click', () => this.clock.seek(event.time));
    row.append(go);
    return row;
  }

  /** Go to the next event (1) or the one before (-1). */
  toEvent(way) {
    const times = [...new Set(this.flights.flatMap((flight) => flight.events.map((event) => event.time)))].sort((a, b) => a - b);
    const { time } = this.clock;
    const next = way > 0 ? times.find((t) => t > time + 1e-6) : times.reverse().find((t) => t < time - 1e-6);
    if (next !== undefined) this.clock.seek(next);
  }
}
