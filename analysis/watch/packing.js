"use strict";
// The packing in three dimensions: spheres as points that a shader rounds off, contact forces as
// ribbons that face the eye. Both read from one texture, a texel a sphere, where it has moved to.
const { BufferAttribute, BufferGeometry, Color, DataTexture, DoubleSide, FloatType, Mesh,
  OrbitControls, PerspectiveCamera, Points, Scene, ShaderMaterial, Vector3, WebGLRenderer } = libraries;
const data = JSON.parse(document.getElementById("data").textContent);
const by = (id) => document.getElementById(id);
const BESIDE_LINES = 0.5; // size of spheres that leave the contacts' forces to be seen
const LINE = 0.15; // half the width of the strongest contact's line, in mean radii

function decoded(text, Kind) {
  const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
  return new Kind(bytes.buffer);
}

// The packing lies along the screen: scene x, y, z are the packing's z, x, y.
const turned = (axis) => (axis + 1) % 3;
const n = data.spheres;
const places = decoded(data.position, Uint16Array);
const position = new Float32Array(3 * n);
for (let s = 0; s < n; s++)
  for (let a = 0; a < 3; a++)
    position[3 * s + turned(a)] = data.origin[a] + places[3 * s + a] * data.step[a];

// Displacement and value of sphere s are texel s, in rows of ROW.
const ROW = 1024;
const motion = new Float32Array(4 * ROW * Math.ceil(n / ROW));
const texture = new DataTexture(motion, ROW, motion.length / ROW / 4, undefined, FloatType);
const shared = { // by spheres and contacts
  motion: { value: texture }, factor: { value: 1 }, cut: { value: 1e9 }, axis: { value: 1 },
};
const common = `
  uniform sampler2D motion; uniform float factor, cut; uniform int axis;
  vec4 motion_of(int s) { return texelFetch(motion, ivec2(s % ${ROW}, s / ${ROW}), 0); }
  bool is_cut(vec3 p) { return (axis == 0 ? p.x : axis == 1 ? p.y : p.z) > cut; }
  const vec4 NOWHERE = vec4(2.0, 2.0, 2.0, 1.0);`;

const geometry = new BufferGeometry();
geometry.setAttribute("position", new BufferAttribute(position, 3));
geometry.setAttribute("radius", new BufferAttribute(decoded(data.radius, Float32Array), 1));
const material = new ShaderMaterial({
  uniforms: { ...shared, contrast: { value: 1 }, pixels: { value: 1 }, size: { value: 1 } },
  vertexShader: `
    attribute float radius; uniform float pixels, size; varying float shown;
    ${common}
    void main() {
      vec4 moved = motion_of(gl_VertexID);
      vec4 seen = modelViewMatrix * vec4(position + factor * moved.xyz, 1.0);
      shown = moved.w;
      gl_Position = is_cut(position) ? NOWHERE : projectionMatrix * seen;
      gl_PointSize = 2.0 * size * radius * pixels / -seen.z;
    }`,
  fragmentShader: `
    uniform float contrast; varying float shown;
    void main() {
      vec2 c = 2.0 * gl_PointCoord - 1.0;
      float square = dot(c, c);
      if (square > 1.0) discard;
      vec3 normal = vec3(c.x, -c.y, sqrt(1.0 - square));
      float light = 0.45 + 0.55 * max(0.0, dot(normal, normalize(vec3(-0.3, 0.5, 0.8))));
      float v = clamp(shown * contrast, -1.0, 1.0);
      vec3 blue = vec3(0.13, 0.40, 0.67), red = vec3(0.70, 0.09, 0.17), white = vec3(0.94);
      vec3 colour = v < 0.0 ? mix(white, blue, -v) : mix(white, red, v);
      gl_FragColor = vec4(colour * light, 1.0);
    }`,
});
const scene = new Scene();
scene.background = new Color(0xffffff);
const cloud = new Points(geometry, material);
cloud.frustumCulled = false;
scene.add(cloud);

