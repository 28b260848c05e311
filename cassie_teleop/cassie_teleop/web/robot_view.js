// The robot in 3D, drawn by three.js: links as /robot_description has them, placed as /tf says.
import { OrbitControls, STLLoader, THREE } from "/lib/scene/index.js";

const STEPS = 40; // footsteps that stay on the ground
const STEP_COLOURS = [0x4aa3ff, 0xf2a25c]; // left, right
const ROBOT_HEIGHT = 1.6, ROBOT_WIDTH = 1.1, MIDDLE = 0.64; // m that must be in the picture, with some room
const LOADED = 0.5; // contact probability from which a foot is on the ground
const GROUND = 80, TILE = 1; // m; a tile has four fields
const SEGWAY = { platform: 0.145, wheel: 0.13, track: 0.485, bar: 0.42 }; // m, as the simulator's
const FOLLOW = 0.15; // of the way to the robot, that the camera goes with each frame
const SOFTWARE = /swiftshader|llvmpipe|softpipe|software|basic render/i; // who draws where there is no graphics card

export class RobotView {
  constructor(canvas) {
    this.canvas = canvas;
    this.software = SOFTWARE.test(rendererName());
    this.renderer = new THREE.WebGLRenderer({ canvas, antialias: !this.software });
    this.renderer.setPixelRatio(this.software ? 1 : Math.min(devicePixelRatio, 2));
    this.renderer.shadowMap.enabled = !this.software;
    this.scene = new THREE.Scene();
    this.scene.background = new THREE.Color(0x20272e);
    this.scene.fog = new THREE.Fog(0x20272e, 7, 18);
    this.camera = new THREE.PerspectiveCamera(32, 1, 0.05, 60);
    this.camera.up.set(0, 0, 1);
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.enablePan = false;
    this.controls.minDistance = 1;
    this.controls.maxDistance = 15;
    this.controls.maxPolarAngle = 0.49 * Math.PI;
    this.controls.addEventListener("start", () => (this.own = false));
    canvas.addEventListener("dblclick", () => this.frame());

    this.scene.add(new THREE.HemisphereLight(0xdfe9f3, 0x3a3f45, 2.2));
    this.sun = new THREE.DirectionalLight(0xffffff, 2.4);
    this.sun.castShadow = true;
    this.sun.shadow.mapSize.set(1024, 1024);
    Object.assign(this.sun.shadow.camera, { left: -1.5, right: 1.5, top: 1.5, bottom: -1.5, near: 0.5, far: 8 });
    this.scene.add(this.sun, this.sun.target);

    this.ground = this.software ? gridded() : chequered(this.renderer.capabilities.getMaxAnisotropy());
    this.scene.add(this.ground);
    this.vehicle = segway();
    this.scene.add(this.vehicle);

    this.place = new THREE.Vector3(0, 0, 0); // of the robot on the ground; the camera follows it
    this.robot = null;
    this.number = 0;
    this.clear();
    this.own = true; // whether the camera stands where `frame` has put it
    new ResizeObserver(() => this.resize()).observe(canvas.parentElement);
    this.resize();
  }

  /** Draws a picture. */
  render() {
    this.controls.update();
    this.renderer.render(this.scene, this.camera);
  }

  /** Builds the robot anew out of /robot.json. */
  async load() {
    const number = ++this.number;
    const links = await (await fetch("/robot.json")).json();
    const loader = new STLLoader();
    const meshes = new Map();
    const geometry = (index) => {
      if (!meshes.has(index)) meshes.set(index, loader.loadAsync(`/mesh/${index}.stl`));
      return meshes.get(index);
    };
    const robot = { groups: new Map(), moving: [], soles: [[], []] };
    for (const link of links) {
      const group = new THREE.Group();
      place(group, link.rest);
      robot.groups.set(link.name, group);
      robot.groups.get(link.parent)?.add(group);
      for (const shape of link.shapes) group.add(await solid(shape, geometry));
      for (const [x, y, z, radius] of link.soles) {
        const sole = new THREE.Object3D();
        sole.position.set(x, y, z);
        sole.radius = radius;
        group.add(sole);
        robot.soles[link.name.includes("right") ? 1 : 0].push(sole);
      }
    }
    if (number !== this.number || !links.length) return; // another one has come meanwhile
    this.clear();
    this.robot = robot;
    robot.root = robot.groups.get(links[0].name);
    robot.root.visible = false; // until it is known where it is
    this.scene.add(robot.root);
    // As the server lists them: the root, then what moves.
    robot.moving = links.filter((link) => link.moves).map((link) => robot.groups.get(link.name));
  }

  clear() {
    if (this.robot) this.scene.remove(this.robot.root);
    this.robot = null;
    this.restart();
  }

  /** Forgets where the robot was: a new episode begins at another place. */
  restart() {
    for (const step of this.steps ?? []) this.scene.remove(step);
    this.steps = [];
    this.canvas.dataset.steps = 0;
    this.contact = [false, false];
    this.height = null;
    this.level = null;
  }

