// The loops of the running motor: measured on request, their Bode plot over the tuner's model, margins and numbers. Only with a firmware that has the sine.
class LoopsView {
  static HEIGHTS = [170, 150]; // gain, phase
  static LEFT = 40; // room for the labels of an axis
  static RIGHT = 8;
  static TOP = 18; // and for what a panel is
  static BOTTOM = 20; // and for the frequencies
  static GAIN_STEP = 10; // dB from line to line; 20 where there are many
  static PHASE_STEP = 45;
  static LEAST_LABELS_PX = 34;

  constructor({ loops }, send) {
    by("loops-card").hidden = !loops;
    if (!loops) { return; }
    for (const loop of ["speed", "current"]) { by(`measure-${loop}`).onclick = () => send({ measure: loop }); }
    by("measure-cancel").onclick = () => send({ measure: "cancel" });
    this.step = new StepView(loops, send);
    this.set(loops);
  }

  static buttons() { return { speed: by("measure-speed"), current: by("measure-current"), [`step ${by("step-kind").value}`]: by("measure-step") }; }

  // Which loops and steps can be measured now; else why not, in one line. What was measured with other parameters is marked.
  show({ measurable }) {
    if (!measurable) { return; }
    const buttons = LoopsView.buttons(), shown = Object.entries(buttons).map(([name, button]) => [button, measurable.why[name]]);
    const reasons = [...new Set(shown.map(([, why]) => why).filter(Boolean))];
    by("loops-why").textContent = reasons.length ? reasons.join("; ") : "half a minute to two; the motor turns on as it does";
    for (const name of ["loop", "step"]) { this.mark(name, measurable.old.includes(name)); }
    const running = this.told.running, held = document.activeElement, cancel = by("measure-cancel");
    if (running) { cancel.disabled = false; }
    for (const [button, why] of shown) {
      if (why && running && held === button) { cancel.focus(); this.from = button; } // who works by keyboard is where the next key is meant for
      button.disabled = Boolean(why);
    }
    if (running) { return; }
    if (held === cancel && this.from) {
      if (this.from.disabled) { return; } // a disabled button loses the focus, and a frame of before the end may come after it
      this.from.focus();
    }
    cancel.disabled = true;
  }

  // A result of other parameters than those of now.
  mark(name, old) {
    if (this[name === "loop" ? "loopOld" : "stepOld"] === old) { return; }
    this[name === "loop" ? "loopOld" : "stepOld"] = old;
    this.say();
  }

  // Under way, or how it has ended.
  say() {
    const { loop, said, running, of, done, answer } = this.told, old = ": a parameter has changed since: measure again";
    by("loops-said").textContent = loop ? (running && of && done < of && !said ? `${loop} loop: ${done} of ${of}` : `${loop} loop: ${said}`) + (this.loopOld ? old : "") : "";
    by("step-said").textContent = answer.step ? `step of the ${answer.step}: ${answer.said}${this.stepOld ? old : ""}` : "";
    by("loops-said").classList.toggle("old", Boolean(this.loopOld));
    by("step-said").classList.toggle("old", Boolean(this.stepOld));
  }

  // How the measurement stands, here or for another tab.
  set(told) {
    this.told = told;
    this.say();
    this.step.set(told.answer);
    by("loops-result").hidden = !told.loop;
    by("loops-note").textContent = told.note;
    by("loops-note").hidden = !told.note;
    by("save-loop").disabled = !told.points.length;
    this.margins();
    this.numbers();
    this.draw();
  }

  static text(value, digits = 1, unit = "") { return value === null || value === undefined ? "–" : `${value.toFixed(digits)}${unit}`; }

  static row(table, head, cells, kind = "td") {
    const row = make("tr", {}, table);
    make("th", { scope: kind === "th" ? "col" : "row", textContent: head }, row);
    for (const cell of cells) { make(kind, { textContent: cell, ...(kind === "th" ? { scope: "col" } : {}) }, row); }
  }

  margins() {
    const table = by("loops-margins"), { margins, loop, speed_rpm: speed } = this.told, { text } = LoopsView;
    table.replaceChildren();
    make("caption", { textContent: `Open ${loop} loop${speed === null ? "" : ` at ${speed} rpm`}` }, table);
    LoopsView.row(table, "", ["phase margin", "crossover"], "th");
    for (const [name, label] of [["measured", "measured"], ["model", "tuner's model"]]) {
      const [phase, hz] = margins?.[name] ?? [null, null];
      LoopsView.row(table, label, [text(phase, 1, "°"), text(hz, hz < 100 ? 1 : 0, " Hz")]);
    }
    const apart = margins?.difference ?? null;
    const crossovers = apart === null ? null : (margins.measured[1] / margins.model[1] - 1) * 100;
    LoopsView.row(table, "difference", [text(apart, 1, "°") + (apart !== null && Math.abs(apart) > margins.within ? `, more than ${margins.within}°` : ""), text(crossovers, 0, " %")]);
  }

  numbers() {
    const table = by("loops-numbers").firstElementChild, { text } = LoopsView;
    table.replaceChildren();
    LoopsView.row(table, "frequency [Hz]", ["gain [dB], measured", "gain [dB], model", "phase [°], measured", "phase [°], model"], "th");
    for (const [hz, gain, phase, modelGain, modelPhase] of this.told.points) {
      LoopsView.row(table, String(Number(hz.toPrecision(4))), [text(gain), text(modelGain), text(LoopsView.lag(phase)), text(LoopsView.lag(modelPhase))]);
    }
  }

