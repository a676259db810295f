// The firmware's own scope: which variables, when it is triggered; what it has recorded is drawn by traces.js.
class ScopeView extends TracesView {
  static FACTORS = [1, 2, 4, 5, 10, 20, 50, 100, 200];
  static ARMED_MS = 300; // so long "triggered" stays while the next trace is awaited

  constructor(hello, send) {
    super();
    by("scope-card").hidden = !hello.scope && !hello.recorder;
    by("scope-card").classList.toggle("recorder", Boolean(hello.recorder));
    by("scope-title").textContent = hello.recorder ? "Fault recorder" : "Scope";
    Object.assign(this, { faults: hello.faults, told: hello.recorder?.told });
    if (hello.recorder) { this.expect(hello.recorder.names, hello.recorder.units); }
    if (hello.recorder?.trace) { this.draw(hello.recorder.trace); } else { this.why(); }
    if (!hello.scope) { return; }
    Object.assign(this, { send, units: hello.scope.variables, period: hello.scope.period_s, setup: hello.scope.setup, recorder: hello.scope.fault });
    this.names = new Map(Object.keys(this.units).map((name) => [this.short(name), name]));
    by("variables").replaceChildren(...[...this.names.keys()].sort().map((name) => new Option(name)));
    this.channels();
    this.controls();
    this.set(hello.scope);
    if (hello.scope.trace) { this.draw(hello.scope.trace); }
  }

  // The variable that somebody has typed, by its short or its whole name.
  whole(text) { return this.names.get(text) ?? (text in this.units ? text : null); }

  channels() {
    by("scope-channels").replaceChildren();
    this.inputs = TracesView.COLORS.map((color, n) => {
      const input = make("input", { type: "text", placeholder: "no variable", spellcheck: false, title: "a variable of the firmware; clear it to leave the channel out" }, by("scope-channels"));
      input.setAttribute("list", "variables");
      input.setAttribute("aria-label", `channel ${n + 1}`);
      input.style.borderLeftColor = `var(--${color})`;
      input.addEventListener("focus", () => { if (input.value) { input.dataset.before = input.value; } });
      input.addEventListener("change", () => {
        const wrong = Boolean(input.value) && !this.whole(input.value);
        this.mark(input, wrong);
        if (wrong) { warn(`channel ${n + 1}: no variable '${input.value}': choose one of the list, or clear it`); return; }
        this.apply({ channels: this.chosen() });
        if (!input.value) { this.inputs.forEach((item, at) => { item.value = this.short(this.setup.channels[at] ?? ""); }); } // those behind it move up, here as in the trace
      });
      return input;
    });
  }

  mark(input, wrong) {
    input.classList.toggle("wrong", wrong);
    input.setAttribute("aria-invalid", String(wrong));
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
    by("scope-fault").onclick = () => { // once more: back to what was looked at before
      const armed = this.isArmed(), own = this.setup.channels.join() !== this.recorder.channels.join();
      if (own) { this.before = { ...this.setup }; }
      this.apply(armed && this.before ? this.before : this.recorder);
    };
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
      if (document.activeElement !== input) { input.value = name ? this.short(name) : ""; this.mark(input, false); }
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
    const armed = this.isArmed();
    by("scope-fault").setAttribute("aria-pressed", String(armed));
    if (armed) { this.expect(setup.channels, setup.channels.map((name) => this.units[name])); }
    this.why();
    this.say({ waits: this.waits(), stop: "stopped", lent: "suspended while a loop is measured" }[status] ?? status, !["waits", "stop", "lent"].includes(status));
  }

  isArmed() { return ["mode", "trigger", "level"].every((key) => this.setup[key] === this.recorder[key]); }

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

  draw(trace) {
    super.draw(trace);
    this.why();
    if (this.setup && this.setup.mode !== "stop") { this.say(trace.triggered ? "triggered" : "not triggered"); }
  }

  // Room for a record that is to come: it moves nothing then.
  expect(names, units) {
    if (this.trace?.names.join() !== names.join()) { super.draw({ names, units, triggered: false, rows: [-0.01, 0.003].map((time) => [time, ...names.map(() => null)]) }); }
  }

  // Beside a record of a fault: which one, its cause and its remedy.
  why() {
    const place = by("scope-why"), fault = this.trace?.fault, row = this.faults[fault], armed = by("scope-fault").getAttribute("aria-pressed") === "true";
    place.hidden = !armed && !fault && !this.told;
    place.replaceChildren();
    place.classList.toggle("bad", Boolean(row));
    if (!row) { place.append(this.told ?? "Armed: the next fault's record comes by itself. Until then nothing else is recorded. The firmware's own recorder is in builds with SCOPE 0."); return; }
    make("b", { textContent: fault }, place);
    place.append(`, at 0 ms: ${row.cause}. Remedy: ${row.remedy}.`);
  }
}