  /** Places the robot; `contact` are the feet's contact probabilities, or null; `rides` a Segway. */
  show(poses, contact, rides) {
    this.vehicle.visible = false;
    if (!this.robot || poses.length !== this.robot.moving.length) return;
    poses.forEach((pose, i) => pose.length && place(this.robot.moving[i], pose));
    const root = this.robot.root;
    root.visible = poses[0].length > 0;
    root.updateMatrixWorld(true);
    const feet = this.robot.soles.map((soles) => soles.map((sole) => sole.getWorldPosition(new THREE.Vector3())));
    if (!root.visible) return;
    if (feet.every((foot) => foot.length)) {
      this.stand(feet, contact, rides);
      if (rides) this.ride(feet.flat(), root);
    }
    this.follow(root.position);
  }

  /** Height of the pelvis above the mean of the soles, the level of the ground, footsteps on it. */
  stand(feet, contact, rides) {
    const low = feet.map((foot, i) => Math.min(...foot.map((point, j) => point.z - this.robot.soles[i][j].radius)));
    this.height = this.robot.root.position.z - (low[0] + low[1]) / 2;
    this.level ??= Math.min(...low);
    if (!contact) return;
    const standing = contact.map((value) => value > LOADED);
    const levels = low.filter((_, i) => standing[i]);
    if (levels.length) {
      const level = levels.reduce((a, b) => a + b) / levels.length;
      this.level += (Math.abs(level - this.level) > 0.3 ? 1 : 0.1) * (level - this.level);
    } else {
      this.level = Math.min(this.level, ...low); // no foot in the air is below the ground
    }
    if (!rides) standing.forEach((now, i) => now && !this.contact[i] && this.step(i, feet[i]));
    this.contact = standing;
  }

  /** Draws the Segway under the feet, whose estimated place rests while it rolls. */
  ride(points, root) {
    const middle = points.reduce((sum, point) => sum.add(point), new THREE.Vector3()).divideScalar(points.length);
    const ahead = new THREE.Vector3(1, 0, 0).applyQuaternion(root.quaternion);
    this.vehicle.position.set(middle.x, middle.y, (this.level ?? 0) - SEGWAY.platform);
    this.vehicle.rotation.z = Math.atan2(ahead.y, ahead.x);
    this.vehicle.visible = this.contact.some((standing) => standing);
  }

  step(side, foot) {
    const old = this.steps.length >= STEPS ? this.steps.shift() : null;
    const mark = old ?? new THREE.Mesh(new THREE.PlaneGeometry(0.17, 0.045), new THREE.MeshBasicMaterial({ transparent: true, opacity: 0.75 }));
    mark.material.color.set(STEP_COLOURS[side]);
    const [a, b] = [foot[0], foot.at(-1)];
    mark.position.set((a.x + b.x) / 2, (a.y + b.y) / 2, (this.level ?? 0) + 0.006);
    mark.rotation.z = Math.atan2(b.y - a.y, b.x - a.x);
    this.scene.add(mark);
    this.steps.push(mark);
    this.canvas.dataset.steps = this.steps.length;
  }

  follow(base) {
    const move = new THREE.Vector3(base.x, base.y, this.level ?? base.z - 1).sub(this.place);
    move.multiplyScalar(move.length() > 0.8 ? 1 : FOLLOW);
    this.place.add(move);
    this.camera.position.add(move);
    this.controls.target.copy(this.place).setZ(this.place.z + MIDDLE);
    this.ground.position.set(TILE * Math.round(this.place.x / TILE), TILE * Math.round(this.place.y / TILE), this.place.z - (this.vehicle.visible ? SEGWAY.platform : 0));
    this.sun.position.copy(this.place).add(new THREE.Vector3(1.9, -0.9, 3.2));
    this.sun.target.position.copy(this.place);
  }

  resize() {
    const { clientWidth: width, clientHeight: height } = this.canvas.parentElement;
    if (!width || !height) return;
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / height;
    // The lower part is under the buttons (and sticks, where those are below them): the robot
    // stands in the middle of the rest.
    const [drive, buttons] = ["drive", "buttons"].map((id) => document.getElementById(id));
    const covered = (getComputedStyle(drive).flexWrap === "wrap" ? drive : buttons).offsetHeight + 12;
    this.camera.setViewOffset(width, height, 0, Math.round(covered / 2), width, height);
    this.room = Math.max(0.35, 1 - covered / height);
    if (this.own) this.frame();
  }

