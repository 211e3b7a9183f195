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
  }
  data.replayOf = new Map(data.replays.map((r) => [`${r.object}\n${r.grasp}`, r]));
  return data;
}

// Positions are 16-bit steps from a corner; meshes of up to 65 535 vertices.
export function meshArrays(mesh) {
  const steps = u16(mesh.vertices);
  const positions = new Float32Array(steps.length);
  for (let i = 0; i < steps.length; i++) positions[i] = mesh.low[i % 3] + steps[i] * mesh.step_m;
  return { positions, indices: u16(mesh.faces) };
}

// One replay: 29 numbers a frame, see docs/formats.md.
export const FRAME = 29;
export function replayFrames(replay) {
  replay.unpacked ??= f32(replay.data);
  return replay.unpacked;
}
