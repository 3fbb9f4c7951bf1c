// What the page adds to Meshcat's viewer: light, a camera with a target, trails that grow with time, a label
// and a time bar. The drawing itself arrives as Meshcat's own messages.
"use strict";

var viewer = new MeshCat.Viewer(document.getElementById("meshcat-pane"));
const {THREE} = MeshCat;
const byId = (id) => document.getElementById(id);
const node = (...path) => viewer.scene_tree.find(["wbplan", ...path]).object;

// Light: soft from everywhere, and one lamp from above that throws the robot's shadow.
const lamp = new THREE.DirectionalLight(0xffffff, 0.62);
(function light() {
  for (const name of ["SpotLight", "PointLightNegativeX", "PointLightPositiveX"]) {
    viewer.set_property(["Lights", name], "visible", false);
  }
  viewer.set_property(["Lights", "AmbientLight", "<object>"], "intensity", 0.58);
  viewer.set_property(["Lights", "FillLight", "<object>"], "intensity", 0.16);
  lamp.castShadow = true;
  lamp.shadow.mapSize.set(2048, 2048);
  lamp.shadow.bias = -0.0004;
  lamp.shadow.radius = 4;
  viewer.set_object(["Lights", "Lamp"], lamp);
  viewer.scene.add(lamp.target);
})();

// Camera: looks from `eye` at `look_at`, both in the world, z up, whenever the scene sets a new `look_at`.
let lookedAt = null;
function aim() {
  const {eye, look_at: target} = node("camera");
  if (!target || target === lookedAt) return;
  lookedAt = target;
  const distance = Math.hypot(eye[0] - target[0], eye[1] - target[1], eye[2] - target[2]);
  viewer.camera.fov = 36;
  viewer.camera.near = distance / 100;
  viewer.camera.far = distance * 30;
  viewer.camera.position.set(eye[0], eye[2], -eye[1]);
  viewer.controls.target.set(target[0], target[2], -target[1]);
  viewer.controls.update();
  // The lamp stands to the camera's left, above; its shadow map covers what the camera was aimed at.
  const back = [(eye[0] - target[0]) / distance, (eye[1] - target[1]) / distance];
  lamp.position.set(target[0] + distance * (0.55 * back[0] + 0.6 * back[1]),
                    target[1] + distance * (0.55 * back[1] - 0.6 * back[0]), target[2] + distance * 1.5);
  lamp.target.position.set(target[0], target[1], target[2]);
  const half = distance * 0.5;
  lamp.shadow.normalBias = distance * 0.0008;
  Object.assign(lamp.shadow.camera, {left: -half, right: half, top: half, bottom: -half,
                                     near: distance * 0.2, far: distance * 4});
  lamp.shadow.camera.updateProjectionMatrix();
}

// Time of the animation, and the last index of a rising list that is not after it.
const actions = () => viewer.animator.actions;
const now = () => (actions().length ? actions()[0].time : 0);
function upTo(times, t) {
  let low = 0, high = times.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (times[middle] <= t + 1e-6) low = middle + 1; else high = middle;
  }
  return low - 1;
}

// Each trail shows where its frame was in the last seconds; more of the past would only be clutter.
const TRAIL_SECONDS = 6;
function grow(t) {
  for (const trail of node("trails").children) {
    const line = trail.children[0];
    if (!trail.times || !line || !line.geometry) continue;
    const first = Math.max(0, upTo(trail.times, t - TRAIL_SECONDS));
    line.geometry.setDrawRange(first, upTo(trail.times, t) + 1 - first);
  }
}

// Label and time bar.
let story = null;
const ICONS = {play: "M3 1l10 6-10 6z", pause: "M3 1h3v12H3zM8 1h3v12H8z"};
function show(id, hidden) { if (byId(id).hidden !== hidden) byId(id).hidden = hidden; }
function write(element, text) { if (element.textContent !== text) element.textContent = text; }

