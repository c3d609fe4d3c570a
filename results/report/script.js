"use strict";
(() => {
  const root = document.documentElement;
  const narrow = matchMedia("(max-width: 40rem)");
  const prefersDark = matchMedia("(prefers-color-scheme: dark)");
  const settings = { displaylogo: false, responsive: true };
  const tools = [["toImage"], ["zoom2d", "pan2d"], ["zoomIn2d", "zoomOut2d", "resetScale2d"]];
  const toolsInSpace = [["toImage"], ["zoom3d", "pan3d", "tableRotation"], ["resetCameraDefault3d"]];
  const drawn = new Set();
  let printing = false;

  // ---- light and dark
  let chosen = null; // by the reader; else the system's
  const dark = () => chosen ?? prefersDark.matches;
  const button = document.getElementById("tone");
  function dress(isDark) {
    root.dataset.tone = isDark ? "dark" : "light";
    button.setAttribute("aria-pressed", String(isDark));
    button.querySelector(".label").textContent = isDark ? "Light" : "Dark";
    button.setAttribute("aria-label", isDark ? "Use light colours" : "Use dark colours");
    button.removeAttribute("aria-pressed");
    for (const place of drawn) draw(place);
  }
  button.hidden = false;
  button.addEventListener("click", () => { chosen = !dark(); dress(dark()); });
  prefersDark.addEventListener("change", () => dress(dark()));

  // ---- charts: colours come by name, "@--single/0.2", from the style sheet
  function coloured(value) {
    if (typeof value === "string" && value.startsWith("@--")) {
      const [name, alpha] = value.slice(1).split("/");
      const hex = getComputedStyle(root).getPropertyValue(name).trim();
      const parts = [1, 3, 5].map((i) => parseInt(hex.slice(i, i + 2), 16));
      return `rgba(${parts.join(",")},${alpha})`;
    }
    if (Array.isArray(value)) return value.map(coloured);
    if (value && typeof value === "object")
      return Object.fromEntries(Object.entries(value).map(([key, part]) => [key, coloured(part)]));
    return value;
  }
  function themed(layout) {
    const css = getComputedStyle(root);
    const [page, ink, quiet, line] = ["--page", "--ink", "--quiet", "--line"].map((n) => css.getPropertyValue(n).trim());
    const look = { gridcolor: line, linecolor: quiet, zerolinecolor: quiet, tickcolor: quiet, automargin: true };
    const full = { ...layout, paper_bgcolor: page, plot_bgcolor: page, autosize: true, dragmode: layout.scene ? "turntable" : "zoom",
      font: { family: getComputedStyle(document.body).fontFamily, color: ink, size: 12.5 },
      hoverlabel: { bgcolor: css.getPropertyValue("--raised").trim(), bordercolor: quiet, font: { color: ink }, align: "left" } };
    for (const key of Object.keys(layout)) if (/^[xy]axis/.test(key)) full[key] = { ...look, ...layout[key] };
    if (layout.scene) {
      full.scene = { ...layout.scene };
      for (const key of ["xaxis", "yaxis", "zaxis"])
        full.scene[key] = { ...layout.scene[key], gridcolor: line, zerolinecolor: quiet, backgroundcolor: page, color: ink };
    }
    return full;
  }
  function legendLines(data, width) { // about as many as the plotting library will need
    const told = data.filter((trace) => trace.name && trace.showlegend !== false);
    const wide = told.map((trace) => 7.4 * trace.name.length + 54);
    const sum = wide.reduce((a, b) => a + b, 0);
    if (sum <= width) return 1;
    if (!told.some((trace) => trace.legendgroup)) return Math.ceil(wide.length / Math.max(1, Math.floor(width / Math.max(...wide))));
    let lines = 1, used = 0;
    for (const one of wide) { if (used && used + one > width) { lines += 1; used = 0; } used += one; }
    return lines;
  }
  function arranged({ data, layout, grid, gap = 0.08 }, width) {
    if (layout.scene) return layout;
    const panels = grid.flat();
    const stacked = narrow.matches && !printing && grid[0].length > 1;
    const rows = stacked ? panels.map((panel) => [panel]) : grid;
    const full = { ...layout, margin: { ...layout.margin }, grid: { rows: rows.length, columns: rows[0].length, subplots: rows, roworder: "top to bottom", xgap: gap, ygap: stacked ? 0.24 : 0.22 } };
    if (stacked) {
      full.height = 134 + 320 * panels.length - 77;
      full.margin = { l: 52, r: 6, t: 74, b: 60 };
      panels.forEach((_, i) => { // every panel is on its own below its neighbours
        const tail = i ? i + 1 : "", first = Math.floor(i / grid[0].length) * grid[0].length;
        full[`yaxis${tail}`] = { ...full[`yaxis${tail}`], title: full[`yaxis${first ? first + 1 : ""}`].title };
        if (i < panels.length - 1) full[`xaxis${tail}`] = { ...full[`xaxis${tail}`], title: { text: "" } };
      });
    }
    if (printing && grid.length > 1) { // two a page
      full.height = 420;
      full.margin.t = 62;
      full.margin.b = 50;
      full.grid.ygap = 0.4;
    }
    const high = data.some((trace) => trace.legendgroup) ? 29 : 20; // of a legend's line [px]
    const more = high * (legendLines(data, width - full.margin.l - full.margin.r) - 1);
    full.margin.t += more;
    full.height += more;
    return full;
  }
  function canTurn() {
    try { return !!document.createElement("canvas").getContext("webgl"); } catch { return false; }
  }
  function flat(chart) { // where nothing can be drawn in space: seen from above and from the side
    const pairs = [["x", "y"], ["x", "z"]];
    const data = chart.data.flatMap((trace) => pairs.map(([a, b], i) => {
      const { x, y, z, type, ...rest } = trace;
      const of = { x, y, z };
      return { ...rest, type: "scatter", x: of[a], y: of[b], xaxis: i ? "x2" : "x", yaxis: i ? "y2" : "y",
        showlegend: i === 0, legendgroup: trace.name, marker: { ...trace.marker, size: 5 }, line: { ...trace.line, width: 1.5 } };
    }));
    const layout = { height: 420, margin: { l: 56, r: 10, t: 60, b: 48 }, hovermode: "closest", legend: chart.layout.legend,
      xaxis: { title: { text: "x [mm]" } }, yaxis: { title: { text: "y [mm], from above" }, scaleanchor: "x" },
      xaxis2: { title: { text: "x [mm]" } }, yaxis2: { title: { text: "z [mm], from the side" }, scaleanchor: "x2" } };
    return { data, layout, grid: [["xy", "x2y2"]], gap: 0.18 };
  }
  function draw(place) {
    let chart = JSON.parse(document.querySelector(`script[data-of="${place.dataset.chart}"]`).textContent);
    if (chart.layout.scene && (printing || !canTurn())) chart = flat(chart); // nobody turns paper
    const layout = themed(arranged(chart, place.clientWidth));
    place.style.height = `${layout.height}px`;
    const done = Plotly.react(place, coloured(chart.data), coloured(layout),
      { ...settings, modeBarButtons: layout.scene ? toolsInSpace : tools });
    if (!drawn.has(place)) {
      drawn.add(place);
      done.then(() => place.on("plotly_click", (event) => {
        const told = event.points[0]?.customdata;
        if (Array.isArray(told) && typeof told[0] === "string" && told[0].split("/").length >= 3) show(told[0]);
      }));
    }
    return done;
  }
  const places = [...document.querySelectorAll(".plot")];
  const seen = new IntersectionObserver((entries) => {
    for (const entry of entries) if (entry.isIntersecting) { seen.unobserve(entry.target); draw(entry.target); }
  }, { rootMargin: "400px" });
  places.forEach((place) => seen.observe(place));
  narrow.addEventListener("change", () => drawn.forEach((place) => draw(place)));
  addEventListener("beforeprint", () => {
    printing = true;
    root.dataset.printing = ""; // gives charts the width of a page
    dress(false);
    places.filter((place) => place.offsetParent).forEach((place) => draw(place));
    drawn.forEach((place) => Plotly.Plots.resize(place));
  });
  addEventListener("afterprint", () => {
    printing = false;
    delete root.dataset.printing;
    dress(dark());
    drawn.forEach((place) => Plotly.Plots.resize(place));
  });

  // ---- one path of several
  document.getElementById("path-choice")?.addEventListener("change", (event) => {
    for (const path of document.querySelectorAll(".path")) path.hidden = path.dataset.path !== event.target.value;
    const place = document.querySelector(".path:not([hidden]) .plot");
    if (place) draw(place);
  });

  // ---- tables sort by a column
  const value = (cell) => {
    const text = cell.textContent.trim().replace(/^[–-]$/, "");
    const number = parseFloat(text.replace("\u2212", "-").replace(/[,*]/g, ""));
    return /^[-+\u2212.\d]/.test(text) && !Number.isNaN(number) ? number : text.toLowerCase();
  };
  function compare(a, b) {
    if (a === b) return 0;
    if (a === "") return 1;
    if (b === "") return -1;
    return typeof a === typeof b ? (a < b ? -1 : 1) : typeof a === "number" ? -1 : 1;
  }
  for (const table of document.querySelectorAll("table[data-sortable]")) {
    const heads = [...table.tHead.rows[0].cells];
    const lines = [...table.tBodies[0].rows];
    if (lines.length < 2) continue;
    heads.forEach((head, column) => {
      const by = document.createElement("button");
      by.type = "button";
      by.textContent = head.textContent;
      head.replaceChildren(by);
      by.addEventListener("click", () => {
        const before = head.getAttribute("aria-sort");
        heads.forEach((other) => other.removeAttribute("aria-sort"));
        const order = before === null ? "ascending" : before === "ascending" ? "descending" : null;
        if (order) head.setAttribute("aria-sort", order);
        const sign = order === "descending" ? -1 : 1;
        const sorted = order ? [...lines].sort((a, b) => sign * compare(value(a.cells[column]), value(b.cells[column]))) : lines;
        table.tBodies[0].append(...sorted);
      });
    });
  }

  // ---- a frame, with what was seen in it
  const dialog = document.getElementById("frame");
  const crops = new Map([...document.querySelectorAll(".crop")].map((crop) => [crop.dataset.frame, crop]));
  function show(frame) {
    if (!dialog) return;
    const crop = crops.get(frame);
    const view = dialog.querySelector(".view");
    const [key, localizer, pose] = [frame.split("/")[0], frame.split("/").slice(1, -1).join("/"), frame.split("/").at(-1)];
    dialog.querySelector(".layers").hidden = !crop;
    if (crop) {
      view.replaceChildren(crop.querySelector("svg").cloneNode(true));
      dialog.querySelector("h2").textContent = crop.querySelector(".error").textContent;
      dialog.querySelector(".about").textContent = crop.querySelector(".about").textContent;
      for (const box of dialog.querySelectorAll(".layers input")) box.parentElement.hidden = !view.querySelector(`.${box.value}`);
      layer();
    } else {
      view.replaceChildren();
      dialog.querySelector("h2").textContent = `${localizer}, pose ${pose}`;
      dialog.querySelector(".about").textContent = `No picture is kept of this frame; \u201ccampaign debug RUN ${key} ${pose}\u201d renders it again and draws it.`;
    }
    dialog.showModal();
  }
  function layer() {
    for (const box of dialog.querySelectorAll(".layers input"))
      for (const part of dialog.querySelectorAll(`.view .${box.value}`)) part.style.display = box.checked ? "" : "none";
  }
  crops.forEach((crop, frame) => crop.addEventListener("click", () => show(frame)));
  dialog?.addEventListener("change", layer);
  dialog?.addEventListener("click", (event) => { if (event.target === dialog) dialog.close(); });

  dress(dark());
})();
