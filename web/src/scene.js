// The replay in 3-D: ground, trail, reference, wind, the vehicles. World frame: x forward, y left, z up.

import * as THREE from 'three';
import { OrbitControls } from 'three/addons/controls/OrbitControls.js';
import { colourOf, element, onTheme, palette } from './look.js';
import { Arrow, VehicleModel, label } from './vehicle3d.js';

const TRAIL = 3000; // points of a path
const LEAST_RATIO = 0.6; // of the screen's pixels: coarser is hard to read
const NOSE = 0.6; // s of the trail of the nose
const CAMERAS = ['follow', 'ride', 'orbit'];
const Z = new THREE.Vector3(0, 0, 1);
const SPIN = 2 * Math.PI; // rad/s: from one turn a second on, the axis of the turning is drawn

/** The points of a path, with the record of each. */
function pathOf(flight, signal) {
  const count = flight.time.length;
  const step = Math.max(1, Math.floor(count / TRAIL));
  const points = [];
  const records = [];
  for (let i = 0; i < count; i += step) {
    const p = flight.row(signal, i);
    if (!p || !p.every(Number.isFinite)) continue;
    points.push(...p);
    records.push(i);
  }
  return { points: new Float32Array(points), records };
}

function line(points, colour, opacity = 1, dashed = false, size = 0.1) {
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute('position', new THREE.BufferAttribute(points, 3));
  const look = { color: colour, transparent: opacity < 1, opacity };
  const made = new THREE.Line(geometry, dashed ? new THREE.LineDashedMaterial({ ...look, dashSize: size, gapSize: size }) : new THREE.LineBasicMaterial(look));
  if (dashed) made.computeLineDistances();
  made.frustumCulled = false;
  return made;
}

/** How many of some rising numbers are at most a limit. */
function countUpTo(rising, limit) {
  let low = 0;
  let high = rising.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (rising[middle] <= limit) low = middle + 1;
    else high = middle;
  }
  return low;
}

function niceStep(size) {
  const power = 10 ** Math.floor(Math.log10(size));
  return [1, 2, 5, 10].map((k) => k * power).find((step) => step >= size);
}

/** Whether pictures are drawn by the processor, as on machines without a graphics card: smooth edges cost too much there. */
function drawnBySoftware() {
  const gl = document.createElement('canvas').getContext('webgl2');
  const about = gl?.getExtension('WEBGL_debug_renderer_info');
  const name = about ? gl.getParameter(about.UNMASKED_RENDERER_WEBGL) : '';
  gl?.getExtension('WEBGL_lose_context')?.loseContext();
  return /swiftshader|llvmpipe|software|basic render/i.test(name);
}

export class Scene {
  constructor(stage, flights, onFail) {
    this.stage = stage;
    this.flights = flights;
    this.chosen = 0;
    this.split = false;
    this.camera = 'follow';
    this.turned = 0;
    this.time = 0;
    this.dirty = true;
    this.frames = [];
    try {
      const slow = drawnBySoftware();
      this.renderer = new THREE.WebGLRenderer({ antialias: !slow, preserveDrawingBuffer: true, powerPreference: 'high-performance' });
    } catch (error) {
      onFail(error);
      return;
    }
    this.renderer.setPixelRatio(Math.min(devicePixelRatio || 1, 2));
    stage.append(this.renderer.domElement);
    this.names = flights.map((flight, k) => {
      const name = element('span', 'view-name');
      const colour = element('span', '', '■');
      colour.dataset.flight = k;
      name.append(colour, ` ${k + 1} · ${flight.label}`);
      name.hidden = true;
      stage.append(name);
      return name;
    });
    this.eye = new THREE.PerspectiveCamera(45, 1, 0.01, 1e5);
    this.eye.up.set(0, 0, 1);
    this.controls = new OrbitControls(this.eye, this.renderer.domElement);
    this.controls.enableDamping = false;
    this.controls.addEventListener('change', () => (this.dirty = true));
    this.build();
    this.home();
    onTheme(() => {
      this.build();
      this.show(this.time);
      this.draw(); // at once, for paper does not wait for the next frame
    });
    addEventListener('beforeprint', () => this.onPaper());
    new ResizeObserver(() => this.resize()).observe(stage);
    this.resize();
    this.renderer.setAnimationLoop(() => this.draw());
  }

  get reach() {
    return this.actors[this.chosen].reach;
  }