  // -360 to 0.
  static lag(degrees) { return ((degrees % 360) + 360) % 360 - 360; }

  // Both panels one above the other, and the step.
  draw() {
    if (!this.told) { return; } // a firmware without the sine
    this.step.draw();
    const svg = by("loops-plot"), { line, points, loop, speed_rpm: speed } = this.told, [gainHeight, phaseHeight] = LoopsView.HEIGHTS;
    svg.replaceChildren();
    if (!line.length || !svg.clientWidth) { return; }
    const width = svg.clientWidth, height = gainHeight + phaseHeight + LoopsView.BOTTOM, [low, high] = [line[0][0], line.at(-1)[0]];
    svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
    svg.setAttribute("aria-label", `open ${loop} loop at ${speed} rpm, gain and phase over the frequency, ${points.length} points; the table has the numbers`);
    const x = (hz) => LoopsView.LEFT + Math.log(hz / low) / Math.log(high / low) * (width - LoopsView.LEFT - LoopsView.RIGHT);
    const gains = [...line.map((row) => row[1]), ...points.map((row) => row[1])], phases = [...line.map((row) => row[2]), ...points.map((row) => row[2])].map(LoopsView.lag);
    const round = (value, step, up) => step * (up ? Math.ceil : Math.floor)(value / step), step = LoopsView.GAIN_STEP;
    const marks = (name) => this.told.margins?.[name]?.[1] ?? null;
    let last = -Infinity;
    for (let power = Math.floor(Math.log10(low)); power <= Math.log10(high); power++) {
      for (const hz of [1, 2, 5].map((n) => n * 10 ** power).filter((at) => at >= low && at <= high)) {
        for (const [top, bottom] of [[LoopsView.TOP, gainHeight], [gainHeight + LoopsView.TOP, gainHeight + phaseHeight]]) { LoopsView.put(svg, "line", { class: "grid", x1: x(hz), x2: x(hz), y1: top, y2: bottom }); }
        if (x(hz) - last < LoopsView.LEAST_LABELS_PX || x(hz) > width - 46) { continue; }
        LoopsView.put(svg, "text", { x: x(hz), y: height - 6, "text-anchor": "middle" }, String(Number(hz.toPrecision(3))));
        last = x(hz);
      }
    }
    LoopsView.put(svg, "text", { x: width - LoopsView.RIGHT, y: height - 6, "text-anchor": "end" }, "Hz");
    this.panel(svg, { x, top: LoopsView.TOP, bottom: gainHeight, low: round(Math.min(0, ...gains), step, false), high: round(Math.max(0, ...gains), step, true), step,
      limit: 0, title: "gain [dB]", line: line.map((row) => [row[0], row[1]]), points: points.map((row) => [row[0], row[1]]), stars: [] });
    this.panel(svg, { x, top: gainHeight + LoopsView.TOP, bottom: gainHeight + phaseHeight, low: Math.min(-225, round(Math.min(...phases), LoopsView.PHASE_STEP, false)),
      high: Math.min(0, Math.max(-45, round(Math.max(...phases), LoopsView.PHASE_STEP, true))), step: LoopsView.PHASE_STEP, limit: -180, title: "phase [°]",
      line: line.map((row) => [row[0], LoopsView.lag(row[2])]), points: points.map((row) => [row[0], LoopsView.lag(row[2])]),
      stars: ["model", "measured"].filter((name) => marks(name) !== null).map((name) => [marks(name), this.told.margins[name][0] - 180, name]) });
  }

  static put(svg, kind, attributes, text = "") {
    const element = document.createElementNS("http://www.w3.org/2000/svg", kind);
    for (const [name, value] of Object.entries(attributes)) { element.setAttribute(name, typeof value === "number" ? Number(value.toFixed(2)) : value); }
    element.textContent = text;
    svg.append(element);
  }

  panel(svg, { x, top, bottom, low, high, step, limit, title, line, points, stars }) {
    const y = (value) => bottom - (value - low) / (high - low) * (bottom - top), wide = (high - low) / step > 5 ? 2 * step : step;
    const path = (rows) => rows.map(([hz, value], n) => `${n && Math.abs(value - rows[n - 1][1]) < 180 ? "L" : "M"}${x(hz).toFixed(1)} ${y(value).toFixed(1)}`).join("");
    const [from, to] = [line[0][0], line.at(-1)[0]];
    for (let value = Math.ceil(low / wide) * wide; value <= high; value += wide) {
      LoopsView.put(svg, "line", { class: "grid", x1: x(from), x2: x(to), y1: y(value), y2: y(value) });
      LoopsView.put(svg, "text", { x: LoopsView.LEFT - 5, y: y(value) + 4, "text-anchor": "end" }, String(value));
    }
    LoopsView.put(svg, "line", { class: "limit", x1: x(from), x2: x(to), y1: y(limit), y2: y(limit) });
    LoopsView.put(svg, "text", { x: LoopsView.LEFT, y: top - 6 }, title);
    LoopsView.put(svg, "path", { class: "model", d: path(line) });
    LoopsView.put(svg, "path", { class: "measured", d: path(points) });
    for (const [hz, value] of points) { LoopsView.put(svg, "circle", { class: "measured", cx: x(hz), cy: y(value), r: 3 }); }
    for (const [hz, value, name] of stars) { LoopsView.put(svg, "line", { class: `margin ${name}`, x1: x(hz), x2: x(hz), y1: y(limit), y2: y(value) }); }
  }
}
