"use strict";
const at = id => document.getElementById(id);
const scene = at("scene");
const SECONDS = 20, EVERY = 100;
let history = [], gone = 0;

// One page has control, and sends the current actions of its hand twenty times a second. Actions that it does not
// send end; 0.3 s after the last message the hand has let go. So a hidden page sends nothing.
const me = Array.from(crypto.getRandomValues(new Uint32Array(2)), x => x.toString(36)).join("");
const BEAT = 50;
let pushes = {}, buttons = {}, sliders = {}, force_limit = 0, drag = null;
let hand = {}, requests = {}, wish = "", sending = false, leads = false;
const set = (name, value) => { requests[name] = value; };
// a region's switch: its kind and number; for more than a few only numbers are shown
const REGION = /^region (.+)_(\d+)$/, FEW = 12;

async function beat() {
  if (sending || document.hidden) return;
  sending = true;
  if (leads) readSticks(); else if (wish !== "take") { hand = {}; requests = {}; }
  const draw = leads ? points.splice(0, MOST) : [];
  const body = JSON.stringify({client: me, hand, set: requests, lead: wish, draw});
  requests = {}; wish = "";
  try {
    const answer = await fetch("hear", {method: "POST", body, signal: AbortSignal.timeout(1000)});
    if (answer.ok && !leads) letGo();
    if (answer.status !== 400) leads = answer.ok;
  } catch { /* the status shows when the session has ended */ }
  sending = false;
}
setInterval(beat, BEAT);
at("take").addEventListener("click", () => { wish = "take"; });

function leave() {
  letGo();
  leads = false;
  navigator.sendBeacon("hear", JSON.stringify({client: me, lead: "leave"}));
}
document.addEventListener("visibilitychange", () => { if (document.hidden) leave(); });
addEventListener("pagehide", leave);

const handles = [];
function letGo() { handles.forEach(each => each.end()); hand = {}; }
const LET_GO = /^(let go|reset)/;
const press = name => {
  if (LET_GO.test(name)) letGo();
  if (name.startsWith("reset")) { strokes = []; points = []; }
  set(name, 1);
};

// keys push while they are pressed
const named = (group, code) => Object.keys(group).find(name => group[name] === code);
addEventListener("keydown", event => {
  if (event.repeat || event.ctrlKey || event.metaKey || event.altKey || !leads) return;
  const push = named(pushes, event.code), button = named(buttons, event.code);
  if (push) hand[push] = 1;
  if (button) press(button);
  if (push || button) event.preventDefault();
  for (const slider of Object.values(sliders)) {
    const side = slider.keys.indexOf(event.code);
    if (side >= 0) set(slider.name, side ? slider.high : slider.low);
  }
});
addEventListener("keyup", event => { delete hand[named(pushes, event.code)]; });
addEventListener("blur", () => {
  for (const name in pushes) delete hand[name];
  // keys remain active after a click into the scene
  setTimeout(() => { if (document.activeElement === scene) { scene.blur(); focus(); } });
});

// a gamepad's axes that push along x, y, z: forward, to the left and up; sticks read down and right
function readSticks() {
  const axes = Array.from(navigator.getGamepads()).find(pad => pad && pad.axes.length > 3)?.axes;
  for (const [axis, number] of Object.entries({x: 1, y: 0, z: 3})) {
    if (axes && axes[number]) hand["stick " + axis] = -axes[number]; else delete hand["stick " + axis];
  }
}

// handles are pulled and spring back; a leader device is dragged instead, by the displacement of the pointer
const named_of = axis => drag === null ? "pull " + axis + " [N]" : "drag " + axis + " [m]";
function handle(id, along) {
  const box = at(id), knob = box.querySelector(".knob");
  let live = false, bounds, first;  // where it was grasped, independent of scrolling
  const pull = event => {
    const point = [(event.clientX - bounds.left) / bounds.width, (event.clientY - bounds.top) / bounds.height]
      .map(x => Math.min(Math.max(x, 0), 1));
    first ??= point;
    for (const {side, axis} of along) {
      knob.style[side ? "top" : "left"] = 100 * point[side] + "%";
      hand[named_of(axis)] = drag === null ? (1 - 2 * point[side]) * force_limit : 2 * (first[side] - point[side]) * drag;
    }
  };
  const end = () => {
    live = false; first = undefined; knob.style.left = knob.style.top = "50%";
    for (const {axis} of along) delete hand[named_of(axis)];
  };
  // show the hand of another page
  const show = pulled => {
    for (const {side, axis} of along)
      knob.style[side ? "top" : "left"] = 50 * (1 - (pulled[named_of(axis)] ?? 0) / (drag ?? force_limit)) + "%";
  };
  handles.push({end, show});
  box.addEventListener("pointerdown", event => {
    if (!leads || !force_limit) return;
    live = true; bounds = box.getBoundingClientRect();
    box.setPointerCapture(event.pointerId); pull(event); });
  box.addEventListener("pointermove", event => { if (live) pull(event); });
  for (const type of ["pointerup", "pointercancel"]) box.addEventListener(type, end);
}
handle("pad", [{side: 1, axis: "x"}, {side: 0, axis: "y"}]);
handle("lift", [{side: 1, axis: "z"}]);