  /** Puts the camera where the whole robot is in the picture. */
  frame() {
    const half = Math.tan((this.camera.fov * Math.PI) / 360);
    const distance = Math.max(ROBOT_HEIGHT / (2 * half * this.room), ROBOT_WIDTH / (2 * half * this.camera.aspect));
    const direction = new THREE.Vector3(0.72, -0.95, 0.32).normalize();
    this.controls.target.copy(this.place).setZ(this.place.z + MIDDLE);
    this.camera.position.copy(this.controls.target).addScaledVector(direction, distance + 0.3);
    this.camera.updateProjectionMatrix();
    this.own = true;
  }
}

function place(object, [x, y, z, qx, qy, qz, qw]) {
  object.position.set(x, y, z);
  object.quaternion.set(qx, qy, qz, qw);
}

/** A Segway: platform, two wheels, a bar in front of the knees; its origin is on the ground. */
function segway() {
  const vehicle = new THREE.Group();
  const add = (geometry, colour, x, y, z) => {
    const part = new THREE.Mesh(geometry, new THREE.MeshLambertMaterial({ color: colour }));
    part.position.set(x, y, z);
    part.castShadow = true;
    vehicle.add(part);
  };
  add(new THREE.BoxGeometry(0.26, 0.42, 0.09), 0x9aa4ae, 0, 0, SEGWAY.platform - 0.045);
  for (const side of [-1, 1]) add(new THREE.CylinderGeometry(SEGWAY.wheel, SEGWAY.wheel, 0.06, 24), 0x22262a, 0, (side * SEGWAY.track) / 2, SEGWAY.wheel);
  add(new THREE.CylinderGeometry(0.015, 0.015, SEGWAY.bar, 12).rotateX(Math.PI / 2), 0x9aa4ae, 0.08, 0, SEGWAY.wheel + SEGWAY.bar / 2);
  vehicle.visible = false;
  return vehicle;
}

/** What the browser draws with; empty where it does not tell. */
function rendererName() {
  const gl = document.createElement("canvas").getContext("webgl2");
  const known = gl?.getExtension("WEBGL_debug_renderer_info");
  const name = known ? gl.getParameter(known.UNMASKED_RENDERER_WEBGL) : "";
  gl?.getExtension("WEBGL_lose_context")?.loseContext();
  return String(name);
}

/** Ground whose fields of half a metre show how the robot moves over it. */
function chequered(anisotropy) {
  const canvas = Object.assign(document.createElement("canvas"), { width: 256, height: 256 });
  const paint = canvas.getContext("2d");
  paint.fillStyle = "#5a6672";
  paint.fillRect(0, 0, 256, 256);
  paint.fillStyle = "#515c67";
  paint.fillRect(0, 0, 128, 128);
  paint.fillRect(128, 128, 128, 128);
  const texture = new THREE.CanvasTexture(canvas);
  texture.wrapS = texture.wrapT = THREE.RepeatWrapping;
  texture.repeat.set(GROUND / TILE, GROUND / TILE);
  texture.anisotropy = Math.min(8, anisotropy);
  texture.colorSpace = THREE.SRGBColorSpace;
  const ground = new THREE.Mesh(new THREE.PlaneGeometry(GROUND, GROUND), new THREE.MeshLambertMaterial({ map: texture }));
  ground.receiveShadow = true;
  return ground;
}

/** The same of lines, for a processor that draws: half of the work of a picture is the texture. */
function gridded() {
  const size = GROUND / 2;
  const ground = new THREE.Mesh(new THREE.PlaneGeometry(size, size), new THREE.MeshBasicMaterial({ color: 0x39424b }));
  const points = [];
  // In short pieces: of lines that pass the camera some are not drawn.
  for (let across = -size / 2; across <= size / 2; across += TILE / 2) {
    for (let along = -size / 2; along < size / 2; along += TILE) {
      points.push(along, across, 0, along + TILE, across, 0, across, along, 0, across, along + TILE, 0);
    }
  }
  const geometry = new THREE.BufferGeometry().setAttribute("position", new THREE.Float32BufferAttribute(points, 3));
  const lines = new THREE.LineSegments(geometry, new THREE.LineBasicMaterial({ color: 0x56616c }));
  lines.position.z = 0.003;
  ground.add(lines);
  return ground;
}

async function solid(shape, mesh) {
  const [a, b, c] = shape.size;
  let geometry;
  if (shape.kind === "mesh") geometry = await mesh(shape.mesh);
  else if (shape.kind === "box") geometry = new THREE.BoxGeometry(a, b, c);
  else if (shape.kind === "sphere") geometry = new THREE.SphereGeometry(a, 24, 16);
  else geometry = new THREE.CylinderGeometry(a, a, b, 24).rotateX(Math.PI / 2);
  const [red, green, blue] = shape.colour;
  const colour = new THREE.Color().setRGB(red, green, blue, THREE.SRGBColorSpace);
  const body = new THREE.Mesh(geometry, new THREE.MeshLambertMaterial({ color: colour }));
  if (shape.kind === "mesh") body.scale.set(a, b, c);
  body.castShadow = true;
  place(body, shape.pose);
  return body;
}
