// The flights of the page, unpacked. The form is written by src/rotorfault/pages/tracks.py.

const NOTHING = 65535;
const LEVELS = 65534;

function bytesOf(text) {
  const raw = atob(text);
  const bytes = new Uint8Array(raw.length);
  for (let i = 0; i < raw.length; i++) bytes[i] = raw.charCodeAt(i);
  return bytes;
}

async function inflated(text) {
  if (!text) return new Uint8Array(0);
  const stream = new Blob([bytesOf(text)]).stream().pipeThrough(new DecompressionStream('deflate'));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

/** Times of the records in s. */
async function timesOf(packed) {
  const { count } = packed;
  if (packed.data === undefined) {
    return Float64Array.from({ length: count }, (_, i) => packed.start + i * packed.step);
  }
  return new Float64Array((await inflated(packed.data)).buffer);
}

/** One Float32Array per column. */
function columnsOf(signal, bytes, count) {
  let offset = 0;
  return signal.low.map((low, k) => {
    const high = signal.high[k];
    const values = new Float32Array(count);
    if (!signal.coded[k]) return values.fill(low === null ? NaN : low);
    const unit = (high - low) / LEVELS;
    let code = 0;
    for (let i = 0; i < count; i++) {
      code = (code + bytes[offset + i] + (bytes[offset + count + i] << 8)) & 0xffff;
      values[i] = code === NOTHING ? NaN : low + code * unit;
    }
    offset += 2 * count;
    return values;
  });
}

/** One flight: its records, and what is asked of them at a time. */
class Flight {
  constructor(about, time, signals, index) {
    Object.assign(this, about);
    this.time = time;
    this.signals = signals;
    this.index = index;
    this.end = time[time.length - 1];
    this.start = time[0];
  }

  has(name) {
    return this.signals[name] !== undefined;
  }

  /** The last record at or before a time. */
  at(t) {
    const { time } = this;
    let low = 0;
    let high = time.length - 1;
    if (t >= time[high] - 1e-12) return high;
    while (low < high) {
      const middle = (low + high + 1) >> 1;
      if (time[middle] <= t + 1e-12) low = middle;
      else high = middle - 1;
    }
    return low;
  }

  /** Value of a column at a record; NaN where there is none. */
  value(name, column, record) {
    const signal = this.signals[name];
    return signal === undefined || signal.values[column] === undefined ? NaN : signal.values[column][record];
  }

  /** Values of all columns at a record. */
  row(name, record) {
    return this.has(name) ? this.signals[name].values.map((column) => column[record]) : null;
  }
}

/** All flights of the page. */
export async function load(payload) {
  return Promise.all(
    payload.flights.map(async (about, index) => {
      const time = await timesOf(about.time);
      const signals = {};
      await Promise.all(
        Object.entries(about.signals).map(async ([name, signal]) => {
          const bytes = await inflated(signal.data);
          signals[name] = { ...signal, data: null, values: columnsOf(signal, bytes, time.length) };
        }),
      );
      return new Flight(about, time, signals, index);
    }),
  );
}
