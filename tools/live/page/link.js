// The connection to the board: JSON both ways, opened again when it breaks.
class Link {
  constructor(take, tell, hush) {
    Object.assign(this, { take, tell, hush });
    this.open();
  }

  open() {
    this.socket = new WebSocket(`ws://${location.host}/board${location.search}`);
    this.socket.onopen = () => { this.tell(""); this.hush(false); };
    this.socket.onmessage = (event) => this.take(JSON.parse(event.data));
    this.socket.onclose = () => {
      this.hush(true);
      this.tell("no answer: make live has ended. Start it again and open the address that it prints.");
      setTimeout(() => this.open(), 1500);
    };
  }

  send(command) {
    if (this.socket.readyState === WebSocket.OPEN) { this.socket.send(JSON.stringify(command)); }
  }
}

// Sends the newest value at most every 40 ms.
function gently(send) {
  let waiting = null, timer = 0;
  return (value) => {
    waiting = value;
    timer ||= setTimeout(() => { timer = 0; send(waiting); }, 40);
  };
}

// Puts an element into another: make("li", {className: "now"}, parent).
function make(tag, properties, parent) {
  const element = Object.assign(document.createElement(tag), properties);
  parent?.append(element);
  return element;
}

// The browser saves it by this name.
function save(blob, name) {
  const file = make("a", { href: URL.createObjectURL(blob), download: name }, document.body);
  file.click();
  file.remove();
  URL.revokeObjectURL(file.href);
}

// A colour of the style by its name, for what is drawn: it is another one in the dark.
const tint = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();

// Round values for a curve's axis, three to six: the widest step of 1, 2, 2.5, 5 times a power of ten that gives three. None on its ends: those are not drawn.
function ticks(low, high) {
  if (!(high > low)) { return [{ v: low, label: String(low) }]; }
  const inner = (high - low) * 1e-6;
  [low, high] = [low + inner, high - inner];
  const power = 10 ** Math.floor(Math.log10(high - low));
  const step = [5, 2.5, 2, 1, 0.5, 0.25, 0.2, 0.1].map((n) => n * power).find((s) => Math.floor(high / s) - Math.ceil(low / s) >= 2) ?? power / 10;
  const first = Math.ceil(low / step), count = Math.floor(high / step) - first + 1;
  return Array.from({ length: count }, (_, n) => Number(((first + n) * step).toPrecision(12))).map((v) => ({ v, label: Math.abs(v) >= 1e4 ? `${Number((v / 1e3).toPrecision(6))}k` : String(v) }));
}

// What all curves have: an axis that leaves room for the curve on a phone, and the style's colours.
const AXIS = { axisLabelFontSize: 11, axisLabelWidth: 36, ticker: ticks };
const look = () => ({ gridLineColor: tint("grid"), axisLineColor: tint("line"), rightGap: 4 });

const by = (id) => document.getElementById(id);
