// Bundle the flight page's program and style into the package, with the licences of what is in it.
// `make web` runs this; tests see to it that the bundle is of today's sources.

import { build } from 'esbuild';
import { createHash } from 'node:crypto';
import { mkdirSync, readFileSync, readdirSync, writeFileSync } from 'node:fs';

const out = '../src/rotorfault/pages/bundle';
mkdirSync(out, { recursive: true });
const digest = createHash('sha256');
for (const name of ['package.json', ...readdirSync('src').sort().map((file) => `src/${file}`)]) digest.update(readFileSync(name));
const banner = `/* sources ${digest.digest('hex')} */`;
await build({
  entryPoints: ['src/main.js'], bundle: true, minify: true, format: 'iife', target: 'es2022', legalComments: 'eof',
  outfile: `${out}/flight.js`, banner: { js: banner, css: banner },
});
const { dependencies } = JSON.parse(readFileSync('package.json', 'utf8'));
const licences = Object.entries(dependencies).map(([name, version]) => `${name} ${version}\n\n${readFileSync(`node_modules/${name}/LICENSE`, 'utf8')}`);
writeFileSync(`${out}/LICENSES.txt`, `The program of the flight page contains:\n\n${licences.join('\n\n')}`);
