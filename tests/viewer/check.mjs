// node check.mjs RUN_DIRECTORY: claims about report.html, against the files beside it.

import assert from 'node:assert/strict';
import { readFileSync, readdirSync } from 'node:fs';
import path from 'node:path';
import { launch, open } from './browser.mjs';

const run = path.resolve(process.argv[2]);
const summary = JSON.parse(readFileSync(path.join(run, 'summary.json')));
const browser = await launch();
const { page, complaints } = await open(browser, path.join(run, 'report.html'));

// Counts per outcome are those of summary.json.
const counts = await page.evaluate(() => window.graspViewer.counts());
for (const [name, n] of Object.entries(summary.physics.outcomes)) {
  assert.equal(counts[name] ?? 0, n, `outcome ${name}`);
}

// Every name stands there as text and started nothing.
const names = await page.evaluate(() => [...document.querySelectorAll('#object option')].map((o) => o.textContent));
assert.deepEqual(names, summary.objects.map((o) => o.object));
assert.equal(await page.evaluate(() => window.hacked), undefined, 'a name ran as a script');

// Pixels: more than a background.
const colours = await page.evaluate(() => {
  const canvas = document.getElementById('canvas');
  const copy = document.createElement('canvas');
  [copy.width, copy.height] = [canvas.width, canvas.height];
  const context = copy.getContext('2d');
  context.drawImage(canvas, 0, 0);
  const { data } = context.getImageData(0, 0, copy.width, copy.height);
  const seen = new Set();
  for (let i = 0; i < data.length; i += 4) seen.add((data[i] << 16) | (data[i + 1] << 8) | data[i + 2]);
  return seen.size;
});
assert.ok(colours > 20, `${colours} colours`);

// Keyboard: arrows choose, escape lets go.
await page.focus('#canvas');
await page.keyboard.press('ArrowRight');
const first = await page.evaluate(() => window.graspViewer.state().grasp);
assert.notEqual(first, null);
await page.keyboard.press('ArrowRight');
assert.notEqual(await page.evaluate(() => window.graspViewer.state().grasp), first);
await page.keyboard.press('Escape');
assert.equal(await page.evaluate(() => window.graspViewer.state().grasp), null);

// A click on a hand chooses one. The page says where it drew the first.
const box = await (await page.$('#canvas')).boundingBox();
const place = await page.evaluate(() => window.graspViewer.placeOf(0));
await page.mouse.click(box.x + place[0], box.y + place[1]);
assert.notEqual(await page.evaluate(() => window.graspViewer.state().grasp), null, 'a click chooses');

// Filters show what they say.
await page.select('#filter', 'outcome:0');
const shown = await page.evaluate(() => window.graspViewer.state().shown);
const object = await page.evaluate(() => window.graspViewer.state().object);
const own = summary.objects.find((o) => o.object === object);
assert.equal(shown, own.physics.outcomes.held, 'filter held');
await page.select('#filter', 'all');

// The convex pieces of the trial can be seen instead of the mesh.
await page.select('#surface', 'pieces');
assert.ok(await page.evaluate(() => window.graspViewer.state().pieces) > 0, 'convex pieces');
await page.select('#surface', 'mesh');
assert.equal(await page.evaluate(() => window.graspViewer.state().pieces), 0);

// A replay shows the recorded pose.
const files = readdirSync(path.join(run, 'replays'));
if (files.length) {
  const replay = JSON.parse(readFileSync(path.join(run, 'replays', files[0])));
  const raw = Buffer.from(replay.data, 'base64');
  const number = (frame, i) => raw.readFloatLE(4 * (frame * replay.numbers_per_frame + i));
  for (const share of [0, 0.4, 0.99]) {
    const k = Math.floor((replay.frames - 1) * share);
    const moment = await page.evaluate(({ id, grasp, t }) => {
      window.graspViewer.show(id);
      window.graspViewer.select(grasp);
      window.graspViewer.seek(t);
      return window.graspViewer.state().moment;
    }, { id: replay.object, grasp: replay.grasp, t: number(k, 0) });
    assert.ok(Math.abs(moment.t - number(k, 0)) < 1e-6);
    moment.world_from_object.forEach((x, i) => {
      assert.ok(Math.abs(x - number(k, 8 + i)) < 1e-4, `pose ${i} of frame ${k}`);
    });
  }
}

assert.deepEqual(complaints, []);
await browser.close();
console.log(`ok: ${summary.n} grasps, ${colours} colours`);
