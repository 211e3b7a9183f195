// What is drawn: one object, its grasps, and the trial that is played.

import {
  ArrowHelper, AxesHelper, BufferAttribute, BufferGeometry, Color, DirectionalLight, Group,
  HemisphereLight, LineBasicMaterial, Matrix4, Mesh, MeshStandardMaterial, PerspectiveCamera,
  Scene, Sphere, Vector3, WebGLRenderer,
} from 'three';
import { OrbitControls } from 'three/examples/jsm/controls/OrbitControls.js';
import { ConvexGeometry } from 'three/examples/jsm/geometries/ConvexGeometry.js';
import { FRAME, meshArrays, piecesOf, replayFrames } from './data.js';
import { Glyphs, makeHand, matrixOf } from './hand.js';

export class View {
  constructor(canvas, gripper) {
    this.renderer = new WebGLRenderer({ canvas, antialias: true, preserveDrawingBuffer: true });
    this.scene = new Scene();
    this.camera = new PerspectiveCamera(40, 1, 0.001, 20);
    this.camera.up.set(0, 0, 1);
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.addEventListener('change', () => this.draw());
    this.scene.add(new HemisphereLight(0xffffff, 0x666677, 2.2));
    const sun = new DirectionalLight(0xffffff, 1.6);
    sun.position.set(1, -2, 3);
    this.scene.add(sun);
    // A trial is shown with the approach downwards, an object's grasps as its mesh has them.
    this.root = new Group();
    this.scene.add(this.root);
    this.object = new Group();
    this.material = new MeshStandardMaterial({
      color: 0x9fb4c7, roughness: 0.85, transparent: true, opacity: 1, side: 2, flatShading: true,
    });
    this.axes = new AxesHelper(0.05);
    this.axes.visible = false;
    this.object.add(this.axes);
    this.glyphs = new Glyphs(gripper);
    this.selected = new Glyphs(gripper);
    this.selected.material = new LineBasicMaterial({ vertexColors: true, depthTest: false });
    this.selected.lines.material = this.selected.material;
    this.selected.lines.renderOrder = 2;
    this.object.add(this.glyphs.lines, this.selected.lines);
    this.root.add(this.object);
    const { hand, fingers } = makeHand(gripper);
    this.hand = hand;
    this.fingers = fingers;
    this.hand.visible = false;
    this.root.add(hand);
    this.arrows = [0, 1].map(() => {
      const arrow = new ArrowHelper(new Vector3(1, 0, 0), new Vector3(), 0.03, 0xd55e00);
      arrow.visible = false;
      this.root.add(arrow);
      return arrow;
    });
    this.bounds = new Sphere(new Vector3(), 0.1);
    this.theme();
  }

  theme() {
    const style = getComputedStyle(document.documentElement);
    this.scene.background = new Color(style.getPropertyValue('--canvas').trim() || '#f4f5f7');
  }

  setObject(object) {
    if (this.mesh) {
      this.object.remove(this.mesh);
      this.mesh.geometry.dispose();
      this.mesh = null;
    }
    if (object.mesh) {
      const { positions, indices } = meshArrays(object.mesh);
      const geometry = new BufferGeometry();
      geometry.setAttribute('position', new BufferAttribute(positions, 3));
      geometry.setIndex(new BufferAttribute(indices, 1));
      geometry.computeVertexNormals();
      geometry.computeBoundingSphere();
      this.mesh = new Mesh(geometry, this.material);
      this.object.add(this.mesh);
      this.bounds = geometry.boundingSphere.clone();
    }
    this.setPieces(object.mesh ? piecesOf(object.mesh) : []);
    this.bounds.radius = Math.max(this.bounds.radius, 0.06);
  }

  setPieces(pieces) {
    for (const piece of this.pieces?.children || []) piece.geometry.dispose();
    if (this.pieces) this.object.remove(this.pieces);
    this.pieces = new Group();
    pieces.forEach((corners, i) => {
      const points = [];
      for (let k = 0; k < corners.length; k += 3) {
        points.push(new Vector3(corners[k], corners[k + 1], corners[k + 2]));
      }
      // Steps of the golden angle keep neighbours apart.
      const colour = new Color().setHSL((i * 0.381966) % 1, 0.45, 0.6);
      const material = new MeshStandardMaterial({ color: colour, roughness: 0.85, flatShading: true });
      this.pieces.add(new Mesh(new ConvexGeometry(points), material));
    });
    this.object.add(this.pieces);
    this.showAs(this.surface || 'mesh');
  }

  // 'mesh', 'pieces' or 'both'. Without pieces there is always the mesh.
  showAs(surface) {
    this.surface = surface;
    const hasPieces = this.pieces.children.length > 0;
    this.pieces.visible = hasPieces && surface !== 'mesh';
    if (this.mesh) this.mesh.visible = !hasPieces || surface !== 'pieces';
  }

