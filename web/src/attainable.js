// What the rotors can give now, by their true and by their believed effectiveness, and the wrench asked for.

import { element, onTheme, palette, shown } from './look.js';

const DIRECTIONS = 144;

/** Limits of each rotor's thrust in N with given losses; a loss that is { stuck: N } leaves that thrust alone. */
function limits(vehicle, losses) {
  return losses.map((loss, k) => {
    if (typeof loss === 'object') return [loss.stuck, loss.stuck];
    const share = 1 - Math.min(Math.max(loss, 0), 1);
    return vehicle.rotors[k].limits.map((limit) => share * limit);
  });
}

function directions() {
  return Array.from({ length: DIRECTIONS }, (_, k) => (2 * Math.PI * k) / DIRECTIONS);
}

/** Largest and least total thrust in N. */
function reach(rotors, ends) {
  let least = 0;
  let most = 0;
  rotors.forEach((rotor, i) => {
    const [a, b] = [rotor.wrench[0] * ends[i][0], rotor.wrench[0] * ends[i][1]];
    least += Math.min(a, b);
    most += Math.max(a, b);
  });
  return [least, most];
}

/** Roll and pitch torques that can be given at a total thrust, yaw free: corners of a polygon in N m. */
export function tiltTorques(vehicle, losses, thrust) {
  const { rotors } = vehicle;
  const ends = limits(vehicle, losses);
  const [least, most] = reach(rotors, ends);
  const held = Math.min(Math.max(thrust, least), most);
  return directions().map((angle) => {
    const [cx, cy] = [Math.cos(angle), Math.sin(angle)];
    const gains = rotors.map((rotor) => cx * rotor.wrench[1] + cy * rotor.wrench[2]);
    // The best use of a fixed thrust: fill the rotors that give the most torque per thrust first.
    const order = rotors.map((_, i) => i).filter((i) => rotors[i].wrench[0] > 1e-9);
    order.sort((i, j) => gains[j] / rotors[j].wrench[0] - gains[i] / rotors[i].wrench[0]);
    const u = ends.map(([low, high], i) => (rotors[i].wrench[0] > 1e-9 || gains[i] <= 0 ? low : high));
    let left = held - u.reduce((sum, value, i) => sum + value * rotors[i].wrench[0], 0);
    for (const i of order) {
      const more = Math.min(Math.max(left / rotors[i].wrench[0], 0), ends[i][1] - ends[i][0]);
      u[i] += more;
      left -= more * rotors[i].wrench[0];
    }
    return [1, 2].map((axis) => u.reduce((sum, value, i) => sum + value * rotors[i].wrench[axis], 0));
  });
}

/** Total thrusts and yaw torques that can be given, tilt torques free: corners of a polygon in N m and N. */
export function thrustAndYaw(vehicle, losses) {
  const { rotors } = vehicle;
  const ends = limits(vehicle, losses);
  const scale = Math.max(...rotors.map((rotor) => Math.abs(rotor.wrench[3]))) || 1;
  return directions().map((angle) => {
    const point = [0, 0];
    rotors.forEach((rotor, i) => {
      const along = Math.cos(angle) * (rotor.wrench[3] / scale) + Math.sin(angle) * rotor.wrench[0];
      const u = along > 0 ? ends[i][1] : ends[i][0];
      point[0] += u * rotor.wrench[3];
      point[1] += u * rotor.wrench[0];
    });
    return point;
  });
}

/** What is known of each rotor at a record: its loss, or at which thrust it is stuck. */
function states(flight, loss, stuck, record) {
  const held = flight.row(stuck, record) ?? [];
  return (flight.row(loss, record) ?? flight.vehicle.rotors.map(() => 0)).map((value, k) => (Number.isFinite(held[k]) ? { stuck: held[k] } : value));
}

/** Two small charts of the attainable set of a flight. */
export class AttainableSet {
  constructor(parent) {
    this.charts = [
      { title: 'roll and pitch torque (N·m)', about: 'at the thrust asked for, yaw free' },
      { title: 'yaw torque (N·m) and thrust (N)', about: 'roll and pitch free' },
    ].map(({ title, about }) => {
      const figure = element('figure', 'set');
      const canvas = element('canvas');
      canvas.setAttribute('role', 'img');
      canvas.setAttribute('aria-label', `attainable set: ${title}, ${about}`);
      const caption = element('figcaption', '', title);
      caption.append(element('span', 'soft', ` ${about}`));
      figure.append(canvas, caption);
      parent.append(figure);
      return canvas;
    });
    this.last = null;
    // Asking for the size at each frame would make the browser lay out the page at each frame.
    this.sizes = [];
    const measure = () => {
      const ratio = Math.min(devicePixelRatio || 1, 2);
      this.sizes = this.charts.map((canvas) => {
        const size = [canvas.clientWidth || 200, canvas.clientHeight || 160];
        [canvas.width, canvas.height] = size.map((length) => length * ratio);
        return size;
      });
      if (this.last) this.draw(...this.last);
    };
    new ResizeObserver(measure).observe(parent);
    measure();
    onTheme(() => this.last && this.draw(...this.last));
  }