  build() {
    const colours = palette();
    this.world = new THREE.Scene();
    this.world.background = new THREE.Color(colours.paper);
    this.world.add(new THREE.HemisphereLight(0xffffff, 0x8a8f96, 2.2));
    const sun = new THREE.DirectionalLight(0xffffff, 1.6);
    sun.position.set(3, 2, 8);
    this.world.add(sun);
    this.paths = this.flights.map((flight) => ({ flown: pathOf(flight, 'position'), wanted: pathOf(flight, 'position_reference') }));
    this.box = new THREE.Box3();
    for (const { flown, wanted } of this.paths) {
      for (const { points } of [flown, wanted]) {
        for (let i = 0; i < points.length; i += 3) this.box.expandByPoint(new THREE.Vector3(points[i], points[i + 1], points[i + 2]));
      }
    }
    if (this.box.isEmpty()) this.box.set(new THREE.Vector3(-1, -1, 0), new THREE.Vector3(1, 1, 1));
    this.actors = this.flights.map((flight, k) => this.actor(flight, k));
    this.ground(colours);
    this.choose(this.chosen);
  }

  actor(flight, k) {
    const colours = palette();
    const alone = this.flights.length === 1;
    const colour = alone ? colours.blue : colourOf(k);
    const full = new VehicleModel(flight.vehicle, null);
    const ghost = new VehicleModel(flight.vehicle, colour);
    const { flown, wanted } = this.paths[k];
    const path = line(flown.points, colour, 0.25);
    const trail = line(flown.points, colour);
    const reference = line(wanted.points, colours.soft, 0.8, true, 0.12 * full.reach + 0.01);
    const target = new THREE.Mesh(new THREE.OctahedronGeometry(0.09 * full.reach), new THREE.MeshBasicMaterial({ color: colours.soft, wireframe: true }));
    const height = line(new Float32Array(6), colours.soft, 0.5);
    const nose = line(new Float32Array(3 * 64), colours.vermilion, 0.9);
    const wind = new Arrow(colours.sky, 0.035 * full.reach);
    const wish = new Arrow(colours.purple, 0.022 * full.reach);
    const spin = new Arrow(colours.ink, 0.016 * full.reach);
    const own = new THREE.Group();
    own.add(full, reference, target, height, nose, wind, wish, spin);
    this.world.add(own, ghost, path, trail);
    return { own, full, ghost, path, trail, reference, target, height, nose, wind, wish, spin, reach: full.reach, records: flown.records };
  }

  ground(colours) {
    const known = this.flights.map((flight) => flight.ground).find((height) => height !== null && height !== undefined);
    const reach = this.actors[0].reach;
    const size = new THREE.Vector3();
    this.box.getSize(size);
    this.level = known ?? this.box.min.z - 2.5 * reach;
    const width = Math.max(size.x, size.y, 8 * reach) * 1.6;
    this.step = niceStep(width / 14);
    const count = Math.ceil(width / this.step / 2) * 2;
    const grid = new THREE.GridHelper(count * this.step, count, new THREE.Color(colours.line), new THREE.Color(colours.line));
    grid.rotateX(Math.PI / 2);
    const middle = new THREE.Vector3();
    this.box.getCenter(middle);
    const round = (value) => Math.round(value / this.step) * this.step;
    grid.position.set(round(middle.x), round(middle.y), this.level);
    this.world.add(grid);
    const corner = new THREE.Vector3(grid.position.x - (count / 2) * this.step, grid.position.y - (count / 2) * this.step, this.level);
    const length = Math.min(2, count / 2) * this.step;
    for (const [k, name] of ['x', 'y', 'z'].entries()) {
      const along = new THREE.Vector3(...[0, 1, 2].map((i) => (i === k ? 1 : 0)));
      const arrow = new Arrow(colours.soft, 0.025 * length);
      arrow.position.copy(corner);
      arrow.setDirection(along);
      arrow.setLength(length);
      const text = label(name, colours.soft, 0.25 * length);
      text.position.copy(corner).addScaledVector(along, 1.2 * length);
      this.world.add(arrow, text);
    }
  }

  choose(index) {
    this.chosen = index;
    this.visible(index, this.split);
    this.dirty = true;
  }

  /** Show one flight whole and, unless alone, the others as ghosts. */
  visible(index, alone) {
    this.actors.forEach((actor, k) => {
      const own = k === index;
      actor.own.visible = own;
      actor.ghost.visible = !own && !alone;
      actor.path.visible = actor.trail.visible = own || !alone;
    });
  }

  setSplit(split) {
    this.split = split && this.flights.length > 1;
    this.visible(this.chosen, false);
    this.resize();
  }

