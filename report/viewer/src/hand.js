// The hand of the manifest as meshes and as a line drawing.

import {
  BoxGeometry, BufferAttribute, BufferGeometry, Color, Euler, Group, LineBasicMaterial, LineSegments,
  Matrix4, Mesh, MeshStandardMaterial, Quaternion, Vector3,
} from 'three';
import { ConvexGeometry } from 'three/examples/jsm/geometries/ConvexGeometry.js';

function partGeometry(part) {
  if (part.hull_m && part.hull_m.length) {
    return new ConvexGeometry(part.hull_m.map((p) => new Vector3(...p)));
  }
  const box = part.box || part.cuboid;
  const geometry = new BoxGeometry(...box.size_m);
  const [roll, pitch, yaw] = box.rpy_rad || [0, 0, 0];
  geometry.applyMatrix4(new Matrix4().makeRotationFromEuler(new Euler(roll, pitch, yaw, 'ZYX')));
  geometry.translate(...box.centre_m);
  return geometry;
}

export function makeHand(gripper) {
  const material = () => new MeshStandardMaterial({
    color: 0xb8bec6, roughness: 0.7, metalness: 0.1, flatShading: true,
  });
  const hand = new Group();
  const fingers = [new Group(), new Group()];
  for (const part of gripper.palm) hand.add(new Mesh(partGeometry(part), material()));
  for (const [i, group] of fingers.entries()) {
    // The second finger is the first one turned by half a turn about the approach direction.
    const turned = new Group();
    if (i === 1) turned.rotation.z = Math.PI;
    for (const part of gripper.finger) turned.add(new Mesh(partGeometry(part), material()));
    group.add(turned);
    hand.add(group);
  }
  return { hand, fingers };
}

// Line segments of one open hand, hand frame: stem, bar, two fingers.
function glyphPoints(gripper) {
  const half = gripper.opening_max_m / 2;
  const tip = gripper.pad.z_max_m;
  const bar = gripper.pad.z_min_m - 0.045;
  return [
    [0, 0, bar - 0.03], [0, 0, bar],
    [-half, 0, bar], [half, 0, bar],
    [-half, 0, bar], [-half, 0, tip],
    [half, 0, bar], [half, 0, tip],
  ];
}

// All hands of an object in one draw call.
export class Glyphs {
  constructor(gripper) {
    this.points = glyphPoints(gripper).map((p) => new Vector3(...p));
    this.tcp = new Vector3(0, 0, gripper.tcp_z_m);
    this.material = new LineBasicMaterial({ vertexColors: true, transparent: true, opacity: 0.9 });
    this.lines = new LineSegments(new BufferGeometry(), this.material);
    this.lines.frustumCulled = false;
    this.centres = [];
  }

  show(poses, chosen, colourOf) {
    const each = this.points.length;
    const positions = new Float32Array(chosen.length * each * 3);
    const colours = new Float32Array(chosen.length * each * 3);
    const pose = new Matrix4();
    const point = new Vector3();
    const colour = new Color();
    this.centres = [];
    chosen.forEach((grasp, n) => {
      matrixOf(poses, grasp * 7, pose);
      colour.set(colourOf(grasp));
      this.points.forEach((p, k) => {
        point.copy(p).applyMatrix4(pose).toArray(positions, (n * each + k) * 3);
        colour.toArray(colours, (n * each + k) * 3);
      });
      this.centres.push(this.tcp.clone().applyMatrix4(pose));
    });
    this.lines.geometry.dispose();
    this.lines.geometry = new BufferGeometry();
    this.lines.geometry.setAttribute('position', new BufferAttribute(positions, 3));
    this.lines.geometry.setAttribute('color', new BufferAttribute(colours, 3));
  }
}

const ONE = new Vector3(1, 1, 1);
export function matrixOf(numbers, at, out) {
  const t = new Vector3(numbers[at], numbers[at + 1], numbers[at + 2]);
  const q = new Quaternion(numbers[at + 3], numbers[at + 4], numbers[at + 5], numbers[at + 6]);
  return out.compose(t, q, ONE);
}
