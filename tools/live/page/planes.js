// Voltage and current as vectors: in the stator's frame with the hexagon that the bus allows, and in the rotor's.
// A canvas of its element's width, in sharp pixels: [context, width, height].
function fitted(canvas, aspect) {
  const width = canvas.clientWidth, height = Math.round(width * aspect), ratio = window.devicePixelRatio || 1;
  if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(height * ratio);
    canvas.style.height = `${height}px`;
  }
  const c = canvas.getContext("2d");
  c.setTransform(ratio, 0, 0, ratio, 0, 0);
  c.clearRect(0, 0, width, height);
  return [c, width, height];
}

function circle(c, x, y, r) { c.beginPath(); c.arc(x, y, r, 0, 2 * Math.PI); }

const polar = (r, deg) => [r * Math.cos(deg * Math.PI / 180), -r * Math.sin(deg * Math.PI / 180)];

function label(c, text, x, y, align = "center") {
  c.font = "10px system-ui, sans-serif";
  c.textAlign = align;
  c.textBaseline = "middle";
  c.fillText(text, x, y);
}

function arrow(c, x0, y0, x, y, color, width, dash = []) {
  const length = Math.hypot(x - x0, y - y0), angle = Math.atan2(y - y0, x - x0);
  if (length < 2) { return; }
  const head = Math.min(9, length);
  Object.assign(c, { strokeStyle: color, fillStyle: color, lineWidth: width });
  c.setLineDash(dash);
  c.beginPath();
  c.moveTo(x0, y0);
  c.lineTo(x - head * 0.7 * Math.cos(angle), y - head * 0.7 * Math.sin(angle));
  c.stroke();
  c.setLineDash([]);
  c.beginPath();
  c.moveTo(x, y);
  for (const turn of [2.7, -2.7]) { c.lineTo(x + head * Math.cos(angle + turn), y + head * Math.sin(angle + turn)); }
  c.fill();
}

class PlanesView {
  static ASPECT = 0.74;

  constructor(hello) {
    this.hello = hello;
    this.trail = [];
  }

  // Pixels of a volt and of an ampere; the centre is the origin.
  scales(w, h, bus) {
    const r = Math.min(w, h) / 2 - 14;
    return [r / (2 / 3 * Math.max(bus, this.hello.nominal_bus_v)), r * 0.5 / this.hello.max_current_a];
  }

  show(frame) {
    this.stator(frame);
    this.rotor(frame);
  }

  axes(c, w, h, x, y) {
    Object.assign(c, { strokeStyle: tint("grid"), lineWidth: 1, fillStyle: tint("soft") });
    c.beginPath();
    c.moveTo(-w / 2, 0);
    c.lineTo(w / 2, 0);
    c.moveTo(0, -h / 2);
    c.lineTo(0, h / 2);
    c.stroke();
    label(c, x, w / 2 - 8, 9);
    label(c, y, 9, 8 - h / 2);
  }

  legend(c, w, h, current) {
    c.fillStyle = tint("true");
    label(c, "voltage", 4 - w / 2, h / 2 - 7, "left");
    c.fillStyle = tint("q");
    label(c, current, w / 2 - 4, h / 2 - 7, "right");
  }

  path(c, points, scale, color) {
    Object.assign(c, { strokeStyle: color, lineWidth: 1.5 });
    c.beginPath();
    points.forEach(([x, y], n) => c[n ? "lineTo" : "moveTo"](x * scale, -y * scale));
    c.stroke();
  }

  ring(c, r, color, dash) {
    Object.assign(c, { strokeStyle: color, lineWidth: 1 });
    c.setLineDash(dash);
    circle(c, 0, 0, r);
    c.stroke();
    c.setLineDash([]);
  }

  stator({ now, orbit }) {
    const [c, w, h] = fitted(by("stator"), PlanesView.ASPECT), [volt, ampere] = this.scales(w, h, now.bus_v);
    c.translate(w / 2, h / 2);
    this.axes(c, w, h, "α", "β");
    Object.assign(c, { strokeStyle: tint("hexagon"), lineWidth: 1.2 });
    c.beginPath();
    for (let n = 0; n < 6; n++) { c[n ? "lineTo" : "moveTo"](...polar(2 / 3 * now.bus_v * volt, 60 * n)); }
    c.closePath();
    c.stroke();
    this.ring(c, now.v_limit_v * volt, tint("hexagon"), [3, 3]);
    this.path(c, orbit.v, volt, `${tint("true")}66`);
    this.path(c, orbit.i, ampere, `${tint("q")}77`);
    const [v, i] = [orbit.v.at(-1), orbit.i.at(-1)];
    if (v) { arrow(c, 0, 0, v[0] * volt, -v[1] * volt, tint("true"), 2); }
    if (i) { arrow(c, 0, 0, i[0] * ampere, -i[1] * ampere, tint("q"), 2); }
    this.legend(c, w, h, "current");
  }

  rotor({ now, outputs }) {
    const [c, w, h] = fitted(by("frame"), PlanesView.ASPECT), [volt, ampere] = this.scales(w, h, now.bus_v);
    c.translate(w / 2, h / 2);
    this.axes(c, w, h, "d", "q");
    this.ring(c, now.v_limit_v * volt, `${tint("true")}55`, [3, 3]);
    this.ring(c, this.hello.max_current_a * ampere, `${tint("q")}55`, [3, 3]);
    this.trail.push([now.i_d_a, now.i_q_a]);
    this.trail.splice(0, this.trail.length - 40);
    this.path(c, this.trail, ampere, `${tint("q")}55`);
    if (outputs) {
      arrow(c, 0, 0, now.v_d_v * volt, -now.v_q_v * volt, tint("true"), 2);
      arrow(c, 0, 0, now.i_d_a * ampere, -now.i_q_a * ampere, tint("q"), 2);
    }
    this.legend(c, w, h, `current, circle ${this.hello.max_current_a} A`);
  }
}
