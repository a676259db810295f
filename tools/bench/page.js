// Draws the curves of a run: lanes for states, faults and reasons for a limit, and a panel for each quantity, all on one time axis.
(async () => {
  "use strict";
  const STATES = { CALIBRATE: "#e8e8e8", BOOTSTRAP: "#e3d9f0", CATCH: "#cdeaf0", ALIGN: "#fde7c3", RAMP: "#fff4b8", CLOSED: "#e0f3e0", STOPPING: "#d9e8f7",
                   FAULT: "#f9d3d3", BRAKE: "#d5d5f2" };
  const LANE = 18, LABELS = 110, POINTS = 1500; // px, px, pairs of points drawn at most
  const place = document.getElementById("curves");
  const pictures = JSON.parse(document.getElementById("pictures").textContent);
  const moment = Object.assign(document.createElement("div"), { id: "moment" });
  const time = (t) => t.toFixed(4) + " s";
  let graphs = [], view = null, shown = null;

  async function decoded(picture) {
    const head = JSON.parse(picture.head);
    const packed = Uint8Array.from(atob(picture.curves), (c) => c.charCodeAt(0));
    const buffer = await new Response(new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"))).arrayBuffer();
    const n = head.points, times = new Float64Array(n), differences = new Int32Array(buffer, 0, n);
    for (let i = 0, t = 0; i < n; i++) {
      times[i] = (t = (t + differences[i]) | 0) / 1e6;
    }
    let at = 4 * n;
    for (const line of head.panels.flatMap((panel) => panel.lines)) {
      const counts = new Int16Array(buffer, at, n);
      line.values = new Float64Array(n);
      for (let i = 0, c = 0; i < n; i++) {
        c = (c + counts[i]) << 16 >> 16;
        line.values[i] = c === -32768 ? NaN : line.low + (c + 32767) * line.step;
      }
      at += 2 * n;
    }
    return { ...head, times };
  }

  // First index with times[i] >= t.
  function index(times, t) {
    let low = 0, high = times.length;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (times[middle] < t) { low = middle + 1; } else { high = middle; }
    }
    return low;
  }

  // Rows for Dygraph between two moments: all points, or the lowest and the highest of each stretch.
  function rows(lines, from, to) {
    const { times } = shown, first = Math.max(0, index(times, from) - 1), last = Math.min(times.length, index(times, to) + 1);
    const step = Math.ceil((last - first) / POINTS / 2), result = [];
    if (step <= 1) {
      for (let i = first; i < last; i++) {
        result.push([times[i], ...lines.map((line) => line.values[i])]);
      }
      return result;
    }
    for (let a = first; a < last; a += 2 * step) {
      const b = Math.min(last, a + 2 * step), one = [times[a]], two = [times[Math.min(last - 1, a + step)]];
      for (const { values } of lines) {
        let low = NaN, high = NaN, down = false;
        for (let i = a; i < b; i++) {
          const v = values[i];
          if (!(v >= low)) { if (v < low || low !== low) { low = v; down = i > a; } }
          if (!(v <= high)) { if (v > high || high !== high) { high = v; if (i > a) { down = false; } } }
        }
        one.push(down ? high : low);
        two.push(down ? low : high);
      }
      result.push(one);
      if (two[0] > one[0]) { result.push(two); }
    }
    return result;
  }

  const spans = (changes) => changes.map(([at, name], i) => [at, i + 1 < changes.length ? changes[i + 1][0] : shown.to_s, name]);
  const during = (list, t) => list.find(([from, to]) => t >= from && t < to);

  // States behind a panel, events as lines.
  function underlay(canvas, area, graph) {
    for (const [from, to, name] of spans(shown.states)) {
      const left = Math.max(area.x, graph.toDomXCoord(from)), right = Math.min(area.x + area.w, graph.toDomXCoord(to));
      if (right > left && STATES[name]) {
        canvas.fillStyle = STATES[name];
        canvas.fillRect(left, area.y, right - left, area.h);
      }
    }
    canvas.fillStyle = "#777";
    for (const [at] of shown.events) {
      const x = graph.toDomXCoord(at);
      if (x >= area.x && x <= area.x + area.w) {
        for (let y = area.y; y < area.y + area.h; y += 6) { canvas.fillRect(x, y, 1, 2); }
      }
    }
  }

  function lanes() {
    const faults = spans(shown.faults).filter(([, , name]) => name !== "NONE");
    return [["state", spans(shown.states), "#ffffff00"], ...(faults.length ? [["fault", faults, "#c62828"]] : []),
            ...Object.entries(shown.limits).filter(([, list]) => list.length).map(([name, list]) => [name, list, "#e08a00"]),
            ["event", shown.events.map(([at], i) => [at, at, String(i + 1)]), "#555"]];
  }

  function drawLanes(canvas, area, graph, all) {
    underlay(canvas, area, graph);
    canvas.font = "11px sans-serif";
    all.forEach(([name, list, color], lane) => {
      const y = area.y + lane * LANE;
      let free = -Infinity;
      for (const [from, to, text] of list) {
        const left = Math.max(area.x, graph.toDomXCoord(from)), right = Math.min(area.x + area.w, graph.toDomXCoord(to));
        if (right < area.x || left > area.x + area.w || right < left) { continue; }
        canvas.fillStyle = color;
        if (to > from) { canvas.fillRect(left, y + 3, Math.max(1, right - left), LANE - 6); }
        const width = text ? canvas.measureText(text).width : 0;
        if (text && left > free && (to === from || right - left > width + 6)) {
          canvas.fillStyle = name === "fault" ? "#fff" : "#333";
          canvas.fillText(text, left + 3, y + LANE - 5);
          free = left + width + 4;
        }
      }
    });
  }

  function tell(t) {
    const state = during(spans(shown.states), t), fault = during(spans(shown.faults), t);
    const why = Object.entries(shown.limits).filter(([, list]) => during(list, t)).map(([name]) => name);
    moment.textContent = time(t) + (state ? ", " + state[2] : "") + (fault && fault[2] !== "NONE" ? ", fault " + fault[2] : "")
      + (why.length ? ", limited by " + why.join(", ") : "");
  }

  function show(from, to) {
    view = [Math.max(shown.from_s, from), Math.min(shown.to_s, to)];
    for (const { graph, lines } of graphs) {
      graph.updateOptions({ dateWindow: view, ...(lines ? { file: rows(lines, ...view) } : {}) });
    }
  }

  function showAll() {
    for (const { graph, lines } of graphs) {
      if (lines) { graph.updateOptions({ valueRange: null }, true); }
    }
    show(shown.from_s, shown.to_s);
  }

  function hover(event, t, points, row, graph) {
    tell(t);
    for (const other of graphs) {
      if (other.graph !== graph && other.lines && graph.lines) { other.graph.setSelection(row); }
    }
  }

  function legend(data) {
    const text = (value) => value.replace(/[&<>]/g, (c) => ({ "&": "&amp;", "<": "&lt;", ">": "&gt;" })[c]);
    return data.series.map((one) => `<b style="color:${one.color}">${text(one.label)}${one.y === undefined || Number.isNaN(one.y)
      ? "" : " " + Number(one.y.toPrecision(5))}</b>`).join("");
  }

  function graphOf(panel, data, options) {
    const graph = new Dygraph(panel, data, {
      dateWindow: view, xRangePad: 0, legend: "always", legendFormatter: legend, highlightCircleSize: 2,
      zoomCallback: (from, to) => show(from, to), highlightCallback: (e, t, points, row) => hover(e, t, points, row, graph),
      interactionModel: { ...Dygraph.defaultInteractionModel, dblclick: showAll },
      ...options,
      axes: { x: { drawAxis: true, valueFormatter: time, axisLabelFormatter: (t) => Number(t.toFixed(5)) + " s" }, ...options.axes } });
    return graph;
  }

  function addLanes() {
    const all = lanes(), panel = document.createElement("div");
    panel.className = "panel";
    panel.style.height = all.length * LANE + 22 + "px";
    place.append(panel);
    const ticks = all.map(([name], i) => ({ v: all.length - i - 0.5, label: name }));
    const graph = graphOf(panel, [[shown.from_s, 0], [shown.to_s, 0]], {
      labels: ["s", "lane"], legend: "never", valueRange: [0, all.length], strokeWidth: 0, highlightCircleSize: 0,
      underlayCallback: (canvas, area, g) => drawLanes(canvas, area, g, all),
      ylabel: " ", axes: { y: { axisLabelWidth: LABELS, axisLabelFontSize: 11, ticker: () => ticks, drawGrid: false } } });
    panel.addEventListener("mousemove", (event) => tell(graph.toDataXCoord(event.clientX - panel.getBoundingClientRect().left)));
    graphs.push({ graph, lines: null });
  }

  function addPanel({ title, unit, lines }) {
    const panel = document.createElement("div"), names = document.createElement("div");
    panel.className = lines.length === 1 ? "panel low" : "panel";
    names.className = "legend";
    place.append(names, panel);
    const series = Object.fromEntries(lines.map(({ name, style }) => [name, {
      strokeWidth: style === "thin" ? 0.7 : 1.3, strokePattern: style === "dashed" ? [5, 3] : null }]));
    const graph = graphOf(panel, rows(lines, ...view), {
      labels: ["s", ...lines.map(({ name }) => name)], colors: lines.map(({ color }) => color), series, labelsDiv: names,
      underlayCallback: underlay, ylabel: `${title} [${unit}]`,
      axes: { y: { axisLabelWidth: LABELS, pixelsPerLabel: 25, axisLabelFormatter: (v) => String(Number(v.toPrecision(6))) } } });
    graph.lines = lines;
    graphs.push({ graph, lines });
  }

  async function open(number) {
    graphs.forEach(({ graph }) => graph.destroy());
    graphs = [];
    shown = await decoded(pictures[number]);
    view = [shown.from_s, shown.to_s];
    document.getElementById("title").textContent = "Curves: " + shown.title;
    place.replaceChildren(moment);
    if (!shown.points) {
      moment.textContent = "nothing was recorded";
      return;
    }
    moment.textContent = "drag to zoom, shift and drag to move, double click for all; click on "
      + (pictures.length > 1 ? "a row of the table for its curves" : "an event below for its moment");
    addLanes();
    shown.panels.forEach(addPanel);
  }

  document.addEventListener("click", (event) => {
    const row = event.target.closest("tr[data-picture], tr[data-at]");
    if (!row) { return; }
    if (row.dataset.picture !== undefined && pictures[row.dataset.picture]) {
      document.querySelectorAll("tr.shown").forEach((other) => other.classList.remove("shown"));
      row.classList.add("shown");
      open(row.dataset.picture).then(() => document.getElementById("title").scrollIntoView());
    } else if (row.dataset.at !== undefined && graphs.length) {
      show(row.dataset.at - 0.05, Number(row.dataset.at) + 0.05);
      document.getElementById("title").scrollIntoView();
    }
  });

  const first = pictures.findIndex((picture) => picture);
  document.querySelector(`tr[data-picture="${first}"]`)?.classList.add("shown");
  await open(first);
})();
