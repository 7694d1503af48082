(() => {
  "use strict";
  const $ = (selector, within = document) => within.querySelector(selector);
  const $$ = (selector, within = document) => [...within.querySelectorAll(selector)];
  const root = document.documentElement;
  root.classList.add("js");
  const data = JSON.parse($("#data").textContent);

  // Numbers as the tables have them: four digits, by a power of ten where very small or large.
  const raised = { "-": "⁻", "+": "", 0: "⁰", 1: "¹", 2: "²", 3: "³", 4: "⁴", 5: "⁵", 6: "⁶", 7: "⁷", 8: "⁸", 9: "⁹" };
  function number(x, digits = 4) {
    if (x === null || !Number.isFinite(x)) return "–";
    const size = Math.abs(x);
    if (size !== 0 && (size < 1e-3 || size >= 1e6)) {
      const [mantissa, power] = x.toExponential(digits - 1).split("e");
      return `${mantissa}·10${[...power].map((c) => raised[c]).join("")}`.replace("-", "−");
    }
    const places = Math.max(0, digits - 1 - (size ? Math.floor(Math.log10(size)) : 0));
    const text = x.toFixed(places);
    return (text.includes(".") ? text.replace(/\.?0+$/, "") : text).replace("-", "−");
  }

  // A radio group's value by name.
  const chosen = (form, name) => new FormData(form).get(name);

  /* Theme */
  const themes = ["auto", "dark", "light"];
  $("#theme").addEventListener("click", (event) => {
    const next = themes[(themes.indexOf(root.dataset.theme || "auto") + 1) % themes.length];
    if (next === "auto") delete root.dataset.theme;
    else root.dataset.theme = next;
    event.currentTarget.textContent = `Theme: ${next}`;
  });

  /* Drawing on what is drawn */
  const SVG = "http://www.w3.org/2000/svg";
  function mark(parent, name, attributes) {
    const element = document.createElementNS(SVG, name);
    for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
    return parent.appendChild(element);
  }
  // What a figure is called and what is read out of it, as it is drawn now.
  function tell(svg, title, description) {
    svg.setAttribute("aria-label", title);
    const first = $("title", svg);
    first.textContent = title;
    let more = $("desc", svg);
    if (!more) {
      more = document.createElementNS(SVG, "desc");
      first.after(more);
    }
    more.textContent = description;
  }
  const numbers = (text) => text.split(" ").map((word) => (Number.isNaN(+word) ? word : +word));
  // From a value to its place on a scale, as the frame's attribute tells it.
  function placer(attribute) {
    const [low, high, spacing] = numbers(attribute);
    const of = { linear: (v) => v, log: Math.log10, root: Math.sqrt }[spacing];
    return (v) => (v === null || (spacing === "log" && v <= 0) ? null : (of(v) - of(low)) / (of(high) - of(low)));
  }
  const clamp = (v, low, high) => Math.min(high, Math.max(low, v));
  // Where a pointer stands in an SVG's own units.
  function within(svg, event) {
    const at = new DOMPoint(event.clientX, event.clientY).matrixTransform(svg.getScreenCTM().inverse());
    return [at.x, at.y];
  }
  function path(points) {
    let text = "";
    let pen = "M";
    for (const point of points) {
      if (!point) pen = "M";
      else {
        text += `${pen}${point[0].toFixed(2)} ${point[1].toFixed(2)}`;
        pen = "L";
      }
    }
    return text;
  }

  /* Lobes */
  if (data.lobes) {
    const lobes = data.lobes;
    const form = $("#lobe-controls");
    const frames = $("#lobe-frames");
    const readout = $("#lobe-readout");
    const state = () => ({
      slice: lobes.slices[+chosen(form, "incidence")],
      described: lobes.described[+chosen(form, "incidence")],
      incidence: lobes.incidences[+chosen(form, "incidence")],
      channel: +(chosen(form, "channel") ?? $("[data-channel]", frames).dataset.channel),
      log: chosen(form, "scale") === "log",
    });
    const shown = () => $$("[data-channel]", frames).find((f) => !f.hidden);

    function slicePlacer(svg) {
      const [left, top, width, height] = numbers(svg.dataset.area);
      const [x, y] = [placer(svg.dataset.x), placer(svg.dataset.y)];
      return (theta, value) => {
        const place = y(value);
        return place === null ? null : [left + x(theta) * width, top + (1 - clamp(place, 0, 1)) * height];
      };
    }
    function polarPlacer(svg) {
      const [cx, cy, radius] = numbers(svg.dataset.polar);
      const r = placer(svg.dataset.r);
      return (theta, value) => {
        if (value === null) return null;
        const length = clamp(r(value) ?? 0, 0, 1) * radius;
        const angle = (theta * Math.PI) / 180;
        return [cx + length * Math.sin(angle), cy - length * Math.cos(angle)];
      };
    }
    const placers = (frame) => $$("svg", frame).map((svg) => [svg, svg.dataset.polar ? polarPlacer(svg) : slicePlacer(svg)]);

    function draw() {
      const now = state();
      for (const frame of $$("[data-channel]", frames))
        frame.hidden = +frame.dataset.channel !== now.channel || (frame.dataset.log === "true") !== now.log;
      for (const [svg, at] of placers(shown())) {
        const series = $(".series", svg);
        series.replaceChildren();
        for (const curve of now.slice) {
          const values = curve.values[now.channel];
          const points = curve.theta.map((theta, k) => at(theta, values[k]));
          if (!curve.readings) {
            mark(series, "path", { class: curve.class, d: path(points) });
            continue;
          }
          if (curve.sigma && !svg.dataset.polar) {
            const bars = curve.theta.flatMap((theta, k) => {
              const [value, sigma] = [values[k], curve.sigma[now.channel][k]];
              return value === null || sigma === null ? [] : [null, at(theta, value - sigma), at(theta, value + sigma)];
            });
            mark(series, "path", { class: "error s0", d: path(bars) });
          }
          const size = svg.dataset.polar || points.length > 60 ? 1.8 : 2.6;
          for (const p of points) if (p) mark(series, "circle", { class: curve.class, cx: p[0], cy: p[1], r: size });
        }
        const arrow = $(".incident", svg);
        if (arrow) {
          const [cx, cy] = numbers(svg.dataset.polar);
          arrow.setAttribute("transform", `rotate(${-now.incidence} ${cx} ${cy})`);
        }
        const kind = svg.dataset.polar ? "Polar chart" : "BRDF over θo";
        tell(svg, `${kind}, θi = ${number(now.incidence)}°, channel ${lobes.channels[now.channel]}`, now.described[now.channel]);
      }
      if (reading !== null) read(reading);
    }

    // A curve's value at an angle, between its own ones.
    function valueAt(curve, channel, theta) {
      const k = curve.theta.findIndex((t) => t >= theta - 1e-9);
      const values = curve.values[channel];
      if (k < 0) return null;
      if (Math.abs(curve.theta[k] - theta) < 1e-6 || k === 0) return Math.abs(curve.theta[k] - theta) < 0.6 ? values[k] : null;
      if (curve.readings || values[k] === null || values[k - 1] === null) return null;
      const share = (theta - curve.theta[k - 1]) / (curve.theta[k] - curve.theta[k - 1]);
      return values[k - 1] + share * (values[k] - values[k - 1]);
    }

    let reading = null;
    function read(theta) {
      const { slice, channel } = state();
      const angles = slice[0].theta;
      theta = angles.reduce((best, t) => (Math.abs(t - theta) < Math.abs(best - theta) ? t : best), angles[0]);
      reading = theta;
      const said = slice.map((curve) => {
        const value = valueAt(curve, channel, theta);
        const k = curve.theta.indexOf(theta);
        const sigma = curve.sigma && k >= 0 ? ` ± ${number(curve.sigma[channel][k], 2)}` : "";
        return `${curve.name} ${number(value)}${value === null ? "" : sigma}`;
      });
      readout.textContent = `θo = ${number(theta)}°: ${said.join(", ")} [${lobes.unit}]`;
      for (const [svg, at] of placers(shown())) {
        $(".cursor", svg)?.remove();
        let d;
        if (svg.dataset.polar) {
          const [cx, cy, radius] = numbers(svg.dataset.polar);
          const angle = (theta * Math.PI) / 180;
          d = `M${cx} ${cy}L${cx + radius * Math.sin(angle)} ${cy - radius * Math.cos(angle)}`;
        } else {
          const [, top, , height] = numbers(svg.dataset.area);
          const x = at(theta, numbers(svg.dataset.y)[1])[0];
          d = `M${x} ${top}V${top + height}`;
        }
        mark(svg, "path", { class: "cursor", d });
      }
    }
    frames.addEventListener("pointermove", (event) => {
      const svg = event.target.closest("svg");
      if (!svg) return;
      const [x, y] = within(svg, event);
      if (svg.dataset.polar) {
        const [cx, cy] = numbers(svg.dataset.polar);
        read(clamp((Math.atan2(x - cx, cy - y) * 180) / Math.PI, -90, 90));
      } else {
        const [left, , width] = numbers(svg.dataset.area);
        const [low, high] = numbers(svg.dataset.x);
        read(low + clamp((x - left) / width, 0, 1) * (high - low));
      }
    });
    frames.addEventListener("keydown", (event) => {
      const step = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
      if (!step) return;
      event.preventDefault();
      const { slice, incidence } = state();
      const angles = slice[0].theta;
      const k = reading === null ? -1 : angles.indexOf(reading);
      read(k < 0 ? incidence : angles[clamp(k + step, 0, angles.length - 1)]);
    });
    form.addEventListener("change", draw);
    draw();
  }

  /* Residual maps */
  if (data.residuals.length) {
    const form = $("#residual-controls");
    const readout = $("#residual-readout");
    const bytes = (text) => Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
    const floats = (text) => new Float32Array(bytes(text).buffer);
    for (const fit of data.residuals)
      for (const map of Object.values(fit.maps)) for (const key of ["mean", "rms", "noise"]) map[key] = floats(map[key]);
    function show() {
      const statistic = chosen(form, "statistic");
      for (const figure of $$("[data-statistic]")) figure.hidden = figure.dataset.statistic !== statistic;
    }
    form.addEventListener("change", show);
    show();
    for (const figure of $$("[data-statistic]"))
      figure.addEventListener("pointermove", (event) => {
        const svg = $("svg", figure);
        const fit = data.residuals[+figure.parentElement.dataset.fit];
        const half = figure.dataset.over === "half";
        const map = fit.maps[figure.dataset.over];
        const [left, top, width, height] = numbers(svg.dataset.area);
        const [x, y] = within(svg, event);
        const [u, v] = [(x - left) / width, (top + height - y) / height];
        if (!(u >= 0 && u < 1 && v >= 0 && v < 1)) return;
        const ends = (list) => [list[0], list[list.length - 1]];
        const [[x0, x1], [y0, y1]] = [ends(map.x), ends(map.y)];
        const a = half ? x0 + u * u * (x1 - x0) : x0 + u * (x1 - x0);
        const b = y0 + v * (y1 - y0);
        const cell = (borders, value) => borders.findIndex((border) => border > value) - 1;
        const [i, j] = [cell(map.x, a), cell(map.y, b)];
        const k = j * (map.x.length - 1) + i;
        const names = half ? ["θh", "θd"] : ["θi", "θo"];
        const span = (list, n) => `${number(list[n], 3)}° to ${number(list[n + 1], 3)}°`;
        const unit = fit.unit ? ` ${fit.unit}` : "";
        const found = map.count[k]
          ? `mean ${number(map.mean[k])}${unit}, rms ${number(map.rms[k])}${unit}, mean over its error ${number(map.noise[k], 3)}, ${map.count[k]} values`
          : "no readings";
        readout.textContent = `${fit.label}, ${names[0]} ${span(map.x, i)}, ${names[1]} ${span(map.y, j)}: ${found}`;
      });
  }

  /* Pictures */
  async function inflated(text) {
    const packed = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
    const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate-raw"));
    return new Uint8Array(await new Response(stream).arrayBuffer());
  }
  // Half precision to numbers: low bytes first, then high ones.
  function halves(bytes) {
    const n = bytes.length / 2;
    const out = new Float32Array(n);
    for (let i = 0; i < n; i++) {
      const bits = bytes[i] | (bytes[n + i] << 8);
      const [sign, exponent, fraction] = [bits & 0x8000 ? -1 : 1, (bits >> 10) & 31, bits & 1023];
      out[i] =
        exponent === 31 ? NaN : sign * (exponent ? (1 + fraction / 1024) * 2 ** (exponent - 15) : fraction * 2 ** -24);
    }
    return out;
  }
  const LEVELS = 4096;
  const srgb = Uint8ClampedArray.from({ length: LEVELS + 1 }, (_, i) => {
    const x = i / LEVELS;
    return Math.round(255 * (x <= 0.0031308 ? 12.92 * x : 1.055 * x ** (1 / 2.4) - 0.055));
  });
  // Below this the curve is steep: the level is computed.
  const encode = (x) =>
    x >= 1 ? 255 : x > 0.02 ? srgb[Math.round(x * LEVELS)] : x <= 0.0031308 ? Math.max(0, 255 * 12.92 * x) : 255 * (1.055 * x ** (1 / 2.4) - 0.055);
  const DIVERGING = [
    [5, 48, 97], [33, 102, 172], [67, 147, 195], [146, 197, 222], [209, 229, 240], [247, 247, 247],
    [253, 219, 199], [244, 165, 130], [214, 96, 77], [178, 24, 43], [103, 0, 31],
  ];
  function diverging(t) {
    const at = clamp(t, 0, 1) * 10;
    const i = Math.min(9, Math.floor(at));
    return [0, 1, 2].map((c) => DIVERGING[i][c] + (at - i) * (DIVERGING[i + 1][c] - DIVERGING[i][c]));
  }
  const GREY = [150, 150, 150];

  async function viewer() {
    const { width, height, pictures, exposure, range, factor } = data.pictures;
    const pixels = await Promise.all(pictures.map(async (p) => halves(await inflated(p.pixels))));
    const [form, stage, readout] = [$("#viewer-controls"), $("#stage"), $("#pixel-readout")];
    const [slide, split, cross] = [$("#exposure"), $("#split"), $(".cross", stage)];
    const [a, b] = ["#canvas-a", "#canvas-b"].map((id) => $(id).getContext("2d"));
    const known = (...lists) => lists.every((list) => !Number.isNaN(list));

    function paint(context, color) {
      const image = context.createImageData(width, height);
      for (let i = 0; i < width * height; i++) {
        const [r, g, blue] = color(i);
        image.data.set([r, g, blue, 255], 4 * i);
      }
      context.putImageData(image, 0, 0);
    }
    const developed = (list, gain) => (i) =>
      Number.isNaN(list[3 * i]) ? GREY : [encode(gain * list[3 * i]), encode(gain * list[3 * i + 1]), encode(gain * list[3 * i + 2])];
    const luminance = (list, i) => 0.2126 * list[3 * i] + 0.7152 * list[3 * i + 1] + 0.0722 * list[3 * i + 2];
    const second = () => +chosen(form, "picture");

    function draw() {
      const [view, k, stops] = [chosen(form, "view"), second(), +slide.value];
      const gain = 2 ** (exposure + stops);
      stage.dataset.view = view;
      $("#split-label").hidden = view !== "slider";
      paint(a, developed(pixels[0], gain));
      if (view === "difference") {
        const most = range * 2 ** -stops;
        paint(b, (i) => {
          const difference = luminance(pixels[k], i) - luminance(pixels[0], i);
          return known(difference) ? diverging(0.5 + (0.5 * difference) / most) : GREY;
        });
      } else paint(b, developed(pixels[k], gain));
      const name = view === "difference" ? `${pictures[k].label} less ${pictures[0].label}` : pictures[k].label;
      $("#tag-b").textContent = name;
      $("#canvas-b").setAttribute("aria-label", name);
      const sign = stops > 0 ? "+" : stops < 0 ? "−" : "±";
      $("#exposure-value").textContent = `${sign}${Math.abs(stops)} stops`;
      if (at) read(...at);
    }

    let at = null;
    function read(x, y) {
      at = [clamp(x, 0, width - 1), clamp(y, 0, height - 1)];
      const [k, i] = [second(), at[1] * width + at[0]];
      const rgb = (list) => [0, 1, 2].map((c) => list[3 * i + c]);
      const [reference, other] = [rgb(pixels[0]), rgb(pixels[k])];
      const list = (values) => values.map((v) => number(v)).join(" ");
      const place = factor === 1 ? `pixel (${at[0]}, ${at[1]})` : `pixels from (${at[0] * factor}, ${at[1] * factor})`;
      readout.textContent = known(...reference, ...other)
        ? `${place}: ${pictures[0].label} ${list(reference)}, ${pictures[k].label} ${list(other)}, difference ${list(other.map((v, c) => v - reference[c]))} [W/(sr·m²)]`
        : `${place}: not measured`;
      const canvas = $("#canvas-a");
      cross.hidden = false;
      cross.style.left = `${((at[0] + 0.5) / width) * canvas.clientWidth}px`;
      cross.style.top = `${((at[1] + 0.5) / height) * canvas.clientHeight}px`;
    }
    stage.addEventListener("pointermove", (event) => {
      const canvas = event.target.closest(".half") ? $("canvas", event.target.closest(".half")) : $("#canvas-a");
      const box = canvas.getBoundingClientRect();
      const [u, v] = [(event.clientX - box.left) / box.width, (event.clientY - box.top) / box.height];
      if (event.buttons && stage.dataset.view === "slider") divide(100 * u);
      read(Math.floor(u * width), Math.floor(v * height));
    });
    stage.addEventListener("keydown", (event) => {
      const step = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[event.key];
      if (!step) return;
      event.preventDefault();
      const far = event.shiftKey ? 10 : 1;
      const [x, y] = at ?? [Math.floor(width / 2), Math.floor(height / 2)];
      read(x + far * step[0], y + far * step[1]);
    });
    function divide(share) {
      split.value = clamp(share, 0, 100);
      stage.style.setProperty("--split", `${split.value}%`);
    }
    split.addEventListener("input", () => divide(+split.value));
    slide.addEventListener("input", draw);
    form.addEventListener("change", draw);
    form.addEventListener("submit", (event) => event.preventDefault());
    draw();
    $("#viewer").dataset.ready = "true";
  }
  if (data.pictures && $("#viewer")) {
    viewer().catch(() => {
      // Without the means to unpack them the still pictures stay.
      $("#viewer").remove();
      for (const still of $$(".still")) still.classList.remove("still");
    });
  }
})();
