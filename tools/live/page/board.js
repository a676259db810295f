// The board as one sees it: buttons, potentiometer, LEDs, bridge.
class BoardView {
  static POT = { x: 332, y: 172, r: 33, from: -135, to: 135 };

  constructor(send) {
    this.send = send;
    this.turn = gently((value) => send({ set: ["input.pot", value] }));
    this.value = 0;
    this.busy = 0; // until then what the board tells of the potentiometer may be older than what the hand did
    this.fets();
    document.querySelectorAll(".push").forEach((push) => this.button(push));
    this.pot();
    by("pot-track").setAttribute("d", this.arc(1));
  }

  fets() {
    const SVG = "http://www.w3.org/2000/svg";
    for (let n = 0; n < 6; n++) { // bits as in P1OVDCON: 1L, 1H, 2L, 2H, 3L, 3H
      const fet = document.createElementNS(SVG, "g"), rect = document.createElementNS(SVG, "rect");
      const [x, y] = [186 + (n >> 1) * 46 + (n & 1 ? 0 : 0), n & 1 ? 30 : 62];
      Object.entries({ x, y, width: 34, height: 24, rx: 2 }).forEach(([name, value]) => rect.setAttribute(name, value));
      const text = document.createElementNS(SVG, "text");
      text.setAttribute("x", x + 17);
      text.setAttribute("y", y + 15);
      text.textContent = `${(n >> 1) + 1}${n & 1 ? "H" : "L"}`;
      fet.setAttribute("class", "fet");
      fet.append(rect, text);
      by("bridge").append(fet);
    }
  }

  button(push) {
    const name = push.dataset.button;
    const down = () => { push.classList.add("down"); this.send({ press: name }); };
    const up = () => { if (push.classList.contains("down")) { push.classList.remove("down"); this.send({ release: name }); } };
    push.addEventListener("pointerdown", (event) => { push.setPointerCapture(event.pointerId); down(); });
    push.addEventListener("pointerup", up);
    push.addEventListener("pointercancel", up);
    push.addEventListener("keydown", (event) => { if ((event.key === " " || event.key === "Enter") && !event.repeat) { event.preventDefault(); down(); } });
    push.addEventListener("keyup", (event) => { if (event.key === " " || event.key === "Enter") { up(); } });
    push.addEventListener("blur", up);
  }

  pot() {
    const pot = by("pot"), svg = by("board"), { x, y, from, to } = BoardView.POT;
    const drag = (event) => {
      const point = new DOMPoint(event.clientX, event.clientY).matrixTransform(svg.getScreenCTM().inverse());
      const angle = Math.atan2(point.x - x, y - point.y) * 180 / Math.PI;
      if (Math.abs(angle) > 170 && Math.abs(this.value - 0.5) > 0.3) { return; } // no jump across the gap at the bottom
      this.set((Math.min(to, Math.max(from, angle)) - from) / (to - from));
    };
    pot.addEventListener("pointerdown", (event) => { pot.setPointerCapture(event.pointerId); drag(event); });
    pot.addEventListener("pointermove", (event) => { if (pot.hasPointerCapture(event.pointerId)) { drag(event); } });
    pot.addEventListener("wheel", (event) => { event.preventDefault(); this.set(this.value - Math.sign(event.deltaY) * 0.02); }, { passive: false });
    pot.addEventListener("keydown", (event) => {
      const step = { ArrowUp: 0.01, ArrowRight: 0.01, ArrowDown: -0.01, ArrowLeft: -0.01, PageUp: 0.1, PageDown: -0.1, Home: -1, End: 1 }[event.key];
      if (step) { event.preventDefault(); this.set(this.value + step); }
    });
  }

  set(value) {
    this.busy = performance.now() + 300;
    this.draw(Math.min(1, Math.max(0, Math.round(value * 1000) / 1000)));
    this.turn(this.value);
  }

  arc(value) {
    const { x, y, r, from, to } = BoardView.POT;
    const at = (deg) => `${x + r * Math.sin(deg * Math.PI / 180)} ${y - r * Math.cos(deg * Math.PI / 180)}`;
    const end = from + (to - from) * value;
    return `M${at(from)}A${r} ${r} 0 ${end - from > 180 ? 1 : 0} 1 ${at(end)}`;
  }

  draw(value) {
    const { x, y, from, to } = BoardView.POT;
    this.value = value;
    by("pot-arc").setAttribute("d", value > 0 ? this.arc(value) : "");
    by("pot-hand").setAttribute("transform", `rotate(${from + (to - from) * value} ${x} ${y})`);
    by("pot").setAttribute("aria-valuenow", Math.round(value * 100));
  }

  show(frame) {
    if (performance.now() > this.busy) { this.draw(frame.settings["input.pot"]); }
    for (const [name, on] of Object.entries(frame.leds)) { by(`led-${name}`).classList.toggle("on", Boolean(on)); }
    document.querySelectorAll(".push").forEach((push) => push.classList.toggle("held", Boolean(frame.buttons[push.dataset.button])));
    [...by("bridge").children].forEach((fet, n) => fet.classList.toggle("on", Boolean(frame.outputs >> n & 1)));
    by("bus-text").textContent = `${frame.now.bus_v.toFixed(1)} V`;
    by("pot-text").textContent = `potentiometer ${(this.value * 100).toFixed(0)} %: ${frame.now.target_rpm.toFixed(0)} rpm · takes ${frame.now.power_w.toFixed(1)} W`;
  }
}
