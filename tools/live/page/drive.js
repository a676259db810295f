// What the drive says: its state, a fault with cause and remedy, why the output is limited, and what happened.
class DriveView {
  constructor(hello) {
    this.hello = hello;
    this.states = Object.entries(hello.states).map(([name, meaning]) => {
      const item = make("li", { textContent: name, title: meaning }, by("states"));
      item.dataset.state = name;
      return item;
    });
    this.told = "";
    this.lines = new Map();
    this.note(hello.log);
  }

  // The state is what it was when it was told.
  unknown() {
    for (const item of this.states) { item.classList.remove("now"); }
  }

  show(frame) {
    for (const item of this.states) { item.classList.toggle("now", item.dataset.state === frame.state); }
    const told = [frame.fault, ...frame.limits].join();
    if (told !== this.told) {
      this.told = told;
      this.fault(frame.fault);
      this.limits(frame.limits);
    }
    this.note(frame.log);
  }

  fault(name) {
    const place = by("fault"), row = this.hello.faults[name];
    place.hidden = name === "NONE";
    place.replaceChildren();
    if (!row || place.hidden) { return; }
    make("b", { textContent: name }, place);
    place.append(`: ${row.cause}. Remedy: ${row.remedy}. S2 clears it once the cause is gone.`);
  }

  limits(names) {
    by("limits").replaceChildren(...(names.length ? ["limited by"] : []));
    for (const name of names) {
      const row = this.hello.limits[name];
      make("b", { textContent: name, title: row ? `${row.cause}: ${row.remedy}` : "" }, by("limits"));
    }
  }

  // A line with a known number replaces the older one.
  note(lines) {
    const list = by("log");
    for (const line of lines) {
      let item = this.lines.get(line.id);
      if (!item) {
        item = make("li", { className: line.kind });
        item.append(make("time"), make("span"));
        list.prepend(item);
        this.lines.set(line.id, item);
      }
      item.firstChild.textContent = `${line.t.toFixed(3)} s`;
      item.lastChild.textContent = line.text;
    }
    while (list.children.length > 200) { list.lastChild.remove(); }
    for (const [id, item] of this.lines) { if (!item.isConnected) { this.lines.delete(id); } }
  }

  clear() {
    by("log").replaceChildren();
    this.lines.clear();
  }
}
