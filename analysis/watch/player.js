"use strict";
// What is shown when: a wave's recorded times, or one mode through its period; controls and plots.
const { uPlot } = libraries;
const FRAMES_A_SECOND = 30;
const PERIOD = 90; // drawn frames of a mode's period at normal speed
const moved = decoded(data.displacement, Int16Array);
const isWave = data.kind === "wave";
const pushed = isWave ? turned(Math.max(0, "xyz".indexOf(data.along))) : 0; // where the source wall moves to
// Fields that stay as they are while spheres move, 0 to 255: their name, and what 255 is.
const still = {};
if (data.pressure) still["pressure of contacts"] = [decoded(data.pressure, Uint8Array), data.pressure_ends];
if (data.slip) still["dissipated by slip"] = [decoded(data.slip, Uint8Array), data.slip_ends];
const fields = isWave ? ["displacement"] : ["displacement z", "displacement x", "displacement y", "displacement size"];
fields.push(...Object.keys(still));
for (const name of fields) by("colour").add(new Option(name, name));
by("told").textContent = [data.told, data.slip_told].filter(Boolean).join(" ");
by("lines").hidden = !data.contacts;
by("forces").checked = Boolean(data.contacts) && location.hash === "#forces";

let which = isWave ? Math.floor(data.signals.length / 2) : 0, now = 0, drawn = 0;
let playing = !matchMedia("(prefers-reduced-motion: reduce)").matches;
const count = isWave ? data.time.length : PERIOD;
by("scrub").max = isWave ? count - 1 : count;
if (isWave) by("choose").firstChild.textContent = "signal of ";
(isWave ? data.signals : data.modes).forEach((item, k) => by("which").add(new Option(item.name, k)));
by("which").value = which;
by("contrast").value = data.contrast;

function choose() { // a mode is coloured by its own direction
  if (!isWave) by("colour").value = `displacement ${data.modes[which].along}`;
}

function layOut() {
  const shape = isWave ? null : moved.subarray(3 * n * which, 3 * n * (which + 1));
  const colour = by("colour").value, [fixed, ends] = still[colour] || [];
  const part = { "displacement z": 2, "displacement x": 0, "displacement y": 1 }[colour];
  const before = Math.min(Math.floor(now), count - 1), after = Math.min(before + 1, count - 1);
  const share = now - before, phase = Math.cos((2 * Math.PI * now) / count);
  for (let s = 0; s < n; s++) {
    const at = 4 * s;
    if (isWave) {
      const u = ((1 - share) * moved[before * n + s] + share * moved[after * n + s]) / 32767;
      motion[at + pushed] = motion[at + 3] = u;
    } else {
      for (let a = 0; a < 3; a++) motion[at + turned(a)] = (phase * shape[3 * s + a]) / 32767;
      motion[at + 3] = part === undefined
        ? Math.hypot(motion[at], motion[at + 1], motion[at + 2])
        : motion[at + turned(part)];
    }
    if (fixed) motion[at + 3] = fixed[s] / 127.5 - 1;
  }
  texture.needsUpdate = true;
  const factor = 10 ** by("amplify").value;
  shared.factor.value = factor * data.visible;
  material.uniforms.contrast.value = fixed ? 1 : 10 ** by("contrast").value;
  by("factor").textContent = data.real ? `${(factor * data.visible / data.real).toPrecision(2)} x` : `${factor.toPrecision(2)} x`;
  const edges = ends ? ends
    : isWave ? [-1, 1].map((sign) => `${sign < 0 ? "-" : ""}${(data.largest_nm / 10 ** by("contrast").value).toPrecision(2)} ${data.unit}`)
    : ["-", "+"];
  by("low").textContent = edges[0]; by("high").textContent = edges[1];
  wallShift.value = isWave ? (factor * data.visible * interpolated(data.wall_displacement)) / data.largest_nm : 0;
  by("now").textContent = isWave ? `${interpolated(data.time).toFixed(1)} µs` : `${(now / count).toFixed(2)} T`;
  by("scrub").value = now;
  by("scrub").setAttribute("aria-valuetext", by("now").textContent);
  by("amplify").setAttribute("aria-valuetext", by("factor").textContent);
}
function interpolated(list) {
  const k = Math.min(Math.floor(now), list.length - 1);
  return list[k] + (now - k) * (list[Math.min(k + 1, list.length - 1)] - list[k]);
}

