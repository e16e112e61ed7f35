"use strict";

/** An element of a name, a class and children, texts among them. */
const make = (name, className, ...children) => {
  const element = document.createElement(name);
  if (className) element.className = className;
  element.append(...children.filter((child) => child !== null && child !== undefined));
  return element;
};

/** A table of names and values. */
const pairs = (rows, chosen = -1) => make("table", "", make("tbody", "", ...rows.map(([name, value], row) => {
  const head = make("th", "", name);
  head.scope = "row";
  return make("tr", row === chosen ? "chosen" : "", head, make("td", "", value));
})));

/** A picture that is loaded when it comes into sight, sharp if enlarged. */
const picture = (path, caption) => {
  const image = make("img");
  image.loading = "lazy";
  image.alt = caption;
  image.addEventListener("load", () => image.classList.toggle("enlarged", image.naturalWidth < image.clientWidth));
  image.src = path;
  const link = make("a", "", image);
  link.href = path;
  return make("figure", "", link, make("figcaption", "", caption));
};

for (const section of document.querySelectorAll(".subject")) {
  const data = JSON.parse(section.querySelector("script.data").textContent);
  const panel = section.querySelector(".panel");
  const instruction = [...panel.childNodes];
  const select = section.querySelector("select.metric");
  const table = section.querySelector("table.sortable");
  let metric = Number(select.value);
  /** What is shown, and whether a click keeps it. */
  let shown = null;
  let kept = false;

  const fill = (id, executor) => {
    const point = data.points[id];
    const result = point?.results[executor];
    if (!result) {
      panel.replaceChildren(...instruction);
      return;
    }
    const parts = [];
    const name = [point.preset, point.default ? "default" : null].filter(Boolean).join(", ");
    parts.push(make("h4", "", name || id));
    parts.push(make("p", "muted", [name ? id : null, executor, point.arithmetic, kept ? "kept; Escape lets go" : null]
      .filter(Boolean).join(" · ")));
    const better = result.better[metric];
    if (result.front.includes(metric)) {
      parts.push(make("p", "", make("span", "badge good", "best for its time")));
    } else if (better) {
      const link = make("a", "to-point", data.points[better[0]]?.preset ?? better[0]);
      link.href = "#";
      link.dataset.point = better[0];
      link.dataset.executor = executor;
      parts.push(make("p", "", make("span", "badge bad", "dominated"), " by ", link, `: ${better[1]}`));
    }
    if (result.picture || result.difference) {
      parts.push(make("div", "pictures",
        result.picture ? picture(result.picture, "The result") : null,
        result.difference ? picture(result.difference, "Its difference from the truth") : null));
    }
    parts.push(make("h5", "", "Settings"), pairs(point.settings));
    parts.push(make("h5", "", "Time, with quartiles"), make("p", "",
      make("strong", "", result.time ?? "not timed"), result.frames ? ` over ${result.frames} frames` : ""));
    for (const kind of ["Rounding", "Algorithm", "Model"]) {
      const rows = data.metrics.map(([of, name], place) => [of, name, result.errors[place], place])
        .filter(([of]) => of === kind);
      parts.push(make("h5", "", `Errors: ${kind.toLowerCase()}`));
      parts.push(rows.length === 0 ? make("p", "muted", "not measured")
        : pairs(rows.map(([, name, error]) => [name, error ?? "–"]), rows.findIndex((row) => row[3] === metric)));
    }
    parts.push(make("h5", "", "Memory and work of a frame"), pairs([["memory", point.bytes], ...point.work]));
    const others = data.executors.filter((other) => other in point.results);
    if (others.length > 1) {
      parts.push(make("h5", "", "On every executor"), pairs(
        others.map((other) => [other, `${point.results[other].short ?? "not timed"} · ${point.results[other].errors[metric] ?? "–"}`]),
        others.indexOf(executor)));
    }
    panel.replaceChildren(...parts);
  };

  const show = (id, executor) => {
    shown = id === null ? null : { id, executor };
    for (const one of section.querySelectorAll(".chosen")) one.classList.remove("chosen");
    if (shown) {
      const sameId = (element) => element.dataset.point === id;
      for (const point of section.querySelectorAll(".point")) point.classList.toggle("chosen", sameId(point));
      for (const row of section.querySelectorAll("tr[data-point]")) {
        row.classList.toggle("chosen", sameId(row) && row.dataset.executor === executor);
      }
    }
    fill(id, executor);
  };

  const keep = (id, executor) => {
    kept = true;
    show(id, executor);
  };

  // A chart answers for the point nearest to the pointer, as points are small.
  const operate = (figure) => {
    const executor = figure.dataset.executor;
    const svg = figure.querySelector("svg");
    const points = [...svg.querySelectorAll(".point")];
    for (const point of points) {
      point.addEventListener("pointerenter", () => { if (!kept) show(point.dataset.point, executor); });
      point.addEventListener("focus", () => { if (!kept) show(point.dataset.point, executor); });
      point.addEventListener("keydown", (event) => {
        if (event.key !== "Enter" && event.key !== " ") return;
        event.preventDefault();
        keep(point.dataset.point, executor);
      });
    }
    const nearest = (event) => {
      const box = svg.getBoundingClientRect();
      const scale = svg.viewBox.baseVal.width / box.width;
      const [x, y] = [(event.clientX - box.left) * scale, (event.clientY - box.top) * scale];
      let best = null;
      let least = 30;
      for (const point of points) {
        const distance = Math.hypot(point.cx.baseVal.value - x, point.cy.baseVal.value - y);
        if (distance < least) [best, least] = [point, distance];
      }
      return best;
    };
    svg.addEventListener("pointermove", (event) => {
      const point = kept ? null : nearest(event);
      if (point && shown?.id !== point.dataset.point) show(point.dataset.point, executor);
    });
    svg.addEventListener("click", (event) => {
      const point = event.target.closest(".point") ?? nearest(event);
      if (point) keep(point.dataset.point, executor);
      else kept = false;
    });
  };
  for (const figure of section.querySelectorAll("figure.chart")) operate(figure);

  const choose = (place) => {
    metric = place;
    const template = section.querySelector(`template[data-metric="${place}"]`);
    if (template) {
      const charts = template.content.cloneNode(true);
      for (const figure of charts.querySelectorAll("figure.chart")) operate(figure);
      template.replaceWith(charts);
    }
    for (const element of section.querySelectorAll(".charts, .standing .badge")) {
      element.classList.toggle("selected", Number(element.dataset.metric) === place);
    }
    if (shown) show(shown.id, shown.executor);
  };
  select.addEventListener("change", () => choose(Number(select.value)));
  choose(metric);

  section.addEventListener("click", (event) => {
    const link = event.target.closest(".to-point, tr[data-point]");
    if (!link) return;
    if (link.matches(".to-point")) event.preventDefault();
    keep(link.dataset.point, link.dataset.executor);
  });
  addEventListener("keydown", (event) => {
    if (event.key !== "Escape" || !shown) return;
    kept = false;
    show(null, null);
  });

  // Numbers by size, others by name, what is not there last; again the other way.
  const headings = [...table.tHead.rows[0].cells];
  const body = table.tBodies[0];
  const order = new Intl.Collator("en", { numeric: true });
  headings.forEach((heading, column) => {
    heading.querySelector("button").addEventListener("click", () => {
      const sign = heading.getAttribute("aria-sort") === "ascending" ? -1 : 1;
      for (const other of headings) other.removeAttribute("aria-sort");
      heading.setAttribute("aria-sort", sign > 0 ? "ascending" : "descending");
      const key = (row) => {
        const cell = row.cells[column];
        const shownText = cell.matches(".standing")
          ? [...cell.querySelectorAll(".selected")].map((badge) => badge.textContent).join() : cell.textContent;
        return { row, value: cell.dataset.value, text: shownText };
      };
      const keys = [...body.rows].map(key);
      const missing = ({ value, text }) => value === undefined && (text === "–" || text === "");
      keys.sort((a, b) => {
        if (missing(a) || missing(b)) return missing(a) - missing(b);
        if (a.value !== undefined && b.value !== undefined) return sign * (Number(a.value) - Number(b.value));
        return sign * order.compare(a.text, b.text);
      });
      body.append(...keys.map(({ row }) => row));
    });
  });

  const filter = section.querySelector(".of-executor");
  filter.addEventListener("change", () => {
    for (const row of body.rows) {
      row.classList.toggle("other-executor", filter.value !== "" && row.dataset.executor !== filter.value);
    }
  });
  const only = section.querySelector(".only-kept");
  only.addEventListener("change", () => table.classList.toggle("only-kept-shown", only.checked));
}

// Paper cannot be unfolded.
addEventListener("beforeprint", () => {
  for (const details of document.querySelectorAll("details")) details.open = true;
});

document.documentElement.dataset.ready = "true";
