// What the page does in the browser by itself: keeps the draft, hears the shortcuts, writes hovers.
// One object, so that the server can call it by name.

const quito = {
  KEY: "quito.draft",
  MOST: 400000, // characters; longer texts are refused by the server anyway
  about: {}, // name, place and settings of the draft, as the server last said them

  // The draft lives in the browser's own session too: neither a reload nor a server that was
  // restarted loses it. The text is read off the editor, so that what was typed last is in it.
  keep(about) {
    if (about) quito.about = about;
    const text = quito.text();
    if (text === null || text.length > quito.MOST || quito.about.name === undefined) return;
    const draft = JSON.stringify({ ...quito.about, text });
    if (draft !== quito.kept) {
      try {
        sessionStorage.setItem(quito.KEY, draft);
        quito.kept = draft;
      } catch (full) { /* the server has it all the same */ }
    }
  },
  text() {
    const editor = document.querySelector(".edit .nicegui-codemirror");
    const element = editor && window.getElement ? getElement(editor.id.slice(1)) : null;
    return element && element.editor ? element.editor.state.doc.toString() : null;
  },
  draft() {
    try {
      return JSON.parse(sessionStorage.getItem(quito.KEY));
    } catch (damaged) {
      return null;
    }
  },
  colours() {
    try {
      return localStorage.getItem("quito.colours");
    } catch (refused) {
      return null;
    }
  },
  colour(word) {
    try {
      localStorage.setItem("quito.colours", word);
    } catch (refused) { /* for this page, then */ }
  },
  restored() {
    let known = Quasar.Dark.isActive;
    const look = () => {
      if (Quasar.Dark.isActive === known) return;
      known = Quasar.Dark.isActive;
      emitEvent("quito-dark", known);
    };
    new MutationObserver(look).observe(document.body, { attributeFilter: ["class"] });
    setInterval(() => quito.keep(), 400);
    window.addEventListener("pagehide", () => quito.keep());
  },

  // Shortcuts. In the capturing phase: an editor would take Ctrl+Enter for a new line, and Tab for
  // an indent, from which no key leads on; Ctrl+] and Ctrl+[ indent.
  hear(event) {
    if (event.key === "Tab" && event.target.closest?.(".cm-editor")) event.stopPropagation();
    const open = document.querySelector(".q-dialog, .q-menu");
    if (event.key === "Enter" && (event.ctrlKey || event.metaKey) && !open) quito.click("run", event);
    if (event.key === "Escape" && !open) quito.click("cancel", event);
  },
  click(id, event) {
    const button = document.getElementById(id);
    if (!button || button.disabled) return;
    event.preventDefault();
    event.stopPropagation();
    button.click();
  },

  // Numbers and hovers of plots.
  number(value) {
    if (value === null || value === undefined || Number.isNaN(value)) return "–";
    const size = Math.abs(value);
    if (size !== 0 && (size < 1e-3 || size >= 1e5)) {
      return value.toExponential(3).replace(/\.?0+e/, "e");
    }
    return String(Number(value.toPrecision(6)));
  },
  // ECharts itself tells only of the lines that have a point just there.
  hover(points) {
    const box = document.createElement("div");
    const place = document.querySelector(".nicegui-echart:hover");
    const options = place && getElement(place.id.slice(1))?.options;
    const at = (Array.isArray(points) ? points[0] : points)?.axisValue;
    if (!options || at === undefined) return box;
    const head = document.createElement("div");
    head.textContent = `${options.xAxis.at(-1).name} = ${quito.number(at)}`;
    head.style.fontWeight = "600";
    box.append(head);
    for (const line of options.series) {
      const value = line.name.startsWith("~") ? null : quito.value(line.data, at);
      if (value !== null) box.append(quito.row(line.lineStyle, line.name, quito.number(value)));
    }
    for (const [style, said] of quito.near(place, options, at)) box.append(quito.row(style, said, ""));
    return box;
  },
  row(style, said, figure) {
    const row = document.createElement("div");
    const [mark, name, number] = ["i", "span", "span"].map((tag) => document.createElement(tag));
    mark.style.cssText = `display:inline-block;width:14px;border-top:2px ${style.type} ${style.color};margin-right:6px;vertical-align:middle`;
    number.style.cssText = "float:right;margin-left:18px;font-family:var(--mono)";
    name.textContent = said;
    number.textContent = figure;
    row.append(mark, name, number);
    return row;
  },
  // The switching times within a few pixels of `at`, each once, with the look of their marks.
  near(place, options, at) {
    const chart = getElement(place.id.slice(1)).chart;
    const x = (time) => chart.convertToPixel({ xAxisIndex: 0 }, time);
    const lines = options.series.flatMap((line) => (line.markLine ? [line.markLine] : []));
    const marks = lines.flatMap((line) => line.data.map((mark) => [line.lineStyle, mark]));
    const close = marks.filter(([, mark]) => Math.abs(x(mark.xAxis) - x(at)) <= 6);
    return [...new Map(close.map(([style, mark]) => [mark.name, [style, mark.name]])).values()];
  },
  // The value of a line at `at`, linear between its points; null where there is none.
  value(data, at) {
    let low = 0, high = data.length - 1;
    if (high < 0 || at < data[low][0] || at > data[high][0]) return null;
    while (high - low > 1) {
      const middle = (low + high) >> 1;
      if (data[middle][0] <= at) low = middle;
      else high = middle;
    }
    const [[a, x], [b, y]] = [data[low], data[high]];
    if (x === null || y === null) return b === at ? y : a === at ? x : null;
    return b > a ? x + ((y - x) * (at - a)) / (b - a) : y;
  },

  // Zoom of the plots: by a band drawn with the pointer, and by buttons for who has none.
  chart(id = "plot") {
    const place = document.getElementById(id);
    return place && window.getElement ? getElement(place.dataset.chart)?.chart : null;
  },
  zoom(id, factor) {
    const chart = quito.chart(id);
    const zoom = chart && chart.getOption().dataZoom[0];
    if (!zoom) return;
    const middle = (zoom.start + zoom.end) / 2;
    const half = factor ? Math.min(50, ((zoom.end - zoom.start) / 2) * factor) : 50;
    const start = Math.max(0, Math.min(100 - 2 * half, middle - half));
    chart.dispatchAction({ type: "dataZoom", start, end: start + 2 * half });
  },
  // A chart takes the pointer for a band from when it first comes there: it may be drawn late.
  band(event) {
    const place = event.target.closest?.("[data-chart]");
    const chart = place && quito.chart(place.id);
    if (!chart || place.banded === chart) return;
    place.banded = chart;
    const key = "dataZoomSelect";
    chart.dispatchAction({ type: "takeGlobalCursor", key, dataZoomSelectActive: true });
  },
};
window.quito = quito;
document.addEventListener("keydown", quito.hear, true);
document.addEventListener("pointerover", quito.band);
