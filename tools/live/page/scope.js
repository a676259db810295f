// The firmware's own scope: which variables, when it is triggered, and its last trace; variables of one unit share an axis.
class ScopeView {
  static COLORS = ["d", "q", "true", "estimate"];
  static FACTORS = [1, 2, 5, 10, 20, 50, 100, 200];
  static PREFIXES = ["board_drive.run.", "board_drive."]; // left out where a name is shown
  static HEIGHT = 190;
  static LEAST_HEIGHT = 66; // of a panel: three labels
  static ARMED_MS = 300; // so long "triggered" stays while the next trace is awaited

  constructor(hello, send) {
    by("scope-card").hidden = !hello.scope;
    if (!hello.scope) { return; }
    Object.assign(this, { send, units: hello.scope.variables, period: hello.scope.period_s, setup: hello.scope.setup, graphs: [], layout: "", trace: null, zoom: null });
    this.keys();
    this.names = new Map(Object.keys(this.units).map((name) => [this.short(name), name]));
    by("variables").replaceChildren(...[...this.names.keys()].sort().map((name) => new Option(name)));
    this.channels();
    this.controls();
    this.set(hello.scope);
    if (hello.scope.trace) { this.draw(hello.scope.trace); }
  }

  short(name) {
    const prefix = ScopeView.PREFIXES.find((start) => name.startsWith(start)) ?? "";
    return name.slice(prefix.length);
  }

  // The variable that somebody has typed, by its short or its whole name.
  whole(text) { return this.names.get(text) ?? (text in this.units ? text : null); }

  channels() {
    by("scope-channels").replaceChildren();
    this.inputs = ScopeView.COLORS.map((color, n) => {
      const input = make("input", { type: "text", placeholder: "no variable", spellcheck: false, title: "a variable of the firmware; clear it to leave the channel out" }, by("scope-channels"));
      input.setAttribute("list", "variables");
      input.setAttribute("aria-label", `channel ${n + 1}`);
      input.style.borderLeftColor = `var(--${color})`;
      input.addEventListener("focus", () => { if (input.value) { input.dataset.before = input.value; } });
      input.addEventListener("change", () => {
        input.classList.toggle("wrong", Boolean(input.value) && !this.whole(input.value));
        if (!input.classList.contains("wrong")) { this.apply({ channels: this.chosen() }); }
      });
      return input;
    });
  }

  chosen() { return this.inputs.map((input) => this.whole(input.value)).filter((name) => name); }

  controls() {
    for (const button of document.querySelectorAll("#scope-mode button")) { button.onclick = () => this.apply({ mode: button.dataset.mode }); }
    by("scope-factor").replaceChildren(...ScopeView.FACTORS.map((factor) => new Option(this.rate(factor), factor)));
    const listen = (id, change) => { by(id).onchange = () => this.apply(change(by(id))); };
    listen("scope-trigger", (item) => ({ trigger: item.value || null, level: 0 }));
    listen("scope-level", (item) => ({ level: Number(item.value) || 0 }));
    listen("scope-position", (item) => ({ position: Number(item.value) / 100 }));
    listen("scope-factor", (item) => ({ factor: Number(item.value) }));
    by("scope-edge").onclick = () => this.apply({ rising: !this.setup.rising });
  }

  rate(factor) {
    const us = factor * this.period * 1e6;
    return us < 1000 ? `${Number(us.toFixed(1))} µs a row` : `${Number((us / 1000).toFixed(2))} ms a row`;
  }

  // What somebody has changed; a trigger that is no longer recorded stays a trigger.
  apply(change) {
    this.setup = { ...this.setup, ...change };
    this.send({ scope: this.setup });
  }

  // What is set up, here or by another tab.
  set({ setup, status }) {
    this.setup = setup;
    this.inputs.forEach((input, n) => {
      const name = setup.channels[n];
      if (document.activeElement !== input) { input.value = name ? this.short(name) : ""; input.classList.remove("wrong"); }
    });
    const triggers = [...new Set([...setup.channels, ...(setup.trigger ? [setup.trigger] : [])])];
    by("scope-trigger").replaceChildren(new Option("none", ""), ...triggers.map((name) => new Option(this.short(name), name)));
    by("scope-trigger").value = setup.trigger ?? "";
    by("scope-edge").textContent = setup.rising ? "rises to" : "falls to";
    if (document.activeElement !== by("scope-level")) { by("scope-level").value = Number(setup.level.toPrecision(6)); }
    by("scope-unit").textContent = this.units[setup.trigger] ?? "";
    by("scope-position").value = setup.position * 100;
    by("scope-factor").value = setup.factor;
    for (const item of ["scope-edge", "scope-level", "scope-position"]) { by(item).disabled = !setup.trigger; }
    for (const button of document.querySelectorAll("#scope-mode button")) { button.setAttribute("aria-pressed", String(button.dataset.mode === setup.mode)); }
    this.say({ waits: this.waits(), stop: "stopped" }[status] ?? status, !["waits", "stop"].includes(status));
  }

  waits() { return this.setup.trigger ? "waits for its trigger" : "records"; }

  say(text, bad = false) {
    clearTimeout(this.timer);
    by("scope-status").textContent = by("scope-status").title = text;
    by("scope-status").classList.toggle("bad", bad);
  }

  // The next trace is awaited: what was said of the last one goes, unless another follows at once.
  armed() {
    clearTimeout(this.timer);
    this.timer = setTimeout(() => this.say(this.waits()), ScopeView.ARMED_MS);
  }

  groups(trace) {
    const groups = new Map();
    trace.names.forEach((name, n) => {
      const unit = trace.units[n];
      groups.set(unit, [...(groups.get(unit) ?? []), n]);
    });
    return [...groups.entries()];
  }

