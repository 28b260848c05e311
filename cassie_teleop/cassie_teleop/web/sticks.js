// The two sticks: nipplejs by mouse and touch, keys, and a gamepad. Held to drive: letting go is stop.
import { nipplejs } from "/lib/joystick/index.js";

const KEYS = {
  KeyW: ["forward", 1], ArrowUp: ["forward", 1], KeyS: ["forward", -1], ArrowDown: ["forward", -1],
  KeyA: ["turn", 1], ArrowLeft: ["turn", 1], KeyD: ["turn", -1], ArrowRight: ["turn", -1],
  KeyQ: ["left", 1], KeyE: ["left", -1],
};
const PART_WAY = 0.5; // of the way, without Shift
const DEAD_BAND = 0.1; // of a gamepad's stick
const PAD_BUTTONS = { 0: "stand", 1: "stop", 3: "walk", 9: "drive" }; // A, B, Y, Start of the standard layout

const none = () => ({ forward: 0, left: 0, turn: 0 });

export class Sticks {
  /** Calls `changed()` when a stick moves, `press(button)` for a gamepad's buttons. */
  constructor(changed, press) {
    this.changed = changed;
    this.press = press;
    this.touch = none();
    this.held = new Set();
    this.fast = false;
    this.padDown = {};
    this.pad = none();
    this.stick("move-stick", {}, (x, y) => Object.assign(this.touch, { left: -x, forward: y }));
    this.stick("turn-stick", { lockX: true }, (x) => Object.assign(this.touch, { turn: -x }));
    addEventListener("keydown", (event) => this.key(event, true));
    addEventListener("keyup", (event) => this.key(event, false));
    addEventListener("blur", () => this.letGo());
    document.addEventListener("visibilitychange", () => this.letGo());
  }

  stick(id, options, put) {
    const stick = nipplejs.create({
      zone: document.getElementById(id), mode: "static", position: { left: "50%", top: "50%" },
      size: 130, color: "#4aa3ff", restOpacity: 0.7, dynamicPage: true, ...options,
    });
    stick.on("move", (_, data) => {
      put(data.vector.x, data.vector.y);
      this.changed();
    });
    stick.on("end", () => {
      put(0, 0);
      this.changed();
    });
  }

  key(event, down) {
    if (event.ctrlKey || event.altKey || event.metaKey) {
      // A shortcut, during which a browser may not tell of a key's release.
      if (this.held.size) this.letGo();
      return;
    }
    this.fast = event.shiftKey;
    if (!(event.code in KEYS)) return;
    event.preventDefault();
    if (event.repeat) return;
    down ? this.held.add(event.code) : this.held.delete(event.code);
    this.changed();
  }

  letGo() {
    this.touch = none();
    this.pad = none();
    this.held.clear();
    this.changed();
  }

  /** Reads the gamepad; browsers tell of it only when asked. */
  poll() {
    const pad = [...(navigator.getGamepads?.() ?? [])].find((each) => each?.connected && each.mapping === "standard");
    const band = (value) => (Math.abs(value) < DEAD_BAND ? 0 : (value - Math.sign(value) * DEAD_BAND) / (1 - DEAD_BAND));
    this.pad = pad ? { forward: band(-pad.axes[1]), left: band(-pad.axes[0]), turn: band(-pad.axes[2]) } : none();
    for (const [index, button] of Object.entries(PAD_BUTTONS)) {
      const down = pad?.buttons[index]?.pressed ?? false;
      if (down && !this.padDown[index]) this.press(button);
      this.padDown[index] = down;
    }
  }

  /** How the sticks stand: of stick, keys and gamepad whichever is farthest out. -1 .. 1 each. */
  get values() {
    const keys = none();
    for (const code of this.held) keys[KEYS[code][0]] += KEYS[code][1] * (this.fast ? 1 : PART_WAY);
    const farthest = (name) =>
      [this.touch, keys, this.pad].map((each) => each[name]).reduce((a, b) => (Math.abs(b) > Math.abs(a) ? b : a));
    const held = (value) => Math.round(1000 * Math.max(-1, Math.min(1, value))) / 1000 || 0;
    return { forward: held(farthest("forward")), left: held(farthest("left")), turn: held(farthest("turn")) };
  }
}
