// Traces and what one does with them: panels of one unit each, zoom, y ranges, cursors, spectra, numbers, a reference under them.
class TracesView {
  static COLORS = ["d", "q", "true", "estimate", "bad", "reference", "leaf", "rose"];
  static PREFIXES = ["board_drive.run.", "board_drive."]; // left out where a name is shown
  static HEIGHT = 190;
  static TALL = 1200; // a window that has room for more
  static LEAST_HEIGHT = 66; // of a panel: three labels
  static ANGLE = "°"; // it wraps: its mean is none
  static kept = null; // the reference; it stays when the connection is opened again

  constructor() {
    Object.assign(this, { graphs: [], layout: "", trace: null, curves: [], view: "time", zooms: {}, spans: {}, places: {}, ranges: new Map(), cursors: false });
    by("scope-graphs").replaceChildren();
    this.keys();
    this.tools();
  }

  // Of the view, time in ms or spectrum in Hz: the stretch that is shown, null for all of it; and all of it.
  get zoom() { return this.zooms[this.view] ?? null; }
  set zoom(stretch) { this.zooms[this.view] = stretch; }
  get span() { return this.spans[this.view]; }
  get shown() { return this.zoom ?? this.span; }

  short(name) {
    const prefix = TracesView.PREFIXES.find((start) => name.startsWith(start)) ?? "";
    return name.slice(prefix.length);
  }

  // Of all curves what they are in time, and the points that the view shows. The reference has those whose variable is in the trace, too.
  read() {
    const own = (trace, kept) => trace.names.map((name, n) => ({ name, kept, unit: trace.units[n], color: TracesView.COLORS[this.trace.names.indexOf(name) % 8],
      time: trace.rows.filter((row) => row[n + 1] !== null).map((row) => [row[0] * 1000, row[n + 1]]) })).filter((curve) => curve.color);
    const [from, to] = this.zooms.time ?? this.spans.time;
    this.curves = [...own(this.trace, false), ...(TracesView.kept ? own(TracesView.kept, true) : [])];
    for (const curve of this.curves) {
      curve.seconds = TracesView.between(curve.time, from, to).map(([x, y]) => [x / 1000, y]);
      curve.points = this.view === "time" ? curve.time : measure.spectrum(curve.seconds);
    }
  }

  static between(points, from, to) { return points.filter(([x]) => x >= from - 1e-9 && x <= to + 1e-9); }

  draw(trace) {
    this.trace = trace;
    this.stretch("time", [trace.rows[0][0] * 1000, trace.rows.at(-1)[0] * 1000]);
    this.refresh();
  }

  // Another rate, position or length: what was zoomed means nothing.
  stretch(view, whole) {
    const old = this.spans[view];
    if (!old || Math.abs(whole[1] - whole[0] - old[1] + old[0]) > 1e-6) { this.zooms[view] = this.places[view] = null; }
    this.spans[view] = whole;
  }

  refresh() {
    if (!this.trace) { return; }
    this.read();
    if (this.view !== "time") { this.stretch(this.view, [0, Math.max(1e-3, ...this.curves.map((curve) => curve.points.at(-1)?.[0] ?? 0))]); }
    const layout = [this.view, this.trace.names, this.trace.units].join();
    if (layout !== this.layout) {
      this.layout = layout;
      this.graphs.forEach(({ graph }) => graph?.destroy());
      by("scope-graphs").replaceChildren();
      const units = [...new Set(this.trace.units)];
      this.graphs = units.map((unit, n) => this.panel(unit, n === units.length - 1, units.length));
      this.axes(units);
    }
    this.update((n) => ({ file: this.file(this.graphs[n].members), dateWindow: this.shown, valueRange: this.range(this.graphs[n].unit) }));
    this.tell();
  }

  // Rows of a panel: a gap where a curve has no point.
  file(members) {
    const rows = new Map();
    members.forEach((member, n) => this.curves[member].points.forEach(([x, y]) => {
      if (!rows.has(x)) { rows.set(x, [x, ...members.map(() => null)]); }
      rows.get(x)[n + 1] = y;
    }));
    return rows.size ? [...rows.values()].sort((a, b) => a[0] - b[0]) : [[0, ...members.map(() => null)]];
  }