// a pen: its points are sent with the next message
const plane = at("plane"), TIDY = 1e-3, MOST = 250;
let points = [], strokes = [], drawing = false, drawn_in = null;
const NEW = 1, LIFTED = 2;
function planePoint(event) {
  const box = plane.getBoundingClientRect(), [width, height] = drawn_in.size;
  return [((event.clientX - box.left) / box.width - 0.5) * width, (0.5 - (event.clientY - box.top) / box.height) * height];
}
function put(event, kind) {
  const [x, y] = planePoint(event), last = strokes.at(-1), [u, v] = last.at(-1) ?? [Infinity, Infinity];
  if (kind === 0 && Math.hypot(x - u, y - v) < TIDY) return;
  points.push([Number(x.toFixed(5)), Number(y.toFixed(5)), kind]); last.push([x, y]);
}
plane.addEventListener("pointerdown", event => {
  if (!leads || !drawn_in) return;
  drawing = true; plane.setPointerCapture(event.pointerId);
  const anew = at("anew");
  if (anew.checked) strokes = [];
  strokes.push([]); put(event, anew.checked ? NEW : 0);
  anew.checked = false;
});
plane.addEventListener("pointermove", event => {
  if (!drawing) return;
  for (const each of event.getCoalescedEvents?.() ?? [event]) put(each, 0);
});
for (const type of ["pointerup", "pointercancel"]) plane.addEventListener(type, event => {
  if (drawing) put(event, LIFTED);
  drawing = false;
});
at("anew").addEventListener("change", () => at("anew").blur());
addEventListener("keydown", event => {
  if (event.code === "KeyN" && drawn_in && leads && !event.repeat) at("anew").checked = !at("anew").checked;
});
function showPlane(s) {
  drawn_in = s.plane;
  at("draws").hidden = !s.plane;
  if (!s.plane) return;
  const [width, height] = s.plane.size, ratio = window.devicePixelRatio || 1;
  plane.style.height = plane.clientWidth * height / width + "px";
  plane.width = plane.clientWidth * ratio; plane.height = plane.clientWidth * height / width * ratio;
  const pen = plane.getContext("2d"), style = getComputedStyle(document.body);
  const at_page = ([x, y]) => [(x / width + 0.5) * plane.width, (0.5 - y / height) * plane.height];
  pen.lineWidth = 2 * ratio; pen.lineJoin = pen.lineCap = "round"; pen.strokeStyle = style.getPropertyValue("--accent");
  for (const stroke of strokes) {
    pen.beginPath();
    for (const each of stroke) pen.lineTo(...at_page(each));
    pen.stroke();
  }
  pen.fillStyle = style.getPropertyValue("--warn");
  pen.beginPath(); pen.arc(...at_page(s.plane.tool), 5 * ratio, 0, 7); pen.fill();
  at("stream").textContent = s.plane.status + "; " + s.plane.taken + " of " + s.plane.sent + " waypoints accepted, " + mm(s.plane.left) + " of path known ahead";
}

// controls are known from the first status of the session
function build(controls) {
  ({buttons, pushes, force_limit} = controls);
  drag = controls.drag ?? null;
  if (drag !== null) {
    at("pulls-title").textContent = "Drag the leader";
    for (const [id, axes] of [["pad", "along x (up) and y (left)"], ["lift", "up or down"]])
      at(id).title = "drag to command the tool " + axes + "; release and grasp again to continue";
  }
  for (const slider of controls.sliders) sliders[slider.name] = slider;
  at("commands").replaceChildren(...Object.keys(buttons).map(name => {
    const button = document.createElement("button");
    button.textContent = name; button.dataset.name = name;
    button.addEventListener("click", () => { press(name); button.blur(); });
    return button; }));
  const switches = controls.sliders.filter(x => x.group === "switch"), ofRegion = x => REGION.test(x.name);
  const short = switches.filter(ofRegion).length > FEW;
  const turn = slider => {
    const button = document.createElement("button");
    button.dataset.name = slider.name;
    button.addEventListener("click", () => { set(slider.name, 1 - sliders[slider.name].value); button.blur(); });
    if (ofRegion(slider)) {
      const [, kind, number] = REGION.exec(slider.name);
      button.dataset.label = short ? number : number + " " + kind;
    }
    return button; };
  at("switches").replaceChildren(...switches.filter(x => !ofRegion(x)).map(turn));
  at("regions").replaceChildren(...switches.filter(ofRegion).map(turn));
  at("switches").hidden = !at("switches").children.length;
  const count = at("regions").children.length;
  at("walls").hidden = !count;
  at("walls-title").textContent = count > 1 ? "Regions, by their numbers in the scene" : "Region";
  const group = {hold: ["hold"], tune: ["keys", "tune"], pace: ["pace"]};
  for (const id in group) at(id).replaceChildren(...controls.sliders.filter(x => group[id].includes(x.group)).map(slider => {
    const label = document.createElement("label"), input = document.createElement("input");
    Object.assign(input, {type: "range", min: slider.low, max: slider.high, step: slider.step});
    input.dataset.name = slider.name;
    input.addEventListener("input", () => set(slider.name, Number(input.value)));
    input.addEventListener("change", () => input.blur());
    label.append(slider.label || slider.name, input, document.createElement("output"));
    return label; }));
}

function refresh(controls, recording) {
  for (const slider of controls.sliders) sliders[slider.name] = slider;
  for (const element of document.querySelectorAll("[data-name]")) {
    const slider = sliders[element.dataset.name];
    if (element.type === "range") {
      if (document.activeElement !== element) element.value = slider.value;
      element.nextSibling.textContent =
        slider.rigid_top && slider.value === slider.high ? "rigid" : Number(slider.value.toPrecision(3));
    } else if (slider) {
      const on = slider.value > 0.5, text = slider.name + ": " + (on ? "on" : "off");
      element.textContent = element.dataset.label ?? text;
      element.title = element.dataset.label === undefined ? "" : text;
      element.className = on ? "on" : "off";
      element.ariaPressed = on;
    } else if (element.dataset.name.startsWith("record")) {
      element.textContent = recording === null ? element.dataset.name : "save (C)";
      element.className = recording === null ? "" : "on";
    }
  }
  at("hold").hidden = !(Object.values(sliders).find(x => x.name.startsWith("hold ("))?.value > 0.5);
}
