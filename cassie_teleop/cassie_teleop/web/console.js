// The page's link to web_console: frames in; heartbeats with the sticks, buttons and sliders out.
import { Charts } from "/web/charts.js";
import { RobotView } from "/web/robot_view.js";
import { Sticks } from "/web/sticks.js";

const BEAT = 33; // ms
const SOONEST = 12; // ms between two beats out of turn, when a stick moves
const LATE = 80; // ms between two beats, above which pictures are drawn less often
const AGAIN = 1000; // ms until that may be done once more
const FRAME = 8; // ms that a browser takes on average to begin a picture
const PERIOD = { graphics: 1000 / 30, software: 100, longest: 400 }; // ms between two pictures
const RECOVERY = 0.003; // of the way back to the shortest period, with each beat in time
const CHARTS = 6; // pictures from one drawing of the charts to the next
const SILENT = 30; // beats without a frame, after which the page says so and connects anew
const SMOOTH = 0.15; // of a new figure, in what is shown of the speed achieved

const find = (id) => document.getElementById(id);
const every = (selector) => [...document.querySelectorAll(selector)];
const put = (id, text) => find(id).textContent !== text && (find(id).textContent = text);
const figure = (value, digits, unit = "") => (value === null || value === undefined ? "–" : value.toFixed(digits) + unit);

let socket = null;
let me = null; // {page, name, own}
let status = null;
let echo = 0;
let silent = 0; // beats since the last frame
let beaten = 0; // ms
let eased = 0; // ms, when pictures were last made rarer
let hurried = 0; // ms, when the last beat out of turn was sent
let soon = 0; // timer of the next one
let described = 0;
let dragged = null;
let frame = null; // the newest
let shown = null; // the one in the picture
let pictures = 0;
let smooth = [null, null, null];

let view = null;
try {
  view = new RobotView(find("view"));
} catch (error) {
  put("empty", "this browser draws no 3D (WebGL)");
}
const charts = new Charts();
const shortest = view?.software ? PERIOD.software : PERIOD.graphics;
let period = shortest;
const sticks = new Sticks(beatSoon, press);

function connect() {
  const scheme = location.protocol === "https:" ? "wss" : "ws";
  const opened = (socket = new WebSocket(`${scheme}://${location.host}/socket`));
  silent = 0;
  opened.onmessage = (event) => opened === socket && receive(JSON.parse(event.data));
  opened.onclose = () => {
    if (opened !== socket) return;
    socket = null;
    offline();
    setTimeout(connect, 500);
  };
}

function offline() {
  echo = beaten = 0;
  me = status = null;
  document.body.classList.add("offline");
  document.body.classList.remove("mine");
  put("mode", "–");
  find("mode").className = "badge";
  put("readiness", "connecting …");
  find("readiness").className = "";
  showDriver();
}

function say(message) {
  if (socket?.readyState === WebSocket.OPEN) socket.send(JSON.stringify({ echo, ...message }));
}

function beat() {
  clearTimeout(soon);
  soon = 0;
  if (!me || !echo) return;
  const now = performance.now();
  if (beaten && now - beaten > LATE && !document.hidden) ease(now);
  else period += RECOVERY * (shortest - period);
  beaten = now;
  say({ visible: !document.hidden, ...sticks.values });
}

/** The heartbeat that drives must not wait for pictures: they become rarer. */
function ease(now) {
  if (now - eased < AGAIN) return;
  eased = now;
  period = Math.min(2 * period, PERIOD.longest);
}

/** Sends a stick that has moved at once: after an input a browser lets timers wait for its picture. */
function beatSoon() {
  const now = performance.now();
  const wait = hurried + SOONEST - now;
  if (wait > 0) {
    soon ||= setTimeout(() => ((soon = 0), beatSoon()), wait);
    return;
  }
  hurried = now;
  beat();
}

function press(button) {
  say({ press: button });
}

function receive(message) {
  if ("page" in message) {
    me = message;
    return;
  }
  if ("told" in message) return notice(message.told);
  if ("status" in message) return follow(message.status);
  silent = 0;
  echo = message.t;
  document.body.classList.remove("offline");
  if (frame && frame.episode !== message.episode && message.episode !== null) view?.restart();
  frame = message;
  view?.show(frame.poses, frame.contact, frame.segway !== null);
  charts.add(frame.t, frame, height(frame));
  smooth = smooth.map((old, i) => {
    const now = frame.achieved?.[i] ?? null;
    return old === null || now === null ? now : old + SMOOTH * (now - old);
  });
}

