// The 3-D view of a report: choose an object, filter its grasps, click one, play its trial.

import { CHANGE, CLASS, OUTCOME, UNKNOWN, ramp } from './colours.js';
import { CHANGES, FRAME, readData, replayFrames } from './data.js';
import { View } from './scene.js';

const $ = (id) => document.getElementById(id);
const NONE = 255;

function start() {
  const data = readData();
  if (!data.objects.length) {
    window.graspViewer = { ready: true };
    return;
  }
  const section = $('viewer');
  section.hidden = false;
  let view;
  try {
    view = new View($('canvas'), data.gripper);
  } catch (error) {
    $('no-webgl').hidden = false;
    $('stage').hidden = true;
    window.graspViewer = { ready: true, failed: String(error) };
    return;
  }
  new App(data, view);
}

class App {
  constructor(data, view) {
    Object.assign(this, { data, view, index: 0, grasp: -1, playing: false, t: 0, moment: null });
    this.fill($('object'), data.objects.map((o) => o.id));
    const modes = [['outcome', 'outcome'], ['class', 'geometry'], ['p_hold', 'p_hold']];
    for (const [value, text] of modes) this.option($('colour'), value, text);
    this.option($('filter'), 'all', 'all grasps');
    data.outcomes.forEach((name, i) => this.option($('filter'), `outcome:${i}`, name));
    data.classes.forEach((name, i) => this.option($('filter'), `class:${i}`, `geometry: ${name}`));
    this.option($('filter'), 'replay', 'with a replay');
    if (data.comparison) this.compares();
    if (!data.objects.some((o) => o.outcome.some((x) => x !== NONE))) $('colour').value = 'class';
    this.listen();
    this.show(0);
    view.resize();
    view.look('fit');
    window.graspViewer = {
      ready: true,
      state: () => this.state(),
      select: (id) => this.select(id),
      show: (id) => this.show(data.objects.findIndex((o) => o.id === id)),
      seek: (t) => this.seek(t),
      counts: () => this.counts(),
      changes: () => this.changes(),
      placeOf: (n) => view.placeOf(n),
      drawCalls: () => view.renderer.info.render.calls,
      timeFrames: (n) => {
        const before = performance.now();
        for (let i = 0; i < n; i++) view.draw();
        view.renderer.getContext().finish();
        return (performance.now() - before) / n;
      },
    };
  }

  get object() { return this.data.objects[this.index]; }

  replayIn(run, i) {
    return this.data.replayOf[run].get(`${this.object.id}\n${this.object.grasp[i]}`);
  }

  // Of the chosen run, or of the one that recorded this trial.
  get replay() {
    if (this.grasp < 0) return undefined;
    const run = this.data.comparison ? $('run').value : 'new';
    return this.replayIn(run, this.grasp)
      || (this.data.comparison && this.replayIn(run === 'new' ? 'base' : 'new', this.grasp));
  }

  // Two runs: colours and filters by what changed, and a choice of whose trial is played.
  compares() {
    this.option($('colour'), 'change', 'change');
    $('colour').value = 'change';
    CHANGES.forEach((name, i) => this.option($('filter'), `change:${i}`, name));
    this.option($('run'), 'new', 'new run');
    this.option($('run'), 'base', 'base run');
    $('run').onchange = () => this.choose(this.grasp);
    for (const button of document.querySelectorAll('button.flip')) {
      button.onclick = () => {
        this.show(this.data.objects.findIndex((o) => o.id === button.dataset.object));
        this.select(Number(button.dataset.grasp));
        $('viewer').scrollIntoView();
      };
    }
  }

  option(select, value, text) {
    const option = document.createElement('option');
    option.value = value;
    option.textContent = text;
    select.append(option);
  }

  fill(select, names) {
    names.forEach((name, i) => this.option(select, String(i), name));
  }

