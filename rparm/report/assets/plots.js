'use strict';
// The plots of a page, and one cursor for all of them and for the player. Load compare.js before.
//
// The page has the data in <script type="application/json" id="run"> and an empty
// <figure class="plot"> for each plot. Arrays of numbers are {"array": index} into "arrays", which
// holds doubles (f8) or floats (f4) in base64, little-endian.

const Plots = (() => {
  const FEW = 40; // rows; up to here each one gets a marker
  const DASHES = [[], [6, 4], [2, 3], [7, 3, 2, 3], [4, 4]]; // px, drawn and left out; last: dashed above a curve
  const COLOURS = 6;

  /** Data of the page, with arrays unpacked. */
  function read(text) {
    const arrays = JSON.parse(text).arrays.map(decode);
    return JSON.parse(text, (_, value) => (value && value.array !== undefined ? arrays[value.array] : value));
  }

  function decode({ f8, f4 }) {
    const bytes = Uint8Array.from(atob(f8 ?? f4), (c) => c.charCodeAt(0));
    const numbers = f8 === undefined ? new Float32Array(bytes.buffer) : new Float64Array(bytes.buffer);
    // a float reads as the shortest number that it stands for, not with the digits of a double
    return Array.from(numbers, f8 === undefined ? (x) => Number(x.toPrecision(7)) : undefined);
  }

  /** Index of the number in `sorted` (ascending or descending) that is nearest to `x`. */
  function nearest(sorted, x) {
    const sign = sorted[sorted.length - 1] >= sorted[0] ? 1 : -1;
    let low = 0;
    let high = sorted.length - 1;
    while (high - low > 1) {
      const middle = (low + high) >> 1;
      if (sign * sorted[middle] <= sign * x) low = middle;
      else high = middle;
    }
    return Math.abs(sorted[high] - x) < Math.abs(x - sorted[low]) ? high : low;
  }

  /** At most so many digits, as short as they get. */
  function shown(number, digits = 9) {
    if (!Number.isFinite(number)) return '–';
    const rounded = Number(number.toPrecision(digits));
    const tiny = rounded !== 0 && Math.abs(rounded) < 1e-4;
    return minus(tiny ? rounded.toExponential() : String(rounded));
  }

  const PREFIXES = {'-12': 'p', '-9': 'n', '-6': '\u00b5', '-3': 'm', 0: '', 3: 'k', 6: 'M', 9: 'G'};
  // a unit that begins with a symbol to the first power, which takes a prefix
  const PREFIXED = /^(m|s|rad|N|J|W|V|A|Hz|Pa|H)(?![\p{L}\u00b2\u00b3])/u;

  /** A unit for values of this size: its text, and what it is in the unit, 0.001 for mm in m. */
  function scaled(unit, values) {
    const largest = values.reduce((most, x) => (Math.abs(x) > most ? Math.abs(x) : most), 0);
    if (!PREFIXED.test(unit) || !(largest > 1e-12) || (largest >= 0.1 && largest < 1e4)) {
      return { unit, factor: 1 };
    }
    const power = 3 * Math.floor((Math.log10(largest) + 1 + 1e-9) / 3);
    const exponent = Math.max(-12, Math.min(9, power));
    return { unit: PREFIXES[exponent] + unit, factor: Number(`1e${exponent}`) };
  }

  /** A text with minus signs before its digits, as the axes have them. */
  function minus(text) {
    return text.replace(/(?<![\w.-])-(?=\d)|(?<=\de)-(?=\d)/g, '\u2212');
  }

  function colours() {
    const style = getComputedStyle(document.documentElement);
    const named = (name) => style.getPropertyValue(`--${name}`).trim();
    return {
      ink: named('ink'),
      paper: named('paper'),
      grid: named('grid'),
      reference: named('reference'),
      curves: Array.from({ length: COLOURS }, (_, i) => named(`curve${i + 1}`)),
    };
  }

  /** Colour and dashes of a curve. */
  function styleOf(curve, i, palette) {
    if (curve.limit) return { colour: palette.ink, dashes: DASHES[1] };
    return { colour: palette.curves[i % COLOURS], dashes: DASHES[Math.floor(i / COLOURS) % 4] };
  }

  const isCompared = (plot) => plot.curves.some((curve) => curve.other);
  const divided = (values, factor) => (factor === 1 ? values : Array.from(values, (value) => value / factor));

  /** Units of a plot and of its differences, by the sizes of what is drawn. */
  function unitsOf(plot) {
    const drawn = plot.curves.flatMap(({ values, reference, other }) => [values, reference ?? [], other ?? []]);
    const left = plot.curves.flatMap(({ difference }) => difference ?? []);
    return {
      own: plot.log ? { unit: plot.unit, factor: 1 } : scaled(plot.unit, drawn.flatMap((x) => Array.from(x))),
      difference: scaled(plot.unit, left),
    };
  }

  /** A thin dashed line above the curves. */
  const above = (x, y, colour, more = {}) => ({
    x, y, mode: 'lines', line: { color: colour, width: 1.3, dash: '4px,4px', simplify: false }, ...more,
  });

  /** Traces of plotly: measured points below, curves, references and another result dashed on top. */
  function traces(plot, x, palette, units) {
    const mode = x.length <= FEW ? 'lines+markers' : 'lines';
    const { factor } = units.own;
    const references = plot.curves
      .filter((curve) => curve.reference)
      .map((curve) => above(x, divided(curve.reference, factor), palette.ink));
    const others = plot.curves.flatMap((curve, i) => (curve.other ? [
      above(x, divided(curve.other, factor), otherColour(plot, i, palette)),
      {
        x,
        y: divided(curve.difference, units.difference.factor),
        yaxis: 'y2',
        mode,
        line: { color: styleOf(curve, i, palette).colour, width: 1.3, simplify: false },
        marker: { size: 4 },
      },
    ] : []));
    const levels = (plot.levels ?? []).map((level) => ({
      x: [x[0], x[x.length - 1]],
      y: [level.value, level.value],
      mode: 'lines',
      line: { color: palette.ink, width: 1, dash: 'dash' },
    }));
    // a logarithmic axis has no 0: a gap; a point between two gaps is seen by its marker
    const drawn = (values) => (plot.log ? values.map((value) => (value > 0 ? value : null)) : values);
    const alone = (values) => values.map((value, i) => {
      const beside = values[i - 1] ?? values[i + 1] ?? null;
      return value !== null && beside === null ? 5 : 0;
    });
    const order = plot.curves.map((_, i) => i);
    order.sort((a, b) => Number(plot.curves[b].points) - Number(plot.curves[a].points) || a - b);
    const curves = order.map((i) => {
      const curve = plot.curves[i];
      const { colour, dashes } = styleOf(curve, i, palette);
      const y = drawn(divided(curve.values, factor));
      if (curve.points) return { x, y, mode: 'markers', marker: { size: 4, color: colour } };
      const points = x.length > FEW && plot.log ? alone(y) : [];
      return {
        x,
        y,
        mode: points.some(Boolean) ? 'lines+markers' : mode,
        line: {
          color: colour,
          width: curve.limit ? 1 : 1.6,
          simplify: false,
          shape: curve.steps ? 'vh' : 'linear',
          dash: dashes.map((length) => `${length}px`).join() || 'solid',
        },
        marker: { size: points.some(Boolean) ? points : 5 },
      };
    });
    return [...levels, ...curves, ...references, ...others];
  }

  function layout(plot, axis, palette, units) {
    const lines = { gridcolor: palette.grid, zerolinecolor: palette.grid, linecolor: palette.grid };
    const ordinate = (text, more) => ({
      ...lines, exponentformat: 'power', title: { text, standoff: 6, font: { size: 12 } }, ...more,
    });
    const compared = isCompared(plot);
    return {
      margin: { l: 62, r: 12, t: 10, b: 38 },
      showlegend: false,
      hovermode: false,
      separators: '.\u202f', // decimal point, and a narrow space between thousands
      // on a touch screen a finger on a plot scrolls the page
      dragmode: matchMedia('(pointer: coarse)').matches ? false : 'zoom',
      font: { color: palette.ink, size: 12 },
      paper_bgcolor: palette.paper,
      plot_bgcolor: palette.paper,
      modebar: { bgcolor: palette.paper, color: palette.reference, activecolor: palette.ink },
      xaxis: {
        ...lines,
        title: { text: axis.unit ? `${axis.title} (${axis.unit})` : axis.title, standoff: 4 },
        type: axis.log ? 'log' : 'linear',
        autorange: axis.reversed ? 'reversed' : true,
        exponentformat: axis.log ? 'power' : 'none', // a late time keeps its digits
        anchor: compared ? 'y2' : 'y',
      },
      yaxis: ordinate(minus(units.own.unit), {
        type: plot.log ? 'log' : 'linear', nticks: 6, domain: [compared ? 0.42 : 0, 1],
      }),
      ...(compared && { yaxis2: ordinate(`\u0394 ${units.difference.unit}`, { nticks: 4, domain: [0, 0.32] }) }),
    };
  }

  const CONFIG = {
    displaylogo: false,
    showTips: false,
    responsive: true,
    modeBarButtonsToRemove: ['select2d', 'lasso2d', 'autoScale2d'],
  };

  /** Colour of another result: its curve's, or another one where there is only one curve. */
  function otherColour(plot, i, palette) {
    return palette.curves[plot.curves.length > 1 ? i % COLOURS : 1];
  }

  /** Lines of a plot's legend: name, style, and whose values they are. */
  function entries(plot, palette, other) {
    const found = plot.curves.map((curve, i) => (
      { name: curve.name, ...styleOf(curve, i, palette), points: curve.points }));
    // one line for all: the references are dark, the others have the colours of their curves
    const dashed = (name, colour) => found.push({ name, colour, dashes: DASHES[4] });
    if (plot.curves.some((curve) => curve.reference)) dashed('reference', palette.ink);
    const first = plot.curves.findIndex((curve) => curve.other);
    if (first >= 0) dashed(other, otherColour(plot, first, palette));
    const levels = (plot.levels ?? []).map(({ name }) => ({ name, colour: palette.ink, dashes: DASHES[1] }));
    return [...found, ...levels];
  }

  function legend(list, plot, palette, other) {
    const found = entries(plot, palette, other);
    // one curve that has the plot's title needs no legend
    const shown = found.length === 1 && found[0].name === plot.title ? [] : found;
    list.replaceChildren(...shown.map((entry) => {
      const item = document.createElement('li');
      item.append(swatch(entry), minus(entry.name));
      return item;
    }));
  }

  /** A piece of a line as the plot has it. */
  function swatch({ colour, dashes = [], points = false }) {
    const picture = document.createElementNS('http://www.w3.org/2000/svg', 'svg');
    picture.setAttribute('class', 'swatch');
    picture.setAttribute('viewBox', '0 0 22 6');
    picture.setAttribute('aria-hidden', 'true');
    const line = document.createElementNS(picture.namespaceURI, 'path');
    line.setAttribute('d', 'M0 3H22');
    if (points) line.setAttribute('stroke-linecap', 'round');
    line.setAttribute('stroke', colour);
    line.setAttribute('stroke-dasharray', points ? '0.1 7' : dashes.join(' '));
    line.setAttribute('stroke-width', dashes === DASHES[4] ? 1.5 : 3);
    picture.append(line);
    return picture;
  }

  /** One plot: the figure, its drawing, its line at the cursor. */
  class Plot {
    constructor(figure, plot, data) {
      this.figure = figure;
      this.plot = plot;
      this.data = data;
      this.x = data.time;
      this.axis = data.axis;
      this.drawing = figure.querySelector('.drawing');
      if (plot.log && plot.curves.some(({ values }) => values.includes(0))) {
        const note = document.createElement('p');
        note.className = 'muted note';
        note.textContent = 'This axis has no place for 0: a line has a gap where its value is 0.';
        figure.querySelector('figcaption').after(note);
      }
      this.line = document.createElement('div');
      this.line.className = 'cursor';
      this.line.hidden = true;
      this.restyle();
    }

    restyle() {
      this.palette = colours();
      this.units = unitsOf(this.plot);
      legend(this.figure.querySelector('.values'), this.plot, this.palette, this.data.other && Compare.label(this.data.other));
      this.figure.classList.toggle('compared', isCompared(this.plot));
    }

    async draw(plotly) {
      const { plot, palette, units } = this;
      const parts = [traces(plot, this.x, palette, units), layout(plot, this.axis, palette, units)];
      await plotly.react(this.drawing, ...parts, CONFIG);
      this.drawing.append(this.line);
      this.place();
    }

    /** Abscissa at a point of the screen; undefined beside the plot. */
    at(event) {
      const { xaxis } = this.drawing._fullLayout;
      const pixel = event.clientX - this.drawing.getBoundingClientRect().left - xaxis._offset;
      return pixel >= 0 && pixel <= xaxis._length ? xaxis.p2d(pixel) : undefined;
    }

    show(row) {
      this.row = row;
      this.place();
    }

    place() {
      const full = this.drawing._fullLayout;
      if (!full || this.row === undefined) return;
      const pixel = full.xaxis.d2p(this.x[this.row]);
      const { _offset: top } = full.yaxis;
      const last = full.yaxis2 ?? full.yaxis;
      this.line.hidden = !(pixel >= 0 && pixel <= full.xaxis._length);
      this.line.style.left = `${full.xaxis._offset + pixel}px`;
      this.line.style.top = `${top}px`;
      this.line.style.height = `${last._offset + last._length - top}px`;
    }
  }

  /** All values at the cursor, each once, in a list. */
  class Readout {
    constructor(list, plots, other) {
      this.values = [];
      const seen = new Map(); // values by names: of a variable once, of runs that share a name each
      const all = plots.flatMap(({ plot }) => plot.curves.map(({ name }) => name));
      const isShared = (name) => all.indexOf(name) !== all.lastIndexOf(name);
      list.replaceChildren();
      for (const { plot, palette, units } of plots) {
        const names = plot.curves.map(({ name }) => name);
        const title = document.createElement('li');
        title.className = 'group';
        title.textContent = plot.title;
        if ((names.length > 1 || isShared(names[0])) && names.join(', ') !== plot.title) list.append(title);
        plot.curves.forEach((curve, i) => {
          const name = curve.points && curve.name === 'measured' ? `${plot.title} measured` : curve.name;
          const known = seen.get(name) ?? [];
          if (known.some((values) => values.every((value, row) => Object.is(value, curve.values[row])))) return;
          seen.set(name, [...known, curve.values]);
          const add = (text, values, { unit, factor }, style) => {
            const item = document.createElement('li');
            const label = document.createElement('span');
            const value = document.createElement('span');
            label.append(...(style ? [swatch(style)] : []), minus(text));
            item.className = style ? '' : 'also';
            item.append(label, ' ', value);
            list.append(item);
            this.values.push({ values, factor, value, unit: unit ? ` ${unit}` : '' });
            return value;
          };
          const own = add(name, curve.values, units.own, { ...styleOf(curve, i, palette), points: curve.points });
          own.dataset.curve = curve.name;
          own.dataset.factor = units.own.factor;
          if (curve.reference) add('reference', curve.reference, units.own);
          if (!curve.other) return;
          add(other, curve.other, units.own);
          add('difference', curve.difference, units.difference);
        });
        if (list.lastChild === title) title.remove();
      }
    }

    show(row) {
      for (const { values, factor, value, unit } of this.values) {
        // seven digits of what was recorded, in this unit
        const number = factor === 1 ? values[row] : Number((values[row] / factor).toPrecision(12));
        value.textContent = shown(number) + unit;
      }
    }
  }

  /** The cursor of a page: all plots, the panel, and the player where there is motion. */
  class Page {
    constructor(data) {
      this.data = data;
      this.x = data.time;
      const figures = document.querySelectorAll('figure.plot');
      this.plots = data.plots.map((plot, i) => new Plot(figures[i], plot, data));
      this.panel = document.querySelector('.panel');
      this.bar = this.panel.querySelector('input');
      this.output = this.panel.querySelector('output');
      this.addPlayer(document.getElementById('player'));
      if (!this.player) {
        this.bar.max = this.x.length - 1;
        this.bar.addEventListener('input', () => this.seek(Number(this.bar.value)));
      }
      this.addCompare(document.querySelector('.compare'));
      this.read();
      this.show(0);
    }

    /** The player has the page's slider; its values stand with those of the plots. */
    addPlayer(element) {
      if (!element) return;
      this.player = new Player(element, this.data.motion);
      this.bar = this.player.slider;
      this.bar.id = 'cursor';
      this.player.controls.querySelector('.player-clock').replaceWith(this.output);
      this.panel.querySelector('.cursor-bar').replaceWith(this.player.controls, this.player.list);
      this.panel.append(element.querySelector('.player-keys'));
      const names = this.data.plots.flatMap((plot) => plot.curves.map((curve) => curve.name));
      for (const item of this.player.list.children) {
        const own = item.dataset.name;
        const isDrawn = names.some((name) => name === own || name.endsWith(`.${own}`));
        item.hidden = isDrawn && !item.classList.contains('player-words');
      }
      element.addEventListener('time', (event) => {
        if (!this.seeking) this.show(nearest(this.x, event.detail.time));
      });
    }

    /** A file that is chosen or dropped is drawn over the run. */
    addCompare(element) {
      if (!element) return;
      this.notice = element.querySelector('[role=status]');
      this.input = element.querySelector('input');
      this.clear = element.querySelector('button');
      this.said();
      const take = async (file) => {
        try {
          this.lay(Compare.over(this.data, file.name, await file.text()));
        } catch (error) {
          if (!(error instanceof Compare.Refused)) throw error;
          this.say(`${file.name}: ${error.message}`, true);
        }
      };
      this.input.addEventListener('change', () => {
        if (this.input.files.length) take(this.input.files[0]);
        this.input.value = '';
      });
      this.clear.addEventListener('click', () => this.lay(Compare.alone(this.data)));
      const holds = (event) => event.dataTransfer?.types.includes('Files');
      document.addEventListener('dragover', (event) => {
        if (holds(event)) event.preventDefault();
      });
      document.addEventListener('drop', (event) => {
        if (!holds(event)) return;
        event.preventDefault();
        if (event.dataTransfer.files.length) take(event.dataTransfer.files[0]);
      });
    }

    /** Draw the page's data after a change of what it is compared with. */
    async lay(other) {
      this.data.other = other;
      this.said();
      await this.restyle(await plotlyReady);
    }

    say(text, isWrong = false) {
      this.notice.textContent = text;
      this.notice.classList.toggle('failed', isWrong);
    }

    said() {
      this.clear.hidden = !this.data.other;
      this.say(this.data.other ? Compare.described(this.data, scaled, shown) : '');
    }

    read() {
      this.readout = new Readout(this.panel.querySelector('.readout'), this.plots, this.data.other && Compare.label(this.data.other));
      if (this.row !== undefined) this.readout.show(this.row);
    }

    /** Move the cursor to a row, and the player with it. */
    seek(row) {
      this.show(row);
      if (!this.player) return;
      this.seeking = true;
      this.player.seek(this.x[row]);
      this.seeking = false;
    }

    show(row) {
      if (row === this.row) return;
      this.row = row;
      const { title, unit } = this.data.axis;
      const text = `${title} ${shown(this.x[row], 15)}${unit ? ` ${unit}` : ''}`;
      this.bar.value = row;
      this.bar.setAttribute('aria-valuetext', text);
      this.output.textContent = text;
      this.readout.show(row);
      for (const plot of this.plots) plot.show(row);
    }

    async draw() {
      const plotly = await plotlyReady;
      for (const plot of this.plots) {
        await plot.draw(plotly);
        this.listen(plotly, plot);
      }
      // what the library measures texts with is none for readers
      document.getElementById('js-plotly-tester')?.setAttribute('aria-hidden', 'true');
      const dark = matchMedia('(prefers-color-scheme: dark)');
      dark.addEventListener('change', () => this.restyle(plotly));
      document.documentElement.dataset.ready = 'yes';
    }

    listen(plotly, plot) {
      const seek = (event) => {
        const x = plot.at(event);
        if (x !== undefined) this.seek(nearest(this.x, x));
      };
      plot.drawing.addEventListener('click', seek);
      plot.drawing.addEventListener('mousemove', (event) => {
        // a running animation keeps the cursor
        if (!event.buttons && !this.player?.playing) seek(event);
      });
      plot.drawing.on('plotly_relayout', (change) => this.zoom(plotly, plot, change));
      plot.drawing.on('plotly_afterplot', () => plot.place());
    }

    /** All plots show the same part of the abscissa. */
    zoom(plotly, source, change) {
      if (this.zooming || !Object.keys(change).some((key) => key.startsWith('xaxis'))) return;
      const { xaxis } = source.drawing.layout;
      const update = change['xaxis.autorange']
        ? { 'xaxis.autorange': this.data.axis.reversed ? 'reversed' : true }
        : { 'xaxis.range': [...xaxis.range] };
      this.zooming = true;
      const others = this.plots.filter((plot) => plot !== source);
      Promise.all(others.map((plot) => plotly.relayout(plot.drawing, update))).finally(() => {
        this.zooming = false;
      });
    }

    async restyle(plotly) {
      for (const plot of this.plots) plot.restyle();
      this.read();
      for (const plot of this.plots) await plot.draw(plotly);
    }
  }

  /** Draw the plots of this page; gives the page's cursor. */
  function start() {
    const page = new Page(read(document.getElementById('run').textContent));
    page.ready = page.draw();
    return page;
  }

  return { start, read, nearest };
})();

const page = Plots.start();
