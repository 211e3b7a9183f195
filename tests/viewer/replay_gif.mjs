// node replay_gif.mjs REPORT.html OBJECT GRASP OUT.gif: a recorded trial as a small animation.

import { writeFileSync } from 'node:fs';
import path from 'node:path';
import gifenc from 'gifenc';
import { PNG } from 'pngjs';
import { launch, open } from './browser.mjs';

const { GIFEncoder, applyPalette, quantize } = gifenc;
const [, , report, object, grasp, out] = process.argv;
const FRAMES_PER_S = 12;
const browser = await launch();
const { page } = await open(browser, path.resolve(report), { width: 720, height: 900 });
const end_s = await page.evaluate(({ id, n }) => {
  window.graspViewer.show(id);
  window.graspViewer.select(n);
  document.getElementById('viewer').scrollIntoView();
  return Number(document.getElementById('time').max);
}, { id: object, n: Number(grasp) });
const frame = await page.$('#frame');
const gif = GIFEncoder();
for (let t = 0; t <= end_s; t += 1 / FRAMES_PER_S) {
  await page.evaluate((at) => window.graspViewer.seek(at), t);
  const { data, width, height } = PNG.sync.read(Buffer.from(await frame.screenshot()));
  const palette = quantize(data, 48);
  gif.writeFrame(applyPalette(data, palette), width, height, { palette, delay: 1000 / FRAMES_PER_S });
}
gif.finish();
writeFileSync(out, gif.bytes());
await browser.close();