  /** Put the camera where the vehicle, or the whole path, fills the picture. */
  home() {
    const middle = new THREE.Vector3();
    const size = new THREE.Vector3();
    this.box.getCenter(middle);
    this.box.getSize(size);
    const follow = this.camera !== 'orbit';
    const target = follow ? this.place(this.chosen) : middle;
    const away = follow ? 6.2 * this.reach : Math.max(1.5 * size.length(), 7 * this.reach);
    this.eye.near = Math.max(away / 300, 1e-3);
    this.eye.far = 60 * Math.max(away, size.length());
    this.eye.updateProjectionMatrix();
    this.controls.target.copy(target);
    this.eye.position.copy(target).add(new THREE.Vector3(-0.72, -0.58, 0.42).normalize().multiplyScalar(away));
    this.controls.update();
    this.dirty = true;
  }

  /** `follow` the vehicle, `ride` with it as it turns, or `orbit` the whole path. */
  setCamera(kind) {
    this.camera = CAMERAS.includes(kind) ? kind : 'follow';
    this.turned = this.heading(this.chosen);
    this.home();
  }

  /** Where the nose of a flight points, in rad about the vertical. */
  heading(k) {
    const flight = this.flights[k];
    const q = flight.row('quaternion', flight.at(this.time));
    return q && q.every(Number.isFinite) ? Math.atan2(2 * (q[0] * q[3] + q[1] * q[2]), 1 - 2 * (q[2] ** 2 + q[3] ** 2)) : 0;
  }

  place(k) {
    const flight = this.flights[k];
    const p = flight.row('position', flight.at(this.time)) ?? [0, 0, 0];
    return p.every(Number.isFinite) ? new THREE.Vector3(...p) : this.controls?.target.clone() ?? new THREE.Vector3();
  }

  show(time) {
    if (!this.renderer) return;
    this.time = time;
    this.flights.forEach((flight, k) => this.showFlight(flight, this.actors[k], flight.at(time), time));
    if (this.camera !== 'orbit') {
      const moved = this.place(this.chosen).sub(this.controls.target);
      this.controls.target.add(moved);
      this.eye.position.add(moved);
      if (this.camera === 'ride') {
        const heading = this.heading(this.chosen);
        const away = this.eye.position.clone().sub(this.controls.target).applyAxisAngle(Z, heading - this.turned);
        this.eye.position.copy(this.controls.target).add(away);
        this.turned = heading;
      }
      this.controls.update();
    }
    this.dirty = true;
  }

  showFlight(flight, actor, record, time) {
    const p = flight.row('position', record);
    if (!p || !p.every(Number.isFinite)) return;
    const { reach } = actor;
    for (const model of [actor.full, actor.ghost]) {
      model.position.set(...p);
      model.update(flight, record, Math.min(time, flight.end));
    }
    actor.trail.geometry.setDrawRange(0, countUpTo(actor.records, record));
    const wish = flight.row('position_reference', record);
    actor.target.visible = actor.reference.visible = Boolean(wish);
    if (wish) actor.target.position.set(...wish);
    const drop = actor.height.geometry.attributes.position;
    drop.setXYZ(0, ...p);
    drop.setXYZ(1, p[0], p[1], this.level);
    drop.needsUpdate = true;
    this.noseTrail(flight, actor, record);
    const wind = flight.row('wind', record);
    const speed = wind ? Math.hypot(...wind) : 0;
    actor.wind.visible = speed > 0.01;
    if (speed > 0.01) {
      const along = new THREE.Vector3(...wind).divideScalar(speed);
      actor.wind.setDirection(along);
      actor.wind.setLength(Math.min(0.3 * speed, 4) * reach);
      // It ends above the vehicle's upwind side, where it hides nothing.
      actor.wind.position.set(...p).addScaledVector(along, -Math.min(0.3 * speed, 4) * reach - 1.3 * reach);
      actor.wind.position.z += 0.5 * reach;
    }
    const command = flight.row('controller.attitude_command', record);
    actor.wish.visible = Boolean(command && command.every(Number.isFinite));
    if (actor.wish.visible) {
      const [roll, pitch, yaw] = command;
      actor.wish.position.set(...p);
      actor.wish.setDirection(new THREE.Vector3(
        Math.cos(yaw) * Math.sin(pitch) * Math.cos(roll) + Math.sin(yaw) * Math.sin(roll),
        Math.sin(yaw) * Math.sin(pitch) * Math.cos(roll) - Math.cos(yaw) * Math.sin(roll),
        Math.cos(pitch) * Math.cos(roll),
      ).normalize());
      actor.wish.setLength(2.1 * reach);
    }
    const rates = flight.row('body_rates', record);
    const rate = rates ? Math.hypot(...rates) : 0;
    actor.spin.visible = rate > SPIN && Number.isFinite(rate);
    if (actor.spin.visible) {
      const along = new THREE.Vector3(...rates).divideScalar(rate).applyQuaternion(actor.full.quaternion);
      actor.spin.position.set(...p);
      actor.spin.setDirection(along);
      actor.spin.setLength(1.9 * reach);
    }
  }