  // What somebody has set by hand, or what is shown and a little more.
  range(unit) {
    const [from, to] = this.shown, hand = this.ranges.get(this.view + unit);
    if (hand) { return hand; }
    const values = this.curves.filter((curve) => curve.unit === unit).flatMap((curve) => TracesView.between(curve.points, from, to).map((point) => point[1]));
    const low = this.view === "time" ? Math.min(...values) : 0, high = Math.max(...values), more = high > low ? (high - low) * 0.06 : Math.abs(low) * 0.1 || 1;
    return values.length ? [this.view === "time" ? low - more : 0, high + more] : [0, 1];
  }

  // All panels at once; none of them then takes it for somebody's zoom.
  update(options) {
    this.updating = true;
    this.graphs.forEach(({ graph }, n) => graph?.updateOptions(options(n)));
    this.updating = false;
  }

  // One panel shows another stretch: the others follow, and traces to come stay there.
  show([from, to]) {
    const [first, last] = this.span;
    this.zoom = from <= first && to >= last ? null : [from, to];
    this.refresh();
  }

  // Somebody has dragged: along the time for all panels, upwards for this one.
  followed(graph, unit) {
    if (this.updating || !this.span) { return; }
    const differs = (one, other) => Math.abs(one[0] - other[0]) > 1e-9 || Math.abs(one[1] - other[1]) > 1e-9;
    if (differs(graph.yAxisRange(), this.range(unit))) { this.scale(unit, graph.yAxisRange()); }
    if (differs(graph.xAxisRange(), this.shown)) { this.show(graph.xAxisRange()); }
  }

  // + and - zoom around the middle, the arrows move, 0 shows all.
  keys() {
    by("scope-graphs").onkeydown = (event) => {
      if (!this.span || event.ctrlKey || event.altKey || event.metaKey) { return; }
      const [from, to] = this.shown, span = to - from, [first, last] = this.span;
      const [factor, shift] = { "+": [0.5, 0], "=": [0.5, 0], "-": [2, 0], ArrowLeft: [1, -0.25], ArrowRight: [1, 0.25], 0: [1e9, 0] }[event.key] ?? [];
      if (!factor) { return; }
      event.preventDefault();
      const wide = Math.min(span * factor, last - first), start = (from + to) / 2 + shift * span - wide / 2;
      const begin = Math.max(first, Math.min(last - wide, start));
      this.show([begin, begin + wide]);
    };
  }

  // All panels together.
  static room() { return TracesView.HEIGHT * (window.innerWidth < 1800 ? 1 : window.innerHeight < TracesView.TALL ? 2 : 3); }

  // The window is another one.
  resized() {
    if (this.room === TracesView.room()) { return; }
    this.layout = "";
    this.refresh();
  }

  // Light or dark.
  fit() {
    this.update((n) => ({ colors: this.graphs[n].members.map((m) => tint(this.curves[m].color)), ...look() }));
  }

  panel(unit, last, count) {
    const members = this.trace.units.flatMap((other, n) => other === unit ? [n] : []), box = make("div", { className: "strip" }, by("scope-graphs"));
    const head = make("div", { className: "head" }, box), place = make("div", { className: "graph" }, box);
    this.room = TracesView.room();
    place.style.height = `${Math.max(TracesView.LEAST_HEIGHT, Math.round(this.room / count)) + (last ? 18 : 0)}px`;
    const legend = make("div", { className: "legend" }, head);
    if (!window.Dygraph) { return { members, unit }; }
    const graph = new Dygraph(place, [[0, ...members.map(() => 0)]], {
      labels: ["x", ...members.map((n) => this.short(this.trace.names[n]))], colors: members.map((n) => tint(TracesView.COLORS[n % 8])), strokeWidth: 1.5, legend: "always", labelsDiv: legend,
      highlightCircleSize: 2, connectSeparatedPoints: true, legendFormatter: (data) => this.legend(data, unit), ...look(), xRangePad: 0,
      drawCallback: (g, first) => { if (!first) { this.followed(g, unit); } }, clickCallback: (event) => this.put(graph.toDataXCoord(graph.eventToDomCoords(event)[0])),
      interactionModel: { ...Dygraph.defaultInteractionModel, dblclick: () => { this.ranges.delete(this.view + unit); this.show(this.span); this.limits(); } },
      underlayCallback: (canvas, area, g) => this.marks(canvas, area, g, unit),
      axes: { x: { drawAxis: last, axisLabelFontSize: 11, axisLabelFormatter: (x) => this.place(x), pixelsPerLabel: 80 }, y: AXIS } });
    return { graph, members, unit };
  }

