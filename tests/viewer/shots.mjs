// node shots.mjs REPORT.html OUT_DIRECTORY: the report in light, dark and on a phone, and a trial.

import path from 'node:path';
import { launch, open } from './browser.mjs';

const [, , report, out] = process.argv;
const file = path.resolve(report);
const browser = await launch();
const shots = [
  ['light', { width: 1200 }], ['dark', { width: 1200, scheme: 'dark' }],
  ['phone', { width: 390, height: 844 }],
];
for (const [name, options] of shots) {
  const { page } = await open(browser, file, options);
  await page.screenshot({ path: path.join(out, `${name}.png`), fullPage: true });
  await page.close();
}
const { page } = await open(browser, file, { width: 1100, height: 640 });
await page.evaluate(() => {
  document.getElementById('viewer').scrollIntoView();
  document.getElementById('filter').value = 'replay';
  document.getElementById('filter').onchange();
});
await page.focus('#canvas');
await page.keyboard.press('ArrowRight');
await page.evaluate(() => window.graspViewer.seek(0.6));
await page.screenshot({ path: path.join(out, 'trial.png') });
await browser.close();