// A contact from its first sphere across to the second, or to a wall, where the second is -1: four
// corners, all of which know the whole contact. (Instances would be less data, and slow to draw.)
function ribbons() {
  const across = decoded(data.contacts.across, Int16Array), m = across.length / 3;
  const first = decoded(data.contacts.first, Int32Array);
  const second = decoded(data.contacts.second, Int32Array);
  const force = decoded(data.contacts.force, Uint8Array);
  const start = new Float32Array(12 * m), to = new Float32Array(12 * m);
  const ends = new Float32Array(8 * m), corner = new Float32Array(12 * m), index = new Uint32Array(6 * m);
  for (let v = 0; v < 4 * m; v++) {
    const c = v >> 2, k = v & 3;
    for (let a = 0; a < 3; a++) {
      start[3 * v + a] = position[3 * first[c] + a];
      to[3 * v + turned(a)] = across[3 * c + a] * data.contacts.step;
    }
    ends[2 * v] = first[c];
    ends[2 * v + 1] = second[c];
    corner[3 * v] = k >> 1; // along the contact, aside, and its force
    corner[3 * v + 1] = k & 1 ? 1 : -1;
    corner[3 * v + 2] = force[c] / 255;
  }
  for (let c = 0; c < m; c++)
    [0, 1, 2, 2, 1, 3].forEach((k, place) => { index[6 * c + place] = 4 * c + k; });
  const shape = new BufferGeometry();
  shape.setIndex(new BufferAttribute(index, 1));
  for (const [name, values, width] of [["start", start, 3], ["to", to, 3], ["ends", ends, 2], ["corner", corner, 3]])
    shape.setAttribute(name, new BufferAttribute(values, width));
  const look = new ShaderMaterial({
    uniforms: { ...shared, width: { value: LINE * data.mean_radius } },
    vertexShader: `
      attribute vec3 start, to, corner; attribute vec2 ends;
      uniform float width; varying float side, strength;
      ${common}
      vec3 shift(float s) { return s < 0.0 ? vec3(0.0) : factor * motion_of(int(s)).xyz; }
      void main() {
        vec3 a = (modelViewMatrix * vec4(start + shift(ends.x), 1.0)).xyz;
        vec3 b = (modelViewMatrix * vec4(start + to + shift(ends.y), 1.0)).xyz;
        vec3 here = mix(a, b, corner.x);
        vec3 aside = cross(normalize(b - a), normalize(here));
        side = corner.y;
        strength = corner.z;
        here += width * strength * side * normalize(aside + vec3(0.0, 1e-6, 0.0));
        gl_Position = is_cut(start) ? NOWHERE : projectionMatrix * vec4(here, 1.0);
      }`,
    fragmentShader: `
      varying float side, strength;
      void main() {
        float light = 0.6 + 0.4 * sqrt(1.0 - side * side);
        gl_FragColor = vec4(light * mix(vec3(0.80, 0.76, 0.66), vec3(0.22, 0.17, 0.10), strength), 1.0);
      }`,
    side: DoubleSide,
  });
  const mesh = new Mesh(shape, look);
  mesh.frustumCulled = false;
  return mesh;
}
// Walls as sheets that one sees through. The source wall follows the motion that was recorded of it.
const WALL = 0.25; // opacity
const wallShift = { value: 0 };
function sheet(z, follows) {
  const [x, y] = [0, 1].map((a) => [data.cell.low[a], data.cell.high[a]]);
  const corners = [[0, 0], [1, 0], [0, 1], [1, 1]].flatMap(([a, b]) => [z, x[a], y[b]]);
  const shape = new BufferGeometry();
  shape.setAttribute("position", new BufferAttribute(new Float32Array(corners), 3));
  shape.setIndex([0, 1, 2, 2, 1, 3]);
  const mesh = new Mesh(shape, new ShaderMaterial({
    uniforms: { shift: follows ? wallShift : { value: 0 } },
    vertexShader: `
      uniform float shift;
      void main() {
        vec3 p = position + vec3(${data.along === "x" ? "0.0, shift, 0.0" : data.along === "y" ? "0.0, 0.0, shift" : data.along === "torsion" ? "0.0, 0.0, 0.0" : "shift, 0.0, 0.0"});
        gl_Position = projectionMatrix * modelViewMatrix * vec4(p, 1.0);
      }`,
    fragmentShader: `void main() { gl_FragColor = vec4(0.29, 0.35, 0.41, ${WALL}); }`,
    side: DoubleSide, transparent: true, depthWrite: false,
  }));
  mesh.frustumCulled = false;
  mesh.renderOrder = 1; // over the spheres that stand behind it
  return mesh;
}
data.walls.forEach((z, k) => { if (z !== null) scene.add(sheet(z, k === 0)); });

