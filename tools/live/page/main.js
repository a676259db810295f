// Brings the parts together: a hello builds them, each frame is shown by all.
const foc33 = { frames: 0, frame: null, traces: 0, refused: "" }; // for those who look from outside
let views = null, rotor = null, run = 0;

// What holds until it is over; then "".
function say(text) {
  say.now = text;
  clearTimeout(warn.timer);
  tell(text);
}

// For a while; then what holds is there again.
function warn(text) {
  tell(text);
  clearTimeout(warn.timer);
  warn.timer = setTimeout(() => tell(say.now ?? ""), 6000);
}

function tell(text) {
  by("message").hidden = !text;
  by("message").textContent = text;
}

// Without an answer the last values are grey, and no state is claimed.
function hush(on) {
  document.body.classList.toggle("silent", on);
  if (on) { views?.drive.unknown(); }
}

let silent = null; // null: the board has not said yet
const link = new Link(take, say, (on) => { hush(on); silent = null; });
const board = new BoardView((command) => link.send(command));

function begin(hello) {
  document.body.classList.toggle("real", !hello.virtual);
  document.body.classList.toggle("told", hello.remote === null); // a board that only tells
  by("what").textContent = by("what").title = [hello.motor, hello.board, ...hello.defines, ...(hello.chip ? ["the image in the simulated dsPIC33F"] : [])].join(" · ");
  ["sliders", "throws", "states", "log", "pace"].forEach((id) => by(id).replaceChildren());
  for (const pace of hello.paces) { make("option", { value: pace, textContent: pace === 1 ? "real time" : `1 : ${Math.round(1 / pace)}` }, by("pace")); }
  const send = (command) => link.send(command);
  const drive = new DriveView(hello), strips = new StripsView(hello), loops = new LoopsView(hello, send);
  const own = hello.virtual ? [board, new BenchView(hello, send), rotor ??= new RotorView(hello)] : hello.remote ? [new RemoteView(hello.remote, send)] : [];
  views = { drive, strips, loops, scope: new ScopeView(hello, send), tuning: new TuningView(hello, send), planes: new PlanesView(hello), all: [drive, strips, loops, new KeptView(hello, send), ...own] };
  run = 0;
}

let paceBusy = 0; // until then what the board tells of the pace may be older than what somebody chose
function tempo(frame) {
  const slow = frame.measured !== null && frame.measured < 0.95 * frame.pace;
  by("time").textContent = `${frame.t.toFixed(frame.pace < 0.1 ? 3 : 1)} s`;
  if (performance.now() > paceBusy && by("pace").value !== String(frame.pace)) { by("pace").value = String(frame.pace); }
  by("measured").classList.toggle("slow", slow);
  by("measured").textContent = slow ? `this machine manages 1 : ${(1 / frame.measured).toFixed(frame.measured > 0.1 ? 1 : 0)}` : "";
}

// The next message comes when this one is on the screen: a slow machine, or a tab out of sight, gets fewer.
function take(message) {
  if (message.t !== undefined || message.scope || message.trace || message.armed || message.tuning || message.loops) { requestAnimationFrame(() => link.send({ seen: true })); }
  if (message.hello) { begin(message.hello); return; }
  if (message.ended) { say(`The board has stopped: ${message.ended}`); return; }
  if (message.refused) { foc33.refused = message.refused; warn(message.refused); return; }
  if (!views) { return; }
  if (message.scope) { views.scope.set(message.scope); return; }
  if (message.armed) { views.scope.armed(); return; }
  if (message.loops) { views.loops.set(message.loops); return; }
  if (message.tuning) { views.tuning.set(message.tuning); return; }
  if (message.trace) { views.scope.draw(message.trace); foc33.traces++; return; }
  if (run && message.run !== run) { views.drive.clear(); views.strips.clear(); }
  run = message.run;
  tempo(message);
  views.all.forEach((view) => view.show(message));
  if (message.now) { views.planes.show(message); } // a real board that has not answered yet has no numbers
  if (message.silent !== undefined && message.silent !== silent) { silent = message.silent; hush(silent); say(silent ? "no answer from the board: is it on, is its cable in? What is grey is older." : ""); }
  foc33.frame = message;
  foc33.frames++;
}

matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => { views?.strips.fit(); views?.scope.fit(); });

addEventListener("resize", () => { views?.loops.draw(); views?.scope.resized(); });

by("power").addEventListener("click", () => link.send({ power: true }));
by("pace").addEventListener("change", () => { paceBusy = performance.now() + 500; link.send({ pace: Number(by("pace").value) }); });
for (const what of ["scenario", "csv", "header", "motor", "loop", "step"]) {
  by(`save-${what}`).addEventListener("click", async () => { // what cannot be saved says why, instead of an empty file
    const answer = await fetch(`/save/${what}${location.search}`);
    if (!answer.ok) { warn((await answer.text()).trim()); return; }
    if (what === "header" || what === "motor") { views?.tuning.kept(); }
    save(await answer.blob(), /filename="(.*)"/.exec(answer.headers.get("Content-Disposition"))[1]);
  });
}