function tell(t) {
  const overlay = node("overlay");
  if (overlay.story && overlay.story !== story) begin(overlay.story);
  const [title, detail, why] = byId("label").children;
  if (!story) {
    show("label", !overlay.label);
    const [first, second, ...rest] = (overlay.label || "").split("\n");
    write(title, first);
    write(detail, second || "");
    write(why, rest.join(" "));
    return;
  }
  const i = Math.max(0, upTo(story.starts, t));
  const k = Math.max(0, upTo(story.times, t));
  write(title, story.names[i]);
  const margin = story.margins[k];
  write(detail, `${story.title}  ·  phase ${i + 1} of ${story.names.length}` +
    (Number.isFinite(margin) ? `  ·  margin ${(1000 * margin).toFixed(0)} mm` : "") +
    (story.asked[i] > -1e8 ? `, at least ${(1000 * story.asked[i]).toFixed(0)}` : ""));
  const note = (story.why || []).find(([from, until]) => from - 1e-6 <= t && t < until);
  write(why, note ? note[2] : "");
  write(byId("clock"), `${t.toFixed(2)} / ${story.duration.toFixed(1)} s`);
  byId("knob").style.left = `${100 * t / story.duration}%`;
  const marks = byId("phases").children;
  for (let j = 0; j < marks.length; j++) marks[j].classList.toggle("now", j === i);
  icon();
}

function icon() {
  const button = byId("play"), kind = viewer.animator.playing ? "pause" : "play";
  if (button.dataset.kind === kind) return;
  button.dataset.kind = kind;
  button.innerHTML = `<svg width="14" height="14" viewBox="0 0 14 14"><path d="${ICONS[kind]}"/></svg>`;
}

function begin(told) {
  story = told;
  show("label", false);
  show("bar", false);
  const ends = [...Array.from(story.starts).slice(1), story.duration];
  byId("phases").replaceChildren(...story.names.map((name, i) => {
    const mark = document.createElement("i");
    mark.style.left = `${100 * story.starts[i] / story.duration}%`;
    mark.style.width = `${100 * (ends[i] - story.starts[i]) / story.duration}%`;
    return mark;
  }));
  byId("track").title = story.names.join(" → ");
}

function seek(t) {
  viewer.animator.pause();
  viewer.animator.seek(t);
  viewer.animator.display_progress(t);
}

byId("play").onclick = () => {
  if (viewer.animator.playing) viewer.animator.pause(); else viewer.animator.play();
  icon();
};
byId("track").querySelector("input").oninput = (event) => {
  if (story) seek(Number(event.target.value) * story.duration);
};
window.addEventListener("keydown", (event) => {
  if (event.target.tagName === "INPUT" && event.target.type !== "range") return;
  if (event.key === " " && story) { event.preventDefault(); byId("play").onclick(); }
});

// Everything that depends on time follows right before a picture is drawn, so that it is never one frame late.
const render = viewer.render.bind(viewer);
viewer.render = () => {
  aim();
  const t = now();
  grow(t);
  tell(t);
  render();
};

// The two ways a scene arrives: as one packed block inside the page, or message by message from the server.
async function unpack(text) {
  if (typeof DecompressionStream === "undefined") throw new Error("this browser is too old to unpack the scene");
  const packed = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"));
  const bytes = new Uint8Array(await new Response(stream).arrayBuffer());
  const sizes = new DataView(bytes.buffer);
  for (let at = 0; at < bytes.length;) {
    const size = sizes.getUint32(at);
    viewer.handle_command_bytearray(bytes.subarray(at + 4, at + 4 + size));
    at += 4 + size;
  }
}

function playEmbedded(text) {
  unpack(text).then(() => { window.wbplanReady = true; }, (error) => {
    show("label", false);
    write(byId("label").children[0], "The scene cannot be shown");
    write(byId("label").children[1], error.message);
    throw error;
  });
}

function followServer() {
  viewer.connect(`ws://${location.host}/messages`);
  viewer.connection.onopen = () => { window.wbplanReady = true; };
  viewer.connection.onclose = () => { document.title = `${document.title} (stopped)`; };
}