let lines = null; // made when they are first asked for
function showForces(wanted) {
  if (wanted && !lines) scene.add((lines = ribbons()));
  if (lines) lines.visible = wanted;
  material.uniforms.size.value = wanted ? BESIDE_LINES : 1;
}

const canvas = by("view");
const renderer = new WebGLRenderer({ canvas, antialias: true, preserveDrawingBuffer: true });
const camera = new PerspectiveCamera(30, 1, 1e-3, 1e3);
const controls = new OrbitControls(camera, canvas);

const [low, high] = [data.cell.low, data.cell.high].map((p) => new Vector3(p[2], p[0], p[1]));
const middle = low.clone().add(high).multiplyScalar(0.5), size = high.clone().sub(low);
function home() {
  const half = Math.tan((camera.fov * Math.PI) / 360);
  const away = 1.2 * Math.max(size.x / 2 / half / camera.aspect, (size.y + size.z) / 2 / half) + size.z / 2;
  controls.target.copy(middle);
  camera.position.copy(middle).add(new Vector3(-0.12, 0.26, 0.96).normalize().multiplyScalar(away));
  camera.near = away / 1e3; camera.far = 10 * away;
  camera.updateProjectionMatrix();
  controls.update();
}
// What dragging and the wheel do, by keys.
const TURN = Math.PI / 36, ZOOM = 1.1; // of one press
const keys = {
  ArrowLeft: (away) => away.applyAxisAngle(camera.up, -TURN),
  ArrowRight: (away) => away.applyAxisAngle(camera.up, TURN),
  ArrowUp: (away) => away.applyAxisAngle(away.clone().cross(camera.up).normalize(), TURN),
  ArrowDown: (away) => away.applyAxisAngle(away.clone().cross(camera.up).normalize(), -TURN),
  "+": (away) => away.multiplyScalar(1 / ZOOM),
  "-": (away) => away.multiplyScalar(ZOOM),
};
function turnByKey(key) {
  const away = camera.position.clone().sub(controls.target);
  keys[key](away);
  // Not over the poles, where up and down change places.
  if (Math.abs(away.clone().normalize().dot(camera.up)) < 0.99) camera.position.copy(controls.target).add(away);
  controls.update();
}
// Rulers along three edges of the cell, drawn over the spheres: mm, from the source wall on.
const rulers = by("rulers"), pen = rulers.getContext("2d");
function onScreen(x, y, z) {
  const p = new Vector3(x, y, z).project(camera);
  return [((p.x + 1) / 2) * canvas.clientWidth, ((1 - p.y) / 2) * canvas.clientHeight, p.z];
}
function roundStep(length, most) {
  const least = length / most, ten = 10 ** Math.floor(Math.log10(least));
  return [1, 2, 5, 10].map((k) => k * ten).find((step) => step >= least);
}
function ruler(name, from, to) {
  const start = onScreen(...from), end = onScreen(...to);
  if (Math.max(start[2], end[2]) > 1) return; // behind the eye
  const along = [end[0] - start[0], end[1] - start[1]], pixels = Math.hypot(...along);
  if (pixels < 40) return;
  const aside = [-along[1] / pixels, along[0] / pixels], centre = onScreen(...middle.toArray());
  const sign = Math.sign(aside[0] * (start[0] - centre[0]) + aside[1] * (start[1] - centre[1]));
  const length = 1e3 * Math.hypot(to[0] - from[0], to[1] - from[1], to[2] - from[2]);
  const step = roundStep(length, Math.max(1, Math.min(10, pixels / 55)));
  const digits = Math.max(0, -Math.floor(Math.log10(step)));
  pen.beginPath(); pen.moveTo(start[0], start[1]); pen.lineTo(end[0], end[1]);
  for (let mm = 0; mm <= length * (1 + 1e-9); mm += step) {
    const [x, y] = onScreen(...from.map((p, a) => p + ((to[a] - p) * mm) / length));
    const out = (d) => [x + sign * d * aside[0], y + sign * d * aside[1]];
    pen.moveTo(x, y); pen.lineTo(...out(5));
    if (mm > 0 || name === "z") pen.fillText(mm.toFixed(digits), ...out(14));
  }
  pen.stroke();
  const half = [(start[0] + end[0]) / 2 + sign * 30 * aside[0], (start[1] + end[1]) / 2 + sign * 30 * aside[1]];
  pen.fillText(`${name}, mm`, ...half);
}
function drawRulers() {
  pen.setTransform(renderer.getPixelRatio(), 0, 0, renderer.getPixelRatio(), 0, 0);
  pen.clearRect(0, 0, rulers.width, rulers.height);
  pen.strokeStyle = pen.fillStyle = "#1c2530";
  pen.font = "12px system-ui, sans-serif"; pen.textAlign = "center"; pen.textBaseline = "middle";
  const front = camera.position.z > middle.z ? high.z : low.z; // the edges that are near the eye
  const below = camera.position.y > middle.y ? low.y : high.y, first = low.x;
  ruler("z", [low.x, below, front], [high.x, below, front]);
  ruler("x", [first, low.y, front], [first, high.y, front]);
  const above = low.y + high.y - below;
  ruler("y", [high.x, above, low.z], [high.x, above, high.z]);
}