  draw(flight, record) {
    this.last = [flight, record];
    const { vehicle } = flight;
    if (!vehicle || vehicle.thrust_max === undefined) return;
    const none = vehicle.rotors.map(() => 0);
    const truth = states(flight, 'loss_true', 'stuck_true', record);
    const belief = states(flight, 'loss_believed', 'stuck_believed', record);
    const asked = [flight.value('thrust_demand', 0, record), ...(flight.row('torque_demand', record) ?? [])];
    const thrusts = flight.row('thrust', record) ?? [];
    const given = [0, 1, 2, 3].map((axis) => thrusts.reduce((sum, f, i) => sum + f * vehicle.rotors[i].wrench[axis], 0));
    const thrust = Number.isFinite(asked[0]) ? asked[0] : given[0];
    const colours = palette();
    // The scales are those of the sound vehicle, so that what is lost is seen to shrink.
    const sets = [
      [tiltTorques(vehicle, none, vehicle.weight), tiltTorques(vehicle, truth, thrust), tiltTorques(vehicle, belief, thrust), [asked[1], asked[2]], [given[1], given[2]]],
      [thrustAndYaw(vehicle, none), thrustAndYaw(vehicle, truth), thrustAndYaw(vehicle, belief), [asked[3], asked[0]], [given[3], given[0]]],
    ];
    sets.forEach(([whole, real, believed, wish, got], k) => {
      const chart = new Chart(this.charts[k], this.sizes[k], [...whole, ...real], k === 0);
      chart.axes(colours);
      chart.polygon(whole, { line: colours.line, dash: [] });
      chart.polygon(real, { line: colours.blue, fill: `${colours.blue}33`, dash: [] });
      chart.polygon(believed, { line: colours.orange, dash: [5, 3] });
      chart.mark(got, colours.blue, false);
      chart.mark(wish, colours.ink, true);
      if (k === 1) chart.level(vehicle.weight, 'weight', colours);
    });
  }
}

class Chart {
  constructor(canvas, size, points, square) {
    const ratio = Math.min(devicePixelRatio || 1, 2);
    const [width, height] = size;
    this.c = canvas.getContext('2d');
    this.c.setTransform(ratio, 0, 0, ratio, 0, 0);
    this.c.clearRect(0, 0, width, height);
    this.width = width;
    this.height = height;
    const [xs, ys] = [0, 1].map((k) => points.map((point) => point[k]));
    let [x0, x1, y0, y1] = [Math.min(...xs), Math.max(...xs), Math.min(0, ...ys), Math.max(...ys)];
    const pad = 1.12;
    let sx = (width - 8) / ((x1 - x0) * pad || 1);
    let sy = (height - 8) / ((y1 - y0) * pad || 1);
    if (square) sx = sy = Math.min(sx, sy);
    this.x = (value) => width / 2 + (value - (x0 + x1) / 2) * sx;
    this.y = (value) => height / 2 - (value - (y0 + y1) / 2) * sy;
    this.span = [x0, x1, y0, y1];
  }

  axes(colours) {
    const { c } = this;
    c.strokeStyle = colours.line;
    c.lineWidth = 1;
    c.beginPath();
    c.moveTo(this.x(0), 0);
    c.lineTo(this.x(0), this.height);
    c.moveTo(0, this.y(0));
    c.lineTo(this.width, this.y(0));
    c.stroke();
    c.fillStyle = colours.soft;
    c.font = '10px system-ui, sans-serif';
    c.textAlign = 'right';
    c.fillText(shown(this.span[1], 2), this.width - 2, this.y(0) - 3);
    c.textAlign = 'left';
    c.fillText(shown(this.span[3], 2), this.x(0) + 3, 10);
  }

  polygon(points, { line, fill = null, dash }) {
    const { c } = this;
    c.beginPath();
    points.forEach(([x, y], k) => (k ? c.lineTo(this.x(x), this.y(y)) : c.moveTo(this.x(x), this.y(y))));
    c.closePath();
    if (fill) {
      c.fillStyle = fill;
      c.fill();
    }
    c.setLineDash(dash);
    c.strokeStyle = line;
    c.lineWidth = 1.6;
    c.stroke();
    c.setLineDash([]);
  }

  level(value, label, colours) {
    const { c } = this;
    c.strokeStyle = colours.soft;
    c.lineWidth = 1;
    c.setLineDash([2, 3]);
    c.beginPath();
    c.moveTo(0, this.y(value));
    c.lineTo(this.width, this.y(value));
    c.stroke();
    c.setLineDash([]);
    c.fillStyle = colours.soft;
    c.textAlign = 'left';
    c.fillText(label, 2, this.y(value) - 3);
  }

  /** A cross for what is asked, a dot for what is given; at the edge if it lies outside. */
  mark([x, y], colour, cross) {
    if (!Number.isFinite(x) || !Number.isFinite(y)) return;
    const { c } = this;
    const px = Math.min(Math.max(this.x(x), 5), this.width - 5);
    const py = Math.min(Math.max(this.y(y), 5), this.height - 5);
    c.strokeStyle = colour;
    c.fillStyle = colour;
    c.lineWidth = 2;
    c.beginPath();
    if (cross) {
      c.moveTo(px - 5, py - 5);
      c.lineTo(px + 5, py + 5);
      c.moveTo(px - 5, py + 5);
      c.lineTo(px + 5, py - 5);
      c.stroke();
    } else {
      c.arc(px, py, 4, 0, 2 * Math.PI);
      c.fill();
    }
  }
}