  listen() {
    const { view } = this;
    $('object').onchange = () => { this.show(Number($('object').value)); view.look('fit'); };
    $('colour').onchange = () => this.paint();
    $('filter').onchange = () => this.paint();
    $('opacity').oninput = () => {
      view.material.opacity = Number($('opacity').value);
      view.material.depthWrite = view.material.opacity > 0.95;
      view.draw();
    };
    $('wireframe').onchange = () => { view.material.wireframe = $('wireframe').checked; view.draw(); };
    $('surface').onchange = () => { view.showAs($('surface').value); view.draw(); };
    $('axes').onchange = () => { view.axes.visible = $('axes').checked; view.draw(); };
    for (const name of ['fit', 'front', 'top']) $(name).onclick = () => view.look(name);
    $('from-side').onclick = () => view.look('side');
    $('png').onclick = () => this.exportPng();
    $('play').onclick = () => this.play(!this.playing);
    $('close').onclick = () => this.select(null);
    $('time').oninput = () => this.seek(Number($('time').value));
    const canvas = $('canvas');
    let down = null;
    canvas.addEventListener('pointerdown', (e) => { down = [e.offsetX, e.offsetY]; });
    canvas.addEventListener('pointerup', (e) => {
      const moved = down && Math.hypot(e.offsetX - down[0], e.offsetY - down[1]) > 4;
      if (moved || view.hand.visible) return;
      const n = view.pick(e.offsetX, e.offsetY);
      if (n >= 0) this.choose(this.chosen[n]);
    });
    canvas.addEventListener('keydown', (e) => {
      const step = { ArrowRight: 1, ArrowDown: 1, ArrowLeft: -1, ArrowUp: -1 }[e.key];
      if (step && this.chosen.length) {
        const at = this.chosen.indexOf(this.grasp);
        const n = this.chosen.length;
        this.choose(this.chosen[at < 0 ? 0 : (at + step + n) % n]);
      } else if (e.key === ' ') this.play(!this.playing);
      else if (e.key === 'Escape') this.select(null);
      else return;
      e.preventDefault();
    });
    window.addEventListener('resize', () => view.resize());
    window.matchMedia('(prefers-color-scheme: dark)').addEventListener('change', () => {
      view.theme();
      view.draw();
    });
  }

  show(index) {
    if (index < 0) return;
    this.index = index;
    $('object').value = String(index);
    this.grasp = -1;
    this.play(false);
    this.inTrial = false;
    this.view.setObject(this.object);
    this.view.rest();
    this.paint();
    this.describe();
  }

  colourOf(i) {
    const o = this.object;
    const mode = $('colour').value;
    if (mode === 'class') return CLASS[o.class[i]] || UNKNOWN;
    if (mode === 'change') return CHANGE[o.change[i]] || UNKNOWN;
    if (mode === 'p_hold') return ramp(o.numbers.p_hold ? o.numbers.p_hold[i] : NaN);
    return OUTCOME[o.outcome[i]] || UNKNOWN;
  }

  passes(i) {
    const [kind, value] = $('filter').value.split(':');
    const o = this.object;
    if (kind === 'outcome') return o.outcome[i] === Number(value);
    if (kind === 'class') return o.class[i] === Number(value);
    if (kind === 'change') return o.change[i] === Number(value);
    if (kind === 'replay') return Boolean(this.replayIn('new', i) || this.replayIn('base', i));
    return true;
  }

  paint() {
    this.chosen = [];
    for (let i = 0; i < this.object.count; i++) if (this.passes(i)) this.chosen.push(i);
    this.view.glyphs.show(this.object.pose, this.chosen, (i) => this.colourOf(i));
    this.legend();
    this.view.draw();
  }

  legend() {
    const mode = $('colour').value;
    const o = this.object;
    const [names, colours, codes] = {
      class: [this.data.classes, CLASS, o.class],
      outcome: [this.data.outcomes, OUTCOME, o.outcome],
      change: [CHANGES, CHANGE, o.change],
      p_hold: [[], [], []],
    }[mode];
    const items = mode === 'p_hold'
      ? [0.1, 0.3, 0.5, 0.7, 0.9].map((p) => [ramp(p), p.toFixed(1)])
      : names.map((name, i) => {
        const n = codes.reduce((sum, c) => sum + (c === i), 0);
        return [colours[i], `${name} ${n}`, n];
      }).filter((item) => item[2] > 0);
    $('legend').replaceChildren(...items.map(([colour, text]) => {
      const entry = document.createElement('span');
      const swatch = document.createElement('i');
      swatch.style.background = colour;
      entry.append(swatch, text);
      return entry;
    }));
  }

  select(id) {
    if (id === null) {
      this.grasp = -1;
      this.play(false);
      this.view.rest();
      if (this.inTrial) this.view.look('fit');
      this.inTrial = false;
      this.view.selected.show(this.object.pose, [], () => '#000');
      this.describe();
      this.view.draw();
      return;
    }
    const i = this.object.grasp.indexOf(id);
    if (i >= 0) this.choose(i);
  }