  noseTrail(flight, actor, record) {
    const points = actor.nose.geometry.attributes.position;
    const from = flight.at(flight.time[record] - NOSE);
    const tip = new THREE.Vector3();
    const turn = new THREE.Quaternion();
    for (let i = 0; i < points.count; i++) {
      const at = Math.round(from + ((record - from) * i) / (points.count - 1));
      const p = flight.row('position', at);
      const q = flight.row('quaternion', at);
      if (!p || !q) return;
      turn.set(q[1], q[2], q[3], q[0]);
      tip.set(0.45 * actor.reach, 0, 0).applyQuaternion(turn);
      points.setXYZ(i, p[0] + tip.x, p[1] + tip.y, p[2] + tip.z);
    }
    points.needsUpdate = true;
  }

  /** Browsers print a picture in 3-D as it was on the screen: paper gets a copy, which is light. */
  onPaper() {
    this.dirty = true;
    this.draw();
    const { domElement } = this.renderer;
    this.copy ??= this.stage.appendChild(element('canvas', 'on-paper'));
    [this.copy.width, this.copy.height] = [domElement.width, domElement.height];
    this.copy.getContext('2d').drawImage(domElement, 0, 0);
  }

  resize() {
    if (!this.renderer) return;
    const width = this.stage.clientWidth;
    const height = this.stage.clientHeight;
    if (!width || !height) return;
    this.renderer.setSize(width, height);
    for (const name of this.names) name.hidden = !this.split;
    if (this.split) {
      for (const [x, y, w, h, k] of this.views()) Object.assign(this.names[k].style, { left: `${x + 8}px`, top: `${height - y - h + 6}px`, maxWidth: `${w - 16}px` });
    }
    this.dirty = true;
    this.draw();
  }

  /** Viewports in CSS pixels, one per flight when they stand side by side. */
  views() {
    const width = this.stage.clientWidth;
    const height = this.stage.clientHeight;
    if (!this.split) return [[0, 0, width, height, this.chosen]];
    const count = this.flights.length;
    const columns = width > 560 ? Math.min(count, 3) : Math.min(count, 2);
    const rows = Math.ceil(count / columns);
    return this.flights.map((_, k) => {
      const [w, h] = [width / columns, height / rows];
      return [(k % columns) * w, (rows - 1 - Math.floor(k / columns)) * h, w, h, k];
    });
  }

  draw() {
    if (!this.dirty) return;
    this.dirty = false;
    const offset = this.eye.position.clone().sub(this.controls.target);
    const home = this.eye.position.clone();
    const look = this.eye.quaternion.clone();
    this.renderer.setScissorTest(true);
    for (const [x, y, w, h, k] of this.views()) {
      if (this.split) {
        this.visible(k, true);
        if (this.camera !== 'orbit') {
          const turn = this.camera === 'ride' ? this.heading(k) - this.heading(this.chosen) : 0;
          const size = this.actors[k].reach / this.reach; // so that each fills its picture
          this.eye.position.copy(this.place(k)).add(offset.clone().multiplyScalar(size).applyAxisAngle(Z, turn));
          this.eye.lookAt(this.place(k));
        }
      }
      this.eye.aspect = w / h;
      this.eye.updateProjectionMatrix();
      this.renderer.setViewport(x, y, w, h);
      this.renderer.setScissor(x, y, w, h);
      this.renderer.render(this.world, this.eye);
      this.eye.position.copy(home);
      this.eye.quaternion.copy(look);
    }
    if (this.split) this.visible(this.chosen, false);
    this.pace();
  }

  /** On a machine that draws slowly, draw fewer pixels: frames that follow each other tell how long one takes. */
  pace() {
    const now = performance.now();
    const passed = now - this.drawn;
    this.drawn = now;
    if (!(passed < 500)) return;
    this.frames.push(passed);
    if (this.frames.length < 10) return;
    const mean = this.frames.reduce((sum, one) => sum + one, 0) / this.frames.length;
    this.frames = [];
    const ratio = this.renderer.getPixelRatio();
    if (mean > 36 && ratio > LEAST_RATIO) {
      this.renderer.setPixelRatio(Math.max(LEAST_RATIO, ratio * 0.8));
      this.dirty = true;
    }
  }
}