// The sphere nearest to the eye among those whose disc is under a point of the screen, or -1.
function sphereUnder(x, y) {
  const m = camera.matrixWorldInverse.elements, half = Math.tan((camera.fov * Math.PI) / 360);
  const unit = canvas.clientHeight / 2 / half, radius = geometry.attributes.radius.array;
  const factor = shared.factor.value, cutAxis = shared.axis.value, cut = shared.cut.value;
  let found = -1, nearest = Infinity;
  for (let s = 0; s < n; s++) {
    if (position[3 * s + cutAxis] > cut) continue;
    const [a, b, c] = [0, 1, 2].map((k) => position[3 * s + k] + factor * motion[4 * s + k]);
    const away = -(m[2] * a + m[6] * b + m[10] * c + m[14]);
    if (away <= camera.near || away >= nearest) continue;
    const right = (unit * (m[0] * a + m[4] * b + m[8] * c + m[12])) / away + canvas.clientWidth / 2;
    const down = canvas.clientHeight / 2 - (unit * (m[1] * a + m[5] * b + m[9] * c + m[13])) / away;
    const size = (unit * material.uniforms.size.value * radius[s]) / away;
    if ((right - x) ** 2 + (down - y) ** 2 <= size ** 2) { found = s; nearest = away; }
  }
  return found;
}
function fit() {
  const width = canvas.clientWidth, height = canvas.clientHeight;
  renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
  renderer.setSize(width, height, false);
  rulers.width = width * renderer.getPixelRatio();
  rulers.height = height * renderer.getPixelRatio();
  camera.aspect = width / height;
  camera.updateProjectionMatrix();
  material.uniforms.pixels.value =
    (height * renderer.getPixelRatio()) / (2 * Math.tan((camera.fov * Math.PI) / 360));
}