  // A place on the x axis with its unit.
  place(x, digits = 4) {
    if (this.view === "time") { return `${Number(x.toFixed(digits))} ms`; }
    return Math.abs(x) < 1000 ? `${Number(x.toFixed(1))} Hz` : `${Number((x / 1000).toFixed(4))} kHz`;
  }

  legend(data, unit) {
    const text = (value) => value.replace(/[&<>"]/g, (c) => ({ "&": "&amp;", "<": "&lt;", ">": "&gt;", '"': "&quot;" })[c]);
    const rows = data.series.map((one) => `<span style="color:${one.color}">${text(one.label)} <em>${one.y === undefined ? "" : Number(one.y.toPrecision(5))}</em> ${text(unit)}</span>`);
    return rows.join("") + (data.x === undefined ? "" : `<small>at ${this.place(data.x, 3)}</small>`);
  }

  // Under the curves: the reference, wide and pale; the trigger's moment, and its level where its variable is drawn; the cursors.
  marks(canvas, area, graph, unit) {
    if (!this.trace) { return; }
    const line = (points, color, dash, wide = 1) => {
      canvas.strokeStyle = tint(color);
      canvas.lineWidth = wide;
      canvas.globalAlpha = wide > 1 ? 0.4 : 1;
      canvas.setLineDash(dash);
      canvas.beginPath();
      points.forEach(([x, y], n) => canvas[n ? "lineTo" : "moveTo"](x, y));
      canvas.stroke();
    };
    const upright = (x, color, dash) => line([[x, area.y], [x, area.y + area.h]], color, dash), pixel = (x) => Math.round(graph.toDomXCoord(x)) + 0.5;
    canvas.save();
    canvas.beginPath();
    canvas.rect(area.x, area.y, area.w, area.h);
    canvas.clip();
    for (const curve of this.curves.filter((one) => one.kept && one.unit === unit)) { line(curve.points.map(([x, y]) => graph.toDomCoords(x, y)), curve.color, [], 3); }
    if (this.view === "time" && this.trace.triggered) {
      upright(pixel(0), "soft", [3, 4]);
      const level = Math.round(graph.toDomYCoord(this.setup?.level ?? 0)) + 0.5, at = this.trace.names.indexOf(this.setup?.trigger);
      if (at >= 0 && this.trace.units[at] === unit) { line([[area.x, level], [area.x + area.w, level]], "soft", [3, 4]); }
    }
    canvas.globalAlpha = 1;
    canvas.fillStyle = tint("ink");
    canvas.font = "11px sans-serif";
    this.cut.forEach((x, n) => { upright(pixel(x), "ink", []); canvas.fillText("AB"[n], pixel(x) + 3, area.y + 10); });
    canvas.restore();
  }

  // ---- y axes by hand ------------------------------------------------------------------------------------------------------
  axes(units) {
    const before = by("scope-axis").selectedOptions[0]?.value;
    by("scope-axis").replaceChildren(...units.map((unit) => new Option(unit || "no unit", unit)));
    if (units.includes(before)) { by("scope-axis").value = before; }
    this.limits();
  }

  // What is set of the chosen axis; nothing is automatic.
  limits() {
    const hand = this.ranges.get(this.view + by("scope-axis").value);
    [by("scope-low"), by("scope-high")].forEach((input, n) => { input.value = hand ? Number(hand[n].toPrecision(4)) : ""; input.classList.remove("wrong"); });
  }

  scale(unit, range) {
    this.ranges.set(this.view + unit, range);
    by("scope-axis").value = unit;
    this.limits();
  }

  // Both ends, or none: a scale by hand; what is wrong is said.
  typed() {
    const inputs = [by("scope-low"), by("scope-high")], texts = inputs.map((input) => input.value.trim()), unit = by("scope-axis").value;
    const no = texts.filter((text) => text && !Number.isFinite(Number(text))), [low, high] = texts.map(Number);
    inputs.forEach((input, n) => input.classList.toggle("wrong", no.includes(texts[n]) || (!no.length && texts.every(Boolean) && low >= high)));
    if (no.length) { warn(`y axis: '${no[0]}' is no number: type one such as -1.5, or clear both ends`); }
    else if (texts.every(Boolean) && low >= high) { warn(`y axis: ${low} .. ${high} is impossible: the lower end must be less than the upper one`); }
    else if (texts.every(Boolean) || !texts.some(Boolean)) {
      if (texts[0]) { this.ranges.set(this.view + unit, [low, high]); } else { this.ranges.delete(this.view + unit); }
      this.refresh();
    }
  }

  // ---- cursors -------------------------------------------------------------------------------------------------------------
  // Where A and B are; none while they are off.
  get cut() {
    if (!this.cursors || !this.span) { return []; }
    const [from, to] = this.shown;
    return this.places[this.view] ??= [from + (to - from) / 3, to - (to - from) / 3].map((x) => this.nearest(x));
  }

  get grid() { return this.curves.find((curve) => !curve.kept && curve.points.length)?.points.map(([x]) => x) ?? [0]; }

  nearest(x, grid = this.grid) { return grid.reduce((best, other) => Math.abs(other - x) < Math.abs(best - x) ? other : best); }

  move(n, x) {
    this.cut[n] = this.nearest(x);
    this.refresh();
  }

  // A click takes the nearer one there.
  put(x) {
    const [a, b] = this.cut;
    if (b !== undefined) { this.move(Math.abs(x - a) <= Math.abs(x - b) ? 0 : 1, x); }
  }

  // ---- numbers -------------------------------------------------------------------------------------------------------------
  tell() {
    const [a, b] = this.cut, grid = this.grid, on = b !== undefined;
    by("scope-places").hidden = !on;
    if (on) {
      [a, b].forEach((x, n) => {
        const slider = by(`cursor-${"ab"[n]}`), at = grid.indexOf(this.nearest(x, grid));
        Object.assign(slider, { min: 0, max: grid.length - 1, value: at });
        slider.setAttribute("aria-valuetext", this.place(x));
      });
      const apart = this.view === "time" && a !== b ? ` = 1 / ${Number((1000 / Math.abs(b - a)).toPrecision(5))} Hz` : "";
      by("cursor-text").textContent = `A ${this.place(a)}   B ${this.place(b)}   B − A ${this.place(b - a)}${apart}`;
    }
    this.table(a, b, on);
  }

  // Mean, RMS and frequency are those between the cursors in time, or of the stretch that is shown.
  table(a, b, on) {
    const text = (value) => value === null || value === undefined ? "–" : String(Math.abs(value) < 0.001 ? Number(value.toFixed(6)) : Number(value.toPrecision(4)));
    const at = (curve, x) => curve.points.length ? curve.points.find((point) => point[0] === this.nearest(x, curve.points.map((one) => one[0])))[1] : null;
    const titles = [on && this.view === "time" ? "between A and B" : "of what is shown", ...(on ? ["A", "B", "B − A"] : []), "mean", "RMS", this.view === "time" ? "frequency" : "peak at"];
    const beside = (name) => this.curves.filter((curve) => curve.name === name), head = make("tr", { role: "row" }), rows = this.trace.names.flatMap(beside).map((curve) => {
      const gate = on && this.view === "time" ? TracesView.between(curve.time, Math.min(a, b), Math.max(a, b)).map(([x, y]) => [x / 1000, y]) : curve.seconds;
      const [y1, y2] = on ? [at(curve, a), at(curve, b)] : [], wraps = curve.unit === TracesView.ANGLE;
      const frequency = this.view === "time" ? measure.frequency(gate) : measure.peak(curve.points);
      const row = make("tr", { role: "row" }), name = make("th", { scope: "row", role: "rowheader", textContent: curve.kept ? "reference" : `${this.short(curve.name)}${curve.unit && ` [${curve.unit}]`}` }, row);
      name.style.color = `var(--${curve.color})`;
      const cells = [...(on ? [y1, y2, y1 === null ? null : y2 - y1] : []), wraps ? null : measure.mean(gate), wraps ? null : measure.rms(gate)].map(text);
      for (const cell of [...cells, frequency === null ? "–" : `${text(frequency)} Hz`]) { make("td", { role: "cell", textContent: cell }, row); }
      return row;
    });
    titles.forEach((title, n) => make(n ? "th" : "td", n ? { scope: "col", role: "columnheader", textContent: title } : { role: "cell", textContent: title }, head));
    by("scope-numbers").firstElementChild.replaceChildren(head, ...rows);
  }

  // ---- buttons -------------------------------------------------------------------------------------------------------------
  tools() {
    const press = (id, on) => by(id).setAttribute("aria-pressed", String(on));
    by("scope-cursors").onclick = () => { press("scope-cursors", this.cursors = !this.cursors); this.refresh(); };
    by("scope-fft").onclick = () => { this.view = this.view === "time" ? "spectrum" : "time"; press("scope-fft", this.view !== "time"); this.refresh(); };
    by("scope-keep").onclick = () => {
      if (!this.filled) { warn("reference: no trace yet: click Auto or Single first"); return; }
      TracesView.kept = TracesView.kept ? null : this.trace; press("scope-keep", Boolean(TracesView.kept));
      this.refresh();
    };
    ["a", "b"].forEach((name, n) => { by(`cursor-${name}`).oninput = (event) => this.move(n, this.grid[Number(event.target.value)]); });
    by("scope-axis").onchange = () => this.limits();
    by("scope-low").onchange = by("scope-high").onchange = () => this.typed();
    by("scope-csv").onclick = () => this.filled ? save(new Blob([this.csv()], { type: "text/csv" }), "scope.csv") : warn("CSV: no trace yet: click Auto or Single first");
    by("scope-png").onclick = () => this.filled ? this.picture().toBlob((blob) => save(blob, "scope.png")) : warn("PNG: no trace yet: click Auto or Single first");
    press("scope-cursors", false);
    press("scope-fft", false);
    press("scope-keep", Boolean(TracesView.kept));
  }

  get filled() { return this.curves.some((curve) => curve.time.length); }

  // What is shown as a table: a column for each curve, those of the reference beside them with their own time or frequency.
  csv() {
    const blocks = [false, true].map((kept) => this.curves.filter((curve) => curve.kept === kept)).filter((block) => block.length).map((block) => {
      const before = block[0].kept ? "reference " : "", x = `${before}${this.view === "time" ? "time_s" : "frequency_hz"}`;
      const rows = this.file(block.map((curve) => this.curves.indexOf(curve))).map(([place, ...values]) => [this.view === "time" ? place / 1000 : place, ...values]);
      return [[x, ...block.map((curve) => `${before}${curve.name}${curve.unit && ` [${curve.unit}]`}`)], ...rows];
    });
    const cell = (value) => value === null || value === undefined ? "" : typeof value === "number" ? String(Number(value.toPrecision(6))) : value;
    const most = Math.max(...blocks.map((block) => block.length));
    return Array.from({ length: most }, (_, n) => blocks.flatMap((block) => (block[n] ?? block[0].map(() => null)).map(cell)).join(",") + "\n").join("");
  }

  // Curves and numbers as they are on the screen.
  picture() {
    const all = by("scope-view"), { left, top, width, height } = all.getBoundingClientRect(), margin = 10, scale = 2;
    const canvas = make("canvas", { width: (width + 2 * margin) * scale, height: (height + 2 * margin) * scale }), c = canvas.getContext("2d");
    c.scale(scale, scale);
    c.fillStyle = tint("card");
    c.fillRect(0, 0, canvas.width, canvas.height);
    c.translate(margin - left, margin - top);
    for (const part of all.querySelectorAll("canvas")) {
      const r = part.getBoundingClientRect();
      if (r.width) { c.drawImage(part, r.left, r.top, r.width, r.height); }
    }
    c.textBaseline = "middle";
    for (const walker = document.createTreeWalker(all, NodeFilter.SHOW_TEXT); walker.nextNode();) {
      const range = document.createRange(), style = getComputedStyle(walker.currentNode.parentElement);
      range.selectNodeContents(walker.currentNode);
      const r = range.getBoundingClientRect();
      c.font = `${style.fontWeight} ${style.fontSize} ${style.fontFamily}`;
      c.fillStyle = style.color;
      if (r.width) { c.fillText(walker.currentNode.textContent.trim(), r.left, r.top + r.height / 2); }
    }
    return canvas;
  }
}