  look(direction) {
    const towards = { fit: [1, -1.4, 0.9], front: [0, -1, 0.001], top: [0, -0.001, 1], side: [1, 0, 0.001] };
    const way = new Vector3(...towards[direction]).normalize();
    const centre = this.bounds.center.clone().applyMatrix4(this.object.matrix);
    let room = this.bounds.radius + 0.09;
    if (this.hand.visible) {
      // Object and hand: half way between their middles.
      const hand = new Vector3(0, 0, 0.04).applyMatrix4(this.hand.matrix);
      room = Math.max(this.bounds.radius, 0.13) + centre.distanceTo(hand) / 2;
      centre.add(hand).multiplyScalar(0.5);
    }
    this.root.updateMatrix();
    centre.applyMatrix4(this.root.matrix);
    const narrow = Math.min(1, this.camera.aspect);
    const distance = room / Math.tan((this.camera.fov * Math.PI) / 360) / narrow;
    this.controls.target.copy(centre);
    this.camera.position.copy(centre).addScaledVector(way, distance);
    this.controls.update();
    this.draw();
  }

  // The object rests in its own frame, all hands about it.
  rest() {
    this.hand.visible = false;
    this.root.rotation.x = 0;
    for (const arrow of this.arrows) arrow.visible = false;
    this.place(this.object, new Matrix4());
    this.glyphs.lines.visible = true;
    this.selected.lines.visible = true;
    this.draw();
  }

  place(group, matrix) {
    group.matrixAutoUpdate = false;
    group.matrix.copy(matrix);
    group.matrixWorldNeedsUpdate = true;
  }

  // The moment of a replay: poses between frames are those of the frame before.
  seek(replay, t) {
    const frames = replayFrames(replay);
    const count = frames.length / FRAME;
    let k = 0;
    while (k + 1 < count && frames[(k + 1) * FRAME] <= t + 1e-6) k++;
    const at = k * FRAME;
    const hand = matrixOf(frames, at + 1, new Matrix4());
    const object = matrixOf(frames, at + 8, new Matrix4());
    // Seen from the hand's first pose: the world of the trial.
    this.root.rotation.x = Math.PI;
    this.place(this.hand, hand);
    this.place(this.object, object);
    this.fingers[0].position.x = frames[at + 15];
    this.fingers[1].position.x = -frames[at + 16];
    this.arrows.forEach((arrow, i) => {
      const from = at + 17 + 6 * i;
      const force = new Vector3(frames[from + 3], frames[from + 4], frames[from + 5]);
      const size = force.length();
      arrow.visible = size > 0;
      if (size > 0) {
        arrow.position.set(frames[from], frames[from + 1], frames[from + 2]);
        arrow.setDirection(force.clone().divideScalar(size));
        arrow.setLength(Math.min(0.08, 0.01 + 0.002 * size), 0.008, 0.005);
      }
    });
    this.hand.visible = true;
    this.glyphs.lines.visible = false;
    this.selected.lines.visible = false;
    this.draw();
    return {
      t: frames[at],
      world_from_object: Array.from(frames.slice(at + 8, at + 15)),
      world_from_hand: Array.from(frames.slice(at + 1, at + 8)),
      force_n: [0, 1].map((i) => Math.hypot(...frames.slice(at + 20 + 6 * i, at + 23 + 6 * i))),
    };
  }

  resize() {
    const canvas = this.renderer.domElement;
    const { clientWidth: w, clientHeight: h } = canvas.parentElement;
    this.renderer.setPixelRatio(Math.min(2, window.devicePixelRatio || 1));
    this.renderer.setSize(w, h, false);
    this.camera.aspect = w / h;
    this.camera.updateProjectionMatrix();
    this.draw();
  }

  draw() {
    this.renderer.render(this.scene, this.camera);
  }

  // Where on the canvas the n-th drawn hand is.
  placeOf(n) {
    const { clientWidth: w, clientHeight: h } = this.renderer.domElement;
    const p = this.glyphs.centres[n].clone().project(this.camera);
    return [(p.x + 1) * w / 2, (1 - p.y) * h / 2, p.z];
  }

  // Which of the drawn hands is nearest to a place on the canvas? -1: none within reach.
  pick(x, y) {
    let best = -1;
    let nearest = 18 * 18;
    this.glyphs.centres.forEach((_, n) => {
      const [px, py, depth] = this.placeOf(n);
      const d = (px - x) ** 2 + (py - y) ** 2;
      if (depth < 1 && d < nearest) {
        nearest = d;
        best = n;
      }
    });
    return best;
  }
}
