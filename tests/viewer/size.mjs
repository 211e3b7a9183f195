// node size.mjs REPORT.html: how long it takes to open, and to draw; prints one JSON line.

import { statSync } from 'node:fs';
import path from 'node:path';
import { launch, open } from './browser.mjs';

const file = path.resolve(process.argv[2]);
const browser = await launch();
const { page, opened_ms } = await open(browser, file);
const drawn = await page.evaluate(() => ({
  shown: window.graspViewer.state().shown,
  draw_calls: window.graspViewer.drawCalls(),
  frame_ms: window.graspViewer.timeFrames(5),
}));
await browser.close();
console.log(JSON.stringify({ megabytes: statSync(file).size / 1e6, opened_ms, ...drawn }));
