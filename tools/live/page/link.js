// The connection to the board: JSON both ways, opened again when it breaks.
class Link {
  constructor(take, tell) {
    this.take = take;
    this.tell = tell;
    this.open();
  }

  open() {
    this.socket = new WebSocket(`ws://${location.host}/board${location.search}`);
    this.socket.onopen = () => this.tell("");
    this.socket.onmessage = (event) => this.take(JSON.parse(event.data));
    this.socket.onclose = () => {
      this.tell("The board does not answer: make live has ended. Start it again and open the address that it prints.");
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

const by = (id) => document.getElementById(id);
