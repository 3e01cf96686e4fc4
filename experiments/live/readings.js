const show = (id, text, kind = "") => {
  at(id).textContent = text; at(id).className = "badge " + kind; at(id).hidden = !text; };
const mm = x => x === null ? "–" : (1e3 * x).toFixed(2) + " mm";
const size = values => Math.hypot(...values.map(x => x ?? 0));

const fixed = (x, digits) => (Number(x.toFixed(digits)) + 0).toFixed(digits);  // without "-0.0"

// a force or moment with enough digits that a small one does not read zero
function amount(x, unit) {
  const least = 1e-4, some = 0.1;
  if (Math.abs(x) < least) return "0 " + unit;
  return Math.abs(x) < some ? Number((1e3 * x).toPrecision(2)) + " m" + unit : x.toFixed(Math.abs(x) < 10 ? 2 : 1) + " " + unit;
}

// speed of the tool [m/s], largest force and mean measured force [N] over the last second of simulated time
let track = [];
const SLOWEST = 1e-6, NO_FORCE = 1e-2;
function observe(s) {
  if (track.length && s.time < track.at(-1).time) track = [];
  const measured = Object.entries(s.measured).filter(([name]) => !(name in s.angles)).map(([, force]) => force ?? 0);
  track.push({time: s.time, point: s.tool_point, measured, force: size(s.force)});
  while (track.length > 2 && s.time - track[1].time >= 1) track.shift();
  const lasted = s.time - track[0].time, moved = Math.hypot(...s.tool_point.map((x, i) => x - track[0].point[i]));
  const mean = measured.map((_, i) => track.reduce((sum, each) => sum + (each.measured[i] ?? 0), 0) / track.length);
  const force = Math.max(...track.map(each => each.force));
  return {speed: lasted > 0 ? moved / lasted : 0, measured: Math.hypot(...mean), force};
}
const motion = v => v < SLOWEST ? "at rest" : Number((1e3 * v).toPrecision(2)) + " mm/s";
function creep(seen) {
  if (!(seen.force < NO_FORCE) || seen.speed < SLOWEST) return "";
  const cause = seen.measured < NO_FORCE ? "" : ", but the sensor measures " + amount(seen.measured, "N");
  return "No force on the tool" + cause + ": it moves at " + motion(seen.speed) + ".";
}

function instruction(s, watches) {
  if (watches || !s.controls.sliders) return "";
  if (s.override !== null) return "Set the speed of the robot by the slider, or pause it.";
  if (s.plane) return "Draw in the field, and the tool follows the line.";
  if (drag !== null) return "Drag the ball in the panel to move the leader device.";
  return "Drag the ball in the panel to push the tool.";
}
let used = false;

scene.addEventListener("load", () => { if (scene.dataset.at) at("loading").hidden = true; });

function chart(id, values, color, least) {
  const canvas = at(id), width = canvas.clientWidth, height = canvas.clientHeight;
  const ratio = window.devicePixelRatio || 1;
  canvas.width = width * ratio; canvas.height = height * ratio;
  const pen = canvas.getContext("2d");
  pen.scale(ratio, ratio);
  const top = Math.max(least, ...values) * 1.1, step = width / (1000 * SECONDS / EVERY - 1);
  pen.strokeStyle = getComputedStyle(document.body).getPropertyValue(color);
  pen.lineWidth = 1.6; pen.beginPath();
  values.forEach((x, i) => pen.lineTo(width - (values.length - 1 - i) * step,
                                      height - 2 - (height - 4) * x / top));
  pen.stroke();
}

function table(s) {
  // of a monitored robot nothing else is known
  const known = s.override === null ? 5 : 2, rows = [["", "position", "force", "stiffness k", "damping d"]];
  const values = {...s.progress, ...s.deviation, ...s.angles};
  for (const [name, x] of Object.entries(values)) {
    const turns = name in s.angles, k = s.stiffness[name], d = s.damping[name];
    const value = x === null ? "–" : turns ? fixed(1e3 * x, 1) + " mrad" : fixed(1e3 * x, 1) + " mm";
    const force = s.measured[name];
    rows.push([s.labels[name] ?? name, value, force == null ? "–" : amount(force, turns ? "Nm" : "N"),
      k === undefined ? "–" : k === null ? "rigid" : Number(k.toPrecision(3)).toString(),
      d == null ? "–" : Number(d.toPrecision(3)).toString()]);
  }
  const body = at("coordinates");
  body.replaceChildren(...rows.map((cells, i) => {
    const row = document.createElement("tr");
    row.append(...cells.slice(0, known).map(text => {
      const cell = document.createElement(i ? "td" : "th"); cell.textContent = text; return cell; }));
    if (!i) ["N/m, of a rotation Nm/rad", "Ns/m, of a rotation Nms/rad"].forEach((unit, j) => { if (row.cells[3 + j]) row.cells[3 + j].title = unit; });
    return row; }));
}

