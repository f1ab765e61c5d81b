// The page of a run: reads messages by their address, from the server or out of the page itself, and draws them.
"use strict";
(() => {
const $ = (id) => document.getElementById(id);
const SVG = "http://www.w3.org/2000/svg";
const POLL = 2000, CACHED = 300e6, REST = 300; // ms between looks at a run in progress; bytes; ms until cracks are asked for
const UNKNOWN = 1e37, TORN = 2e37; // values of nodes without a colour: GLSL need not know NaN
const EYE = [-1.6, -2.6, 1.4], REACH = 12; // where a body is seen from, as in pdpost render; pixels around a click
const digits = (x, n = 4) => String(Number(Number(x).toPrecision(n))).replace("-", "\u2212");
const sleep = (ms) => new Promise((done) => setTimeout(done, ms));
const element = (tag, attributes = {}, text = "") => {
  const made = document.createElementNS(SVG, tag);
  for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
  made.textContent = text;
  return made;
};

// Messages
const blocks = new Map([...document.querySelectorAll("script[data-address]")].map((s) => [s.dataset.address, s]));
const offline = blocks.size > 0;
const cache = new Map(); // address: promise of a message, those used last at the end
async function bytesAt(address) {
  if (!offline) return (await fetch(`data/${address}`)).arrayBuffer();
  if (!blocks.has(address)) throw new Error("this is not in the file");
  const packed = Uint8Array.from(atob(blocks.get(address).textContent), (sign) => sign.charCodeAt(0));
  return new Response(new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"))).arrayBuffer();
}
async function read(address) {
  const buffer = await bytesAt(address);
  const length = new DataView(buffer).getUint32(0, true);
  const message = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, length)));
  if (message.error) throw new Error(message.error);
  let at = 4 + length;
  for (const [name, kind, count] of message.arrays) {
    message[name] = new (kind === "i4" ? Int32Array : Float32Array)(buffer, at, count);
    at += 4 * count;
  }
  message.bytes = buffer.byteLength;
  return message;
}
async function get(address) {
  const promise = cache.get(address) || read(address);
  cache.delete(address);
  cache.set(address, promise);
  try { promise.bytes = (await promise).bytes; } catch (error) { cache.delete(address); throw error; }
  let total = 0;
  for (const [name, kept] of [...cache].reverse()) { // of those on their way, which are not waited for, nothing
    total += kept.bytes || 0;
    if (total > CACHED) cache.delete(name);
  }
  return promise;
}
function complain(error) {
  $("error").textContent = error ? String(error.message || error) : "";
  $("error").hidden = !error;
}

// The picture
let run, nodes, field, cracks, picked = null, timer = null, locked = null;
let renderer, scene, camera, controls, points, lut, surface;
const VERTEX = `
attribute float value, spacing; attribute vec3 moved;
uniform float low, high, pixels, scale; uniform vec4 plane; uniform sampler2D lut; uniform vec3 unknown, torn;
varying vec3 colour;
void main() {
  float share = clamp((value - low) / (high - low), 0.0, 1.0);
  colour = value > 1.5e37 ? torn : value > 0.5e37 ? unknown : texture2D(lut, vec2((share * 255.0 + 0.5) / 256.0, 0.5)).rgb;
  gl_Position = projectionMatrix * modelViewMatrix * vec4(position + scale * moved, 1.0);
  if (dot(position, plane.xyz) < plane.w) gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
  gl_PointSize = max(1.0, SIZE * spacing * pixels);
}`;
const SQUARE = "varying vec3 colour; void main() { gl_FragColor = vec4(colour, 1.0); }";
const BALL = `varying vec3 colour; void main() {
  vec2 from = 2.0 * gl_PointCoord - 1.0; float far = dot(from, from);
  if (far > 1.0) discard;
  gl_FragColor = vec4(colour * (0.55 + 0.45 * sqrt(1.0 - far)), 1.0);
}`;
const size = () => Math.hypot(...nodes.size);

