// Unpacks what the report carries: base64 arrays of numbers, little endian.

function bytes(text) {
  const raw = atob(text);
  const out = new Uint8Array(raw.length);
  for (let i = 0; i < raw.length; i++) out[i] = raw.charCodeAt(i);
  return out;
}

export const f32 = (text) => new Float32Array(bytes(text).buffer);
export const u32 = (text) => new Uint32Array(bytes(text).buffer);
export const u16 = (text) => new Uint16Array(bytes(text).buffer);
export const u8 = bytes;

export function readData() {
  const element = document.getElementById('shakedown-data');
  const data = JSON.parse(element.textContent);
  for (const o of data.objects) {
    o.grasp = u32(o.grasp);
    o.pose = f32(o.pose);
    o.class = u8(o.class);
    o.outcome = u8(o.outcome);
    o.label = u8(o.label);
    for (const name of Object.keys(o.numbers)) o.numbers[name] = f32(o.numbers[name]);
    o.count = o.grasp.length;
    if (o.base_outcome) o.base_outcome = u8(o.base_outcome);
  }
  const byGrasp = (list) => new Map((list || []).map((r) => [`${r.object}\n${r.grasp}`, r]));
  data.replayOf = { new: byGrasp(data.replays), base: byGrasp(data.base_replays) };
  if (data.comparison) for (const o of data.objects) o.change = changes(o, data);
  return data;
}

export const CHANGES = ['lost', 'won', 'success in both', 'failure in both'];

// What became of each grasp from the base run to this one: a place in CHANGES, or none.
function changes(o, { comparison, outcomes, classes }) {
  const { lost, won } = comparison.flips[o.id] || { lost: [], won: [] };
  const flipped = new Map([...lost.map((g) => [g, 0]), ...won.map((g) => [g, 1])]);
  const good = comparison.metric === 'held'
    ? (i) => o.outcome[i] === outcomes.indexOf('held')
    : (i) => o.class[i] === classes.indexOf('optimal');
  return Uint8Array.from(o.grasp, (g, i) => {
    if (!comparison.flips[o.id]) return 255;
    return flipped.get(g) ?? (good(i) ? 2 : 3);
  });
}

// Positions are 16-bit steps from a corner; meshes of up to 65 535 vertices.
function positionsOf(mesh, packed) {
  const steps = u16(packed);
  const positions = new Float32Array(steps.length);
  for (let i = 0; i < steps.length; i++) positions[i] = mesh.low[i % 3] + steps[i] * mesh.step_m;
  return positions;
}

export function meshArrays(mesh) {
  return { positions: positionsOf(mesh, mesh.vertices), indices: u16(mesh.faces) };
}

// Corners of the convex pieces.
export const piecesOf = (mesh) => (mesh.pieces || []).map((p) => positionsOf(mesh, p));

// One replay: 29 numbers a frame, see docs/formats.md.
export const FRAME = 29;
export function replayFrames(replay) {
  replay.unpacked ??= f32(replay.data);
  return replay.unpacked;
}