  draw(trace) {
    this.trace = trace;
    const layout = [trace.names, trace.units].join();
    if (layout !== this.layout) {
      this.layout = layout;
      this.graphs.forEach(({ graph }) => graph?.destroy());
      by("scope-graphs").replaceChildren();
      const groups = this.groups(trace);
      this.graphs = groups.map(([unit, members], n) => this.panel(unit, members, n === groups.length - 1, groups.length));
    }
    const whole = [trace.rows[0][0] * 1000, trace.rows.at(-1)[0] * 1000];
    if (!this.span || Math.abs(whole[1] - whole[0] - this.span[1] + this.span[0]) > 1e-6) { this.zoom = null; } // another rate or position
    this.span = whole;
    const files = this.graphs.map(({ members }) => trace.rows.map((row) => [row[0] * 1000, ...members.map((n) => row[n + 1])]));
    this.update((n) => ({ file: files[n], dateWindow: this.zoom ?? whole }));
    if (this.setup.mode !== "stop") { this.say(trace.triggered ? "triggered" : "not triggered"); }
  }

  // All panels at once; none of them then takes it for somebody's zoom.
  update(options) {
    this.updating = true;
    this.graphs.forEach(({ graph }, n) => graph?.updateOptions(options(n)));
    this.updating = false;
  }

  // One panel shows another stretch of time: the others follow, and traces to come stay there.
  show([from, to]) {
    const [first, last] = this.span;
    this.zoom = from <= first && to >= last ? null : [from, to];
    this.update(() => ({ dateWindow: this.zoom ?? this.span }));
  }

  followed(graph) {
    if (this.updating || !this.span) { return; }
    const [from, to] = graph.xAxisRange(), [before, after] = this.zoom ?? this.span;
    if (Math.abs(from - before) > 1e-9 || Math.abs(to - after) > 1e-9) { this.show([from, to]); }
  }

  // + and - zoom around the middle, the arrows move, 0 shows all.
  keys() {
    by("scope-graphs").onkeydown = (event) => {
      if (!this.span || event.ctrlKey || event.altKey || event.metaKey) { return; }
      const [from, to] = this.zoom ?? this.span, span = to - from, [first, last] = this.span;
      const [factor, shift] = { "+": [0.5, 0], "=": [0.5, 0], "-": [2, 0], ArrowLeft: [1, -0.25], ArrowRight: [1, 0.25], 0: [1e9, 0] }[event.key] ?? [];
      if (!factor) { return; }
      event.preventDefault();
      const wide = Math.min(span * factor, last - first), start = (from + to) / 2 + shift * span - wide / 2;
      const begin = Math.max(first, Math.min(last - wide, start));
      this.show([begin, begin + wide]);
    };
  }

  // Light or dark.
  fit() {
    if (!this.graphs) { return; }
    this.update((n) => ({ colors: this.graphs[n].members.map((m) => tint(ScopeView.COLORS[m % 4])), ...look() }));
  }

  panel(unit, members, last, count) {
    const names = members.map((n) => this.short(this.trace.names[n])), box = make("div", { className: "strip" }, by("scope-graphs"));
    const head = make("div", { className: "head" }, box), place = make("div", { className: "graph" }, box);
    const room = ScopeView.HEIGHT * (window.innerWidth >= 1800 ? 2 : 1);
    place.style.height = `${Math.max(ScopeView.LEAST_HEIGHT, Math.round(room / count)) + (last ? 18 : 0)}px`;
    const legend = make("div", { className: "legend" }, head);
    if (!window.Dygraph) { return { members }; }
    const graph = new Dygraph(place, [[0, ...members.map(() => 0)]], {
      labels: ["ms", ...names], colors: members.map((n) => tint(ScopeView.COLORS[n % 4])), strokeWidth: 1.5, legend: "always", labelsDiv: legend, highlightCircleSize: 2,
      legendFormatter: (data) => this.legend(data, unit), ...look(), drawCallback: (g, first) => { if (!first) { this.followed(g); } }, xRangePad: 0, yRangePad: 6,
      underlayCallback: (canvas, area, g) => this.marks(canvas, area, g, members),
      axes: { x: { drawAxis: last, axisLabelFontSize: 11, axisLabelFormatter: (t) => `${Number(t.toFixed(4))} ms`, pixelsPerLabel: 80 },
              y: AXIS } });
    return { graph, members };
  }

  legend(data, unit) {
    const text = (value) => value.replace(/[&<>"]/g, (c) => ({ "&": "&amp;", "<": "&lt;", ">": "&gt;", '"': "&quot;" })[c]);
    const rows = data.series.map((one) => `<span style="color:${one.color}">${text(one.label)} <em>${one.y === undefined ? "" : Number(one.y.toPrecision(5))}</em> ${text(unit)}</span>`);
    return rows.join("") + (data.x === undefined ? "" : `<small>at ${data.x.toFixed(3)} ms</small>`);
  }

  // The trigger: its moment, and its level where its variable is drawn.
  marks(canvas, area, graph, members) {
    if (!this.trace.triggered) { return; }
    canvas.strokeStyle = tint("soft");
    canvas.setLineDash([3, 4]);
    canvas.beginPath();
    const x = Math.round(graph.toDomXCoord(0)) + 0.5;
    canvas.moveTo(x, area.y);
    canvas.lineTo(x, area.y + area.h);
    if (members.some((n) => this.trace.names[n] === this.setup.trigger)) {
      const y = Math.round(graph.toDomYCoord(this.setup.level)) + 0.5;
      canvas.moveTo(area.x, y);
      canvas.lineTo(area.x + area.w, y);
    }
    canvas.stroke();
    canvas.setLineDash([]);
  }
}
