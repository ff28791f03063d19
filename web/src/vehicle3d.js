// A vehicle in 3-D, built from its file: arms, rotors that turn, arrows of thrust, the wanted and the actual axis.

import * as THREE from 'three';
import { palette } from './look.js';

const UP = new THREE.Vector3(0, 0, 1);
const BLADES = 1 / 40; // of the true speed, so that the eye can follow them

function material(colour, opacity = 1) {
  return new THREE.MeshLambertMaterial({ color: colour, transparent: opacity < 1, opacity, depthWrite: opacity > 0.6 });
}

/** An arrow along z of length 1, to be scaled. */
export class Arrow extends THREE.Group {
  constructor(colour, radius) {
    super();
    // In shade too it has the colour that the legend gives it.
    const look = new THREE.MeshLambertMaterial({ color: colour, emissive: colour, emissiveIntensity: 0.5 });
    this.shaft = new THREE.Mesh(new THREE.CylinderGeometry(radius, radius, 1, 10).rotateX(Math.PI / 2).translate(0, 0, 0.5), look);
    this.head = new THREE.Mesh(new THREE.ConeGeometry(2.4 * radius, 6 * radius, 14).rotateX(Math.PI / 2), look);
    this.size = radius;
    this.add(this.shaft, this.head);
  }

  /** Length in m; a negative one points the other way. */
  setLength(length) {
    const size = Math.abs(length);
    this.visible = size > 0.5 * this.size;
    const tip = 3 * this.size;
    const shaft = Math.max(size - 2 * tip, 1e-4);
    this.shaft.scale.z = shaft;
    this.head.position.z = shaft + tip;
    this.scale.z = length < 0 ? -1 : 1;
  }

  setDirection(vector) {
    this.quaternion.setFromUnitVectors(UP, vector);
  }

  setColour(colour) {
    this.shaft.material.color.set(colour);
    this.shaft.material.emissive.set(colour);
  }
}

/** Which level each rotor has among those at its place: 0 the first, 1 the next below; null where it is alone. */
function levels(rotors, reach) {
  const near = (a, b) => Math.hypot(...a.position.map((value, k) => value - b.position[k])) < 0.1 * reach;
  return rotors.map((rotor, i) => {
    const same = rotors.map((other, j) => [other, j]).filter(([other]) => near(rotor, other));
    return same.length > 1 ? same.findIndex(([, j]) => j === i) : null;
  });
}

/** A text that faces the reader. */
export function label(text, colour, height) {
  const canvas = document.createElement('canvas');
  const c = canvas.getContext('2d');
  const font = '600 44px system-ui, sans-serif';
  c.font = font;
  const width = Math.ceil(c.measureText(text).width) + 16;
  canvas.width = width;
  canvas.height = 60;
  c.font = font;
  c.fillStyle = colour;
  c.textBaseline = 'middle';
  c.fillText(text, 8, 31);
  const map = new THREE.CanvasTexture(canvas);
  map.colorSpace = THREE.SRGBColorSpace;
  const sprite = new THREE.Sprite(new THREE.SpriteMaterial({ map, depthTest: false }));
  sprite.scale.set((height * width) / 60, height, 1);
  sprite.renderOrder = 5;
  return sprite;
}

/** Half the least distance of two rotors that are not above each other, or a share of the arm. */
function discRadius(rotors, reach) {
  let least = Infinity;
  for (let i = 0; i < rotors.length; i++) {
    for (let j = 0; j < i; j++) {
      const [a, b] = [rotors[i].position, rotors[j].position];
      const apart = Math.hypot(a[0] - b[0], a[1] - b[1]);
      if (apart > 0.1 * reach) least = Math.min(least, apart);
    }
  }
  return 0.33 * (Number.isFinite(least) ? least : reach);
}

export class VehicleModel extends THREE.Group {
  /** `ghost`: the colour of a flight that is drawn beside another one; null for the one that is looked at. */
  constructor(vehicle, ghost) {
    super();
    this.vehicle = vehicle;
    const rotors = vehicle?.rotors ?? [];
    this.reach = Math.max(...rotors.map((rotor) => Math.hypot(...rotor.position)), 1e-3) || 0.3;
    if (!rotors.length) this.reach = 0.3;
    this.ghost = ghost;
    this.rotors = [];
    this.build();
  }