function update(s) {
  // a monitored robot is not pulled
  const watched = s.override !== null;
  for (const id of ["forces", "pulls", "tunes", "hand-keys"]) at(id).hidden = watched;
  at("paces").hidden = !watched;
  // no pulling while drawing
  if (s.plane) for (const id of ["forces", "pulls", "tunes", "hand-keys", "switches"]) at(id).hidden = true;
  showPlane(s);
  if (s.scene && scene.dataset.at !== s.scene) scene.src = scene.dataset.at = s.scene;
  const watches = s.lead !== null && s.lead !== me;
  if (watches && leads) { leads = false; letGo(); }
  at("lead").hidden = !watches;
  for (const element of document.querySelectorAll(".leads")) element.inert = watches;
  document.title = s.scenario + " – live";
  at("scenario").textContent = s.scenario;
  const phases = {running: ["running", "good"], driving: ["driving", "good"], paused: ["paused", "warn"],
    stopping: ["stopping", "bad"], "no controller": ["no controller", "warn"], fault: ["fault", "bad"], saving: ["saving", "warn"]};
  show("phase", ...(phases[s.phase] ?? [s.phase]));
  show("time", s.time.toFixed(1) + " s");
  if (s.override !== null) show("factor", (100 * s.override).toFixed(0) + " % of planned speed");
  else show("factor", s.phase === "running" ? s.factor.toFixed(2) + " × real time" : "simulation stopped",
       s.slow || s.phase !== "running" ? "warn" : "");
  show("mode", s.mode === null ? "" : s.mode);
  show("limit", s.limit ?? "");
  show("recording", s.recording === null ? "" : "● recording since " + s.recording.toFixed(1) + " s", "bad");
  at("message").textContent = s.message ||
    (s.slow && s.phase === "running" ? "This machine simulates slower than real time: at " +
      s.factor.toFixed(2) + " times the speed of the clock." : s.ready ? "" :
      "The force sensor is not tared yet: let go until it is, the tool is rigid before.");
  at("message").className = s.phase === "fault" ? "fault" : "";
  const across = Object.values(s.deviation), force = size(s.force);
  const names = Object.keys(s.deviation).join(", ");
  at("deviation-title").textContent = names in s.labels || across.length > 1 ? "Deviation across" : "Distance " + names;
  at("deviation-title").title = names;
  at("deviation").textContent = across.length ? mm(size(across)) : "–";
  at("force").textContent = amount(force, "N");
  const seen = s.tool_point.length ? observe(s) : null;
  at("motion").textContent = seen ? motion(seen.speed) : "";
  used ||= leads && (Object.keys(hand).length > 0 || drawing);
  const hints = [used ? "" : instruction(s, watches), seen && s.ready && !s.plane ? creep(seen) : ""];
  at("hint").textContent = hints.filter(text => text).join(" ");
  if (s.phase === "running" || s.phase === "driving") {
    history.push([size(across), force]);
    history = history.slice(-1000 * SECONDS / EVERY);
  }
  chart("deviation-chart", history.map(x => x[0]), "--accent", 1e-3);
  chart("force-chart", history.map(x => x[1]), "--warn", 10);
  table(s);
  if (s.controls.sliders) {
    if (!Object.keys(sliders).length) build(s.controls);
    refresh(s.controls, s.recording);
    if (watches) handles.forEach(each => each.show(s.controls.hand));
  }
  at("takes").textContent = s.takes.length ? "Saved takes: " + s.takes.join(", ") : "";
}

async function poll() {
  try {
    const answer = await fetch("status", {cache: "no-store"});
    update(await answer.json());
    gone = 0;
  } catch {
    if (++gone === 5) { show("phase", "ended"); show("factor", "");
      at("message").textContent = "The session has ended."; }
  }
  setTimeout(poll, gone > 5 ? 2000 : EVERY);
}
poll();