function prepare() {
  const canvas = $("canvas"), body = run.dimension === 3;
  renderer = new THREE.WebGLRenderer({ canvas, antialias: false, preserveDrawingBuffer: true });
  renderer.setClearColor(0xffffff);
  scene = new THREE.Scene();
  camera = new THREE.OrthographicCamera();
  if (body) camera.up.set(0, 0, 1);
  controls = new THREE.OrbitControls(camera, canvas);
  Object.assign(controls, { enableRotate: body, screenSpacePanning: true, keyPanSpeed: 20 });
  if (!body) { controls.mouseButtons.LEFT = THREE.MOUSE.PAN; controls.touches.ONE = THREE.TOUCH.PAN; }
  controls.listenToKeyEvents(canvas);
  controls.addEventListener("change", draw);
  lut = new THREE.DataTexture(new Uint8Array(1024), 256, 1, THREE.RGBAFormat);
  const colour = (text) => ({ value: new THREE.Color(text) });
  const material = new THREE.ShaderMaterial({
    uniforms: {
      low: { value: 0 }, high: { value: 1 }, pixels: { value: 1 }, scale: { value: 0 }, lut: { value: lut },
      plane: { value: new THREE.Vector4(0, 0, 0, -1) },
      unknown: colour(run.node_colours.unknown), torn: colour(run.node_colours.torn),
    },
    vertexShader: VERTEX.replace("SIZE", body ? "1.3" : "1.0"), fragmentShader: body ? BALL : SQUARE,
  });
  points = new THREE.Points(new THREE.BufferGeometry(), material);
  surface = new THREE.Mesh(new THREE.BufferGeometry(), new THREE.MeshBasicMaterial(
    { color: 0xd55e00, transparent: true, opacity: 0.55, side: THREE.DoubleSide, depthTest: false }));
  points.frustumCulled = surface.frustumCulled = false;
  scene.add(points, surface);
  new ResizeObserver(() => { fitCanvas(); render(); }).observe($("stage"));
}
function fitCanvas() {
  const { clientWidth: width, clientHeight: height } = $("stage");
  renderer.setPixelRatio(window.devicePixelRatio);
  renderer.setSize(width, height, false);
  Object.assign(camera, { left: -width / 2, right: width / 2, top: height / 2, bottom: -height / 2 });
  camera.updateProjectionMatrix();
}
function fit() {
  const { clientWidth: width, clientHeight: height } = $("stage"), body = run.dimension === 3;
  fitCanvas();
  const across = body ? [size(), size()] : nodes.size;
  camera.zoom = 0.95 * Math.min(width / across[0], height / across[1]);
  camera.near = -20 * size();
  camera.far = 20 * size();
  controls.target.set(0, 0, 0);
  camera.position.set(...(body ? EYE : [0, 0, 1])).setLength(size());
  camera.updateProjectionMatrix();
  controls.update();
  draw();
}
function render() {
  if (!field) return;
  points.material.uniforms.pixels.value = camera.zoom * renderer.getPixelRatio();
  renderer.render(scene, camera);
  drawOver();
  document.documentElement.dataset.drawn = "yes";
}
let asked = false;
function draw() { // once before the next picture of the browser
  if (asked) return;
  asked = true;
  requestAnimationFrame(() => { asked = false; render(); });
}
function place(x, y, z) { // on the stage, in pixels
  const at = new THREE.Vector3(x, y, z).project(camera), { clientWidth: width, clientHeight: height } = $("stage");
  return [(at.x + 1) / 2 * width, (1 - at.y) / 2 * height];
}
function position(row) {
  const scale = points.material.uniforms.scale.value, moved = points.geometry.attributes.moved;
  return [0, 1, 2].map((axis) => nodes.position[3 * row + axis] + (scale && moved ? scale * moved.array[3 * row + axis] : 0));
}
function drawOver() {
  const over = $("over"), parts = [];
  if (cracks && cracks.lines && $("crack").checked) {
    let at = 0;
    for (const [kind, count] of cracks.lines) {
      const corners = [];
      for (const end = at + count; at < end; at++) corners.push(place(...cracks.points.subarray(3 * at, 3 * at + 3)).map((x) => x.toFixed(1)).join());
      const [stroke, width] = kind === "path" ? ["#0072B2", 2.5] : ["#000", 2];
      for (const [colour, wide] of [["#fff", width + 2], [stroke, width]])
        parts.push(element("polyline", { points: corners.join(" "), fill: "none", stroke: colour, "stroke-width": wide, "data-kind": kind }));
    }
  }
  if (picked !== null) {
    const [x, y] = place(...position(picked));
    for (const colour of ["#fff", "#000"])
      parts.push(element("circle", { cx: x, cy: y, r: colour === "#fff" ? 8 : 6.5, fill: "none", stroke: colour, "stroke-width": 2 }));
  }
  const height = $("stage").clientHeight, ideal = 120 / camera.zoom, power = 10 ** Math.floor(Math.log10(ideal));
  const long = power * [5, 2, 1].find((n) => n * power <= ideal), end = 12 + long * camera.zoom; // the scale
  parts.push(element("path", { d: `M12 ${height - 18}v6H${end}v-6`, fill: "none", stroke: "#000", "stroke-width": 1.5 }));
  parts.push(element("text", { x: 16, y: height - 18, "font-size": 12 }, `${digits(long * 1e3)} mm`));
  if (run.dimension === 3) {
    const middle = [52, height - 80], axis = new THREE.Vector3();
    ["x", "y", "z"].forEach((name, number) => {
      axis.set(0, 0, 0).setComponent(number, 1).transformDirection(camera.matrixWorldInverse);
      const tip = [middle[0] + 26 * axis.x, middle[1] - 26 * axis.y];
      parts.push(element("path", { d: `M${middle}L${tip}`, stroke: "#000" }), element("text", { x: tip[0] + 3, y: tip[1], "font-size": 12 }, name));
    });
  }
  over.replaceChildren(...parts);
}
function paint() { // nodes and field into the buffers
  const geometry = points.geometry, uniforms = points.material.uniforms;
  if (geometry.userData.nodes !== nodes) {
    geometry.setAttribute("position", new THREE.BufferAttribute(nodes.position, 3));
    geometry.setAttribute("spacing", new THREE.BufferAttribute(nodes.spacing, 1));
    geometry.userData.nodes = nodes;
  }
  const values = new Float32Array(field.value.length);
  for (let row = 0; row < values.length; row++) {
    const value = field.value[row];
    values[row] = value === Infinity ? TORN : value === value ? value : UNKNOWN;
  }
  geometry.setAttribute("value", new THREE.BufferAttribute(values, 1));
  const shown = locked || field, high = shown.high > shown.low ? shown.high : shown.low + 1;
  uniforms.low.value = shown.low;
  uniforms.high.value = high;
  const rgb = run.palettes[shown.cmap], image = new ImageData(256, 1);
  for (let k = 0; k < 256; k++) image.data.set([rgb[3 * k], rgb[3 * k + 1], rgb[3 * k + 2], 255], 4 * k);
  lut.image.data.set(image.data);
  lut.needsUpdate = true;
  $("palette").getContext("2d").putImageData(image, 0, 0);
  $("low").textContent = digits(shown.low * shown.factor);
  $("high").textContent = digits(high * shown.factor);
  $("unit").textContent = shown.label + (field.ends ? ` (${field.ends})` : "");
  $("title").textContent = field.title;
  $("legend").replaceChildren(...field.legend.map((entry) => key(entry.colour, entry.words)));
  tell();
}
function key(colour, words) {
  const row = document.createElement("span"), mark = document.createElement("i");
  mark.style.background = colour;
  row.append(mark, words);
  return row;
}

