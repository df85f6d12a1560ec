// What a visitor does, as the commands of a car: degrees to the left and m/s. Keys, buttons on the screen, tilt, gamepad.

const KEYS = {
  ArrowLeft: "left", a: "left", ArrowRight: "right", d: "right", ArrowUp: "faster", w: "faster", ArrowDown: "slower", s: "slower", " ": "slower",
};
const LOCK = { there: 95, back: 170 }; // degrees a second
const GAIN = 2.6, LOSS = 0.7, BRAKE = 6; // m/s each second
const TILT = 28; // degrees for full lock
const DEAD = 0.08; // of a stick

export class Controls {
  constructor(root, { max_steering_deg: lock, min_speed: least, max_speed: most }) {
    Object.assign(this, { lock, least, most, steering: 0, speed: least, held: new Set(), touched: false, tilt: null });
    this.stop = new AbortController();
    const on = (target, kind, act) => target.addEventListener(kind, act, { signal: this.stop.signal });
    on(window, "keydown", (event) => {
      const key = KEYS[event.key.length === 1 ? event.key.toLowerCase() : event.key];
      if (!key || event.ctrlKey || event.metaKey || event.altKey || event.target.closest("select, input, textarea")) return;
      if (event.key === " " && event.target.closest("a, button")) return; // presses the button
      event.preventDefault();
      this.press(key);
    });
    on(window, "keyup", (event) => this.held.delete(KEYS[event.key.length === 1 ? event.key.toLowerCase() : event.key]));
    on(window, "blur", () => this.held.clear());
    for (const button of root.querySelectorAll("[data-hold]")) {
      const act = button.dataset.hold;
      on(button, "pointerdown", (event) => { event.preventDefault(); button.setPointerCapture(event.pointerId); this.press(act); });
      for (const kind of ["pointerup", "pointercancel", "lostpointercapture"]) on(button, kind, () => this.held.delete(act));
      on(button, "contextmenu", (event) => event.preventDefault());
    }
    on(window, "deviceorientation", ({ beta, gamma }) => {
      if (this.tilt === null || gamma === null) return;
      const angle = screen.orientation?.angle ?? 0;
      this.tilt = angle === 90 ? -beta : angle === 270 || angle === -90 ? beta : -gamma;
    });
  }

  press(act) { this.held.add(act); this.touched ||= act === "faster"; }

  // Asks for the sensor where the browser wants that; false without one.
  async useTilt() {
    if (this.tilt !== null) { this.tilt = null; return false; }
    try {
      if (DeviceOrientationEvent.requestPermission && (await DeviceOrientationEvent.requestPermission()) !== "granted") return false;
    } catch { return false; }
    this.tilt = 0;
    return true;
  }

  reset() { Object.assign(this, { steering: 0, speed: this.least, touched: false }); }

  // The commands after so many seconds more.
  read(seconds) {
    const { held, lock, least, most } = this;
    const pad = [...(navigator.getGamepads?.() ?? [])].find(Boolean);
    const stick = pad ? pad.axes[0] ?? 0 : 0, [gas, brake] = pad ? [pad.buttons[7]?.value ?? 0, pad.buttons[6]?.value ?? 0] : [0, 0];
    if (gas > DEAD) this.touched = true;
    const way = Number(held.has("left")) - Number(held.has("right"));
    let wanted = way * lock, analogue = false;
    if (Math.abs(stick) > DEAD) { wanted = -Math.sign(stick) * ((Math.abs(stick) - DEAD) / (1 - DEAD)) ** 1.4 * lock; analogue = true; }
    else if (!way && this.tilt !== null) { wanted = Math.max(-1, Math.min(1, this.tilt / TILT)) * lock; analogue = true; }
    const pace = analogue ? Infinity : Math.abs(wanted) < Math.abs(this.steering) || wanted * this.steering < 0 ? LOCK.back : LOCK.there;
    this.steering += Math.max(-pace * seconds, Math.min(pace * seconds, wanted - this.steering)) || 0;
    if (analogue) this.steering = wanted;
    if (held.has("slower") || brake > DEAD) this.speed -= BRAKE * seconds * (brake || 1);
    else if (gas > DEAD) this.speed += Math.max(-GAIN * seconds, Math.min(2 * GAIN * seconds, least + gas * (most - least) - this.speed));
    else this.speed += held.has("faster") ? GAIN * seconds : -LOSS * seconds;
    this.speed = Math.max(least, Math.min(most, this.speed));
    return [this.steering, this.speed];
  }
}
