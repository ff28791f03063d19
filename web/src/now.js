// The numbers of the moment: motion, and a bar per rotor with command, thrust, belief and limits.

import { degrees, element, shown } from './look.js';

const ROWS = [
  ['height', 'm', (f, i) => f.value('position', 2, i)],
  ['position error', 'm', (f, i) => size(f.row('position_error', i))],
  ['speed', 'm/s', (f, i) => size(f.row('velocity', i))],
  ['tilt', '°', (f, i) => tilt(f.row('quaternion', i))],
  ['yaw', '°', (f, i) => direction(f.value('attitude', 2, i))],
  ['yaw rate', '°/s', (f, i) => degrees(f.value('body_rates', 2, i))],
  ['turns', '1/s', (f, i) => (f.spins ? size(f.row('body_rates', i)) / (2 * Math.PI) : NaN)],
  ['wind', 'm/s', (f, i) => size(f.row('wind', i))],
];

/** An angle within half a turn, in degrees: records count turns, people read a direction. */
function direction(angle) {
  return degrees(angle - 2 * Math.PI * Math.round(angle / (2 * Math.PI)));
}

function size(row) {
  return row ? Math.hypot(...row) : NaN;
}

function tilt(q) {
  return q ? degrees(Math.acos(Math.min(Math.max(1 - 2 * (q[1] ** 2 + q[2] ** 2), -1), 1))) : NaN;
}

export class Now {
  constructor(numbers, bars, flights) {
    this.flights = flights;
    this.bars = bars;
    this.chosen = 0;
    const body = element('tbody');
    this.rows = ROWS.filter(([, , of]) => flights.some((flight) => Number.isFinite(of(flight, 0)))).map(([name, unit, of]) => {
      const row = element('tr');
      row.append(element('th', '', name));
      const cells = flights.map(() => {
        const cell = element('td', 'n');
        row.append(cell);
        return cell;
      });
      row.append(element('td', 'soft', unit));
      body.append(row);
      return { of, cells };
    });
    numbers.append(body);
    this.build();
  }

  build() {
    const flight = this.flights[this.chosen];
    this.bars.replaceChildren();
    const count = flight.signals.thrust?.values.length ?? 0;
    this.rotors = Array.from({ length: count }, (_, k) => {
      const row = element('div', 'rotor');
      const name = flight.vehicle?.rotors[k]?.name;
      const title = element('span', 'rotor-name', `${k + 1}`);
      if (name) title.title = name;
      const track = element('div', 'track');
      const thrust = element('span', 'thrust');
      const believed = element('span', 'believed');
      const command = element('span', 'command');
      track.append(thrust, believed, command);
      const text = element('span', 'rotor-text');
      row.append(title, track, text);
      this.bars.append(row);
      return { row, thrust, believed, command, text };
    });
  }

  choose(index) {
    this.chosen = index;
    this.build();
  }

  show(time) {
    for (const { of, cells } of this.rows) {
      this.flights.forEach((flight, k) => {
        const text = time > flight.end + 1e-6 ? 'ended' : shown(of(flight, flight.at(time)), 3);
        if (cells[k].textContent !== text) cells[k].textContent = text;
      });
    }
    const flight = this.flights[this.chosen];
    const record = flight.at(time);
    const most = flight.vehicle?.thrust_max || Math.max(...(flight.row('thrust', record) ?? [1]), 1e-9);
    const least = Math.min(flight.vehicle?.thrust_min ?? 0, 0);
    const share = (value) => `${Math.min(Math.max(((value - least) / (most - least)) * 100, 0), 100)}%`;
    this.rotors.forEach(({ row, thrust, believed, command, text }, k) => {
      const of = (signal) => flight.value(signal, k, record);
      thrust.style.width = share(of('thrust'));
      believed.style.left = share(of('thrust_believed'));
      believed.hidden = !Number.isFinite(of('thrust_believed'));
      command.style.left = share(of('thrust_command'));
      command.hidden = !Number.isFinite(of('thrust_command'));
      row.classList.toggle('flagged', of('fault_flag') > 0.5);
      const [loss, belief, held, heldBelieved] = ['loss_true', 'loss_believed', 'stuck_true', 'stuck_believed'].map(of);
      const words = [`${shown(of('thrust'), 3)} N`];
      const state = (stuck, lost) => (Number.isFinite(stuck) ? `stuck at ${shown(stuck, 3)} N` : `${Math.round(100 * lost)} %`);
      if (Number.isFinite(held)) words.push(`${state(held)}, believed ${Number.isFinite(heldBelieved) ? state(heldBelieved) : `lost ${state(NaN, belief)}`}`);
      else if (loss > 0.0005 || belief > 0.0005 || Number.isFinite(heldBelieved)) words.push(`lost ${state(NaN, loss)}, believed ${state(heldBelieved, belief)}`);
      const line = words.join(' · ');
      if (text.textContent !== line) text.textContent = line;
    });
  }
}