// A node
function pick(event) {
  const box = $("stage").getBoundingClientRect(), x = event.clientX - box.left, y = event.clientY - box.top;
  const matrix = new THREE.Matrix4().multiplyMatrices(camera.projectionMatrix, camera.matrixWorldInverse).elements;
  const uniforms = points.material.uniforms, [a, b, c, d] = uniforms.plane.value.toArray(), body = run.dimension === 3;
  const p = nodes.position, scale = uniforms.scale.value, moved = scale ? points.geometry.attributes.moved.array : p;
  let best = null, least = Infinity;
  for (let row = 0, k = 0; row < nodes.ids.length; row++, k += 3) {
    if (a * p[k] + b * p[k + 1] + c * p[k + 2] < d) continue;
    const X = p[k] + scale * moved[k], Y = p[k + 1] + scale * moved[k + 1], Z = p[k + 2] + scale * moved[k + 2];
    const u = ((matrix[0] * X + matrix[4] * Y + matrix[8] * Z + matrix[12]) + 1) / 2 * box.width - x;
    const v = (1 - (matrix[1] * X + matrix[5] * Y + matrix[9] * Z + matrix[13])) / 2 * box.height - y;
    const far = Math.hypot(u, v), near = 0.65 * nodes.spacing[row] * camera.zoom;
    if (far > Math.max(near, REACH)) continue;
    const depth = matrix[2] * X + matrix[6] * Y + matrix[10] * Z; // of a body the foremost node under the pointer
    const rank = body && far <= near ? depth - 10 : far;
    if (rank < least) { least = rank; best = row; }
  }
  choose(best);
}
function choose(row) {
  picked = row;
  $("node").value = row === null ? "" : nodes.ids[row];
  tell();
  draw();
  if (row !== null && !offline) showHistory(`history/${nodes.ids[row]}`).catch(complain);
}
function tell() {
  const rows = [];
  if (picked !== null) {
    const where = [0, 1, 2].slice(0, run.dimension).map((axis) => digits((nodes.position[3 * picked + axis] + nodes.centre[axis]) * 1e3, 5));
    const value = field.value[picked];
    const words = value === Infinity ? "left out near the crack" : value !== value ? "unknown" : `${digits(value, 6)} ${field.unit}`;
    rows.push(["node", nodes.ids[picked]], [`${"x, y, z".slice(0, 3 * run.dimension - 2)}`, `${where.join(", ")} mm`],
      ["spacing", `${digits(nodes.spacing[picked] * 1e3)} mm`], [$("field").selectedOptions[0].text, words]);
  }
  $("picked").replaceChildren(...rows.map((cells) => {
    const line = document.createElement("tr");
    cells.forEach((text, number) => line.appendChild(document.createElement(number ? "td" : "th")).textContent = text);
    return line;
  }));
}