/** Height of the pelvis; null while it is unknown. In m. */
function height(frame) {
  return (frame.achieved && view?.height) ?? null;
}

/** Shows everything that has changed at once: the browser lays its parts together each time. */
function picture() {
  // By a timer, since a browser that waits for its next picture makes one of the page each time.
  setTimeout(() => requestAnimationFrame(picture), period - FRAME);
  view?.render();
  if (frame !== shown) showFigures((shown = frame));
  if (++pictures % CHARTS === 0) charts.draw();
}

function follow(next) {
  if (status && next.notice && next.notice !== status.notice) notice(next.notice);
  status = next;
  if (next.described !== described) {
    described = next.described;
    view?.load();
  }
  if (view) find("empty").hidden = next.described > 0;
  showMode();
  showDriver();
  showButtons();
  showSliders();
  showFaults();
}

function showFigures(frame) {
  const robot = status?.robot;
  put("factor", figure(frame.factor, 2, " ×"));
  put("missed", robot ? `${robot.missed}${robot.missed ? ` (${(100 * robot.share).toFixed(2)} %)` : ""}` : "–");
  put("latency", frame.latency === null ? "–" : figure(1000 * frame.latency, 1, " ms"));
  const age = me ? frame.ages[me.page] : null;
  put("age", age === null || age > 9 ? "–" : figure(1000 * age, 0, " ms"));
  find("age").className = age > 0.3 ? "bad" : "";
  put("battery", frame.battery === null || frame.battery < 0 ? "–" : figure(100 * frame.battery, 0, " %"));
  find("vehicle").hidden = frame.segway === null;
  put("segway", figure(frame.segway, 2));
  const columns = [frame.asked, frame.limited, [...smooth, height(frame)]];
  for (const row of every("#speeds tr[data-row]")) {
    columns.forEach((column, i) => {
      const text = figure(column?.[row.dataset.row] ?? null, 2).replace(/^-(0\.00)$/, "$1");
      if (row.cells[i + 1].textContent !== text) row.cells[i + 1].textContent = text;
    });
  }
}

function showMode() {
  const robot = status.robot;
  const mode = robot ? (robot.fallen ? "fallen" : robot.mode) : "–";
  put("mode", mode);
  find("mode").className = `badge ${mode}`;
  const waits = robot?.readiness ?? "";
  let words = robot ? (waits ? `${robot.requested} is asked for: ${waits}` : "ready") : "no word from the supervisor";
  if (robot && !waits && status.power === false) words = "the drives have no power";
  if (robot && !waits && robot.mode === robot.requested && status.power) words = `it ${{ stand: "stands", walk: "walks", segway: "rides" }[robot.mode] ?? "waits"}`;
  put("readiness", words);
  find("readiness").className = waits ? "wait" : "";
  put("move-label", robot?.mode === "segway" ? "lean" : "walk");
}

function showDriver() {
  const line = find("driver");
  const robot = status?.robot;
  const mine = me !== null && status?.driver === me.page;
  let words = "", kind = "";
  if (!status) words = "";
  else if (mine && !status.linked) [words, kind] = ["your link is lost: the robot stops and stands", "lost"];
  else if (mine && robot && robot.holder && robot.holder !== me.own) [words, kind] = [`${robot.holder} drives; asked for the lease`, ""];
  else if (mine && (!status.armed || (robot && !robot.armed))) [words, kind] = ["you drive; let go of the sticks once before they count", "mine"];
  else if (mine) [words, kind] = ["you drive", "mine"];
  else if (!status.heard) words = "view only: nobody listens to commands";
  else if (status.driver !== null) words = `view only: ${status.driver_name} drives`;
  else if (robot?.holder && robot.holder !== me?.own) words = `view only: ${robot.holder} drives`;
  else words = "view only: nobody drives";
  put("driver", words);
  line.className = kind;
  document.body.classList.toggle("mine", mine);
}

