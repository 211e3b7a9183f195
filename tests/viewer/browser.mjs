// Opens a page in headless Chromium and notes what no report may do: errors, network requests.

import chromium from '@sparticuz/chromium';
import puppeteer from 'puppeteer-core';

export const NO_BROWSER = 77;

export async function launch() {
  try {
    return await puppeteer.launch({
      executablePath: await chromium.executablePath(),
      headless: 'shell',
      args: [
        '--no-sandbox', '--use-angle=swiftshader', '--enable-unsafe-swiftshader',
        '--ignore-gpu-blocklist',
      ],
    });
  } catch (error) {
    console.error(`no browser: ${error.message}`);
    process.exit(NO_BROWSER);
  }
}

export async function open(browser, file, { width = 1200, height = 900, scheme = 'light' } = {}) {
  const page = await browser.newPage();
  const complaints = [];
  page.on('console', (m) => {
    if (m.type() === 'error') complaints.push(`console: ${m.text()}`);
  });
  page.on('pageerror', (e) => complaints.push(`error: ${e.message}`));
  page.on('dialog', (d) => { complaints.push(`dialog: ${d.message()}`); d.dismiss(); });
  page.on('request', (r) => {
    if (!/^(file|data|blob):/.test(r.url())) complaints.push(`request: ${r.url()}`);
  });
  await page.setViewport({ width, height });
  await page.emulateMediaFeatures([{ name: 'prefers-color-scheme', value: scheme }]);
  const before = Date.now();
  await page.goto(`file://${file}`);
  await page.waitForFunction('window.graspViewer && window.graspViewer.ready', { timeout: 60000 });
  return { page, complaints, opened_ms: Date.now() - before };
}
