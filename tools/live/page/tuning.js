// Parameters of userparams.h by subject: changed in the running firmware, undone, saved as a header. What is wrong is refused by a build's own checks.
class TuningView {
  static PLACES = { board: "changed, unsaved", build: "needs a build: in the saved header alone", unused: "this build does not ask for it: in the saved header alone" };

  constructor({ tuning }, send) {
    Object.assign(this, { send, subjects: tuning.subjects, rows: new Map(), saved: {} });
    document.onkeydown = null;
    by("tuning-fixed").hidden = !tuning.fixed;
    by("tuning-fixed").textContent = tuning.fixed ?? "";
    by("tuning-parts").hidden = Boolean(tuning.fixed);
    if (tuning.fixed) { return; }
    const before = by("tuning-subject").value;
    by("tuning-subject").replaceChildren(...Object.keys(tuning.subjects).map((name) => new Option(name.split(": ")[0], name)));
    if (before in tuning.subjects) { by("tuning-subject").value = before; }
    by("tuning-subject").onchange = () => this.list();
    by("tuning-undo").onclick = () => send({ tune: "undo" });
    by("tuning-again").onclick = () => send({ tune: "again" });
    document.onkeydown = (event) => { // in a field that somebody edits the browser undoes; elsewhere it would, too, in a field that somebody has left
      const own = by("tuning-card").contains(event.target), edited = event.target.tagName === "INPUT" && (!own || event.target.value !== event.target.dataset.shown);
      if (event.key === "z" && (event.ctrlKey || event.metaKey) && !edited) { event.preventDefault(); send({ tune: "undo" }); }
    };
    this.set(tuning);
    this.list();
  }

  // The rows of the chosen subject.
  list() {
    by("tuning-rows").replaceChildren();
    this.rows = new Map(this.subjects[by("tuning-subject").value].map((row) => [row.name, this.row(row)]));
    this.show();
  }

  row({ name, unit, low, high, header, meaning }) {
    const box = make("div", { className: "parameter" }, by("tuning-rows"));
    const label = make("label", {}, box);
    make("b", { textContent: name }, label);
    const input = make("input", { type: "text", spellcheck: false, autocomplete: "off" }, label);
    make("span", { textContent: unit === "1" ? "" : unit }, label);
    make("p", { textContent: `${meaning}. ${low} .. ${high}, header ${header}` }, box);
    const place = make("p", { className: "place" }, box);
    input.onchange = () => { // an empty field is the header's value again
      input.value = input.value.trim() || header;
      if (input.value !== input.dataset.shown) { input.classList.add("busy"); this.send({ tune: [name, input.value] }); }
    };
    return { input, place, header };
  }

  // How things stand, after a change here or in another tab, or after one that was refused.
  set(tuning) {
    this.told = tuning;
    this.show();
  }

  // A header or motor file was saved.
  kept() {
    this.saved = Object.fromEntries(Object.entries(this.told?.changed ?? {}).map(([name, { text }]) => [name, text]));
    this.show();
  }

  show() {
    const { changed, undo, lost, foreign } = this.told, names = Object.keys(changed);
    const unsaved = names.filter((name) => changed[name].text !== this.saved[name]);
    for (const [name, { input, place, header }] of this.rows) {
      const text = changed[name]?.text ?? header, edited = document.activeElement === input && input.value !== input.dataset.shown && !input.classList.contains("busy");
      if (!edited) { input.value = text; }
      input.dataset.shown = text;
      input.classList.remove("busy");
      input.classList.toggle("changed", name in changed);
      place.textContent = name in changed && changed[name].place === "board" && !unsaved.includes(name) ? "changed, saved" : TuningView.PLACES[changed[name]?.place] ?? "";
    }
    by("tuning-undo").disabled = !undo;
    by("tuning-again").hidden = !lost;
    by("tuning-text").textContent = [unsaved.length ? `unsaved: ${unsaved.join(", ")}` : names.length ? "all changes are saved" : "nothing is changed", lost ? "the board has lost them, after a reset" : "",
      foreign ? `${foreign} values of the board were not this header's before` : ""].filter(Boolean).join("; ");
    by("tuning-text").classList.toggle("bad", lost);
  }
}