// Curves
function ticks(low, high, most) {
  const rough = (high - low) / most || 1, power = 10 ** Math.floor(Math.log10(rough));
  const apart = power * [1, 2, 5, 10].find((n) => n * power >= rough * 0.999), all = [];
  for (let k = Math.ceil(low / apart - 1e-9); k * apart <= high + 1e-9 * apart; k++) all.push(k * apart);
  return all;
}
function chart(spec) {
  const W = 380, H = 200, [L, R, T, B] = [58, 10, 8, 36], box = document.createElement("figure");
  box.className = "chart";
  box.style.margin = "0";
  const heading = document.createElement("h2"), legend = document.createElement("div");
  heading.textContent = spec.title;
  legend.className = "legend";
  const picture = element("svg", { viewBox: `0 0 ${W} ${H}`, role: "img", "aria-label": `${spec.title}: ${spec.y.label} over ${spec.x.label}` });
  const ends = (axis) => {
    let low = Infinity, high = -Infinity;
    for (const curve of spec.curves) for (const value of curve[axis]) if (value !== null) { low = Math.min(low, value); high = Math.max(high, value); }
    [low, high] = low > high ? [0, 1] : [low * spec[axis].factor, high * spec[axis].factor];
    return axis === "y" ? [Math.min(low, 0), Math.max(high, low < 0 ? 0 : low + 1e-300)] : [low, high > low ? high : low + 1];
  };
  const [x0, x1] = ends("x"), [y0, y1] = ends("y");
  const X = (x) => L + (x * spec.x.factor - x0) / (x1 - x0) * (W - L - R), Y = (y) => H - B - (y * spec.y.factor - y0) / (y1 - y0 || 1) * (H - T - B);
  for (const tick of ticks(y0, y1, 5)) {
    const y = Y(tick / spec.y.factor);
    picture.append(element("path", { d: `M${L} ${y}H${W - R}`, stroke: "currentColor", opacity: 0.15 }), element("text", { x: L - 5, y: y + 4, "text-anchor": "end" }, digits(tick)));
  }
  for (const tick of ticks(x0, x1, 5)) picture.append(element("text", { x: X(tick / spec.x.factor), y: H - B + 14, "text-anchor": "middle" }, digits(tick)));
  picture.append(element("text", { x: (L + W - R) / 2, y: H - 5, "text-anchor": "middle" }, spec.x.label),
    element("text", { transform: `translate(11 ${(T + H - B) / 2}) rotate(-90)`, "text-anchor": "middle" }, spec.y.label));
  spec.curves.forEach((curve, number) => {
    const colour = run.curve_colours[number % run.curve_colours.length].replace("#000000", "currentColor");
    let path = "", joined = false;
    curve.x.forEach((x, k) => {
      const known = x !== null && curve.y[k] !== null;
      if (known) path += `${joined ? "L" : "M"}${X(x).toFixed(1)} ${Y(curve.y[k]).toFixed(1)}`;
      joined = known;
    });
    picture.append(element("path", { d: path, fill: "none", stroke: colour, "stroke-width": 1.6 }));
    curve.dot = picture.appendChild(element("circle", { r: 3.5, fill: colour, visibility: "hidden" }));
    curve.text = document.createElement("span");
    const entry = key(colour, curve.name);
    entry.append(curve.text);
    legend.append(entry);
  });
  if (spec.left_out) legend.append(`${spec.left_out} more are left out`);
  box.append(heading, picture, legend);
  box.mark = (time) => spec.curves.forEach((curve) => { // the last point until a time
    let row = -1;
    while (row + 1 < curve.time.length && curve.time[row + 1] <= time * (1 + 1e-9)) row++;
    const there = row >= 0 && curve.x[row] !== null && curve.y[row] !== null;
    curve.dot.setAttribute("visibility", there ? "visible" : "hidden");
    curve.text.textContent = there ? `: ${digits(curve.y[row] * spec.y.factor)}` : "";
    if (there) { curve.dot.setAttribute("cx", X(curve.x[row])); curve.dot.setAttribute("cy", Y(curve.y[row])); }
  });
  return box;
}
function mark() {
  for (const box of document.querySelectorAll(".chart")) box.mark(run.times[Number($("frame").value)]);
}
async function showCharts() {
  $("charts").replaceChildren(...(await get("charts")).charts.map(chart));
  mark();
}
async function showHistory(address) {
  $("history").replaceChildren(...(await get(address)).charts.map(chart));
  mark();
}
async function showSummary() {
  const lines = (await get("summary")).sentences.map((sentence) => {
    const line = document.createElement("p");
    line.textContent = sentence;
    return line;
  });
  const heading = document.createElement("h2");
  heading.textContent = "Cracks";
  $("said").replaceChildren(heading, ...lines);
}