function showButtons() {
  const robot = status.robot;
  const mine = me !== null && status.driver === me.page;
  const other = status.driver !== null || (robot?.holder && robot.holder !== me?.own);
  const take = find("take");
  take.dataset.press = mine ? "leave" : "drive";
  take.textContent = mine ? "Leave" : other ? "Take over" : "Drive";
  take.disabled = !mine && !status.heard;
  take.classList.toggle("call", !mine && !other && status.heard);
  const power = find("power");
  power.disabled = !mine;
  power.classList.toggle("on", status.power === true);
  power.classList.toggle("asked", mine && status.asked.power && status.power === false);
  power.textContent = status.power ? "Power is on" : "Power on";
  for (const button of every("[data-mode]")) {
    const mode = button.dataset.mode;
    button.disabled = !mine;
    button.classList.toggle("on", robot?.mode === mode);
    button.classList.toggle("asked", mine && status.power && status.asked.mode === mode && robot?.mode !== mode);
    button.title = robot?.[mode] || "would be entered now";
  }
  find("recording").hidden = status.recording === null;
  find("record").disabled = status.driver !== null && !mine;
  find("record").textContent = status.recording ? "End recording" : "Record";
  find("record").classList.toggle("on", Boolean(status.recording));
  put("bag", status.recording ?? "");
  const orders = new Set(status.orders);
  find("simulator").hidden = !orders.size;
  for (const button of every("#simulator button")) {
    button.hidden = !orders.has(button.dataset.press);
    button.disabled = !mine || (button.dataset.press === "let_go_bar" && robot?.mode !== "segway");
  }
  for (const each of every("#sliders input, #sliders button")) each.disabled = !mine;
}

function showSliders() {
  for (const slider of every("[data-slide]")) {
    if (slider !== dragged) slider.value = status.asked[slider.dataset.slide];
    slider.nextElementSibling.textContent = Number(slider.value).toFixed(slider.dataset.slide.startsWith("com") ? 3 : 2);
  }
}

function showFaults() {
  const faults = (status.robot?.faults ?? []).map((text) => [text, "bad"]);
  const lines = [...faults, ...status.reports.map((text) => [text, ""])];
  const list = find("faults");
  const key = JSON.stringify(lines);
  if (list.dataset.key === key) return;
  list.dataset.key = key;
  list.replaceChildren(
    ...lines.map(([text, kind]) => Object.assign(document.createElement("li"), { textContent: text, className: kind })),
  );
}

let hide = 0;
function notice(text) {
  put("notice", text);
  find("notice").classList.add("shown");
  clearTimeout(hide);
  hide = setTimeout(() => find("notice").classList.remove("shown"), 4000);
}

for (const button of every("[data-press]")) {
  button.addEventListener("click", () => {
    press(button.dataset.press);
    button.blur(); // space and enter are not to press it again
  });
}
find("stop").addEventListener("pointerdown", () => press("stop"));
find("stop").addEventListener("click", () => press("stop")); // by keyboard, too
find("open-panel").addEventListener("click", () => put("open-panel", document.body.classList.toggle("panel") ? "Close" : "More"));
for (const slider of every("[data-slide]")) {
  slider.addEventListener("pointerdown", () => (dragged = slider));
  slider.addEventListener("input", () => say({ slide: slider.dataset.slide, value: Number(slider.value) }));
  slider.addEventListener("change", () => (dragged = null));
}
addEventListener("keydown", (event) => {
  if (event.repeat || event.ctrlKey || event.altKey || event.metaKey) return;
  if (event.key === "Escape" || event.code === "KeyO") press("stop");
  else if (["Digit1", "Digit2", "Digit3"].includes(event.code)) press(["stand", "walk", "segway"][event.code.at(-1) - 1]);
});
addEventListener("gamepadconnected", ({ gamepad }) =>
  notice(gamepad.mapping === "standard" ? `gamepad: ${gamepad.id}` : `${gamepad.id}: its layout is unknown, so it does not drive`),
);
addEventListener("gamepaddisconnected", ({ gamepad }) => notice(`gamepad gone: ${gamepad.id}`));
document.addEventListener("visibilitychange", beat);
addEventListener("pagehide", () => socket?.close());
setInterval(() => {
  sticks.poll();
  beat();
  if (socket && ++silent > SILENT) {
    const dead = socket;
    socket = null;
    dead.close();
    offline();
    setTimeout(connect, 500);
  }
}, BEAT);
requestAnimationFrame(picture);
connect();
