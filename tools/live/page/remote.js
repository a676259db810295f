// A real board is started, stopped and given its target over its serial line.
class RemoteView {
  constructor({ low, high }, send) {
    this.send = send;
    this.busy = 0;
    const target = by("target"), turn = gently((value) => send({ target: value }));
    Object.assign(target, { min: low, max: high, value: low });
    target.oninput = () => { this.busy = performance.now() + 500; this.tell(); turn(Number(target.value)); };
    by("start").onclick = () => send({ start: Math.min(high, Math.max(low, Number(target.value))) });
    by("stop").onclick = () => send({ stop: true });
    by("clear").onclick = () => send({ clear: true });
    this.tell();
  }

  tell() { by("target-text").textContent = `${Number(by("target").value).toFixed(0)} rpm`; }

  show(frame) {
    by("start").setAttribute("aria-pressed", String(Boolean(frame.remote?.run)));
    by("stop").disabled = !frame.remote;
    if (frame.remote && performance.now() > this.busy) {
      by("target").value = frame.remote.target_rpm;
      this.tell();
    }
  }
}
