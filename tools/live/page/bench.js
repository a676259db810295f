// What surrounds the board: load, supply, temperature, and the faults to throw in.
class BenchView {
  constructor(hello, send) {
    this.sliders = Object.entries(hello.sliders).filter(([key]) => key !== "input.pot").map(([key, slider]) => this.slider(key, slider, send));
    this.throws = this.faults(hello.throws, send);
  }

  slider(key, slider, send) {
    const row = make("label", { className: "slider" }, by("sliders"));
    make("span", { textContent: slider.label }, row);
    const input = make("input", { type: "range", min: slider.low, max: slider.high, step: slider.step, value: slider.start, name: key }, row);
    const output = make("output", {}, row), turn = gently((value) => send({ set: [key, value] }));
    const item = { key, input, busy: 0, show: (value) => {
      const shown = value * slider.shown, digits = Math.abs(slider.high * slider.shown) >= 100 ? 0 : 1;
      output.textContent = `${shown.toFixed(digits)} ${slider.unit}`;
    } };
    input.addEventListener("input", () => {
      item.busy = performance.now() + 300;
      const value = Math.min(slider.high, Math.max(slider.low, Number(input.value)));
      item.show(value);
      turn(value);
    });
    item.show(slider.start);
    return item;
  }

  faults(throws, send) {
    const buttons = {};
    let group = "", place = null;
    for (const fault of throws) {
      if (fault.group !== group) {
        make("small", { textContent: group = fault.group }, by("throws"));
        place = make("div", {}, by("throws"));
      }
      const button = make("button", { textContent: fault.label, type: "button" }, place);
      button.dataset.fault = fault.name;
      button.setAttribute("aria-pressed", "false");
      button.addEventListener("click", () => send({ fault: [fault.name, button.getAttribute("aria-pressed") !== "true"] }));
      buttons[fault.name] = button;
    }
    return buttons;
  }

  show(frame) {
    for (const item of this.sliders) {
      if (performance.now() > item.busy) {
        item.input.value = frame.settings[item.key];
        item.show(frame.settings[item.key]);
      }
    }
    for (const [name, button] of Object.entries(this.throws)) { button.setAttribute("aria-pressed", String(frame.broken.includes(name))); }
  }
}
