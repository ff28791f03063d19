// The flight page: puts the parts together.

import 'uplot/dist/uPlot.min.css';
import './page.css';
import { AttainableSet, tiltTorques } from './attainable.js';
import { Clock, remember, wanted } from './clock.js';
import { load } from './data.js';
import { colourOf, onTheme, palette, startTheme } from './look.js';
import { Now } from './now.js';
import { Plots } from './plots.js';
import { Scene } from './scene.js';
import { Timeline } from './timeline.js';

const NUMBERS = 10; // per second while it plays: nobody reads faster

const part = (id) => document.getElementById(id);

/** Colours of the legend beside the 3-D picture, and of the flights' names, as the theme has them. */
function paint(flights) {
  const colours = palette();
  for (const key of document.querySelectorAll('[data-colour]')) key.style.background = colours[key.dataset.colour];
  for (const name of document.querySelectorAll('[data-flight]')) name.style.color = flights.length > 1 ? colourOf(Number(name.dataset.flight)) : '';
}

async function start() {
  startTheme(part('theme'));
  const payload = JSON.parse(part('data').textContent);
  performance.mark('program');
  const flights = await load(payload);
  performance.mark('unpacked');
  const clock = new Clock(Math.min(...flights.map((f) => f.start)), Math.max(...flights.map((f) => f.end)));
  const wish = wanted();
  paint(flights);
  onTheme(() => paint(flights));

  const scene = new Scene(part('stage'), flights, () => (part('no-3d').hidden = false));
  paint(flights);
  performance.mark('scene');
  const now = new Now(part('numbers'), part('bars'), flights);
  const set = new AttainableSet(part('sets'));
  part('sets').hidden = !flights.some((flight) => flight.vehicle);
  const plots = new Plots(part('plots'), flights, clock, (time) => clock.seek(time));
  const timeline = new Timeline(
    { lanes: part('lanes'), scrubber: part('scrubber'), clockText: part('time'), play: part('play'), speed: part('speed'), zoom: part('zoom'), list: part('events'), rest: part('more-events'), latest: part('latest') },
    flights, clock, (window) => plots.show(window),
  );

  performance.mark('plots');
  let chosen = 0;
  const drawSet = () => set.draw(flights[chosen], flights[chosen].at(clock.time));
  const showNumbers = (time) => {
    now.show(time);
    drawSet();
  };
  const show = (time) => {
    scene.show(time);
    showNumbers(time);
  };
  const keep = () => {
    if (clock.playing) return;
    remember({
      t: clock.time.toFixed(3), flight: flights.length > 1 ? chosen + 1 : null, camera: scene.camera,
      view: scene.split ? 'split' : null, speed: clock.speed === 1 ? null : clock.speed,
    });
  };
  const choose = (index) => {
    if (index < 0 || index >= flights.length) return;
    chosen = index;
    scene.choose?.(index);
    now.choose(index);
    plots.choose(index);
    for (const tab of document.querySelectorAll('#tabs button')) tab.setAttribute('aria-pressed', String(Number(tab.dataset.index) === index));
    show(clock.time);
    keep();
  };
  const setCamera = (kind) => {
    scene.setCamera(kind);
    part('camera').value = scene.camera;
    keep();
  };
  const setSplit = (split) => {
    scene.setSplit(split);
    part('split').setAttribute('aria-pressed', String(scene.split));
    document.body.classList.toggle('split', scene.split);
    keep();
  };
  const apply = (want) => {
    if (want.speed > 0) clock.setSpeed(want.speed);
    if (want.flight >= 1) choose(want.flight - 1);
    if (want.camera && scene.renderer) setCamera(want.camera);
    if (scene.renderer) setSplit(want.view === 'split');
    if (Number.isFinite(want.time)) clock.seek(want.time);
    if (want.play) clock.play();
  };

  clock.onTime((time) => scene.show(time));
  clock.onTime(showNumbers, NUMBERS);
  clock.onChange(keep);
  for (const tab of document.querySelectorAll('#tabs button')) tab.addEventListener('click', () => choose(Number(tab.dataset.index)));
  part('camera').addEventListener('change', () => {
    setCamera(part('camera').value);
    part('camera').blur(); // so that the keys are those of the page again
  });
  part('home').addEventListener('click', () => scene.home());
  part('split').addEventListener('click', () => setSplit(!scene.split));
  part('help').addEventListener('click', () => part('keys').toggleAttribute('hidden'));
  addEventListener('hashchange', () => apply(wanted()));
  addEventListener('keydown', (event) => {
    const { target } = event;
    if (event.ctrlKey || event.metaKey || event.altKey || target.tagName === 'SELECT') return;
    const pressed = target.tagName === 'BUTTON' && (event.key === ' ' || event.key === 'Enter');
    if (pressed) return;
    const step = event.shiftKey ? 0.001 : 0.05 * Math.max(clock.speed, 0.02);
    const keys = {
      ' ': () => clock.toggle(), k: () => clock.toggle(),
      ArrowRight: () => clock.seek(clock.time + step), ArrowLeft: () => clock.seek(clock.time - step),
      Home: () => clock.seek(clock.start), End: () => clock.seek(clock.end),
      n: () => timeline.toEvent(1), p: () => timeline.toEvent(-1),
      '+': () => clock.faster(1), '-': () => clock.faster(-1), ']': () => clock.faster(1), '[': () => clock.faster(-1),
      f: () => setCamera('follow'), t: () => setCamera('ride'), o: () => setCamera('orbit'), r: () => scene.home(),
      s: () => flights.length > 1 && setSplit(!scene.split), z: () => !part('zoom').hidden && part('zoom').click(),
      '?': () => part('help').click(),
    };
    const act = /^[1-6]$/.test(event.key) ? () => choose(Number(event.key) - 1) : keys[event.key];
    if (!act) return;
    event.preventDefault();
    act();
  });
  for (const button of document.querySelectorAll('[data-copy]')) {
    button.addEventListener('click', async () => {
      const text = button.previousElementSibling.textContent;
      try {
        await navigator.clipboard.writeText(text);
        button.textContent = 'Copied';
      } catch {
        getSelection().selectAllChildren(button.previousElementSibling);
        button.textContent = 'Press Ctrl-C';
      }
    });
  }
  clock.time = clock.start;
  apply(wish);
  show(clock.time);
  clock.tell();
  // For tests and for the curious: the state of the page.
  window.rotorfault = { clock, scene, plots, timeline, flights, tiltTorques };
  performance.mark('ready');
  document.body.dataset.ready = 'true';
}

start().catch((error) => {
  part('failed').hidden = false;
  part('failed').append(` ${error}`);
  throw error;
});