// Frames
let wanted = 0, busy = false;
async function show() { // the frame of the slider; of several that are asked for meanwhile, the last
  wanted++;
  mark();
  if (busy) return;
  busy = true;
  try {
    for (let mine = 0; mine !== wanted;) {
      mine = wanted;
      const at = Number($("frame").value), step = run.steps[at];
      $("moment").textContent = `Frame ${at + 1} of ${run.steps.length}, ${run.moments[at]}`;
      const moves = Number($("scale").value) > 0 && run.can_move && !offline;
      const [there, values, motion] = await Promise.all([get(`nodes/${run.epochs[at]}`),
        get(`field/${$("field").value}/${$("part").value}/${step}`), moves ? get(`displacement/${step}`) : null]);
      if (mine !== wanted) continue;
      const first = !nodes, id = picked === null ? null : nodes.ids[picked];
      if (there !== nodes) { nodes = there; picked = id === null ? null : nodes.ids.indexOf(id); if (picked < 0) picked = null; }
      field = values;
      cracks = null;
      surface.visible = false;
      if (motion) points.geometry.setAttribute("moved", new THREE.BufferAttribute(motion.moved, 3));
      else points.geometry.deleteAttribute("moved"); // that of another number of nodes draws nothing
      points.material.uniforms.scale.value = motion ? Number($("scale").value) : 0;
      paint();
      complain(null);
      first ? fit() : draw();
      if (run.has_cracks && $("crack").checked) showCracks(step, mine).catch(complain);
    }
  } catch (error) { complain(error); } finally { busy = false; }
}
async function showCracks(step, mine) {
  if (!offline && !cache.has(`cracks/${step}`)) await sleep(REST);
  if (mine !== wanted) return;
  const message = await get(`cracks/${step}`);
  if (mine !== wanted) return;
  cracks = message;
  if (cracks.triangles) {
    surface.geometry.setAttribute("position", new THREE.BufferAttribute(cracks.triangles, 3));
    surface.geometry.setDrawRange(0, cracks.triangles.length / 3);
    surface.visible = cracks.triangles.length > 0;
  }
  draw();
}
function about() {
  const many = nodes ? `${nodes.count} nodes, ` : "";
  $("about").textContent = `${many}${run.steps.length} frames; the run is ${run.status}`;
  $("frame").max = run.steps.length - 1;
  $("follow-label").hidden = offline || run.status !== "running";
}
async function showTextsAndCurves() { // of all frames; they may take long
  const histories = picked === null ? [() => showHistory("history/usual")] : [];
  for (const part of [showCharts, ...(run.has_cracks ? [showSummary] : []), ...histories]) {
    await part().catch((error) => offline || complain(error));
  }
}
async function follow() {
  while (!offline && run.status === "running") {
    await sleep(POLL);
    const before = run.steps.length, last = Number($("frame").value) === before - 1;
    try { run = await read("run"); } catch (error) { complain(error); continue; }
    about();
    if (run.steps.length === before && run.status === "running") continue;
    for (const address of [...cache.keys()]) if (/^(charts|summary|history)/.test(address)) cache.delete(address);
    if (last && $("follow").checked) $("frame").value = run.steps.length - 1;
    show();
    if (Number($("frame").value) === run.steps.length - 1) await showTextsAndCurves();
  }
}
function stop() {
  clearInterval(timer);
  timer = null;
  $("play").textContent = "Play";
}
function move(by) {
  const next = Number($("frame").value) + by;
  if (next < 0 || next >= run.steps.length) return stop();
  $("frame").value = next;
  show();
}
function listParts() {
  const parts = run.fields[$("field").selectedIndex].components;
  $("part").replaceChildren(...parts.map((name) => new Option(name, name)));
  $("part-label").hidden = parts.length === 1;
}
function cutBody() {
  const axis = $("axis").selectedIndex, share = Number($("cut").value), plane = [0, 0, 0, -Infinity];
  if (share > 0) { plane[axis] = 1; plane[3] = nodes.size[axis] * (share - 0.5); } else plane[3] = -1e30;
  points.material.uniforms.plane.value.set(...plane);
  draw();
}
function listen() {
  const on = (id, kind, react) => $(id).addEventListener(kind, react);
  on("field", "change", () => { locked = null; $("lock").checked = false; listParts(); show(); });
  on("part", "change", () => { locked = null; $("lock").checked = false; show(); });
  on("lock", "change", () => { locked = $("lock").checked ? field : null; paint(); draw(); });
  on("crack", "change", () => { surface.visible = false; cracks = null; show(); });
  on("frame", "input", () => { stop(); show(); });
  on("back", "click", () => move(-1));
  on("next", "click", () => move(1));
  on("play", "click", () => {
    if (timer) return stop();
    if (Number($("frame").value) === run.steps.length - 1) $("frame").value = 0;
    timer = setInterval(() => busy || move(1), 150);
    $("play").textContent = "Pause";
  });
  on("fit", "click", fit);
  on("scale", "change", show);
  on("axis", "change", cutBody);
  on("cut", "input", cutBody);
  on("node", "change", () => { const row = nodes.ids.indexOf(Number($("node").value)); choose(row < 0 ? null : row); });
  on("canvas", "keydown", (event) => {
    const by = { "+": 1.25, "=": 1.25, "-": 0.8 }[event.key];
    if (!by) return;
    camera.zoom *= by;
    camera.updateProjectionMatrix();
    draw();
  });
  let from = null;
  on("canvas", "pointerdown", (event) => { from = [event.clientX, event.clientY]; });
  on("canvas", "pointerup", (event) => {
    if (from && Math.hypot(event.clientX - from[0], event.clientY - from[1]) < 5) pick(event);
    from = null;
  });
}
async function begin() {
  run = await get("run");
  const body = run.dimension === 3;
  $("field").replaceChildren(...run.fields.map((entry) => new Option(entry.title, entry.name)));
  listParts();
  $("cut-row").hidden = !body;
  $("crack-label").hidden = !run.has_cracks;
  $("scale-label").hidden = offline || !run.can_move;
  about();
  $("frame").value = run.steps.length - 1;
  prepare();
  points.material.uniforms.plane.value.set(0, 0, 0, -1e30);
  listen();
  await show();
  about();
  follow().catch(complain);
  await showTextsAndCurves();
  document.documentElement.dataset.complete = "yes";
}
begin().catch(complain);
})();