// The two plots; a line in the left one says where the view is.
const marker = () => (isWave ? interpolated(data.time) : data.modes[which].frequency);
function plot(where, titles, columns, points, marked, range) {
  where.setAttribute("aria-label", `plot, ${titles[0]}: ${titles[2]} against ${titles[1]}`);
  where.replaceChildren(Object.assign(document.createElement("div"), { textContent: titles[0] }));
  return new uPlot({
    width: Math.min(760, Math.max(300, innerWidth / 2 - 40), innerWidth - 28), height: 200,
    scales: { x: { time: false }, y: range ? { range } : {} }, legend: { show: false },
    axes: [{ label: titles[1] }, { label: titles[2], size: 70 }],
    series: [{}, points
      ? { paths: () => null, points: { show: true, size: 6, fill: "#2166ac" }, stroke: "#2166ac" }
      : { stroke: "#2166ac", width: 1.2 }],
    hooks: { draw: [(u) => {
      if (!marked) return;
      const x = u.valToPos(marker(), "x", true);
      u.ctx.strokeStyle = "#b2182b"; u.ctx.lineWidth = 2; u.ctx.beginPath();
      u.ctx.moveTo(x, u.bbox.top); u.ctx.lineTo(x, u.bbox.top + u.bbox.height); u.ctx.stroke();
    }] },
  }, columns, where);
}
let left = null;
function plots() {
  if (isWave) {
    const signal = data.signals[which];
    left = plot(by("left"), ["signal", "time, µs", `${data.symbol}, ${data.unit}`], [data.signal_time, signal.displacement], false, true);
    plot(by("right"), ["its spectrum", "frequency, kHz", `|F(${data.symbol})|, ${data.unit} µs`], [data.spectrum_frequency, signal.spectrum], false, false);
  } else {
    const modes = data.modes;
    left = plot(by("left"), ["share of motion along z", "frequency, kHz", "χ_z (-)"],
      [modes.map((m) => m.frequency), modes.map((m) => m.chi_z)], true, true);
    const along = `u_${modes[which].along}`;
    plot(by("right"), [`mean ${along} of layers, ${modes[which].name}`, "z, mm", `${along} over the largest (-)`],
      [data.layer_z, modes[which].layers], false, false, [-1.05, 1.05]);
  }
}

// The number of the sphere under the pointer, where it is, and what its colour stands for.
let pointer = null;
function tell() {
  const s = pointer ? sphereUnder(...pointer) : -1;
  by("under").hidden = s < 0;
  if (s < 0) return;
  const z = 1e3 * (position[3 * s] - low.x), value = motion[4 * s + 3], colour = by("colour").value;
  const share = (value + 1) / 2; // of what does not move
  const shown = colour === "pressure of contacts" ? `pressure ${(100 * share).toFixed(0)} % of ${data.pressure_ends[1]}`
    : colour === "dissipated by slip" ? `slip dissipated ${share ? (10 ** (data.slip_decades * (share - 1))).toPrecision(2) : "no more than " + 10 ** -data.slip_decades} of ${data.slip_ends[1]}`
    : isWave ? `${data.symbol} = ${(value * data.largest_nm).toPrecision(3)} ${data.unit}`
    : `${colour.replace("displacement ", "u_")} = ${value.toFixed(3)} of the largest`;
  by("under").textContent = `sphere ${s}, z = ${z.toFixed(2)} mm: ${shown}`;
  const left = Math.min(pointer[0] + 14, canvas.clientWidth - by("under").offsetWidth - 4);
  by("under").style.transform = `translate(${left}px, ${Math.max(0, pointer[1] - 34)}px)`;
}
canvas.addEventListener("pointermove", (event) => {
  pointer = event.buttons ? null : [event.offsetX, event.offsetY];
  tell();
});
canvas.addEventListener("pointerleave", () => { pointer = null; tell(); });

function draw() {
  layOut();
  renderer.render(scene, camera);
  drawRulers();
  tell();
  if (left && isWave) left.redraw(false);
  document.body.dataset.drawn = String(++drawn);
  document.body.dataset.now = now.toFixed(3);
}
let last = performance.now();
function step(time) {
  if (playing) {
    // The first time may lie before the last drawing.
    now += (Math.min(Math.max(time - last, 0), 200) / 1000) * FRAMES_A_SECOND * 10 ** by("speed").value;
    now %= by("scrub").max;
    draw();
  } else if (controls.update()) draw();
  last = time;
  requestAnimationFrame(step);
}
function sayPlaying() { by("play").textContent = playing ? "pause" : "play"; }
sayPlaying();
by("play").onclick = () => { playing = !playing; sayPlaying(); };
by("stage").addEventListener("keydown", (event) => {
  if (event.key === "Home") home();
  else if (event.key in keys) turnByKey(event.key);
  else return;
  event.preventDefault();
  draw();
});
by("scrub").oninput = () => { now = Number(by("scrub").value); draw(); };
by("which").onchange = () => { which = Number(by("which").value); choose(); plots(); draw(); };
by("forces").oninput = () => { showForces(by("forces").checked); draw(); };
by("home").onclick = () => { home(); draw(); };
for (const id of ["amplify", "contrast", "colour"]) by(id).oninput = draw;
for (const id of ["axis", "slice"]) by(id).oninput = () => {
  const axis = Number(by("axis").value), name = "xyz"[axis];
  shared.axis.value = axis;
  shared.cut.value = Number(by("slice").value) >= 1 ? 1e9
    : low[name] + Number(by("slice").value) * size[name];
  draw();
};
controls.addEventListener("change", draw);
addEventListener("resize", plots);
showForces(by("forces").checked);
choose(); plots(); // before the packing, which has the height that they leave
fit(); home(); draw();
new ResizeObserver(() => { fit(); draw(); }).observe(canvas);
requestAnimationFrame(step);