  build() {
    this.clear();
    this.rotors = [];
    this.axis = null;
    const { reach, ghost } = this;
    const rotors = this.vehicle?.rotors ?? [];
    const colours = palette();
    const opacity = ghost ? 0.42 : 1;
    const look = material(ghost ?? colours.body, opacity);
    const hub = new THREE.Mesh(new THREE.SphereGeometry(0.13 * reach, 20, 14), look);
    hub.scale.set(1.25, 1, 0.6);
    this.add(hub);
    // The nose points forward, so that a turning body is seen to turn.
    const nose = new THREE.Mesh(new THREE.ConeGeometry(0.09 * reach, 0.3 * reach, 16).rotateZ(-Math.PI / 2), material(ghost ?? colours.vermilion, opacity));
    nose.position.set(0.3 * reach, 0, 0);
    this.add(nose);
    const radius = discRadius(rotors, reach);
    const stacked = levels(rotors, reach);
    rotors.forEach((rotor, i) => {
      const place = new THREE.Vector3(...rotor.position);
      const arm = new THREE.Mesh(new THREE.CylinderGeometry(0.028 * reach, 0.028 * reach, place.length(), 8), look);
      const below = stacked[i] ?? 0;
      // Rotors whose file has them at one place are drawn one below the other.
      const shift = stacked[i] === null ? 0 : (0.09 - 0.3 * below) * reach;
      arm.position.copy(place).multiplyScalar(0.5);
      arm.quaternion.setFromUnitVectors(new THREE.Vector3(0, 1, 0), place.clone().normalize());
      const mount = new THREE.Group();
      mount.position.copy(place).add(new THREE.Vector3(0, 0, shift));
      mount.quaternion.setFromUnitVectors(UP, new THREE.Vector3(...rotor.axis).normalize());
      const turn = rotor.turn > 0 ? colours.vermilion : colours.blue;
      const ring = new THREE.Mesh(new THREE.TorusGeometry(radius, 0.018 * reach, 6, 32), material(ghost ?? turn, opacity));
      ring.position.z = 0.06 * reach;
      const blades = new THREE.Group();
      blades.position.z = 0.06 * reach;
      const blade = new THREE.Mesh(new THREE.BoxGeometry(2 * radius * 0.94, 0.1 * radius, 0.012 * reach), material(ghost ?? colours.ink, opacity));
      blades.add(blade);
      mount.add(ring, blades);
      const parts = { mount, ring, blades, blade, turn: rotor.turn };
      if (!ghost) {
        parts.flagged = new THREE.Mesh(new THREE.TorusGeometry(radius * 1.14, 0.035 * reach, 6, 32), material(colours.purple));
        parts.flagged.position.z = 0.06 * reach;
        parts.flagged.visible = false;
        parts.thrust = new Arrow(colours.blue, 0.03 * reach);
        parts.believed = new Arrow(colours.orange, 0.03 * reach);
        // Side by side, across the arm, so that one does not hide the other.
        const aside = new THREE.Vector3(-place.y, place.x, 0).normalize().multiplyScalar((0.055 + 0.13 * below) * reach);
        parts.thrust.position.copy(aside).setZ(0.08 * reach);
        parts.believed.position.copy(aside).negate().setZ(0.08 * reach);
        mount.add(parts.flagged, parts.thrust, parts.believed);
        const number = label(String(i + 1), colours.ink, 0.3 * reach);
        const lift = stacked[i] === null ? 0.1 : 0.3 - 0.45 * below;
        number.position.copy(place).multiplyScalar(1 + (1.45 * radius) / (place.length() || 1)).setZ(place.z + lift * reach);
        if (place.length() < 1e-6) number.position.set(0, 0, 0.4 * reach);
        this.add(number);
      }
      this.add(arm, mount);
      this.rotors.push(parts);
    });
    if (!ghost) {
      this.axis = new Arrow(colours.green, 0.022 * reach);
      this.axis.setLength(2.1 * reach);
      this.add(this.axis);
    }
  }

  /** Where the rotors pull together, in body axes: z where none is tilted. */
  pull(flight, record) {
    const sum = new THREE.Vector3();
    (this.vehicle?.rotors ?? []).forEach((rotor, i) => {
      const thrust = flight.value('thrust', i, record);
      if (Number.isFinite(thrust)) sum.addScaledVector(new THREE.Vector3(...rotor.axis), thrust);
    });
    return sum.length() > 1e-6 ? sum.normalize() : UP;
  }

  /** Show a record of a flight; `time` in s turns the blades. */
  update(flight, record, time) {
    const q = flight.row('quaternion', record);
    if (q && q.every(Number.isFinite)) this.quaternion.set(q[1], q[2], q[3], q[0]);
    const most = this.vehicle?.thrust_max || 1;
    this.axis?.setDirection(this.pull(flight, record));
    this.rotors.forEach((parts, i) => {
      const speed = flight.value('rotor_speed', i, record);
      if (Number.isFinite(speed)) {
        // At rest it stands; else its angle follows from time, so that scrubbing turns it back.
        parts.blades.rotation.z = parts.turn * speed * BLADES * time;
      }
      if (this.ghost) return;
      const thrust = flight.value('thrust', i, record);
      const believed = flight.value('thrust_believed', i, record);
      parts.thrust.setLength(Number.isFinite(thrust) ? (1.5 * this.reach * thrust) / most : 0);
      parts.believed.setLength(Number.isFinite(believed) ? (1.5 * this.reach * believed) / most : 0);
      parts.flagged.visible = flight.value('fault_flag', i, record) > 0.5;
      const loss = flight.value('loss_true', i, record);
      parts.blade.scale.x = Number.isFinite(loss) ? 1 - 0.75 * Math.min(Math.max(loss, 0), 1) : 1;
    });
  }
}
