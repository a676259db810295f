// Parameters kept over a reset: what the board says of them, and the two buttons. Only with a firmware that has PARAMS_KEPT.
class KeptView {
  constructor(hello, send) {
    by("kept-card").hidden = !hello.kept;
    by("keep").onclick = () => send({ keep: true });
    by("forget").onclick = () => send({ forget: true });
  }

  show(frame) {
    const kept = frame.kept;
    if (!kept) { return; }
    const unsaved = kept.unsaved ? `${kept.unsaved} ${kept.unsaved === 1 ? "word has" : "words have"} changed since and would be lost with a reset` : "";
    by("kept-state").textContent = kept.state;
    by("kept-state").classList.toggle("bad", !["NONE", "KEPT"].includes(kept.state));
    by("kept-text").textContent = [kept.meaning, unsaved].filter(Boolean).join("; ");
    by("keep").disabled = by("forget").disabled = frame.state !== "STOPPED";
  }
}
