// node compare.mjs COMPARISON.html: claims about the page of a comparison, against its own JSON.

import assert from 'node:assert/strict';
import path from 'node:path';
import { launch, open } from './browser.mjs';

const browser = await launch();
const { page, complaints } = await open(browser, path.resolve(process.argv[2]));
const report = JSON.parse(await page.evaluate(() => document.querySelector('details pre').textContent));
const { pairs } = report.comparison;
assert.ok(pairs.lost > 0, 'the test wants a grasp that changed sides');

// As many grasps of each kind of change as the comparison counted.
assert.deepEqual(await page.evaluate(() => window.graspViewer.changes()), {
  lost: pairs.lost, won: pairs.won, 'success in both': pairs.both, 'failure in both': pairs.neither,
});

// A click on the number of a grasp that was lost shows it, and its trial in both runs.
const flip = await page.$('button.flip');
const wanted = await flip.evaluate((b) => ({ object: b.dataset.object, grasp: Number(b.dataset.grasp) }));
await flip.click();
const state = () => page.evaluate(() => window.graspViewer.state());
const now = await state();
assert.deepEqual({ object: now.object, grasp: now.grasp }, wanted);
assert.equal(await page.$eval('#run', (e) => e.hidden), false, 'both runs recorded it');
const ends = {};
for (const run of ['new', 'base']) {
  await page.select('#run', run);
  await page.evaluate(() => window.graspViewer.seek(1e9));
  ends[run] = (await state()).moment;
}
assert.notDeepEqual(ends.new, ends.base, 'two runs, two trials');

assert.deepEqual(complaints, []);
await browser.close();
console.log(`ok: ${pairs.lost} lost, ${pairs.won} won`);