  choose(i) {
    this.grasp = i;
    this.play(false);
    this.view.rest();
    this.view.selected.show(this.object.pose, [i], () => '#ff00aa');
    this.describe();
    const replay = this.replay;
    $('player').hidden = !replay;
    const both = this.data.comparison && this.replayIn('new', i) && this.replayIn('base', i);
    $('run').hidden = !both;
    if (replay) {
      const frames = replayFrames(replay);
      $('time').max = String(frames[frames.length - FRAME]);
      const wasPlaying = this.inTrial;
      this.seek(0);
      this.inTrial = true;
      if (!wasPlaying) this.view.look('fit');
    } else if (this.inTrial) {
      this.inTrial = false;
      this.view.look('fit');
    }
    this.view.draw();
  }

  describe() {
    const rows = [];
    const o = this.object;
    const i = this.grasp;
    $('player').hidden = true;
    if (i < 0) {
      $('row').replaceChildren();
      $('hint').hidden = false;
      return;
    }
    $('hint').hidden = true;
    rows.push(['grasp', String(o.grasp[i])]);
    if (o.class[i] !== NONE) rows.push(['geometry', this.data.classes[o.class[i]]]);
    if (o.outcome[i] !== NONE) rows.push(['outcome', this.data.outcomes[o.outcome[i]]]);
    if (o.base_outcome && o.base_outcome[i] !== NONE) {
      rows.push(['outcome in the base run', this.data.outcomes[o.base_outcome[i]]]);
    }
    if (o.label[i] !== NONE) rows.push(['label of the input', String(o.label[i])]);
    for (const [name, values] of Object.entries(o.numbers)) {
      if (Number.isFinite(values[i])) rows.push([name, String(Number(values[i].toPrecision(4)))]);
    }
    $('row').replaceChildren(...rows.map(([name, value]) => {
      const tr = document.createElement('tr');
      const th = document.createElement('th');
      const td = document.createElement('td');
      th.textContent = name;
      td.textContent = value;
      tr.append(th, td);
      return tr;
    }));
  }

  seek(t) {
    const replay = this.replay;
    if (!replay) return;
    this.t = t;
    this.moment = this.view.seek(replay, t);
    $('time').value = String(t);
    const [a, b] = this.moment.force_n.map((f) => f.toFixed(1));
    $('clock').textContent = `${this.moment.t.toFixed(2)} s, pads ${a} N and ${b} N`;
  }

  play(on) {
    this.playing = on && Boolean(this.replay);
    $('play').textContent = this.playing ? 'pause' : 'play';
    if (!this.playing) return;
    const end = Number($('time').max);
    if (this.t >= end) this.seek(0);
    let last = performance.now();
    const tick = (now) => {
      if (!this.playing) return;
      const t = this.t + (now - last) / 1000;
      last = now;
      this.seek(Math.min(t, end));
      if (t >= end) this.play(false);
      else requestAnimationFrame(tick);
    };
    requestAnimationFrame(tick);
  }

  exportPng() {
    this.view.draw();
    $('canvas').toBlob((blob) => {
      const link = document.createElement('a');
      link.href = URL.createObjectURL(blob);
      link.download = 'grasps.png';
      link.click();
      URL.revokeObjectURL(link.href);
    });
  }

  counts() {
    const counts = {};
    for (const o of this.data.objects) {
      for (const code of o.outcome) {
        if (code !== NONE) {
          const name = this.data.outcomes[code];
          counts[name] = (counts[name] || 0) + 1;
        }
      }
    }
    return counts;
  }

  // Grasps per kind of change, over all objects.
  changes() {
    const counts = Object.fromEntries(CHANGES.map((name) => [name, 0]));
    for (const o of this.data.objects) {
      for (const code of o.change || []) if (code !== NONE) counts[CHANGES[code]] += 1;
    }
    return counts;
  }

  state() {
    return {
      object: this.object.id,
      grasp: this.grasp < 0 ? null : this.object.grasp[this.grasp],
      shown: this.chosen.length,
      t: this.t,
      playing: this.playing,
      pieces: this.view.pieces.visible ? this.view.pieces.children.length : 0,
      moment: this.moment,
    };
  }
}

start();
