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
    if (size !== 0 && (size < 1e-3 || size >= 1e5)) return value.toExponential(3);
    return String(Number(value.toPrecision(6)));
  },
  hover(points) {
    const list = Array.isArray(points) ? points : [points];
    const box = document.createElement("div");
    const head = document.createElement("div");
    if (!list.length) return box;
    head.textContent = `t = ${quito.number(list[0].axisValue)}`;
    head.style.fontWeight = "600";
    box.append(head);
    const seen = new Set();
    for (const point of list) {
      if (point.seriesName.startsWith("~") || seen.has(point.seriesId)) continue;
      seen.add(point.seriesId);
      const row = document.createElement("div");
      const name = document.createElement("span");
      const value = document.createElement("span");
      const line = document.createElement("i");
      line.style.cssText = `display:inline-block;width:12px;border-top:2px solid ${point.color};margin-right:6px;vertical-align:middle`;
      name.textContent = point.seriesName;
      value.textContent = quito.number(point.value[1]);
      value.style.cssText = "float:right;margin-left:18px;font-family:var(--mono)";
      row.append(line, name, value);
      box.append(row);
    }
    return box;
  },
  // Zoom of the plots: by a band drawn with the pointer, and by buttons for who has none.
  chart() {
    const place = document.getElementById("plot");
    return place && window.getElement ? getElement(place.dataset.chart)?.chart : null;
  },
  zoom(factor) {
    const chart = quito.chart();
    const zoom = chart && chart.getOption().dataZoom[0];
    if (!zoom) return;
    const middle = (zoom.start + zoom.end) / 2;
    const half = factor ? Math.min(50, ((zoom.end - zoom.start) / 2) * factor) : 50;
    const start = Math.max(0, Math.min(100 - 2 * half, middle - half));
    chart.dispatchAction({ type: "dataZoom", start, end: start + 2 * half });
  },
  band(tries = 50) {
    const chart = quito.chart();
    if (!chart && tries) setTimeout(() => quito.band(tries - 1), 40);
    const key = "dataZoomSelect";
    chart?.dispatchAction({ type: "takeGlobalCursor", key, dataZoomSelectActive: true });
  },
};
window.quito = quito;
document.addEventListener("keydown", quito.hear, true);
