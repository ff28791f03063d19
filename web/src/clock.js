// The one time of the page: everything that shows a moment listens to it. It is kept in the address, for deep links.

export const SPEEDS = [0.01, 0.02, 0.05, 0.1, 0.25, 0.5, 1, 2, 4];

export class Clock {
  constructor(start, end) {
    this.start = start;
    this.end = end;
    this.time = start;
    this.speed = 1;
    this.playing = false;
    this.listeners = [];
    this.changes = [];
    this.last = null;
    this.frame = this.frame.bind(this);
  }

  /** Call a function with the time whenever it moves; at most so many times a second while it plays, if that is given. */
  onTime(listener, rate = Infinity) {
    this.listeners.push({ listener, pause: 1000 / rate, last: -Infinity });
  }

  /** Call a function when playing, speed or a resting time changes. */
  onChange(listener) {
    this.changes.push(listener);
  }

  tell() {
    const now = performance.now();
    for (const one of this.listeners) {
      if (this.playing && now - one.last < one.pause) continue;
      one.last = now;
      one.listener(this.time);
    }
  }

  changed() {
    for (const listener of this.changes) listener();
  }

  seek(time) {
    if (!Number.isFinite(time)) return;
    this.time = Math.min(Math.max(time, this.start), this.end);
    this.tell();
    if (!this.playing) this.changed();
  }

  play() {
    if (this.playing) return;
    if (this.time >= this.end - 1e-9) this.time = this.start;
    this.playing = true;
    this.last = null;
    requestAnimationFrame(this.frame);
    this.changed();
  }

  pause() {
    this.playing = false;
    this.tell();
    this.changed();
  }

  toggle() {
    if (this.playing) this.pause();
    else this.play();
  }

  faster(steps) {
    const at = SPEEDS.findIndex((speed) => speed >= this.speed - 1e-9);
    this.setSpeed(SPEEDS[Math.min(Math.max(at + steps, 0), SPEEDS.length - 1)]);
  }

  setSpeed(speed) {
    if (!(speed > 0)) return;
    this.speed = Math.min(Math.max(speed, SPEEDS[0]), SPEEDS[SPEEDS.length - 1]);
    this.changed();
  }

  frame(now) {
    if (!this.playing) return;
    // A page that was in the background goes on where it was, and does not leap.
    const passed = this.last === null ? 0 : Math.min((now - this.last) / 1000, 0.25);
    this.last = now;
    this.time = Math.min(this.time + passed * this.speed, this.end);
    this.tell();
    if (this.time >= this.end) this.pause();
    else requestAnimationFrame(this.frame);
  }
}

/** What the address asks for: time t, flight, camera, view, speed, play. */
export function wanted() {
  const given = new URLSearchParams(location.hash.slice(1));
  const number = (key) => (given.has(key) ? Number(given.get(key)) : NaN);
  return {
    time: number('t'),
    flight: number('flight'),
    camera: given.get('camera'),
    view: given.get('view'),
    speed: number('speed'),
    play: given.get('play') === '1',
  };
}

/** Put the state into the address, without a step in the history. */
export function remember(state) {
  const kept = new URLSearchParams();
  for (const [key, value] of Object.entries(state)) if (value !== null) kept.set(key, value);
  try {
    history.replaceState(null, '', `#${kept}`);
  } catch {
    // Some viewers of local files do not allow it; the page works without.
  }
}
