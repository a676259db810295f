// The rotor with its true and its estimated angle; what turns too fast for the eye is slowed down.
class RotorView {
  static SLOWER = [1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000, 5000];
  static MOST_DEG_PER_S = 400;
  static PICTURE_S = 0.03; // more pictures a second would only cost

  constructor(hello) {
    this.hello = hello;
    this.shown = 0;
    this.error = 0;
    this.frame = null;
    this.last = performance.now();
    const turn = (now) => {
      const seconds = (now - this.last) / 1000;
      if (seconds >= RotorView.PICTURE_S) { this.turn(seconds); this.last = now; }
      requestAnimationFrame(turn);
    };
    requestAnimationFrame(turn);
  }

  show(frame) {
    const { now } = frame;
    this.frame = frame;
    this.rate = now.speed_rpm * 6 * this.hello.pole_pairs * (frame.measured ?? frame.pace);
    this.slower = RotorView.SLOWER.find((n) => Math.abs(this.rate) / n <= RotorView.MOST_DEG_PER_S) ?? RotorView.SLOWER.at(-1);
    this.estimated = this.hello.estimates.includes(frame.state);
    this.goal = RotorView.wrapped(now.theta_est_deg - now.theta_deg);
    this.truth = now.theta_deg;
    by("rotor-text").textContent = `true ${now.speed_rpm.toFixed(0)} rpm` + (this.estimated ? `, angle error ${this.goal >= 0 ? "+" : ""}${this.goal.toFixed(1)}°` : "")
      + (this.slower > 1 ? ` · shown ${this.slower} times slower` : "");
  }

  static wrapped(deg) { return deg - 360 * Math.round(deg / 360); }

  turn(seconds) {
    if (!this.frame) { return; }
    const step = Math.min(seconds, 0.1);
    this.shown += this.rate / this.slower * step;
    if (this.slower === 1) { // then it stands where it really is
      this.truth += this.rate * step;
      this.shown += RotorView.wrapped(this.truth - this.shown) * 0.3;
    }
    this.error += (this.goal - this.error) * 0.4;
    this.draw();
  }

  draw() {
    const [c, w, h] = fitted(by("rotor"), 0.72), r = Math.min(w, h) / 2 - 12;
    c.translate(w / 2, h / 2);
    this.stator(c, r);
    c.save();
    c.rotate(-this.shown * Math.PI / 180); // counter-clockwise is forward
    this.magnets(c, r * 0.62);
    c.restore();
    arrow(c, 0, 0, ...polar(r * 0.86, this.shown), tint("true"), 3);
    if (this.estimated) { arrow(c, 0, 0, ...polar(r * 0.86, this.shown + this.error), tint("estimate"), 2, [5, 4]); }
    c.fillStyle = "#fff";
    circle(c, 0, 0, 4);
    c.fill();
  }

  stator(c, r) {
    c.strokeStyle = tint("ring");
    c.lineWidth = 14;
    circle(c, 0, 0, r - 7);
    c.stroke();
    ["A", "B", "C"].forEach((name, n) => {
      for (const side of [0, 180]) {
        const [x, y] = polar(r - 7, n * 120 + side);
        c.fillStyle = side ? "#c4ccd3" : "#7d8791";
        circle(c, x, y, 8);
        c.fill();
        c.fillStyle = "#fff";
        label(c, side ? "" : name, x, y);
      }
    });
  }

  magnets(c, r) {
    for (const [from, color, name, at] of [[-Math.PI / 2, "#d8897f", "N", 1], [Math.PI / 2, "#8fb0d3", "S", -1]]) {
      c.fillStyle = color;
      c.beginPath();
      c.arc(0, 0, r, from, from + Math.PI);
      c.fill();
      c.fillStyle = "#ffffffcc";
      label(c, name, at * r * 0.78, 0);
    }
  }
}
