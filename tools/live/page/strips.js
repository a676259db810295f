// The rolling curves: the last ten seconds of motor time, or what a slower pace has of them.
class StripsView {
  static LEAST = { rpm: 200, A: 0.5, "mN·m": 20, V: 2 }; // the axis never shows less

  constructor(hello) {
    this.panels = hello.panels;
    this.rows = [];
    this.count = 0;
    this.first = 1;
    by("strips").replaceChildren();
    if (!window.Dygraph) { make("p", { className: "hint", textContent: "The curves need dygraphs: install Debian's libjs-dygraphs and start again." }, by("strips")); }
    let column = 1;
    this.graphs = this.panels.map((panel, n) => {
      const item = this.panel(panel, column, n === this.panels.length - 1);
      column += panel.lines.length;
      return item;
    });
    this.width = column;
    this.add(hello.strip);
  }

  panel(panel, column, last) {
    const box = make("div", { className: last ? "strip last" : "strip" }, by("strips")), head = make("div", { className: "head" }, box);
    make("h2", { textContent: `${panel.title} [${panel.unit}]` }, head);
    const values = panel.lines.map((line) => {
      const item = make("span", { textContent: `${line.name} ` }, head);
      item.style.color = `var(--${line.color})`;
      return make("em", { textContent: "" }, item);
    });
    const place = make("div", { className: "graph" }, box);
    if (!window.Dygraph) { return { values, column, panel }; }
    const labels = ["s", ...panel.lines.map((line) => line.name)];
    const series = Object.fromEntries(panel.lines.map((line) => [line.name, { strokePattern: line.dashed ? [5, 4] : null, strokeWidth: line.dashed ? 1.2 : 1.6 }]));
    const graph = new Dygraph(place, [[0, ...panel.lines.map(() => null)]], {
      labels, series, colors: panel.lines.map((line) => tint(line.color)), legend: "never", interactionModel: {}, showLabelsOnHighlight: false, highlightCircleSize: 0,
      dateWindow: [0, 10], ...look(),
      axes: { x: { drawAxis: last, axisLabelFontSize: 11, axisLabelFormatter: (t) => `${Number(t.toFixed(3))} s`, pixelsPerLabel: 80 },
              y: AXIS } });
    return { graph, values, column, panel };
  }

  add(rows) {
    const last = this.rows.at(-1)?.[0] ?? -1;
    this.rows.push(...rows.filter((row) => row[0] > last));
    const old = (this.rows.at(-1)?.[0] ?? 0) - 12;
    if (this.rows.length && this.rows[0][0] < old - 2) { this.rows.splice(0, this.rows.findIndex((row) => row[0] >= old)); }
  }

  clear() { this.rows = []; }

  // Light or dark.
  fit() { this.graphs.forEach(({ graph, panel }) => graph?.updateOptions({ colors: panel.lines.map((line) => tint(line.color)), ...look() })); }

  show(frame) {
    this.add(frame.strip);
    if (this.count++ % 2 || !this.rows.length) { return; } // ten pictures a second are enough
    const seconds = Math.max(0.05, Math.min(10, 10 * frame.pace)), to = Math.max(frame.silent ? this.rows.at(-1)[0] : frame.t, seconds); // of a silent board what came last stays
    const window_ = [to - seconds, to], shown = this.rows.filter((row) => row[0] >= window_[0] - seconds / 100);
    for (const { graph, values, column, panel } of this.graphs) {
      const lines = shown.map((row) => [row[0], ...row.slice(column, column + panel.lines.length)]);
      values.forEach((value, n) => { value.textContent = StripsView.text(lines.at(-1)?.[n + 1], panel.unit); });
      graph?.updateOptions({ file: lines, dateWindow: window_, valueRange: StripsView.range(lines, panel.unit) });
    }
  }

  static text(value, unit) { return value === undefined || value === null ? "–" : value.toFixed(unit === "rpm" ? 0 : unit === "A" ? 2 : 1); }

  static range(lines, unit) {
    let low = Infinity, high = -Infinity;
    for (const row of lines) {
      for (let n = 1; n < row.length; n++) if (row[n] !== null) { low = Math.min(low, row[n]); high = Math.max(high, row[n]); }
    }
    if (!(high >= low)) { return [0, StripsView.LEAST[unit]]; }
    const more = Math.max(0, StripsView.LEAST[unit] - (high - low)) / 2 + (high - low) * 0.06;
    return [low - more, high + more];
  }
}
