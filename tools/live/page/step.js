// A step of the running motor: chosen, measured on request, its curve over the tuner's model, and their numbers.
class StepView {
  static HEIGHT = 190;
  static BAND = { current: 10, speed: 10, load: 2 }; // percent around the end, in which it counts as settled: SETTLED of step.py

  constructor({ sizes, of_load: ofLoad }, send) {
    const before = by("step-kind").value;
    by("step-kind").replaceChildren(...Object.keys(sizes).map((name) => new Option(name)));
    if (before) { by("step-kind").value = before; }
    by("step-kind").title = ofLoad ?? "";
    const choose = () => {
      const { usual, unit, low, high } = sizes[by("step-kind").value];
      by("step-size").value = usual;
      by("step-size").title = `${low} .. ${high}`;
      by("step-unit").textContent = unit;
    };
    by("step-kind").onchange = choose;
    choose();
    by("measure-step").onclick = () => {
      const size = Number(by("step-size").value.trim().replace(",", ".") || NaN), { low, high, unit } = sizes[by("step-kind").value];
      const wrong = !(size >= low && size <= high);
      by("step-size").classList.toggle("wrong", wrong);
      if (wrong) { warn(`step: '${by("step-size").value}' is impossible: choose ${low} .. ${high} ${unit}`); return; }
      send({ measure: { step: by("step-kind").value, size } });
    };
  }

  // How it stands.
  set(answer) {
    this.answer = answer;
    by("step-result").hidden = !answer.step;
    by("step-note").textContent = answer.note;
    by("step-note").hidden = !answer.note;
    by("save-step").disabled = !answer.time_ms.length;
    by("step-limit").textContent = answer.step ? `the end, ± ${StepView.BAND[answer.step]} %` : "";
    this.numbers();
    this.draw();
  }

  numbers() {
    const table = by("step-figures"), { caption, figures, step, ripple } = this.answer, load = step === "load";
    const text = (value, factor, unit) => value === null || value === undefined ? "–" : `${Number((value * factor).toPrecision(3))} ${unit}`;
    table.replaceChildren();
    make("caption", { textContent: caption }, table);
    LoopsView.row(table, "", [...(load ? ["dip"] : ["rise time", "overshoot"]), "settled in"], "th");
    for (const [name, label] of [["measured", "measured"], ["model", "tuner's model"]]) {
      const found = figures?.[name], peak = found ? `${(Math.max(found.peak, 0) * 100).toFixed(1)} %` : "–";
      LoopsView.row(table, label, [...(load ? [] : [text(found?.rise_s, 1e3, "ms")]), peak, found && found.settled_s === null ? "not in the record" : text(found?.settled_s, 1e3, "ms")]);
    }
    if (ripple !== null) { LoopsView.row(table, "ripple before it, RMS", [...(load ? [] : [""]), `${(ripple * 100).toFixed(1)} %`, ""]); }
  }

  draw() {
    const svg = by("step-plot"), { time_ms: times, measured, model, step, caption } = this.answer, width = svg.clientWidth, height = StepView.HEIGHT;
    svg.replaceChildren();
    if (!times.length || !width) { return; }
    const left = LoopsView.LEFT + 8, right = width - LoopsView.RIGHT, top = LoopsView.TOP, bottom = height - LoopsView.BOTTOM;
    const values = [...measured, ...model].map((value) => value * 100), low = Math.min(...values), high = Math.max(...values), more = (high - low) * 0.06;
    const x = (ms) => left + (ms - times[0]) / (times.at(-1) - times[0]) * (right - left), y = (value) => bottom - (value - low + more) / (high - low + 2 * more) * (bottom - top);
    svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
    svg.setAttribute("aria-label", `${caption}: the change over the time, measured and by the model; the table has the numbers`);
    const end = step === "load" ? 0 : 100, band = StepView.BAND[step];
    const [from, to] = [end + band, end - band].map((value) => Math.max(top, Math.min(bottom, y(value))));
    LoopsView.put(svg, "rect", { class: "band", x: left, y: from, width: right - left, height: Math.max(to - from, 0) });
    for (const { v, label } of ticks(low - more, high + more)) {
      LoopsView.put(svg, "line", { class: "grid", x1: left, x2: right, y1: y(v), y2: y(v) });
      LoopsView.put(svg, "text", { x: left - 5, y: y(v) + 4, "text-anchor": "end" }, label);
    }
    for (const { v, label } of ticks(times[0], times.at(-1))) {
      LoopsView.put(svg, "line", { class: "grid", x1: x(v), x2: x(v), y1: top, y2: bottom });
      if (x(v) < right - 34) { LoopsView.put(svg, "text", { x: x(v), y: height - 6, "text-anchor": "middle" }, label); }
    }
    LoopsView.put(svg, "text", { x: right, y: height - 6, "text-anchor": "end" }, "ms");
    LoopsView.put(svg, "text", { x: left, y: top - 6 }, step === "load" ? "change of the speed, of the speed [%]" : "change, of the step [%]");
    if (y(end) > top && y(end) < bottom) { LoopsView.put(svg, "line", { class: "limit", x1: left, x2: right, y1: y(end), y2: y(end) }); }
    for (const [name, curve] of [["model", model], ["measured", measured]]) {
      LoopsView.put(svg, "path", { class: name, d: curve.map((value, n) => `${n ? "L" : "M"}${x(times[n]).toFixed(1)} ${y(value * 100).toFixed(1)}`).join("") });
    }
  }
}
